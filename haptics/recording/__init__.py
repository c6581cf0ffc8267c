"""Recording: an append-only journal while a session runs, HDF5 with NeXus attributes when it ends, and views of it.

A stream is rows of one shape in time; this package knows rows, not devices. What a row means is for whoever declares the
stream; ``docs/reference/recording.md`` lists the streams that the views look for.
"""

from haptics.recording.hdf5 import Finalised, finalise, recover
from haptics.recording.journal import Journal, Stream
from haptics.recording.journal_reader import JournalContents, read_journal
from haptics.recording.recording import Recording, load
from haptics.recording.streams import StreamSpec
from haptics.recording.views.picture import write_picture
from haptics.recording.views.rrd import write_rrd

__all__ = [
    "Finalised",
    "Journal",
    "JournalContents",
    "Recording",
    "Stream",
    "StreamSpec",
    "finalise",
    "load",
    "read_journal",
    "recover",
    "write_picture",
    "write_rrd",
]

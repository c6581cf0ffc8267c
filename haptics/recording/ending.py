"""What a session that is broken off leaves: a recording marked incomplete, or at least its journal, and word of where it is."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haptics.ends import unbroken
from haptics.errors import HapticsError, InputError
from haptics.recording.hdf5 import Finalised, finalise, recover
from haptics.recording.journal import Journal
from haptics.recording.journal_reader import read_journal
from haptics.recording.leftovers import advice


def finish(journal: Journal, out: str | os.PathLike[str], force: bool, footer: Mapping[str, Any]) -> Finalised:
    """End a session well: its footer, and a recording of it in the journal's place. Signals wait until it is done.

    :param journal: the session's, still open.
    :param out: the recording to write (``.h5``).
    :param force: overwrite ``out`` if it exists.
    :param footer: plain JSON data: how the session ended.
    :return: what became of the journal.
    :raises InputError: see ``finalise``; :func:`keep` then reports what there is.
    :raises HapticsError: the disk is full or gone; :func:`keep` then reports what there is.
    :raises InputError, HapticsError: see ``finalise``; then, and for a signal, :func:`keep` says what there is.
    """
    with unbroken:
        journal.close(footer)
        made = finalise(journal.path, out, force=force)
        journal.recording = made.path
        return made


def keep(journal: Journal, out: str | os.PathLike[str], force: bool, error: BaseException) -> Finalised | None:
    """Make a recording of what a journal holds; ``error``, which ended the session, is given a note of where it is.

    Never raises for a disk that is full or gone: then the journal stays, if anything does. Signals wait until it is done.

    :param journal: the session's, open or closed.
    :param out: the recording to write (``.h5``).
    :param force: overwrite ``out`` if it exists.
    :param error: what ended the session; gets the note.
    :return: what was made here; None where nothing could be, or was before.
    """
    with unbroken:
        if journal.recording is not None:  # a signal that came while it was made
            error.add_note(f"the recording {journal.recording} is complete")
            return None
        made = None
        journal.raises = False
        journal.abandon()
        try:
            made = recover(journal.path, out, force=force)
            note = f"the recording {made.path} is {_how(made.complete)}: {made.damage}".removesuffix(": ")
            if made.journal_kept:
                note += f"; the journal {journal.path} is kept, {made.lost_bytes} bytes of it could not be used"
        except HapticsError as trouble:
            note = _left(journal.path, trouble)
        error.add_note(note)
        return made


def _left(path: Path, trouble: HapticsError) -> str:
    try:
        contents = read_journal(path)
    except InputError as error:
        return f"what was recorded is lost: {error}"
    where = f"what was recorded is in the journal {path}, {_how(contents.complete)}: no recording could be made of it ({trouble})"
    return f"{where}; when that is mended, or with --out and another place: {advice(path)}"


def _how(complete: bool) -> str:
    return "complete" if complete else "incomplete"

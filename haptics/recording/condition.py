"""In what condition a recording is: complete or not, what was lost, what is damaged."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from haptics.errors import InputError
from haptics.recording.hdf5_file import DamagedFile
from haptics.recording.journal_reader import read_journal
from haptics.recording.leftovers import advice, is_journal
from haptics.recording.lock import being_written
from haptics.recording.recording import load


@dataclass(frozen=True)
class Condition:
    """What is known of a file's condition.

    :ivar path: the file.
    :ivar kind: ``recording`` or ``journal``.
    :ivar complete: the session ended well and nothing is missing.
    :ivar lost_bytes: bytes of the journal that are in no recording; None: unknown, as the file is damaged.
    :ivar ended: how the session ended where it did not end well; else empty.
    :ivar damaged: places that are not as they were written; nothing of a damaged recording is used.
    :ivar verified: checksums confirm that what is there is what was written.
    :ivar rows: rows by stream; empty if the file is damaged.
    :ivar header: provenance, as the session wrote it; empty if it cannot be read.
    :ivar notes: what to do, and what else one has to know.
    """

    path: Path
    kind: str
    complete: bool
    lost_bytes: int | None
    ended: str
    damaged: list[str]
    verified: bool
    rows: dict[str, int] = field(default_factory=dict)
    header: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def condition_of(path: str | os.PathLike[str]) -> Condition:
    """Look at a recording or a journal.

    :param path: the file.
    :return: its condition.
    :raises InputError: it is neither, or cannot be read.
    """
    path = Path(path)
    if os.path.isdir(path):  # which raises nothing
        raise InputError(f"{path} is a folder; expected a recording (.h5 or .journal)")
    if is_journal(path):
        return _of_journal(path)
    try:
        recording = load(path)
        for name in recording.streams:
            recording.stream(name)
        for name in recording.blobs:
            recording.blob(name)
    except DamagedFile as error:
        note = "nothing of it is used; use a copy"
        return Condition(path, "recording", False, None, "", list(error.places), False, notes=(note,))
    return Condition(
        path,
        "recording",
        recording.complete,
        recording.lost_bytes,
        recording.damage,
        [],
        recording.verified,
        recording.counts,
        recording.header,
        recording.notes,
    )


def _of_journal(path: Path) -> Condition:
    contents = read_journal(path)
    writing = being_written(path)
    ended, damaged = "" if contents.footer is not None else "the session did not end well", []
    if contents.damage is not None:
        damaged.append(f"from byte {contents.damage.offset}: {contents.damage.why}")
    notes = "a session is writing it now" if writing else f"make a recording of it: {advice(path)}"
    rows = {name: contents.count(name) for name in contents.streams}
    return Condition(
        path,
        "journal",
        contents.complete,
        contents.dropped_bytes,
        "it goes on" if writing else ended,
        [] if writing else damaged,
        True,
        rows,
        contents.header or {},
        (notes,),
    )

"""Journals that a session left behind: the only copy of what happened, so named with what saves them and never overwritten."""

from __future__ import annotations

from pathlib import Path

from haptics.errors import InputError
from haptics.recording.journal_reader import read_journal
from haptics.recording.lock import being_written
from haptics.recording.output import refuse_existing, with_suffix
from haptics.recording.segments import MAGIC

SUFFIX = ".journal"


def journal_of(recording: Path) -> Path:
    """Where a session keeps its journal while it runs: beside the recording it will become.

    :param recording: the recording to be (``.h5``).
    :return: the journal (``.journal``).
    :raises InputError: ``recording`` names no file.
    """
    return with_suffix(recording, SUFFIX)


def advice(journal: Path) -> str:
    """The command that makes a recording of a journal.

    :param journal: the journal.
    :return: a line for a shell.
    """
    return f"haptics recording recover {journal}"


def refuse_leftover(path: Path, force: bool) -> None:
    """Refuse to begin a journal where a file is.

    :param path: where the journal is to be.
    :param force: a file that holds nothing may go.
    :raises InputError: there is a file, and if it is a journal, what saves it; or there is no folder.
    """
    refuse_existing(path, force=True)
    if not path.exists():
        return
    if being_written(path):
        raise InputError(f"{path}: another process is still writing this journal")
    if not is_journal(path):
        if not force or path.stat().st_size:
            raise InputError(f"{path} exists and is not a journal; choose another name for the recording")
        return
    if not _begun_and_no_more(path):
        raise InputError(
            f"{path} holds what an earlier session recorded, and is not overwritten, not even with --force; "
            f"save it first: {advice(path)}; then remove or rename it if it is still there"
        )
    if not force:
        raise InputError(f"{path} exists and holds nothing; remove it, choose another name or overwrite it (--force)")


def _begun_and_no_more(path: Path) -> bool:
    """Whether a journal holds nothing, as its writer died over its first bytes.

    Where those are damaged instead, what follows them may still be read.
    """
    contents = read_journal(path)
    return contents.header is None and (contents.damage is None or contents.damage.torn)


def leftovers(folder: Path) -> list[Path]:
    """Journals in a folder that no process is writing and that hold something.

    :param folder: where to look; not in folders within it.
    :return: their paths, sorted; none if the folder cannot be read.
    """
    try:
        found = sorted(path for path in folder.glob(f"*{SUFFIX}") if path.is_file() and is_journal(path))
        return [path for path in found if not being_written(path) and read_journal(path).header is not None]
    except (OSError, InputError):  # what cannot be read cannot be saved
        return []


def left_journal(path: Path) -> str:
    """A line about a journal that an earlier session left.

    :param path: the journal.
    :return: the line.
    """
    return f"{path} was left by a session that did not end; save it: {advice(path)}"


def is_journal(path: Path) -> bool:
    """Whether a file begins as a journal does.

    :param path: the file.
    :return: false also if it is empty or cannot be read.
    """
    try:
        with path.open("rb") as file:
            start = file.read(len(MAGIC))
    except OSError:
        return False
    return bool(start) and MAGIC.startswith(start)

"""A lock that separates a journal under way from one that a crash left. The system drops it with the process.

Where there is no ``fcntl`` (Windows) nothing is locked: there the system itself refuses to remove a file that is open.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO


def try_lock(file: IO[bytes]) -> bool:
    """Take the lock of an open file until it is closed.

    :param file: open in any mode.
    :return: false if another holder has it; true also where there are no locks.
    """
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def being_written(path: Path) -> bool:
    """Whether a running process holds the lock of a journal.

    :param path: the journal.
    :return: false also if it cannot be read, and where there are no locks.
    """
    try:
        with path.open("rb") as file:
            return not try_lock(file)
    except OSError:  # what cannot even be read cannot be written
        return False

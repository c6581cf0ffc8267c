"""One way to get a recorded hand: by the shipped motion's name, or from a file, told apart by its content."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from haptics.errors import InputError
from haptics.scene.hand_files.hdf5 import SIGNATURE, load_recorded
from haptics.scene.hand_files.leap import load_leap
from haptics.scene.hands.recording import HandRecording
from haptics.scene.hands.synthetic import NAME as SYNTHETIC, synthetic_hand
from haptics.units import file_path

_SHIPPED: dict[str, Callable[[], HandRecording]] = {SYNTHETIC: synthetic_hand}

_READERS: tuple[tuple[bytes, Callable[[Path], HandRecording]], ...] = ((SIGNATURE, load_recorded), (b"", load_leap))
"""Who reads a file that begins with these bytes; the first match does. JSON has no such mark, so Leap's comes last."""


def shipped_hands() -> tuple[str, ...]:
    """The names of the motions that ship."""
    return tuple(_SHIPPED)


def load_hand(source: str | PathLike[str]) -> HandRecording:
    """A hand's motion: a shipped one by its name, or a file's. A file that bears a shipped name is had as ``./name``.

    :raises InputError: no such name or file, or its content cannot be used.
    """
    if isinstance(source, str) and source in _SHIPPED:
        return _SHIPPED[source]()
    path = file_path("source", source)
    try:
        if not path.is_file():
            what = "is a folder or a device" if path.exists() else "does not exist"
            raise InputError(f"hand = {str(path)!r} {what}; allowed: a file, or one of: {', '.join(_SHIPPED)}")
        with path.open("rb") as file:
            head = file.read(max(len(first_bytes) for first_bytes, _ in _READERS))
    except OSError as error:
        raise InputError(f"hand = {str(source)!r} cannot be read: {error}; allowed: a file that can") from error
    return next(reader for first_bytes, reader in _READERS if head.startswith(first_bytes))(path)

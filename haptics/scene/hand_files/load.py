"""Recorded hands by the shipped motion's name, or from a file; its content decides how it is read."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from haptics.errors import InputError
from haptics.scene.hand_files.hdf5 import SIGNATURE, load_recorded
from haptics.scene.hand_files.leap import load_leap
from haptics.scene.hands.recording import HandRecording
from haptics.scene.hands.synthetic import NAME as SYNTHETIC, synthetic_hand
from haptics.units import file_path, nearest

_SHIPPED: dict[str, Callable[[], HandRecording]] = {SYNTHETIC: synthetic_hand}

_READERS: tuple[tuple[bytes, Callable[[Path], HandRecording]], ...] = ((SIGNATURE, load_recorded), (b"", load_leap))
"""Who reads a file that begins with these bytes; the first match does. JSON has no such mark, so Leap's comes last."""


def shipped_hands() -> tuple[str, ...]:
    """The motions that ship.

    :return: their names.
    """
    return tuple(_SHIPPED)


def load_hand(source: str | PathLike[str]) -> HandRecording:
    """A hand's motion: a shipped one by its name, or a file's.

    :param source: a shipped name or a path; a file that bears a shipped name is ``./name``.
    :return: tracks of frames, 26 joints each.
    :raises InputError: no such name or file, or its content cannot be used.
    """
    if isinstance(source, str) and source in _SHIPPED:
        return _SHIPPED[source]()
    path = file_path("source", source)
    try:
        if not path.is_file():
            what = "is a folder or a device" if path.exists() else "does not exist"
            known = ", ".join(_SHIPPED) + nearest(source, tuple(_SHIPPED))
            raise InputError(f"hand = {str(path)!r} {what}; expected a file, or a motion that ships: {known}")
        with path.open("rb") as file:
            head = file.read(max(len(first_bytes) for first_bytes, _ in _READERS))
    except OSError as error:
        raise InputError(f"hand = {str(source)!r} cannot be read: {error}") from error
    return next(reader for first_bytes, reader in _READERS if head.startswith(first_bytes))(path)

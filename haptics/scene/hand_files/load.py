"""Recorded hands by the shipped motion's name, or from a file; its content decides how it is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from pathlib import Path

from haptics.errors import InputError
from haptics.scene.hand_files.declared import Declared
from haptics.scene.hand_files.hdf5 import SIGNATURE, load_recorded
from haptics.scene.hand_files.joint_lines import read_joint_lines
from haptics.scene.hand_files.joint_table import read_joint_table
from haptics.scene.hand_files.kind import Kind, kind_of
from haptics.scene.hand_files.leap import load_leap
from haptics.scene.hand_files.mediapipe import read_landmarks
from haptics.scene.hand_files.settled import settled
from haptics.scene.hands.recording import HandRecording
from haptics.scene.hands.synthetic import NAME as SYNTHETIC, synthetic_hand
from haptics.units import file_path, known_arguments, nearest

_SHIPPED: dict[str, Callable[[], HandRecording]] = {SYNTHETIC: synthetic_hand}


def shipped_hands() -> tuple[str, ...]:
    """The motions that ship.

    :return: their names.
    """
    return tuple(_SHIPPED)


@known_arguments
def load_hand(
    source: str | PathLike[str],
    *,
    basis: str | None = None,
    unit: str | None = None,
    time: str | None = None,
    side: str | None = None,
    mirrored: bool | None = None,
) -> HandRecording:
    """A hand's motion: a shipped one by its name, or a file's.

    :param source: a shipped name or a path; a file that bears a shipped name is ``./name``.
    :param basis: whose axes a file of joints has, a name of ``haptics.BASES``; None: as it says, or as is certain.
    :param unit: of its lengths, ``m``, ``cm`` or ``mm``; None likewise.
    :param time: unit of its times, ``ns``, ``us``, ``ms`` or ``s``; None likewise.
    :param side: ``left`` or ``right``: whose hand it is where its poses do not say, and the only one that is read; None: all.
    :param mirrored: whether landmarks were found in a mirrored picture; None: as the file says, or not.
    :return: tracks of frames, 26 joints each.
    :raises InputError: no such name or file, or its content cannot be used.
    """
    told = Declared(basis, unit, time, side, mirrored)
    if isinstance(source, str) and source in _SHIPPED:
        return _fixed(_SHIPPED[source](), told)
    path = file_path("source", source)
    try:
        if not path.is_file():
            what = "is a folder or a device" if path.exists() else "does not exist"
            known = ", ".join(_SHIPPED) + nearest(source, tuple(_SHIPPED))
            raise InputError(f"hand = {str(path)!r} {what}; expected a file, or a motion that ships: {known}")
        with path.open("rb") as file:
            head = file.read(len(SIGNATURE))
    except OSError as error:
        raise InputError(f"hand = {str(source)!r} cannot be read: {error}") from error
    if head == SIGNATURE:
        return _fixed(load_recorded(path), told)
    kind = _kind_of(path)
    return _fixed(load_leap(path), told) if kind == "leap" else _of_joints(path, kind, told)


def _kind_of(path: Path) -> Kind:
    try:
        return kind_of(path)
    except InputError:
        return "leap"  # whose reader says at which place it cannot be read


def _of_joints(path: Path, kind: Kind, told: Declared) -> HandRecording:
    try:
        if kind == "landmarks":
            _check_told(told, ("basis", "unit"), path.name)
            rows, axes, notes = read_landmarks(path, told)
            _check_told(rows.declared, ("basis", "unit"), path.name)
            recording = settled(rows, told, path.name, "MediaPipe's world landmarks as JSON", axes)
            return replace(recording, notes=(*notes, *recording.notes))
        _check_told(told, ("mirrored",), path.name)
        if kind == "joint lines":
            return settled(read_joint_lines(path), told, path.name, "joints as JSON")
        return settled(read_joint_table(path), told, path.name, "joints as CSV")
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _check_told(told: Declared, names: tuple[str, ...], source: str) -> None:
    """What a kind of file says by itself cannot be told otherwise."""
    for name in names:
        if getattr(told, name) is not None:
            raise InputError(f"{name} = {getattr(told, name)!r}: what {source} is settles that; leave it out")


def _fixed(recording: HandRecording, told: Declared) -> HandRecording:
    """A recording whose kind settles all but which of its hands to read."""
    _check_told(told, ("basis", "unit", "time", "mirrored"), recording.source)
    if told.side is None:
        return recording
    tracks = recording.of_side(told.side)
    if not tracks:
        raise InputError(f"{recording.source} has no pose of the {told.side} hand")
    refused = tuple(pose for pose in recording.refused if pose.side in (told.side, None))
    return replace(recording, tracks=tracks, refused=refused)

"""Hands written as plain files, which every program can read: CSV with a row a pose, or a line of JSON a pose.

OpenXR's basis, metres and nanoseconds, and every number with all its digits (``docs/reference/hands.md``).
"""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from haptics.errors import HapticsError, InputError
from haptics.recording.output import check_outputs, replacing
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hand_files.spelling import PARTS
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.joints import JOINTS, NOMINAL_RADIUS_M, SIDES
from haptics.scene.hands.recording import HandRecording

_DECLARED = {"basis": "openxr", "unit": "m", "time": "ns"}


@dataclass(frozen=True, slots=True)
class Written:
    """A file of hands that was written, and what was lost on the way.

    :param path: the file.
    :param poses: how many, of both hands.
    :param off_mm: the largest distance between a joint as it was read and as the written file gives it back, mm.
    :param losses: what is not as in the file that was read, in sentences.
    """

    path: Path
    poses: int
    off_mm: float
    losses: tuple[str, ...]


def convert(recording: HandRecording, out: Path, read_from: Path | None = None, force: bool = False) -> Written:
    """Write a recording as a plain file, and hold what it gives back against what was read.

    :param recording: as ``load_hand`` gives it; poses that could not be read are not in it.
    :param out: ends in ``.csv`` or ``.jsonl``.
    :param read_from: the file that the recording was read from, which is not written over; None if there is none.
    :param force: overwrite ``out`` if it exists.
    :return: what was written and lost.
    :raises InputError: another ending, no poses, or the file cannot be written there.
    :raises HapticsError: the disk failed.
    """
    lines = {".csv": _csv, ".jsonl": _json_lines}.get(out.suffix.lower())
    if lines is None:
        raise InputError(f"out = {str(out)!r} ends in neither .csv nor .jsonl; the ending chooses what is written")
    check_outputs({"out": out}, force, {} if read_from is None else {"the hand": read_from})
    frames = [*_frames(recording)]
    if not frames:
        raise InputError(f"hand {recording.source} has no poses to write")
    with replacing(out, force) as partial:
        with partial.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(lines(frames))
        try:
            off_mm = _off_mm(frames, load_hand(partial))
        except InputError as error:
            raise HapticsError(f"{out} is not written, as it could not be read again: {error}") from error
    return Written(out, len(frames), off_mm, tuple(_losses(recording, len(frames))))


def _frames(recording: HandRecording) -> Iterator[HandFrame]:
    """The poses of both hands in the order of time; one that has a joint nowhere has no numbers to write."""
    for frame in heapq.merge(*(recording.frames(side) for side in SIDES), key=lambda frame: frame.time_ns):
        if np.isfinite(frame.position_m).all() and np.isfinite(frame.orientation_xyzw).all():
            yield frame


def _csv(frames: Sequence[HandFrame]) -> Iterator[str]:
    yield f"# {' '.join(f'{name}={word}' for name, word in _DECLARED.items())}\n"
    yield ",".join(["time_ns", "side", "track", *(f"{joint}_{part}" for joint in JOINTS for part in PARTS)]) + "\n"
    for frame in frames:
        numbers = np.hstack([frame.position_m, frame.orientation_xyzw]).ravel().tolist()
        yield ",".join([str(frame.time_ns), frame.side, str(frame.track_id), *map(repr, numbers)]) + "\n"


def _json_lines(frames: Sequence[HandFrame]) -> Iterator[str]:
    yield json.dumps(_DECLARED) + "\n"
    for frame in frames:
        joints = {
            name: {"position": place, "orientation": turn}
            for name, place, turn in zip(JOINTS, frame.position_m.tolist(), frame.orientation_xyzw.tolist(), strict=True)
        }
        yield json.dumps({"time": frame.time_ns, "side": frame.side, "track": frame.track_id, "joints": joints}) + "\n"


def _off_mm(frames: Sequence[HandFrame], back: HandRecording) -> float:
    """The largest distance of a joint from itself as read again, mm."""
    off_m = 0.0
    for side in SIDES:
        wanted, found = [frame for frame in frames if frame.side == side], [*back.frames(side)]
        if len(found) != len(wanted):
            raise InputError(f"it gives back {len(found)} of {len(wanted)} poses of the {side} hand")
        for one, again in zip(wanted, found, strict=True):
            off_m = max(off_m, float(np.max(np.linalg.norm(again.position_m - one.position_m, axis=1))))
    return 1e3 * off_m


def _losses(recording: HandRecording, poses: int) -> Iterator[str]:
    if recording.origin is not None:
        yield from recording.origin.losses
    beside = sum(map(len, recording.tracks)) - poses
    if beside:
        yield f"left out: {beside} poses, of a second hand of the same side or with a joint nowhere"
    if recording.refused:
        yield f"{len(recording.refused)} poses could not be read; the first: {recording.refused[0].reason}"
    if any(not np.array_equal(track.radius_m, NOMINAL_RADIUS_M) for track in recording.tracks):
        yield "how thick the fingers are is not written"

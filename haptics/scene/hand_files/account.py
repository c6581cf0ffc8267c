"""What a file of hands holds, for whoever is to trust it: hands, rate, what was read and made, what is refused and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.scene.hands.handedness import apparent_side, contradiction
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.motion import refusals
from haptics.scene.hands.origin import Origin
from haptics.scene.hands.recording import HandRecording, RefusedPose, too_many_refused
from haptics.time import NS_PER_MS, NS_PER_S

MOST_REASONS = 10
"""Refused poses beyond these are counted, not listed."""


@dataclass(frozen=True, slots=True)
class OneHand:
    """The poses of one side.

    :param side: ``left`` or ``right``.
    :param poses: of it, those that are refused included.
    :param tracks: how often the hand was found; it was lost in between.
    :param rate_hz: of the poses, by the median time between two; None of fewer than two.
    :param jitter_ms: half of the times between two poses differ from the median by at most this, ms; None likewise.
    :param refused: poses that must not move anything, or could not be read, by what is wrong with them.
    :param playable: whether ``haptics run`` would play it.
    """

    side: str
    poses: int
    tracks: int
    rate_hz: float | None
    jitter_ms: float | None
    refused: int
    playable: bool


@dataclass(frozen=True, slots=True)
class HandAccount:
    """What a file of hands holds.

    :param source: the file's name.
    :param format: what kind of file it is.
    :param basis: whose axes its numbers have.
    :param unit: of its lengths.
    :param time: unit of its times.
    :param hands: of each side that has poses.
    :param frames: moments that it has poses of, or, of trackers that tell, frames.
    :param duration_s: from the first to the last, s.
    :param joints_read: joints that the file has.
    :param joints_made: joints that were made of others.
    :param orientations: ``read`` or ``made``.
    :param dropped: what was left out, and how often.
    :param refused: the first ``MOST_REASONS`` poses that are refused.
    :param notes: what was taken for granted, in sentences.
    :param losses: what was made rather than read, and how far joints are from where the file has them, in sentences.
    """

    source: str
    format: str
    basis: str
    unit: str
    time: str
    hands: tuple[OneHand, ...]
    frames: int
    duration_s: float
    joints_read: tuple[str, ...]
    joints_made: tuple[str, ...]
    orientations: str
    dropped: Mapping[str, int]
    refused: tuple[RefusedPose, ...]
    notes: tuple[str, ...]
    losses: tuple[str, ...]


def account_of(recording: HandRecording) -> HandAccount:
    """Look into a recording.

    :param recording: as ``load_hand`` gives it.
    :return: what it holds.
    """
    origin = Origin("the motion that ships", "openxr", "m", "ns") if recording.origin is None else recording.origin
    refused, hands = list(recording.refused), []
    notes = [note for note in recording.notes if note not in origin.losses]
    for side in SIDES:
        frames = tuple(recording.frames(side))
        if not frames:
            continue
        found = refusals(frames)
        refused += [RefusedPose(frames[index].time_ns, side, reason) for index, reason in found.items()]
        unread = sum(pose.side in (side, None) for pose in recording.refused)
        bad, poses = len(found) + unread, len(frames) + unread
        playable = bad == 0 or not too_many_refused(bad, poses)
        rate_hz, jitter_ms = _pace(np.diff([frame.time_ns for frame in frames]))
        hands.append(OneHand(side, poses, len(recording.of_side(side)), rate_hz, jitter_ms, bad, playable))
        if not playable:
            notes.append(f"`haptics run` does not play the {side} hand: {bad} of its {poses} poses are refused")
        tracks = recording.of_side(side)
        shape = [np.concatenate([getattr(track, name) for track in tracks]) for name in ("position_m", "orientation_xyzw")]
        wrong = contradiction(side, apparent_side(*shape))
        notes += [] if wrong is None else [wrong]
    return HandAccount(
        source=recording.source,
        format=origin.format,
        basis=origin.basis,
        unit=origin.unit,
        time=origin.time,
        hands=tuple(hands),
        frames=recording.frame_count,
        duration_s=recording.duration_s,
        joints_read=origin.read,
        joints_made=origin.made,
        orientations="made" if origin.turned else "read",
        dropped=recording.dropped,
        refused=tuple(refused[:MOST_REASONS]),
        notes=tuple(notes),
        losses=origin.losses,
    )


def _pace(apart_ns: NDArray[np.int64]) -> tuple[float | None, float | None]:
    if not len(apart_ns):
        return None, None
    median_ns = float(np.median(apart_ns))
    return NS_PER_S / median_ns, float(np.median(np.abs(apart_ns - median_ns))) / NS_PER_MS

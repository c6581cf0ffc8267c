"""Hands over time: tracks of frames, and a tracker's whole recording."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from haptics.scene.hands.frame import Floats, HandFrame
from haptics.scene.hands.joints import NOMINAL_RADIUS_M, SIDES, Side, joint_index
from haptics.scene.hands.origin import Origin

LARGE_SHARE = 0.2
"""Where this share of a recording's poses, or more, must be refused, the recording as a whole is not to be trusted."""


@dataclass(frozen=True, slots=True, eq=False)
class HandTrack:
    """One hand from when it appears until it is lost: n frames, strictly later one after another.

    :param side: ``left`` or ``right``.
    :param track_id: unique within its recording.
    :param time_ns: (n,), int64.
    :param position_m: (n, 26, 3), metres.
    :param orientation_xyzw: (n, 26, 4), unit quaternions, of like sign from frame to frame.
    :param radius_m: (26,), half the hand's thickness at each joint.
    """

    side: Side
    track_id: int
    time_ns: NDArray[np.int64]
    position_m: Floats
    orientation_xyzw: Floats
    radius_m: Floats = field(default_factory=lambda: NOMINAL_RADIUS_M)

    def __len__(self) -> int:
        return len(self.time_ns)

    def joint_m(self, name: str) -> Floats:
        """The path of one joint.

        :param name: as ``joint_index`` understands it.
        :return: (n, 3), metres.
        :raises InputError: no such joint.
        """
        return self.position_m[:, joint_index(name)]

    def frames(self) -> Iterator[HandFrame]:
        """Go through the track.

        :return: its frames in time order; their arrays are views.
        """
        for time_ns, position_m, orientation_xyzw in zip(
            self.time_ns.tolist(), self.position_m, self.orientation_xyzw, strict=True
        ):
            yield HandFrame(time_ns, self.side, self.track_id, position_m, orientation_xyzw, radius_m=self.radius_m)


@dataclass(frozen=True, slots=True)
class RefusedPose:
    """A pose that a recording has and that must not move anything.

    :param time_ns: when it was sampled, from the recording's first frame; None where that is not known.
    :param side: ``left`` or ``right``; None where that is not known.
    :param reason: why, with the joint or the place in the file.
    """

    time_ns: int | None
    side: str | None
    reason: str


def too_many_refused(refused: int, poses: int) -> bool:
    """Whether the refused poses are a share that spoils the whole.

    :param refused: how many.
    :param poses: how many there are, the refused ones included.
    :return: whether their share is ``LARGE_SHARE`` or more.
    """
    return refused >= LARGE_SHARE * poses


@dataclass(frozen=True, slots=True, eq=False)
class HandRecording:
    """Hands recorded by one tracker; time zero is the first frame.

    :param source: where it came from, for people.
    :param tracks: in the order in which they begin.
    :param frame_count: the tracker's frames, with or without a hand in them.
    :param duration_s: from the first frame to the last.
    :param dropped: what was left out while reading, and how often.
    :param refused: poses that could not be read.
    :param notes: what was taken for granted while reading, in sentences for people.
    :param origin: what of the joints was read and what made; None where no file was read.
    """

    source: str
    tracks: tuple[HandTrack, ...]
    frame_count: int
    duration_s: float
    dropped: Mapping[str, int] = field(default_factory=dict)
    refused: tuple[RefusedPose, ...] = ()
    notes: tuple[str, ...] = ()
    origin: Origin | None = None

    def of_side(self, side: str) -> tuple[HandTrack, ...]:
        """The tracks of one side.

        :param side: ``left`` or ``right``.
        :return: in the order in which they begin.
        """
        return tuple(track for track in self.tracks if track.side == side)

    def frames(self, side: str) -> Iterator[HandFrame]:
        """The frames of one side; where two tracks share a moment, only that of the track that began first.

        :param side: ``left`` or ``right``.
        :return: in strict time order.
        """
        last_ns = None
        for frame in heapq.merge(*(track.frames() for track in self.of_side(side)), key=lambda frame: frame.time_ns):
            if frame.time_ns != last_ns:
                last_ns = frame.time_ns
                yield frame

    @property
    def side_with_most_frames(self) -> str:
        """``left`` or ``right``; ``right`` where neither leads."""
        count = {side: sum(map(len, self.of_side(side))) for side in SIDES}
        return max(reversed(SIDES), key=lambda side: count[side])

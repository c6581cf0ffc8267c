"""A hand as 26 joints, over time.

The joints are those of OpenXR (``XR_EXT_hand_tracking``), in its order. The basis is OpenXR's too: right-handed, +X right,
+Y up, -Z forward, metres, quaternions ``(x, y, z, w)``. A joint's own axes: -Z along its bone toward the tip, +Y out of the
back of the hand, so +X to the right of someone looking along the bone; the same for both hands. Time is integer nanoseconds.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.errors import InputError
from haptics.scene.joints import FINGERS as FINGERS, JOINT, JOINTS, NOMINAL_RADIUS_M, SIDES, joint_index
from haptics.scene.shown import shown
from haptics.scene.well_formed import ill_formed
from haptics.time import NS_PER_S

Floats = NDArray[np.float64]

FARTHEST_M = 10.0
"""No joint lies farther than this from the tracker's origin, along any axis (assumed; a tracked room is smaller)."""
FASTEST_M_S = 5.0
"""A joint that moves faster than this between two frames has jumped, not moved."""
NEAREST_M, WIDEST_M = 0.02, 0.5
"""How far a hand's farthest joint is from its palm, at least and at most (assumed; an adult's fingers reach 0.1 to 0.15 m).
Less is no hand but a tracker's way to say that it lost one, more is another unit or a joint gone astray."""
LARGE_SHARE = 0.2
"""Where this share of a recording's poses, or more, must be refused, it is no recording of a hand with a fault here and there."""
NORM_TOLERANCE = 0.01
"""How far a unit quaternion's norm may be from one; single precision over a network keeps it within 1e-6."""


@dataclass(frozen=True, slots=True, eq=False)
class HandFrame:
    """One hand at one moment.

    :param time_ns: when the pose was sampled.
    :param side: ``left`` or ``right``.
    :param track_id: the same number as long as the tracker held the same hand without a break.
    :param position_m: (26, 3), metres.
    :param orientation_xyzw: (26, 4), unit quaternions.
    :param valid: whether the tracker vouches for the pose.
    :param radius_m: (26,), half the hand's thickness at each joint.
    :param display_time_ns: the moment a tracker predicted the pose for, where that is not the sample time.
    """

    time_ns: int
    side: str
    track_id: int
    position_m: Floats
    orientation_xyzw: Floats
    valid: bool = True
    radius_m: Floats = field(default_factory=lambda: NOMINAL_RADIUS_M)
    display_time_ns: int | None = None


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

    side: str
    track_id: int
    time_ns: NDArray[np.int64]
    position_m: Floats
    orientation_xyzw: Floats
    radius_m: Floats = field(default_factory=lambda: NOMINAL_RADIUS_M)

    def __len__(self) -> int:
        return len(self.time_ns)

    def joint_m(self, name: str) -> Floats:
        """The path of one joint, (n, 3), metres.

        :raises InputError: no such joint.
        """
        return self.position_m[:, joint_index(name)]

    def frames(self) -> Iterator[HandFrame]:
        """The track's frames in time order; their arrays are views."""
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
    """Whether ``refused`` of ``poses`` are a share that spoils the whole."""
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
    """

    source: str
    tracks: tuple[HandTrack, ...]
    frame_count: int
    duration_s: float
    dropped: Mapping[str, int] = field(default_factory=dict)
    refused: tuple[RefusedPose, ...] = ()
    notes: tuple[str, ...] = ()

    def of_side(self, side: str) -> tuple[HandTrack, ...]:
        """The tracks of one side, in the order in which they begin."""
        return tuple(track for track in self.tracks if track.side == side)

    def frames(self, side: str) -> Iterator[HandFrame]:
        """The frames of one side in strict time order; where two tracks share a moment, the one that began first speaks."""
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


def with_palm(position_m: ArrayLike, orientation_xyzw: ArrayLike) -> tuple[Floats, Floats]:
    """Put the palm in front of 25 joints that lack it, as WebXR's do.

    The palm is the middle of the middle finger's metacarpal, which it shares the orientation of.

    :param position_m: (..., 25, 3), metres, ``JOINTS`` from ``wrist`` on.
    :param orientation_xyzw: (..., 25, 4).
    :return: (..., 26, 3) and (..., 26, 4).
    :raises InputError: other shapes.
    """
    position, orientation = np.asarray(position_m, float), np.asarray(orientation_xyzw, float)
    if position.shape[-2:] != (25, 3) or orientation.shape[-2:] != (25, 4) or position.shape[:-2] != orientation.shape[:-2]:
        raise InputError(f"shapes {position.shape} and {orientation.shape}; allowed: (..., 25, 3) and (..., 25, 4)")
    metacarpal, proximal = JOINT["middle_metacarpal"] - 1, JOINT["middle_proximal"] - 1
    palm = 0.5 * (position[..., metacarpal, :] + position[..., proximal, :])
    return (
        np.concatenate([palm[..., None, :], position], axis=-2),
        np.concatenate([orientation[..., metacarpal, None, :], orientation], axis=-2),
    )


def frame_of_joints(
    time_ns: int, side: str, joints: Mapping[str, tuple[ArrayLike, ArrayLike]], track_id: int = 0, valid: bool = True
) -> HandFrame:
    """A frame from named joints, each a position (3,) in metres and an orientation (4,); the palm may be missing.

    Whether the numbers are a hand's is not asked here but by ``check_frame``.

    :raises InputError: an unknown side or joint, one given twice, missing or null, or not of that shape.
    """
    if not isinstance(side, str) or side not in SIDES:
        raise InputError(f"side = {shown(side)} is not allowed; allowed: {', '.join(SIDES)}")
    if not isinstance(joints, Mapping):
        raise InputError(f"joints is {shown(joints)}; allowed: position and orientation by the joint's name")
    position, orientation, seen = np.zeros((26, 3)), np.zeros((26, 4)), set[int]()
    for name, pose in joints.items():
        index = joint_index(name)
        if index in seen:
            raise InputError(f"joint = {name!r} is given twice; allowed: each joint once")
        if not isinstance(pose, Sequence) or len(pose) != 2:
            raise InputError(
                f"joint {name!r} is {shown(pose)}; allowed: a position and an orientation; "
                "where the tracker has lost it, hand in no pose, or one with valid=False"
            )
        position[index] = _vector(pose[0], 3, f"the position of joint {name!r}")
        orientation[index] = _vector(pose[1], 4, f"the orientation of joint {name!r}")
        seen.add(index)
    missing = [name for name in JOINTS[1:] if JOINT[name] not in seen]
    if missing:
        raise InputError(f"joints are missing: {', '.join(missing)}; allowed: none but the palm")
    if JOINT["palm"] not in seen:
        position, orientation = with_palm(position[1:], orientation[1:])
    return HandFrame(time_ns, side, track_id, position, orientation, valid)


def _vector(value: ArrayLike, count: int, what: str) -> Floats:
    try:
        vector = np.asarray(value)
    except ValueError:  # lists of unequal length
        vector = np.empty(0, object)
    if vector.shape != (count,) or vector.dtype.kind not in "fiu":
        raise InputError(f"{what} is {shown(value)}; allowed: {count} numbers (3 and 4 numbers a joint)")
    return vector.astype(float)


def check_frame(frame: HandFrame, previous: HandFrame | None) -> str | None:
    """Why a pose must not move anything, or ``None`` if it may.

    Refused: what is not of a frame's types and shapes, one the tracker does not vouch for, numbers that are not finite, joints
    beyond ``FARTHEST_M``, quaternions that are not of unit length, joints all in one point or farther than ``WIDEST_M`` from the
    palm, a time that does not increase, and, within one track, a joint faster than ``FASTEST_M_S`` since ``previous``.

    :param previous: the last frame of this hand that was accepted.
    """
    wrong = ill_formed(frame)
    if wrong is not None:
        return wrong
    if not frame.valid:
        return "the tracker does not vouch for the pose"
    position, orientation = frame.position_m, frame.orientation_xyzw
    # Worst first, by argmax, which takes a NaN for the greatest; comparisons that a NaN fails.
    joint, axis = divmod(int(np.abs(position).argmax()), 3)
    if not abs(position[joint, axis]) <= FARTHEST_M:
        where = f"{JOINTS[joint]} lies at {position[joint, axis]:g} m along {'xyz'[axis]}; allowed: within {FARTHEST_M:g} m"
        return where if np.isfinite(position).all() else f"the position of {_not_finite(position)} is not finite"
    norm = np.sqrt(np.vecdot(orientation, orientation))
    joint = int(np.abs(norm - 1.0).argmax())
    if not abs(norm[joint] - 1.0) <= NORM_TOLERANCE:
        length = f"the quaternion of {JOINTS[joint]} has norm {norm[joint]:g}; allowed: 1 within {NORM_TOLERANCE:g}"
        return length if np.isfinite(orientation).all() else f"the quaternion of {_not_finite(orientation)} is not finite"
    reach = position - position[JOINT["palm"]]
    reach_m2 = np.vecdot(reach, reach)
    joint = int(reach_m2.argmax())
    if not NEAREST_M**2 <= reach_m2[joint] <= WIDEST_M**2:
        return _not_a_hands_size(joint, math.sqrt(reach_m2[joint]), position[JOINT["palm"]])
    if previous is None:
        return None
    if frame.time_ns <= previous.time_ns:
        return f"its time {frame.time_ns} ns does not follow {previous.time_ns} ns"
    return jump_between(previous, frame)


def jump_between(previous: HandFrame, frame: HandFrame) -> str | None:
    """Which joint moved faster than ``FASTEST_M_S`` from a frame to a later one of its track, in words, or None."""
    if frame.track_id == previous.track_id and frame.side == previous.side:
        step = frame.position_m - previous.position_m
        moved_m2 = np.vecdot(step, step)
        joint = int(moved_m2.argmax())
        speed_m_s = math.sqrt(moved_m2[joint]) * NS_PER_S / (frame.time_ns - previous.time_ns)
        if speed_m_s > FASTEST_M_S:
            return f"{JOINTS[joint]} jumped at {speed_m_s:.3g} m/s; allowed: up to {FASTEST_M_S:g} m/s"
    return None


def _not_finite(array: Floats) -> str:
    return JOINTS[int(np.isfinite(array).all(axis=1).argmin())]


def _not_a_hands_size(joint: int, reach_m: float, palm_m: Floats) -> str:
    if reach_m < NEAREST_M:
        where = ", ".join(f"{part:g}" for part in palm_m)
        return (
            f"no hand has its joints in one point: all lie within {reach_m * 1e3:.3g} mm of the palm at {where} m; "
            f"allowed: the farthest from {NEAREST_M * 1e3:g} mm on; "
            "are its lengths in the right unit (a HandFrame has metres, a Leap recording millimetres)?"
        )
    return f"{JOINTS[joint]} lies {reach_m:.3g} m from the palm; allowed: up to {WIDEST_M:g} m; is the unit metres?"


def mirrored(frame: HandFrame) -> HandFrame:
    """The other hand doing the same: reflected in the plane x = 0.

    ``p -> (-x, y, z)`` and ``R -> M R M`` with ``M = diag(-1, 1, 1)``, which is ``q -> (x, -y, -z, w)``.
    """
    return replace(
        frame,
        side="left" if frame.side == "right" else "right",
        position_m=frame.position_m * (-1.0, 1.0, 1.0),
        orientation_xyzw=frame.orientation_xyzw * (1.0, -1.0, -1.0, 1.0),
    )

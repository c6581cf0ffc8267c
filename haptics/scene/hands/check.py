"""Which poses must not move anything, and why."""

from __future__ import annotations

import math

import numpy as np

from haptics.scene.hands.frame import Floats, HandFrame
from haptics.scene.hands.joints import JOINT, JOINTS, SIDES
from haptics.scene.hands.shown import shown
from haptics.time import NS_PER_S

FARTHEST_M = 10.0
"""No joint lies farther than this from the tracker's origin, along any axis (assumed; a tracked room is smaller)."""
FASTEST_M_S = 5.0
"""A joint that moves faster than this between two frames has jumped, not moved."""
NEAREST_M, WIDEST_M = 0.02, 0.5
"""How far a hand's farthest joint is from its palm, at least and at most (assumed; an adult's fingers reach 0.1 to 0.15 m).
Less is how some trackers mark a hand that they lost, more is another unit or a joint gone astray."""
NORM_TOLERANCE = 0.01
"""How far a unit quaternion's norm may be from one; single precision over a network keeps it within 1e-6."""


def ill_formed(frame: HandFrame) -> str | None:
    """Check the types and shapes of a frame's fields.

    :param frame: with whatever its maker put in.
    :return: what is wrong, or None.
    """
    for name, bits in (("time_ns", 63), ("track_id", 31)):
        number = getattr(frame, name)
        if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or abs(int(number)) >= 1 << bits:
            return f"{name} is {shown(number)}; expected a whole number of {bits + 1} bits"
    if not isinstance(frame.side, str) or frame.side not in SIDES:
        return f"side is {shown(frame.side)}; allowed: {', '.join(SIDES)}"
    if not isinstance(frame.valid, (bool, np.bool_)):
        return f"valid is {shown(frame.valid)}; expected True or False"
    for name, shape in (("position_m", (26, 3)), ("orientation_xyzw", (26, 4))):
        array = getattr(frame, name)
        if not isinstance(array, np.ndarray) or array.dtype.kind not in "fi":
            return f"{name} is {shown(array)}; expected an array {shape} of numbers"
    position, orientation = frame.position_m, frame.orientation_xyzw
    if position.shape != (26, 3) or orientation.shape != (26, 4):
        return f"shapes {position.shape} and {orientation.shape}; expected (26, 3) and (26, 4)"
    return None


def check_frame(frame: HandFrame, previous: HandFrame | None) -> str | None:
    """Check whether a pose may move anything.

    Refused: what is not of a frame's types and shapes, a pose that its tracker marks as not valid, numbers that are not
    finite, joints beyond ``FARTHEST_M``, quaternions that are not of unit length, joints all in one point or farther than
    ``WIDEST_M`` from the palm, a time that does not increase, and, within one track, a joint faster than ``FASTEST_M_S``
    since ``previous``.

    :param frame: the pose.
    :param previous: the last frame of this hand that was accepted; None: there is none.
    :return: why it must not, or None if it may.
    """
    wrong = ill_formed(frame)
    if wrong is not None:
        return wrong
    if not frame.valid:
        return "its tracker marks the pose as not valid"
    position, orientation = frame.position_m, frame.orientation_xyzw
    # Worst first, by argmax, which takes a NaN for the maximum; comparisons that a NaN fails.
    joint, axis = divmod(int(np.abs(position).argmax()), 3)
    if not abs(position[joint, axis]) <= FARTHEST_M:
        place = f"{position[joint, axis]:g} m along {'xyz'[axis]}"
        where = f"{JOINTS[joint]} lies at {place}; must be within {FARTHEST_M:g} m; is the unit metres?"
        return where if np.isfinite(position).all() else f"the position of {_not_finite(position)} is not finite"
    norm = np.sqrt(np.vecdot(orientation, orientation))
    joint = int(np.abs(norm - 1.0).argmax())
    if not abs(norm[joint] - 1.0) <= NORM_TOLERANCE:
        wrong = int((np.abs(norm - 1.0) > NORM_TOLERANCE).sum())
        others = f", the worst of {wrong} such joints of {len(norm)}" if wrong > 1 else ""
        length = f"the quaternion of {JOINTS[joint]} has norm {norm[joint]:g}{others}; expected 1 within {NORM_TOLERANCE:g}"
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


def jump_between(previous: HandFrame, frame: HandFrame, min_ns: int = 1) -> str | None:
    """Check the speed of every joint between two frames.

    :param previous: the earlier frame.
    :param frame: the later one.
    :param min_ns: frames that are nearer in time are taken to be this far apart, ns, at least 1.
    :return: which joint moved faster than ``FASTEST_M_S``, in words; None if none did, or if they are of different tracks.
    """
    if frame.track_id == previous.track_id and frame.side == previous.side:
        step = frame.position_m - previous.position_m
        moved_m2 = np.vecdot(step, step)
        joint = int(moved_m2.argmax())
        speed_m_s = math.sqrt(moved_m2[joint]) * NS_PER_S / max(frame.time_ns - previous.time_ns, min_ns)
        if speed_m_s > FASTEST_M_S:
            return f"{JOINTS[joint]} jumped at {speed_m_s:.3g} m/s; allowed: up to {FASTEST_M_S:g} m/s"
    return None


def _not_finite(array: Floats) -> str:
    return JOINTS[int(np.isfinite(array).all(axis=1).argmin())]


def _not_a_hands_size(joint: int, reach_m: float, palm_m: Floats) -> str:
    if reach_m < NEAREST_M:
        where = ", ".join(f"{part:g}" for part in palm_m)
        return (
            f"the joints are in one point: all lie within {reach_m * 1e3:.3g} mm of the palm at {where} m; "
            f"expected the farthest at {NEAREST_M * 1e3:g} mm or more; "
            "are its lengths in the right unit (a HandFrame has metres, a Leap recording millimetres)?"
        )
    return f"{JOINTS[joint]} lies {reach_m:.3g} m from the palm; must be at most {WIDEST_M:g} m; is the unit metres?"

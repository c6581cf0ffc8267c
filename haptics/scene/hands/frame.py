"""One hand at one moment: 26 joints.

The joints are those of OpenXR (``XR_EXT_hand_tracking``), in its order. The basis is OpenXR's too: right-handed, +X right,
+Y up, -Z forward, metres, quaternions ``(x, y, z, w)``. A joint's own axes: -Z along its bone toward the tip, +Y out of the
back of the hand, so +X to the right of someone looking along the bone; the same for both hands. Time is integer nanoseconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.errors import InputError
from haptics.scene.hands.joints import JOINT, JOINTS, NOMINAL_RADIUS_M, SIDES, joint_index
from haptics.scene.hands.shown import shown

Floats = NDArray[np.float64]


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

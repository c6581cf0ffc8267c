"""One hand at one moment: 26 joints.

The joints are those of OpenXR (``XR_EXT_hand_tracking``), in its order. The basis is OpenXR's too: right-handed, +X right,
+Y up, -Z forward, metres, quaternions ``(x, y, z, w)``. A joint's own axes: -Z along its bone toward the tip, +Y out of the
back of the hand, so +X to the right of someone looking along the bone; the same for both hands. Time is integer nanoseconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from haptics.errors import InputError
from haptics.scene.hands.basis import BASES, Basis, Floats, basis as find_basis
from haptics.scene.hands.handedness import ALONG_BONES, along_bones, apparent_side
from haptics.scene.hands.joints import JOINT, JOINTS, NOMINAL_RADIUS_M, SIDES, Side, joint_index
from haptics.scene.hands.shown import shown
from haptics.units import known_arguments, one_of


@dataclass(frozen=True, slots=True, eq=False)
class HandFrame:
    """One hand at one moment.

    :param time_ns: the moment the pose is of: when it was sampled, or what the engine predicted it for.
    :param side: ``left`` or ``right``.
    :param track_id: the same number as long as the tracker held the same hand without a break.
    :param position_m: (26, 3), metres.
    :param orientation_xyzw: (26, 4), unit quaternions.
    :param valid: whether the tracker vouches for the pose.
    :param radius_m: (26,), half the hand's thickness at each joint.
    """

    time_ns: int
    side: Side
    track_id: int
    position_m: Floats
    orientation_xyzw: Floats
    valid: bool = True
    radius_m: Floats = field(default_factory=lambda: NOMINAL_RADIUS_M)

    @classmethod
    @known_arguments
    def from_joints(
        cls,
        time_ns: int,
        side: Side,
        joints: Mapping[str, tuple[ArrayLike, ArrayLike]],
        track_id: int = 0,
        valid: bool = True,
        basis: str | Basis = "openxr",
    ) -> HandFrame:
        """A frame from named joints; the palm may be missing, as in WebXR, and is put in then (:func:`with_palm`).

        In a wrong basis the joints' own -Z axes do not run along their bones: it is refused, with the one that would fit. Whether
        the thumb is on the side that ``side`` states, and whether a pose is plausible at all, is judged by ``Session.submit``.

        :param time_ns: when the pose was sampled, ns on the glove's clock.
        :param side: ``left`` or ``right``.
        :param joints: position (3,) in the basis's unit and orientation (4,) as ``(x, y, z, w)``, by name: one of ``JOINTS``, or
            as OpenXR (``XR_HAND_JOINT_INDEX_TIP_EXT``), WebXR (``index-finger-tip``) or Unity (``IndexTip``) spell it.
        :param track_id: another number whenever the tracker has lost the hand in between.
        :param valid: whether the tracker vouches for the pose.
        :param basis: whose axes and unit the numbers have: a name of ``BASES``, or one of your own.
        :return: the frame, in metres and OpenXR's basis.
        :raises InputError: an unknown side, joint or basis, a joint given twice, missing or null, or not of that shape; or, of a
            pose that is valid, a basis that the joints contradict.
        """
        one_of("side", side, SIDES)
        axes = basis if isinstance(basis, Basis) else find_basis(basis)
        if not isinstance(joints, Mapping):
            raise InputError(f"joints is {shown(joints)}; expected position and orientation by the joint's name")
        position, orientation, seen = np.zeros((26, 3)), np.zeros((26, 4)), set[int]()
        for name, pose in joints.items():
            index = joint_index(name)
            if index in seen:
                raise InputError(f"joint = {name!r} is given twice; expected each joint once")
            if not isinstance(pose, Sequence) or len(pose) != 2:
                raise InputError(
                    f"joint {name!r} is {shown(pose)}; expected a position and an orientation; "
                    "where the tracker has lost it, hand in no pose, or one with valid=False"
                )
            position[index] = _vector(pose[0], 3, f"the position of joint {name!r}")
            orientation[index] = _vector(pose[1], 4, f"the orientation of joint {name!r}")
            seen.add(index)
        missing = [name for name in JOINTS[1:] if JOINT[name] not in seen]
        if missing:
            raise InputError(f"joints are missing: {', '.join(missing)}; only the palm may be")
        if JOINT["palm"] not in seen:
            position, orientation = with_palm(position[1:], orientation[1:])
        position_m, orientation_xyzw = axes.to_openxr(position, orientation)
        if valid and along_bones(position_m, orientation_xyzw) < ALONG_BONES:
            raise InputError(_other_basis(axes.name, side, position, orientation))
        return cls(time_ns, side, track_id, position_m, orientation_xyzw, valid)


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
        raise InputError(f"shapes {position.shape} and {orientation.shape}; expected (..., 25, 3) and (..., 25, 4)")
    metacarpal, proximal = JOINT["middle_metacarpal"] - 1, JOINT["middle_proximal"] - 1
    palm = 0.5 * (position[..., metacarpal, :] + position[..., proximal, :])
    return (
        np.concatenate([palm[..., None, :], position], axis=-2),
        np.concatenate([orientation[..., metacarpal, None, :], orientation], axis=-2),
    )


def _vector(value: ArrayLike, count: int, what: str) -> Floats:
    try:
        vector = np.asarray(value)
    except ValueError:  # lists of unequal length
        vector = np.empty(0, object)
    if vector.shape != (count,) or vector.dtype.kind not in "fiu":
        raise InputError(f"{what} is {shown(value)}; expected {count} numbers (3 and 4 numbers a joint)")
    return vector.astype(float)


def _other_basis(stated: str, side: Side, position: Floats, orientation: Floats) -> str:
    """What is wrong with a basis whose -Z axes do not run along the bones, and which one would be right."""
    cure = "no basis of haptics.BASES fits: turn each joint so that it points along its bone as your engine points forward"
    for name, basis in BASES.items():
        pose = basis.to_openxr(position, orientation)
        if along_bones(*pose) >= ALONG_BONES and apparent_side(*pose) == side:
            cure = f"basis={name!r} fits"
            break
    return f"basis = {stated!r} does not fit the joints: their forward axes do not run along the fingers' bones; {cure}"


def mirrored(frame: HandFrame) -> HandFrame:
    """The other hand doing the same: reflected in the plane x = 0.

    ``p -> (-x, y, z)`` and ``R -> M R M`` with ``M = diag(-1, 1, 1)``, which is ``q -> (x, -y, -z, w)``.

    :param frame: of either hand.
    :return: of the other one, with the same time and track.
    """
    return replace(
        frame,
        side="left" if frame.side == "right" else "right",
        position_m=frame.position_m * (-1.0, 1.0, 1.0),
        orientation_xyzw=frame.orientation_xyzw * (1.0, -1.0, -1.0, 1.0),
    )

"""The joints and orientations that a tracker does not give, made of those that it does.

- The palm is the middle of the middle finger's metacarpal, with that joint's orientation, as ``frame.with_palm`` has it.
- The metacarpals of the four fingers begin at ``METACARPAL_SHARE`` of the distance from the knuckle to the wrist (assumed, from
  bone lengths of adults).
- Orientations come from the bones (``bones.orientations``); the palm's forward axis runs from the wrist to the middle knuckle,
  its other one along the knuckles.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from haptics.scene.hands.bones import orientations, unit
from haptics.scene.hands.frame import Floats, with_palm
from haptics.scene.hands.joints import FINGERS, JOINT, JOINTS

METACARPAL_SHARE = 0.72
CLEAR = 0.2
"""The sine of an angle by which no finger bends back at its middle joint (assumed; a stretched finger has none)."""
METACARPALS = tuple(f"{finger}_metacarpal" for finger in FINGERS[1:])
MAKEABLE = ("palm", *METACARPALS)
"""Joints that can be made of the others."""
REQUIRED = tuple(name for name in JOINTS if name not in MAKEABLE)
"""Joints that a tracker must give."""


def put_in_metacarpals(position_m: Floats, made: Collection[str]) -> None:
    """Put in where the metacarpals of fingers begin.

    :param position_m: (n, 26, 3), metres; changed.
    :param made: joints to put in; those that are no metacarpals of fingers are passed over.
    """
    wrist_m = position_m[:, JOINT["wrist"]]
    for name in METACARPALS:
        if name in made:
            knuckle_m = position_m[:, JOINT[name] + 1]
            position_m[:, JOINT[name]] = knuckle_m + METACARPAL_SHARE * (wrist_m - knuckle_m)


def completed(
    position_m: Floats, orientation_xyzw: Floats, side: str, made: Collection[str], turned: bool
) -> tuple[Floats, Floats]:
    """Put in the joints and orientations that are missing.

    :param position_m: (n, 26, 3), metres; finite but for the joints in ``made``.
    :param orientation_xyzw: (n, 26, 4), unit quaternions; looked at unless ``turned``.
    :param side: ``left`` or ``right``.
    :param made: joints to put in, of ``MAKEABLE``.
    :param turned: whether to make all orientations.
    :return: both, whole.
    """
    position_m, orientation_xyzw = position_m.copy(), orientation_xyzw.copy()
    put_in_metacarpals(position_m, made)
    if "palm" in made:
        position_m = with_palm(position_m[:, 1:], orientation_xyzw[:, 1:])[0]
    if turned or any(name in made for name in METACARPALS):
        forward, dorsal = palm_axes(position_m, side)
        from_bones = orientations(position_m, forward, dorsal, side)
        which = slice(None) if turned else [JOINT[name] for name in METACARPALS if name in made]
        orientation_xyzw[:, which] = from_bones[:, which]
    if "palm" in made:
        orientation_xyzw = with_palm(position_m[:, 1:], orientation_xyzw[:, 1:])[1]
    return position_m, orientation_xyzw


def palm_axes(position_m: Floats, side: str) -> tuple[Floats, Floats]:
    """The palm's axes from where wrist and knuckles are.

    :param position_m: (n, 26, 3), metres.
    :param side: ``left`` or ``right``.
    :return: forward, from the wrist to the middle knuckle, and dorsal, out of the back of the hand; (n, 3) each, of length 1,
        at right angles. Of joints that lie in one point or line, any such directions.
    """
    forward = position_m[:, JOINT["middle_proximal"]] - position_m[:, JOINT["wrist"]]
    across = position_m[:, JOINT["little_proximal"]] - position_m[:, JOINT["index_proximal"]]
    forward = _sound(forward, np.broadcast_to([0.0, 0.0, -1.0], forward.shape))
    least = np.eye(3)[np.abs(forward).argmin(axis=1)]
    dorsal = np.cross(across, forward) if side == "right" else np.cross(forward, across)
    return forward, _sound(dorsal, np.cross(least, forward))


def _sound(vector: Floats, instead: Floats) -> Floats:
    """Directions of vectors, and another where one has no length."""
    lost = ~(np.linalg.norm(vector, axis=1, keepdims=True) > 1e-9)
    return unit(np.where(lost, instead, vector))


def bent_back(position_m: Floats, side: str) -> bool:
    """Whether the fingers bend out of the back of the hand, which no fingers do.

    :param position_m: (n, 26, 3), metres.
    :param side: ``left`` or ``right``, as the hand is labelled.
    :return: whether the second bones of the four fingers are turned back from the first, by ``CLEAR`` in the median.
    """
    forward, dorsal = palm_axes(position_m, side)
    across, sines = np.cross(forward, dorsal), []
    for finger in FINGERS[1:]:
        knuckle = JOINT[f"{finger}_proximal"]
        first, second = (position_m[:, knuckle + at + 1] - position_m[:, knuckle + at] for at in (0, 1))
        size = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        sines.append(np.vecdot(np.cross(first, second), across)[size > 0] / size[size > 0])
    every = np.concatenate(sines)
    return len(every) > 0 and float(np.median(every)) > CLEAR

"""What can be measured on a pose, wherever the hand is and however it is turned: lengths between joints, and how far a finger
is stretched."""

from __future__ import annotations

import numpy as np

from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import FINGERS, JOINT, JOINTS

BONES: tuple[str, ...] = tuple(name for name in JOINTS[2:] if not name.endswith("_tip"))
"""The nineteen bones of the fingers, each named as the joint that it begins at."""
SHORTEST_BONE_M = 0.005
"""Of what is shorter, no share can be told (assumed): some trackers make bones up that have no length."""

_FROM = np.array([JOINT[name] for name in BONES])
_PATHS = {
    finger: [JOINT["wrist"], *(JOINT[f"{finger}_{part}"] for part in ("proximal", "intermediate", "distal", "tip"))]
    for finger in FINGERS[1:]
}


def bone_lengths(position_m: Floats) -> Floats:
    """Lengths of the bones.

    :param position_m: joints, (..., 26, 3), metres.
    :return: (..., 19), metres, in the order of ``BONES``.
    """
    return np.linalg.norm(position_m[..., _FROM + 1, :] - position_m[..., _FROM, :], axis=-1)


def knuckle_breadth(position_m: Floats) -> Floats:
    """How far the knuckles of index and little finger are apart.

    :param position_m: joints, (..., 26, 3), metres.
    :return: (...), metres.
    """
    return np.linalg.norm(position_m[..., JOINT["index_proximal"], :] - position_m[..., JOINT["little_proximal"], :], axis=-1)


def stretch(position_m: Floats, finger: str) -> float:
    """How straight a finger is, with the palm before it: wrist to tip, as a share of the way over its joints.

    :param position_m: joints of one pose, (26, 3), metres.
    :param finger: any but the thumb.
    :return: 0 to 1; about 0.98 in a flat hand and 0.4 in a fist.
    """
    path = position_m[_PATHS[finger]]
    way_m = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    return float(np.linalg.norm(path[-1] - path[0])) / way_m if way_m > 0.0 else 0.0


def thumb_to(position_m: Floats, finger: str) -> Floats:
    """From the joint at the thumb's tip to that of a finger's.

    :param position_m: joints, (..., 26, 3), metres.
    :param finger: any but the thumb.
    :return: (..., 3), metres.
    """
    return position_m[..., JOINT[f"{finger}_tip"], :] - position_m[..., JOINT["thumb_tip"], :]

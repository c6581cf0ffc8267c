"""Whether a hand is of the side that its label states, and its joints have the axes that they should.

Seen along its fingers with the back up, a right hand has its thumb on the left. So the knuckles, counted from the thumb's side,
run along the palm's own +X axis in a right hand and against it in a left one, whatever the label. Trackers and converters
mix hands up where pictures are mirrored.

A joint's -Z runs along its bone toward the tip. Read in another engine's basis it does not, though the points alone still look
like a hand.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from haptics.scene.hands.joints import JOINT, JOINTS, SIDES

CLEAR = 0.5
"""To decide, the knuckles' line must lie along the palm's axis by at least this cosine in the median (assumed; hands: 0.9)."""
ALONG_BONES = 0.5
"""Below this cosine in the median, joints do not point along their bones (assumed; hands: above 0.9, other bases: 0 or -1)."""
_BONES = np.array([index for index, name in enumerate(JOINTS) if name.endswith(("_proximal", "_intermediate", "_distal"))])


def along_bones(position_m: ArrayLike, orientation_xyzw: ArrayLike) -> float:
    """How well the joints point along their fingers' bones.

    :param position_m: (26, 3), metres.
    :param orientation_xyzw: (26, 4), quaternions of any length but zero.
    :return: the median cosine between a joint's -Z and the bone it begins, -1 to 1; 1 where most bones have no length.
    """
    position, turn = np.asarray(position_m, float), np.asarray(orientation_xyzw, float)
    bones, (x, y, z, w) = position[_BONES + 1] - position[_BONES], turn[_BONES].T
    forward = -np.stack([2.0 * (x * z + y * w), 2.0 * (y * z - x * w), w * w + z * z - x * x - y * y], axis=-1)
    size = np.linalg.norm(bones, axis=-1) * (x * x + y * y + z * z + w * w)
    known = size > 0
    if np.count_nonzero(known) < len(_BONES) / 2:
        return 1.0
    return float(np.median(np.vecdot(bones, forward)[known] / size[known]))


def apparent_side(position_m: ArrayLike, orientation_xyzw: ArrayLike) -> str | None:
    """The side that thumb and palm suggest.

    :param position_m: (26, 3) of a pose, or (n, 26, 3) of many, metres.
    :param orientation_xyzw: (26, 4) or (n, 26, 4), unit quaternions.
    :return: ``left`` or ``right``, or None where that is not clear.
    """
    position, turn = np.atleast_3d(np.asarray(position_m, float)), np.asarray(orientation_xyzw, float)
    position, turn = np.reshape(position, (-1, 26, 3)), np.reshape(turn, (-1, 26, 4))
    x, y, z, w = turn[:, JOINT["palm"]].T
    palm_x = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)], axis=-1)
    knuckles = position[:, JOINT["little_proximal"]] - position[:, JOINT["index_proximal"]]
    length = np.linalg.norm(knuckles, axis=-1)
    if not (length > 0).any():
        return None
    cosine = float(np.median((np.vecdot(knuckles, palm_x) / np.where(length > 0, length, 1.0))[length > 0]))
    return None if abs(cosine) < CLEAR else SIDES[int(cosine > 0)]


def contradiction(side: str, apparent: str | None) -> str | None:
    """Compare a hand's label with its shape.

    :param side: the label, ``left`` or ``right``.
    :param apparent: as ``apparent_side`` returns it.
    :return: in words that they do not agree, or None.
    """
    if apparent is None or apparent == side:
        return None
    return (
        f"the hand labelled {side} looks like a {apparent} one: its thumb is on the {apparent} hand's side of its palm; "
        "either the label is wrong or the palm's normal"
    )

"""Joint orientations from where the joints are.

For trackers and models that give points only. A joint's -Z is its bone's direction (the tip's is the last bone's); what is
left, the turn about the bone, comes from the palm: a finger bends about the palm's +X axis, and the thumb about that axis
turned by ``THUMB_TURN_RAD`` about the palm's forward axis, as its pad faces the fingers rather than the floor.
"""

from __future__ import annotations

import numpy as np

from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import FINGERS, JOINT, JOINTS

THUMB_TURN_RAD = np.deg2rad(60.0)
"""How far the thumb's bending axis is turned from the fingers' (assumed; the thumb's pad is pronated by 60 to 80 degrees)."""

_BONE_FROM = np.array([JOINT[name] - (1 if name.endswith("_tip") else 0) for name in JOINTS[2:]])
_BONE_TO = _BONE_FROM + 1
_IS_THUMB = np.array([name.startswith(FINGERS[0]) for name in JOINTS[2:]])
_SHORTEST_BONE_M = 1e-6


def orientations(position_m: Floats, forward: Floats, dorsal: Floats, side: str) -> Floats:
    """Joint orientations from where the joints are.

    :param position_m: (n, 26, 3), metres.
    :param forward: (n, 3), from the palm toward the fingers; any length but zero.
    :param dorsal: (n, 3), out of the back of the hand; not along ``forward``.
    :param side: ``left`` or ``right``.
    :return: unit quaternions, (n, 26, 4), of like sign from frame to frame.
    """
    palm = np.empty((len(position_m), 3, 3))
    palm[..., 2] = -unit(forward)
    palm[..., 0] = unit(np.cross(dorsal, palm[..., 2]))
    palm[..., 1] = np.cross(palm[..., 2], palm[..., 0])

    turn = THUMB_TURN_RAD if side == "right" else -THUMB_TURN_RAD
    thumb_axis = palm @ np.array([np.cos(turn), np.sin(turn), 0.0])
    bend_axis = np.where(_IS_THUMB[:, None], thumb_axis[:, None], palm[:, None, :, 0])

    bone = position_m[:, _BONE_TO] - position_m[:, _BONE_FROM]
    length = np.linalg.norm(bone, axis=-1, keepdims=True)
    ahead = -palm[:, None, :, 2]
    along = np.where(length > _SHORTEST_BONE_M, bone / np.maximum(length, _SHORTEST_BONE_M), ahead)
    across = bend_axis - _along(bend_axis, along)
    # The turn of a bone along its own bending axis is undefined; the palm's forward axis serves instead.
    lost = np.linalg.norm(across, axis=-1, keepdims=True) < 1e-6
    across = unit(np.where(lost, ahead - _along(ahead, along), across))

    frame = np.empty((len(position_m), 26, 3, 3))
    frame[:, :2] = palm[:, None]
    frame[:, 2:, :, 0] = across
    frame[:, 2:, :, 2] = -along
    frame[:, 2:, :, 1] = np.cross(-along, across)
    return _like_signs(quaternions(frame))


def quaternions(rotation: Floats) -> Floats:
    """Unit quaternions of rotation matrices, by the largest of the four parts.

    :param rotation: (..., 3, 3).
    :return: (..., 4), in order x, y, z, w.
    """
    r = rotation
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    x_w, y_w, z_w = r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]
    x_y, y_z, z_x = r[..., 0, 1] + r[..., 1, 0], r[..., 1, 2] + r[..., 2, 1], r[..., 2, 0] + r[..., 0, 2]
    # Row k is 4 q_k q; the row of the largest part is the best conditioned.
    rows = np.stack(
        [
            np.stack([1 + xx - yy - zz, x_y, z_x, x_w], -1),
            np.stack([x_y, 1 - xx + yy - zz, y_z, y_w], -1),
            np.stack([z_x, y_z, 1 - xx - yy + zz, z_w], -1),
            np.stack([x_w, y_w, z_w, 1 + xx + yy + zz], -1),
        ],
        axis=-2,
    )
    best = np.diagonal(rows, axis1=-2, axis2=-1).argmax(-1)
    return unit(np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :])


def unit(vector: Floats) -> Floats:
    """Directions of vectors, along the last axis.

    :param vector: (..., 3) or of any other length; none of them zero.
    :return: of the same shape, length 1.
    """
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def _along(vector: Floats, direction: Floats) -> Floats:
    return np.sum(vector * direction, axis=-1, keepdims=True) * direction


def _like_signs(quaternion: Floats) -> Floats:
    """q and -q are one rotation; choose each frame's sign to agree with the frame before (and w >= 0 at first)."""
    sign = np.ones(quaternion.shape[:-1])
    sign[:1] = np.where(quaternion[:1, :, 3] < 0, -1.0, 1.0)
    sign[1:] = np.where(np.sum(quaternion[1:] * quaternion[:-1], axis=-1) < 0, -1.0, 1.0)
    return quaternion * np.cumprod(sign, axis=0)[..., None]

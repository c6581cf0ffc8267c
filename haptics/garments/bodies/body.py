"""What a garment needs to know of a body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from haptics.errors import InputError
from haptics.garments.bodies.motions import JOINTS, Pose
from haptics.garments.mesh import Floats, Ints

PARTS = (
    *("head", "torso", "pelvis"),
    *("upper_arm_l", "lower_arm_l", "hand_l", "upper_arm_r", "lower_arm_r", "hand_r"),
    *("upper_leg_l", "lower_leg_l", "foot_l", "upper_leg_r", "lower_leg_r", "foot_r"),
)


class Body(Protocol):
    """A body that can be posed: z up, facing -y, +x its left, in metres.

    The skin is one surface of triangles, anticlockwise seen from outside; it may be open where no garment lies.
    """

    @property
    def name(self) -> str:
        """What ``open_body`` calls it."""
        ...

    @property
    def triangles(self) -> Ints:
        """``(triangles, 3)``."""
        ...

    @property
    def straight_m(self) -> Floats:
        """Vertices of the straight standing body, ``(vertices, 3)``."""
        ...

    @property
    def part_weights(self) -> Mapping[str, Floats]:
        """How far each vertex belongs to each of ``PARTS``, ``(vertices,)`` each; at a vertex they sum to 1."""
        ...

    @property
    def joints_m(self) -> Mapping[str, Floats]:
        """Centre of each of ``JOINTS`` on the straight body, ``(3,)`` each."""
        ...

    def posed_m(self, pose: Pose) -> Floats:
        """Vertices of the skin in a pose; the pelvis stays where it is.

        :param pose: rotation vector (rad) of each turned joint, ``(3,)``; joints left out stay straight.
        :return: positions, m, ``(vertices, 3)``.
        :raises InputError: a joint that the body has not.
        """
        ...


def checked_pose(pose: Pose) -> Pose:
    """A pose in which every joint is known and every rotation is finite.

    :param pose: rotation vector (rad) by joint.
    :return: the same pose.
    :raises InputError: a joint that no body has, or a rotation that is not three finite numbers.
    """
    for joint, turn in pose.items():
        if joint not in JOINTS:
            raise InputError(f"joint {joint!r} is not known; allowed: {', '.join(JOINTS)}")
        if np.shape(turn) != (3,) or not np.isfinite(turn).all():
            raise InputError(f"rotation of {joint} is {turn!r}; expected three finite numbers, rad")
    return pose

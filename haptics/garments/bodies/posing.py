"""Posing a body: each joint turns what lies beyond it, those farthest from the pelvis first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from haptics.garments.bodies.bending import Hinge, turned
from haptics.garments.bodies.body import checked_pose
from haptics.garments.bodies.motions import ARM_DIRECTION, LEG_DIRECTION, Pose
from haptics.garments.mesh import Bools, Floats
from haptics.physics.parameters import Parameters, parameter

_BALLS = ("shoulder_l", "shoulder_r", "hip_l", "hip_r")
_SPINE = ("spine_5", "spine_4", "spine_3", "spine_2", "spine_1")
_LONGEST_SHARE = 0.65
"""Share of the shorter bone at a hinge beyond which no flesh is deformed, so that trunk and hand are not."""


@dataclass(frozen=True)
class Flesh(Parameters):
    """What muscles do at a hinge, for a body 1.75 m tall."""

    arm_bulge_m: float = parameter(0.012, "m", "assumed", "biceps, towards a full turn of the elbow", low=0.0, high=0.03)
    thigh_bulge_m: float = parameter(0.010, "m", "assumed", "hamstrings, towards a full turn of the knee", low=0.0, high=0.03)


FLESH = Flesh()


@dataclass(frozen=True, eq=False)
class Posing:
    """How a body's vertices follow its joints.

    :param straight_m: vertices of the straight body, m, ``(vertices, 3)``.
    :param joints_m: centre of each joint, m, ``(3,)`` each.
    :param shares: how far each vertex follows a shoulder, a hip or a joint of the spine, 0 to 1, ``(vertices,)`` each.
    :param hinges: elbows and knees by name.
    """

    straight_m: Floats
    joints_m: Mapping[str, Floats]
    shares: Mapping[str, Floats]
    hinges: Mapping[str, Hinge]

    def posed_m(self, pose: Pose) -> Floats:
        """Vertices in a pose.

        :param pose: rotation vector (rad) of each turned joint, ``(3,)``; joints left out stay straight.
        :return: positions, m, ``(vertices, 3)``.
        :raises InputError: a joint that no body has, or a rotation that is not three finite numbers.
        """
        checked_pose(pose)
        points = self.straight_m.copy()
        for joint, hinge in self.hinges.items():
            if joint in pose:
                limb = self._limb(joint)
                points[limb] = hinge.bent(points[limb], pose[joint])
        for joint in (*_BALLS, *_SPINE):
            if joint in pose:
                points = turned(points, self.joints_m[joint], pose[joint], self.shares[joint])
        return points

    def _limb(self, hinge: str) -> Bools:
        ball = hinge.replace("elbow", "shoulder").replace("knee", "hip")
        return self.shares[ball] > 0.5


def hinges(
    joints_m: Mapping[str, Floats], ends_m: Mapping[str, Floats], radii_m: Mapping[str, float], scale: float, flesh: Flesh
) -> dict[str, Hinge]:
    """Elbows and knees of a body.

    :param joints_m: centre of each joint, m, ``(3,)`` each.
    :param ends_m: wrists and ankles, m, ``(3,)`` each.
    :param radii_m: radius of the limb at each hinge, m.
    :param scale: the body's height over 1.75 m, no unit.
    :param flesh: how far muscles bulge on a body 1.75 m tall.
    :return: the hinge of each elbow and knee, by name.
    """
    found = {}
    for side in "lr":
        for joint, ball, end, direction, bulge_m in (
            ("elbow", "shoulder", "wrist", ARM_DIRECTION[side], flesh.arm_bulge_m),
            ("knee", "hip", "ankle", LEG_DIRECTION[side], flesh.thigh_bulge_m),
        ):
            centre = joints_m[f"{joint}_{side}"]
            upper = float(np.linalg.norm(centre - joints_m[f"{ball}_{side}"]))
            shorter = min(upper, float(np.linalg.norm(ends_m[f"{end}_{side}"] - centre)))
            name = f"{joint}_{side}"
            found[name] = Hinge(centre, direction, radii_m[name], _LONGEST_SHARE * shorter, 0.45 * upper, scale * bulge_m)
    return found

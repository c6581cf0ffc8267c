"""The motions that a garment is designed against, as rotations of the joints.

A pose gives each joint's rotation from the straight standing body: by joint, a rotation vector in radians about the world axes
of that body (z up, facing -y, +x its left), of the part below the joint relative to the part above. In the straight pose the
arms hang 40 degrees away from the trunk, palms forward, and the legs stand 8 degrees outward, so that no two regions of cloth
touch; elbows and knees are straight.

The motions are those of thesis 5.6.2 (Table 5.1) and 6.4.1. Their poses came from recordings that are not published: which
joint takes what share of the angle, and the angles themselves, are assumed; elbow and knee turn by 60 degrees, as far as the
wearers of 5.7 did (45 to 60).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from haptics.garments.mesh import Floats
from haptics.units import in_range

Pose = Mapping[str, Floats]
STRAIGHT: Pose = {}
"""No joint turned: the straight standing body."""

JOINTS = (
    *("spine_1", "spine_2", "spine_3", "spine_4", "spine_5"),  # the lowest first
    *("shoulder_l", "elbow_l", "shoulder_r", "elbow_r", "hip_l", "knee_l", "hip_r", "knee_r"),
)

ARM_DEG = 40.0
"""How far the straight body's arms hang from the vertical."""
LEG_DEG = 8.0
"""How far the straight body's legs stand from the vertical."""

_arm, _leg = np.radians(ARM_DEG), np.radians(LEG_DEG)
ARM_DIRECTION = {"l": np.array([np.sin(_arm), 0, -np.cos(_arm)]), "r": np.array([-np.sin(_arm), 0, -np.cos(_arm)])}
LEG_DIRECTION = {"l": np.array([np.sin(_leg), 0, -np.cos(_leg)]), "r": np.array([-np.sin(_leg), 0, -np.cos(_leg)])}
_FORWARD, _UP = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])

ELBOW_AXIS = {side: np.cross(ARM_DIRECTION[side], _FORWARD) for side in "lr"}
"""Turning about it brings the forearm, or the whole arm, forward."""
KNEE_AXIS = {side: np.cross(LEG_DIRECTION[side], -_FORWARD) for side in "lr"}
"""Turning about it brings the shin backward."""
RAISE_AXIS = {"l": np.array([0.0, -1.0, 0.0]), "r": np.array([0.0, 1.0, 0.0])}
INWARD_AXIS = {"l": -_UP, "r": _UP}
"""Turning about it swings an arm inward in front of the body."""
BEND_AXIS = np.array([1.0, 0.0, 0.0])
"""Turning the upper body about it bends it forward; turning a thigh about its opposite flexes the hip."""

_SPINE = ("spine_1", "spine_2", "spine_3", "spine_4", "spine_5")


@dataclass(frozen=True, eq=False)
class Motion:
    """One motion: all joints in proportion to one angle.

    :param name: its key in ``MOTIONS``.
    :param turns: rotation of each joint over the motion's angle, as a rotation vector: axis times the joint's share, ``(3,)``
        each.
    :param default_deg: the angle where none is asked for, degrees.
    :param largest_deg: the largest angle allowed, degrees; the smallest is 1 degree.
    :param straightens: it runs from bent to straight, else from straight to bent.
    """

    name: str
    turns: Pose
    default_deg: float
    largest_deg: float
    straightens: bool = False

    def checked_deg(self, angle_deg: float | None) -> float:
        """The angle of the motion, or the default for None.

        :param angle_deg: angle asked for, degrees from straight, 1 to ``largest_deg``; None takes the default.
        :return: the angle, degrees.
        :raises InputError: it is not 1 degree to ``largest_deg``.
        """
        asked = self.default_deg if angle_deg is None else angle_deg
        return in_range(f"angle of {self.name}", asked, 1.0, self.largest_deg, "deg")

    def pose(self, angle_deg: float) -> Pose:
        """The body part of the motion's travel from straight.

        :param angle_deg: degrees from straight, 0 to ``largest_deg``.
        :return: rotation vector (rad) of each turned joint.
        :raises InputError: it is not 0 degree to ``largest_deg``.
        """
        angle = np.radians(in_range(f"angle of {self.name}", angle_deg, 0.0, self.largest_deg, "deg"))
        return {joint: angle * turn for joint, turn in self.turns.items()} if angle else STRAIGHT

    def rest_deg(self, angle_deg: float) -> float:
        """The angle at which a garment for this motion is put on, where it is not stretched.

        :param angle_deg: angle of the motion, degrees, as in ``checked_deg``.
        :return: degrees from straight.
        :raises InputError: as in ``checked_deg``.
        """
        return self.checked_deg(angle_deg) if self.straightens else 0.0

    def end_deg(self, angle_deg: float) -> float:
        """The angle at which the motion ends.

        :param angle_deg: angle of the motion, degrees, as in ``checked_deg``.
        :return: degrees from straight.
        :raises InputError: as in ``checked_deg``.
        """
        return 0.0 if self.straightens else self.checked_deg(angle_deg)

    def path(self, angle_deg: float, steps: int) -> list[float]:
        """Angles from rest to the end, both included, equally far apart.

        :param angle_deg: angle of the motion, degrees, as in ``checked_deg``.
        :param steps: intervals, 1 to 10,000.
        :return: ``steps + 1`` angles, degrees from straight.
        :raises InputError: an angle that is not allowed, or fewer than 1 or more than 10,000 steps.
        """
        count = int(in_range("steps", steps, 1, 10_000))
        return [float(a) for a in np.linspace(self.rest_deg(angle_deg), self.end_deg(angle_deg), count + 1)]


def _spine(*shares: float) -> dict[str, Floats]:
    return {joint: share * BEND_AXIS for joint, share in zip(_SPINE, shares, strict=True)}


def _both(joint: str, axis: Mapping[str, Floats], share: float = 1.0) -> dict[str, Floats]:
    return {f"{joint}_{side}": share * axis[side] for side in "lr"}


_HIP_AXIS = {side: -BEND_AXIS for side in "lr"}
_ELBOW, _KNEE = {"elbow_l": ELBOW_AXIS["l"]}, {"knee_l": KNEE_AXIS["l"]}
_LUNGE = {"hip_l": -BEND_AXIS, "knee_l": KNEE_AXIS["l"], "hip_r": 0.3 * BEND_AXIS, "knee_r": 0.4 * KNEE_AXIS["r"]}

MOTIONS: dict[str, Motion] = {
    motion.name: motion
    for motion in (
        Motion("elbow_flexion", _ELBOW, 60.0, 120.0),
        Motion("elbow_extension", _ELBOW, 60.0, 120.0, straightens=True),
        Motion("knee_flexion", _KNEE, 60.0, 120.0),
        Motion("knee_extension", _KNEE, 60.0, 120.0, straightens=True),
        # the upper back rounds more than the lower, and the shoulders roll inward with it; the angle is the whole spine's
        Motion("slouch", {**_spine(0.1, 0.15, 0.2, 0.25, 0.3), **_both("shoulder", INWARD_AXIS, 0.6)}, 40.0, 70.0),
        Motion("crouch", {**_both("hip", _HIP_AXIS), **_both("knee", KNEE_AXIS)}, 90.0, 110.0),
        Motion("lunge", _LUNGE, 80.0, 100.0),
        Motion("arms_forward", _both("shoulder", ELBOW_AXIS), 80.0, 100.0),
        Motion("arms_raise", _both("shoulder", RAISE_AXIS), 80.0, 100.0),
        # half of the angle between trunk and thighs is the spine's, half is the hips'
        Motion("bend_forward", {**_spine(0.1, 0.1, 0.1, 0.1, 0.1), **_both("hip", _HIP_AXIS, 0.5)}, 80.0, 100.0),
    )
}

"""The shape of the analytic body: tapered capsules about the bones, joined smoothly.

Distances are of a mannequin 1.75 m tall in the straight pose (``motions``). Its sizes are those of a common adult, assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptics.garments.bodies.motions import ARM_DIRECTION, LEG_DIRECTION
from haptics.garments.mesh import Floats

HEIGHT_M = 1.75
ELBOW_RADIUS_M, KNEE_RADIUS_M = 0.041, 0.056
BLEND_M = 0.017
"""Capsules melt into each other over about three times this distance."""


@dataclass(frozen=True, eq=False)
class Capsule:
    """All points within a radius, which tapers linearly, of the segment from ``a_m`` to ``b_m``; flattened from front to back.

    :param a_m: one end of the segment, m, ``(3,)``.
    :param b_m: the other end, m, ``(3,)``.
    :param radius_a_m: radius at ``a_m``, m.
    :param radius_b_m: radius at ``b_m``, m.
    :param depth: depth (along y) over width, no unit; 1 is round.
    """

    a_m: Floats
    b_m: Floats
    radius_a_m: float
    radius_b_m: float
    depth: float = 1.0

    def distance_m(self, points_m: Floats) -> Floats:
        """Signed distance, negative inside; where tapered or flattened a little off, but zero on the surface.

        :param points_m: the points, m, ``(points, 3)``.
        :return: distances, m, ``(points,)``.
        """
        squeeze = np.array([1.0, 1.0 / self.depth, 1.0])
        along = (self.b_m - self.a_m) * squeeze
        from_a = (points_m - self.a_m) * squeeze
        fraction = np.clip(from_a @ along / (along @ along), 0.0, 1.0)
        radius = self.radius_a_m + (self.radius_b_m - self.radius_a_m) * _eased(fraction)
        return (np.linalg.norm(from_a - fraction[:, None] * along, axis=1) - radius) * self.depth


def _eased(fraction: Floats) -> Floats:
    """0 to 1 with no slope at the ends, so that neighbouring capsules join without an edge."""
    return fraction**2 * (3 - 2 * fraction)


def _point(x: float, y: float, z: float) -> Floats:
    return np.array([x, y, z])


_MIRROR = np.array([-1.0, 1.0, 1.0])
_SHOULDER, _HIP = _point(0.185, 0.0, 1.41), _point(0.098, 0.0, 0.90)
_UPPER_ARM, _LOWER_ARM, _HAND = 0.285, 0.25, 0.10
_UPPER_LEG, _LOWER_LEG = 0.42, 0.40


def _left_joints() -> dict[str, Floats]:
    arm, leg = ARM_DIRECTION["l"], LEG_DIRECTION["l"]
    return {
        "shoulder_l": _SHOULDER,
        "elbow_l": _SHOULDER + _UPPER_ARM * arm,
        "wrist_l": _SHOULDER + (_UPPER_ARM + _LOWER_ARM) * arm,
        "hip_l": _HIP,
        "knee_l": _HIP + _UPPER_LEG * leg,
        "ankle_l": _HIP + (_UPPER_LEG + _LOWER_LEG) * leg,
    }


def _landmarks() -> dict[str, Floats]:
    left = _left_joints()
    right = {f"{name[:-1]}r": _MIRROR * at for name, at in left.items()}
    spine = {f"spine_{i + 1}": _point(0.0, 0.0, 1.00 + 0.085 * i) for i in range(5)}
    return {**spine, **left, **right, "waist": _point(0, 0, 1.0), "neck": _point(0, 0, 1.515)}


LANDMARKS_M = _landmarks()
"""Joints, and where parts end that no joint ends: wrists, ankles, waist, neck."""


def _bones() -> dict[str, tuple[Floats, Floats]]:
    at, bones = LANDMARKS_M, {}
    for side in "lr":
        arm, leg = ARM_DIRECTION[side], LEG_DIRECTION[side]
        bones |= {
            f"upper_arm_{side}": (at[f"shoulder_{side}"], at[f"elbow_{side}"]),
            f"lower_arm_{side}": (at[f"elbow_{side}"], at[f"wrist_{side}"]),
            f"hand_{side}": (at[f"wrist_{side}"], at[f"wrist_{side}"] + _HAND * arm),
            f"upper_leg_{side}": (at[f"hip_{side}"], at[f"knee_{side}"]),
            f"lower_leg_{side}": (at[f"knee_{side}"], at[f"ankle_{side}"]),
            f"foot_{side}": (at[f"ankle_{side}"], at[f"ankle_{side}"] + 0.05 * leg),
        }
    middle = {name: _point(0, 0, z) for name, z in (("pelvis", 0.92), ("waist", 1.0), ("neck", 1.515), ("crown", 1.68))}
    return {
        **bones,
        "pelvis": (middle["pelvis"], middle["waist"]),
        "torso": (middle["waist"], middle["neck"]),
        "head": (middle["neck"], middle["crown"]),
    }


BONES = _bones()
"""The line in the middle of each part, from end to end, by part."""


def _limbs(side: str) -> dict[str, list[Capsule]]:
    at = {name[:-2]: point for name, point in LANDMARKS_M.items() if name.endswith(f"_{side}")}
    arm, leg = ARM_DIRECTION[side], LEG_DIRECTION[side]
    belly = at["elbow"] + 0.07 * arm
    calf = at["knee"] + 0.12 * leg + _point(0, 0.012, 0)
    toes = at["ankle"] + _point(0, -0.15, -0.045)
    return {
        "arm": [
            Capsule(at["shoulder"], at["elbow"], 0.054, ELBOW_RADIUS_M),
            Capsule(at["elbow"], belly, ELBOW_RADIUS_M, 0.043),
            Capsule(belly, at["wrist"], 0.043, 0.028),
            Capsule(at["wrist"], at["wrist"] + _HAND * arm, 0.030, 0.035),
        ],
        "leg": [
            Capsule(at["hip"], at["knee"], 0.085, KNEE_RADIUS_M),
            Capsule(at["knee"], calf, KNEE_RADIUS_M, 0.056),
            Capsule(calf, at["ankle"], 0.056, 0.040),
            Capsule(at["ankle"], toes, 0.042, 0.032),
        ],
    }


def _trunk() -> list[Capsule]:
    shoulders = [Capsule(_point(0, 0.01, 1.44), LANDMARKS_M[f"shoulder_{side}"], 0.062, 0.056) for side in "lr"]
    return [
        Capsule(_point(0, 0, 0.955), _point(0, 0, 1.08), 0.165, 0.138, 0.74),
        Capsule(_point(0, 0, 1.08), _point(0, 0, 1.28), 0.138, 0.158, 0.74),
        Capsule(_point(0, 0, 1.28), _point(0, 0, 1.36), 0.158, 0.130, 0.72),
        *shoulders,
    ]


def _head() -> list[Capsule]:
    return [
        Capsule(_point(0, 0.0, 1.42), _point(0, 0.0, 1.58), 0.056, 0.056),
        Capsule(_point(0, -0.015, 1.60), _point(0, -0.005, 1.66), 0.072, 0.088),
    ]


REGIONS: dict[str, list[Capsule]] = {
    "trunk": _trunk(),
    "head": _head(),
    **{f"{limb}_{side}": capsules for side in "lr" for limb, capsules in _limbs(side).items()},
}


def region_distance_m(region: str, points_m: Floats) -> Floats:
    """Smooth signed distance from one region: -k log sum exp(-d / k), k = ``BLEND_M``.

    :param region: one of ``REGIONS``.
    :param points_m: the points, m, ``(points, 3)``.
    :return: distances, m, negative inside, ``(points,)``.
    """
    return _melted([capsule.distance_m(points_m) for capsule in REGIONS[region]])


def distance_m(points_m: Floats) -> Floats:
    """Smooth signed distance from the whole mannequin.

    :param points_m: the points, m, ``(points, 3)``.
    :return: distances, m, negative inside, ``(points,)``.
    """
    return _melted([region_distance_m(region, points_m) for region in REGIONS])


def gradient(points_m: Floats, step_m: float = 1e-5) -> Floats:
    """Gradient of ``distance_m`` by central differences.

    :param points_m: the points, m, ``(points, 3)``.
    :param step_m: half the distance between the two points of a difference, m.
    :return: gradients, no unit, ``(points, 3)``.
    """
    columns = []
    for axis in range(3):
        offset = np.zeros(3)
        offset[axis] = step_m
        columns.append((distance_m(points_m + offset) - distance_m(points_m - offset)) / (2 * step_m))
    return np.stack(columns, axis=1)


def _melted(distances: list[Floats]) -> Floats:
    stacked = np.stack(distances)
    nearest = stacked.min(axis=0)
    return nearest - BLEND_M * np.log(np.exp((nearest - stacked) / BLEND_M).sum(axis=0))

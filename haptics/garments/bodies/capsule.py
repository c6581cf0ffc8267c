"""The analytic body: the mannequin's mesh, shipped, and its pose by formulas alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files

import numpy as np

from haptics.garments.bodies import mannequin
from haptics.garments.bodies.bending import smooth_step
from haptics.garments.bodies.mannequin import LANDMARKS_M, region_distance_m
from haptics.garments.bodies.motions import ARM_DIRECTION, JOINTS, LEG_DIRECTION, Pose
from haptics.garments.bodies.posing import FLESH, Flesh, Posing, hinges
from haptics.garments.mesh import Floats, Ints
from haptics.physics.parameters import Parameters, parameter

_SIZES = "sizes of a common adult"


@dataclass(frozen=True)
class CapsulePhenotype(Parameters):
    """What can be chosen of the analytic body."""

    height_m: float = parameter(mannequin.HEIGHT_M, "m", "assumed", _SIZES, low=1.4, high=2.1)
    girth: float = parameter(1.0, "", "assumed", "thickness of all parts over that of the mannequin as tall", low=0.8, high=1.25)


_SHOULDER_BLEND_M, _HIP_BLEND_M = 0.14, 0.20
"""Lengths over which trunk blends into arm, or into leg, by the difference of the distances from them. Assumed."""
_OVER_HIP_M = 0.12
"""Height above the hips from which nothing follows a leg. Assumed."""
_SPINE_BLEND_M = 0.14
"""Length over which each of the spine's joints acts. Assumed."""
_SEAM_M = 0.12
"""Length over which one part's weight blends into the next along a limb, or at the waist and neck."""
_BETWEEN_LIMBS_M = 0.06
"""Length over which the left leg blends into the right, by the difference of the distances from them."""


class CapsuleBody:
    """A mannequin of tapered capsules joined smoothly, which needs no package beyond numpy.

    :param phenotype: ``height_m`` (1.4 to 2.1 m) scales all of it, ``girth`` (0.8 to 1.25) the distance of the skin from the
        bones; None takes the defaults.
    :param flesh: how far muscles bulge at elbows and knees.
    :raises InputError: a name or a value that is not allowed.
    """

    name = "capsule"

    def __init__(self, phenotype: Mapping[str, float] | None = None, flesh: Flesh = FLESH) -> None:
        self.phenotype = CapsulePhenotype().with_values(**(phenotype or {}))
        self.flesh = flesh
        with np.load(str(files("haptics.garments.bodies") / "capsule.npz")) as shipped:
            self._mannequin_m: Floats = shipped["vertices_m"].astype(np.float64)
            self.triangles: Ints = shipped["triangles"].astype(np.int64)
        self._scale = self.phenotype.height_m / mannequin.HEIGHT_M
        self.joints_m: dict[str, Floats] = {joint: self._scale * LANDMARKS_M[joint] for joint in JOINTS}
        self.part_weights: dict[str, Floats] = self._weights()
        self.straight_m: Floats = self._straight()

    def _straight(self) -> Floats:
        """The mannequin, thickened about its bones, then scaled."""
        thicker = self._mannequin_m.copy()
        for part, weight in self.part_weights.items():
            a, b = (np.asarray(end) for end in mannequin.BONES[part])
            along = np.clip((self._mannequin_m - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            thicker += (self.phenotype.girth - 1) * weight[:, None] * (self._mannequin_m - a - np.outer(along, b - a))
        return self._scale * thicker

    def _weights(self) -> dict[str, Floats]:
        points, weights = self._mannequin_m, {}
        trunk = np.ones(len(points))
        for side in "lr":
            for limb, joints, parts, direction in (
                ("arm", ("elbow", "wrist"), ("upper_arm", "lower_arm", "hand"), ARM_DIRECTION[side]),
                ("leg", ("knee", "ankle"), ("upper_leg", "lower_leg", "foot"), LEG_DIRECTION[side]),
            ):
                whole = self._limb_share[f"{limb}_{side}"]
                trunk = trunk - whole
                middle, end = (_beyond(points, LANDMARKS_M[f"{joint}_{side}"], direction) for joint in joints)
                shares = (1 - middle, middle * (1 - end), middle * end)
                weights.update({f"{part}_{side}": whole * share for part, share in zip(parts, shares, strict=True)})
        up = np.array([0.0, 0.0, 1.0])
        above_waist, above_neck = (_beyond(points, LANDMARKS_M[at], up) for at in ("waist", "neck"))
        shares = {"head": above_neck, "torso": above_waist * (1 - above_neck), "pelvis": (1 - above_waist) * (1 - above_neck)}
        return {**{part: trunk * share for part, share in shares.items()}, **weights}

    @cached_property
    def _limb_share(self) -> dict[str, Floats]:
        """How far each vertex follows a shoulder or a hip: by its distance from the limb, the trunk and the other limbs."""
        limbs = [f"{limb}_{side}" for limb in ("arm", "leg") for side in "lr"]
        distance = {region: region_distance_m(region, self._mannequin_m) for region in mannequin.REGIONS}
        trunk = np.minimum(distance["trunk"], distance["head"])
        shares = {}
        for limb in limbs:
            blend = _SHOULDER_BLEND_M if limb.startswith("arm") else _HIP_BLEND_M
            others = np.min([distance[other] for other in limbs if other != limb], axis=0)
            of_two = smooth_step(0.5 + (others - distance[limb]) / _BETWEEN_LIMBS_M)
            shares[limb] = of_two * smooth_step(0.5 + (trunk - distance[limb]) / blend)
            if limb.startswith("leg"):
                shares[limb] *= 1 - smooth_step((self._mannequin_m[:, 2] - LANDMARKS_M[f"hip_{limb[-1]}"][2]) / _OVER_HIP_M)
        return shares

    @cached_property
    def _posing(self) -> Posing:
        ends = {end: self._scale * LANDMARKS_M[end] for end in ("wrist_l", "wrist_r", "ankle_l", "ankle_r")}
        thickness = self._scale * self.phenotype.girth
        radii = {"elbow": thickness * mannequin.ELBOW_RADIUS_M, "knee": thickness * mannequin.KNEE_RADIUS_M}
        bends = hinges(
            self.joints_m, ends, {f"{joint}_{side}": radii[joint] for joint in radii for side in "lr"}, self._scale, self.flesh
        )
        limbs = {"shoulder": "arm", "hip": "leg"}
        balls = {f"{joint}_{side}": self._limb_share[f"{limb}_{side}"] for joint, limb in limbs.items() for side in "lr"}
        spine = {joint: self._above(joint) for joint in JOINTS if joint.startswith("spine")}
        return Posing(self.straight_m, self.joints_m, {**balls, **spine}, bends)

    def posed_m(self, pose: Pose) -> Floats:
        """Vertices of the skin in a pose; the pelvis stays where it is.

        :param pose: rotation vector (rad) of each turned joint, ``(3,)``; joints left out stay straight.
        :return: positions, m, ``(vertices, 3)``.
        :raises InputError: a joint that no body has, or a rotation that is not three finite numbers.
        """
        return self._posing.posed_m(pose)

    def _above(self, joint: str) -> Floats:
        """How far each vertex follows one of the spine's joints: arms fully, legs not at all."""
        height = self._mannequin_m[:, 2] - LANDMARKS_M[joint][2]
        arms = self._limb_share["arm_l"] + self._limb_share["arm_r"]
        legs = self._limb_share["leg_l"] + self._limb_share["leg_r"]
        return arms + (1 - arms) * (1 - legs) * smooth_step(0.5 + height / _SPINE_BLEND_M)


def _beyond(points: Floats, at: Floats, direction: Floats) -> Floats:
    return smooth_step(0.5 + (points - at) @ direction / _SEAM_M)

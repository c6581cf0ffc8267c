"""A person's body: anny's shapes (extra ``body``), posed as the analytic body is.

anny's own posing, linear skinning, folds the inside of a bent elbow into itself and has no muscles; here it only straightens the
body (``anny_rig``). From there flesh follows the joints by anny's weights (``posing``). What is made of a phenotype is kept in
the user's cache; once it is there, neither anny nor torch is loaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from haptics.errors import InputError
from haptics.garments.bodies.anny_rig import ENDS, FORMAT, missing, rest_shape, straight_rig
from haptics.garments.bodies.body import PARTS
from haptics.garments.bodies.cache import Arrays, kept
from haptics.garments.bodies.mannequin import HEIGHT_M
from haptics.garments.bodies.motions import ARM_DIRECTION, JOINTS, LEG_DIRECTION, Pose
from haptics.garments.bodies.posing import FLESH, Flesh, Posing, hinges
from haptics.garments.mesh import Floats, Ints
from haptics.units import in_range

ADULT = {"gender": 0.5, "age": 2 / 3, "muscle": 0.5, "weight": 0.5, "height": 0.5, "proportions": 0.5}
"""Phenotype where none is given, and the names that are allowed, each 0 to 1. An age of 2/3 is a young adult, 1/3 a child."""

_AT_HINGE_M = 0.02
"""Skin within this distance of a hinge, along the limb, gives the limb's thickness there."""


class AnnyBody:
    """A body of a phenotype.

    :param phenotype: any of ``ADULT``'s names, 0 to 1 each; the rest as in ``ADULT``.
    :param flesh: how far muscles bulge at elbows and knees.
    :raises InputError: a name or a value that is not allowed, or anny or torch is missing.
    """

    name = "anny"

    def __init__(self, phenotype: Mapping[str, float] | None = None, flesh: Flesh = FLESH) -> None:
        self.phenotype = _checked(phenotype or {})
        self.flesh = flesh
        key = {"phenotype": self.phenotype, "anny": _anny_version(), "format": FORMAT}
        rig = kept("anny", key, lambda: _made(self.phenotype))
        self.triangles: Ints = rig["triangles"]
        self.straight_m: Floats = rig["straight_m"]
        self.part_weights: dict[str, Floats] = dict(zip(PARTS, rig["parts"].T, strict=True))
        self.joints_m: dict[str, Floats] = dict(zip(JOINTS, rig["joints_m"], strict=True))
        self._ends_m: dict[str, Floats] = dict(zip(ENDS, rig["ends_m"], strict=True))
        self._shares: dict[str, Floats] = dict(zip(JOINTS, rig["shares"].T, strict=True))

    def posed_m(self, pose: Pose) -> Floats:
        """Vertices of the skin in a pose; the pelvis stays where it is.

        :param pose: rotation vector (rad) of each turned joint, ``(3,)``; joints left out stay straight.
        :return: positions, m, ``(vertices, 3)``.
        :raises InputError: a joint that no body has, or a rotation that is not three finite numbers.
        """
        return self._posing.posed_m(pose)

    @cached_property
    def _posing(self) -> Posing:
        scale = float(np.ptp(self.straight_m[:, 2])) / HEIGHT_M
        radii = {joint: self._radius_m(joint) for joint in JOINTS if joint.startswith(("elbow", "knee"))}
        bends = hinges(self.joints_m, self._ends_m, radii, scale, self.flesh)
        return Posing(self.straight_m, self.joints_m, self._shares, bends)

    def _radius_m(self, hinge: str) -> float:
        """Mean distance of the skin at a hinge from the bone."""
        kind, side = hinge[:-2], hinge[-1]
        along = ARM_DIRECTION[side] if kind == "elbow" else LEG_DIRECTION[side]
        limb = self._shares[f"{'shoulder' if kind == 'elbow' else 'hip'}_{side}"] > 0.5
        offset = self.straight_m[limb] - self.joints_m[hinge]
        distance = offset @ along
        near = np.abs(distance) < _AT_HINGE_M
        return float(np.linalg.norm(offset[near] - np.outer(distance[near], along), axis=1).mean())


def _checked(phenotype: Mapping[str, float]) -> dict[str, float]:
    for name in phenotype:
        if name not in ADULT:
            raise InputError(f"phenotype {name!r} is unknown to anny; allowed: {', '.join(ADULT)}")
    return {name: in_range(f"phenotype {name}", phenotype.get(name, adult), 0.0, 1.0) for name, adult in ADULT.items()}


def _anny_version() -> str:
    try:
        return version("anny")
    except PackageNotFoundError as error:
        raise missing("anny") from error


def _made(phenotype: Mapping[str, float]) -> Arrays:
    rig = straight_rig(rest_shape(phenotype))
    return {
        "straight_m": rig.vertices_m,
        "triangles": rig.triangles,
        "shares": rig.shares,
        "parts": rig.parts,
        "joints_m": np.stack([rig.at_m[joint] for joint in JOINTS]),
        "ends_m": np.stack([rig.at_m[end] for end in ENDS]),
    }

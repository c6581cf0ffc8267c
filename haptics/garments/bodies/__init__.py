"""Bodies that garments are made for."""

from __future__ import annotations

from collections.abc import Mapping

from haptics.garments.bodies.body import PARTS, Body
from haptics.garments.bodies.motions import MOTIONS, STRAIGHT, Motion, Pose
from haptics.units import one_of

__all__ = ["BODIES", "MOTIONS", "PARTS", "STRAIGHT", "Body", "Motion", "Pose", "open_body"]

BODIES = ("capsule", "anny")


def open_body(name: str = "capsule", phenotype: Mapping[str, float] | None = None) -> Body:
    """A body by name.

    :param name: ``capsule``, analytic, or ``anny`` (extra ``body``), a person's shape.
    :param phenotype: what is chosen of its shape, by name (see ``CapsulePhenotype`` and ``anny_body.ADULT``); None takes the
        defaults.
    :return: the body, standing straight.
    :raises InputError: an unknown body, a phenotype it has not, a value out of range, or a package that is missing.
    """
    one_of("body", name, BODIES)
    if name == "anny":
        from haptics.garments.bodies.anny_body import AnnyBody

        return AnnyBody(phenotype)
    from haptics.garments.bodies.capsule import CapsuleBody

    return CapsuleBody(phenotype)

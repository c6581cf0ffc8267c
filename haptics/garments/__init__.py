"""Kinesthetic garments: worn on a simulated body, reinforced where that resists a motion most, and cut (thesis chapter 5).

    body = open_body("capsule")
    worn = wear(body, cut_garment(body, "sleeve"), MOTIONS["elbow_flexion"])
    designs = optimise(worn.simulation, coverage=0.15)
    over_the_motion = evaluate_motion(worn, designs.final.design, worn.motion.path(worn.angle_deg, 12))
    pattern = make_pattern(worn.simulation.rest, designs.final.design, "sleeve")

Each name is imported when first used: scipy, numba and the optional packages only where they are needed.

| folder | what is in it |
| --- | --- |
| `bodies` | bodies that can be posed, and the motions |
| `cut` | cutting a garment out of a body's skin, finer and coarser |
| `equilibrium` | membrane, contact, Newton's method: the garment as worn |
| `design` | where to reinforce: evolution, drawn designs, the store |
| `patch` | the bench's patch between clamps |
| `pattern` | seams, flat panels, files for the cutter |
| `views` | pictures and the rerun recording |
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

_FACE = {
    "open_body": "haptics.garments.bodies",
    "MOTIONS": "haptics.garments.bodies",
    "cut_garment": "haptics.garments.garment",
    "garment_from_mesh": "haptics.garments.garment",
    "wear": "haptics.garments.equilibrium.wearing",
    "evaluate_motion": "haptics.garments.equilibrium.wearing",
    "optimise": "haptics.garments.design.topology",
    "best_drawn": "haptics.garments.design.drawn",
    "make_pattern": "haptics.garments.pattern",
    "write_pattern": "haptics.garments.pattern",
}

__all__ = [*_FACE]  # pyright: ignore[reportUnsupportedDunderAll]

if TYPE_CHECKING:
    from haptics.garments.bodies import MOTIONS as MOTIONS, open_body as open_body
    from haptics.garments.design.drawn import best_drawn as best_drawn
    from haptics.garments.design.topology import optimise as optimise
    from haptics.garments.equilibrium.wearing import evaluate_motion as evaluate_motion, wear as wear
    from haptics.garments.garment import cut_garment as cut_garment, garment_from_mesh as garment_from_mesh
    from haptics.garments.pattern import make_pattern as make_pattern, write_pattern as write_pattern


def __getattr__(name: str) -> Any:
    if name in _FACE:
        return getattr(importlib.import_module(_FACE[name]), name)
    raise AttributeError(f"module 'haptics.garments' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

"""What there is to choose from here: bodies, garments, motions, levels, materials, solvers."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

from haptics.extras import install
from haptics.garments.bodies import BODIES, MOTIONS
from haptics.garments.bodies.anny_body import ADULT
from haptics.garments.bodies.capsule import CapsulePhenotype
from haptics.garments.equilibrium.cholesky import installed_solvers
from haptics.garments.garment import LEVELS, OPENINGS
from haptics.garments.materials import CLOTH, INTERFACE, REINFORCED
from haptics.physics.parameters import provenance

SOLVERS: Mapping[str, tuple[str, str]] = {
    "pardiso": ("oneMKL through pypardiso: BSD-3-Clause, MKL under Intel's Simplified Software License", "extra `solver`"),
    "cholmod": ("SuiteSparse through cvxopt: GPL-3.0", "pip install cvxopt, if you accept its licence"),
    "superlu": ("SuperLU through scipy: BSD-3-Clause", "always there"),
}
"""Licence of each sparse solver, and how to get it; fastest first."""
_NEEDED = {"capsule": (), "anny": ("anny", "torch")}
_SHAPES = {"capsule": "analytic mannequin", "anny": "a person's shape (MakeHuman), Apache-2.0"}


def catalogue() -> dict[str, Any]:
    """All of it as plain data.

    :return: JSON-ready lists under ``bodies``, ``garments``, ``motions``, ``levels``, ``materials`` and ``solvers``; units are in
        the keys.
    """
    here = installed_solvers()
    return {
        "bodies": [_body(name) for name in BODIES],
        "garments": [{"name": name, "openings": count} for name, count in OPENINGS.items()],
        "motions": [
            {
                "name": motion.name,
                "default_deg": motion.default_deg,
                "smallest_deg": 1.0,
                "largest_deg": motion.largest_deg,
                "from": "bent" if motion.straightens else "straight",
                "joints": sorted(motion.turns),
            }
            for motion in MOTIONS.values()
        ],
        "levels": [{"name": name, "vertices_about": count} for name, count in LEVELS.items()],
        "materials": [
            {"of": of, **{key: getattr(row, key) for key in ("name", "value", "unit", "provenance", "source", "low", "high")}}
            for of, parameters in (("cloth", CLOTH), ("reinforced", REINFORCED), ("interface", INTERFACE))
            for row in provenance(parameters)
        ],
        "solvers": [
            {"name": name, "installed": name in here, "licence": licence, "get": get} for name, (licence, get) in SOLVERS.items()
        ],
    }


def _body(name: str) -> dict[str, Any]:
    missing = [module for module in _NEEDED[name] if find_spec(module) is None]
    if name == "anny":
        phenotype = [{"name": key, "default": value, "low": 0.0, "high": 1.0} for key, value in ADULT.items()]
    else:
        rows = provenance(CapsulePhenotype())
        phenotype = [{"name": row.name, "default": row.value, "low": row.low, "high": row.high} for row in rows]
    return {
        "name": name,
        "what": _SHAPES[name],
        "installed": not missing,
        "get": f"needs {', '.join(missing)}: {install('body')}" if missing else None,
        "phenotype": phenotype,
    }

"""The unit and the axis up that fit drawn points to the surface that they were drawn around."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.meshes.frame import AXES, UNITS, in_frame

Floats = NDArray[np.float64]

_POINTS = 300
"""So many of the points are looked at."""
_SHARE = 0.98
"""Of them so many must lie near: a drawn thing may end away from the body."""


@dataclass(frozen=True)
class Fit:
    """How points are interpreted, and how far from the surface most of them are then.

    :param unit: one of ``UNITS``.
    :param up: which axis of the file points up.
    :param quarter_turns: about the vertical, 0 to 3.
    :param distance_m: 98 % of the points are this near to the surface, or nearer, metres.
    """

    unit: str
    up: str
    quarter_turns: int
    distance_m: float


def best_fit(
    points: Floats,
    surface_m: Floats,
    units: Iterable[str] = tuple(UNITS),
    ups: Iterable[str] = AXES,
    turns: Iterable[int] = (0, 1, 2, 3),
) -> Fit:
    """The nearest of all these interpretations of the points, for a surface that is z up; the first of equals.

    :param points: as in the file, ``(n, 3)``.
    :param surface_m: points of the surface, close to each other, ``(m, 3)``, metres.
    :param units: candidates, names in ``UNITS``.
    :param ups: candidates for the axis that points up, of ``AXES``.
    :param turns: candidates for the quarter turns about the vertical.
    :return: the interpretation with the smallest distance.
    """
    from scipy.spatial import KDTree

    tree, some = KDTree(surface_m), points[:: max(1, len(points) // _POINTS)]
    best = None
    for unit in units:
        for up in ups:
            for quarter in turns:
                distance, _ = tree.query(in_frame(some, UNITS[unit], up, "z", quarter))
                found = Fit(unit, up, quarter, float(np.quantile(distance, _SHARE)))
                if best is None or found.distance_m < best.distance_m:
                    best = found
    assert best is not None
    return best

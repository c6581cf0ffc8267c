"""Straight bands across the square patch of the 2D bench: where they lie, and how much of it they cover (thesis 5.6.1).

The square is centred on the origin, x along the pull. A band at the angle a is the set |n . p - offset| <= width / 2 with
n = (-sin a, cos a), from edge to edge. A layout is a union of bands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import cos, radians, sin

import numpy as np

from haptics.garments.mesh import Bools, Floats
from haptics.units import in_range


@dataclass(frozen=True)
class Band:
    """A straight band across the square.

    :param angle_deg: from the pull, degrees, anticlockwise.
    :param width_m: m, from 0.
    :param offset_m: of its middle line from the centre, along ``normal``, m.
    """

    angle_deg: float
    width_m: float
    offset_m: float = 0.0

    @property
    def normal(self) -> Floats:
        """Unit vector across the band."""
        return np.array([-sin(radians(self.angle_deg)), cos(radians(self.angle_deg))])

    def holds(self, points_m: Floats) -> Bools:
        """Which points lie in it.

        :param points_m: the points, m, ``(points, 2)``.
        :return: true where inside or on the edge, ``(points,)``.
        """
        return np.abs(points_m @ self.normal - self.offset_m) <= 0.5 * self.width_m


Layout = tuple[Band, ...]


def covered(layout: Layout, side_m: float) -> float:
    """Share of the square that a layout covers: the areas of its bands, less those of pairs, plus those of triples and so on.

    :param layout: bands, which may cross.
    :param side_m: of the square, m.
    :return: 0 to 1.
    """
    total = 0.0
    for count in range(1, len(layout) + 1):
        for bands in combinations(layout, count):
            total += (-1) ** (count + 1) * _common_area(bands, side_m)
    return total / side_m**2


def fitted(shape: Callable[[float], Layout], coverage: float, side_m: float) -> Layout:
    """The layout of a family that covers a share of the square exactly.

    :param shape: the layout whose bands have a given width (m).
    :param coverage: 0 to 1.
    :param side_m: of the square, m.
    :return: the layout; empty for a coverage of 0.
    :raises InputError: a coverage outside 0 to 1, or more than the family can cover.
    """
    from scipy.optimize import root_scalar

    in_range("coverage", coverage, 0.0, 1.0)
    if coverage == 0.0:
        return ()
    widest = 2.0 * side_m
    in_range("coverage", coverage, 0.0, covered(shape(widest), side_m))
    found = root_scalar(lambda w: covered(shape(float(w)), side_m) - coverage, bracket=(0.0, widest), xtol=1e-14)
    return shape(float(found.root))


def parallel(count: int, angle_deg: float, side_m: float) -> Callable[[float], Layout]:
    """Equal bands at one angle, their middle lines evenly spread over the square's width across them.

    :param count: number of bands, from 1.
    :param angle_deg: from the pull, degrees.
    :param side_m: of the square, m.
    :return: the layout by the width of its bands, m.
    """
    across = side_m * (abs(sin(radians(angle_deg))) + abs(cos(radians(angle_deg))))
    offsets = [across * ((i + 0.5) / count - 0.5) for i in range(count)]
    return lambda width_m: tuple(Band(angle_deg, width_m, offset) for offset in offsets)


def crossed(angle_deg: float) -> Callable[[float], Layout]:
    """Two bands through the centre, at plus and minus an angle from the pull.

    :param angle_deg: from the pull, degrees.
    :return: the layout by the width of its bands, m.
    """
    return lambda width_m: (Band(angle_deg, width_m), Band(-angle_deg, width_m))


def _common_area(bands: Sequence[Band], side_m: float) -> float:
    half = 0.5 * side_m
    polygon = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    for band in bands:
        for sign in (1.0, -1.0):
            polygon = _cut(polygon, sign * band.normal, 0.5 * band.width_m + sign * band.offset_m)
    x, y = polygon.T if len(polygon) else (np.zeros(0), np.zeros(0))
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _cut(polygon: Floats, normal: Floats, limit: float) -> Floats:
    """The part of a convex polygon where normal . p <= limit."""
    beyond = polygon @ normal - limit
    kept: list[Floats] = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if beyond[i] <= 0:
            kept.append(polygon[i])
        if beyond[i] * beyond[j] < 0:
            kept.append(polygon[i] + beyond[i] / (beyond[i] - beyond[j]) * (polygon[j] - polygon[i]))
    return np.array(kept).reshape(-1, 2)

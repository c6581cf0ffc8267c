"""Outlines to cut: the reinforcement of a flat panel without the zigzag of the mesh, at kept area and shape (thesis 5.7).

The zigzag goes by a smoothing spline: of all curves near the mesh edges the one with

    sum |x - x_mesh|^2 + l^4 integral |x''|^2  minimal,

which damps waves shorter than about six l and leaves longer ones. Points on the panel's own outline stay, so that reinforcement
meets across a seam. Then each loop is moved along its normal until it bounds the area that it had.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry as Geometry

from haptics.garments.mesh import Bools, Floats
from haptics.garments.pattern.seams import FlatPanel

POINTS_PER_SMOOTHING = 4
AREA_KEPT = 1e-3
"""An outline whose area is off by more than this share (clipped by the panel's edge) is smoothed less."""
LESS = (1.0, 0.5, 0.25)
"""Shares of the smoothing length tried in turn when outlines would cross; after them the mesh's own edges."""
FEATURE_ROUNDING = 1.0
"""What opening by a disc of radius r takes off a corner is no narrow feature: less than this times r^2."""


@dataclass(frozen=True, eq=False)
class Reinforcement:
    """What to cut from the reinforcing sheet for one panel, in the panel's flat coordinates, m.

    :param polygons: with holes; outer rings anticlockwise, m.
    :param mesh_area_m2: area of the flat reinforced triangles, m2.
    :param smoothing_m: smoothing length that was used, m; 0 where only the mesh's edges do not cross.
    """

    polygons: tuple[shapely.Polygon, ...]
    mesh_area_m2: float
    smoothing_m: float

    @property
    def area_m2(self) -> float:
        """Area of all polygons, m2."""
        return float(sum(polygon.area for polygon in self.polygons))


def reinforcement(flat: FlatPanel, reinforced: Bools, smoothing_m: float) -> Reinforcement:
    """Outlines of a panel's reinforced triangles.

    :param flat: the panel laid flat.
    :param reinforced: its reinforced triangles, ``(triangles,)``.
    :param smoothing_m: the l of the module's formula, m; about the mesh's edge length takes its zigzag away, 0 leaves it.
    :return: the outlines, with the smoothing that kept area and shape.
    """
    corners = flat.flat_m[flat.panel.mesh.triangles[reinforced]]
    merged = shapely.coverage_union_all(shapely.polygons(corners)) if len(corners) else shapely.MultiPolygon()
    rough = [polygon for polygon in shapely.get_parts(merged) if not polygon.is_empty]
    area = float(merged.area)
    cloth = shapely.Polygon(flat.flat_m[flat.panel.loops[0]])
    held = {tuple(point) for point in flat.flat_m[flat.panel.loops[0]].tolist()}
    for share in LESS if smoothing_m > 0 else ():
        smooth = [_smoothed(polygon, held, share * smoothing_m) for polygon in rough]
        if all(map(shapely.is_valid, smooth)):
            smooth = [polygon if cloth.covers(polygon) else cloth.intersection(polygon) for polygon in smooth]
            if _kept(smooth, rough):
                return Reinforcement(_oriented(smooth), area, share * smoothing_m)
    return Reinforcement(_oriented(rough), area, 0.0)


def too_narrow(polygons: tuple[shapely.Polygon, ...], width_m: float) -> list[tuple[float, float]]:
    """Middles of the places where polygons are narrower than a width.

    :param polygons: outlines, m.
    :param width_m: smallest width, m, above 0.
    :return: positions, m, sorted.
    """
    radius = width_m / 2
    places: list[tuple[float, float]] = []
    for polygon in polygons:
        narrow = polygon.difference(polygon.buffer(-radius).buffer(radius * 1.001))
        parts = [part for part in shapely.get_parts(narrow) if part.area > FEATURE_ROUNDING * radius**2]
        places += [(part.representative_point().x, part.representative_point().y) for part in parts]
    return sorted(places)


def with_allowance(flat: FlatPanel, allowance_m: float) -> Floats:
    """The line to cut the cloth along: the panel's outline, and an allowance for the seams around it.

    :param flat: the panel laid flat.
    :param allowance_m: width of the allowance, m, from 0.
    :return: a closed line without its last point, m, ``(points, 2)``.
    """
    outline = shapely.Polygon(flat.flat_m[flat.panel.loops[0]])
    wider = outline.buffer(allowance_m, join_style="mitre", mitre_limit=2.0) if allowance_m else outline
    return np.asarray(shapely.orient_polygons(wider).exterior.coords)[:-1]


def _oriented(polygons: Sequence[Geometry]) -> tuple[shapely.Polygon, ...]:
    parts = [part for polygon in polygons for part in shapely.get_parts(polygon) if part.geom_type == "Polygon"]
    return tuple(shapely.orient_polygons(part) for part in sorted(parts, key=lambda part: part.bounds))


def _kept(smooth: Sequence[Geometry], rough: Sequence[Geometry]) -> bool:
    alone = all(abs(one.area - other.area) <= AREA_KEPT * other.area for one, other in zip(smooth, rough, strict=True))
    total = sum(polygon.area for polygon in smooth)
    return alone and abs(shapely.union_all(smooth).area - total) <= 1e-9 * total


def _smoothed(polygon: shapely.Polygon, held: set[tuple[float, float]], smoothing_m: float) -> shapely.Polygon:
    rings = [_smooth_ring(np.asarray(ring.coords)[:-1], held, smoothing_m) for ring in (polygon.exterior, *polygon.interiors)]
    return shapely.Polygon(rings[0], rings[1:])


def _smooth_ring(points: Floats, held: set[tuple[float, float]], smoothing_m: float) -> Floats:
    """A closed ring smoothed between the points that are held, and then moved outwards or inwards to its old area."""
    fixed = np.array([tuple(point) in held for point in points.tolist()])
    if not fixed.any():
        curve = _resampled(np.vstack([points, points[:1]]), smoothing_m)[:-1]
        ring, freedom = _spline(curve, smoothing_m, closed=True), np.ones(len(curve))
    else:
        points = np.roll(points, -int(np.argmax(fixed)), axis=0)
        ends = [*np.flatnonzero(np.roll(fixed, -int(np.argmax(fixed)))).tolist(), len(points)]
        around = np.vstack([points, points[:1]])
        pieces: list[Floats] = []
        freedoms: list[Floats] = []
        for start, end in pairwise(ends):
            piece = around[start : end + 1]
            if end - start > 1:
                piece = _spline(_resampled(piece, smoothing_m), smoothing_m, closed=False)
            pieces.append(piece[:-1])
            freedoms.append(np.sin(np.pi * np.arange(len(piece) - 1) / (len(piece) - 1)) if end - start > 1 else np.zeros(1))
        ring, freedom = np.vstack(pieces), np.concatenate(freedoms)
    return _at_area(ring, freedom, _area(points))


def _resampled(curve: Floats, smoothing_m: float) -> Floats:
    """Points at equal distances along a polyline, both ends included."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    steps = max(8, int(np.ceil(along[-1] * POINTS_PER_SMOOTHING / smoothing_m)))
    at = np.linspace(0.0, along[-1], steps + 1)
    even = np.stack([np.interp(at, along, curve[:, i]) for i in range(2)], axis=1)
    even[0], even[-1] = curve[0], curve[-1]
    return even


def _spline(curve: Floats, smoothing_m: float, closed: bool) -> Floats:
    from scipy.sparse import coo_array, eye_array
    from scipy.sparse.linalg import splu

    count = len(curve)
    step = np.linalg.norm(np.diff(curve, axis=0), axis=1).mean()
    middles = np.arange(count) if closed else np.arange(1, count - 1)
    columns = np.concatenate([(middles - 1) % count, middles, (middles + 1) % count])
    weights = np.repeat([1.0, -2.0, 1.0], len(middles))
    bend = coo_array((weights, (np.tile(np.arange(len(middles)), 3), columns)), shape=(len(middles), count)).tocsr()
    system = (eye_array(count) + (smoothing_m / step) ** 4 * (bend.T @ bend)).tocsc()
    if closed:
        return splu(system).solve(curve)
    smooth = curve.copy()
    pull = curve[1:-1] - system[1:-1][:, [0, count - 1]] @ curve[[0, -1]]
    smooth[1:-1] = splu(system[1:-1][:, 1:-1].tocsc()).solve(pull)
    return smooth


def _area(ring: Floats) -> float:
    x, y = ring.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _at_area(ring: Floats, freedom: Floats, area_m2: float) -> Floats:
    """The ring moved along its normals, in proportion to ``freedom``, until it bounds ``area_m2`` (signed)."""
    for _ in range(8):
        chord = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
        outward = np.stack([chord[:, 1], -chord[:, 0]], axis=1) / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-12)
        growth = 0.5 * float(freedom @ np.linalg.norm(chord, axis=1))
        if growth == 0.0:
            break
        ring = ring + (area_m2 - _area(ring)) / growth * freedom[:, None] * outward
    return ring

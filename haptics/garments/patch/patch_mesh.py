"""A triangulation of the square patch that follows straight lines across it, so that every triangle has one material.

Points on the lines, a staggered lattice between them, Delaunay. Where a piece of a line is no edge of the triangulation, or an
edge is long for its distance to a point where lines meet, it is halved and all is triangulated again: strain is singular where
two materials meet a clamp or each other in a corner, and smaller triangles there are the cheapest gain in accuracy.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil, sqrt

import numpy as np

from haptics.errors import InputError
from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh
from haptics.garments.patch.bands import Layout

MAX_ROUNDS = 30
CLEARANCE = 0.6
"""Lattice points nearer than this part of the spacing to a line are left out."""
GRADING = 0.5
"""Longest edge over its distance to the nearest meeting of lines."""
FINEST = 1 / 16
"""Edges below this part of the spacing are not halved for the sake of grading."""
Segment = tuple[Floats, Floats]


def patch_mesh(layout: Layout, side_m: float, elements: int) -> SurfaceMesh:
    """The square, centred on the origin in the plane z = 0, of ``elements`` triangles and those that grading adds.

    :param layout: bands whose edges the triangles follow.
    :param side_m: of the square, m.
    :param elements: number of triangles before grading.
    :return: a flat mesh whose edges follow the bands', m.
    :raises InputError: bands so thin, or so nearly meeting, that no triangulation follows them.
    """
    from scipy.spatial import Delaunay, KDTree

    spacing = side_m * sqrt(4 / (sqrt(3) * elements))
    lines = _lines(layout, 0.5 * side_m)
    meetings = [_meetings(line, lines, side_m) for line in lines]
    near = KDTree(np.concatenate([a + np.array(t)[:, None] * (b - a) for (a, b), t in zip(lines, meetings, strict=True)]))
    pieces = [_divided(line, met, spacing) for line, met in zip(lines, meetings, strict=True)]
    free = _lattice(lines, side_m, spacing)

    def too_long(a: Floats, b: Floats) -> Bools:
        length = np.linalg.norm(b - a, axis=1)
        return (length > FINEST * spacing) & (length > GRADING * near.query(0.5 * (a + b))[0])

    for _ in range(MAX_ROUNDS):
        points, numbers = _merged([*pieces, free], side_m)
        triangles = Delaunay(points).simplices.astype(np.int64)
        edges = np.unique(_keys(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), len(points)))
        on_lines, done, first = [], True, 0
        for k, piece in enumerate(pieces):
            ends = np.stack([numbers[first : first + len(piece) - 1], numbers[first + 1 : first + len(piece)]], axis=1)
            first += len(piece)
            keys = _keys(ends, len(points))
            on_lines.append(keys)
            halve = np.flatnonzero((ends[:, 0] != ends[:, 1]) & (~_among(keys, edges) | too_long(piece[:-1], piece[1:])))
            pieces[k] = np.insert(piece, halve + 1, 0.5 * (piece[halve] + piece[halve + 1]), axis=0)
            done &= len(halve) == 0
        between = np.setdiff1d(edges, np.concatenate(on_lines))
        a, b = points[between // len(points)], points[between % len(points)]
        halve = too_long(a, b)
        free = np.concatenate([free, 0.5 * (a[halve] + b[halve])])
        if done and not halve.any():
            return _oriented(points, triangles)
    raise InputError(f"no triangulation follows the edges of {layout}; make the bands wider, or set them farther apart")


def _keys(ends: Ints, points: int) -> Ints:
    """One number for each pair of point numbers, in either order."""
    return ends.min(axis=1) * points + ends.max(axis=1)


def _among(keys: Ints, sorted_keys: Ints) -> Bools:
    return sorted_keys[np.minimum(np.searchsorted(sorted_keys, keys), len(sorted_keys) - 1)] == keys


def _lines(layout: Layout, half: float) -> list[Segment]:
    """The square's sides and the bands' edges within it."""
    corners = [np.array(p) for p in ((-half, -half), (half, -half), (half, half), (-half, half))]
    lines = [(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    for band in layout:
        along = np.array([band.normal[1], -band.normal[0]])
        for sign in (-1.0, 1.0):
            base = (band.offset_m + 0.5 * sign * band.width_m) * band.normal
            ends = [_reach(base, along, half), _reach(base, -along, half)]
            if ends[0] + ends[1] > 1e-9 * half:  # it crosses the square
                lines.append((base - ends[1] * along, base + ends[0] * along))
    return [(np.clip(a, -half, half), np.clip(b, -half, half)) for a, b in lines]


def _reach(base: Floats, along: Floats, half: float) -> float:
    """How far a line goes from ``base`` before it leaves the square for good; the two reaches may add up to nothing."""
    reach = np.inf
    for i in range(2):
        if abs(along[i]) > 1e-12:
            reach = min(reach, (np.sign(along[i]) * half - base[i]) / along[i])
        elif abs(base[i]) > half:
            return -np.inf
    return float(reach)


def _meetings(line: Segment, lines: list[Segment], side_m: float) -> list[float]:
    """Where on a line (0 to 1) it begins, ends, meets another or another ends on it."""
    a, b = line
    along = b - a
    found = [0.0, 1.0]
    for c, d in lines:
        cross = along[0] * (d - c)[1] - along[1] * (d - c)[0]
        if abs(cross) > 1e-12 * side_m**2:
            t = float((c - a)[0] * (d - c)[1] - (c - a)[1] * (d - c)[0]) / cross
            u = float((c - a)[0] * along[1] - (c - a)[1] * along[0]) / cross
            if -1e-9 <= t <= 1 + 1e-9 and -1e-9 <= u <= 1 + 1e-9:
                found.append(min(max(t, 0.0), 1.0))
    return sorted(found)


def _divided(line: Segment, meetings: list[float], spacing: float) -> Floats:
    """Points along a line, no farther apart than the spacing, with one at each meeting."""
    a, b = line
    length = float(np.linalg.norm(b - a))
    where = [0.0]
    for s, t in pairwise(meetings):
        count = ceil((t - s) * length / spacing - 1e-9)
        where.extend(s + (t - s) * i / count for i in range(1, count + 1))
    return a + np.array(where)[:, None] * (b - a)


def _lattice(lines: list[Segment], side_m: float, spacing: float) -> Floats:
    rows = max(1, round(side_m / (0.5 * sqrt(3) * spacing)))
    columns = max(1, round(side_m / spacing))
    points = [
        ((j + 0.5 * (i % 2)) / columns * side_m - 0.5 * side_m, i / rows * side_m - 0.5 * side_m)
        for i in range(rows + 1)
        for j in range(columns + 1)
    ]
    free = np.array(points)
    for a, b in lines:
        along = (b - a) / np.linalg.norm(b - a)
        t = np.clip((free - a) @ along, 0.0, np.linalg.norm(b - a))
        free = free[np.linalg.norm(free - a - t[:, None] * along, axis=1) > CLEARANCE * spacing]
    return free[np.abs(free).max(axis=1) < 0.5 * side_m] if len(free) else free


def _merged(groups: list[Floats], side_m: float) -> tuple[Floats, Ints]:
    """All points once, and which each was. Points nearer than a nanopart of the side are one, or lie on the side itself."""
    everything = np.concatenate(groups)
    keys = np.round(everything / (1e-9 * side_m)).astype(np.int64)
    sides = np.abs(keys) == round(0.5e9)
    everything[sides] = np.sign(everything[sides]) * 0.5 * side_m
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return everything[first], inverse.ravel()


def _oriented(points: Floats, triangles: Ints) -> SurfaceMesh:
    flat = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[doubled < 0] = triangles[doubled < 0][:, [0, 2, 1]]
    return SurfaceMesh(flat, triangles[np.abs(doubled) > 1e-20], "patch")  # not the flat ones along the sides

"""Remove what drawing programs leave in meshes beside the surface; each repair is noted in words, with its count.

A mesh that needs nothing keeps its arrays as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptics.meshes.edges import half_edges, open_edges
from haptics.meshes.flat import unfolded
from haptics.meshes.orientation import consistent

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

WELD = 1e-4
"""Vertices of open edges nearer than this part of the mesh's size are one. Assumed: seams of exporters lie 1e-7 to 1e-5 apart."""
WELD_EDGES = 0.1
"""... but never nearer than this part of the usual edge, so that a fine mesh keeps its triangles."""


def cleaned(vertices: Floats, triangles: Ints, min_area: float) -> tuple[Floats, Ints, list[str]]:
    """The surface without copied and unused vertices, triangles without area and those given twice, all facing the same side.

    :param vertices: ``(v, 3)``, finite.
    :param triangles: ``(t, 3)``, of these vertices.
    :param min_area: a triangle below it, in the square of the vertices' unit, has none.
    :return: vertices, triangles, and what was done, in words; a surface of nothing but flat triangles comes out empty.
    """
    notes: list[str] = []
    loose = len(vertices) - len(np.unique(triangles))
    if loose:
        notes.append(f"{_count(loose, 'vertex', 'vertices')} of no triangle left out")
    distinct = _once(triangles)  # before edges are counted: copies would close what is open
    apart = distinct[_corners_apart(distinct)]
    tolerance = _tolerance(vertices, apart)
    solid, flat = _without_flat(vertices, _welded(vertices, apart, tolerance, notes), tolerance, min_area)
    single = _once(solid)
    without_area = len(distinct) - len(apart) + flat
    if without_area:
        notes.append(f"{_count(without_area, 'triangle')} without area left out")
    twice = len(triangles) - len(distinct) + len(solid) - len(single)
    if twice:
        notes.append(f"{_count(twice, 'triangle')} given twice left out")
    triangles, turned = consistent(single)
    if turned:
        notes.append(f"{_count(turned, 'triangle')} turned to face as the rest of {len(triangles)} do")
    return *_used(vertices, triangles), notes


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _tolerance(vertices: Floats, triangles: Ints) -> float:
    if not len(triangles):
        return 0.0
    half = half_edges(triangles)
    edge = float(np.median(np.linalg.norm(vertices[half[:, 0]] - vertices[half[:, 1]], axis=1)))
    return min(WELD * float(np.ptp(vertices[np.unique(triangles)], axis=0).max()), WELD_EDGES * edge)


def _welded(vertices: Floats, triangles: Ints, tolerance: float, notes: list[str]) -> Ints:
    """Only at open edges: where the surface is whole, near vertices are fine detail."""
    from scipy.spatial import KDTree

    rim = np.unique(open_edges(triangles))
    if not len(rim):
        return triangles
    _, first, copy = np.unique(vertices[rim], axis=0, return_index=True, return_inverse=True)
    near = KDTree(vertices[rim[first]]).query_pairs(tolerance, output_type="ndarray")
    pairs = np.concatenate([rim[first][near], np.column_stack([rim, rim[first[copy.ravel()]]])])
    to = _first_of(pairs, len(vertices))
    number = int((to != np.arange(len(to))).sum())
    if not number:
        return triangles
    notes.append(f"{_count(number, 'vertex', 'vertices')} along open edges welded to others within {tolerance:.2g} m")
    return to[triangles]


def _first_of(pairs: Ints, count: int) -> Ints:
    """The lowest number among those that pairs join to each, ``(count,)``."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, label = connected_components(coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count)), directed=False)
    _, first = np.unique(label, return_index=True)
    return first[label]


def _flat(vertices: Floats, triangles: Ints, min_area: float) -> Bools:
    corners = vertices[triangles]
    twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return twice_area <= 2.0 * min_area


def _corners_apart(triangles: Ints) -> Bools:
    a, b, c = triangles.T
    return (a != b) & (b != c) & (c != a)


def _without_flat(vertices: Floats, triangles: Ints, tolerance: float, min_area: float) -> tuple[Ints, int]:
    """The triangles without those that are flat, and how many these were.

    Flat ones with a side shorter than the tolerance shrink to an edge, and so does what lies across that side.
    """
    flat = _flat(vertices, triangles, min_area)
    if not flat.any():
        return triangles, 0
    half = half_edges(triangles[flat])
    short = np.linalg.norm(vertices[half[:, 0]] - vertices[half[:, 1]], axis=1) <= tolerance
    if short.any():
        triangles = _first_of(half[short], len(vertices))[triangles]
        flat = _flat(vertices, triangles, min_area)
    return unfolded(vertices, triangles, flat), int(flat.sum())


def _once(triangles: Ints) -> Ints:
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    return triangles[np.sort(first)] if len(first) < len(triangles) else triangles


def _used(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles] = True
    if used.all():
        return vertices, triangles
    return vertices[used], (np.cumsum(used) - 1)[triangles]

"""Holes of a surface: counted, named by their place, and closed by flat caps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptics.meshes.edges import open_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_NAMED = 3
"""So many holes are named by their place; the rest are counted."""


def holes(triangles: Ints) -> list[Ints]:
    """The open edges round each hole, the hole with the most edges first.

    :param triangles: ``(t, 3)``, vertex indices.
    :return: for each hole ``(edges, 2)``, vertex indices, in their triangles' direction; empty where the surface is closed.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rim = open_edges(triangles)
    if not len(rim):
        return []
    size = int(rim.max()) + 1
    _, label = connected_components(coo_array((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(size, size)), directed=False)
    of_rim = label[rim[:, 0]]
    order = np.argsort(of_rim, kind="stable")
    found = np.split(rim[order], np.flatnonzero(np.diff(of_rim[order])) + 1)
    return sorted(found, key=lambda edges: (-len(edges), int(edges.min())))


def holes_in_words(vertices: Floats, found: list[Ints]) -> str:
    """Count the holes and name the largest by their place.

    :param vertices: ``(v, 3)``.
    :param found: as ``holes`` returns them.
    :return: such as ``2 holes (4 edges about (0, 0, 1); 3 edges about (0, 1, 0))``; three are named at most.
    """
    named = [f"{len(rim)} edges about {place(vertices[np.unique(rim)].mean(axis=0))}" for rim in found[:_NAMED]]
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return f"{len(found)} hole{'s' * (len(found) > 1)} ({'; '.join(named)}{more})"


def capped(vertices: Floats, triangles: Ints, found: list[Ints]) -> tuple[Floats, Ints]:
    """Close holes by a fan of triangles from the middle of each to its rim.

    :param vertices: ``(v, 3)``.
    :param triangles: ``(t, 3)``, vertex indices.
    :param found: the holes to close, as ``holes`` returns them.
    :return: vertices with one more for each hole, and triangles with the fans' at the end.
    """
    middles = [vertices[np.unique(rim)].mean(axis=0) for rim in found]
    fans = [
        np.column_stack([rim[:, ::-1], np.full(len(rim), len(vertices) + number)]) for number, rim in enumerate(found)
    ]  # against the rim's own triangles, as neighbours run
    return np.vstack([vertices, *middles]), np.concatenate([triangles, *fans])


def place(point: Floats) -> str:
    """A point in words.

    :param point: ``(3,)``.
    :return: ``(x, y, z)`` with four digits each.
    """
    return "(" + ", ".join(f"{value:.4g}" for value in point) + ")"

"""Which triangles meet at which edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def half_edges(triangles: Ints) -> Ints:
    """The three sides of each triangle in its direction: all first sides, then all second, then all third.

    :param triangles: ``(t, 3)``, vertex indices.
    :return: ``(3 t, 2)``, vertex indices.
    """
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def open_edges(triangles: Ints) -> Ints:
    """Edges of one triangle only, in that triangle's direction.

    :param triangles: ``(t, 3)``, vertex indices.
    :return: ``(edges, 2)``, vertex indices; empty where the surface is closed.
    """
    half = half_edges(triangles)
    _, inverse, count = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    return half[count[inverse.ravel()] == 1]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Pairs of triangles that share an edge with no third, ``(pairs,)`` each.

    :param one: indices of the two triangles.
    :param other: likewise, with ``one``.
    :param alike: the two run along the edge in opposite directions, so that they face the same side.
    """

    one: Ints
    other: Ints
    alike: Bools


def neighbours(triangles: Ints) -> Neighbours:
    """Find the pairs of triangles that share an edge with no third.

    :param triangles: ``(t, 3)``, vertex indices.
    :return: the pairs; an edge of three triangles or more gives none.
    """
    half = half_edges(triangles)
    key = np.sort(half, axis=1)
    order = np.lexsort((key[:, 1], key[:, 0]))
    key, half = key[order], half[order]
    same = (key[1:] == key[:-1]).all(axis=1)
    before, after = np.concatenate([[False], same[:-1]]), np.concatenate([same[1:], [False]])
    first = np.flatnonzero(same & ~before & ~after)
    triangle = order % len(triangles)
    return Neighbours(triangle[first], triangle[first + 1], half[first, 0] != half[first + 1, 0])

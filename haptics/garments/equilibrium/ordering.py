"""An order of unknowns that keeps a sparse factor small: nested dissection by levels.

Pieces of the mesh are cut in two by a narrow ring of vertices, taken from the levels of a breadth-first walk between two far
ends; the ring comes last, the halves first, each cut again. On a garment SuperLU then takes a third of the time that its own
minimum degree order needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from haptics.garments.mesh import Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_array

LEAF = 8
"""Pieces so small are not cut further."""


def nested_dissection(adjacency: csr_array) -> Ints:
    """The vertices of a symmetric graph in an order of elimination.

    :param adjacency: an entry for each edge in both directions, in CSR form, ``(vertices, vertices)``.
    :return: vertex numbers, each once, ``(vertices,)``.
    """
    count = len(adjacency.indptr) - 1
    order = np.empty(count, dtype=np.int64)
    pieces = [(np.arange(count), 0)]
    while pieces:
        piece, first = pieces.pop()
        cut = _cut(adjacency, piece) if len(piece) > LEAF else None
        if cut is None:
            order[first : first + len(piece)] = piece
            continue
        left, right, ring = cut
        pieces += [(left, first), (right, first + len(left))]
        order[first + len(left) + len(right) : first + len(piece)] = ring
    return order


def _cut(adjacency: csr_array, piece: Ints) -> tuple[Ints, Ints, Ints] | None:
    """Two halves of a piece with no edge between them, and the ring that parts them; None where it cannot be cut."""
    graph = adjacency[piece][:, piece]
    levels = _levels(graph, 0)
    if (levels < 0).any():
        return piece[levels >= 0], piece[levels < 0], piece[:0]
    levels = _levels(graph, int(levels.argmax()))
    width = np.bincount(levels)
    before = np.cumsum(width) - width
    smaller = np.minimum(before, len(piece) - before - width)
    balanced = np.flatnonzero(smaller >= len(piece) / 4)
    if not len(balanced):
        return None
    at = balanced[width[balanced].argmin()]
    ring, beyond = np.flatnonzero(levels == at), np.flatnonzero(levels == at + 1)
    levels[ring[graph[ring][:, beyond].sum(axis=1) == 0]] = at - 1  # these part nothing
    return piece[levels < at], piece[levels > at], piece[levels == at]


def _levels(graph: csr_array, start: int) -> Ints:
    """Steps from ``start`` to each vertex, -1 where no path leads."""
    from scipy.sparse.csgraph import breadth_first_order

    order, before = breadth_first_order(graph, start, directed=False)
    levels = np.full(len(graph.indptr) - 1, -1, dtype=np.int64)
    levels[start] = 0
    for vertex in order[1:]:
        levels[vertex] = levels[before[vertex]] + 1
    return levels

"""The stiffness matrix of a triangle mesh with three unknowns a vertex: one pattern, filled again and again."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from haptics.garments.mesh import Bools, Floats, Ints


class StiffnessPattern:
    """Where the entries of the matrix lie: compressed rows, both triangles, sorted.

    :param vertices: number of vertices.
    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param fixed: unknowns that stay where they are, ``(vertices, 3)``; their rows become those of the identity. None: none.
    """

    def __init__(self, vertices: int, triangles: Ints, fixed: Bools | None = None):
        own = np.arange(vertices)
        rows = np.concatenate([own, *(triangles[:, a] for a in range(3) for _ in range(3))])
        columns = np.concatenate([own, *(triangles[:, b] for _ in range(3) for b in range(3))])
        pairs, inverse = np.unique(rows * vertices + columns, return_inverse=True)
        block_row, block_column = pairs // vertices, pairs % vertices
        start = np.searchsorted(block_row, np.arange(vertices + 1))
        width = 3 * np.diff(start)  # entries in each of a vertex's three rows
        first = 9 * start[:-1]  # of a vertex's entries
        # Entry (r, c) of a block lies at base + r * stride + c.
        self._base = (first[block_row] + 3 * (np.arange(len(pairs)) - start[block_row])).astype(np.int64)
        self._stride = width[block_row].astype(np.int64)
        slots = inverse.ravel()
        self._diagonal = slots[:vertices]
        self._element = slots[vertices:].reshape(9, -1).T.reshape(-1, 3, 3).copy()
        self.indptr: NDArray[np.int32] = np.concatenate([[0], np.cumsum(np.repeat(width, 3))]).astype(np.int32)
        indices = np.empty(9 * len(pairs), dtype=np.int32)
        for r in range(3):
            for c in range(3):
                indices[self._base + r * self._stride + c] = 3 * block_column + c
        self.indices: NDArray[np.int32] = indices
        self._cleared = self._ones = np.empty(0, dtype=np.int64)
        if fixed is not None and fixed.any():
            still = fixed.ravel()
            row = np.repeat(np.arange(3 * vertices), np.diff(self.indptr))
            self._cleared = np.flatnonzero(still[row] | still[indices])
            self._ones = np.flatnonzero(still[row] & (row == indices))

    def values(self, element: Floats, vertex: Floats) -> Floats:
        """The matrix's entries, in the pattern's order.

        :param element: second derivatives of each triangle's energy, N/m, ``(triangles, 9, 9)``.
        :param vertex: those of each vertex's own energy, N/m, ``(vertices, 3, 3)``.
        :return: entries, N/m, ``(entries,)``.
        """
        out = np.zeros(len(self.indices))
        _scatter(element, self._element, vertex, self._diagonal, self._base, self._stride, out)
        out[self._cleared] = 0.0
        out[self._ones] = 1.0
        return out


@njit(cache=True)
def _scatter(element, element_slots, vertex, vertex_slots, base, stride, out):
    for i in range(len(vertex)):
        slot = vertex_slots[i]
        for r in range(3):
            for c in range(3):
                out[base[slot] + r * stride[slot] + c] += vertex[i, r, c]
    for e in range(len(element)):
        for a in range(3):
            for b in range(3):
                slot = element_slots[e, a, b]
                for r in range(3):
                    for c in range(3):
                        out[base[slot] + r * stride[slot] + c] += element[e, 3 * a + r, 3 * b + c]

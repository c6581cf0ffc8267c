"""Loop's subdivision as a sparse matrix: four triangles from each, positions smooth on smooth input.

C. Loop, Smooth Subdivision Surfaces Based on Triangles, 1987, with Warren's weights, and cubic splines along the boundary.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from haptics.garments.mesh import Ints

Sparse = Any
"""A scipy.sparse matrix in CSR form."""


def loop(triangles: Ints, vertices: int) -> tuple[Sparse, Ints]:
    """One subdivision of a manifold mesh, which may have a boundary.

    An edge's new vertex is 3/8 of its ends and 1/8 of the two opposite corners; on the boundary the middle of its ends. An old
    vertex with n neighbours keeps 1 - n b and takes b of each, b = 3 / (8 n), or 3 / 16 for n = 3; on the boundary it keeps 3/4
    and takes 1/8 of its two boundary neighbours.

    :param triangles: vertex numbers of a manifold mesh, ``(triangles, 3)``.
    :param vertices: how many there are.
    :return: matrix ``(vertices + edges, vertices)`` whose rows sum to 1; triangles ``(4 triangles, 3)``, four of each.
    """
    from scipy.sparse import coo_array

    half = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)  # three rows a triangle, opposite its corners 2, 0, 1
    opposite = triangles[:, [2, 0, 1]].ravel()
    edges, of_half, count = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    of_half = of_half.ravel()
    inner = count == 2
    on_rim = np.zeros(vertices, dtype=bool)
    on_rim[edges[~inner]] = True
    valence = np.bincount(edges.ravel(), minlength=vertices)
    share = np.where(valence == 3, 3 / 16, 3 / (8 * np.maximum(valence, 1)))

    both_ways = np.concatenate([edges, edges[:, ::-1]])
    smooth, rim = both_ways[~on_rim[both_ways[:, 0]]], np.concatenate([edges[~inner], edges[~inner][:, ::-1]])
    keeps = np.where(on_rim, 0.75, 1 - valence * share)
    everyone = np.arange(vertices)
    new = vertices + np.arange(len(edges))
    across = inner[of_half]
    entries = (
        (everyone, everyone, keeps),
        (smooth[:, 0], smooth[:, 1], share[smooth[:, 0]]),
        (rim[:, 0], rim[:, 1], np.full(len(rim), 0.125)),
        (np.repeat(new, 2), edges.ravel(), np.repeat(np.where(inner, 0.375, 0.5), 2)),
        (new[of_half[across]], opposite[across], np.full(int(across.sum()), 0.125)),
    )
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    matrix = coo_array((values, (rows, columns)), shape=(vertices + len(edges), vertices)).tocsr()

    a, b, c = triangles.T
    ab, bc, ca = (vertices + of_half).reshape(-1, 3).T
    finer = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return matrix, finer

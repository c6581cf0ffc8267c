"""Making a body's skin fit for cloth: clefts that cloth spans, and weights that change too fast for flesh.

Both work on the mesh alone, with each neighbour of a vertex counting the same.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh


def spanned(vertices_m: Floats, triangles: Ints, where: Bools, fold_deg: float = 45.0, rings: int = 3, rounds: int = 3) -> Floats:
    """Vertices with each sharp fold replaced by the smooth surface that continues what lies around it.

    Within so many rings of an edge whose triangles differ by more than ``fold_deg``, the positions solve L L x = 0, L being the
    mean of the neighbours less the vertex; all others stay. Repeated until no fold is left, at most ``rounds`` times.

    :param vertices_m: positions, m, ``(vertices, 3)``.
    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param where: vertices that may move, ``(vertices,)``.
    :param fold_deg: angle between the normals of two neighbours above which their edge is a fold, degrees.
    :param rings: rings of neighbours around a fold that move with it.
    :param rounds: how often folds are looked for.
    :return: positions, m, ``(vertices, 3)``.
    """
    from scipy.sparse.linalg import spsolve

    means = neighbour_means(triangles, len(vertices_m))
    faired = vertices_m.copy()
    for _ in range(rounds):
        region = _folded(faired, triangles, fold_deg) & where
        if not region.any():
            break
        for _ in range(rings):
            region = (region | (means @ region.astype(np.float64) > 0)) & where
        inner, outer = np.flatnonzero(region), np.flatnonzero(~region)
        laplacian = (means - _identity(len(faired))).tocsr()
        plate = (laplacian.T @ laplacian).tocsr()[inner]
        faired[inner] = np.asarray(spsolve(plate[:, inner].tocsc(), -(plate[:, outer] @ faired[outer])))
    return faired


def spread(field: Floats, triangles: Ints, rounds: int) -> Floats:
    """A field taken half way to the mean of the neighbours again and again.

    :param field: values at the vertices, ``(vertices,)``.
    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param rounds: how often, from 0.
    :return: the smoothed field, ``(vertices,)``.
    """
    means = neighbour_means(triangles, len(field))
    for _ in range(rounds):
        field = 0.5 * (field + means @ field)
    return field


def neighbour_means(triangles: Ints, vertices: int) -> Any:
    """The sparse matrix that takes the mean of each vertex's neighbours.

    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param vertices: how many there are.
    :return: weights in CSR form, rows sum to 1, ``(vertices, vertices)``.
    """
    from scipy.sparse import coo_array

    edges = SurfaceMesh(np.empty((0, 3)), triangles).edges
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    count = np.bincount(rows, minlength=vertices)
    return coo_array((1 / count[rows], (rows, columns)), shape=(vertices, vertices)).tocsr()


def _identity(size: int) -> Any:
    from scipy.sparse import eye_array

    return eye_array(size, format="csr")


def _folded(vertices_m: Floats, triangles: Ints, fold_deg: float) -> Bools:
    """Vertices of the edges whose two triangles differ by more than an angle, ``(vertices,)``."""
    cross = SurfaceMesh(vertices_m, triangles).cross_m2
    normals = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    half = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(half.T)
    pairs = np.flatnonzero((half[order[1:]] == half[order[:-1]]).all(axis=1))
    one, other = order[pairs] // 3, order[pairs + 1] // 3
    sharp = np.sum(normals[one] * normals[other], axis=1) < np.cos(np.radians(fold_deg))
    folded = np.zeros(len(vertices_m), dtype=bool)
    folded[half[order[pairs[sharp]]]] = True
    return folded

"""Cutting a region out of a surface along the zero line of a field, without slivers."""

from __future__ import annotations

import numpy as np

from haptics.errors import InputError
from haptics.garments.cut.subdivision import Sparse
from haptics.garments.mesh import Floats, Ints, SurfaceMesh


def cut_out(vertices_m: Floats, triangles: Ints, field: Floats) -> tuple[Sparse, Ints]:
    """The connected region with most triangles of those where a field is positive.

    Each edge that the zero line crosses has the end that is nearer to the crossing moved onto it; then no edge crosses it, and
    whole triangles lie on one side. Triangles that hang on by a corner, or stick out with two free edges, are trimmed.

    :param vertices_m: positions, m, ``(vertices, 3)``.
    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param field: any value at the vertices, positive where to keep, ``(vertices,)``.
    :return: the region's vertices as mixtures of the given ones, ``(region's, vertices)``; its triangles, ``(n, 3)``.
    :raises InputError: no whole triangle is left where the field is positive.
    """
    from scipy.sparse import csr_array

    partner, share = _onto_zero_line(vertices_m, triangles, field)
    side = np.where(share > 0, 0.0, np.sign(field))[triangles]
    inside = (side.min(axis=1) >= 0) & (side.max(axis=1) > 0)
    if not inside.any():
        raise InputError("nothing is left of the garment: the body lacks the parts that it covers")
    kept = trimmed(largest_piece(triangles[inside]))
    used, flat = np.unique(kept, return_inverse=True)
    rows = np.arange(len(used))
    values = np.concatenate([1 - share[used], share[used]])
    columns = np.concatenate([used, partner[used]])
    weights = csr_array((values, (np.concatenate([rows, rows]), columns)), shape=(len(used), len(vertices_m)))
    weights.eliminate_zeros()
    return weights, flat.reshape(kept.shape).astype(np.int64)


def openings(triangles: Ints) -> int:
    """How many closed loops the boundary has.

    :param triangles: vertex numbers of a manifold mesh, ``(triangles, 3)``.
    :return: number of boundary loops, from 0.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rim = SurfaceMesh(np.empty((0, 3)), triangles).boundary_edges
    used, flat = np.unique(rim, return_inverse=True)
    a, b = flat.reshape(rim.shape).T
    return int(connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(len(used), len(used))), directed=False)[0])


def _onto_zero_line(vertices_m: Floats, triangles: Ints, field: Floats) -> tuple[Ints, Floats]:
    """For each vertex, with which neighbour it is mixed and by what share (0: it stays)."""
    edges = SurfaceMesh(vertices_m, triangles).edges
    ends = field[edges]
    crossed = (ends[:, 0] > 0) != (ends[:, 1] > 0)
    edges, ends = edges[crossed], ends[crossed]
    cut = ends[:, 0] / (ends[:, 0] - ends[:, 1])
    flip = cut > 0.5
    moving, other = np.where(flip, edges[:, 1], edges[:, 0]), np.where(flip, edges[:, 0], edges[:, 1])
    share = np.clip(np.where(flip, 1 - cut, cut), 1e-9, None)
    travel_m = share * np.linalg.norm(vertices_m[moving] - vertices_m[other], axis=1)
    partner, moved = np.arange(len(field)), np.zeros(len(field))
    for edge in np.argsort(-travel_m, kind="stable"):  # the shortest last, so that it stays
        partner[moving[edge]], moved[moving[edge]] = other[edge], share[edge]
    return partner, moved


def largest_piece(triangles: Ints) -> Ints:
    """The triangles of the connected piece that has the largest number of them.

    :param triangles: vertex numbers, ``(triangles, 3)``, at least one.
    :return: those of the piece, in their order, ``(n, 3)``.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = int(triangles.max()) + 1
    _, piece = connected_components(coo_array((np.ones(len(ends)), tuple(ends.T)), shape=(size, size)), directed=False)
    of_triangle = piece[triangles[:, 0]]
    return triangles[of_triangle == np.bincount(of_triangle).argmax()]


def trimmed(triangles: Ints) -> Ints:
    """Triangles without ears (two free edges), nor what then hangs on by a corner; repeated until there is none.

    :param triangles: vertex numbers, ``(triangles, 3)``.
    :return: those kept, ``(n, 3)``.
    """
    while True:
        half = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, inverse, count = np.unique(half, axis=0, return_inverse=True, return_counts=True)
        free = (count[inverse.ravel()] == 1).reshape(-1, 3)
        rims_at = np.bincount(half[free.ravel()].ravel(), minlength=int(triangles.max()) + 1)
        pinched = (rims_at > 2)[triangles].any(axis=1) & free.any(axis=1)
        ears = free.sum(axis=1) >= 2
        bad = ears if ears.any() else pinched
        if not bad.any():
            return triangles
        triangles = largest_piece(triangles[~bad])

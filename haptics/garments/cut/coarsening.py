"""Coarser meshes of a garment, and tying points to the nearest points of a mesh. Needs libigl (extra ``garment``)."""

from __future__ import annotations

from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.extras import install
from haptics.garments.cut.cutting import trimmed
from haptics.garments.cut.fairing import neighbour_means
from haptics.garments.cut.subdivision import Sparse
from haptics.garments.mesh import Floats, Ints, SurfaceMesh

_ROUNDS = 5
"""Rounds of relaxation after edges have been collapsed."""


def coarsened(vertices_m: Floats, triangles: Ints, fewer: int) -> tuple[Sparse, Ints]:
    """About ``fewer`` vertices: shortest edges collapsed, then the inner vertices relaxed within the surface,
    those of the rim laid onto the old rim.

    :param vertices_m: positions, m, ``(vertices, 3)``.
    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param fewer: about how many vertices to keep.
    :return: the new vertices as mixtures of the old, ``(about fewer, vertices)``; the new triangles, ``(n, 3)``.
    :raises InputError: libigl is missing.
    """
    from scipy.sparse import vstack

    rim = SurfaceMesh(vertices_m, triangles).boundary_edges
    wanted = 2 * fewer - int(len(rim) * np.sqrt(fewer / len(vertices_m)))  # Euler: triangles = 2 vertices - rim, but for a few
    given = np.asfortranarray(vertices_m), np.asfortranarray(triangles.astype(np.int32))
    moved, corners, *_ = libigl().decimate(*given, wanted)
    used, corners = np.unique(trimmed(np.asarray(corners)), return_inverse=True)
    moved, corners = np.ascontiguousarray(moved)[used], corners.reshape(-1, 3).astype(np.int64)
    on_rim = np.isin(np.arange(len(moved)), SurfaceMesh(moved, corners).boundary_edges)
    order = np.argsort(np.concatenate([np.flatnonzero(~on_rim), np.flatnonzero(on_rim)]))
    means = neighbour_means(corners, len(moved))
    outer, _ = anchored(moved[on_rim], vertices_m, rim)
    moved[on_rim] = outer @ vertices_m
    for _ in range(_ROUNDS):
        foot, _ = anchored(0.5 * (moved + means @ moved)[~on_rim], vertices_m, triangles)
        moved[~on_rim] = foot @ vertices_m
    inner, _ = anchored(moved[~on_rim], vertices_m, triangles)
    return vstack([inner, outer]).tocsr()[order], corners


def anchored(points_m: Floats, vertices_m: Floats, simplices: Ints) -> tuple[Sparse, Floats]:
    """The nearest points of triangles, or of edges, as mixtures of their vertices, and how far they are.

    :param points_m: the points, m, ``(points, 3)``.
    :param vertices_m: the mesh's vertices, m, ``(vertices, 3)``.
    :param simplices: its triangles or edges as vertex numbers, ``(n, 3)`` or ``(n, 2)``.
    :return: weights, rows sum to 1, ``(points, vertices)``; distances, m, ``(points,)``.
    :raises InputError: libigl is missing.
    """
    from scipy.sparse import csr_array

    squared, nearest, foot = libigl().point_mesh_squared_distance(points_m, vertices_m, simplices)
    corners = simplices[nearest]
    if corners.shape[1] == 2:
        a, b = (vertices_m[corners[:, i]] for i in range(2))
        along = np.sum((foot - a) * (b - a), axis=1) / np.sum((b - a) ** 2, axis=1)
        parts = np.stack([1 - along, along], axis=1)
    else:
        a, b, c = (vertices_m[corners[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        areas = (np.sum(np.cross(e, foot - o) * normal, axis=1) for o, e in ((b, c - b), (c, a - c), (a, b - a)))
        parts = np.stack(list(areas), axis=1)
    parts = np.clip(parts, 0.0, None)
    parts /= parts.sum(axis=1, keepdims=True)
    starts = corners.shape[1] * np.arange(len(points_m) + 1)
    return csr_array((parts.ravel(), corners.ravel(), starts), shape=(len(points_m), len(vertices_m))), np.sqrt(squared)


def libigl() -> Any:
    """The module ``igl``, imported when first needed.

    :return: the module.
    :raises InputError: it is missing.
    """
    try:
        import igl
    except ImportError as error:
        raise InputError(f"garments need libigl; install it with: {install('garment')}") from error
    return igl

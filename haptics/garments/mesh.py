"""Triangle meshes of garments and bodies, and what makes one unfit: every refusal names the place.

Vertices in metres, shape ``(vertices, 3)``; triangles as vertex numbers, shape ``(triangles, 3)``, anticlockwise seen from
outside.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.meshes import Kind, size_fault

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SMALLEST_AREA_M2 = 1e-12
"""A triangle below this is degenerate: 1 um on a side."""
WORN = Kind("a garment or a body", 0.01, 2.5, 0.6, "pass --units {unit}, or units = '{unit}' in Python")
"""A garment or a body of another size was not given in metres."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A triangle mesh. Made by ``checked_mesh`` where the data come from outside.

    :param vertices_m: positions, m, ``(vertices, 3)``.
    :param triangles: vertex numbers, anticlockwise seen from outside, ``(triangles, 3)``.
    :param name: what messages call it.
    """

    vertices_m: Floats
    triangles: Ints
    name: str = field(default="mesh")

    @cached_property
    def cross_m2(self) -> Floats:
        """Edge 01 x edge 02 of each triangle, ``(triangles, 3)``: twice the area, along the outward normal."""
        a, b, c = (self.vertices_m[self.triangles[:, i]] for i in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def areas_m2(self) -> Floats:
        """Area of each triangle, ``(triangles,)``."""
        return 0.5 * np.linalg.norm(self.cross_m2, axis=1)

    @cached_property
    def vertex_areas_m2(self) -> Floats:
        """A third of the area of the triangles around each vertex, ``(vertices,)``."""
        thirds = np.repeat(self.areas_m2 / 3, 3)
        return np.bincount(self.triangles.ravel(), thirds, minlength=len(self.vertices_m)).astype(np.float64)

    @cached_property
    def vertex_normals(self) -> Floats:
        """Outward unit normals at the vertices, weighted by area, ``(vertices, 3)``."""
        total = np.zeros_like(self.vertices_m)
        for i in range(3):
            np.add.at(total, self.triangles[:, i], self.cross_m2)
        return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)

    @cached_property
    def edges(self) -> Ints:
        """Each edge once, lower vertex first, sorted, ``(edges, 2)``."""
        half = _half_edges(self.triangles)
        keys, corners = np.unique(_keys(np.sort(half, axis=1))), _corners(half)
        return np.stack([keys // corners, keys % corners], axis=1)

    @cached_property
    def boundary_edges(self) -> Ints:
        """Edges of one triangle only, in that triangle's direction, ``(edges, 2)``."""
        half = _half_edges(self.triangles)
        _, inverse, count = np.unique(_keys(np.sort(half, axis=1)), return_inverse=True, return_counts=True)
        return half[count[inverse.ravel()] == 1]

    @cached_property
    def centres_m(self) -> Floats:
        """Centre of each triangle, ``(triangles, 3)``."""
        return self.vertices_m[self.triangles].mean(axis=1)

    def at(self, vertices_m: Floats, name: str | None = None) -> SurfaceMesh:
        """The same triangles with other vertex positions; the edges, which do not change, are not looked for again.

        :param vertices_m: positions, m, ``(vertices, 3)``.
        :param name: what messages call it; None keeps the name.
        :return: the moved mesh.
        """
        moved = SurfaceMesh(vertices_m, self.triangles, name or self.name)
        vars(moved)["edges"] = self.edges
        return moved


def checked_mesh(vertices_m: Floats, triangles: Ints, name: str, closed: bool = False) -> SurfaceMesh:
    """A mesh whose every fault has been looked for.

    :param vertices_m: positions, m, ``(n, 3)`` with n at least 3.
    :param triangles: vertex numbers, whole numbers, ``(n, 3)`` with n at least 1.
    :param name: how messages call it, for example a file's name.
    :param closed: it must bound a volume (a body), with its normals outward.
    :return: the mesh, as float64 and int64.
    :raises InputError: not finite; not in metres; vertex numbers out of range; zero area; an edge of more than two triangles;
        two neighbours turned against each other; a vertex where sheets touch in a point; open or inside out where ``closed``. The
        message names the first such place.
    """
    vertices = np.ascontiguousarray(vertices_m, dtype=np.float64)
    corners = np.asarray(triangles)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) < 3:
        raise InputError(f"{name}: vertices have shape {vertices.shape}; expected (n, 3) with n at least 3")
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 1:
        raise InputError(f"{name}: triangles have shape {corners.shape}; expected (n, 3) with n at least 1")
    if not np.issubdtype(corners.dtype, np.integer):
        raise InputError(f"{name}: triangles are {corners.dtype}; expected whole numbers")
    mesh = SurfaceMesh(vertices, np.ascontiguousarray(corners, dtype=np.int64), name)
    _finite_and_in_metres(mesh)
    _corners_exist(mesh)
    _areas(mesh)
    _manifold(mesh)
    if closed:
        _closed(mesh)
    return mesh


def _half_edges(triangles: Ints) -> Ints:
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def _corners(half: Ints) -> int:
    """One more than the highest vertex number."""
    return int(half.max(initial=0)) + 1


def _keys(half: Ints) -> Ints:
    """One number for each edge, in the order of the pairs: numbers are sorted many times faster than rows."""
    return half[:, 0] * np.int64(_corners(half)) + half[:, 1]


def _place(mesh: SurfaceMesh, vertex: int | np.integer) -> str:
    return "({:.4f}, {:.4f}, {:.4f}) m".format(*mesh.vertices_m[vertex])


def _finite_and_in_metres(mesh: SurfaceMesh) -> None:
    bad = np.flatnonzero(~np.isfinite(mesh.vertices_m).all(axis=1))
    if len(bad):
        raise InputError(f"{mesh.name}: vertex {bad[0]} is {mesh.vertices_m[bad[0]].tolist()}; expected finite numbers")
    fault = size_fault(mesh.vertices_m, WORN)
    if fault is not None:
        raise InputError(f"{mesh.name}: {fault}")


def _corners_exist(mesh: SurfaceMesh) -> None:
    bad = np.flatnonzero(((mesh.triangles < 0) | (mesh.triangles >= len(mesh.vertices_m))).any(axis=1))
    if len(bad):
        corners, last = mesh.triangles[bad[0]].tolist(), len(mesh.vertices_m) - 1
        raise InputError(f"{mesh.name}: triangle {bad[0]} has the vertices {corners}; allowed: 0 to {last}")


def _areas(mesh: SurfaceMesh) -> None:
    bad = np.flatnonzero(mesh.areas_m2 < SMALLEST_AREA_M2)
    if len(bad):
        place, area = _place(mesh, mesh.triangles[bad[0], 0]), mesh.areas_m2[bad[0]]
        raise InputError(
            f"{mesh.name}: triangle {bad[0]} at {place} has the area {area:.3g} m2; allowed: at least {SMALLEST_AREA_M2:g} m2"
        )


def _manifold(mesh: SurfaceMesh) -> None:
    half = _half_edges(mesh.triangles)
    edges, count = np.unique(_keys(np.sort(half, axis=1)), return_counts=True)
    if count.max() > 2:
        a, b = divmod(int(edges[np.argmax(count > 2)]), _corners(half))
        raise InputError(
            f"{mesh.name}: edge {a}-{b} at {_place(mesh, a)} belongs to {count.max()} triangles; "
            "allowed: 1 or 2 (the mesh is not manifold there)"
        )
    directed, twice = np.unique(_keys(half), return_counts=True)
    if twice.max() > 1:
        a, b = divmod(int(directed[np.argmax(twice > 1)]), _corners(half))
        raise InputError(
            f"{mesh.name}: the two triangles at edge {a}-{b}, {_place(mesh, a)}, are turned against each other (one is flipped); "
            "expected all anticlockwise seen from outside"
        )
    _single_fans(mesh)


def _single_fans(mesh: SurfaceMesh) -> None:
    """Around each vertex the triangles must form one fan: corners at a vertex are all joined through shared edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    triangles = len(mesh.triangles)
    corner = np.arange(3 * triangles).reshape(triangles, 3)
    starts, ends = (np.concatenate([corner[:, (k + shift) % 3] for k in range(3)]) for shift in (0, 1))
    vertex = mesh.triangles.ravel()
    key = np.sort(np.stack([vertex[starts], vertex[ends]], axis=1), axis=1)
    order = np.lexsort((key[:, 1], key[:, 0]))
    same = np.flatnonzero((key[order[1:]] == key[order[:-1]]).all(axis=1))
    one, other = order[same], order[same + 1]  # the two half edges of an edge run against each other
    rows, columns = np.concatenate([starts[one], ends[one]]), np.concatenate([ends[other], starts[other]])
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(3 * triangles, 3 * triangles))
    _, fan = connected_components(graph, directed=False)
    first = np.full(len(mesh.vertices_m), -1)
    first[vertex[::-1]] = fan[::-1]
    bad = np.flatnonzero(first[vertex] != fan)
    if len(bad):
        pinched = int(vertex[bad[0]])
        raise InputError(
            f"{mesh.name}: vertex {pinched} at {_place(mesh, pinched)} joins sheets that touch in that point only; "
            "expected one fan of triangles"
        )
    loose = np.flatnonzero(first < 0)
    if len(loose):
        raise InputError(
            f"{mesh.name}: vertex {loose[0]} at {_place(mesh, loose[0])} belongs to no triangle; expected at least one"
        )


def _closed(mesh: SurfaceMesh) -> None:
    if len(mesh.boundary_edges):
        a, b = mesh.boundary_edges[0]
        raise InputError(f"{mesh.name}: it is open at edge {a}-{b}, {_place(mesh, a)}; expected a closed surface")
    volume = float(np.einsum("ij,ij->", mesh.vertices_m[mesh.triangles[:, 0]], mesh.cross_m2)) / 6
    if volume <= 0:
        raise InputError(
            f"{mesh.name}: its volume is {volume:.3g} m3, it is inside out; "
            "expected all triangles anticlockwise seen from outside"
        )

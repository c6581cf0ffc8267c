"""Cloth and the seams cut into it: triangles are divided where a seam crosses them, so that seams are smooth lines and not
the zigzag of the mesh, while the surface and its area stay as they are.

A seam is the zero line of a function given at the corners of some triangles. Where the line crosses an edge a vertex is put in;
what lies on the two sides of the line is then parted. Both sides of a seam run over the same vertices, so they match.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from haptics.errors import InputError
from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh

NEAR = 0.1
"""A line that crosses an edge nearer to its end than this share is led through the vertex, so that no sliver is made."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One piece of the cloth with its own vertices: doubled along the seams.

    :param mesh: the piece in space.
    :param origin: for each vertex the cloth's vertex, ``(vertices,)``.
    :param faces: for each triangle the cloth's triangle, ``(triangles,)``.
    """

    mesh: SurfaceMesh
    origin: Ints
    faces: Ints

    @cached_property
    def loops(self) -> list[Ints]:
        """Boundary loops, longest first, each as vertex numbers in the direction of the triangles."""
        following = {int(a): int(b) for a, b in self.mesh.boundary_edges}
        loops: list[list[int]] = []
        while following:
            start = min(following)
            loop = [start]
            while (vertex := following.pop(loop[-1])) != start:
                loop.append(vertex)
            loops.append(loop)
        around = [float(np.linalg.norm(np.diff(self.mesh.vertices_m[[*loop, loop[0]]], axis=0), axis=1).sum()) for loop in loops]
        return [np.array(loops[i]) for i in sorted(range(len(loops)), key=lambda i: (-around[i], loops[i][0]))]

    @property
    def euler(self) -> int:
        """Vertices - edges + triangles: 1 for a disc, 0 for a tube."""
        return len(self.mesh.vertices_m) - len(self.mesh.edges) + len(self.mesh.triangles)

    @property
    def is_disc(self) -> bool:
        """Whether it can be laid flat: one boundary loop and no hole."""
        return self.euler == 1 and len(self.loops) == 1


@dataclass(frozen=True, eq=False)
class Cloth:
    """A garment with seams.

    :param mesh: the garment, its triangles divided where seams cross.
    :param parents: for each triangle the garment's, ``(triangles,)``.
    :param seams: the edges that are cut, lower vertex first, ``(edges, 2)``.
    """

    mesh: SurfaceMesh
    parents: Ints
    seams: Ints

    @classmethod
    def uncut(cls, mesh: SurfaceMesh) -> Cloth:
        """The garment without a seam.

        :param mesh: the garment.
        :return: one panel, if the garment is one piece.
        """
        return cls(mesh, np.arange(len(mesh.triangles)), np.zeros((0, 2), np.int64))

    @cached_property
    def panels(self) -> list[Panel]:
        """The pieces that the seams leave, in the order of their first triangle."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        triangles = self.mesh.triangles
        # Corners of neighbouring triangles are one vertex of the panel unless a seam lies between.
        left, right = _joined_corners(triangles, self.seams)
        corners = np.arange(triangles.size).reshape(-1, 3)
        same = (np.concatenate([left, right]), np.concatenate([right, left]))
        _, vertex = connected_components(coo_matrix((np.ones(len(same[0])), same), shape=(triangles.size, triangles.size)))
        faces = (np.concatenate([left // 3, corners[:, 0] // 3]), np.concatenate([right // 3, corners[:, 0] // 3]))
        _, piece = connected_components(coo_matrix((np.ones(len(faces[0])), faces), shape=(len(triangles), len(triangles))))
        _, first = np.unique(piece, return_index=True)
        return [self._panel(np.flatnonzero(piece == piece[i]), vertex.reshape(-1, 3)) for i in np.sort(first)]

    def _panel(self, faces: Ints, vertex: Ints) -> Panel:
        corners = vertex[faces].ravel()
        _, first, local = np.unique(corners, return_index=True, return_inverse=True)
        origin = self.mesh.triangles[faces].ravel()[first]
        return Panel(SurfaceMesh(self.mesh.vertices_m[origin], local.reshape(-1, 3), self.mesh.name), origin, faces)

    def corners_of(self, panel: Panel, values: Floats, where: Bools | None = None) -> Floats:
        """Values at a panel's vertices as values at the cloth's triangle corners: NaN elsewhere and outside ``where``.

        :param panel: one of ``panels``.
        :param values: any value at its vertices, ``(panel's vertices,)``.
        :param where: the panel's triangles that get values, ``(panel's triangles,)``; None: all.
        :return: values, ``(triangles, 3)``.
        """
        corners = np.full(self.mesh.triangles.shape, np.nan)
        kept = np.ones(len(panel.faces), bool) if where is None else where
        corners[panel.faces[kept]] = values[panel.mesh.triangles[kept]]
        return corners

    def cut(self, level: Floats) -> tuple[Cloth, Ints]:
        """The cloth with one more seam, the zero line of ``level``.

        :param level: values at the corners of the triangles, ``(triangles, 3)``; NaN where the line does not go.
        :return: the cloth, and for each of its triangles the one it was before, ``(triangles,)``.
        :raises InputError: the line crosses nothing.
        """
        level = _led_through_vertices(self.mesh.triangles, level)
        points, splits = _crossings(self.mesh, level)
        triangles, parents, sides = _divided(self.mesh.triangles, level, splits)
        mesh = SurfaceMesh(np.vstack([self.mesh.vertices_m, points]), triangles, self.mesh.name)
        seams = [half for edge in self.seams.tolist() for half in _halves(edge, splits)]
        new = _between_sides(triangles, sides)
        if not len(new):
            raise InputError(f"{self.mesh.name}: the seam crosses no triangle; expected a line through the cloth")
        both = np.unique(np.sort(np.vstack([np.array(seams, np.int64).reshape(-1, 2), new]), axis=1), axis=0)
        return Cloth(mesh, self.parents[parents], both), parents

    def cut_along(self, edges: Ints) -> Cloth:
        """The cloth with some of its own edges cut as well.

        :param edges: vertex numbers of each, ``(edges, 2)``.
        :return: the cloth.
        """
        return Cloth(self.mesh, self.parents, np.unique(np.sort(np.vstack([self.seams, edges]), axis=1), axis=0))


def _codes(edges: Ints, vertices: int) -> Ints:
    return edges.min(axis=1) * vertices + edges.max(axis=1)


def _paired_corners(triangles: Ints) -> tuple[Ints, Ints, Ints]:
    """For each edge of two triangles: the corner at its start in the one, in the other, and the edge's code."""
    vertices = int(triangles.max()) + 1
    corner = np.arange(triangles.size).reshape(-1, 3)
    half = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    code = _codes(half, vertices)
    order = np.argsort(code, kind="stable")
    pair = np.flatnonzero(code[order][1:] == code[order][:-1])
    one, other = order[pair], order[pair + 1]
    return corner.ravel()[one], corner.ravel()[other], code[one]


def _next(corner: Ints) -> Ints:
    return corner - corner % 3 + (corner + 1) % 3


def _joined_corners(triangles: Ints, seams: Ints) -> tuple[Ints, Ints]:
    one, other, code = _paired_corners(triangles)
    kept = ~np.isin(code, _codes(seams, int(triangles.max()) + 1))
    one, other = one[kept], other[kept]
    # Neighbours run along their edge in opposite directions: the start of the one is the end of the other.
    return np.concatenate([one, _next(one)]), np.concatenate([_next(other), other])


def _between_sides(triangles: Ints, sides: Ints) -> Ints:
    one, other, _ = _paired_corners(triangles)
    cut = sides[one // 3] * sides[other // 3] < 0
    flat = triangles.ravel()
    return np.stack([flat[one[cut]], flat[_next(one[cut])]], axis=1)


def _led_through_vertices(triangles: Ints, level: Floats) -> Floats:
    """Values near zero set to zero, unless that would leave a triangle with no sign."""
    level = level.copy()
    at: dict[tuple[int, float], list[tuple[int, int]]] = {}
    for face in np.flatnonzero(~np.isnan(level[:, 0])).tolist():
        for corner in range(3):
            at.setdefault((int(triangles[face, corner]), float(level[face, corner])), []).append((face, corner))
    near: list[tuple[float, int, float]] = []
    for (vertex, value), corners in at.items():
        shares = [
            value / (value - other)
            for face, corner in corners
            for other in (level[face, corner - 1], level[face, corner - 2])
            if value * other < 0
        ]
        if shares and min(shares) < NEAR:
            near.append((min(shares), vertex, value))
    for _, vertex, value in sorted(near):
        corners = at[vertex, value]
        if all(np.any(np.delete(level[face], corner) != 0) for face, corner in corners):
            for face, corner in corners:
                level[face, corner] = 0.0
    return level


def _crossings(mesh: SurfaceMesh, level: Floats) -> tuple[Floats, dict[tuple[int, int], int]]:
    """Points where the zero line crosses edges, and the number of the new vertex on each such edge (lower vertex first)."""
    points: list[Floats] = []
    splits: dict[tuple[int, int], int] = {}
    for face in np.flatnonzero((level < 0).any(axis=1)):
        for i in range(3):
            j = (i + 1) % 3
            a, b = int(mesh.triangles[face, i]), int(mesh.triangles[face, j])
            edge = (min(a, b), max(a, b))
            if level[face, i] * level[face, j] < 0 and edge not in splits:
                share = np.clip(level[face, i] / (level[face, i] - level[face, j]), NEAR, 1 - NEAR)
                splits[edge] = len(mesh.vertices_m) + len(points)
                points.append((1 - share) * mesh.vertices_m[a] + share * mesh.vertices_m[b])
    return np.array(points).reshape(-1, 3), splits


def _halves(edge: list[int], splits: dict[tuple[int, int], int]) -> list[list[int]]:
    middle = splits.get((edge[0], edge[1]))
    return [edge] if middle is None else [[edge[0], middle], [edge[1], middle]]


def _divided(triangles: Ints, level: Floats, splits: dict[tuple[int, int], int]) -> tuple[Ints, Ints, Ints]:
    """Triangles with the split edges, the triangle each comes from, and its side of the line: 1, -1, or 0 where no line goes."""
    pieces: list[tuple[int, ...]] = []
    parents: list[int] = []
    sides: list[int] = []
    for face, corners in enumerate(triangles.tolist()):
        edges = [(min(a, b), max(a, b)) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        values = dict(zip(corners, level[face].tolist(), strict=True))
        split = [edge for edge in edges if edge in splits]
        # An edge may be split for the sake of the triangle beyond it; those come last, or the line would lose its edge here.
        split.sort(key=lambda edge: not values[edge[0]] * values[edge[1]] < 0)
        parts = [tuple(corners)]
        for edge in split:
            a, b = values[edge[0]], values[edge[1]]
            values[splits[edge]] = 0.0 if a * b < 0 else 0.5 * (a + b)
            parts = [piece for part in parts for piece in _bisected(part, edge, splits[edge])]
        pieces += parts
        parents += [face] * len(parts)
        sums = [sum(values[corner] for corner in part) for part in parts]
        sides += [0 if np.isnan(total) else int(np.sign(total)) for total in sums]
    return np.array(pieces, np.int64), np.array(parents), np.array(sides)


def _bisected(triangle: tuple[int, ...], edge: tuple[int, int], middle: int) -> list[tuple[int, ...]]:
    if edge[0] not in triangle or edge[1] not in triangle:
        return [triangle]
    return [tuple(middle if corner == end else corner for corner in triangle) for end in edge]

"""Closed triangle meshes as exact signed distances.

Magnitude: exact distance to the nearest triangle, by the regions of its plane (Ericson, Real-Time Collision
Detection, 5.1.5); triangles whose bounding sphere cannot hold the nearest point are left out first. Sign: generalised
winding number (Jacobson et al. 2013, from the solid angles of van Oosterom and Strackee 1983), which is 1 inside and
0 outside a closed mesh however its normals are arranged, and unlike ray casting does not fail where a ray grazes an
edge.
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.scene.pose import Array

FORMATS = (".obj", ".stl")
LARGEST_FACES = 200_000
SLIVER = 1e-12
"""Least twice-area of a triangle, relative to the square of the mesh's extent, that still has a direction in float64."""
_PAIRS_AT_ONCE = 400_000


class TriangleMesh:
    """A closed, edge-manifold, consistently wound triangle mesh, centred where its file puts the origin.

    :param vertices_m: (v, 3), metres.
    :param faces: (f, 3) vertex indices. Wound either way round; an inside-out mesh is turned.
    :param name: where it came from, for messages.
    :raises InputError: not finite, indices out of range, degenerate, open, non-manifold or inconsistently wound; the
        message says where.
    """

    def __init__(self, vertices_m: Array, faces: NDArray[np.integer], name: str = "mesh"):
        vertices = np.asarray(vertices_m, dtype=np.float64)
        triangles = np.asarray(faces, dtype=np.int64)
        _check_arrays(name, vertices, triangles)
        vertices, index = np.unique(vertices, axis=0, return_inverse=True)  # STL repeats each vertex in every triangle
        triangles = index.reshape(-1)[triangles]
        _check_surface(name, vertices, triangles)
        volume_m3 = (
            float(np.einsum("ij,ij->", vertices[triangles[:, 0]], np.cross(vertices[triangles[:, 1]], vertices[triangles[:, 2]])))
            / 6
        )
        if volume_m3 < 0.0:
            triangles = triangles[:, ::-1]
        self.name = name
        self.vertices_m, self.faces = vertices, triangles
        self.volume_m3 = abs(volume_m3)
        self._corners = vertices[triangles]  # (f, 3, 3)
        self._bounding_radius_m = float(np.linalg.norm(vertices, axis=1).max())

    @property
    def bounding_radius_m(self) -> float:
        return self._bounding_radius_m

    def distance(self, points_m: Array) -> Array:
        """Signed distance, (n,), metres; negative inside."""
        nearest, _ = self._nearest(points_m)
        return np.where(self.inside(points_m), -1.0, 1.0) * np.linalg.norm(points_m - nearest, axis=1)

    def gradient(self, points_m: Array) -> Array:
        """Outward unit direction at each point, (n, 3); on the surface itself, the normal of the nearest triangle."""
        nearest, face = self._nearest(points_m)
        away = points_m - nearest
        length = np.linalg.norm(away, axis=1)
        sign = np.where(self.inside(points_m), -1.0, 1.0)
        on_surface = length <= 1e-12 * self.bounding_radius_m
        direction = away * (sign / np.where(on_surface, 1.0, length))[:, None]
        direction[on_surface] = self._normals[face[on_surface]]
        return direction

    def inside(self, points_m: Array) -> NDArray[np.bool_]:
        """Which points lie inside, (n,): winding number above one half."""
        low, high = self.vertices_m.min(axis=0), self.vertices_m.max(axis=0)
        inside = ((points_m >= low) & (points_m <= high)).all(axis=1)
        candidates = np.flatnonzero(inside)
        rows = max(1, _PAIRS_AT_ONCE // len(self.faces))
        for start in range(0, len(candidates), rows):
            some = candidates[start : start + rows]
            inside[some] = _winding_number(points_m[some], self._corners) > 0.5
        return inside

    @cached_property
    def _normals(self) -> Array:
        normals = np.cross(self._corners[:, 1] - self._corners[:, 0], self._corners[:, 2] - self._corners[:, 0])
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    @cached_property
    def _face_spheres(self) -> tuple[Array, Array]:
        centre = self._corners.mean(axis=1)
        return centre, np.linalg.norm(self._corners - centre[:, None, :], axis=2).max(axis=1)

    def _nearest(self, points_m: Array) -> tuple[Array, NDArray[np.intp]]:
        nearest = np.empty((len(points_m), 3))
        face = np.empty(len(points_m), dtype=np.intp)
        centre, radius = self._face_spheres
        rows = max(1, _PAIRS_AT_ONCE // len(self.faces))
        for start in range(0, len(points_m), rows):
            points = points_m[start : start + rows]
            to_centre = np.linalg.norm(points[:, None, :] - centre, axis=2)
            possible = to_centre - radius <= (to_centre + radius).min(axis=1, keepdims=True)
            row, triangle = np.nonzero(possible)
            on_triangle = _nearest_on_triangles(points[row], self._corners[triangle])
            by_row_then_distance = np.lexsort((((on_triangle - points[row]) ** 2).sum(axis=1), row))
            best = by_row_then_distance[np.searchsorted(row, np.arange(len(points)))]
            nearest[start : start + rows], face[start : start + rows] = on_triangle[best], triangle[best]
        return nearest, face


def load_mesh(path: Path, scale: float = 1.0) -> TriangleMesh:
    """A mesh from an OBJ or STL file (text or binary), its lengths multiplied by ``scale`` to metres.

    :raises InputError: no such file, another format, unreadable, trimesh not installed, or not a closed mesh.
    """
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"mesh {path} is of type {path.suffix or '(none)'}; allowed: {', '.join(FORMATS)}")
    if not path.is_file():
        raise InputError(f"mesh {path} does not exist")
    if not (math.isfinite(scale) and scale > 0.0):
        raise InputError(f"mesh {path}: scale = {scale:g} is not allowed; allowed: above 0, metres per unit of the file")
    try:
        import trimesh
    except ImportError as error:
        raise InputError(
            f"mesh {path} needs trimesh to be read; install it with: pip install 'wearable-haptics[mesh]'"
        ) from error
    try:
        with path.open("rb") as file:
            found = trimesh.load(file, file_type=path.suffix[1:].lower(), process=False, force="mesh")
        vertices, faces = np.asarray(found.vertices, float), np.asarray(found.faces)  # type: ignore[union-attr]
    except Exception as error:  # the reader has no error type of its own: whatever it raises, the file is broken
        raise InputError(f"mesh {path} cannot be read as {path.suffix[1:].upper()}: {error}") from error
    return TriangleMesh(vertices * scale, faces, name=str(path))


def _check_arrays(name: str, vertices: Array, faces: NDArray[np.int64]) -> None:
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or faces.ndim != 2 or faces.shape[1:] != (3,) or len(faces) == 0:
        raise InputError(
            f"{name} has no triangles: vertices {vertices.shape}, faces {faces.shape}; allowed: (v, 3) and (f, 3), f at least 1"
        )
    if len(faces) > LARGEST_FACES:
        raise InputError(f"{name} has {len(faces)} triangles; allowed: at most {LARGEST_FACES}")
    broken = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if broken.size:
        raise InputError(f"{name}: vertex {broken[0]} is {vertices[broken[0]].tolist()}; allowed: finite coordinates")
    outside = np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))
    if outside.size:
        raise InputError(
            f"{name}: triangle {outside[0]} names vertices {faces[outside[0]].tolist()}; allowed: 0 to {len(vertices) - 1}"
        )


def _check_surface(name: str, vertices: Array, faces: NDArray[np.int64]) -> None:
    corners = vertices[faces]
    twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = np.flatnonzero(twice_area <= SLIVER * float(np.ptp(vertices, axis=0).max()) ** 2)
    if flat.size:
        raise InputError(
            f"{name}: triangle {flat[0]} with corners {_places(corners[flat[0]])} has no area; remove degenerate triangles"
        )
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges, count = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    for wrong, fault in (
        (count == 1, "the mesh is open: one triangle only"),
        (count > 2, "the mesh is not manifold: over two triangles"),
    ):
        if wrong.any():
            raise InputError(f"{name}: {fault} on the edge {_places(vertices[edges[wrong][0]])} ({int(wrong.sum())} such edges)")
    twice, times = np.unique(directed, axis=0, return_counts=True)
    if (times > 1).any():
        raise InputError(
            f"{name}: the two triangles on the edge {_places(vertices[twice[times > 1][0]])} are wound against each other"
        )


def _places(points: Array) -> str:
    return " ".join("(" + ", ".join(f"{value:g}" for value in point) + ")" for point in points)


def _winding_number(points: Array, corners: Array) -> Array:
    a, b, c = (corners[None, :, k, :] - points[:, None, :] for k in range(3))
    la, lb, lc = (np.sqrt(np.einsum("nfi,nfi->nf", v, v)) for v in (a, b, c))
    triple = np.einsum("nfi,nfi->nf", a, np.cross(b, c))
    dots = (np.einsum("nfi,nfi->nf", u, v) * length for u, v, length in ((a, b, lc), (b, c, la), (c, a, lb)))
    solid_angle = 2.0 * np.arctan2(triple, la * lb * lc + sum(dots))
    return solid_angle.sum(axis=1) / (4.0 * math.pi)


def _nearest_on_triangles(points: Array, corners: Array) -> Array:
    """The point of each triangle (k, 3, 3) nearest to the point beside it, (k, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac = b - a, c - a

    def dots(origin: Array) -> tuple[Array, Array]:
        from_corner = points - origin
        return np.einsum("ij,ij->i", ab, from_corner), np.einsum("ij,ij->i", ac, from_corner)

    d1, d2 = dots(a)
    d3, d4 = dots(b)
    d5, d6 = dots(c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2  # barycentric weights, not yet normalised

    with np.errstate(divide="ignore", invalid="ignore"):  # np.select drops the branches that do not apply
        interior = a + ab * (vb / (va + vb + vc))[:, None] + ac * (vc / (va + vb + vc))[:, None]
        on_ab = a + ab * (d1 / (d1 - d3))[:, None]
        on_ac = a + ac * (d2 / (d2 - d6))[:, None]
        on_bc = b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))[:, None]
    regions = [
        ((d1 <= 0) & (d2 <= 0), a),
        ((d3 >= 0) & (d4 <= d3), b),
        ((d6 >= 0) & (d5 <= d6), c),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), on_ab),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), on_ac),
        ((va <= 0) & (d4 - d3 >= 0) & (d5 - d6 >= 0), on_bc),
    ]
    return np.select([where[:, None] for where, _ in regions], [value for _, value in regions], interior)

"""Closed triangle meshes as exact signed distances.

Magnitude: exact distance to the nearest triangle, by the regions of its plane (Ericson, Real-Time Collision
Detection, 5.1.5); triangles whose bounding sphere cannot hold the nearest point are left out first. Sign: generalised
winding number (Jacobson et al. 2013, from the solid angles of van Oosterom and Strackee 1983), which is 1 inside and
0 outside a closed mesh however its normals are arranged, and unlike ray casting does not fail where a ray grazes an
edge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.meshes import (
    AXES,
    MAX_PIECES,
    UNITS,
    WORDS,
    Kind,
    capped,
    check_arrays,
    cleaned,
    extent_of,
    holes,
    holes_in_words,
    in_frame,
    other_unit,
    outward,
    pieces_of,
    read_triangles,
    size_fault,
    winding_number,
)
from haptics.scene.geometry.pose import Array
from haptics.units import in_range, one_of

TOUCHED = Kind(
    "something to touch", 0.002, 3.0, 0.1, 'give units = "{unit}" or scale = {scale} in its shape (units = "m" keeps the size)'
)
"""From a bead to a table."""
SMALLEST_M, LARGEST_M = 1e-4, 1e4
"""What is computed with where units or a scale are given."""
SECONDS_PER_TRIANGLE = 2e-6
"""Of fifteen sites' distances from a mesh near them, on one core; found: 1 to 2.6 us from 200 to 16,000 triangles."""
FAST_TRIANGLES = 500
"""Of so many the distances take the 1 ms that a tick in real time has."""
SLIVER = 1e-12
"""Least twice-area of a triangle, relative to the square of the mesh's extent, that still has a direction in float64."""
_PAIRS_AT_ONCE = 400_000


class TriangleMesh:
    """A closed, edge-manifold, consistently wound triangle mesh, centred where its file puts the origin.

    :param vertices_m: (v, 3), metres.
    :param faces: (f, 3) vertex indices, of either winding; an inside-out mesh is turned.
    :param name: where it came from, for messages.
    :param notes: what was repaired when it was read.
    :raises InputError: not finite, indices out of range, degenerate, open, non-manifold or inconsistently wound; the
        message names the place.
    """

    def __init__(self, vertices_m: Array, faces: NDArray[np.integer], name: str = "mesh", notes: tuple[str, ...] = ()):
        vertices = np.asarray(vertices_m, dtype=np.float64)
        triangles = np.asarray(faces, dtype=np.int64)
        check_arrays(name, vertices, triangles)
        vertices, index = np.unique(vertices, axis=0, return_inverse=True)  # STL repeats each vertex in every triangle
        triangles = index.reshape(-1)[triangles]
        _check_surface(name, vertices, triangles)
        volume_m3 = (
            float(np.einsum("ij,ij->", vertices[triangles[:, 0]], np.cross(vertices[triangles[:, 1]], vertices[triangles[:, 2]])))
            / 6
        )
        if volume_m3 < 0.0:
            triangles = triangles[:, ::-1]
        self.name, self.notes = name, notes
        self.vertices_m, self.faces = vertices, triangles
        self.volume_m3 = abs(volume_m3)
        self.corners_m = vertices[triangles]  # (f, 3, 3)
        self._bounding_radius_m = float(np.linalg.norm(vertices, axis=1).max())

    @property
    def bounding_radius_m(self) -> float:
        """Distance of the farthest vertex from the origin, metres."""
        return self._bounding_radius_m

    def distance(self, points_m: Array) -> Array:
        """Signed distance of each point.

        :param points_m: (n, 3), metres.
        :return: (n,), metres; negative inside; NaN for a point that is not finite.
        """
        seen = np.isfinite(points_m).all(axis=1)
        distance_m = np.full(len(points_m), np.nan)
        nearest, _ = self._nearest(points_m[seen])
        sign = np.where(self.inside(points_m[seen]), -1.0, 1.0)
        distance_m[seen] = sign * np.linalg.norm(points_m[seen] - nearest, axis=1)
        return distance_m

    def gradient(self, points_m: Array) -> Array:
        """Outward unit direction at each point; on the surface itself, the normal of the nearest triangle.

        :param points_m: (n, 3), metres.
        :return: (n, 3), of length 1.
        """
        nearest, face = self._nearest(points_m)
        away = points_m - nearest
        length = np.linalg.norm(away, axis=1)
        sign = np.where(self.inside(points_m), -1.0, 1.0)
        on_surface = length <= 1e-12 * self.bounding_radius_m
        direction = away * (sign / np.where(on_surface, 1.0, length))[:, None]
        direction[on_surface] = self._normals[face[on_surface]]
        return direction

    def inside(self, points_m: Array) -> NDArray[np.bool_]:
        """Which points lie inside: winding number above one half.

        :param points_m: (n, 3), metres.
        :return: (n,).
        """
        low, high = self.vertices_m.min(axis=0), self.vertices_m.max(axis=0)
        inside = ((points_m >= low) & (points_m <= high)).all(axis=1)
        candidates = np.flatnonzero(inside)
        rows = max(1, _PAIRS_AT_ONCE // len(self.faces))
        for start in range(0, len(candidates), rows):
            some = candidates[start : start + rows]
            inside[some] = winding_number(points_m[some], self.corners_m) > 0.5
        return inside

    @cached_property
    def _normals(self) -> Array:
        normals = np.cross(self.corners_m[:, 1] - self.corners_m[:, 0], self.corners_m[:, 2] - self.corners_m[:, 0])
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    @cached_property
    def _face_spheres(self) -> tuple[Array, Array]:
        centre = self.corners_m.mean(axis=1)
        return centre, np.linalg.norm(self.corners_m - centre[:, None, :], axis=2).max(axis=1)

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
            on_triangle = _nearest_on_triangles(points[row], self.corners_m[triangle])
            by_row_then_distance = np.lexsort((((on_triangle - points[row]) ** 2).sum(axis=1), row))
            best = by_row_then_distance[np.searchsorted(row, np.arange(len(points)))]
            nearest[start : start + rows], face[start : start + rows] = on_triangle[best], triangle[best]
        return nearest, face


def load_mesh(
    path: Path, scale: float | None = None, units: str | None = None, up: str | None = None, repair: bool = False
) -> TriangleMesh:
    """A mesh from an OBJ, STL or PLY file (text or binary), in metres and y up, with what had to be repaired in its ``notes``.

    :param path: the file.
    :param scale: metres per unit of the file, above 0; None: by ``units``.
    :param units: one of ``meshes.UNITS``; None: by ``scale``, or metres where neither is given.
    :param up: which axis of the file points up, one of ``meshes.AXES``; None: y. What is not given is noted as it was assumed.
    :param repair: close holes by flat caps.
    :return: the mesh, closed, centred where its file has the origin.
    :raises InputError: a file that cannot be read, a size that nothing to touch has while neither scale nor units are given, or
        not a closed mesh.
    """
    path, notes = Path(path), []
    if scale is not None and units is not None:
        raise InputError(f"mesh {path}: scale = {scale:g} and units = {units!r} are both given; give one of them")
    if scale is not None and not (math.isfinite(scale) and scale > 0.0):
        raise InputError(f"mesh {path}: scale = {scale:g} m per unit of the file; must be above 0 m")
    unit_m = UNITS[one_of(f"units of mesh {path}", units, tuple(UNITS))] if units is not None else scale or 1.0
    if up is not None:
        one_of(f"up of mesh {path}", up, AXES)
    vertices, triangles = read_triangles(path)
    used = vertices[np.unique(triangles)]
    fault = size_fault(used, TOUCHED, unit_m)
    if fault is not None and scale is None and units is None:
        raise InputError(f"mesh {path}: {fault}")
    if fault is not None:
        in_range(f"size of mesh {path}", extent_of(used) * unit_m, SMALLEST_M, LARGEST_M, "m")
        notes.append(f"{fault.seen}; kept as given")
    unsaid = [f"in {WORDS['m']}"] * (scale is None and units is None) + ["y up"] * (up is None)
    if unsaid:
        notes.append(_taken(used, unit_m, up or "y", unsaid))
    vertices, used = (in_frame(points, unit_m, up or "y", to="y") for points in (vertices, used))
    notes.extend(_far_off(used))
    min_area_m2 = 0.5 * _no_twice_area_m2(vertices)
    vertices, triangles, mended = cleaned(vertices, triangles, min_area_m2)
    found = holes(triangles)
    if found and repair:
        mended.append(f"{holes_in_words(vertices, found)} closed by flat caps")
        vertices, triangles, _ = cleaned(*capped(vertices, triangles, found), min_area_m2)  # the cap of a slit is flat
    if repair or not found:
        pieces, _ = pieces_of(triangles)
        if pieces > MAX_PIECES:
            raise InputError(f"mesh {path} is in {pieces} pieces; at most {MAX_PIECES} are read; join it where it was made")
        triangles, turned = outward(vertices, triangles)
        if turned:
            mended.append(f"it was inside out: {turned} of {len(triangles)} triangles turned")
    return TriangleMesh(vertices, triangles, name=f"mesh {path}", notes=tuple(f"{path.name}: {note}" for note in notes + mended))


def _taken(used: Array, unit_m: float, up: str, unsaid: Sequence[str]) -> str:
    """How a mesh was interpreted where its shape leaves it open, with its sizes, and another unit where that is likelier."""
    wide, high, deep = np.ptp(in_frame(used, unit_m, up, to="y"), axis=0)
    question = other_unit(used, TOUCHED) if unsaid[0] != "y up" else ""
    taken = f"taken to be {', '.join(unsaid)}, as its shape does not specify: {wide:.3g} m wide, {high:.3g} high, {deep:.3g} deep"
    return f"{taken}; {question}" if question else taken


def _far_off(used_m: Array) -> list[str]:
    """Of a mesh that lies away from its file's origin by more than its size, where it is: the scene places the origin."""
    low, high = used_m.min(axis=0), used_m.max(axis=0)
    away = float(np.linalg.norm(np.clip(0.0, low, high)))
    if away <= float((high - low).max()):
        return []
    middle = ", ".join(f"{value:.3g}" for value in (low + high) / 2)
    return [f"it lies {away:.3g} m from the origin of its file, which is what a scene places: its middle is at ({middle})"]


def slow_notice(meshes: Sequence[TriangleMesh]) -> str | None:
    """What meshes will cost a tick that passes near them.

    :param meshes: all of a scene.
    :return: in words, or None where a tick in real time has the time.
    """
    triangles = sum(len(mesh.faces) for mesh in meshes)
    if triangles <= FAST_TRIANGLES:
        return None
    seconds = triangles * SECONDS_PER_TRIANGLE
    return (
        f"{triangles} triangles of meshes: about {1e3 * seconds:.3g} ms a tick while the hand is near them, so that "
        f"a second takes {1e3 * seconds:.3g} s to compute; real time needs {FAST_TRIANGLES} at most"
    )


def _no_twice_area_m2(vertices: Array) -> float:
    return SLIVER * float(np.ptp(vertices, axis=0).max()) ** 2


def _check_surface(name: str, vertices: Array, faces: NDArray[np.int64]) -> None:
    corners = vertices[faces]
    twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = np.flatnonzero(twice_area <= _no_twice_area_m2(vertices))
    if flat.size:
        raise InputError(
            f"{name}: triangle {flat[0]} with corners {_places(corners[flat[0]])} has no area; remove degenerate triangles"
        )
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges, count = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    if (count > 2).any():
        raise InputError(
            f"{name}: the mesh is not manifold: over two triangles on the edge {_places(vertices[edges[count > 2][0]])} "
            f"({int((count > 2).sum())} such edges)"
        )
    if (count == 1).any():
        raise InputError(
            f"{name}: the mesh is open: {holes_in_words(vertices, holes(faces))}; expected a closed surface; "
            "close it where it was drawn, or give repair = true in its shape to close holes with flat caps"
        )
    twice, times = np.unique(directed, axis=0, return_counts=True)
    if (times > 1).any():
        raise InputError(
            f"{name}: the two triangles on the edge {_places(vertices[twice[times > 1][0]])} are wound against each other"
        )


def _places(points: Array) -> str:
    return " ".join("(" + ", ".join(f"{value:g}" for value in point) + ")" for point in points)


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

"""Bodies laid out in plain arrays, and their signed distances in compiled code.

The same distances as ``shapes`` and ``mesh`` give, point by point, for the loop's inner path: fifteen sites and a few objects
are too little for numpy's calls to pay. A body that is of none of the shipped shapes has no place here (``packable``).
"""

# Types that depend on one another through these loops are beyond what a checker infers.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from haptics.scene.geometry.mesh import TriangleMesh
from haptics.scene.geometry.pose import Array, Pose
from haptics.scene.geometry.shapes import Box, Capsule, Cylinder, Placed, Plane, Shape, Sphere

_SPHERE, _BOX, _CAPSULE, _CYLINDER, _PLANE, MESH = range(6)
_KINDS: dict[type, int] = {
    Sphere: _SPHERE,
    Box: _BOX,
    Capsule: _CAPSULE,
    Cylinder: _CYLINDER,
    Plane: _PLANE,
    TriangleMesh: MESH,
}


class PackedBodies(NamedTuple):
    """Bodies as arrays, one row each; triangles of all meshes one after another.

    :param kind: (m,).
    :param size_m: (m, 3), half lengths and radii by kind, metres.
    :param origin_m: of its pose, (m, 3), metres.
    :param rotation: likewise, (m, 3, 3).
    :param triangles: of a mesh, (m, 2), first and one past the last.
    :param corners_m: of all triangles, (f, 3, 3), metres.
    :param sphere_m: centre and radius of a sphere about each triangle, (f, 4), metres.
    :param box_m: a mesh's lowest and highest corner, (m, 2, 3), metres.
    """

    kind: NDArray[np.int64]
    size_m: Array
    origin_m: Array
    rotation: Array
    triangles: NDArray[np.int64]
    corners_m: Array
    sphere_m: Array
    box_m: Array

    def put(self, row: int, pose: Pose) -> None:
        """Move a body.

        :param row: which.
        :param pose: in the world.
        """
        self.origin_m[row], self.rotation[row] = pose.origin_m, pose.rotation


def packable(shape: Shape) -> bool:
    """Whether a shape is one of those that this file knows.

    :param shape: any.
    :return: False for a shape of somebody's own, whose distance only it can tell.
    """
    return type(shape) in _KINDS


def packed(bodies: Sequence[Placed]) -> PackedBodies:
    """Lay bodies out in arrays.

    :param bodies: of packable shapes.
    :return: the arrays; only poses may change afterwards (:meth:`PackedBodies.put`).
    """
    count = len(bodies)
    corners, spheres, first = [np.empty((0, 3, 3))], [np.empty((0, 4))], 0
    all_of = PackedBodies(
        np.zeros(count, np.int64),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros((count, 3, 3)),
        np.zeros((count, 2), np.int64),
        np.empty((0, 3, 3)),
        np.empty((0, 4)),
        np.zeros((count, 2, 3)),
    )
    for row, body in enumerate(bodies):
        shape = body.shape
        all_of.kind[row] = _KINDS[type(shape)]
        all_of.put(row, body.pose)
        if isinstance(shape, TriangleMesh):
            mesh_m = shape.corners_m
            centre_m = mesh_m.mean(axis=1)
            radius_m = np.linalg.norm(mesh_m - centre_m[:, None, :], axis=2).max(axis=1)
            corners.append(mesh_m)
            spheres.append(np.column_stack([centre_m, radius_m]))
            all_of.triangles[row] = first, first + len(mesh_m)
            all_of.box_m[row] = shape.vertices_m.min(axis=0), shape.vertices_m.max(axis=0)
            first += len(mesh_m)
        else:
            all_of.size_m[row] = _size_m(shape)
    return all_of._replace(corners_m=np.concatenate(corners), sphere_m=np.concatenate(spheres))


def _size_m(shape: Shape) -> Sequence[float]:
    if isinstance(shape, Sphere):
        return shape.radius_m, 0.0, 0.0
    if isinstance(shape, Box):
        return tuple(0.5 * edge for edge in shape.size_m)
    if isinstance(shape, Capsule):
        return shape.radius_m, 0.5 * shape.length_m, 0.0
    if isinstance(shape, Cylinder):
        return shape.radius_m, 0.5 * shape.height_m, 0.0
    return 0.0, 0.0, 0.0


@njit(cache=True, error_model="numpy")
def to_local(rotation: Array, origin_m: Array, row: int, vectors: Array, place: bool, local: Array) -> None:
    """Vectors of the world in a body's own frame.

    :param rotation: of all bodies, (m, 3, 3).
    :param origin_m: likewise, (m, 3), metres.
    :param row: which body.
    :param vectors: (n, 3 k), along the world's axes, threes of coordinates.
    :param place: whether they are places, which are counted from the body's origin, rather than directions.
    :param local: (n, 3 k), changed in place.
    """
    ox, oy, oz = 0.0, 0.0, 0.0
    if place:
        ox, oy, oz = origin_m[row, 0], origin_m[row, 1], origin_m[row, 2]
    for j in range(3):
        rx, ry, rz = rotation[row, 0, j], rotation[row, 1, j], rotation[row, 2, j]
        for n in range(vectors.shape[0]):
            for i in range(0, vectors.shape[1], 3):
                local[n, i + j] = (vectors[n, i] - ox) * rx + (vectors[n, i + 1] - oy) * ry + (vectors[n, i + 2] - oz) * rz


@njit(cache=True, error_model="numpy")
def solid_distance_m(kind: int, a: float, b: float, c: float, x: float, y: float, z: float) -> float:
    """Signed distance of one point to a body that is no mesh.

    :param kind: of :class:`PackedBodies`.
    :param a: its ``size_m``, metres.
    :param b: likewise.
    :param c: likewise.
    :param x: of the point in the body's own frame, metres.
    :param y: likewise.
    :param z: likewise.
    :return: metres, negative inside; NaN for a point that is not finite.
    """
    if not math.isfinite(x + y + z):
        return math.nan
    if kind == _SPHERE:
        return math.sqrt(x * x + y * y + z * z) - a
    if kind == _BOX:
        qx, qy, qz = abs(x) - a, abs(y) - b, abs(z) - c
        ox, oy, oz = max(qx, 0.0), max(qy, 0.0), max(qz, 0.0)
        return math.sqrt(ox * ox + oy * oy + oz * oz) + min(max(qx, qy, qz), 0.0)
    if kind == _CAPSULE:
        y -= min(max(y, -b), b)
        return math.sqrt(x * x + y * y + z * z) - a
    if kind == _CYLINDER:
        radial, axial = math.sqrt(x * x + z * z) - a, abs(y) - b
        ox, oy = max(radial, 0.0), max(axial, 0.0)
        return math.sqrt(ox * ox + oy * oy) + min(max(radial, axial), 0.0)
    return y


@njit(cache=True, error_model="numpy")
def mesh_distance_m(
    first: int, end: int, corners_m: Array, sphere_m: Array, box_m: Array, row: int, x: float, y: float, z: float
) -> float:
    """Signed distance of one point to a mesh.

    :param first: its triangles, of those of all meshes.
    :param end: likewise, one past the last.
    :param corners_m: of :class:`PackedBodies`.
    :param sphere_m: likewise.
    :param box_m: likewise.
    :param row: which body.
    :param x: of the point in the mesh's own frame, metres.
    :param y: likewise.
    :param z: likewise.
    :return: metres, negative inside; NaN for a point that is not finite.
    """
    if not math.isfinite(x + y + z):
        return math.nan
    nearest_m = math.inf
    for face in range(first, end):
        cx, cy, cz = x - sphere_m[face, 0], y - sphere_m[face, 1], z - sphere_m[face, 2]
        if math.sqrt(cx * cx + cy * cy + cz * cz) - sphere_m[face, 3] < nearest_m:
            nearest_m = min(nearest_m, _triangle_distance_m(corners_m[face], x, y, z))
    outside = False
    for axis, at in enumerate((x, y, z)):
        outside = outside or at < box_m[row, 0, axis] or at > box_m[row, 1, axis]
    if outside:
        return nearest_m
    angle = 0.0
    for face in range(first, end):
        angle += _solid_angle(corners_m[face], x, y, z)
    return -nearest_m if angle > 2.0 * math.pi else nearest_m


@njit(cache=True, error_model="numpy")
def _triangle_distance_m(corners_m: Array, x: float, y: float, z: float) -> float:
    """Distance of a point to a triangle: to its plane where the foot lies inside, else to the nearest of its edges."""
    nearest2 = math.inf
    nx, ny, nz = _cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0])
    inside = True
    for k in range(3):
        p, q = corners_m[k], corners_m[(k + 1) % 3]
        ex, ey, ez = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        dx, dy, dz = x - p[0], y - p[1], z - p[2]
        along = min(max((dx * ex + dy * ey + dz * ez) / (ex * ex + ey * ey + ez * ez), 0.0), 1.0)
        fx, fy, fz = dx - along * ex, dy - along * ey, dz - along * ez
        nearest2 = min(nearest2, fx * fx + fy * fy + fz * fz)
        side = (ey * nz - ez * ny) * dx + (ez * nx - ex * nz) * dy + (ex * ny - ey * nx) * dz
        inside = inside and side <= 0.0
    if inside:
        off = nx * (x - corners_m[0, 0]) + ny * (y - corners_m[0, 1]) + nz * (z - corners_m[0, 2])
        return abs(off) / math.sqrt(nx * nx + ny * ny + nz * nz)
    return math.sqrt(nearest2)


@njit(cache=True, error_model="numpy")
def _cross(a: Array, b: Array) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def _solid_angle(corners_m: Array, x: float, y: float, z: float) -> float:
    """Of a triangle as a point sees it (van Oosterom and Strackee 1983)."""
    ax, ay, az = corners_m[0, 0] - x, corners_m[0, 1] - y, corners_m[0, 2] - z
    bx, by, bz = corners_m[1, 0] - x, corners_m[1, 1] - y, corners_m[1, 2] - z
    cx, cy, cz = corners_m[2, 0] - x, corners_m[2, 1] - y, corners_m[2, 2] - z
    la = math.sqrt(ax * ax + ay * ay + az * az)
    lb = math.sqrt(bx * bx + by * by + bz * bz)
    lc = math.sqrt(cx * cx + cy * cy + cz * cz)
    triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    dots = (ax * bx + ay * by + az * bz) * lc + (bx * cx + by * cy + bz * cz) * la + (cx * ax + cy * ay + cz * az) * lb
    return 2.0 * math.atan2(triple, la * lb * lc + dots)

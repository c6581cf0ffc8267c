"""Shapes as exact signed distances: negative inside, zero on the surface, positive outside, in metres.

Every shape lives in its own frame: centred on the origin, long axis (capsule, cylinder) and normal (plane) along +Y.
``Placed`` puts one into the world. ``distance`` is the exact Euclidean distance, so it is 1-Lipschitz and its
gradient has length 1 wherever there is one; on a medial axis, where the nearest surface point is not unique,
``gradient`` gives one of the equally right directions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal, Protocol

import numpy as np

from haptics.errors import InputError
from haptics.scene.geometry.pose import Array, Pose
from haptics.units import in_range

LARGEST_M = 100.0
SMALLEST_M = 1e-4
_STRICT_FIELDS = {"extra": "forbid", "allow_inf_nan": False}  # for the scene file's parser


class Shape(Protocol):
    """What a scene asks of a shape, in the shape's own frame. Points are (n, 3), metres."""

    @property
    def bounding_radius_m(self) -> float:
        """Radius of a sphere about the origin that holds the shape; infinite for a plane."""
        ...

    def distance(self, points_m: Array) -> Array:
        """Signed distance of each point.

        :param points_m: (n, 3), metres.
        :return: (n,), metres; negative inside.
        """
        ...

    def gradient(self, points_m: Array) -> Array:
        """Outward unit direction of steepest growth of the distance at each point.

        :param points_m: (n, 3), metres.
        :return: (n, 3), of length 1.
        """
        ...


@dataclass(frozen=True)
class Sphere(Shape):
    """``|p| − r``.

    :param radius_m: 1e-4 to 100 m.
    :param kind: always ``sphere``.
    :raises InputError: a radius out of range.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    radius_m: float
    kind: Literal["sphere"] = "sphere"

    def __post_init__(self) -> None:
        _length("sphere radius_m", self.radius_m)

    @property
    def bounding_radius_m(self) -> float:
        return self.radius_m

    def distance(self, points_m: Array) -> Array:
        return _norm(points_m) - self.radius_m

    def gradient(self, points_m: Array) -> Array:
        return _unit(points_m, fallback=_Y)


@dataclass(frozen=True)
class Box(Shape):
    """An axis-aligned box, ``|max(q, 0)| + min(max(q_x, q_y, q_z), 0)`` with ``q = |p| − size/2``.

    :param size_m: full edge lengths along x, y, z, 1e-4 to 100 m each.
    :param kind: always ``box``.
    :raises InputError: not three edges, or one out of range.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    size_m: tuple[float, float, float]
    kind: Literal["box"] = "box"

    def __post_init__(self) -> None:
        if len(self.size_m) != 3:
            raise InputError(f"box size_m = {self.size_m}; expected three edge lengths in metres")
        for edge in self.size_m:
            _length("box size_m", edge)

    @property
    def bounding_radius_m(self) -> float:
        return 0.5 * math.sqrt(sum(edge * edge for edge in self.size_m))

    def distance(self, points_m: Array) -> Array:
        beyond = np.abs(points_m) - 0.5 * np.asarray(self.size_m)
        return _norm(np.maximum(beyond, 0.0)) + np.minimum(np.maximum.reduce(beyond, axis=1), 0.0)

    def gradient(self, points_m: Array) -> Array:
        beyond = np.abs(points_m) - 0.5 * np.asarray(self.size_m)
        sign = np.where(points_m < 0.0, -1.0, 1.0)
        nearest_face = np.eye(3)[np.argmax(beyond, axis=1)]
        outside = beyond.max(axis=1, keepdims=True) > 0.0
        return sign * np.where(outside, _unit(np.maximum(beyond, 0.0), fallback=_Y), nearest_face)


@dataclass(frozen=True)
class Capsule(Shape):
    """A segment of ``length_m`` along Y, thickened by ``radius_m``; its caps reach ``length_m/2 + radius_m``.

    :param radius_m: 1e-4 to 100 m.
    :param length_m: of the segment, without the caps, 1e-4 to 100 m.
    :param kind: always ``capsule``.
    :raises InputError: a length out of range.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    radius_m: float
    length_m: float
    kind: Literal["capsule"] = "capsule"

    def __post_init__(self) -> None:
        _length("capsule radius_m", self.radius_m)
        _length("capsule length_m", self.length_m)

    @property
    def bounding_radius_m(self) -> float:
        return self.radius_m + 0.5 * self.length_m

    def distance(self, points_m: Array) -> Array:
        return _norm(self._from_segment(points_m)) - self.radius_m

    def gradient(self, points_m: Array) -> Array:
        return _unit(self._from_segment(points_m), fallback=_X)

    def _from_segment(self, points_m: Array) -> Array:
        half = 0.5 * self.length_m
        from_segment = points_m.copy()
        from_segment[:, 1] -= np.minimum(np.maximum(points_m[:, 1], -half), half)
        return from_segment


@dataclass(frozen=True)
class Cylinder(Shape):
    """A solid cylinder with flat ends, axis along Y: the distance of a rectangle in (radial, axial) coordinates.

    :param radius_m: 1e-4 to 100 m.
    :param height_m: from end to end, 1e-4 to 100 m.
    :param kind: always ``cylinder``.
    :raises InputError: a length out of range.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    radius_m: float
    height_m: float
    kind: Literal["cylinder"] = "cylinder"

    def __post_init__(self) -> None:
        _length("cylinder radius_m", self.radius_m)
        _length("cylinder height_m", self.height_m)

    @property
    def bounding_radius_m(self) -> float:
        return math.hypot(self.radius_m, 0.5 * self.height_m)

    def distance(self, points_m: Array) -> Array:
        radial, axial = self._beyond(points_m)
        return np.hypot(np.maximum(radial, 0.0), np.maximum(axial, 0.0)) + np.minimum(np.maximum(radial, axial), 0.0)

    def gradient(self, points_m: Array) -> Array:
        radial, axial = self._beyond(points_m)
        inside_side = np.stack([radial >= axial, radial < axial], axis=1).astype(float)
        outside = np.maximum(np.stack([radial, axial], axis=1), 0.0)
        length = np.hypot(*outside.T)
        weight = np.where(length[:, None] > 0.0, outside / np.where(length > 0.0, length, 1.0)[:, None], inside_side)
        flat = points_m * (1.0, 0.0, 1.0)
        up = np.where(points_m[:, 1] < 0.0, -1.0, 1.0)[:, None] * _Y
        return weight[:, :1] * _unit(flat, fallback=_X) + weight[:, 1:] * up

    def _beyond(self, points_m: Array) -> tuple[Array, Array]:
        """How far past the side and past the nearer end, (n,) each."""
        return np.hypot(points_m[:, 0], points_m[:, 2]) - self.radius_m, np.abs(points_m[:, 1]) - 0.5 * self.height_m


@dataclass(frozen=True)
class Plane(Shape):
    """The half space ``y ≤ 0``: solid below, free above.

    :param kind: always ``plane``.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    kind: Literal["plane"] = "plane"

    @property
    def bounding_radius_m(self) -> float:
        return math.inf

    def distance(self, points_m: Array) -> Array:
        return points_m[:, 1].copy()

    def gradient(self, points_m: Array) -> Array:
        return np.broadcast_to(_Y, points_m.shape).copy()


@dataclass(frozen=True)
class Placed:
    """A shape at a pose; the same questions as ``Shape``, asked in world coordinates.

    :param shape: in its own frame.
    :param pose: of that frame in the world.
    """

    shape: Shape
    pose: Pose = field(default_factory=Pose)

    @property
    def bounding_radius_m(self) -> float:
        """Radius of a sphere about the pose's position that holds the shape, metres."""
        return self.shape.bounding_radius_m

    def distance(self, points_m: Array) -> Array:
        """Signed distance of each point.

        :param points_m: (n, 3), metres, in the world.
        :return: (n,), metres; negative inside.
        :raises InputError: another shape of array.
        """
        return self.shape.distance(self.pose.to_local(as_points(points_m)))

    def gradient(self, points_m: Array) -> Array:
        """Outward unit direction of steepest growth of the distance at each point.

        :param points_m: (n, 3), metres, in the world.
        :return: (n, 3), of length 1, in world axes.
        :raises InputError: another shape of array.
        """
        return self.shape.gradient(self.pose.to_local(as_points(points_m))) @ self.pose.rotation.T

    def bounding_distance(self, point_m: Sequence[float]) -> float:
        """A lower bound of one point's ``distance`` in plain numbers, to find early that it is far.

        :param point_m: three numbers, metres, in the world.
        :return: metres; minus infinity for a plane.
        """
        return math.dist(point_m, self.pose.position_m) - self.bounding_radius_m

    def at(self, pose: Pose) -> Placed:
        """The same shape elsewhere.

        :param pose: in the world.
        :return: another placed shape.
        """
        return Placed(self.shape, pose)


def distances(bodies: Sequence[Placed], points_m: Array, within_m: float = math.inf) -> Array:
    """Signed distance of every point to every body.

    Exact wherever it is ``within_m`` or less; a body whose bounding sphere is farther than that from every point is
    given by its lower bound instead, which is above ``within_m`` too.

    :param bodies: as many as wanted.
    :param points_m: (n, 3), metres, in the world.
    :param within_m: distances above this need not be exact, metres; default: all are.
    :return: (bodies, n), metres; negative inside.
    :raises InputError: another shape of array.
    """
    points = as_points(points_m)
    if not bodies:
        return np.empty((0, len(points)))
    origins_m = np.array([body.pose.position_m for body in bodies])
    found = np.linalg.norm(points - origins_m[:, None, :], axis=2)
    found -= np.array([body.bounding_radius_m for body in bodies])[:, None]
    for row in np.flatnonzero((found <= within_m).any(axis=1)).tolist():
        found[row] = bodies[row].distance(points)
    return found


def segment_meets(body: Placed, start_m: Array, end_m: Array, resolution_m: float = SMALLEST_M) -> bool:
    """Whether a segment enters a body.

    Sphere tracing: a point at distance d can be followed by one d further on without passing anything. Objects thinner than
    ``resolution_m`` along the segment may be passed over.

    :param body: the body where it is.
    :param start_m: ends of the segment, (3,), metres, in the world.
    :param end_m: likewise, with ``start_m``.
    :param resolution_m: smallest step, metres, above 0.
    :return: whether a point of the segment lies on the surface or inside.
    """
    span = end_m - start_m
    length = float(np.linalg.norm(span))
    along = 0.0
    while along <= length:
        point = start_m + span * (along / length if length > 0.0 else 0.0)
        gap = float(body.distance(point[None, :])[0])
        if gap <= 0.0:
            return True
        along += max(gap, resolution_m)
    return False


def as_points(points_m: Array) -> Array:
    """An array of points, checked.

    :param points_m: (n, 3), metres.
    :return: the same as float64.
    :raises InputError: another shape.
    """
    points = np.asarray(points_m, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points_m has shape {points.shape}; expected (n, 3), metres")
    return points


_X = np.array([1.0, 0.0, 0.0])
_Y = np.array([0.0, 1.0, 0.0])


def _length(name: str, value: float) -> float:
    return in_range(name, value, SMALLEST_M, LARGEST_M, "m")


def _norm(vectors: Array) -> Array:
    return np.sqrt(np.vecdot(vectors, vectors))


def _unit(vectors: Array, fallback: Array) -> Array:
    length = _norm(vectors)[:, None]
    return np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), fallback)

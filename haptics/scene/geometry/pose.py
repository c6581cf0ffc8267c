"""Rigid poses: a position and a unit quaternion, and the few operations that a scene needs of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.units import brief

Array = NDArray[np.float64]
IDENTITY_XYZW = (0.0, 0.0, 0.0, 1.0)
_UNIT_TOLERANCE = 1e-3  # a quaternion written with three decimals still passes; anything further off is a mistake


@dataclass(frozen=True)
class Pose:
    """A rigid pose: ``p_world = R(orientation_xyzw) · p_local + position_m``.

    :param position_m: origin of the local frame in the world, 3 numbers, metres.
    :param orientation_xyzw: quaternion x, y, z, w, of length 1 within 1e-3 (normalised here).
    :raises InputError: not finite, wrong length, or not a unit quaternion.
    """

    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    orientation_xyzw: tuple[float, float, float, float] = IDENTITY_XYZW

    def __post_init__(self) -> None:
        position = _numbers("position_m", self.position_m, 3)
        quaternion = _numbers("orientation_xyzw", self.orientation_xyzw, 4)
        length = math.sqrt(sum(q * q for q in quaternion))
        if abs(length - 1.0) > _UNIT_TOLERANCE:
            raise InputError(
                f"orientation_xyzw = {list(quaternion)} has length {length:.4g}; expected a unit quaternion x, y, z, w"
            )
        object.__setattr__(self, "position_m", position)
        object.__setattr__(self, "orientation_xyzw", tuple(q / length for q in quaternion))
        object.__setattr__(self, "_rotation", _rotation(self.orientation_xyzw))
        object.__setattr__(self, "_origin", np.array(position))

    @property
    def rotation(self) -> Array:
        """The rotation matrix, (3, 3)."""
        return self._rotation  # type: ignore[attr-defined]  # set once, beside the fields, because it is derived

    @property
    def origin_m(self) -> Array:
        """``position_m`` as an array, (3,)."""
        return self._origin  # type: ignore[attr-defined]

    def to_world(self, points_m: Array) -> Array:
        """Local points in world coordinates.

        :param points_m: (n, 3), metres.
        :return: (n, 3), metres.
        """
        return points_m @ self.rotation.T + self.origin_m

    def to_local(self, points_m: Array) -> Array:
        """World points in local coordinates.

        :param points_m: (n, 3), metres.
        :return: (n, 3), metres.
        """
        return (points_m - self.origin_m) @ self.rotation

    def shifted(self, offset_m: Sequence[float] | Array) -> Pose:
        """This pose moved in world axes.

        :param offset_m: (3,), metres.
        :return: another pose with the same orientation.
        """
        x, y, z = (self.origin_m + np.asarray(offset_m, float)).tolist()
        return Pose((x, y, z), self.orientation_xyzw)

    def turned_about(self, pivot_m: Array, turn_xyzw: Sequence[float], to_m: Array) -> Pose:
        """This pose turned about a point, which is then carried elsewhere.

        :param pivot_m: the point, (3,), metres, in the world.
        :param turn_xyzw: unit quaternion, in world axes.
        :param to_m: where the pivot is carried to, (3,), metres.
        :return: another pose.
        """
        x, y, z = (_rotation(turn_xyzw) @ (self.origin_m - pivot_m) + to_m).tolist()
        return Pose((x, y, z), multiply_xyzw(turn_xyzw, self.orientation_xyzw))


def _rotation(xyzw: Sequence[float]) -> Array:
    x, y, z, w = xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def multiply_xyzw(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float, float]:
    """Quaternion product ``a·b``: the turn ``b`` followed by the turn ``a``.

    :param a: quaternions x, y, z, w, not zero.
    :param b: likewise, with ``a``.
    :return: normalised.
    """
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    product = (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
    length = math.sqrt(sum(q * q for q in product))
    return _four([q / length for q in product])


def shortest_turn_xyzw(start: Array, end: Array) -> tuple[float, float, float, float]:
    """The smallest rotation that takes one direction to another.

    Opposite directions leave the axis open; one at right angles to ``start`` is taken, always the same one.

    :param start: (3,), any length above zero.
    :param end: likewise, with ``start``.
    :return: unit quaternion x, y, z, w.
    """
    (a, b, c), (x, y, z) = start.tolist(), end.tolist()  # plain numbers: three components are too few for numpy to pay
    length = math.sqrt((a * a + b * b + c * c) * (x * x + y * y + z * z))
    turn = [(b * z - c * y) / length, (c * x - a * z) / length, (a * y - b * x) / length, 1.0 + (a * x + b * y + c * z) / length]
    if turn[3] < 1e-12:
        axis = np.cross(start, np.eye(3)[int(np.argmin(np.abs(start)))])
        return _four([*(axis / np.linalg.norm(axis)).tolist(), 0.0])
    norm = math.sqrt(sum(part * part for part in turn))
    return _four([part / norm for part in turn])


def _four(values: Sequence[float]) -> tuple[float, float, float, float]:
    x, y, z, w = values
    return (float(x), float(y), float(z), float(w))


def _numbers(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} = {brief(values)}; expected {count} finite numbers") from error
    if len(numbers) != count or not all(math.isfinite(number) for number in numbers):
        raise InputError(f"{name} = {brief(list(numbers))}; expected {count} finite numbers")
    return numbers

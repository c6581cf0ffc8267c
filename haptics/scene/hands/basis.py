"""Poses between OpenXR's basis and those of the engines.

An engine's axes are a signed permutation ``M`` of OpenXR's (``p_openxr = M p_engine``, with a scale). A rotation goes with
it, both the world's axes and the joint's own, ``R_openxr = M R_engine M^T``; on a quaternion that is ``v -> det(M) M v`` for
the vector part, ``w`` unchanged. So a finger that points along -Z of its joint in OpenXR points along +Z in Unity and +X in
Unreal: each engine's own *forward*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.errors import InputError
from haptics.units import brief, number, one_of

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Basis:
    """An engine's axes and unit.

    :param name: such as ``unity``.
    :param axes: ``M``, a signed permutation; rows: OpenXR's x, y, z in the engine's coordinates.
    :param unit_m: metres in one unit of the engine, 1e-6 to 1000.
    :raises InputError: axes that are no signed permutation, or a unit out of range.
    """

    name: str
    axes: tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]
    unit_m: float = 1.0

    def __post_init__(self) -> None:
        try:
            axes = np.array(self.axes, float)
        except (TypeError, ValueError):  # rows of unequal length, or no numbers
            axes = np.empty(0)
        if axes.shape != (3, 3) or not (np.abs(axes) @ np.ones(3) == 1).all() or not (axes @ axes.T == np.eye(3)).all():
            raise InputError(f"axes = {brief(self.axes)}; expected three rows with one 1 or -1 each, no two in one column")
        number("unit_m", self.unit_m, 1e-6, 1e3, "m")

    @property
    def right_handed(self) -> bool:
        """Whether x cross y is z."""
        return bool(np.linalg.det(self.axes) > 0)

    def to_openxr(self, position: ArrayLike, orientation_xyzw: ArrayLike) -> tuple[Floats, Floats]:
        """Poses of the engine in OpenXR's basis.

        :param position: (..., 3), in the engine's unit.
        :param orientation_xyzw: (..., 4), unit quaternions.
        :return: positions (..., 3), m, and quaternions (..., 4).
        """
        axes = np.array(self.axes, float)
        return np.asarray(position, float) @ axes.T * self.unit_m, _turned(orientation_xyzw, axes)

    def from_openxr(self, position_m: ArrayLike, orientation_xyzw: ArrayLike) -> tuple[Floats, Floats]:
        """Poses in OpenXR's basis in that of the engine.

        :param position_m: (..., 3), m.
        :param orientation_xyzw: (..., 4), unit quaternions.
        :return: positions (..., 3), in the engine's unit, and quaternions (..., 4).
        """
        axes = np.array(self.axes, float)
        return np.asarray(position_m, float) @ axes / self.unit_m, _turned(orientation_xyzw, axes.T)


def _turned(orientation_xyzw: ArrayLike, axes: Floats) -> Floats:
    orientation = np.asarray(orientation_xyzw, float)
    vector = orientation[..., :3] @ (axes.T * np.linalg.det(axes))
    return np.concatenate([vector, orientation[..., 3:]], axis=-1)


BASES = {
    basis.name: basis
    for basis in (
        Basis("openxr", ((1, 0, 0), (0, 1, 0), (0, 0, 1))),
        Basis("webxr", ((1, 0, 0), (0, 1, 0), (0, 0, 1))),  # the same
        Basis("godot", ((1, 0, 0), (0, 1, 0), (0, 0, 1))),  # right-handed, +Y up, -Z forward, metres
        Basis("unity", ((1, 0, 0), (0, 1, 0), (0, 0, -1))),  # left-handed, +Y up, +Z forward, metres
        Basis("unreal", ((0, 1, 0), (0, 0, 1), (-1, 0, 0)), unit_m=0.01),  # left-handed, +X forward, +Z up, centimetres
    )
}
"""By name."""


def basis(name: str) -> Basis:
    """The basis of an engine.

    :param name: one of ``BASES``.
    :return: its axes and unit.
    :raises InputError: no such basis.
    """
    return BASES[one_of("basis", name, tuple(BASES))]

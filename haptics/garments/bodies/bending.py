"""How the analytic body's flesh follows its joints.

A hinge (elbow, knee) bends a limb like flesh about a bone: outside it goes round the joint, inside it folds with a small
radius, and beyond ``reach`` it turns as a rigid part about the joint. Ball joints and the spine turn each point by its share
of the joint's rotation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptics.garments.mesh import Floats

_ROUNDNESS = 0.75
"""Share of the limb's radius with which its centre line turns; outside turns with all of it, inside with half of it."""
_REACH_RADII = 4.0
"""How far from the joint, in radii of the limb, it is deformed: what 120 degrees need at the inside."""
_FLATNESS = 8
"""Even power: the larger, the more evenly stretch is spread within the reach."""


def rotation(vector: Floats) -> Floats:
    """Rotation matrices of rotation vectors (Rodrigues' formula).

    :param vector: axis times angle, rad, ``(..., 3)``; zero vectors give the identity.
    :return: rotation matrices, ``(..., 3, 3)``.
    """
    vector = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    # sinc keeps both factors exact where the angle is zero
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (cross @ cross)


def turned(points_m: Floats, centre_m: Floats, vector: Floats, share: Floats) -> Floats:
    """Points turned about a centre, each by its share of a rotation.

    :param points_m: the points, m, ``(points, 3)``.
    :param centre_m: the point that stays, m, ``(3,)``.
    :param vector: the whole rotation, axis times angle, rad, ``(3,)``.
    :param share: part of it that each point follows, 0 (stays) to 1, ``(points,)``.
    :return: the points, m, ``(points, 3)``.
    """
    moved = share > 0
    turns = rotation(share[moved, None] * vector)
    result = points_m.copy()
    result[moved] = centre_m + np.einsum("pij,pj->pi", turns, points_m[moved] - centre_m)
    return result


def smooth_step(fraction: Floats) -> Floats:
    """Cubic step: 0 below 0, 1 above 1, 3 f^2 - 2 f^3 between.

    :param fraction: f, of any shape, no unit.
    :return: 0 to 1, of the same shape.
    """
    f = np.clip(fraction, 0.0, 1.0)
    return f * f * (3 - 2 * f)


@dataclass(frozen=True, eq=False)
class Hinge:
    """A joint within a limb.

    :param centre_m: the joint, m, ``(3,)``.
    :param direction: unit vector along the straight limb, away from the trunk, ``(3,)``.
    :param radius_m: radius of the limb at the joint, m.
    :param longest_m: largest distance from the joint at which flesh is deformed, m; a limb too thick for it folds as a thinner
        one.
    :param belly_m: distance above the joint at which the muscle that bends it is thickest, m.
    :param bulge_m: how much thicker the muscle gets at a half turn, m; it grows with (1 - cos angle) / 2.
    """

    centre_m: Floats
    direction: Floats
    radius_m: float
    longest_m: float
    belly_m: float
    bulge_m: float

    def bent(self, points_m: Floats, vector: Floats) -> Floats:
        """The limb's points with the joint turned.

        :param points_m: points of the straight limb, m, ``(points, 3)``.
        :param vector: rotation vector of the joint, rad, ``(3,)``.
        :return: the points, m, ``(points, 3)``.
        """
        turn = rotation(vector)
        swung = turn @ self.direction
        angle = float(np.arctan2(np.linalg.norm(np.cross(self.direction, swung)), self.direction @ swung))
        if angle < 1e-9:
            return self._twisted(points_m, vector)
        axis = np.cross(self.direction, swung)
        axis /= np.linalg.norm(axis)
        twist = rotation(-angle * axis) @ turn  # what the turn does beside the swing: a rotation about the limb
        about = 0.5 * self.direction @ np.array([twist[2, 1] - twist[1, 2], twist[0, 2] - twist[2, 0], twist[1, 0] - twist[0, 1]])
        points = self._twisted(points_m, np.arctan2(about, 0.5 * (np.trace(twist) - 1)) * self.direction)
        inward = np.cross(axis, self.direction)
        offset = points - self.centre_m
        s, y, z = offset @ self.direction, offset @ inward, offset @ axis
        s, y = self._swung(s, y + self._bulge(s, y, angle), angle)
        return self.centre_m + np.outer(s, self.direction) + np.outer(y, inward) + np.outer(z, axis)

    @property
    def _fold_m(self) -> float:
        return min(self.radius_m, self.longest_m / _REACH_RADII)

    @property
    def _reach_m(self) -> float:
        return _REACH_RADII * self._fold_m

    def _twisted(self, points_m: Floats, vector: Floats) -> Floats:
        s = (points_m - self.centre_m) @ self.direction
        return turned(points_m, self.centre_m, vector, smooth_step(0.5 + 0.5 * s / self._reach_m))

    def _bulge(self, s: Floats, y: Floats, angle: float) -> Floats:
        profile = np.exp(-(((s + self.belly_m) / (0.45 * self.belly_m)) ** 2))
        return 0.5 * self.bulge_m * (1 - np.cos(angle)) * profile * np.clip(y / self.radius_m, 0.0, 1.0) ** 2

    def _swung(self, s: Floats, y: Floats, angle: float) -> tuple[Floats, Floats]:
        """Along and inward coordinates, in the plane of the bend, of points that stood at (s, y).

        The line of all points with one y becomes straight, arc, straight: the arc has the radius rho = c r - (1 - c) y
        about a centre on the bisector and touches both straights at the distance (y + rho) tan(angle / 2) from the corner.
        These lines never cross. Along each, material spreads over the new length with a smooth stretch, 1 at the ends.
        """
        reach, power = self._reach_m, _FLATNESS
        rho = np.maximum(_ROUNDNESS * self._fold_m - (1 - _ROUNDNESS) * y, 0.0)
        tangent = (y + rho) * np.tan(angle / 2)
        excess = (rho * angle - 2 * tangent) / (2 * reach)  # mean stretch, less 1
        inside = np.clip(s, -reach, reach)
        spread = (1 + 1 / power) * (inside + reach - (inside ** (power + 1) / reach**power + reach) / (power + 1))
        length = (inside + reach) + excess * spread  # along the new line, from where the limb starts to be deformed
        on_arc = length - (reach - tangent)
        turned_by = np.clip(np.divide(on_arc, rho, out=np.zeros_like(s), where=rho > 0), 0.0, angle)
        beyond = np.maximum(on_arc - rho * angle, 0.0)
        along = np.minimum(length - reach, -tangent) + rho * np.sin(turned_by) + beyond * np.cos(angle)
        inward = y + rho * (1 - np.cos(turned_by)) + beyond * np.sin(angle)
        rigid_along, rigid_inward = s * np.cos(angle) - y * np.sin(angle), s * np.sin(angle) + y * np.cos(angle)
        before, after = s <= -reach, s >= reach
        return np.select([before, after], [s, rigid_along], along), np.select([before, after], [y, rigid_inward], inward)

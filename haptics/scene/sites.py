"""Where the fifteen tactors sit on a hand.

Five fingertips, four intermediate phalanges (not the little finger's), five on the palm at the base of each finger, and one
on the outer palm below the thumb (thesis 3.4.6), in the order of their channels. A site is a sphere: its centre is a fixed
blend of joints plus an offset fixed to one joint, and its far side is the skin.

A fingertip's sphere is the tip joint with 7 mm. The others are assumed: a sphere of 5 mm (a tactor is 8 x 9.5 mm, thesis
3.4.2) whose far side lies 8 mm to the palmar side of a phalanx's bone, and 12 mm to that of a knuckle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from haptics.errors import InputError
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import JOINT
from haptics.units import in_range, nearest

TIP_RADIUS_M = 0.007
PAD_RADIUS_M = 0.005
PHALANX_SKIN_M = 0.008
PALM_SKIN_M = 0.012
LARGEST_OFFSET_M = 0.05
"""A calibration that moves a tactor farther than this from its joint names the wrong site (assumed)."""

# site: joints with their weights; the joint whose axes the offset is in; depth of the skin below the bone; radius
_TIP = {finger: ({f"{finger}_tip": 1.0}, f"{finger}_tip", TIP_RADIUS_M, TIP_RADIUS_M)
        for finger in ("thumb", "index", "middle", "ring", "little")}  # fmt: skip
_PHALANX = {
    finger: ({f"{finger}_{near}": 0.5, f"{finger}_distal": 0.5}, f"{finger}_{near}", PHALANX_SKIN_M, PAD_RADIUS_M)
    for finger, near in (("thumb", "proximal"), ("index", "intermediate"), ("middle", "intermediate"), ("ring", "intermediate"))
}
_PALM = {
    finger: ({f"{finger}_proximal": 1.0}, f"{finger}_metacarpal", PALM_SKIN_M, PAD_RADIUS_M)
    for finger in ("thumb", "index", "middle", "ring", "little")
}
_LAYOUT = {
    **{f"{finger}_tip": row for finger, row in _TIP.items()},
    **{f"{finger}_phalanx": row for finger, row in _PHALANX.items()},
    **{f"palm_{finger}": row for finger, row in _PALM.items()},
    "palm_outer": ({"thumb_metacarpal": 0.7, "thumb_proximal": 0.3}, "palm", PALM_SKIN_M, PAD_RADIUS_M),
}

SITES: tuple[str, ...] = tuple(_LAYOUT)
"""The sites' names, in the order of the array's channels 0 to 14."""
SITE = {name: index for index, name in enumerate(SITES)}


@dataclass(frozen=True, slots=True, eq=False)
class SiteMap:
    """From a hand's joints to the centres of its fifteen sites: ``c_s = sum_j W_sj p_j + R(q_f(s)) o_s``.

    :param weights: ``W``, (15, 26), rows that sum to one.
    :param offset_joint: ``f``, (15,), the joint whose axes a site's offset is in.
    :param offset_m: ``o``, (15, 3), metres; -y is toward the palmar side.
    :param radius_m: (15,), metres.
    """

    weights: Floats
    offset_joint: np.ndarray
    offset_m: Floats
    radius_m: Floats
    _left: np.ndarray
    _right: np.ndarray
    _rotation: Floats

    @classmethod
    def of(cls, weights: ArrayLike, offset_joint: ArrayLike, offset_m: ArrayLike, radius_m: ArrayLike) -> SiteMap:
        """A map from its parts.

        :param weights: ``W``, (15, 26), rows that sum to one.
        :param offset_joint: ``f``, (15,), indices in ``JOINTS``.
        :param offset_m: ``o``, (15, 3), metres, in the axes of its joint.
        :param radius_m: (15,), metres.
        :return: the map, ready to use.
        """
        joint, offset = np.asarray(offset_joint), np.asarray(offset_m, float)
        left, right, rotation = _rotation_form(joint, offset)
        return cls(np.asarray(weights, float), joint, offset, np.asarray(radius_m, float), left, right, rotation)

    def positions(self, position_m: Floats, orientation_xyzw: Floats) -> Floats:
        """The sites' centres.

        :param position_m: joints, (..., 26, 3), metres.
        :param orientation_xyzw: unit quaternions, (..., 26, 4).
        :return: (..., 15, 3), metres.
        """
        flat = orientation_xyzw.reshape(*orientation_xyzw.shape[:-2], 104)
        products = flat.take(self._left, -1) * flat.take(self._right, -1)
        centres = self.weights @ position_m
        centres += (products @ self._rotation).reshape(centres.shape)
        return centres

    def moved(self, offsets_m: Mapping[str, ArrayLike]) -> SiteMap:
        """A map for one user, from where the tactors really sit.

        :param offsets_m: by site's name, (3,), metres in the axes of its joint, added to where it was.
        :return: another map; this one stays as it is.
        :raises InputError: no such site, or a move beyond 50 mm along an axis.
        """
        offset = self.offset_m.copy()
        for name, by_m in offsets_m.items():
            if name not in SITE:
                raise InputError(f"site = {name!r} is not known; known sites: {', '.join(SITES)}{nearest(name, SITES)}")
            by = np.asarray(by_m)
            if by.shape != (3,):
                raise InputError(f"offset of {name} has shape {by.shape}; expected (3,), metres")
            offset[SITE[name]] += [
                in_range(f"offset of {name} along {axis}", part, -LARGEST_OFFSET_M, LARGEST_OFFSET_M, "m")
                for axis, part in zip("xyz", by.tolist(), strict=True)
            ]
        return SiteMap.of(self.weights, self.offset_joint, offset, self.radius_m)


def _rotation_form(offset_joint: np.ndarray, offset_m: Floats) -> tuple[np.ndarray, np.ndarray, Floats]:
    """The rotated offsets as one linear map of products of quaternion parts: the parts' places, (p,) twice, and (p, 45).

    ``R(q) o = (w^2 - v.v) o + 2 (v.o) v + 2 w (v x o)`` is quadratic in q, so its coefficients can be laid down once.
    """
    sites = len(offset_m)
    form = np.zeros((sites, 4, 4, 3))
    for axis in range(3):
        form[:, axis, axis] -= offset_m
        for other in range(3):
            form[:, axis, other, axis] += 2.0 * offset_m[:, other]
        form[:, axis, 3] += 2.0 * np.cross(np.eye(3)[axis], offset_m)
    form[:, 3, 3] += offset_m
    site, left, right = np.nonzero(np.any(form, axis=-1))
    rotation = np.zeros((len(site), sites, 3))
    rotation[np.arange(len(site)), site] = form[site, left, right]
    return offset_joint[site] * 4 + left, offset_joint[site] * 4 + right, rotation.reshape(len(site), 3 * sites)


def nominal_sites() -> SiteMap:
    """The map of a glove that nobody has calibrated.

    :return: it fits either hand.
    """
    weights, joint, offset, radius = np.zeros((15, 26)), np.zeros(15, dtype=np.intp), np.zeros((15, 3)), np.zeros(15)
    for site, (blend, frame, skin_m, radius_m) in enumerate(_LAYOUT.values()):
        for name, weight in blend.items():
            weights[site, JOINT[name]] = weight
        joint[site], radius[site] = JOINT[frame], radius_m
        offset[site, 1] = radius_m - skin_m
    return SiteMap.of(weights, joint, offset, radius)

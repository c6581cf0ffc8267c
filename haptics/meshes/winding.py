"""How often a surface winds around points: 1 inside a closed one that faces outward, 0 outside.

From the solid angles of van Oosterom and Strackee (1983); see Jacobson et al. (2013).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def winding_number(points: Floats, corners: Floats) -> Floats:
    """How often a surface winds around each point.

    :param points: ``(n, 3)``.
    :param corners: ``(t, 3, 3)``, the triangles' corners, in the points' unit.
    :return: ``(n,)``; 1 inside a closed surface that faces outward, 0 outside it.
    """
    a, b, c = (corners[None, :, k, :] - points[:, None, :] for k in range(3))
    la, lb, lc = (np.sqrt(np.einsum("nfi,nfi->nf", v, v)) for v in (a, b, c))
    triple = np.einsum("nfi,nfi->nf", a, np.cross(b, c))
    dots = (np.einsum("nfi,nfi->nf", u, v) * length for u, v, length in ((a, b, lc), (b, c, la), (c, a, lb)))
    solid_angle = 2.0 * np.arctan2(triple, la * lb * lc + sum(dots))
    return solid_angle.sum(axis=1) / (4.0 * math.pi)

"""A round tube as a body and a garment on it: what can be said of it is exact but for the mesh."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from haptics.garments.garment import Garment

RADIUS_M, LENGTH_M = 0.045, 0.3


def tube(around: int = 40, length_m: float = LENGTH_M, radius_m: float = RADIUS_M):
    """(vertices, triangles, rings): a tube along z, its normals outward."""
    rings = round(length_m / (2 * np.pi * radius_m / around * 0.9)) + 1
    z, angle = np.meshgrid(np.linspace(-length_m / 2, length_m / 2, rings), 2 * np.pi * np.arange(around) / around, indexing="ij")
    angle = angle + (np.arange(rings)[:, None] % 2) * np.pi / around
    vertices = np.stack([radius_m * np.cos(angle), radius_m * np.sin(angle), z], axis=2).reshape(-1, 3)
    triangles = []
    for i in range(rings - 1):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            c, d = a + around, b + around
            triangles += [[a, b, c], [b, d, c]] if i % 2 == 0 else [[a, b, d], [a, d, c]]
    return vertices, np.array(triangles), rings


def tube_garment(around: int = 40, short_m: float = 0.1, band_m: float = 0.0) -> tuple[np.ndarray, np.ndarray, Garment]:
    """A tube body, and a garment on its middle: ``short_m`` shorter at both ends, attached within ``band_m`` of its ends."""
    vertices, triangles, _ = tube(around)
    worn = triangles[(np.abs(vertices[triangles][:, :, 2]) <= LENGTH_M / 2 - short_m + 1e-9).all(axis=1)]
    used = np.unique(worn)
    number = np.full(len(vertices), -1)
    number[used] = np.arange(len(used))
    weights = csr_array((np.ones(len(used)), (np.arange(len(used)), used)), shape=(len(used), len(vertices)))
    centres = np.abs(vertices[worn][:, :, 2].mean(axis=1))
    attached = centres > LENGTH_M / 2 - short_m - band_m if band_m else np.zeros(len(worn), dtype=bool)
    return vertices, triangles, Garment("tube", "test", number[worn], weights, attached, np.ones(len(worn), dtype=bool))

"""A stand-in for a garment with an exact equilibrium and a known best design: rows of bars, each pulled by its own amount.

Along a row the triangles are springs in series: one of width w and length l has the compliance c = l / (k w), the tension is
T = u / sum(c), and each stores T^2 c / 2. No row feels another, so the best use of n rows' area are the n rows pulled farthest.
"""

from __future__ import annotations

import numpy as np

from haptics.garments.equilibrium.simulation import Equilibrium
from haptics.garments.mesh import SurfaceMesh


def flat_sheet(columns: int, rows: int, width_m: float = 0.1, height_m: float = 0.1) -> SurfaceMesh:
    """A rectangle in the plane z = 0, each cell cut in two; the triangles of a row have neighbouring numbers."""
    x, y = np.meshgrid(np.linspace(0, width_m, columns + 1), np.linspace(0, height_m, rows + 1))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    a, b, c, d = first, first + 1, first + columns + 2, first + columns + 1
    return SurfaceMesh(vertices, np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3), "sheet")


def tube(around: int, along: int, radius_m: float = 0.04, length_m: float = 0.3) -> SurfaceMesh:
    """A cylinder about z, triangles anticlockwise from outside; the first seam vertex lies at +x."""
    flat = flat_sheet(around, along, 2 * np.pi, length_m)
    angle, z = flat.vertices_m[:, 0], flat.vertices_m[:, 1]
    vertices = np.stack([radius_m * np.cos(angle), radius_m * np.sin(angle), z], axis=1)
    number = np.arange(len(vertices)).reshape(along + 1, around + 1)
    number = number[:, :-1] - np.arange(along + 1)[:, None]
    joined = np.hstack([number, number[:, :1]]).ravel()
    keep = np.ones((along + 1, around + 1), bool)
    keep[:, -1] = False
    return SurfaceMesh(vertices[keep.ravel()], joined[flat.triangles], "tube")


class BarPanel:
    """:param pulls_m: elongation of each row, ``(rows,)``.
    :param fails_at: numbers of solve calls (from 0) that end without an equilibrium.
    """

    cloth_n_m, reinforced_n_m = 135.0, 1995.0

    def __init__(self, pulls_m, columns: int = 20, fails_at=()):
        self.rows, self.columns = len(pulls_m), columns
        self.rest = flat_sheet(columns, self.rows)
        self.pulls_m = np.asarray(pulls_m, float)
        self.designable = np.ones(len(self.rest.triangles), bool)
        self.stiffness_scale = np.ones(len(self.rest.triangles))
        self.fails_at, self.starts = set(fails_at), []

    @property
    def triangles(self):
        return self.rest.triangles

    @property
    def areas_m2(self):
        return self.rest.areas_m2

    def row_of(self) -> np.ndarray:
        return np.arange(len(self.triangles)) // (2 * self.columns)

    def solve(self, design, start=None) -> Equilibrium:
        self.starts.append(start)
        converged = len(self.starts) - 1 not in self.fails_at
        stiffness = np.where(design, self.reinforced_n_m, self.cloth_n_m) * self.stiffness_scale
        width = 0.1 / self.rows
        compliance = (self.areas_m2 / width) / (stiffness * width)
        tension = self.pulls_m / np.bincount(self.row_of(), compliance)
        energy = 0.5 * tension[self.row_of()] ** 2 * compliance
        positions = self.rest.vertices_m + np.array([0.0, 0.0, energy.sum()])
        stretches = np.ones((len(design), 2))
        return Equilibrium(
            positions, converged, 0.0 if converged else 1.0, 1e-7, 1, float(energy.sum()), energy, stretches, 0.0, 0.0
        )

"""What a triangle's reinforcement is worth to the garment's energy, smoothed over the cloth (thesis 5.5.2, 5.5.3)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from haptics.garments.mesh import Bools, Floats, SurfaceMesh

PASS_SPREAD = 8 / (3 * np.sqrt(3))
"""Squared spread of one pass over triangle areas: it takes two steps from a corner to a centre, h^2 / 3 each, and equilateral
triangles have h^2 = 4 A / sqrt(3)."""


def sensitivities(
    design: Bools, areas_m2: Floats, element_energy_j: Floats, stiffness_ratio: float, penalty: float, d_min: float
) -> Floats:
    """Sensitivity numbers of eq. 5.12.

    alpha = (1 - k2/k1) W / 2 where reinforced, d^(p-1) (k1 - k2) / (d^p k1 + (1 - d^p) k2) W / 2 where cloth, with d = ``d_min``.

    Energy by area W = t W_garment and stiffness by width k = E t take the place of energy by volume and E: reinforcing changes
    the thickness too, and the energy of eq. 5.7 goes with their product. At an equilibrium p alpha A is half the total energy's
    derivative by d, where k(d) = d^p k1 + (1 - d^p) k2: the positions' own change adds nothing, since they are a minimum.

    :param design: reinforced triangles, ``(triangles,)``.
    :param areas_m2: area of each triangle, m2, ``(triangles,)``.
    :param element_energy_j: strain energy of each triangle, J, ``(triangles,)``.
    :param stiffness_ratio: k1 / k2, reinforced over cloth, above 1.
    :param penalty: p, from 1.
    :param d_min: d of cloth, above 0, at most 1.
    :return: alpha, J/m2, ``(triangles,)``.
    """
    energy_j_m2 = element_energy_j / areas_m2
    kept = 1 - 1 / stiffness_ratio
    gained = d_min ** (penalty - 1) * (stiffness_ratio - 1) / (d_min**penalty * stiffness_ratio + 1 - d_min**penalty)
    return 0.5 * np.where(design, kept, gained) * energy_j_m2


def pass_spread_m(area_m2: float) -> float:
    """Root mean square distance over which one pass of eq. 5.13 spreads a value on triangles of this area.

    :param area_m2: area of one triangle, m2.
    :return: distance, m.
    """
    return float(np.sqrt(PASS_SPREAD * area_m2))


def mesh_filter(rest: SurfaceMesh, spread_m: float) -> Callable[[Floats], Floats]:
    """The filter of 5.5.3 with a fixed reach: triangles to corners by area (eq. 5.13), and back by the corners' mean.

    The plain filter reaches as far as its triangles are large, so that a finer mesh has thinner, other designs. Between its two
    halves the corners' values are therefore smoothed by (M + r^2 K) a = M a0, the Helmholtz equation on the surface (Lazarov and
    Sigmund 2011) with M the corners' areas and K the cotangent Laplacian; values do not leave through the cloth's edge. Its
    squared spread is 4 r^2; r is such that both together reach ``spread_m``. Where one pass already reaches farther, r is 0: the
    plain filter. Constants are kept.

    :param rest: the garment at rest.
    :param spread_m: root mean square distance over which a value is spread, m; 0 for the plain filter.
    :return: a function from values at the triangles, ``(triangles,)``, to smoothed ones, ``(triangles,)``.
    """
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    corners, areas, lumped = rest.triangles, rest.areas_m2, rest.vertex_areas_m2
    length_m2 = max(0.0, (spread_m**2 - PASS_SPREAD * float(areas.mean())) / 4)
    solve: Callable[[Floats], Floats] = (
        splu(csc_array(diags_array(lumped) + length_m2 * laplacian(rest))).solve
        if length_m2 > 0
        else lambda right: right / lumped
    )

    def smooth(alpha: Floats) -> Floats:
        at_corners = np.bincount(corners.ravel(), np.repeat(alpha * areas / 3, 3), minlength=len(lumped))
        return solve(at_corners.astype(float))[corners].mean(axis=1)

    return smooth


def laplacian(mesh: SurfaceMesh):
    """Stiffness of linear triangles for the Laplace operator of the surface (cotangent weights), ``(vertices, vertices)``.

    :param mesh: the surface.
    :return: sparse matrix in CSC form, no unit, ``(vertices, vertices)``.
    """
    from scipy.sparse import coo_array

    points = mesh.vertices_m[mesh.triangles]
    opposite = points[:, [2, 0, 1]] - points[:, [1, 2, 0]]  # the edge across from each corner
    local = np.einsum("eik,ejk->eij", opposite, opposite) / (4 * mesh.areas_m2[:, None, None])
    rows = np.repeat(mesh.triangles, 3, axis=1).ravel()
    columns = np.tile(mesh.triangles, (1, 3)).ravel()
    return coo_array((local.ravel(), (rows, columns)), shape=(len(mesh.vertices_m),) * 2).tocsc()

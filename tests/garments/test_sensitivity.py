"""The worth of a triangle: eq. 5.12 against derivatives of exact equilibria, and the filter on meshes of any fineness."""

from __future__ import annotations

import numpy as np
import pytest
from bar_panel import BarPanel, flat_sheet, tube

from haptics.garments.design.sensitivity import laplacian, mesh_filter, pass_spread_m, sensitivities
from haptics.garments.mesh import SurfaceMesh

RATIO, P, D_MIN = BarPanel.reinforced_n_m / BarPanel.cloth_n_m, 1.6, 0.001


@pytest.fixture
def panel() -> BarPanel:
    return BarPanel(np.linspace(0.004, 0.011, 6), columns=8)


def _design(panel: BarPanel) -> np.ndarray:
    return np.random.default_rng(5).random(len(panel.triangles)) < 0.4


def test_energy_of_a_triangle_is_the_derivative_of_the_total_by_its_stiffness(panel: BarPanel) -> None:
    design = _design(panel)
    own = panel.solve(design).element_energy_j
    for triangle in range(0, len(design), 7):
        totals = []
        for change in (1e-5, -1e-5):
            panel.stiffness_scale[triangle] = 1 + change
            totals.append(panel.solve(design).energy_j)
            panel.stiffness_scale[triangle] = 1.0
        assert (totals[0] - totals[1]) / 2e-5 == pytest.approx(own[triangle], rel=1e-8)


def test_sensitivity_is_the_derivative_by_the_design_variable(panel: BarPanel) -> None:
    """p alpha A = half of dE/dd with k(d) = d^p k1 + (1 - d^p) k2: at d = 1 where reinforced, at d_min where cloth."""
    design = _design(panel)

    def stiffness(d: float) -> float:
        return d**P * panel.reinforced_n_m + (1 - d**P) * panel.cloth_n_m

    # cloth is at d_min, hardly stiffer than at 0
    panel.stiffness_scale[~design] = stiffness(D_MIN) / panel.cloth_n_m
    alpha = sensitivities(design, panel.areas_m2, panel.solve(design).element_energy_j, RATIO, P, D_MIN)
    for triangle in range(0, len(design), 7):
        at, own = (1.0, panel.reinforced_n_m) if design[triangle] else (D_MIN, panel.cloth_n_m)
        before, step, totals = panel.stiffness_scale[triangle], at * 1e-4, []
        for change in (step, -step):
            panel.stiffness_scale[triangle] = stiffness(at + change) / own
            totals.append(panel.solve(design).energy_j)
        panel.stiffness_scale[triangle] = before
        slope = (totals[0] - totals[1]) / (2 * step)
        assert P * alpha[triangle] * panel.areas_m2[triangle] == pytest.approx(slope / 2, rel=1e-6)


def test_equation_5_12_by_hand() -> None:
    alpha = sensitivities(np.array([True, False]), np.array([2.0, 4.0]), np.array([6.0, 8.0]), 11.4, 1.6, 0.001)
    d = 0.001**1.6
    assert alpha[0] == pytest.approx(0.5 * (1 - 0.5 / 5.7) * 3.0, rel=1e-12)
    assert alpha[1] == pytest.approx(0.5 * 0.001**0.6 * (5.7 - 0.5) / (d * 5.7 + (1 - d) * 0.5) * 2.0, rel=1e-12)


def test_one_material_has_no_sensitivity() -> None:
    assert not sensitivities(np.array([True, False]), np.ones(2), np.ones(2), 1.0, P, D_MIN).any()


def test_plain_filter_by_hand() -> None:
    """Two triangles share an edge: its ends see both by area, the others one."""
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 2, 0]], float)
    mesh = SurfaceMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    (a, b), alpha = mesh.areas_m2, np.array([3.0, 9.0])
    shared = (a * 3 + b * 9) / (a + b)
    assert mesh_filter(mesh, 0.0)(alpha) == pytest.approx([(2 * shared + 3) / 3, (2 * shared + 9) / 3], rel=1e-12)


@pytest.mark.parametrize("spread_m", [0.0, 0.02])
def test_filter_keeps_a_constant(spread_m: float) -> None:
    rest = tube(17, 23)
    assert mesh_filter(rest, spread_m)(np.full(len(rest.triangles), 4.5)) == pytest.approx(4.5, rel=1e-12)


def _lattice(edge_m: float) -> SurfaceMesh:
    """Equilateral triangles over some 0.2 m, the middle of one of them at the origin."""
    n = round(0.2 / edge_m)
    sheet = flat_sheet(n, n, 1.0, 1.0)
    i, j = sheet.vertices_m[:, 0] * n - n // 2, sheet.vertices_m[:, 1] * n - n // 2
    points = edge_m * np.stack([i + j / 2, j * np.sqrt(3) / 2, 0 * i], axis=1)
    turned = SurfaceMesh(points, np.stack([*_halves(n)], axis=0).reshape(-1, 3))
    return turned.at(points - turned.centres_m[np.argmin(np.linalg.norm(turned.centres_m, axis=1))])


def _halves(n: int):
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    yield np.stack([first, first + 1, first + n + 1], axis=1)
    yield np.stack([first + 1, first + n + 2, first + n + 1], axis=1)


def _spread_m(mesh: SurfaceMesh, spread_m: float) -> float:
    point = np.zeros(len(mesh.triangles))
    point[np.argmin(np.linalg.norm(mesh.centres_m, axis=1))] = 1.0
    out = mesh_filter(mesh, spread_m)(point)
    assert out.sum() == pytest.approx(1.0, rel=1e-9)
    return float(np.sqrt(out @ (mesh.centres_m**2).sum(axis=1)))


def test_one_plain_pass_spreads_a_value_as_far_as_stated() -> None:
    mesh = _lattice(0.01)
    assert _spread_m(mesh, 0.0) == pytest.approx(pass_spread_m(float(mesh.areas_m2[0])), rel=1e-9)


@pytest.mark.parametrize("edge_m", [0.012, 0.008, 0.005, 0.003])
def test_filter_reaches_equally_far_on_any_mesh(edge_m: float) -> None:
    """On every mesh fine enough for it; a sheet of 0.2 m cuts off less than 1e-4 of the tail."""
    assert _spread_m(_lattice(edge_m), 0.0105) == pytest.approx(0.0105, rel=2e-4)


def test_filter_with_a_reach_below_the_mesh_is_the_plain_one() -> None:
    mesh, alpha = _lattice(0.01), np.random.default_rng(1).random(2 * 20 * 20)
    assert np.array_equal(mesh_filter(mesh, 0.005)(alpha), mesh_filter(mesh, 0.0)(alpha))


def test_filter_does_not_reach_across_a_gap() -> None:
    near, far = flat_sheet(6, 6), flat_sheet(6, 6)
    both = SurfaceMesh(
        np.concatenate([near.vertices_m, far.vertices_m + np.array([0, 0, 1e-3])]),
        np.concatenate([near.triangles, far.triangles + len(near.vertices_m)]),
    )
    alpha = np.repeat([1.0, 0.0], 72)
    assert mesh_filter(both, 0.05)(alpha) == pytest.approx(alpha, abs=1e-12)


def test_laplacian_gives_the_exact_energy_of_a_linear_field() -> None:
    sheet = flat_sheet(7, 5, 0.2, 0.1)
    field = 3 * sheet.vertices_m[:, 0] - 2 * sheet.vertices_m[:, 1]
    assert field @ (laplacian(sheet) @ field) == pytest.approx((9 + 4) * 0.2 * 0.1, rel=1e-12)

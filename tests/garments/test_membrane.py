"""The membrane against an energy in extended precision, its derivatives against differences, and what must not change it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.special import lambertw
from scipy.stats import special_ortho_group

from haptics.errors import InputError
from haptics.garments.equilibrium.membrane import SLACK, TAUT, WRINKLED, Membrane, natural_width
from haptics.garments.materials import CLOTH, REINFORCED, Lame, Material
from haptics.garments.mesh import SurfaceMesh

Array = NDArray[np.float64]
LAMES = [material.lame_n_m(lame) for material in (CLOTH, REINFORCED) for lame in ("plane", "thesis")]
CONSTANTS = [*LAMES, (0.0, 1.0), (1e4, 1.0)]
"""(lambda, mu) in N/m: the stated materials under both readings, cloth that does not narrow, cloth that keeps its area."""
KINK = 1e-3
"""Nearer than this to a kink, in stretch, differences would straddle it."""


class Triangles:
    """Separate triangles of random rest shapes of about a metre, each deformed by its own F."""

    def __init__(self, f: Array, lame: tuple[float, float], seed: int = 0):
        rng = np.random.default_rng(seed)
        n = len(f)
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) + rng.uniform(-0.25, 0.25, (n, 3, 2))
        frames = special_ortho_group.rvs(3, size=n, random_state=rng).reshape(n, 3, 3)
        rest = np.einsum("nij,nkj->nki", frames[:, :, :2], corners) + rng.normal(size=(n, 1, 3))
        self.rest = SurfaceMesh(rest.reshape(-1, 3), np.arange(3 * n).reshape(n, 3), "triangles")
        self.membrane = Membrane.at_rest(self.rest)
        self.lame = np.tile(lame, (n, 1))
        self.positions = np.einsum("nij,nkj->nki", f, corners).reshape(-1, 3)

    def energy(self, positions: Array) -> Array:
        return self.membrane.element_energy_j(positions, self.lame)

    def gradient(self, positions: Array) -> Array:
        return self.membrane.gradient_n(positions, self.lame).reshape(-1, 9)

    def hessian(self, positions: Array) -> Array:
        return self.membrane.element_hessians_n_m(positions, self.lame)

    def moved(self, unknown: int, by: Array) -> Array:
        x = self.positions.reshape(-1, 9).copy()
        x[:, unknown] += by
        return x.reshape(-1, 3)


def with_stretches(s1: Array, s2: Array, seed: int = 1) -> Array:
    """F of these principal stretches in random directions, ``(n, 3, 2)``."""
    rng = np.random.default_rng(seed)
    n = len(s1)
    left = special_ortho_group.rvs(3, size=n, random_state=rng).reshape(n, 3, 3)[:, :, :2]
    right = special_ortho_group.rvs(2, size=n, random_state=rng).reshape(n, 2, 2)
    return np.einsum("nij,nj,nkj->nik", left, np.stack([s1, s2], axis=1), right)


def cases() -> dict[str, Array]:
    rng = np.random.default_rng(2)
    n = 60
    turned_over = rng.normal(size=(n, 3, 2))
    turned_over[:, :2] = np.array([[1.0, 0.0], [0.0, -1.0]]) + 0.3 * rng.normal(size=(n, 2, 2))
    turned_over[:, 2] = 0.0
    line = rng.normal(size=(n, 3, 1)) * np.array([1.0, -0.7])
    return {
        "random": rng.normal(size=(n, 3, 2)),
        "about_rest": with_stretches(1 + rng.uniform(0.002, 0.05, n), 1 + rng.uniform(-0.05, 0.05, n)),
        "nearly_a_line": with_stretches(rng.uniform(1.1, 2, n), 10 ** rng.uniform(-14, -5, n)),
        "a_line": 2 * line,
        "a_short_line": 0.05 * line,
        "a_point": np.zeros((n, 3, 2)),
        "turned_over": turned_over,
        "stretched_a_thousandfold": 1e3 * rng.normal(size=(n, 3, 2)),
        "stretched_one_way": with_stretches(rng.uniform(500, 1500, n), rng.uniform(0.02, 2.0, n)),
        "compressed_a_millionfold": 1e-6 * rng.normal(size=(n, 3, 2)),
        "equal_stretches": with_stretches(s := rng.uniform(1.01, 2, n), s),
    }


CASES = cases()


def stretches(f: Array) -> Array:
    return np.linalg.svd(f, compute_uv=False)


def away_from_kinks(f: Array, lame: tuple[float, float]) -> NDArray[np.bool_]:
    s = stretches(f)
    width = np.array([natural_width(max(s1, 1e-12), *lame) for s1 in s[:, 0]])
    return (np.abs(s[:, 0] - 1) > KINK) & ((s[:, 0] < 1) | (np.abs(s[:, 1] - width) > KINK))


# --- the energy ---


def energy_in_extended_precision(f: Array, lam: float, mu: float) -> np.longdouble:
    """W of one F, from the invariants of F'F and a bisection, in numbers of 64 bits of mantissa."""
    long = np.longdouble
    a, b = f[:, 0].astype(long), f[:, 1].astype(long)
    trace, normal = a @ a + b @ b, np.cross(a, b)
    j = np.sqrt(normal @ normal)
    s1 = 0.5 * (np.sqrt(trace + 2 * j) + np.sqrt(max(trace - 2 * j, long(0))))
    if s1 <= 1:
        return long(0)

    def across(log_w: np.longdouble) -> np.longdouble:
        return long(mu) * np.expm1(2 * log_w) + long(lam) * (np.log(s1) + log_w)

    low, high = -np.log(s1) - 1, long(1)
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if across(middle) < 0 else (low, middle)
    log_s, log_w = np.log(s1), max(high, np.log(j / s1) if j > 0 else -long("inf"))
    stretch = (np.expm1(2 * log_s) - 2 * log_s) + (np.expm1(2 * log_w) - 2 * log_w)
    return long(mu) / 2 * stretch + long(lam) / 2 * (log_s + log_w) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("lame", CONSTANTS)
@pytest.mark.parametrize("name", CASES)
def test_energy_agrees_with_extended_precision(name: str, lame: tuple[float, float]) -> None:
    f = CASES[name]
    triangles = Triangles(f, lame)
    ours = triangles.energy(triangles.positions) / triangles.rest.areas_m2
    exact = np.array([energy_in_extended_precision(one, *lame) for one in f], dtype=np.float64)
    # F itself is known to 1e-15 of its size; at a strain e the energy mu e^2 loses 1e-15 / e of itself: 1e-12 at the 2e-3 here.
    assert ours == pytest.approx(exact, rel=5e-12, abs=1e-20 * lame[1])


@pytest.mark.parametrize("name", CASES)
def test_stretches_are_the_singular_values(name: str) -> None:
    f = CASES[name]
    triangles = Triangles(f, LAMES[0])
    ours = triangles.membrane.stretches(triangles.positions)
    size = stretches(f)[:, :1]
    assert np.abs(ours - stretches(f)).max() <= 1e-14 * max(1.0, size.max())


def test_the_natural_width_is_that_of_lamberts_function() -> None:
    for lam, mu in CONSTANTS[:-2]:
        for s in (0.3, 0.999, 1.0, 1.001, 1.1, 3.0, 1e3):
            ratio = 2 * mu / lam
            expected = np.sqrt(lambertw(ratio * np.exp(ratio) / s**2).real / ratio)
            assert natural_width(s, lam, mu) == pytest.approx(expected, rel=1e-12)
    assert natural_width(2.0, 0.0, 1.0) == 1.0
    assert natural_width(2.0, 1e9, 1.0) == pytest.approx(0.5, rel=1e-8)  # it keeps its area


@pytest.mark.parametrize(
    ("stretch", "lam", "mu"), [(0.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, 0.0), (np.nan, 1.0, 1.0)]
)
def test_a_width_that_does_not_exist_is_refused(stretch: float, lam: float, mu: float) -> None:
    with pytest.raises(InputError, match="natural width of stretch"):
        natural_width(stretch, lam, mu)


def test_the_states_are_slack_wrinkled_and_taut() -> None:
    lame = LAMES[0]
    width = natural_width(1.2, *lame)
    s = np.array([[0.9, 0.5], [1.0, 0.2], [1.2, 0.0], [1.2, width - 1e-6], [1.2, width + 1e-6], [1.2, 1.1]])
    triangles = Triangles(with_stretches(s[:, 0] * (1 - 1e-12), s[:, 1]), lame)
    assert triangles.membrane.states(triangles.positions, triangles.lame).tolist() == [
        SLACK,
        SLACK,
        WRINKLED,
        WRINKLED,
        TAUT,
        TAUT,
    ]


# --- derivatives ---


@pytest.mark.parametrize("lame", CONSTANTS)
@pytest.mark.parametrize("name", CASES)
def test_gradient_and_hessian_agree_with_central_differences(name: str, lame: tuple[float, float]) -> None:
    f = CASES[name]
    f = f[away_from_kinks(f, lame)]
    assert len(f) >= 10
    triangles = Triangles(f, lame)
    energy, gradient, hessian = (g(triangles.positions) for g in (triangles.energy, triangles.gradient, triangles.hessian))
    # Taut cloth bends its energy over its smaller stretch; other cloth over the unit.
    taut = triangles.membrane.states(triangles.positions, triangles.lame) == TAUT
    scale = np.where(taut, np.minimum(stretches(f)[:, 1], 1.0), 1.0)
    step = 5e-5 * scale
    stiffness, force = np.abs(hessian).max(axis=(1, 2)), np.abs(gradient).max(axis=1)
    for i in range(9):
        near, far = ([triangles.moved(i, sign * k * step) for sign in (1, -1)] for k in (1, 2))
        by_energy, by_gradient = (
            (8 * (g(near[0]) - g(near[1])) - (g(far[0]) - g(far[1]))).T / (12 * step)  # the error is of fourth order
            for g in (triangles.energy, triangles.gradient)
        )
        # 1e-6 of the force, or of what a strain of 1e-3 makes; and the rounding of what is subtracted.
        assert (np.abs(by_energy - gradient[:, i]) <= 1e-6 * (force + 1e-3 * stiffness * scale) + 1e-15 * energy / step).all()
        assert (np.abs(by_gradient.T - hessian[:, i]).max(axis=1) <= 1e-6 * stiffness + 1e-15 * force / step).all()


@pytest.mark.parametrize("name", CASES)
def test_the_hessian_is_symmetric_and_forces_balance(name: str) -> None:
    triangles = Triangles(CASES[name], LAMES[1])
    hessian = triangles.hessian(triangles.positions)
    assert np.isfinite(hessian).all()
    assert np.abs(hessian - hessian.transpose(0, 2, 1)).max() <= 1e-12 * max(np.abs(hessian).max(), 1e-300)
    force = triangles.gradient(triangles.positions).reshape(-1, 3, 3)
    x = triangles.positions.reshape(-1, 3, 3)
    size = max(np.abs(force).max(), 1e-300)
    assert np.abs(force.sum(axis=1)).max() <= 1e-13 * size
    assert np.abs(np.cross(x, force).sum(axis=1)).max() <= 1e-12 * size * max(np.abs(x).max(), 1.0)


@pytest.mark.parametrize("lame", LAMES)
def test_the_energy_is_convex_up_to_twice_the_length(lame: tuple[float, float]) -> None:
    rng = np.random.default_rng(5)
    s = np.sort(rng.uniform(0.0, 2.0, (2000, 2)), axis=1)
    triangles = Triangles(with_stretches(s[:, 1], s[:, 0]), lame)
    hessian = triangles.hessian(triangles.positions)
    assert (np.linalg.eigvalsh(hessian)[:, 0] >= -1e-12 * lame[1]).all()


# --- across the kinks ---


@pytest.mark.parametrize("lame", CONSTANTS[:-1])
@pytest.mark.parametrize("kink", ["slack_to_wrinkled", "slack_to_taut", "wrinkled_to_taut"])
def test_energy_and_gradient_go_on_across_a_kink(kink: str, lame: tuple[float, float]) -> None:
    n = 20
    if kink == "wrinkled_to_taut":
        s1 = np.linspace(1.01, 3.0, n)
        s2 = np.array([natural_width(s, *lame) for s in s1])
        nudge = np.array([0.0, 1.0])
    else:
        s1 = np.ones(n)
        s2 = np.linspace(0.0, 0.99, n) if kink == "slack_to_wrinkled" else np.ones(n)
        nudge = np.array([1.0, 0.0]) if kink == "slack_to_wrinkled" else np.array([1.0, 1.0])
    stiffness = 0.0
    for delta in (1e-3, 1e-5, 1e-7):
        sides = [Triangles(with_stretches(s1 + sign * delta * nudge[0], s2 + sign * delta * nudge[1]), lame) for sign in (1, -1)]
        states = [one.membrane.states(one.positions, one.lame) for one in sides]
        assert (states[0] > states[1]).all()
        energy, gradient = ([one.energy(one.positions) for one in sides], [one.gradient(one.positions) for one in sides])
        stiffness = max(stiffness, *(np.abs(one.hessian(one.positions)).max() for one in sides))
        force = max(np.abs(one).max() for one in gradient)
        # The corners move by some 3 delta; the jump may be what stiffness, and force, make of that.
        assert np.abs(gradient[0] - gradient[1]).max() <= 20 * stiffness * delta
        assert np.abs(energy[0] - energy[1]).max() <= 20 * force * delta + 1e-15 * energy[0].max()


# --- what must not change it ---


@pytest.mark.parametrize("lame", LAMES)
def test_at_rest_there_is_no_energy_and_no_force(lame: tuple[float, float]) -> None:
    rng = np.random.default_rng(6)
    triangles = Triangles(np.tile(np.eye(3)[:, :2], (50, 1, 1)), lame)
    turn = special_ortho_group.rvs(3, random_state=rng)
    for positions in (triangles.rest.vertices_m, triangles.rest.vertices_m @ turn.T + [3.0, -2.0, 5.0]):
        # Places of 5 m are known to 1e-15 m, which is a strain of 1e-15.
        assert triangles.energy(positions).max() <= 1e-27 * lame[1]
        assert np.abs(triangles.gradient(positions)).max() <= 1e-13 * lame[1]


@pytest.mark.parametrize("name", CASES)
def test_rigid_motions_turn_the_force_and_leave_the_energy(name: str) -> None:
    rng = np.random.default_rng(7)
    triangles = Triangles(CASES[name], LAMES[2])
    x, turn = triangles.positions, special_ortho_group.rvs(3, random_state=rng)
    moved = x @ turn.T
    energy, force = triangles.energy(x), triangles.gradient(x).reshape(-1, 3)
    assert triangles.energy(moved) == pytest.approx(energy, rel=1e-11, abs=1e-24)
    assert np.abs(triangles.gradient(moved).reshape(-1, 3) - force @ turn.T).max() <= 1e-11 * max(np.abs(force).max(), 1e-300)
    mirrored = x * [1.0, 1.0, -1.0]
    assert triangles.energy(mirrored) == pytest.approx(energy, rel=1e-11, abs=1e-24)


def test_cloth_has_no_grain() -> None:
    f = CASES["random"]
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    one, other = Triangles(f, LAMES[0]), Triangles(f @ turn, LAMES[0])
    assert other.energy(other.positions) == pytest.approx(one.energy(one.positions), rel=1e-12)


def test_which_corner_comes_first_does_not_matter() -> None:
    one = Triangles(CASES["random"], LAMES[0])
    rolled = Membrane.at_rest(SurfaceMesh(one.rest.vertices_m, np.roll(one.rest.triangles, 1, axis=1), "rolled"))
    assert rolled.element_energy_j(one.positions, one.lame) == pytest.approx(one.energy(one.positions), rel=1e-12)
    assert rolled.gradient_n(one.positions, one.lame) == pytest.approx(
        one.membrane.gradient_n(one.positions, one.lame), rel=1e-11, abs=1e-11
    )


finite = st.floats(-1e3, 1e3, allow_nan=False, width=64)


@settings(max_examples=200, deadline=None)
@given(f=st.lists(finite, min_size=6, max_size=6), which=st.integers(0, len(CONSTANTS) - 1))
def test_any_deformation_has_finite_energy_force_and_stiffness(f: list[float], which: int) -> None:
    triangles = Triangles(np.array(f).reshape(1, 3, 2), CONSTANTS[which])
    energy, force, hessian = (g(triangles.positions) for g in (triangles.energy, triangles.gradient, triangles.hessian))
    assert energy[0] >= 0
    assert np.isfinite(energy).all()
    assert np.isfinite(force).all()
    assert np.isfinite(hessian).all()
    # It pulls only: no corner's force has work done by shrinking the triangle.
    assert float(force.ravel() @ triangles.positions.ravel()) >= -1e-9 * np.abs(force).max() * max(
        np.abs(triangles.positions).max(), 1.0
    )


# --- what it stands for ---


@pytest.mark.parametrize("material", [CLOTH, REINFORCED, Material(poisson=0.0), Material(poisson=0.49)])
@pytest.mark.parametrize("lame", ["plane", "thesis"])
def test_a_strip_pulled_a_little_has_youngs_modulus(material: Material, lame: Lame) -> None:
    """E in plane stress; 4 mu (lambda + mu) / (lambda + 2 mu) with the constants of a solid, read as those of a sheet."""
    lam, mu = material.lame_n_m(lame)
    strain = 1e-6
    f = np.zeros((1, 3, 2))
    f[0, 0, 0], f[0, 1, 1] = 1 + strain, natural_width(1 + strain, lam, mu)
    triangles = Triangles(f, (lam, mu))
    along = float(np.vdot(triangles.gradient(triangles.positions).reshape(3, 3)[:, 0], triangles.positions[:, 0]))
    modulus_n_m = along / (triangles.rest.areas_m2[0] * (1 + strain)) / strain
    expected = material.young_pa * material.thickness_m if lame == "plane" else 4 * mu * (lam + mu) / (lam + 2 * mu)
    assert modulus_n_m == pytest.approx(expected, rel=1e-5)  # 2 to 3 strains of it, by the next term
    narrowed = (1 - f[0, 1, 1]) / strain
    assert narrowed == pytest.approx(material.poisson if lame == "plane" else lam / (lam + 2 * mu), abs=1e-5)


def test_small_strains_have_the_energy_of_the_linear_sheet() -> None:
    """W = mu |e|^2 + lambda/2 (tr e)^2 where both strains pull; e is known to 2e-16, so 1e-5 holds it to 1e-10."""
    rng = np.random.default_rng(8)
    e = np.sort(rng.uniform(1e-6, 1e-5, (100, 2)), axis=1)
    for lam, mu in LAMES:
        triangles = Triangles(with_stretches(1 + e[:, 1], 1 + e[:, 0]), (lam, mu))
        linear = mu * (e**2).sum(axis=1) + lam / 2 * e.sum(axis=1) ** 2
        assert triangles.energy(triangles.positions) / triangles.rest.areas_m2 == pytest.approx(linear, rel=1e-4)

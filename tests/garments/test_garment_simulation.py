"""The worn garment: exact cases, exact derivatives, the extremes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tube import RADIUS_M, tube_garment

from haptics.errors import InputError
from haptics.garments.equilibrium.cholesky import installed_solvers
from haptics.garments.equilibrium.membrane import TAUT, natural_width
from haptics.garments.equilibrium.simulation import GarmentOnBody
from haptics.garments.materials import CLOTH, INTERFACE, REINFORCED

NO_HOLD = INTERFACE.with_values(attachment_n_m3=0.0, regulariser_n_m3=1.0)
HARD = NO_HOLD.with_values(contact_n_m3=1e10, rounding_m=1e-7)
"""Skin that does not give way."""


def swollen(by: float, around: int = 40, **options) -> GarmentOnBody:
    """A tube of cloth on a tube of flesh whose radius grows by a part ``by``."""
    vertices, triangles, garment = tube_garment(around)
    return GarmentOnBody(garment, triangles, vertices, vertices * [1 + by, 1 + by, 1], **options)


def plain(worn: GarmentOnBody) -> np.ndarray:
    return np.zeros(len(worn.triangles), dtype=bool)


def hoop_energy_j_m2(stretch: float) -> float:
    """A strip pulled to ``stretch``, free across: W(s, w(s)) with the natural width w."""
    lam, mu = CLOTH.lame_n_m()
    width = natural_width(stretch, lam, mu)
    return mu / 2 * (stretch**2 + width**2 - 2) - mu * np.log(stretch * width) + lam / 2 * np.log(stretch * width) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("by", [0.02, 0.3])
def test_a_tube_on_a_swollen_limb_stores_the_energy_of_a_strip_pulled_around_it(by):
    """Exact, but for the mesh, whose error falls with the square of its edges: the cloth is stretched around the limb and free
    along it. Edges of 5 mm on a limb of 45 mm leave 0.6 %."""
    worn = swollen(by, 56, interface=HARD)
    found = worn.solve(plain(worn))
    assert found.converged
    between = np.abs(worn.rest.centres_m[:, 2]) < 0.025
    per_area = found.element_energy_j[between].sum() / worn.areas_m2[between].sum()
    assert per_area == pytest.approx(hoop_energy_j_m2(1 + by), rel=0.01)
    assert np.median(found.stretches[between, 0]) == pytest.approx(1 + by, rel=2e-3)
    assert np.median(found.stretches[between, 1]) == pytest.approx(natural_width(1 + by, *CLOTH.lame_n_m()), rel=2e-3)


def test_the_swollen_limbs_energy_converges_with_the_mesh():
    def error(around: int) -> float:
        worn = swollen(0.1, around, interface=HARD)
        return abs(worn.solve(plain(worn)).energy_j / worn.areas_m2.sum() / hoop_energy_j_m2(1.1) - 1)

    coarse, middle, fine = (error(around) for around in (16, 28, 48))
    assert coarse > 1.5 * middle > 1.5 * 1.5 * fine


def test_contact_gives_way_as_pressure_over_stiffness_says():
    """Laplace: p = T / R presses the skin, and s - r/2 = p / k is how deep the cloth sinks."""
    worn = swollen(0.2, interface=NO_HOLD.with_values(contact_n_m3=2e7))
    found = worn.solve(plain(worn))
    homes = worn._skin.surface.walk_home(found.positions_m, worn._skin.homes)
    depth = -np.median(worn._skin.surface.distance_m(found.positions_m, homes))
    radius = 1.2 * RADIUS_M - depth
    stretch = radius / RADIUS_M
    lam, mu = CLOTH.lame_n_m()
    width = natural_width(stretch, lam, mu)
    tension = mu * (stretch - width**2 / stretch)  # force a unit of rest width
    pressure = tension / width / radius
    # stiffness and area are those of the rest shape
    assert (depth - worn.interface.rounding_m / 2) * 2e7 == pytest.approx(pressure * stretch * width, rel=0.03)


def test_at_rest_nothing_is_stored_and_nothing_moves():
    worn = swollen(0.0)
    found = worn.solve(plain(worn))
    assert found.converged
    assert found.iterations == 0
    assert found.energy_j < 1e-20
    assert np.array_equal(found.positions_m, worn.rest.vertices_m)


def test_a_body_that_only_turns_and_travels_costs_nothing():
    vertices, triangles, garment = tube_garment(band_m=0.02)
    away = vertices @ Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix().T + [0.3, -0.2, 1.0]
    worn = GarmentOnBody(garment, triangles, vertices, away)
    found = worn.solve(worn.designable)
    assert found.converged
    assert found.energy_j < 1e-18


def test_force_is_the_slope_of_the_energy_and_stiffness_that_of_the_force():
    vertices, triangles, garment = tube_garment(24, band_m=0.02)
    bent = vertices + np.column_stack([3.0 * vertices[:, 2] ** 2, np.zeros((len(vertices), 2))])
    worn = GarmentOnBody(garment, triangles, vertices, bent * [1.05, 1.05, 1.02])
    design = np.arange(len(worn.triangles)) % 3 == 0
    found = worn.solve(design)
    rng = np.random.default_rng(3)
    x = found.positions_m + rng.normal(scale=2e-5, size=found.positions_m.shape)
    direction = rng.normal(size=x.shape)
    h = 1e-8
    state, up, down = worn.state(x), worn.state(x + h * direction), worn.state(x - h * direction)
    slope = float(np.sum(state.force_n * direction))
    assert (up.energy_j - down.energy_j) / (2 * h) == pytest.approx(slope, rel=1e-6)

    from scipy.sparse import csr_array

    pattern = worn._pattern
    stiffness = csr_array((state.stiffness(0.0), pattern.indices, pattern.indptr))
    product = (stiffness @ direction.ravel()).reshape(x.shape)
    difference = (up.force_n - down.force_n) / (2 * h)
    near_a_kink = np.abs(difference - product).max(axis=1) > 1e-5 * np.abs(product).max()
    assert near_a_kink.mean() < 0.02, "only vertices of a triangle that changes state between the two points may differ"
    assert np.abs(stiffness - stiffness.T).max() < 1e-9 * np.abs(stiffness).max()


def test_every_installed_solver_finds_the_same_equilibrium():
    energies = []
    for solver in installed_solvers():
        worn = swollen(0.1, 24, solver=solver)
        assert worn.solver_name == solver
        found = worn.solve(plain(worn))
        assert found.converged
        assert found.residual_n <= 1e-7
        energies.append(found.energy_j)
    assert np.ptp(energies) < 1e-9 * max(energies)


def test_the_same_problem_gives_the_same_bytes():
    first, second = (swollen(0.1, 24) for _ in range(2))
    assert first.solve(plain(first)).positions_m.tobytes() == second.solve(plain(second)).positions_m.tobytes()


def test_over_a_hollow_the_cloth_lifts_off():
    """A limb with a waist, swollen but for it: taut cloth spans the waist and touches only around it (5.3)."""
    vertices, triangles, garment = tube_garment(32, short_m=0.03)
    waist = 1 - 0.35 * np.exp(-((vertices[:, 2] / 0.03) ** 2))
    pulled = vertices * [1.15, 1.15, 1.25]
    worn = GarmentOnBody(garment, triangles, vertices * np.column_stack([waist, waist, np.ones(len(waist))]), pulled)
    back = GarmentOnBody(garment, triangles, pulled, (pulled * np.column_stack([waist, waist, 1.1 * np.ones(len(waist))])))
    assert worn.solve(plain(worn)).converged
    found = back.solve(plain(back))
    assert found.converged
    homes = back._skin.surface.walk_home(found.positions_m, back._skin.homes)
    off = back._skin.surface.distance_m(found.positions_m, homes)
    middle = np.abs(back.rest.vertices_m[:, 2]) < 0.01
    assert off[middle].min() > 2e-3, "over the waist the cloth hangs free of the skin"
    assert np.isfinite(off[~middle]).any()
    assert (off < 0).any(), "beside it, it is in contact"


def test_a_garment_that_starts_inside_the_body_comes_out():
    worn = swollen(0.1, 24)
    inside = worn._skin.copy_m * [0.9, 0.9, 1]
    found = worn.solve(plain(worn), inside)
    assert found.converged
    assert found.energy_j == pytest.approx(worn.solve(plain(worn)).energy_j, rel=1e-6)


def test_a_stiffness_ratio_of_a_million_converges():
    stiff = REINFORCED.with_values(young_pa=0.5e12 * 0.27 / 0.35)
    worn = swollen(0.02, 24, reinforced=stiff)
    strip = np.abs(np.arctan2(worn.rest.centres_m[:, 1], worn.rest.centres_m[:, 0])) < 0.6
    found = worn.solve(strip)
    assert found.converged
    assert found.stretches[strip, 0].max() < 1 + 1e-5, "the strip does not stretch"
    assert found.stretches[~strip, 0].mean() == pytest.approx(1 + 0.02 * np.pi / (np.pi - 0.6), rel=5e-3), "the cloth does"


def test_attachments_hold_or_let_go_by_their_stiffness():
    vertices, triangles, garment = tube_garment(24, band_m=0.02)
    longer = vertices * [1, 1, 1.2]
    energy = {}
    for stiffness in (0.0, 2.5e5, 1e9):
        worn = GarmentOnBody(garment, triangles, vertices, longer, interface=INTERFACE.with_values(attachment_n_m3=stiffness))
        found = worn.solve(plain(worn))
        assert found.converged
        energy[stiffness] = found.energy_j
    assert energy[0.0] < 0.02 * energy[1e9], "nothing but the small placing pull holds it"
    assert energy[0.0] < energy[2.5e5] < energy[1e9]


def test_the_solids_constants_are_stiffer_by_a_tenth():
    plane, solid = (swollen(0.1, 24, lame=lame) for lame in ("plane", "thesis"))
    ratio = solid.solve(plain(solid)).energy_j / plane.solve(plain(plane)).energy_j
    assert 1.08 < ratio < 1.16  # 4 mu (lambda + mu) / (lambda + 2 mu) over E at small strain: 1.116


def test_reinforcement_stiffens_in_proportion_where_all_is_reinforced():
    worn = swollen(0.05, 24, interface=HARD)
    ratio = worn.solve(worn.designable).energy_j / worn.solve(plain(worn)).energy_j
    assert ratio == pytest.approx(5.7 * 0.35 / (0.5 * 0.27), rel=0.02)


def test_cloth_at_the_end_is_taut_or_wrinkled_only_where_it_is_pulled():
    worn = swollen(0.1, 24)
    found = worn.solve(plain(worn))
    states = worn.membrane.states(found.positions_m, np.tile(CLOTH.lame_n_m(), (len(worn.triangles), 1)))
    assert (states == TAUT).mean() > 0.2
    assert (found.stretches[:, 0] > 1).all()


@pytest.mark.parametrize("which", ["rest", "posed", "start"])
def test_float32_is_refused_with_the_reason(which):
    vertices, triangles, garment = tube_garment(24)
    small = vertices.astype(np.float32)
    worn = GarmentOnBody(garment, triangles, vertices, vertices)
    attempts = {
        "rest": lambda: GarmentOnBody(garment, triangles, small, vertices),
        "posed": lambda: GarmentOnBody(garment, triangles, vertices, small),
        "start": lambda: worn.solve(plain(worn), worn.rest.vertices_m.astype(np.float32)),
    }
    with pytest.raises(InputError, match=r"float32.*float64.*rounding"):
        attempts[which]()


def test_wrong_arrays_are_refused():
    worn = swollen(0.1, 24)
    with pytest.raises(InputError, match="design is int64"):
        worn.solve(np.zeros(len(worn.triangles), dtype=int))
    with pytest.raises(InputError, match="start has shape"):
        worn.solve(plain(worn), worn.rest.vertices_m[:-1])
    with pytest.raises(InputError, match="posed_body_m has shape"):
        worn.wear(worn.rest.vertices_m[:5])
    with pytest.raises(InputError, match="solver = 'abacus' is not allowed"):
        swollen(0.1, 24, solver="abacus")
    with pytest.raises(InputError, match="lame = 'french' is not allowed"):
        swollen(0.1, 24, lame="french")


def test_a_faulty_body_is_refused_with_the_place():
    vertices, triangles, garment = tube_garment(24)
    flipped, bad = triangles.copy(), vertices.copy()
    flipped[5] = flipped[5][::-1]
    bad[9, 0] = np.nan
    with pytest.raises(InputError, match=r"body at rest: .*turned against each other"):
        GarmentOnBody(garment, flipped, vertices, vertices)
    with pytest.raises(InputError, match="body at rest: vertex 9 is"):
        GarmentOnBody(garment, triangles, bad, vertices)
    with pytest.raises(InputError, match="millimetres"):
        GarmentOnBody(garment, triangles, 1000 * vertices, vertices)


def test_a_garment_that_does_not_lie_on_the_body_is_refused():
    vertices, triangles, garment = tube_garment(24)
    garment.weights.data[7] = 3.0
    with pytest.raises(InputError, match="beyond the reach of the body's surface"):
        GarmentOnBody(garment, triangles, vertices, vertices)

"""Designs of real cloth: on the clamped patch, where straight strips along the pull are best, and on a sleeve on a bent arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from haptics.garments.bodies import MOTIONS, open_body
from haptics.garments.design.designs import DesignSequence, DesignStore
from haptics.garments.design.drawn import best_drawn
from haptics.garments.design.rating import Densities, first_by_area
from haptics.garments.design.topology import optimise
from haptics.garments.equilibrium.simulation import GarmentOnBody
from haptics.garments.equilibrium.wearing import WornMotion, wear
from haptics.garments.garment import cut_garment
from haptics.garments.materials import CLOTH
from haptics.garments.mesh import Bools
from haptics.garments.patch.clamped_patch import ClampedPatch

pytestmark = pytest.mark.slow

COVERAGE = 0.3
SOLVER = "superlu"
"""There everywhere, and the same bits each time."""


BODY = open_body("capsule")
SLEEVE = cut_garment(BODY, "sleeve", "coarse")


def _worn(**options) -> WornMotion:
    return wear(BODY, SLEEVE, MOTIONS["elbow_flexion"], 60.0, solver=SOLVER, **options)


def _sleeve() -> GarmentOnBody:
    return _worn().simulation


@pytest.fixture(scope="module")
def sleeve() -> GarmentOnBody:
    return _sleeve()


@pytest.fixture(scope="module")
def sequence(sleeve: GarmentOnBody) -> DesignSequence:
    return optimise(sleeve, COVERAGE)


def test_energy_of_a_triangle_is_the_derivative_of_all_energy_by_its_modulus() -> None:
    """One triangle's E by a part more and less: cloth of which only that triangle is `reinforced`."""
    change, cloth = 1e-3, _worn(reinforced=CLOTH).simulation
    changed = [_worn(reinforced=CLOTH.with_values(young_pa=CLOTH.young_pa * part)) for part in (1 + change, 1 - change)]
    none = np.zeros(len(cloth.triangles), bool)
    equal = cloth.solve(none)
    strained = np.argsort(equal.element_energy_j)[::-1]
    for triangle in strained[[0, 40, 400]]:
        only = none.copy()
        only[triangle] = True
        totals = []
        for other in changed:
            state = other.simulation.solve(only, equal.positions_m)
            assert state.converged
            skin = other.simulation.skin(other.posed_m(60.0))
            totals.append(state.energy_j + other.simulation.pose_energy_j(state.positions_m, skin))
        slope = (totals[0] - totals[1]) / (2 * change)
        assert slope == pytest.approx(equal.element_energy_j[triangle], rel=1e-4)


def test_every_step_of_the_sleeve_converges_and_the_coverage_is_met(sequence: DesignSequence) -> None:
    assert max(step.residual_n for step in sequence.steps) <= 1e-7
    assert sequence.final.coverage == pytest.approx(COVERAGE, abs=0.003)
    assert 80 + 10 <= len(sequence.steps) <= 120


def test_density_of_the_sleeve_rises_with_less_reinforcement(sequence: DesignSequence) -> None:
    densities = np.array([step.density for step in sequence.steps])
    assert densities[0] == 1.0
    assert np.diff(densities[::10]).min() > -0.02
    assert sequence.final.density > 1.7


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["line", "x"])
def test_drawn_baselines_are_beaten(sleeve: GarmentOnBody, sequence: DesignSequence, shape: str) -> None:
    drawn = best_drawn(sleeve, shape, COVERAGE)
    assert drawn.coverage == pytest.approx(sequence.final.coverage, abs=0.003)
    assert sequence.final.density > 1.2 * drawn.density
    assert sequence.final.energy_j > drawn.energy_j


def test_random_designs_are_beaten(sleeve: GarmentOnBody, sequence: DesignSequence) -> None:
    """Scattered triangles, and discs about random places."""
    chance, areas = np.random.default_rng(7), sleeve.areas_m2
    full = Densities.of(sleeve.designable, areas, sleeve.solve(sleeve.designable).element_energy_j)
    for number in range(4):
        order = chance.permutation(len(areas))
        if number % 2:
            order = np.argsort(np.linalg.norm(sleeve.rest.centres_m - sleeve.rest.centres_m[order[0]], axis=1))
        design = np.zeros(len(areas), bool)
        design[first_by_area(order, areas, COVERAGE * float(areas.sum()))] = True
        state = sleeve.solve(design)
        assert state.converged
        assert Densities.of(design, areas, state.element_energy_j).over(full).reinforced_j_m2 < sequence.final.density / 2


def test_final_design_is_the_same_afresh(sleeve: GarmentOnBody, sequence: DesignSequence) -> None:
    """Not an artefact of the way that led there."""
    assert sleeve.solve(sequence.final.design).energy_j == pytest.approx(sequence.final.energy_j, rel=0.01)


def test_resumed_sleeve_gives_the_same_bytes(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("whole.h5", "resumed.h5")]
    optimise(_sleeve(), 0.95, store=DesignStore(paths[0]))

    def stop(number: int, step: object) -> None:
        if number == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise(_sleeve(), 0.95, store=DesignStore(paths[1]), progress=stop)
    optimise(_sleeve(), 0.95, store=DesignStore(paths[1]))
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.fixture(scope="module")
def patch() -> ClampedPatch:
    return ClampedPatch(elements=500, solver=SOLVER)


def _nearest(patch: ClampedPatch, away: np.ndarray) -> Bools:
    design = np.zeros(len(away), bool)
    design[first_by_area(np.argsort(away, kind="stable"), patch.areas_m2, 0.4 * float(patch.areas_m2.sum()))] = True
    return design


def test_patch_is_reinforced_straight_along_the_pull(patch: ClampedPatch) -> None:
    """Nothing is stiffer by its area than bands from clamp to clamp; those along the free edges even hold the cloth's width."""
    final = optimise(patch, 0.4).final
    x, y = patch.centres_m.T
    strip, cross = _nearest(patch, np.abs(y)), _nearest(patch, np.minimum(np.abs(x - y), np.abs(x + y)))
    assert final.energy_j >= patch.solve(strip).energy_j > 1.5 * patch.solve(cross).energy_j
    parts = np.digitize(y, np.linspace(-0.05, 0.05, 11)[1:-1])
    shares = np.array([patch.areas_m2[final.design & (parts == k)].sum() / patch.areas_m2[parts == k].sum() for k in range(10)])
    assert (shares > 0.98).sum() >= 3  # whole bands from clamp to clamp
    assert (shares < 0.02).sum() >= 4  # and nothing between them

"""Drawn baselines: equal area, in the place that is best, and of the shape that they are named for."""

from __future__ import annotations

import numpy as np
import pytest
from bar_panel import flat_sheet, tube

from haptics.errors import InputError
from haptics.garments.design.drawn import PLACES, best_drawn, drawn_designs
from haptics.garments.design.rating import Unconverged, solved
from haptics.garments.equilibrium.simulation import Equilibrium
from haptics.garments.mesh import Bools, Floats, SurfaceMesh

STRAINED_AT_DEG = 77.0
RADIUS_M, LENGTH_M = 0.04, 0.3


class StrainedTube:
    """A tube whose cloth is strained along a side, most at the middle; what is reinforced does not change the strain."""

    def __init__(self, around: int = 32, along: int = 40, fails: bool = False):
        self.rest, self.fails, self.solved = tube(around, along, RADIUS_M, LENGTH_M), fails, 0
        self.designable = np.ones(len(self.rest.triangles), bool)
        x, y, z = self.rest.centres_m.T
        self.turn_deg = np.degrees(np.arctan2(y, x))
        self.strain = np.exp(2 * np.cos(np.radians(self.turn_deg - STRAINED_AT_DEG)) - ((z - 0.15) / 0.05) ** 2)

    @property
    def triangles(self):
        return self.rest.triangles

    @property
    def areas_m2(self):
        return self.rest.areas_m2

    def solve(self, design: Bools, start: Floats | None = None) -> Equilibrium:
        self.solved += 1
        energy = np.where(design, 1995.0, 135.0) * self.strain**2 * self.areas_m2 / 2
        good = not self.fails or bool(design.all())
        positions, stretches = self.rest.vertices_m, np.ones((len(design), 2))
        return Equilibrium(positions, good, 0.0, 1e-7, 1, float(energy.sum()), energy, stretches, 0.0, 0.0)


@pytest.fixture(scope="module")
def strained() -> StrainedTube:
    return StrainedTube()


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["line", "x"])
@pytest.mark.parametrize("coverage", [0.05, 0.4])
def test_every_place_has_the_area_asked_for(strained: StrainedTube, shape: str, coverage: float) -> None:
    designs = drawn_designs(strained, shape, coverage, solved(strained, strained.designable))
    assert len(designs) == (PLACES if shape == "line" else 2 * PLACES)
    for design in designs.values():
        covered = strained.areas_m2[design].sum() / strained.areas_m2.sum()
        assert covered == pytest.approx(coverage, abs=0.5 / len(design) + 1e-9)


def test_line_is_a_straight_strip_of_even_width_where_the_strain_is(strained: StrainedTube) -> None:
    best = best_drawn(strained, "line", 0.15)
    assert best.place.endswith(", 0 deg")
    apart = np.abs((strained.turn_deg - STRAINED_AT_DEG + 180) % 360 - 180)
    half = 0.15 * 180  # a straight strip has 15 % of the turn
    one_column = 360 / 32
    assert apart[best.design].max() < half + 2 * one_column
    assert best.design[apart < half - 2 * one_column].all()


@pytest.mark.slow
def test_best_place_is_the_one_returned(strained: StrainedTube) -> None:
    for shape in ("line", "x"):
        best = best_drawn(strained, shape, 0.15)
        ratings = [density for density in best.tried.values() if density is not None]
        assert best.density == max(ratings) == best.tried[best.place]
        own, whole = solved(strained, best.design), solved(strained, strained.designable)
        by_hand = own.element_energy_j[best.design].sum() / strained.areas_m2[best.design].sum()
        assert best.density == pytest.approx(by_hand / (whole.energy_j / strained.areas_m2.sum()), rel=1e-12)


def test_eight_places_go_once_around(strained: StrainedTube) -> None:
    designs = drawn_designs(strained, "line", 0.05, solved(strained, strained.designable))
    turns = [np.angle(np.exp(1j * np.radians(strained.turn_deg[design])).mean(), deg=True) for design in designs.values()]
    steps = np.diff(np.unwrap(turns, period=360))
    assert np.abs(steps) == pytest.approx(45, abs=4)
    assert abs(steps.sum()) == pytest.approx(315, abs=4)


@pytest.mark.slow
def test_x_crosses_at_the_strain_and_closes_two_loops_on_the_other_side(strained: StrainedTube) -> None:
    designs = drawn_designs(strained, "x", 0.12, solved(strained, strained.designable))
    design = next(found for place, found in designs.items() if place.endswith(", 0 deg, reach 0.25"))
    z = strained.rest.centres_m[:, 2]
    apart = (strained.turn_deg - STRAINED_AT_DEG + 180) % 360 - 180

    def heights(low_deg: float, high_deg: float) -> Floats:
        return z[design & (apart >= low_deg) & (apart < high_deg)]

    assert heights(-8, 8).mean() == pytest.approx(0.15, abs=0.01)  # one patch, at the middle
    assert np.ptp(heights(-8, 8)) < 0.06
    for side in (heights(82, 98), heights(-98, -82)):  # two legs, a quarter of the way up and down
        assert np.abs(side - 0.15) == pytest.approx(0.125 * LENGTH_M, abs=0.02)
    back = np.concatenate([heights(172, 180), heights(-180, -172)])
    assert np.abs(back - 0.15) == pytest.approx(0.25 * LENGTH_M, abs=0.03)  # the legs meet: two loops
    assert _pieces(strained.rest, design) == 1
    assert _pieces(strained.rest, ~design) == 3  # above the upper loop, below the lower one, between them


def test_line_that_cannot_be_reinforced_there_goes_around(strained: StrainedTube) -> None:
    cloth = StrainedTube()
    cloth.designable = np.abs((cloth.turn_deg - STRAINED_AT_DEG + 180) % 360 - 180) > 30
    best = best_drawn(cloth, "line", 0.2)
    assert not best.design[~cloth.designable].any()
    assert best.coverage == pytest.approx(0.2, abs=0.001)


def test_same_inputs_same_baseline(strained: StrainedTube) -> None:
    one, two = best_drawn(strained, "line", 0.15), best_drawn(strained, "line", 0.15)
    assert np.array_equal(one.design, two.design)
    assert one.tried == two.tried


def test_a_place_without_equilibrium_is_not_rated() -> None:
    with pytest.raises(Unconverged, match="line: no equilibrium at any of the 8 places tried"):
        best_drawn(StrainedTube(fails=True), "line", 0.15)


def test_refusals(strained: StrainedTube) -> None:
    with pytest.raises(InputError, match="shape = 'ring' is not allowed; allowed: line, x"):
        best_drawn(strained, "ring", 0.15)
    with pytest.raises(InputError, match="coverage = 0; allowed"):
        best_drawn(strained, "line", 0.0)
    sheet = StrainedTube()
    sheet.rest = flat_sheet(10, 10)
    sheet.designable, sheet.strain = np.ones(200, bool), np.ones(200)
    with pytest.raises(InputError, match="sheet has 1 openings; a drawn line or X needs at least 2"):
        best_drawn(sheet, "line", 0.15)


def _pieces(mesh: SurfaceMesh, mask: Bools) -> int:
    """Parts of a mask that hang together by edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    numbers = np.flatnonzero(mask)
    sides = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2), axis=2)[mask].reshape(-1, 2)
    _, edge = np.unique(sides, axis=0, return_inverse=True)
    at = np.repeat(np.arange(len(numbers)), 3)
    touches = coo_array((np.ones(len(at)), (at, edge.ravel()))).tocsr()
    return int(connected_components(touches @ touches.T, directed=False)[0])

"""Evolution of a design: each rule of thesis 5.5.4 by itself, and the known best reinforcement of a panel of bars."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from bar_panel import BarPanel

from haptics.errors import InputError
from haptics.garments.design.designs import DesignStore, read_designs
from haptics.garments.design.drawn import DrawnDesign
from haptics.garments.design.rating import Densities
from haptics.garments.design.sensitivity import mesh_filter, sensitivities
from haptics.garments.design.topology import BesoParameters, DesignInterrupted, evolve, optimise

PULLS_M = np.linspace(0.005, 0.02, 20)
PLAIN = BesoParameters(filter_spread_m=0.0)


def _panel(**options) -> BarPanel:
    return BarPanel(PULLS_M, columns=15, **options)


def _best_rows(panel: BarPanel, coverage: float) -> np.ndarray:
    return panel.row_of() >= panel.rows - round(coverage * panel.rows)


@pytest.mark.parametrize("coverage", [0.1, 0.15, 0.4, 0.75])
def test_the_known_best_design_is_found(coverage: float) -> None:
    panel = _panel()
    final = optimise(panel, coverage, PLAIN).final
    assert np.array_equal(final.design, _best_rows(panel, coverage))
    assert final.energy_j == pytest.approx(panel.solve(_best_rows(panel, coverage)).energy_j, rel=1e-12)


def test_default_filter_finds_it_too() -> None:
    panel = _panel()
    assert optimise(panel, 0.15).final.energy_j >= 0.999 * panel.solve(_best_rows(panel, 0.15)).energy_j


def test_no_random_design_of_equal_area_is_better() -> None:
    panel, random = _panel(), np.random.default_rng(11)
    best = optimise(panel, 0.2, PLAIN).final.energy_j
    for _ in range(200):
        rows = np.isin(panel.row_of(), random.choice(panel.rows, 4, replace=False))
        scattered = np.isin(np.arange(len(panel.triangles)), random.choice(len(panel.triangles), 120, replace=False))
        assert panel.solve(rows).energy_j <= best
        assert panel.solve(scattered).energy_j <= best


def test_reinforcement_grows_from_a_poor_start_to_the_same_design() -> None:
    """From the rows pulled least: the best cloth is added, what was poor goes. A greater d_min favours cloth."""
    panel = BarPanel(np.linspace(0.005, 0.02, 300), columns=1)
    poor = panel.row_of() < 30
    sequence = optimise(panel, 0.2, BesoParameters(filter_spread_m=0.0, d_min=0.3), start=poor)
    assert np.array_equal(sequence.steps[0].design, poor)
    for before, after in pairwise(sequence.steps):
        assert after.coverage <= before.coverage * 1.015 + 1 / 600
        assert panel.areas_m2[after.design & ~before.design].sum() <= 0.015 * panel.areas_m2.sum() + 1e-12
    assert np.array_equal(sequence.final.design, panel.row_of() >= 240)


def test_area_shrinks_by_the_evolution_rate_and_is_met() -> None:
    panel = _panel()
    sequence = optimise(panel, 0.15, PLAIN)
    coverages = [step.coverage for step in sequence.steps]
    triangle = 1 / len(panel.triangles)
    for number, coverage in enumerate(coverages):
        assert coverage == pytest.approx(max(0.15, 0.985**number), abs=triangle / 2 + 1e-12)
    assert coverages.index(coverages[-1]) <= 126  # 0.985^126 = 0.149
    assert len(coverages) >= 126 + 2 * 5 - 1  # then two spans of N steps at the target
    assert sequence.complete


def test_density_rises_to_the_end() -> None:
    """But for what the last triangle stores in vain where its row has lost the other."""
    panel = BarPanel(np.linspace(0.005, 0.02, 300), columns=1)
    steps = optimise(panel, 0.15, PLAIN).steps
    densities = np.array([step.density for step in steps])
    one_triangle = densities / [step.design.sum() for step in steps]
    assert densities[0] == 1.0
    assert np.all(np.diff(densities) >= -one_triangle[1:])
    assert densities[-1] == pytest.approx((panel.pulls_m[255:] ** 2).mean() / (panel.pulls_m**2).mean(), rel=1e-12)


def test_densities_by_hand() -> None:
    panel = _panel()
    step = optimise(panel, 0.3, PLAIN).final
    loaded, full = panel.solve(step.design), panel.solve(panel.designable)
    area, whole = panel.areas_m2[step.design].sum(), panel.areas_m2.sum()
    in_it = loaded.element_energy_j[step.design].sum()
    assert step.density == pytest.approx(in_it / area / (full.energy_j / whole), rel=1e-12)
    assert step.density_eq65 == pytest.approx(loaded.energy_j * whole / (full.energy_j * area), rel=1e-12)


def test_triangles_that_are_not_designable_stay_cloth_and_do_not_count() -> None:
    panel = _panel()
    panel.designable = panel.row_of() < 18  # the best two rows are out
    final = optimise(panel, 2 / 18, PLAIN).final
    assert np.array_equal(final.design, (panel.row_of() >= 16) & (panel.row_of() < 18))
    assert final.coverage == pytest.approx(2 / 18, abs=1e-12)


def test_sensitivities_are_averaged_with_those_of_the_past(tmp_path) -> None:
    """Eq. 5.14, replayed from the designs of the first steps."""
    panel, store = _panel(), DesignStore(tmp_path / "designs.h5")

    def stop(number: int, step: object) -> None:
        if number == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise(panel, 0.8, PLAIN, store=store, progress=stop)
    _, sequence = read_designs(store.path)
    smooth, history = mesh_filter(panel.rest, 0.0), None
    for step in sequence.steps:
        energy = panel.solve(step.design).element_energy_j
        alpha = smooth(sensitivities(step.design, panel.areas_m2, energy, PLAIN.stiffness_ratio, PLAIN.penalty, PLAIN.d_min))
        history = alpha if history is None else (alpha + history) / 2
    assert len(sequence.steps) == 8
    assert sequence.at_latest.history_j_m2 == pytest.approx(history, rel=1e-12)


def test_full_coverage_is_the_full_garment() -> None:
    sequence = optimise(_panel(), 1.0, PLAIN)
    assert sequence.final.design.all()
    assert sequence.final.density == sequence.final.density_eq65 == 1.0


def test_each_step_starts_from_the_last_equilibrium() -> None:
    panel = _panel()
    sequence = optimise(panel, 0.5, PLAIN)
    assert panel.starts[0] is None
    assert len(panel.starts) == len(sequence.steps)
    for step, start in zip(sequence.steps, panel.starts[1:], strict=False):
        assert start[0, 2] == pytest.approx(step.energy_j, rel=1e-12)  # the panel writes its energy into its positions


def test_unconverged_step_is_begun_afresh() -> None:
    panel, smooth = _panel(fails_at={7}), _panel()
    sequence = optimise(panel, 0.5, PLAIN)
    assert panel.starts[7] is not None
    assert panel.starts[8] is None
    assert [step.energy_j for step in sequence.steps] == [step.energy_j for step in optimise(smooth, 0.5, PLAIN).steps]


def test_nothing_follows_from_a_state_that_does_not_converge() -> None:
    panel = _panel(fails_at={7, 8})
    with pytest.raises(DesignInterrupted, match=r"step 7: .* residual 1 N; allowed: at most 1e-07 N") as caught:
        optimise(panel, 0.5, PLAIN)
    assert caught.value.sequence is not None
    assert len(caught.value.sequence.steps) == 7
    assert not caught.value.sequence.complete
    assert len(panel.starts) == 9  # no solve after that one


def test_first_step_without_equilibrium_is_said() -> None:
    with pytest.raises(DesignInterrupted, match="step 0") as caught:
        optimise(_panel(fails_at={0}), 0.5, PLAIN)
    assert caught.value.sequence is None


def test_progress_is_told_each_step() -> None:
    seen = []
    sequence = optimise(_panel(), 0.6, PLAIN, progress=lambda number, step: seen.append((number, step)))
    assert seen == list(enumerate(sequence.steps))


def test_same_inputs_same_designs() -> None:
    one, two = (optimise(_panel(), 0.2).steps for _ in range(2))
    assert all(np.array_equal(a.design, b.design) and a.energy_j == b.energy_j for a, b in zip(one, two, strict=True))


def _shaken(panel: BarPanel) -> BarPanel:
    """A panel whose stiffness is another at each solve, so that its energy never settles."""
    chance, solve = np.random.default_rng(2), panel.solve

    def shaken(design, start=None):
        panel.stiffness_scale[:] = 1 + 0.2 * chance.random(len(design))
        return solve(design, start)

    panel.solve = shaken
    return panel


def test_ends_though_the_energy_does_not_settle() -> None:
    restless = BesoParameters(filter_spread_m=0.0, settled_change=0.0, max_extra_steps=12)
    sequence = optimise(_shaken(_panel()), 0.5, restless)
    assert sequence.complete
    there = [step for step in sequence.steps if abs(step.coverage - 0.5) <= 0.003]
    # of the 9 triangles that a step may exchange a half and a quarter, 4 and 2, are tried since the best: fewer are not worth it
    best = there.index(sequence.final)
    assert len(there) == max(best + 1, 12) + 2


def test_once_settled_the_search_goes_on_from_the_best_with_ever_fewer_exchanged() -> None:
    restless = BesoParameters(filter_spread_m=0.0, settled_change=0.0, max_extra_steps=12)
    panel = _shaken(_panel())
    steps = optimise(panel, 0.5, restless).steps
    first = next(n for n, step in enumerate(steps) if abs(step.coverage - 0.5) <= 0.003)
    area, tries = panel.areas_m2.sum(), 0
    best = max(steps[first : first + 12], key=lambda step: step.density)
    for step in steps[first + 12 :]:
        added = panel.areas_m2[step.design & ~best.design].sum()
        assert added <= 0.015 * area * 0.5 ** (tries + 1) + 1e-12
        best, tries = (step, 0) if step.density > best.density else (best, tries + 1)


def test_of_the_designs_with_the_coverage_the_densest_is_chosen_with_its_equilibrium() -> None:
    sequence = optimise(_shaken(_panel()), 0.5, BesoParameters(settled_change=0.0, max_extra_steps=12))
    there = [step for step in sequence.steps if abs(step.coverage - 0.5) <= 0.003]
    assert sequence.final.density == max(step.density for step in there)
    assert sequence.final is not sequence.steps[-1]
    assert sequence.at_final.positions_m[0, 2] == pytest.approx(sequence.final.energy_j, rel=1e-12)
    assert sequence.at_latest.positions_m[0, 2] == pytest.approx(sequence.steps[-1].energy_j, rel=1e-12)


def _evolved(alpha, design, area, limit, areas=None):
    design = np.array(design, bool)
    areas = np.ones(len(design)) if areas is None else np.array(areas, float)
    return np.flatnonzero(evolve(np.array(alpha, float), design, np.ones(len(design), bool), areas, area, limit)).tolist()


def test_evolve_takes_the_highest() -> None:
    assert _evolved([1, 5, 3, 4], [1, 1, 1, 1], 2, 1) == [1, 3]


def test_evolve_meets_the_area_with_unequal_triangles() -> None:
    assert _evolved([4, 3, 2, 1], [1, 1, 1, 1], 3.4, 0, [1, 2, 1, 1]) == [0, 1]
    assert _evolved([4, 3, 2, 1], [1, 1, 1, 1], 3.6, 0, [1, 2, 1, 1]) == [0, 1, 2]


def test_evolve_adds_no_more_than_the_limit() -> None:
    alpha, design = [9, 8, 7, 1, 2, 3], [0, 0, 0, 1, 1, 1]
    assert _evolved(alpha, design, 3, 3) == [0, 1, 2]
    assert _evolved(alpha, design, 3, 1) == [0, 4, 5]
    assert _evolved(alpha, design, 3, 0) == [3, 4, 5]
    assert _evolved(alpha, design, 2, 1) == [0, 5]


def test_equal_ranks_go_by_number() -> None:
    assert _evolved([1, 1, 1, 1], [1, 1, 1, 1], 2, 1) == [0, 1]


@pytest.mark.parametrize(
    ("coverage", "options", "message"),
    [
        (0.0, {}, "coverage = 0; allowed 0.01 to 1"),
        (1.2, {}, "coverage = 1.2"),
        (float("nan"), {}, "coverage = nan"),
        (0.5, {"start": np.zeros(600, bool)}, "start reinforces nothing"),
        (0.5, {"start": np.zeros(3, bool)}, r"start is bool of shape \(3,\)"),
    ],
)
def test_refusals(coverage: float, options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        optimise(_panel(), coverage, PLAIN, **options)


def test_start_outside_the_designable_area_is_refused() -> None:
    panel = _panel()
    panel.designable = panel.row_of() < 10
    with pytest.raises(InputError, match="start reinforces triangle 300, which is not designable"):
        optimise(panel, 0.5, PLAIN, start=np.ones(600, bool))


def test_mesh_too_coarse_for_a_coverage_is_refused() -> None:
    with pytest.raises(InputError, match=r"largest triangle is 1\.00% of the designable area"):
        optimise(BarPanel([0.01] * 5, columns=10), 0.5, PLAIN)


@pytest.mark.parametrize(
    "values", [{"evolution_rate": 0.0}, {"penalty": 0.5}, {"stiffness_ratio": 0.5}, {"filter_spread_m": -0.01}]
)
def test_parameters_out_of_range_are_refused(values: dict) -> None:
    with pytest.raises(InputError, match=next(iter(values))):
        BesoParameters(**values)


def test_a_drawn_rival_that_is_better_is_tried_and_not_lost() -> None:
    """Evolution begun with the bars pulled least, and allowed to add nothing, stays there; a hand has drawn the best ones."""
    panel = _panel()
    best, coverage = _best_rows(panel, 0.1), 0.1
    full, state = panel.solve(panel.designable), panel.solve(best)
    ratio = Densities.of(best, panel.areas_m2, state.element_energy_j).over(
        Densities.of(panel.designable, panel.areas_m2, full.element_energy_j)
    )
    rival = DrawnDesign("line", best, "by hand", coverage, state.energy_j, ratio.reinforced_j_m2, ratio.eq65_j_m2, {})
    stuck = {"parameters": BesoParameters(filter_spread_m=0.0, admission_limit=0.0), "start": panel.row_of() < 2}
    without, contested = optimise(panel, coverage, **stuck), optimise(panel, coverage, rivals=[rival], **stuck)
    assert without.final.density < 0.5 * rival.density
    assert contested.final.density >= rival.density * (1 - 1e-12)
    assert sum(np.array_equal(step.design, best) for step in contested.steps) >= 1


def test_a_drawn_rival_that_is_far_off_changes_nothing() -> None:
    panel = _panel()
    worst = panel.row_of() < 2
    rival = DrawnDesign("line", worst, "by hand", 0.1, 0.0, 0.1, 0.1, {})
    plain, contested = optimise(panel, 0.1, PLAIN), optimise(panel, 0.1, PLAIN, rivals=[rival])
    assert all(np.array_equal(a.design, b.design) for a, b in zip(plain.steps, contested.steps, strict=True))

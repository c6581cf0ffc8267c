"""What was measured of every level: it falls as the level rises, and it holds for cases it was not measured on."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import pytest

from haptics.errors import InputError
from haptics.fidelity import cost, shipped
from haptics.fidelity.cases import brake as brake_cases, latch as latch_cases, thermal as thermal_cases
from haptics.fidelity.measure import UNITS, measure
from haptics.fidelity.measured import from_json, to_json
from haptics.fidelity.picture import draw
from haptics.physics.brake import levels as brake
from haptics.physics.latch import pulse as latch
from haptics.physics.latch.pulse import UNCERTAIN_WITHIN
from haptics.version import __version__

LADDERS = {"latch": latch.LEVELS, "brake": brake.LEVELS}
FLOOR = {"supply power": 1e-3, "force over time": 1e-6}
"""Below these all levels are the same to rounding; in the observable's unit."""


def test_the_shipped_table_is_of_this_version_and_says_what_it_was_measured_on():
    table = shipped()
    assert table.version == __version__
    assert {"processor", "cores", "system", "python"} <= table.machine.keys()
    assert {row.model for row in table.rows} == {"latch", "thermal", "brake"}
    for row in table.rows:
        assert row.unit == UNITS[row.observable]
        assert row.cost_s_per_sim_s.keys() == {"1", "15", "64", "1000"}
        assert 0.0 <= row.median <= row.p95 <= row.worst < math.inf
        assert row.cost_us_per_event > 0.0


@pytest.mark.parametrize("model", LADDERS)
@pytest.mark.parametrize("cases", ["typical", "edge"])
def test_errors_fall_as_the_level_rises(model, cases):
    table = shipped()
    observables = {row.observable for row in table.rows if (row.model, row.cases) == (model, cases)}
    assert len(observables) >= 5
    for observable in observables:
        rows = [table.row(model, level, observable, cases) for level in LADDERS[model]]
        for cheap, dear in pairwise(rows):
            floor = FLOOR.get(observable, 0.0)
            assert dear.worst <= max(cheap.worst, floor), (observable, cheap.level, dear.level)
            assert dear.p95 <= max(cheap.p95, floor), (observable, cheap.level, dear.level)
        assert rows[-1].worst == 0.0  # the reference itself


def test_no_level_of_the_latch_ends_at_a_wrong_stop():
    table = shipped()
    for level in latch.LEVELS:
        for cases in ("typical", "edge"):
            assert table.row("latch", level, "wrong final state", cases).worst == 0.0


def _beyond(found, model, level, cases):
    """Observables whose error passes the shipped worst by more than half."""
    table = shipped()
    limits = {name: 1.5 * table.row(model, level, name, cases).worst for name in found}
    return {name: (error, limits[name]) for name, error in found.items() if error > limits[name] + FLOOR.get(name, 1e-9)}


def _other_latch_cases(kind, count, seed, levels=("event", "table", "dynamic")):
    for case in latch_cases.latch_cases(kind, count, seed):
        true = latch_cases.play(case, "reference")
        for level in levels:
            run = latch_cases.play(case, level)
            if run is not None:
                yield level, _beyond(latch_cases.errors(run, true), "latch", level, kind)


def _other_brake_cases(kind, count, seed):
    for case in brake_cases.brake_cases(kind, count, seed):
        true = brake_cases.play(case, "reference")
        for level in ("static", "lagged", "dynamic"):
            yield level, _beyond(brake_cases.errors(brake_cases.play(case, level), true), "brake", level, kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["typical", "edge"])
def test_the_worst_of_the_latch_holds_for_other_cases(kind):
    assert not [(level, beyond) for level, beyond in _other_latch_cases(kind, 25, seed=77) if beyond]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["typical", "edge"])
def test_the_worst_of_the_brake_holds_for_other_cases(kind):
    assert not [(level, beyond) for level, beyond in _other_brake_cases(kind, 6, seed=77) if beyond]


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["typical", "edge"])
def test_the_worst_of_the_latch_holds_for_very_many_cases(kind):
    assert not [(level, beyond) for level, beyond in _other_latch_cases(kind, 1500, seed=78) if beyond]


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["typical", "edge"])
def test_the_worst_of_the_brake_holds_for_very_many_cases(kind):
    assert not [(level, beyond) for level, beyond in _other_brake_cases(kind, 200, seed=78) if beyond]


def test_cases_stay_away_from_the_threshold_and_repeat_by_seed():
    cases = latch_cases.latch_cases("typical", 20, seed=5)
    assert cases == latch_cases.latch_cases("typical", 20, seed=5)
    assert cases != latch_cases.latch_cases("typical", 20, seed=6)
    for case in cases:
        ((volts, length_s),) = case.strokes
        nominal = abs(volts) * 1.38 / case.parameters.resistance_ohm
        min_s = latch.min_pulse_s(nominal, "off-on" if volts > 0 else "on-off", case.rise_k, extrapolate=True)
        assert abs(length_s / min_s - 1.0) > 0.9 * UNCERTAIN_WITHIN


def test_what_a_level_does_not_answer_for_is_refused_not_measured():
    weak = latch_cases.LatchCase("edge", ((2.8, 10e-3),), "off", 0.0, latch_cases.LATCH)
    assert latch_cases.play(weak, "event") is None  # its constants end at 3.75 V
    assert latch_cases.play(weak, "table") is not None
    assert shipped().row("latch", "event", "arrival time", "edge").refused > 0


def test_one_node_hides_what_a_coil_that_stays_on_does():
    edge = thermal_cases.thermal_cases("edge", 5)
    assert max(thermal_cases.errors(case, "exact")["coil temperature"] for case in edge) > 50.0
    assert max(thermal_cases.errors(case, "two_node")["coil temperature"] for case in edge) == 0.0


@pytest.mark.slow
def test_measuring_twice_gives_the_same_errors(monkeypatch):
    monkeypatch.setattr(cost, "_ENOUGH_S", 0.01)  # costs are not looked at
    table = measure(quick=True, models=("thermal",))
    again = measure(quick=True, models=("thermal",))
    errors = [(row.level, row.observable, row.cases, row.median, row.worst) for row in table.rows]
    assert errors == [(row.level, row.observable, row.cases, row.median, row.worst) for row in again.rows]
    with pytest.raises(InputError, match="garment"):
        measure(models=("garment",))


def test_a_table_survives_its_json():
    table = shipped()
    assert from_json(json.loads(json.dumps(to_json(table)))) == from_json(to_json(table))
    with pytest.raises(InputError, match="no measured row"):
        table.row("latch", "event", "colour")


def test_the_picture_is_a_png_and_is_not_overwritten_unasked(tmp_path):
    path = tmp_path / "cost.png"
    draw(shipped(), path)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    with pytest.raises(InputError, match="exists"):
        draw(shipped(), path)

"""The finger behind a brake: slack, rise, plateau; strips that hold but never push."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.physics.brake.finger import FINGER, FingerParameters, series_stiffness_n_m
from haptics.physics.brake.kernel import pulled
from haptics.physics.brake.levels import brake_plant
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.parameters import provenance

places = st.floats(-0.1, 0.1)


def engaged(level: str, volts: float = 800.0, finger: FingerParameters = FINGER):
    """A brake under constant volts, settled at its capacity."""
    plant = brake_plant(level, BrakeSystem(finger=finger))
    plant.drive(0.0, 1, volts, 0.0)
    plant.advance(0.2)
    return plant


def test_two_springs_in_series() -> None:
    finger = FINGER.with_values(load_stiffness_n_m=3e3, strip_stiffness_n_m=6e3)
    assert series_stiffness_n_m(finger) == pytest.approx(2e3)


@pytest.mark.parametrize("name", [row.name for row in provenance(FINGER)])
def test_every_parameter_has_a_range_and_says_where_it_comes_from(name: str) -> None:
    row = next(row for row in provenance(FINGER) if row.name == name)
    assert row.source
    assert row.low <= row.value <= row.high < math.inf
    with pytest.raises(InputError, match=name):
        FINGER.with_values(**{name: row.low - 1.0})
    with pytest.raises(InputError, match=name):
        FINGER.with_values(**{name: math.nan})


def test_a_slow_pull_is_slack_then_rise_then_plateau_then_loose() -> None:
    """The course worked out by hand: 1 mm of slack, 800 N/m in series, 4 N of capacity."""
    course = [
        (0.5e-3, 0.0, 0.0),
        (3.5e-3, 0.0, 2.0),
        (6e-3, 0.0, 4.0),
        (7e-3, 1e-3, 4.0),
        (4.5e-3, 1e-3, 2.0),
        (1.5e-3, 1e-3, 0.0),
    ]
    slip_m = 0.0
    for hand_m, slid_m, tension in course:
        slip_m, tension_n = pulled(slip_m, hand_m, 4.0, 800.0, 1e-3)
        assert slip_m == pytest.approx(slid_m, abs=1e-15)
        assert tension_n == pytest.approx(tension, abs=1e-12)


def test_strips_are_pushed_together_again_but_not_beyond_where_they_began() -> None:
    slip_m, tension_n = pulled(2e-3, 0.5e-3, 4.0, 800.0, 1e-3)
    assert (slip_m, tension_n) == (0.5e-3, 0.0)
    assert pulled(slip_m, -3e-3, 4.0, 800.0, 1e-3) == (0.0, 0.0)


@given(st.floats(0, 0.1), places, places, st.floats(0, 50), st.floats(1, 3e5), st.floats(0, 0.01))
def test_play_depends_on_the_way_and_not_on_the_steps(slip_m, from_m, to_m, capacity_n, stiffness, slack_m) -> None:
    start_m, _ = pulled(slip_m, from_m, capacity_n, stiffness, slack_m)
    once = pulled(start_m, to_m, capacity_n, stiffness, slack_m)
    half, _ = pulled(start_m, 0.5 * (from_m + to_m), capacity_n, stiffness, slack_m)
    twice = pulled(half, to_m, capacity_n, stiffness, slack_m)
    assert twice[0] == pytest.approx(once[0], abs=1e-15)
    assert twice[1] == pytest.approx(once[1], abs=1e-9)
    assert 0.0 <= once[1] <= capacity_n
    assert 0.0 <= once[0] <= max(start_m, to_m)


@pytest.mark.parametrize("level", ["static", "lagged", "dynamic", "reference"])
def test_every_level_gives_slack_rise_and_plateau(level: str) -> None:
    """At 10 mm/s against 800 V: loose for 0.1 s, then 8 N/s (series 800 N/m), then what the brake holds."""
    plant = engaged(level)
    held = plant.capacity_n[0]
    plant.move(0, 0.2, 0.0, 0.01)
    plant.advance(0.28)
    assert plant.tension_n[0] == 0.0
    plant.advance(0.5)
    # 2 mm past the slack; a hand 8 mm/s faster than the finger drags it along, the finger's own damping holds it back.
    dragged_n = 0.8 * (5.0 * 8e-3 - 0.5 * 2e-3) if level in ("dynamic", "reference") else 0.0
    assert plant.tension_n[0] == pytest.approx(800 * 2e-3 + dragged_n, abs=1e-6 if level == "reference" else 0.01)
    assert plant.slip_m[0] == 0.0
    plant.advance(1.5)
    # Overlap lost at 10 mm/s; capacity lags behind it by tau_off, 15 mN.
    left_n = held * (1 - 1e-2 * plant.slip_m[0] / 11e-4)
    assert plant.tension_n[0] == plant.capacity_n[0] == pytest.approx(left_n, abs=0.025)
    # The finger drags behind its hand by T / k_l.
    assert plant.finger_m[0] == pytest.approx(0.013 - plant.tension_n[0] / 1e3, abs=1e-4)
    assert plant.slip_m[0] == pytest.approx(plant.finger_m[0] - 1e-3 - plant.tension_n[0] / 4e3, abs=1e-6)


@pytest.mark.parametrize("level", ["static", "lagged", "dynamic", "reference"])
def test_a_finger_that_comes_back_is_free_and_pushes_the_strips_together(level: str) -> None:
    plant = engaged(level)
    plant.move(0, 0.2, 0.0, 0.05)
    plant.advance(0.5)
    slid_m = plant.slip_m[0]
    assert slid_m > 5e-3
    plant.move(0, 0.5, 0.015, -0.05)
    plant.advance(0.68)
    assert plant.tension_n[0] == 0.0
    assert plant.finger_m[0] == pytest.approx(0.006, abs=4e-4)
    assert 0.0 < plant.slip_m[0] < slid_m
    assert plant.slip_m[0] == pytest.approx(plant.finger_m[0], abs=3e-5)  # a step's way, at most
    plant.advance(1.0)
    assert plant.slip_m[0] == 0.0


@pytest.mark.parametrize("level", ["static", "lagged", "dynamic"])
def test_a_stiff_tester_sees_the_capacity(level: str) -> None:
    """A frame of 3e5 N/m; only the strips' own 4 kN/m are left to load."""
    finger = FINGER.with_values(load_stiffness_n_m=3e5, slack_m=0.0)
    plant = engaged(level, 400.0, finger)
    plant.move(0, 0.2, 0.0, 1e-3)
    plant.advance(0.4)
    assert plant.tension_n[0] == pytest.approx(1 / (1 / 3e5 + 1 / 4e3) * 0.2e-3, rel=5e-3)
    plant.advance(1.0)
    assert plant.tension_n[0] == plant.capacity_n[0]

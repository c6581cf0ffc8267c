"""Brakes that hold nothing, run for years, or are asked for a time that never comes."""

from __future__ import annotations

import math

import pytest

from haptics.errors import InputError
from haptics.physics.brake.force_laws import INDEX_CLOSING_GAP, force_law
from haptics.physics.brake.lagged import steps_at
from haptics.physics.brake.levels import brake_plant
from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.system import BrakeSystem
from haptics.units import VACUUM_PERMITTIVITY_F_PER_M


@pytest.mark.parametrize("level", ["lagged", "dynamic", "reference"])
def test_strips_without_capacity_hold_nothing_however_they_became_taut(level):
    # A jump of the hand, overshoot, strips pushed together and taut again; the drive at 0 V cuts time anew.
    plant = brake_plant(level, BrakeSystem(laws=(force_law("index", "ideal"),)))
    plant.move(0, 0.0, 0.0192, 0.0259)
    plant.drive(0.5e-3, 1, 0.0, 10.0)
    plant.advance(0.3)
    assert plant.tension_n == [0.0]
    # The finger lags its hand by what its damping takes, and the strips come after it by their slack.
    hand_m = 0.0192 + 0.0259 * 0.3
    assert plant.finger_m[0] == pytest.approx(hand_m, abs=2e-5)
    assert plant.slip_m[0] == pytest.approx(hand_m - 1e-3, abs=2e-5)


@pytest.mark.parametrize("years_s", [1.0, 1e5, 1e7, 1e9])
def test_the_grid_never_runs_ahead_of_time(years_s):
    step_s = 25e-6
    assert steps_at(years_s, 0.0, step_s) == round(years_s / step_s)
    assert steps_at(years_s - 0.1 * step_s, 0.0, step_s) == round(years_s / step_s) - 1


@pytest.mark.parametrize("time_s", [math.nan, math.inf])
def test_an_output_stage_refuses_a_time_that_never_comes(time_s):
    stage = OutputStage([2.5e-9])
    stage.drive(0.0, 1, 1500.0, 10.0)
    for act in (stage.advance, lambda t: stage.drive(t, 1, 1500.0, 20.0)):
        with pytest.raises(InputError, match="to_s"):
            act(time_s)


def test_the_closing_gap_is_the_equation_it_states():
    volts, overlap_m2, thickness_m, permittivity, law = 1200.0, 8e-4, 20e-6, 2.5, INDEX_CLOSING_GAP
    pressure_pa = VACUUM_PERMITTIVITY_F_PER_M * (volts * permittivity / thickness_m) ** 2 / 2
    gap_m = law.gap_m * (1 + (law.pressure_pa / pressure_pa) ** 2)
    field_m = permittivity * (thickness_m / permittivity + gap_m) ** 2
    stated_n = law.friction * 2 * VACUUM_PERMITTIVITY_F_PER_M * overlap_m2 * volts**2 / (2 * field_m) + law.off_force_n
    assert law.force_n(volts, overlap_m2, thickness_m, permittivity, 2, extrapolate=True) == pytest.approx(stated_n, rel=1e-12)

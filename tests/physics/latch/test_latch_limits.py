"""Where the latch model ends it reports so; what acts for less than a coil's time constant is counted right at every level."""

from __future__ import annotations

import math

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.physics.latch.bank import LatchBank
from haptics.physics.latch.dynamic import DynamicLatch
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.pulse import LEVELS, latch_plant, switch
from haptics.physics.latch.table import TableLatch

STEPPED = ("table", "dynamic", "reference")


@pytest.mark.parametrize("level", STEPPED)
def test_volts_that_press_the_pin_through_its_foam_are_refused_and_not_answered_with_nan(level):
    # At 50 V over 1.28 ohm the coil's 2.9 N grows with depth faster than 3 kN/m of foam pushes back: no equilibrium.
    plant = latch_plant(level, LATCH.with_values(resistance_ohm=1.28), latched="on")
    plant.drive(0.0, -50.0)
    with pytest.raises(InputError, match="into a stop"):
        plant.advance(20e-3)
    with pytest.raises(InputError):
        plant.advance(30e-3)


@pytest.mark.parametrize("level", STEPPED)
def test_a_pin_pressed_all_but_through_its_foam_rests_where_the_forces_balance(level):
    plant = latch_plant(level, latched="on")
    plant.drive(0.0, -34.0)
    plant.advance(0.5)
    assert plant.at_rest
    x, p = plant.position_m, LATCH
    shape = math.exp(-x / p.thrust_length_m) + math.exp((x - p.stroke_m) / p.thrust_length_m)
    coil_n = -34.0 / p.resistance_ohm * p.thrust_n_a * shape / (1.0 + math.exp(-p.stroke_m / p.thrust_length_m))
    on_n = p.hold_on_n * (1.0 + (p.stroke_m - x) / p.plate_length_m) ** -p.plate_power
    off_n = p.hold_off_n * (1.0 + x / p.plate_length_m) ** -p.plate_power
    assert coil_n + on_n - off_n - p.off_stiffness_n_m * x == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("level", ["table", "dynamic"])
def test_a_bank_refuses_them_too(level):
    bank = LatchBank(2, level, resistance_ohm=1.28)
    bank.drive(0.0, [-50.0, 5.0])
    with pytest.raises(InputError, match="into a stop"):
        bank.advance(20e-3)


def test_plain_python_refuses_them_too():
    plant = DynamicLatch(latched="on", compiled=False)
    plant.drive(0.0, -60.0)
    with pytest.raises(InputError, match="into a stop"):
        plant.advance(20e-3)


def test_switch_answers_or_refuses_up_to_its_greatest_volts():
    assert switch(10e-3, 20.0, "on-off").switched
    short = switch(0.9e-3, 50.0, "on-off", -40.0)
    assert short.switched
    assert not short.valid
    assert 0.0 < short.min_pulse_s < 0.9e-3
    with pytest.raises(InputError, match="into a stop"):
        switch(10e-3, 50.0, "on-off", -40.0)


@pytest.mark.parametrize("level", LEVELS)
def test_a_time_that_never_comes_is_refused(level):
    for time_s in (math.inf, math.nan):
        for act in (
            lambda plant, t: plant.advance(t),
            lambda plant, t: plant.drive(t, 1.0),
            lambda plant, t: plant.load_skin(t, 1.0, 1e-3),
        ):
            with pytest.raises(InputError, match="time"):
                act(latch_plant(level), time_s)


def test_a_pin_cannot_be_near_both_stops():
    with pytest.raises(InputError, match="near_stop_m"):
        LATCH.with_values(near_stop_m=2.5e-3)
    with pytest.raises(InputError, match="near_stop_m"):
        LATCH.with_values(stroke_m=1e-4)


@pytest.mark.parametrize("level", LEVELS)
def test_the_same_volts_again_change_nothing(level):
    def play(again_s):
        plant = latch_plant(level)
        plant.drive(0.0, 5.0)
        for at_s in again_s:
            plant.drive(at_s, 5.0)
        plant.drive(4e-3, 0.0)
        plant.advance(0.1)
        return plant.take_events(), plant.energy_j

    (once, once_j), (twice, twice_j) = play([]), play([1e-3, 1.5e-3])
    assert [event.kind for event in twice] == ["reached_skin"]
    assert twice[0].time_s == pytest.approx(once[0].time_s, abs=0.2e-6)
    assert twice_j == pytest.approx(once_j, rel=1e-5)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("at_s", [0.0, 2.6e-3, 6e-3])  # at rest, in flight, while it bounces
def test_a_pulse_shorter_than_the_coils_time_constant_costs_what_its_current_says(level, at_s):
    plant = latch_plant(level)
    if at_s:
        plant.drive(0.0, 5.0)
        plant.drive(at_s - 0.5e-3, 0.0)
    plant.advance(at_s)
    before_j = plant.energy_j
    volts, long_s, tau_s = 5.0, 3e-6, LATCH.inductance_h / LATCH.resistance_ohm
    plant.drive(at_s, volts)
    plant.drive(at_s + long_s, 0.0)
    plant.advance(0.1)
    expected_j = volts**2 / LATCH.resistance_ohm * (long_s - tau_s * -math.expm1(-long_s / tau_s))
    # What the pin's speed induces is a few per cent. A table that catches up with bounces puts 0.01 % of the whole right as well.
    assert plant.energy_j - before_j == pytest.approx(expected_j, rel=0.05, abs=1e-4 * before_j)


def test_a_chopped_drive_takes_the_same_in_a_bank_and_alone():
    bank, table, dynamic = LatchBank(1), TableLatch(), DynamicLatch()
    for k in range(600):  # 10 us on, 10 us off, on through landing and bounces
        for plant in (bank, table, dynamic):
            plant.drive(k * 20e-6, 9.0)
            plant.drive(k * 20e-6 + 10e-6, 0.0)
    for plant in (bank, table, dynamic):
        plant.advance(0.2)
    assert dynamic.latched == table.latched == "on"
    assert bank.latched[0] == 1
    assert table.energy_j == pytest.approx(dynamic.energy_j, rel=2e-3)
    assert float(bank.energy_j[0]) == pytest.approx(dynamic.energy_j, rel=2e-3)


def test_a_skin_laid_under_a_bouncing_pin_finds_it_where_it_is():
    positions = []
    for make in (TableLatch, DynamicLatch):
        plant = make()
        plant.drive(0.0, 5.0)
        plant.load_skin(4.86e-3 + 0.15e-3, 300.0, 1.9e-3)  # just after landing
        plant.advance(5.1e-3)
        positions.append(plant.position_m)
    assert positions[0] == pytest.approx(positions[1], abs=0.2e-6)
    assert abs(positions[1] - LATCH.stroke_m) > 2e-6


def test_level_event_says_that_weak_volts_push_a_flying_pin_too():
    # 2.1 ms of 5 V fall short; 1.9 V after it would carry the pin over, though too weak to fetch it from its stop.
    states = {}
    for level in ("event", "dynamic"):
        plant = latch_plant(level)
        plant.drive(0.0, 5.0)
        plant.drive(2.1e-3, 1.9)
        plant.drive(20e-3, 0.0)
        plant.advance(0.2)
        states[level] = plant.latched, plant.outside
    assert states["dynamic"] == ("on", ())
    assert states["event"][0] == "on" or any("1.9 V" in reason for reason in states["event"][1])
    resting = latch_plant("event")
    resting.drive(0.0, 1.9)
    assert resting.outside == ()


def test_years_of_time_cost_no_more_than_their_rounding():
    """A double at 1e9 s resolves 0.12 us."""
    seen = []
    for start_s in (0.0, 1e9):
        bank = LatchBank(1)
        bank.advance(start_s)
        at_s = start_s
        for volts, long_s in ((5.0, 5.2e-3), (-5.0, 3e-3), (5.0, 2e-3), (-5.0, 3e-3), (5.0, 20e-3)):
            bank.drive(at_s, volts)
            at_s += long_s
        bank.advance(at_s)
        seen.append((float(bank.reached_skin_s[0]) - start_s, float(bank.reached_off_s[0]) - start_s))
    assert np.allclose(seen[0], seen[1], atol=2e-6, rtol=0.0, equal_nan=True)

from __future__ import annotations

import math

import pytest

from haptics.errors import InputError
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.pulse import (
    DIRECTIONS,
    LEVELS,
    PULSE_BACK_S,
    PULSE_TOWARD_S,
    TRAIN_BACK_S,
    TRAIN_TOWARD_S,
    latch_plant,
    min_pulse_s,
    switch,
    travel_s,
)


def drive(plant, *strokes):
    """Play (volts, seconds) after one another, then nothing, until at rest."""
    at_s = 0.0
    for volts, length_s in strokes:
        plant.drive(at_s, volts)
        at_s += length_s
    plant.drive(at_s, 0.0)
    plant.advance(at_s + 0.3)
    assert plant.at_rest
    return plant


@pytest.mark.parametrize("level", LEVELS)
def test_on_to_off_takes_the_published_six_milliseconds(level):
    outcome = switch(10e-3, 5.0, "on-off", level=level)
    assert outcome.switched
    assert outcome.arrival_s == pytest.approx(6.000e-3, abs=0.5e-6)
    assert travel_s("on-off", level=level) == pytest.approx(6.000e-3, abs=0.5e-6)


@pytest.mark.parametrize("level", LEVELS)
def test_off_to_on_is_faster_because_the_off_plate_holds_less(level):
    assert switch(10e-3, 5.0, "off-on", level=level).arrival_s == pytest.approx(4.85e-3, abs=0.02e-3)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_full_pulse_costs_about_180_millijoule(level, direction):
    # 18 W for 10 ms (thesis 3.4.3); resistance 1.38 ohm alone makes it 181.2 mJ, induced voltage takes a little off.
    assert switch(10e-3, 5.0, direction, level=level).energy_j == pytest.approx(0.180, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_least_pulse_divides_those_that_switch_from_those_that_fall_back(level, direction):
    shortest_s = min_pulse_s(5.0, direction, level=level)
    near, far = direction.split("-")
    long, short = switch(shortest_s * 1.001, 5.0, direction, level=level), switch(shortest_s * 0.999, 5.0, direction, level=level)
    assert (long.switched, long.final_state) == (True, far)
    assert (short.switched, short.final_state, short.arrival_s) == (False, near, None)
    for outcome in (long, short):
        assert outcome.uncertain
        assert abs(outcome.margin) == pytest.approx(0.001, rel=0.1)
    assert not switch(shortest_s * 1.03, 5.0, direction, level=level).uncertain
    assert not switch(shortest_s * 0.97, 5.0, direction, level=level).uncertain


@pytest.mark.parametrize("level", LEVELS)
def test_a_pulse_shorter_than_the_coils_time_constant_does_nothing(level):
    outcome = switch(5e-6, 5.0, "off-on", level=level)  # L/R = 14.5 us
    assert not outcome.switched
    assert 0 < outcome.energy_j < 1e-4


def test_energy_of_a_very_short_pulse_is_that_of_a_coil_charging():
    # Integral of V i with i = V/R (1 - exp(-t R/L)); the pin has not moved, so this is exact.
    t, tau = 5e-6, LATCH.inductance_h / LATCH.resistance_ohm
    exact = 25 / LATCH.resistance_ohm * (t - tau * (1 - math.exp(-t / tau)))
    assert switch(t, 5.0).energy_j == pytest.approx(exact, rel=1e-3)  # one step of 5 us, fourth order


@pytest.mark.parametrize("level", LEVELS)
def test_a_volt_moves_nothing(level):
    outcome = switch(10e-3, 1.0, "off-on", level=level)
    assert not outcome.switched
    assert outcome.min_pulse_s == math.inf
    assert outcome.margin == -1.0


@pytest.mark.parametrize("level", LEVELS)
def test_heat_slows_the_pin(level):
    cold, hot = (travel_s("off-on", rise_k=k, level=level) for k in (0.0, 50.0))
    assert hot > 1.1 * cold


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("volts", [4.5, 5.0])
@pytest.mark.parametrize("rise_k", [0.0, 50.0])
def test_pulse_mode_retracts(level, volts, rise_k):
    plant = latch_plant(level)
    plant.rise_k = rise_k
    drive(plant, (volts, PULSE_TOWARD_S), (-volts, PULSE_BACK_S))
    assert plant.latched == "off"
    assert "reached_skin" not in [event.kind for event in plant.take_events()]


@pytest.mark.parametrize("level", LEVELS)
def test_three_milliseconds_alone_latch_the_pin_on(level):
    # The conflict behind PULSE_BACK_S: without the reverse pulse "retracts" fails.
    assert drive(latch_plant(level), (5.0, PULSE_TOWARD_S)).latched == "on"


def test_half_the_reverse_pulse_still_retracts_at_any_resistance_and_skin():
    for resistance in (1.28, 1.48):
        for skin in (0.0, 300.0):
            parameters = LATCH.with_values(resistance_ohm=resistance, skin_stiffness_n_m=skin)
            plant = drive(latch_plant("dynamic", parameters), (5.0, PULSE_TOWARD_S), (-5.0, PULSE_BACK_S / 2))
            assert plant.latched == "off"


@pytest.mark.parametrize("level", LEVELS)
def test_a_train_at_200_hz_ends_off_and_holds_at_most_the_published_energy(level):
    plant = drive(latch_plant(level), *[(5.0, TRAIN_TOWARD_S), (-5.0, TRAIN_BACK_S)] * 10)
    assert plant.latched == "off"
    assert 0.85 < plant.energy_j <= 0.9 * 1.01  # 18 W for 50 ms; 25/1.38 is 18.1 W


@pytest.mark.parametrize("level", LEVELS)
def test_a_reversal_in_flight_brings_the_pin_back(level):
    plant = latch_plant(level, latched="on")
    drive(plant, (-5.0, 3e-3), (5.0, 4e-3))
    assert plant.latched == "on"
    assert [event.kind for event in plant.take_events()] == ["left_skin", "reached_skin"]


@pytest.mark.parametrize("level", LEVELS)
def test_events_of_a_contact_and_a_release(level):
    plant = latch_plant(level)
    plant.drive(0.0, 5.0)
    plant.drive(0.010, 0.0)
    plant.drive(0.100, -5.0)
    plant.drive(0.110, 0.0)
    plant.advance(0.2)
    events = plant.take_events()
    assert [event.kind for event in events] == ["reached_skin", "left_skin", "reached_off"]
    assert events[0].time_s == pytest.approx(4.856e-3, abs=1e-6)
    assert events[1].time_s == pytest.approx(0.101, abs=0.1e-3)
    assert events[2].time_s == pytest.approx(0.106, abs=1e-6)
    assert events[0].speed_m_s > 0 > events[2].speed_m_s
    assert plant.take_events() == []


@pytest.mark.parametrize("level", LEVELS)
def test_how_time_is_cut_does_not_change_the_result(level):
    def run(cuts):
        plant = latch_plant(level)
        changes = {0.001: 5.0, 0.0037: -4.0, 0.0052: 5.0, 0.0133: 0.0}
        for time_s in sorted(set(changes) | set(cuts)):
            plant.advance(time_s)
            _ = plant.position_m, plant.energy_j
            if time_s in changes:
                plant.drive(time_s, changes[time_s])
        plant.advance(0.06)
        return plant.take_events(), plant.position_m, plant.energy_j, plant.latched

    assert run([k * 7.3e-6 for k in range(5000)]) == run([])


@pytest.mark.parametrize("level", LEVELS)
def test_a_coil_stuck_on_takes_full_power_for_as_long_as_it_lasts(level):
    plant = latch_plant(level)
    plant.drive(0.0, 5.0)
    plant.advance(3600.0)
    assert plant.at_rest
    assert plant.energy_j == pytest.approx(3600 * 25 / 1.38, rel=1e-6)  # the first milliseconds' induced voltage


@pytest.mark.parametrize("level", LEVELS)
def test_at_rest_the_pin_stays_and_takes_nothing(level):
    for state in ("on", "off"):
        plant = latch_plant(level, latched=state)
        plant.advance(1e6)
        assert plant.at_rest
        assert plant.latched == state
        assert plant.energy_j == 0.0
        assert plant.take_events() == []


@pytest.mark.parametrize(("stiffness", "holds"), [(0.0, True), (300.0, True), (500.0, False), (800.0, False)])
def test_contact_stalls_against_skin_stiffer_than_the_hold_can_compress(stiffness, holds):
    # 0.2 N over the last 0.5 mm is 400 N/m.
    plant = latch_plant("dynamic", LATCH.with_values(skin_stiffness_n_m=stiffness))
    assert (drive(plant, (5.0, 10e-3)).latched == "on") is holds


def test_skin_may_press_while_the_pin_rests_on_it():
    plant = latch_plant("dynamic", latched="on")
    plant.load_skin(0.1, 2000.0, 1.5e-3)
    plant.advance(0.5)
    assert plant.latched == "between"
    assert [event.kind for event in plant.take_events()] == ["left_skin"]


def test_outside_the_stated_drive_the_answer_is_not_valid_and_says_why():
    outcome = switch(12e-3, 6.0)
    assert not outcome.valid
    assert len(outcome.reasons) == 2
    assert "12 ms" in outcome.reasons[0]
    assert switch(10e-3, 5.0).valid


@pytest.mark.parametrize(
    "arguments",
    [(-1e-3,), (math.nan,), (10e-3, -5.0), (10e-3, 5.0, "up"), (10e-3, 5.0, "off-on", 1e4), (10e-3, 5.0, "off-on", 0.0, "x")],
)
def test_nonsense_is_refused(arguments):
    with pytest.raises(InputError):
        switch(*arguments)


@pytest.mark.parametrize("level", LEVELS)
def test_time_only_moves_forward(level):
    plant = latch_plant(level)
    plant.advance(1.0)
    with pytest.raises(InputError, match="forward"):
        plant.drive(0.5, 5.0)
    with pytest.raises(InputError, match="between"):
        latch_plant(level, latched="between")

"""Brakes driven pin by pin: the same edges give the same volts, forces, charge and energy as the wave made inside."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.physics.brake.bridge import BROKEN_DOWN_OHM
from haptics.physics.brake.charging import DRIVE, Charging, steady_half_period
from haptics.physics.brake.force_laws import default_law
from haptics.physics.brake.levels import LEVELS, brake_plant
from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.system import BrakeSystem

C = 2.547e-9
R, R_B, AMPS = DRIVE.output_resistance_ohm, DRIVE.bleeder_ohm, DRIVE.supply_current_a
ROUNDING = 1e-9  # of each quantity: the same formulas, cut into the same stretches
HELD = 2e-7  # of a force: brakes nobody pulls pass through volts within 1e-7 of the setpoint as if they were held


def follow(wave: OutputStage, pins, time_s: float) -> None:
    """Put the pins to what the wave's bridge does now."""
    pins.pins(time_s, wave.mask, wave.set_v, wave.polarity if wave.charging else 0, wave.mask != 0)


def together(a, b, stage: OutputStage, to_s: float) -> None:
    """Carry both, the second one's pins moved wherever the first one's bridge switches."""
    while (at_s := stage.next_event_s) is not None and at_s <= to_s:
        a.advance(at_s)
        follow(stage, b, at_s)
    a.advance(to_s)
    b.advance(to_s)


drives = st.tuples(
    st.integers(0, 7), st.sampled_from([0.0, 30.0, 400.0, 1000.0, 1500.0]), st.sampled_from([0.0, 5.0, 20.0, 110.0, 1000.0]),
    st.floats(1e-4, 0.06),
)  # fmt: skip


@settings(deadline=None, max_examples=40)
@given(st.lists(drives, min_size=1, max_size=8))
def test_pins_at_the_same_edges_give_the_same_volts_charge_and_energy(sequence):
    a, b = OutputStage([C, 1.1 * C, 0.0]), OutputStage([C, 1.1 * C, 0.0])
    now_s = 0.0
    for mask, volts, frequency_hz, for_s in sequence:
        if frequency_hz != a.frequency_hz:  # as firmware does: another wave begins from shorted outputs
            a.drive(now_s, 0, 0.0, 0.0)
            follow(a, b, now_s)
            now_s += 2e-3
        a.drive(now_s, mask, volts, frequency_hz)
        follow(a, b, now_s)
        for _ in range(3):
            now_s += for_s / 3
            together(a, b, a, now_s)
            assert b.voltages_v == pytest.approx(a.voltages_v, rel=ROUNDING, abs=1e-9)
            assert b.bus_v == pytest.approx(a.bus_v, rel=ROUNDING)
            assert b.supply_current_a == pytest.approx(a.supply_current_a, rel=ROUNDING, abs=1e-15)
            assert [b.amplitude_v(k) for k in range(3)] == pytest.approx([a.amplitude_v(k) for k in range(3)], abs=1e-9)
            assert b.mask == a.mask
            if a.charging:  # the wave's bridge counts as turned when its clamp begins, a pin when it moves
                assert b.polarity == a.polarity
    assert b.charge_c == pytest.approx(a.charge_c, rel=ROUNDING)
    assert b.energy_j == pytest.approx(a.energy_j, rel=ROUNDING)
    assert [b.output_energy_j(k) for k in range(3)] == pytest.approx([a.output_energy_j(k) for k in range(3)], rel=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("pulled", [False, True])
@pytest.mark.parametrize("level", LEVELS)
def test_pins_at_the_same_edges_give_the_same_forces_at_every_level(level, pulled):
    system = BrakeSystem(laws=(default_law("index"), default_law("thumb")))
    a, b = brake_plant(level, system), brake_plant(level, system)
    seen: list[list] = [[], []]
    for plant in (a, b) if pulled else ():
        plant.move(0, 0.0, 0.0, 0.1)
    for at_s, mask, volts, frequency_hz in [
        (0.01, 1, 1000.0, 20.0),
        (0.12, 3, 1500.0, 25.0),
        (0.2, 3, 900.0, 25.0),
        (0.33, 0, 0, 0),
    ]:
        together(a, b, a.stage, at_s)
        a.drive(at_s, mask, volts, frequency_hz)
        follow(a.stage, b, at_s)
        for k in range(1, 7):
            together(a, b, a.stage, at_s + 0.01 * k)
            for name in ("capacity_n", "tension_n", "slip_m", "finger_m"):
                assert getattr(b, name) == pytest.approx(getattr(a, name), rel=ROUNDING if pulled else HELD, abs=1e-12)
        for plant, events in zip((a, b), seen, strict=True):
            events += [(event.output, event.kind, round(event.time_s, 9)) for event in plant.take_events()]
    assert (max(a.slip_m) > 0.0) == pulled
    assert seen[0] == seen[1]
    assert [kind for _, kind, _ in seen[0]].count("half_capacity") >= 2


def test_the_static_level_takes_the_frequency_from_the_edges():
    """So fast that the amplitude stays short of the setpoint, the force must be that of the amplitude."""
    system = BrakeSystem()
    plant = brake_plant("static", system)
    frequency_hz = 90.0
    edge_s = 0.25 / frequency_hz
    plant.pins(0.0, 1, 1500.0, 1)
    for k in range(30):
        plant.pins(edge_s + 0.5 * k / frequency_hz, 1, 1500.0, 0)
        plant.pins(edge_s + 0.5 * k / frequency_hz + 0.05 / frequency_hz, 1, 1500.0, -1 if k % 2 == 0 else 1)
    amplitude_v = steady_half_period(1500.0, frequency_hz, system.capacitance_f(0)).amplitude_v
    assert amplitude_v < 1300.0
    assert plant.stage.reversals == 30
    assert plant.stage.frequency_hz == pytest.approx(frequency_hz, rel=1e-9)
    assert plant.capacity_n[0] == pytest.approx(system.full_force_n(0, amplitude_v), rel=1e-4)


def test_a_supply_that_is_not_enabled_gives_nothing_and_only_its_bleeder_takes():
    stage = OutputStage([C])
    stage.pins(0.0, 1, 1000.0, 1)
    stage.advance(0.05)
    before_v, given_c = stage.voltage_v(0), stage.charge_c
    stage.pins(0.05, 1, 1000.0, 1, enabled=False)
    stage.advance(0.15)
    tau_s = (R + R_B) * (C + DRIVE.stray_f)
    assert stage.voltage_v(0) == pytest.approx(before_v * math.exp(-0.1 / tau_s), rel=1e-12)
    assert stage.bus_v == pytest.approx(stage.voltage_v(0) * R_B / (R + R_B), rel=1e-12)
    assert (stage.charge_c, stage.supply_current_a) == (given_c, 0.0)


def test_an_enabled_supply_without_outputs_charges_the_stray_capacitance():
    stage = OutputStage([C])
    stage.pins(0.0, 0, 500.0, 1)
    assert stage.bus_v == pytest.approx(AMPS / (1.0 / R + 1.0 / R_B), rel=1e-9)  # all its current into empty wires
    stage.advance(0.1e-3)
    charged = Charging(500.0, DRIVE.stray_f, 0.0).charge(0.0, 0.1e-3)
    assert stage.bridge_v == pytest.approx(charged.u_v, rel=1e-12)
    assert stage.charge_c == pytest.approx(charged.charge_c, rel=1e-12)
    assert stage.voltages_v == [0.0]
    stage.pins(0.1e-3, 1, 500.0, 1)  # an empty output shares it
    assert stage.voltage_v(0) == pytest.approx(charged.u_v * DRIVE.stray_f / (C + DRIVE.stray_f), rel=1e-12)


def test_a_stuck_bridge_misses_what_its_pins_say():
    stage = OutputStage([C])
    stage.pins(0.0, 1, 1000.0, -1)
    stage.stuck = True
    stage.pins(0.02, 1, 1000.0, 0)
    stage.pins(0.021, 1, 1000.0, 1)
    stage.advance(0.05)
    assert stage.voltage_v(0) == pytest.approx(-1000.0, rel=1e-3)
    stage.pins(0.05, 0, 0.0, 0, enabled=False)  # shorting the outputs is not the bridge's
    stage.advance(0.051)
    assert abs(stage.voltage_v(0)) < 1.0


def breaking(stand_v: float, cuts: int = 1) -> OutputStage:
    stage = OutputStage([C, C])
    stage.set_output(0.0, 0, breakdown_v=stand_v)
    stage.drive(0.0, 0b11, 1500.0, 10.0)
    for k in range(cuts):
        stage.advance(0.02 * (k + 1) / cuts)
    return stage


def test_a_dielectric_breaks_down_when_its_volts_come_and_conducts_from_then_on():
    stage = OutputStage([C, C])
    stage.set_output(0.0, 0, breakdown_v=900.0)
    stage.drive(0.0, 0b11, 1500.0, 10.0)
    at_s = stage.next_event_s
    # The exact ramp: C u' = (I - u/R_b) / (1 + R/R_b).
    total_f = 2 * C + DRIVE.stray_f
    assert at_s == pytest.approx(-(R + R_B) * total_f * math.log1p(-900.0 / (AMPS * R_B)), rel=1e-9)
    stage.advance(at_s)
    assert stage.voltages_v == pytest.approx([900.0] * 2, rel=1e-9)
    assert stage.broken_down == 0b01
    stage.advance(at_s + 5e-3)
    assert stage.voltage_v(1) == pytest.approx(AMPS * BROKEN_DOWN_OHM, rel=1e-3)  # all the supply's current through the channel


def test_below_its_volts_nothing_breaks_and_how_time_is_cut_changes_nothing():
    assert breaking(1501.0).broken_down == 0
    once, often = breaking(1200.0), breaking(1200.0, 77)
    assert once.broken_down == often.broken_down == 0b01
    assert often.voltages_v == pytest.approx(once.voltages_v, rel=1e-9)


@pytest.mark.parametrize("level", LEVELS)
def test_a_broken_brake_holds_nothing_at_any_level(level):
    plant = brake_plant(level, BrakeSystem())
    plant.set_output(0.0, 0, breakdown_v=1200.0)
    plant.drive(0.0, 1, 1100.0, 10.0)
    plant.advance(0.1)
    held_n = plant.capacity_n[0]
    assert held_n > 5.0
    plant.drive(0.1, 1, 1300.0, 10.0)
    plant.advance(0.4)
    assert plant.stage.broken_down == 1
    assert plant.capacity_n[0] < 0.01


def test_pins_past_what_the_dielectric_stands_break_it_down_and_are_no_error():
    plant = brake_plant("lagged", BrakeSystem(brake=BrakeSystem().brake.with_values(thickness_m=2e-6)))  # 600 V
    plant.pins(0.0, 1, 1000.0, 1)
    plant.advance(0.1)
    assert plant.stage.broken_down == 1


@pytest.mark.parametrize(
    "wrong", [{"mask": 4}, {"volts": -1.0}, {"volts": 2001.0}, {"polarity": 2}, {"time_s": -1.0}], ids=lambda w: next(iter(w))
)
def test_nonsense_on_the_pins_is_refused(wrong):
    with pytest.raises(InputError):
        OutputStage([C, C]).pins(**{"time_s": 0.0, "mask": 1, "volts": 100.0, "polarity": 1, **wrong})

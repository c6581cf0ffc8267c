from __future__ import annotations

import math

import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.physics.brake.charging import DRIVE, steady_half_period
from haptics.physics.brake.output_stage import OutputStage

C = 2.547e-9


def run_to(stage, to_s, step_s=1e-4):
    """Samples (t, v of output 0) on the way."""
    samples, k = [], 1
    start = stage.now_s
    while start + k * step_s <= to_s:
        stage.advance(start + k * step_s)
        samples.append((stage.now_s, stage.voltage_v(0)))
        k += 1
    stage.advance(to_s)
    return samples


def test_the_first_half_period_has_half_the_length():
    stage = OutputStage([C])
    stage.drive(1.0, 0b1, 1500.0, 10.0)
    switches = []
    while len(switches) < 6:
        at_s = stage.next_event_s
        before = stage.polarity
        stage.advance(at_s)
        if stage.polarity != before:
            switches.append(at_s)
    assert [s - 1.0 for s in switches] == pytest.approx([0.025, 0.075, 0.125, 0.175, 0.225, 0.275], abs=1e-12)


def test_the_mean_voltage_is_zero_from_the_start():
    stage = OutputStage([C])
    stage.drive(0.0, 0b1, 1500.0, 20.0)
    samples = [v for _, v in run_to(stage, 1.0)]
    # Integral of the voltage stays within a half period's worth, rather than half of one away on average.
    area, low, high = 0.0, 0.0, 0.0
    for v in samples:
        area += v * 1e-4
        low, high = min(low, area), max(high, area)
    # Without the short start the area would never change sign and the ratio be 1; what is left is the first ramp.
    assert abs(low + high) < 0.2 * (high - low)


def test_amplitude_energy_and_charge_in_steady_state_are_the_closed_form():
    stage = OutputStage([C, C])
    stage.drive(0.0, 0b11, 1500.0, 20.0)
    stage.advance(1.0)
    energy_j, charge_c = stage.energy_j, stage.charge_c
    stage.advance(2.0)
    half = steady_half_period(1500.0, 20.0, 2 * C)
    assert stage.energy_j - energy_j == pytest.approx(40 * half.energy_j, rel=1e-9)
    assert stage.charge_c - charge_c == pytest.approx(40 * half.charge_c, rel=1e-9)
    assert stage.amplitude_v(0) == pytest.approx(half.amplitude_v, rel=1e-12)


def test_energy_is_the_integral_of_v_times_i_at_the_supply():
    stage = OutputStage([C])
    stage.drive(0.0, 0b1, 1200.0, 15.0)
    h, total = 1e-5, 0.0
    for k in range(10_000):
        stage.advance((k + 0.5) * h)
        total += stage.bus_v * stage.supply_current_a * h
    stage.advance(10_000 * h)
    assert stage.energy_j == pytest.approx(total, rel=1e-3)  # midpoint rule, with a few jumps of 10 us


@pytest.mark.parametrize("reversal", ["clamped", "direct"])
def test_the_current_never_passes_the_limit(reversal):
    stage = OutputStage([C] * 5, reversal=reversal)
    stage.drive(0.0, 0b10101, 1500.0, 20.0)
    for k in range(2000):
        stage.advance(k * 1e-4)
        assert 0.0 <= stage.supply_current_a <= DRIVE.supply_current_a * (1 + 1e-9)


@settings(max_examples=25)
@given(st.lists(st.floats(1e-6, 0.02), min_size=1, max_size=40))
def test_how_time_is_cut_does_not_change_the_result(pieces):
    # Exponentials compose exactly but for rounding.
    one, many = OutputStage([C, 2 * C]), OutputStage([C, 2 * C])
    for stage in (one, many):
        stage.drive(0.0, 0b11, 1000.0, 25.0)
    now = 0.0
    for piece in pieces:
        now += piece
        many.advance(now)
    one.advance(now)
    assert many.voltage_v(0) == pytest.approx(one.voltage_v(0), rel=1e-9, abs=1e-6)
    assert many.energy_j == pytest.approx(one.energy_j, rel=1e-9)


def test_connecting_another_clutch_shares_the_charge():
    stage = OutputStage([C, C])
    stage.drive(0.0, 0b01, 1000.0, 10.0)
    stage.advance(0.02)
    before = stage.stored_charge_c
    stage.drive(0.02, 0b11, 1000.0, 10.0)
    assert stage.voltage_v(0) == stage.voltage_v(1) == pytest.approx(1000 * (C + 0.2e-9) / (2 * C + 0.2e-9), rel=1e-9)
    assert stage.stored_charge_c == pytest.approx(before, rel=1e-12)


def test_outputs_not_in_the_mask_are_shorted():
    stage = OutputStage([C, C])
    stage.drive(0.0, 0b11, 1500.0, 10.0)
    stage.advance(0.02)
    stage.drive(0.02, 0b01, 1500.0, 10.0)
    stage.advance(0.021)
    assert abs(stage.voltage_v(1)) == pytest.approx(1500 * math.exp(-1e-3 / (20e3 * C)), rel=1e-9)
    assert stage.voltage_v(0) == pytest.approx(1500.0, rel=1e-3)
    stage.drive(0.021, 0, 0.0, 0.0)
    stage.advance(0.1)
    assert abs(stage.voltage_v(0)) < 1e-9
    assert stage.supply_current_a == 0.0
    assert stage.next_event_s is None


def test_a_refresh_of_the_same_wave_keeps_its_phase():
    once, often = OutputStage([C]), OutputStage([C])
    once.drive(0.0, 1, 1500.0, 10.0)
    for k in range(40):
        often.drive(k * 0.007, 1, 1500.0, 10.0)
    once.advance(0.3)
    often.advance(0.3)
    assert often.reversals == once.reversals
    assert often.voltage_v(0) == pytest.approx(once.voltage_v(0), rel=1e-9)


def test_a_lower_setpoint_is_reached_at_the_next_reversal_because_the_supply_cannot_sink():
    stage = OutputStage([C])
    stage.drive(0.0, 1, 1500.0, 10.0)
    stage.advance(0.01)
    stage.drive(0.01, 1, 600.0, 10.0)
    stage.advance(0.02)
    assert stage.voltage_v(0) > 1480.0  # 1.4 s through the bleeder
    assert stage.supply_current_a == 0.0
    stage.advance(0.04)
    assert stage.voltage_v(0) == pytest.approx(-600.0, rel=1e-6)
    assert stage.amplitude_v(0) == pytest.approx(600.0, rel=1e-6)


def test_faults_of_the_plant_show_electrically():
    short = OutputStage([C])
    short.set_output(0.0, 0, leak_ohm=1000.0)
    short.drive(0.0, 1, 1500.0, 10.0)
    short.advance(0.02)
    assert short.voltage_v(0) == pytest.approx(0.5, rel=0.01)  # 500 uA through 1 kohm
    assert short.supply_current_a == pytest.approx(500e-6)
    leaky = OutputStage([C])
    leaky.set_output(0.0, 0, leak_ohm=15e6)
    leaky.drive(0.0, 1, 1500.0, 10.0)
    leaky.advance(0.02)
    assert leaky.supply_current_a == pytest.approx(1500 / 15e6 + 1500 / 500e6, rel=1e-2)
    open_circuit = OutputStage([0.0])
    open_circuit.drive(0.0, 1, 1500.0, 10.0)
    open_circuit.advance(0.001)
    assert open_circuit.voltage_v(0) > 1400.0  # stray only: far too fast
    stuck = OutputStage([C])
    stuck.stuck = True
    stuck.drive(0.0, 1, 1500.0, 10.0)
    stuck.advance(1.0)
    assert stuck.reversals == 0
    assert stuck.voltage_v(0) > 0


def test_constant_voltage_has_no_reversals():
    stage = OutputStage([C])
    stage.drive(0.0, 1, 300.0, 0.0)
    stage.advance(100.0)
    assert stage.reversals == 0
    assert stage.voltage_v(0) == pytest.approx(300.0, rel=1e-4)


def test_nonsense_is_refused():
    stage = OutputStage([C] * 2, start_s=1.0)
    for arguments in ((0.5, 1, 100.0, 10.0), (2.0, 4, 100.0, 10.0), (2.0, 1, -1.0, 10.0), (2.0, 1, 100.0, 2000.0)):
        with pytest.raises(InputError):
            stage.drive(*arguments)
    with pytest.raises(InputError):
        OutputStage([])

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from haptics.errors import InputError
from haptics.physics.brake.charging import DRIVE, Charging, bleeder_alone_v, rise_time_s, steady_half_period, supply_power_w
from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.reservoir import Bus, steady

C = 2.747e-9


def stepped(bus: Bus, bus_v: float, load_v: float, dt_s: float, shorted: bool = False):
    """The same circuit by an implicit method of order 5: bus, load, charge, energy."""
    full = False

    def joined(u_v, b_v):
        return 0.0 if shorted else (b_v - u_v) / bus.resistance_ohm

    def motion(_, y):
        b_v, u_v = (bus.set_v, y[1]) if full else (y[0], y[1])
        into_a = joined(u_v, b_v)
        supply_a = b_v / bus.bleeder_ohm + into_a if full else bus.limit_a
        load_a = -u_v / bus.resistance_ohm if shorted else into_a
        bus_slope = 0.0 if full else (bus.limit_a - b_v / bus.bleeder_ohm - into_a) / bus.reservoir_f
        at_v = bus.set_v if bus.stiff else b_v
        return [bus_slope, (load_a - bus.leak_s * u_v) / bus.load_f, supply_a * 1e6, supply_a * at_v * 1e3]

    def filled(_, y):
        return y[0] - bus.set_v

    filled.terminal, filled.direction = True, 1.0
    now_s, y = 0.0, [bus_v, load_v, 0.0, 0.0]
    full = bus_v >= bus.set_v and bus.set_v / bus.bleeder_ohm + joined(load_v, bus_v) <= bus.limit_a
    while now_s < dt_s:
        done = solve_ivp(
            motion, (now_s, dt_s), y, "Radau", events=None if full else filled, rtol=1e-10, atol=1e-9, first_step=dt_s * 1e-9
        )
        now_s, y = done.t[-1], done.y[:, -1].tolist()
        full = full or done.status == 1
    return y[0], y[1], y[2] * 1e-6, y[3] * 1e-3


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    bus_share=st.floats(0.0, 1.0),
    load_share=st.floats(-1.0, 1.0),
    dt_s=st.floats(1e-5, 0.05),
    reservoir_f=st.floats(0.2e-9, 50e-9),
    leak_s=st.sampled_from([0.0, 1e-7, 2e-6]),
    bleeder_ohm=st.sampled_from([2e6, 1e7, 5e8]),
    stiff=st.booleans(),
    shorted=st.booleans(),
)
def test_two_capacitances_agree_with_an_integrator(
    bus_share, load_share, dt_s, reservoir_f, leak_s, bleeder_ohm, stiff, shorted
):  # fmt: skip
    bus = Bus(500e-6, 1500.0, 20e3, bleeder_ohm, reservoir_f, C, leak_s, stiff)
    bus_v = bus_share * 1500.0
    load_v = load_share * bus_v
    ours = (bus.shorted if shorted else bus.joined)(bus_v, load_v, dt_s)
    other = stepped(bus, bus_v, load_v, dt_s, shorted)
    # The integrator's relative tolerance of 1e-10 a step, over up to some thousand steps, of 1500 V and the charge that makes.
    assert ours.bus_v == pytest.approx(other[0], abs=1e-3)
    assert ours.load_v == pytest.approx(other[1], abs=1e-3)
    assert ours.charge_c == pytest.approx(other[2], rel=1e-6, abs=1e-11)
    assert ours.energy_j == pytest.approx(other[3], rel=1e-6, abs=1e-8)


@given(st.floats(-1500.0, 1500.0), st.floats(0.0, 1.0), st.lists(st.floats(1e-7, 5e-3), min_size=2, max_size=12))
def test_how_time_is_cut_changes_nothing(load_v, bus_share, pieces):
    bus = Bus(500e-6, 1500.0, 20e3, 5e8, 5e-9, C)
    whole = bus.joined(1500.0 * bus_share, load_v, sum(pieces))
    bus_v, at_v, charge_c, energy_j = 1500.0 * bus_share, load_v, 0.0, 0.0
    for piece in pieces:
        part = bus.joined(bus_v, at_v, piece)
        bus_v, at_v, charge_c, energy_j = part.bus_v, part.load_v, charge_c + part.charge_c, energy_j + part.energy_j
    # Exponentials compose but for rounding.
    assert (bus_v, at_v) == pytest.approx((whole.bus_v, whole.load_v), rel=1e-9, abs=1e-6)
    assert charge_c == pytest.approx(whole.charge_c, rel=1e-9)
    assert energy_j == pytest.approx(whole.energy_j, rel=1e-9)


def test_a_reservoir_gives_its_charge_share_at_once():
    # 10 R C later the two have one voltage, 1500 V C_r / (C + C_r), and the supply has added I t to the sum of charges.
    bus = Bus(500e-6, 1500.0, 20e3, 1e15, 5e-9, C)
    dt_s = 10 * 20e3 * C * 5e-9 / (C + 5e-9)
    after = bus.joined(1500.0, 0.0, dt_s)
    share_v = 1500.0 * 5e-9 / (5e-9 + C)
    assert C * after.load_v + 5e-9 * after.bus_v == pytest.approx(1500.0 * 5e-9 + 500e-6 * dt_s, rel=1e-12)
    # A supply that goes on charging keeps the bus I R C/(C + C_r) above the load, 3.5 V, and has raised both by 23 V.
    assert after.load_v == pytest.approx(share_v + 500e-6 * dt_s / (C + 5e-9), abs=3.5)
    assert share_v > 960.0


def test_a_vanishing_reservoir_is_none_and_a_huge_one_is_a_stiff_source():
    plain = steady_half_period(1500.0, 20.0, C - 0.2e-9)
    tiny = steady_half_period(1500.0, 20.0, C - 0.2e-9, DRIVE.with_values(reservoir_f=1e-15))
    # 1 fF beside 2.7 nF.
    assert (tiny.amplitude_v, tiny.charge_c, tiny.energy_j) == pytest.approx(
        (plain.amplitude_v, plain.charge_c, plain.energy_j), rel=3e-6
    )
    huge = supply_power_w(1500.0, 20.0, C - 0.2e-9, DRIVE.with_values(reservoir_f=1e-6))
    # From a bus that stays within C/C_r of 1500 V each half period takes C V^2, and the bleeder V^2/R_b.
    assert huge == pytest.approx(40.0 * C * 1500.0**2 + 1500.0**2 / 5e8, rel=2 * C / 1e-6)


@pytest.mark.parametrize("reversal", ["clamped", "direct"])
@pytest.mark.parametrize("reservoir_f", [1e-9, 20e-9])
@pytest.mark.parametrize("frequency_hz", [5.0, 60.0, 400.0])
def test_the_steady_half_period_repeats_itself(reversal, reservoir_f, frequency_hz):
    bus = Bus(500e-6, 1500.0, 20e3, 5e8, reservoir_f, C, 1e-8, reversal == "direct")
    half_s, clamped_s = 0.5 / frequency_hz, min(1e-3, 0.05 / frequency_hz) if reversal == "clamped" else 0.0
    given_ = steady(bus, clamped_s, half_s)
    pause = bus.shorted(given_.bus_v, -given_.load_v, clamped_s)
    again = bus.joined(pause.bus_v, pause.load_v, half_s - clamped_s)
    assert (again.bus_v, again.load_v) == pytest.approx((given_.bus_v, given_.load_v), abs=1e-6)
    assert given_.charge_c <= 500e-6 * half_s * (1 + 1e-9)
    assert given_.energy_j <= 1500.0 * given_.charge_c * (1 + 1e-9)


def test_constant_voltage_needs_no_more_than_bleeder_and_leak():
    held = steady_half_period(1000.0, 0.0, C, DRIVE.with_values(reservoir_f=5e-9), leak_s=1e-8)
    assert held.amplitude_v == pytest.approx(1000.0 / (1 + 20e3 * 1e-8), rel=1e-9)
    assert held.charge_c == pytest.approx(1000.0 / 5e8 + 1000.0 / (1e8 + 20e3), rel=1e-3)  # and 0.2 V fewer on the load


def test_where_a_reservoir_is_not_known_it_is_refused():
    drive = DRIVE.with_values(reservoir_f=1e-9)
    for use in (lambda: OutputStage([C], drive), lambda: rise_time_s(1500.0, C, drive), lambda: Charging(1500.0, C, 0.0, drive)):
        with pytest.raises(
            InputError, match="reservoir_f = 1e-09 F; only steady_half_period and supply_power_w take a reservoir"
        ):
            use()


def test_a_supply_whose_bleeder_is_too_strong_gives_no_more_than_its_current_while_the_bridge_shorts():
    weak = DRIVE.with_values(bleeder_ohm=2e6)  # 500 uA * 2 Mohm = 1000 V of 1500 V
    assert bleeder_alone_v(1500.0, weak) == 1000.0
    assert bleeder_alone_v(900.0, weak) == 900.0
    # All the time the supply gives all it can.
    assert steady_half_period(1500.0, 20.0, C, weak).charge_c == pytest.approx(500e-6 * 25e-3, rel=1e-12)
    stage = OutputStage([C], weak)
    stage.drive(0.0, 1, 1500.0, 20.0)
    stage.advance(13e-3)  # half a millisecond into the first short
    assert not stage.charging
    assert stage.supply_current_a == pytest.approx(500e-6, rel=1e-12)
    assert stage.bus_v == pytest.approx(1000.0, rel=1e-12)
    stage.advance(0.1)
    assert stage.charge_c == pytest.approx(500e-6 * 0.1, rel=1e-12)


def test_a_leak_helps_the_short_to_empty_the_load():
    # 300 V, 1 kHz, 10 uS: a short of 50 us is shorter than R C, so that what is left counts; time step by step says the same.
    half = steady_half_period(300.0, 1000.0, C - 0.2e-9, leak_s=1e-5)
    stage = OutputStage([C - 0.2e-9])
    stage.set_output(0.0, 0, leak_ohm=1e5)
    stage.drive(0.0, 1, 300.0, 1000.0)
    stage.advance(0.01025)
    assert half.amplitude_v == pytest.approx(stage.amplitude_v(0), rel=1e-9)


def test_a_load_above_a_lowered_setpoint_holds_the_bus_up():
    stage = OutputStage([C])
    stage.drive(0.0, 1, 1500.0, 10.0)
    stage.advance(0.02)
    stage.drive(0.02, 1, 600.0, 10.0)
    assert stage.supply_current_a == 0.0
    assert stage.bus_v == pytest.approx(1500.0 / (1 + 20e3 / 5e8), rel=1e-3)
    assert math.isclose(float(np.abs(stage.voltage_v(0))), 1500.0, rel_tol=1e-3)

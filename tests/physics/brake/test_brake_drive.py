from __future__ import annotations

import itertools
import math

import pytest

from haptics.errors import InputError
from haptics.physics.brake.charging import (
    DRIVE,
    Charging,
    discharge_time_s,
    eq44_power_w,
    max_frequency_hz,
    rise_time_s,
    steady_half_period,
    supply_power_w,
)
from haptics.physics.brake.parameters import BRAKE, capacitance_f

C = capacitance_f(BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity)
BARE = DRIVE.with_values(stray_f=0.0, bleeder_ohm=1e15, output_resistance_ohm=1.0, clamp_s=1e-6)
"""All but ideal: no stray capacitance, no bleeder, no resistance."""


def stepped(u_v, set_v, dt_s, c, leak_s, drive, steps=200_000):
    """The same circuit by small explicit steps: voltage, charge, energy."""
    r, r_b, limit = drive.output_resistance_ohm, drive.bleeder_ohm, drive.supply_current_a
    h = dt_s / steps
    q = e = 0.0
    for _ in range(steps):
        if u_v > set_v:
            into, supply, terminals = -u_v / (r_b + r), 0.0, 0.0
        else:
            into = (set_v - u_v) / r
            supply, terminals = into + set_v / r_b, set_v
            if supply > limit:
                supply, into = limit, (limit - u_v / r_b) / (1 + r / r_b)
                terminals = u_v + into * r
        q += supply * h
        e += supply * terminals * h
        u_v += (into - u_v * leak_s) / c * h
    return u_v, q, e


@pytest.mark.parametrize(
    ("start_v", "set_v", "dt_s", "leak_s", "bleeder"),
    [
        (0.0, 1500.0, 5e-3, 0.0, 5e8),
        (0.0, 1500.0, 20e-3, 0.0, 5e8),
        (-40.0, 1500.0, 20e-3, 1e-7, 1e8),
        (0.0, 1500.0, 20e-3, 5e-7, 1e8),
        (1500.0, 600.0, 20e-3, 1e-7, 1e7),
        (1500.0, 1400.0, 60e-3, 4e-7, 1e7),
        (0.0, 1500.0, 20e-3, 0.0, 2e6),
        (900.0, 900.0, 5e-3, 1e-5, 5e8),
    ],
)
def test_the_closed_form_agrees_with_small_steps(start_v, set_v, dt_s, leak_s, bleeder):
    drive = DRIVE.with_values(bleeder_ohm=bleeder)
    done = Charging(set_v, C + DRIVE.stray_f, leak_s, drive).charge(start_v, dt_s)
    u, q, e = stepped(start_v, set_v, dt_s, C + DRIVE.stray_f, leak_s, drive)
    assert done.u_v == pytest.approx(u, rel=1e-4, abs=1e-3)  # explicit Euler, h/tau = 2e-3
    assert done.charge_c == pytest.approx(q, rel=1e-3, abs=1e-12)
    assert done.energy_j == pytest.approx(e, rel=1e-3, abs=1e-9)


def test_two_pieces_are_one():
    charging = Charging(1500.0, C, 1e-7)
    whole = charging.charge(0.0, 20e-3)
    first = charging.charge(0.0, 7.3e-3)
    second = charging.charge(first.u_v, 12.7e-3)
    assert second.u_v == pytest.approx(whole.u_v, rel=1e-12)
    assert first.energy_j + second.energy_j == pytest.approx(whole.energy_j, rel=1e-11)


def test_charging_takes_8_milliseconds_not_50():
    assert rise_time_s(1500.0, C, BARE, share=1.0 - 1e-9) == pytest.approx(C * 1500 / 500e-6, rel=1e-4)
    assert rise_time_s(1500.0, C, BARE, share=1.0 - 1e-9) == pytest.approx(7.64e-3, abs=0.01e-3)
    assert rise_time_s(1500.0, C) == pytest.approx(0.9 * (C + 0.2e-9) * 1500 / 500e-6, rel=0.01)
    assert rise_time_s(1500.0, 2 * C) == pytest.approx(2 * rise_time_s(1500.0, C), rel=0.05)  # stray is not doubled
    assert rise_time_s(0.0, C) == 0.0


def test_a_bleeder_the_supply_cannot_feed_is_never_overcome():
    weak = DRIVE.with_values(bleeder_ohm=2e6)  # 500 uA * 2 Mohm = 1000 V
    assert rise_time_s(1500.0, C, weak) == math.inf
    assert steady_half_period(1500.0, 5.0, C, weak).amplitude_v == pytest.approx(1000.0, rel=1e-2)


def test_power_of_equation_44_and_of_the_supply_at_20_hertz():
    assert eq44_power_w(1500.0, 20.0, C) == pytest.approx(57.3e-3, abs=0.05e-3)
    minimum_w = C * 1500**2 * 20
    assert supply_power_w(1500.0, 20.0, C, BARE) == pytest.approx(minimum_w, rel=1e-3)
    assert supply_power_w(1500.0, 20.0, C, BARE, "direct") == pytest.approx(4 * minimum_w, rel=1e-3)
    assert supply_power_w(1500.0, 20.0, C) > minimum_w


@pytest.mark.parametrize(("reversal", "charges"), [("clamped", 2), ("direct", 4)])
def test_charge_from_the_source(reversal, charges):
    half = steady_half_period(1500.0, 20.0, C, BARE, reversal)
    assert half.charge_c * 40.0 == pytest.approx(charges * C * 1500 * 20, rel=1e-3)


@pytest.mark.parametrize(("reversal", "charges"), [("clamped", 2), ("direct", 4)])
def test_above_the_greatest_frequency_the_amplitude_is_what_the_current_gives(reversal, charges):
    fastest = max_frequency_hz(1500.0, C, BARE, reversal)
    assert fastest == pytest.approx(500e-6 / (charges * C * 1500), rel=1e-12)
    assert steady_half_period(1500.0, 0.95 * fastest, C, BARE, reversal).amplitude_v == pytest.approx(1500.0, rel=1e-3)
    assert steady_half_period(1500.0, 3.0 * fastest, C, BARE, reversal).amplitude_v == pytest.approx(500.0, rel=1e-2)


def test_full_swing_at_1500_volts_ends_near_65_hertz():
    assert max_frequency_hz(1500.0, C, BARE) == pytest.approx(65.4, abs=0.1)
    assert max_frequency_hz(1500.0, 2 * C, BARE) == pytest.approx(32.7, abs=0.1)
    assert max_frequency_hz(100.0, C) == pytest.approx(910.0, abs=1.0)
    assert max_frequency_hz(10.0, C) == 1000.0  # the bridge's


@pytest.mark.parametrize(
    ("volts", "frequency", "reversal"), list(itertools.product((0, 300, 1500), (0, 1, 20, 200, 1000), ("clamped", "direct")))
)
def test_steady_state_repeats_and_never_passes_the_setpoint(volts, frequency, reversal):
    half = steady_half_period(float(volts), float(frequency), C, DRIVE, reversal)
    assert 0.0 <= half.amplitude_v <= volts
    assert half.energy_j >= 0.0
    assert half.charge_c <= 500e-6 * (0.5 / frequency if frequency else 1.0) * (1 + 1e-9)


def test_discharge_through_the_bridge():
    # 20 kohm * 2.75 nF * ln 25: safe within a millisecond.
    assert discharge_time_s(1500.0, 60.0, C) == pytest.approx(20e3 * (C + 0.2e-9) * math.log(25), rel=1e-12)
    assert discharge_time_s(1500.0, 60.0, 5 * C) < 1e-3
    assert discharge_time_s(50.0, 60.0, C) == 0.0


def test_nonsense_is_refused():
    for arguments in ((-1.0, 10.0, C), (100.0, math.nan, C), (100.0, 10.0, -1.0)):
        with pytest.raises(InputError):
            steady_half_period(*arguments)
    with pytest.raises(InputError, match="reversal"):
        steady_half_period(100.0, 10.0, C, DRIVE, "other")

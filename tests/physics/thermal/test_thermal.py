from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.physics.thermal.one_node import THERMAL, ThermalParameters, burst_energy_j, pulse_rise_k, relax

rises = st.floats(-20, 100)
powers = st.floats(0, 20)


def test_one_switch_is_a_jump_of_an_eighth_of_a_kelvin():
    assert pulse_rise_k() == pytest.approx(0.18 * 69 / 102, rel=1e-15)
    assert pulse_rise_k() == pytest.approx(0.1218, abs=5e-5)  # four digits as published


def test_six_minutes_at_two_switches_a_second_reach_the_published_25_kelvin():
    # 69 K/W * 0.36 W = 24.84 K in the end, 97 % of it after 3.5 time constants.
    assert relax(0.0, 0.36, 1e5) == pytest.approx(24.84, rel=1e-12)
    assert relax(0.0, 0.36, 360.0) == pytest.approx(24.84 * (1 - math.exp(-360 / 102)), rel=1e-12)


@given(rises, powers, st.floats(0, 1000), st.floats(0, 1000))
def test_two_steps_are_one_step(rise_k, power_w, first_s, second_s):
    # Both are exact solutions: they differ by rounding only.
    there = relax(relax(rise_k, power_w, first_s), power_w, second_s)
    assert there == pytest.approx(relax(rise_k, power_w, first_s + second_s), rel=1e-12, abs=1e-10)


@given(rises, powers, st.floats(0, 1e9))
def test_the_rise_never_passes_its_equilibrium(rise_k, power_w, dt_s):
    final_k = THERMAL.c_k_per_w * power_w
    low, high = sorted((rise_k, final_k))
    assert low - 1e-9 <= relax(rise_k, power_w, dt_s) <= high + 1e-9


def test_a_million_microsecond_steps_do_not_stick():
    rise_k = 0.0
    for _ in range(1_000_000):
        rise_k += (69 * 18 - rise_k) * -math.expm1(-1e-6 / 102)
    assert rise_k == pytest.approx(relax(0.0, 18.0, 1.0), rel=1e-9)  # 1e6 roundings of 1e-16, random in sign


def test_a_clock_that_stepped_back_is_refused():
    with pytest.raises(InputError, match="dt_s"):
        relax(1.0, 0.0, -1.0)


def test_a_burst_at_200_hz_is_on_all_the_time():
    assert burst_energy_j(50e-3, 200.0) == pytest.approx(0.9, rel=1e-15)
    assert burst_energy_j(50e-3, 100.0) == pytest.approx(0.45, rel=1e-15)
    assert burst_energy_j(50e-3, 400.0) == burst_energy_j(50e-3, 200.0)


def test_parameters_swap():
    slow = ThermalParameters(tau_s=204.0)
    assert pulse_rise_k(0.18, slow) == pytest.approx(pulse_rise_k(0.18) / 2, rel=1e-15)

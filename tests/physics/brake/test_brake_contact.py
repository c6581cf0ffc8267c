from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.physics.brake.contact import CONTACT, ContactLag, lagged, time_to_reach_s
from haptics.physics.brake.force_laws import default_law
from haptics.physics.brake.output_stage import OutputStage

forces = st.floats(0, 50)


@given(forces, forces, st.floats(0, 1), st.floats(0, 1))
def test_two_steps_toward_one_target_are_one(force_n, target_n, first_s, second_s):
    there = lagged(lagged(force_n, target_n, first_s), target_n, second_s)
    assert there == pytest.approx(lagged(force_n, target_n, first_s + second_s), rel=1e-12, abs=1e-12)


@given(forces, forces, st.floats(0, 10))
def test_the_force_never_passes_its_target(force_n, target_n, dt_s):
    low, high = sorted((force_n, target_n))
    assert low - 1e-12 <= lagged(force_n, target_n, dt_s) <= high + 1e-12


def test_release_is_faster_than_100_ms():
    # Thesis 4.7.3: down to a tenth within 100 ms, at any tau_off of the stated range.
    assert time_to_reach_s(20.0, 2.0, 0.0) == pytest.approx(CONTACT.tau_off_s * math.log(10), rel=1e-12)
    assert time_to_reach_s(20.0, 2.0, 0.0, CONTACT.with_values(tau_off_s=43e-3)) < 0.1
    assert time_to_reach_s(0.0, 18.0, 20.0) < 5e-3
    assert time_to_reach_s(0.0, 21.0, 20.0) == math.inf


def plateau(parameters):
    """Mean force in steady state at 1500 V, 10 Hz, over its value without any dips."""
    law = default_law("index")
    stage = OutputStage([2.547e-9])
    stage.drive(0.0, 1, 1500.0, 10.0)
    force_n, total = 0.0, 0.0
    for k in range(4000):
        stage.advance((k + 0.5) * 1e-4)
        force_n = lagged(force_n, law.force_n(stage.voltage_v(0)), 1e-4, parameters)
        total += force_n if k >= 2000 else 0.0
    return total / 2000 / law.force_n(1500.0)


def test_the_slow_release_carries_the_plateau_over_the_reversals():
    assert plateau(CONTACT) > 0.95
    assert plateau(CONTACT.with_values(tau_off_s=CONTACT.tau_on_s)) < 0.93


def test_stepping_is_the_exact_lag_for_a_constant_target_and_ignores_how_time_is_cut():
    once, often = ContactLag(), ContactLag()
    once.advance(0.05, lambda _t: 10.0)
    for k in range(501):
        often.advance(k * 1e-4, lambda _t: 10.0)
    assert often.force_n == once.force_n == pytest.approx(lagged(0.0, 10.0, 0.05), rel=1e-12)


def test_stepping_converges_in_second_order_on_a_ramp():
    # Exact: F' = (a t - F)/tau, F = a (t - tau (1 - exp(-t/tau))).
    a, t, tau = 1000.0, 20e-3, CONTACT.tau_on_s
    exact = a * (t - tau * -math.expm1(-t / tau))
    errors = [abs(ContactLag(step_s=h).advance(t, lambda s: a * s) - exact) for h in (1e-3, 0.5e-3)]
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.1)


def test_a_negative_step_is_refused():
    with pytest.raises(InputError):
        lagged(1.0, 0.0, -1e-3)

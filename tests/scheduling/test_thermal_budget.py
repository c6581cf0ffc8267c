"""The heat account against published figures, brute force, and clocks that misbehave."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.physics.thermal.one_node import PULSE_ENERGY_J, ThermalParameters, burst_energy_j
from haptics.scheduling import ThermalBudget

S = 1_000_000_000
BURST_J = burst_energy_j(0.05, 200.0)

rises = st.floats(0.0, 24.9)
energies = st.sampled_from([PULSE_ENERGY_J, BURST_J, 0.05])


def budget(rise_k: float = 0.0, limit_k: float = 25.0) -> ThermalBudget:
    return ThermalBudget(limit_k=limit_k, rise_k=rise_k)


def test_one_switch_is_a_jump_of_energy_times_c_over_tau():
    assert budget().spend(0.18, 0) == pytest.approx(0.18 * 69 / 102, rel=1e-12)  # 0.1218 K; rounding only


def test_between_pulses_the_rise_falls_by_e_in_one_time_constant():
    account = budget(rise_k=10.0)
    assert account.rise_k(102 * S) == pytest.approx(10 / math.e, rel=1e-12)
    assert account.headroom_k(102 * S) == pytest.approx(25 - 10 / math.e, rel=1e-12)


@given(st.lists(st.integers(0, 10 * S), min_size=1, max_size=50), rises)
def test_many_small_steps_end_where_one_large_step_does(steps_ns: list[int], rise_k: float):
    account, now_ns = budget(rise_k), 0
    for step_ns in steps_ns:
        now_ns += step_ns
        account.rise_k(now_ns)
    # each step rounds to about one part in 2^53
    assert account.rise_k(now_ns) == pytest.approx(budget(rise_k).rise_k(now_ns), rel=1e-13, abs=1e-15)


def test_nanoseconds_count_even_after_a_week_of_uptime():
    account = budget()
    week_ns = 7 * 86400 * S
    account.spend(0.18, week_ns)
    before_k = account.rise_k(week_ns)
    for nanosecond in range(1, 1001):
        account.rise_k(week_ns + nanosecond)
    expected_k = before_k * 1e-6 / 102
    assert before_k - account.rise_k(week_ns + 1000) == pytest.approx(expected_k, rel=1e-4)  # 1000 roundings of 1e-17 K


@given(st.integers(0, 100 * S), st.integers(1, 100 * S), st.integers(0, 50 * S))
def test_a_clock_that_steps_back_never_cools_and_is_counted(at_ns: int, back_ns: int, forward_ns: int):
    account = budget()
    hot_k = account.spend(1.0, at_ns)
    assert account.rise_k(at_ns - back_ns) == hot_k
    assert account.clock_faults == 1
    # running on from the earlier time cools nothing until the latest time seen is passed
    for later_ns in range(at_ns - back_ns, at_ns, max(1, back_ns // 5)):
        assert account.rise_k(later_ns) == hot_k
    assert account.rise_k(at_ns + forward_ns) == pytest.approx(hot_k * math.exp(-forward_ns / S / 102), rel=1e-12)
    assert account.latest_ns == at_ns + forward_ns


def test_a_question_asked_ahead_of_time_is_answered_for_then_and_moves_nothing():
    account = budget(rise_k=24.95)
    assert not account.allows(0.18, 0)
    assert account.allows(0.18, 10 * S)
    assert account.allowed_now(100 * S) > account.allowed_now(50 * S) > 0
    assert account.wait_s(1, 10 * S) == 0.0 < account.wait_s(1, 0)
    assert account.rise_k(0) == 24.95
    assert account.clock_faults == 0
    assert account.rise_k(5 * S) > account.rise_k(6 * S)
    assert account.rise_k(5 * S) == account.rise_k(6 * S)
    assert account.clock_faults == 1


def test_energy_spent_at_a_time_that_has_passed_is_charged_in_full_now():
    account = budget()
    account.spend(0.18, 50 * S)
    assert account.spend(0.18, 20 * S) == pytest.approx(2 * 0.18 * 69 / 102, rel=1e-12)
    assert account.clock_faults == 1


@given(rises, energies, st.integers(0, 400 * S))
def test_switches_allowed_now_are_those_that_fit_one_by_one(rise_k: float, energy_j: float, now_ns: int):
    account, count = budget(rise_k), 0
    promised = account.allowed_now(now_ns, energy_j)
    while account.allows(energy_j, now_ns):
        account.spend(energy_j, now_ns)
        count += 1
    assert promised == count


@settings(max_examples=60, deadline=None)
@given(rises, energies, st.floats(0.05, 6.0))
def test_switches_allowed_at_a_spacing_are_those_that_fit_one_by_one(rise_k: float, energy_j: float, spacing_s: float):
    account = budget(rise_k)
    promised = account.allowed_at(spacing_s, 0, energy_j)
    spacing_ns = round(spacing_s * S)
    far = 2000
    count = 0
    while count < far and account.allows(energy_j, count * spacing_ns):
        account.spend(energy_j, count * spacing_ns)
        count += 1
    if promised is None:
        assert count == far
    else:
        # spacing as integer nanoseconds moves the limit by 1e-9 of a pulse: at most the last one may differ
        assert abs(count - min(promised, far)) <= 1


@pytest.mark.parametrize("energy_j", [PULSE_ENERGY_J, BURST_J])
def test_least_spacing_is_kept_up_for_ever_and_a_shorter_one_is_not(energy_j: float):
    account = budget()
    min_s = account.min_spacing_s(energy_j)
    assert account.allowed_at(min_s * (1 + 1e-9), 0, energy_j) is None
    assert account.allowed_at(min_s * (1 - 1e-3), 0, energy_j) is not None
    jump_k = energy_j * 69 / 102
    assert jump_k / -math.expm1(-min_s / 102) == pytest.approx(25.0, rel=1e-9)


@given(st.floats(1.0, 25.0), energies, st.integers(1, 20))
def test_after_the_wait_that_many_are_allowed_and_shortly_before_they_are_not(rise_k: float, energy_j: float, count: int):
    account = budget(rise_k)
    wait_s = account.wait_s(count, 0, energy_j)
    if math.isinf(wait_s):
        assert count * energy_j * 69 / 102 >= 25.0 * (1 - 1e-9)
        return
    if wait_s > 1e-6:
        assert (
            account.allowed_now(round(wait_s * S) - 1000, energy_j) < count
        )  # 1 us sooner is 1e-8 K too hot, far above rounding
    assert account.allowed_now(math.ceil(wait_s * S) + 1, energy_j) >= count


def test_published_rates():
    account = budget()
    assert account.allowed_at(0.5, 0) is None  # 120 switches a minute are safe (thesis 3.5.2)
    assert account.allowed_at(5.0, 0, BURST_J) is None  # 50 ms at 200 Hz every 5 s likewise
    assert account.allowed_now(0) == 205  # floor(25 / 0.12176)
    assert account.min_spacing_s() == pytest.approx(0.498, abs=5e-4)  # 102 s * 0.12176 / 25, and a little


def test_a_reserve_must_fit_beside_the_energy():
    jump_k = 0.18 * 69 / 102
    account = budget(limit_k=1.5 * jump_k)
    assert account.allows(0.18, 0)
    assert not account.allows(0.18, 0, reserve_j=0.18)


def test_other_parameters_are_used():
    account = ThermalBudget(ThermalParameters(tau_s=10.0, c_k_per_w=20.0), limit_k=5.0)
    assert account.spend(1.0, 0) == pytest.approx(2.0)
    assert account.rise_k(10 * S) == pytest.approx(2 / math.e)


@pytest.mark.parametrize("bad", [-0.1, math.nan, math.inf])
def test_bad_numbers_are_refused_and_change_nothing(bad: float):
    account = budget()
    with pytest.raises(InputError, match="energy_j"):
        account.spend(bad, 0)
    with pytest.raises(InputError, match="limit_k"):
        ThermalBudget(limit_k=bad)
    with pytest.raises(InputError, match="rise_k"):
        ThermalBudget(rise_k=bad)
    assert account.rise_k(0) == 0.0
    with pytest.raises(InputError, match="energy_j"):
        account.allowed_now(0, 0.0)


def test_an_account_is_only_ever_raised():
    account = budget(rise_k=5.0)
    account.raise_to(9.0, 0)
    assert account.rise_k(0) == pytest.approx(9.0)
    account.raise_to(2.0, 0)
    assert account.rise_k(0) == pytest.approx(9.0)

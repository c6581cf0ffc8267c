"""The heat account against every actuator within tolerance, and against the account that a board keeps.

The judges are written apart: bodies and boards here are sums of exponentials over continuous on-time, without jumps.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.physics.thermal.one_node import WORST_PULSE_POWER_W, ThermalParameters, bounding
from haptics.scheduling import CoilHeat, ThermalBudget
from haptics.scheduling.coil_heat import BOARD_TAU_S, BUILT_ON_TIME_S, MARGIN
from haptics.session.configuration import ActuatorCalibration

S = 1_000_000_000
BOARD_S = 102.0
WORST = ActuatorCalibration().coil_heat()
"""What is assumed of a coil that nobody measured."""
Spans = list[tuple[int, int]]

spans = st.lists(st.tuples(st.integers(0, 300 * S), st.integers(50_000, 50_000_000)), min_size=1, max_size=60)
"""Pauses of up to five minutes, and times a coil is on, to 50 ms."""


def on_spans(steps: Spans) -> Spans:
    """Start and end of each time a coil is on."""
    made, now_ns = [], 0
    for pause_ns, on_ns in steps:
        made.append((now_ns + pause_ns, now_ns + pause_ns + on_ns))
        now_ns = made[-1][1]
    return made


def body(played: Spans, at_ns: int, tau_s: float, final: float) -> float:
    """A first-order body that tends to ``final`` while on: exact, each span by itself."""
    total = 0.0
    for start_ns, end_ns in played:
        if start_ns < at_ns:
            end_ns = min(end_ns, at_ns)
            total += final * math.exp(-(at_ns - end_ns) / S / tau_s) * -math.expm1(-(end_ns - start_ns) / S / tau_s)
    return total


@given(spans, st.floats(97, 107), st.floats(59, 79), st.floats(1.28, 1.48))
def test_the_worst_account_is_never_below_any_actuator_within_tolerance(steps, tau_s, c_k_per_w, ohm):
    account = ThermalBudget(WORST.parameters, 25.0)
    played = on_spans(steps)
    for start_ns, end_ns in played:
        account.spend(WORST_PULSE_POWER_W * (end_ns - start_ns) / S, end_ns)
        for later_ns in (end_ns, end_ns + S, end_ns + 200 * S):
            ahead_k = account._look_ahead(later_ns)
            until = [span for span in played if span[1] <= end_ns]
            assert body(until, later_ns, tau_s, c_k_per_w * 25.0 / ohm) <= ahead_k * (1 + 1e-12)


@pytest.mark.parametrize("corner", [(tau, c, ohm) for tau in (97, 107) for c in (59, 79) for ohm in (1.28, 1.48)])
def test_at_the_corners_of_the_tolerance_too_and_not_by_much_at_the_warmest(corner):
    tau_s, c_k_per_w, ohm = corner
    account = ThermalBudget(WORST.parameters, 25.0)
    played: Spans = []
    now_ns, margin_k = 0, math.inf
    for _ in range(600):
        if account.allows(WORST_PULSE_POWER_W * 0.01, now_ns):
            played.append((now_ns, now_ns + 10_000_000))
            account.spend(WORST_PULSE_POWER_W * 0.01, played[-1][1])
            margin_k = min(margin_k, 25.0 - body(played[-400:], played[-1][1], tau_s, c_k_per_w * 25.0 / ohm))
        now_ns += S // 3
    assert margin_k >= 0.0
    if (c_k_per_w, ohm) == (79, 1.28):
        assert margin_k < 0.1 * 25.0  # tau from 97 to 107 s is 10 %: no more is given away


def test_a_body_whose_tau_is_known_is_its_own_bound():
    assert bounding(69.0, 102.0, 102.0) == ThermalParameters(tau_s=102.0, c_k_per_w=69.0)
    with pytest.raises(InputError, match=r"tau_low_s = 103 s"):
        bounding(69.0, 103.0, 102.0)


coils = st.builds(
    lambda tau_s, c, power_w: CoilHeat(ThermalParameters(tau_s=tau_s, c_k_per_w=c), power_w),
    st.floats(20, 500),
    st.floats(10, 300),
    st.floats(1, 40),
)


@given(coils, st.floats(0.05, BUILT_ON_TIME_S), st.lists(st.integers(0, 20 * S), min_size=1, max_size=20), st.data())
def test_whatever_a_host_admits_leaves_a_board_below_its_limit(coil, board_s, pauses_ns, data):
    """Greedy hosts: pulses back to back as long as they are admitted, pauses, and again; from any account taken over."""
    heat_s = data.draw(st.floats(0.0, board_s))
    account = ThermalBudget(coil.parameters, coil.limit_k(board_s), rise_k=coil.rise_k(heat_s))
    charged, last_ns, now_ns, max_s = heat_s, 0, 0, 0.0
    for pause_ns in pauses_ns:
        for _ in range(400):
            if not account.allows(coil.power_w * 0.01, now_ns):
                break
            end_ns = now_ns + 10_000_000
            account.spend(coil.power_w * 0.01, end_ns)
            charged = charged * math.exp(-(now_ns - last_ns) / S / BOARD_S) + 0.01
            max_s, last_ns, now_ns = max(max_s, charged), now_ns, end_ns
        now_ns += pause_ns
    assert max_s <= board_s


@given(coils, st.floats(12.0, 30.0))
def test_the_limit_that_a_board_is_given_is_the_least_that_does(coil, limit_k):
    on_time_s = coil.on_time_s(limit_k)
    assert coil.limit_k(on_time_s) == pytest.approx(limit_k, rel=1e-12)
    assert coil.limit_k(0.999 * on_time_s) < limit_k


@settings(max_examples=60)
@given(coils, spans)
def test_what_is_taken_over_covers_any_past_that_a_board_admits(coil, steps):
    """The past keeps to the board's own limit; what follows is looked at from every moment of it."""
    past: Spans = []
    for start_ns, end_ns in on_spans(steps):
        if body([*past, (start_ns, end_ns)], end_ns, BOARD_S, BOARD_S) <= BUILT_ON_TIME_S:
            past.append((start_ns, end_ns))
        heat_s = body(past, end_ns, BOARD_S, BOARD_S)
        now_k = body(past, end_ns, coil.parameters.tau_s, coil.parameters.c_k_per_w * coil.power_w)
        assert now_k <= coil.rise_k(heat_s) * (1 + 1e-9) + 1e-12


def test_a_slow_body_behind_a_small_account_was_at_the_limit_for_ever_and_then_left_alone():
    """The bound is reached, so that it cannot be lowered."""
    coil = CoilHeat(ThermalParameters(tau_s=204.0, c_k_per_w=69.0), 18.0)
    left_s = 300.0
    ever = BUILT_ON_TIME_S / BOARD_S * 69.0 * 18.0  # steady on-time of A / tau_b
    heat_s = BUILT_ON_TIME_S * math.exp(-left_s / BOARD_S)
    assert coil.rise_k(heat_s) == pytest.approx(ever * math.exp(-left_s / 204.0), rel=1e-12)


def test_the_constants_are_those_of_the_protocol_and_of_the_stated_tolerance():
    assert (BOARD_TAU_S, BUILT_ON_TIME_S) == (102.0, 2.5)
    assert MARGIN == 0.01
    assert WORST.jump_k_per_s == pytest.approx(79 / 97 * 25 / 1.28)
    assert CoilHeat().jump_k_per_s * BUILT_ON_TIME_S == pytest.approx(30.4, abs=0.05)  # a nominal tactor at the board's limit

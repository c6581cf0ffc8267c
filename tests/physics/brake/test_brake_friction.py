"""Implicit friction: exact solutions, order of convergence, and energy that never grows by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from haptics.physics.brake.finger import FINGER, finger_parameters
from haptics.physics.brake.kernel import coulomb, lugre

FRICTIONS = {"coulomb": coulomb, "lugre": lugre}
steps = st.floats(math.log10(1e-6), -1.0).map(lambda power: 10.0**power)
fingers = st.tuples(
    st.floats(1e-3, 10.0),  # mass
    st.floats(0.0, 50.0),  # damping
    st.floats(1.0, 3e5),  # hand
    st.floats(0.0, 500.0),  # its damping
    st.floats(0.0, 5e-3),  # slack
    st.floats(10.0, 3e5),  # strips
)


def energy_j(y: float, v: float, tension_n: float, hand_m: float, p: tuple[float, ...]) -> float:
    mass, _, k_l, _, _, k_s = p
    return 0.5 * mass * v * v + 0.5 * k_l * (hand_m - y) ** 2 + 0.5 * tension_n**2 / k_s


@pytest.mark.parametrize("friction", FRICTIONS)
@settings(max_examples=150, deadline=None)
@given(
    p=fingers,
    h=steps,
    v0=st.floats(-2, 2),
    speed=st.floats(-0.5, 0.5),
    forces=st.lists(st.floats(0, 50), min_size=5, max_size=40),
)
def test_energy_never_grows_by_itself(friction, p, h, v0, speed, forces) -> None:
    """Any parameters, any step, a capacity that jumps: what is stored grows by no more than the hand's work."""
    step = FRICTIONS[friction]
    y, v, s, tension, hand_m = 0.0, v0, 0.0, 0.0, 0.0
    stored = energy_j(y, v, tension, hand_m, p)
    for force_n in forces:
        after_m = hand_m + speed * h
        y, v, s, tension = step(y, v, s, force_n, after_m, speed, h, p)
        work = (p[2] * (after_m - y) + p[3] * (speed - v)) * (after_m - hand_m)
        now = energy_j(y, v, tension, after_m, p)
        # Rounding: of the energies, and of positions, a few ulp of which are a force that acts along the way of the step.
        rounding_n = 1e-15 * (p[2] + p[5]) * (abs(after_m) + abs(y) + p[4])
        moved_m = abs(after_m - hand_m) + h * (abs(v) + abs(speed))
        assert now <= stored + work + 1e-12 * (stored + abs(work) + now) + rounding_n * moved_m
        assert 0.0 <= tension <= force_n
        assert s >= 0.0
        assert math.isfinite(y + v + s)
        stored, hand_m = now, after_m


@pytest.mark.parametrize("friction", FRICTIONS)
@settings(max_examples=60, deadline=None)
@given(p=fingers, h=steps)
def test_a_hand_that_stands_still_comes_to_rest(friction, p, h) -> None:
    """After two hundred steps of whatever length nothing is faster than it began."""
    y, v, s, tension = 0.0, 0.3, 0.0, 0.0
    first = energy_j(y, v, tension, 0.0, p)
    for _ in range(200):
        y, v, s, tension = FRICTIONS[friction](y, v, s, 3.0, 0.0, 0.0, h, p)
    assert energy_j(y, v, tension, 0.0, p) <= first * (1 + 1e-12)


def run(step, h, time_s, force_n, hand_speed, p):
    y, v, s, tension = 0.0, 0.0, 0.0, 0.0
    for k in range(round(time_s / h)):
        y, v, s, tension = step(y, v, s, force_n, hand_speed * (k + 1) * h, hand_speed, h, p)
    return y, v, s, tension


P = finger_parameters(FINGER.with_values(slack_m=0.0))
HAND_M_S, CAPACITY_N = 0.05, 2.0


def under_a_steady_hand(t, y0, v0, hand_m, stiffness, pull_n):
    """Exact ``m y'' + (c + c_l) y' + stiffness y = k_l (hand + V t) + c_l V + pull``, under-damped: position and speed."""
    mass, c, k_l, c_l, _, _ = P
    v_p = k_l * HAND_M_S / stiffness
    b = (k_l * hand_m + c_l * HAND_M_S + pull_n - (c + c_l) * v_p) / stiffness
    decay = (c + c_l) / (2 * mass)
    omega = math.sqrt(stiffness / mass - decay**2)
    a1, a2 = y0 - b, (v0 - v_p + decay * (y0 - b)) / omega
    e, co, si = math.exp(-decay * t), math.cos(omega * t), math.sin(omega * t)
    return v_p * t + b + e * (a1 * co + a2 * si), v_p + e * (-decay * (a1 * co + a2 * si) + omega * (a2 * co - a1 * si))


def assert_first_order(errors, last):
    """Halving the step halves the error, within what an event's place in a step leaves open."""
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.1)
    assert errors[2] / errors[1] == pytest.approx(0.5, abs=0.1)
    assert errors[2] < last


def test_sticking_is_the_linear_oscillator_in_first_order() -> None:
    exact, _ = under_a_steady_hand(0.02, 0.0, 0.0, 0.0, P[2] + P[5], 0.0)
    assert_first_order([abs(run(coulomb, h, 0.02, 100.0, HAND_M_S, P)[0] - exact) for h in (20e-6, 10e-6, 5e-6)], 1e-7)


def test_stick_then_slip_at_constant_capacity_is_the_exact_solution_in_first_order() -> None:
    """Both springs until T = F, at a time found by bisection, then the hand's alone against F."""
    k_l, k_s = P[2], P[5]

    def reached(t):
        return k_s * under_a_steady_hand(t, 0.0, 0.0, 0.0, k_l + k_s, 0.0)[0] >= CAPACITY_N

    high = next(t for t in np.linspace(0.0, 1.0, 50_001) if reached(t))
    low = high - 2e-5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(middle) else (middle, high)
    y1, v1 = under_a_steady_hand(high, 0.0, 0.0, 0.0, k_l + k_s, 0.0)
    t = round(high + 0.005, 4)
    y, _ = under_a_steady_hand(t - high, y1, v1, HAND_M_S * high, k_l, -CAPACITY_N)
    slip_m = y - CAPACITY_N / k_s
    assert slip_m > 5e-5
    assert run(coulomb, 5e-6, t, CAPACITY_N, HAND_M_S, P)[3] == CAPACITY_N
    assert_first_order([abs(run(coulomb, h, t, CAPACITY_N, HAND_M_S, P)[2] - slip_m) for h in (20e-6, 10e-6, 5e-6)], 1e-6)


@settings(max_examples=150)
@given(fingers, steps, st.floats(-1e-2, 1e-2), st.floats(-1, 1), st.floats(1e-3, 50), st.floats(-0.02, 0.02))
def test_the_bristle_step_solves_its_own_equations(p, h, y, v, force_n, hand_m) -> None:
    """Put back into ``m (v1 - v)/h = ... - T1`` and ``z1 (1 + h |v1| k / F) = z + h v1``, or T1 = 0 where that is negative."""
    mass, c, k_l, c_l, slack, k_s = p
    s = max(0.0, y - slack - force_n / k_s)
    y1, v1, _, tension = lugre(y, v, s, force_n, hand_m, 0.0, h, p)
    terms = [mass / h * (v1 - v), k_l * (hand_m - y1), -(c_l + c) * v1, -tension]
    scale = mass / h * (abs(v1) + abs(v)) + k_l * (abs(hand_m) + abs(y1) + abs(y)) + (c + c_l) * abs(v1) + k_s * abs(h * v1) + 1.0
    assert abs(terms[0] - sum(terms[1:])) < 1e-9 * scale
    z1 = (y - s - slack + h * v1) / (1 + h * abs(v1) * k_s / force_n)
    assert tension == pytest.approx(min(max(0.0, k_s * z1), force_n), abs=1e-9 * scale)


def test_bristles_approach_the_capacity_exponentially() -> None:
    """A finger that is dragged at constant speed: ``T = F (1 - exp(-k x / F))``, exact for bristles without damping."""
    stiff = finger_parameters(
        FINGER.with_values(load_stiffness_n_m=3e5, load_damping_n_s_m=1e4, finger_mass_kg=1e-3, slack_m=0.0)
    )
    y, v, s, tension, h = 0.0, 0.01, 0.0, 0.0, 1e-5
    for k in range(5000):
        y, v, s, tension = lugre(y, v, s, 2.0, 0.01 * (k + 1) * h, 0.01, h, stiff)
        if k % 500 == 499:
            assert tension == pytest.approx(2.0 * -math.expm1(-4e3 * y / 2.0), abs=2e-3)


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("h", [1e-6, 1e-4, 1e-3, 1e-2])
def test_taut_and_slack_do_not_alternate(friction, h) -> None:
    """A slow pull out of the slack becomes taut once and stays so."""
    p = finger_parameters(FINGER)
    y, v, s, tension, changes, taut = 0.98e-3, 0.0, 0.0, 0.0, 0, False
    for k in range(300):
        speed = 2e-3 * max(h, 1e-4) / h  # at the shortest steps faster, to get somewhere
        y, v, s, tension = FRICTIONS[friction](y, v, s, 5.0, 0.98e-3 + speed * (k + 1) * h, speed, h, p)
        changes += (tension > 0.0) != taut
        taut = tension > 0.0
    assert changes <= 1


def test_no_capacity_holds_nothing() -> None:
    for step in FRICTIONS.values():
        y, _, s, tension = step(0.0, 0.1, 0.0, 0.0, 0.02, 0.0, 1e-3, P)
        assert tension == 0.0
        assert y > 0.0
        assert s == pytest.approx(y, rel=1e-9) or s == 0.0

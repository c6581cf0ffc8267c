"""Closed forms of pulse trains against pulse-by-pulse brute force."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given, strategies as st

from haptics.errors import InputError
from haptics.physics.thermal.one_node import pulse_rise_k
from haptics.physics.thermal.trains import (
    GUARD,
    admitted_of,
    allowed_now,
    first_denied_index,
    min_spacing_s,
    predict_thermal,
    train_rise_k,
    wait_s,
)

TAU = 102.0
jumps = st.floats(0.05, 3.0)
spacings = st.floats(0.05, 200.0)
limits = st.floats(0.5, 40.0)
starts = st.floats(-3.0, 40.0)


def play(asked, jump_k, spacing_s, limit_k, start_rise_k=0.0):
    """Pulse by pulse: which are admitted, and the closest any decision came to the limit, relative."""
    rise_k, admitted, closest = start_rise_k, [], math.inf
    for k in range(asked):
        after_k = rise_k + jump_k
        closest = min(closest, abs(after_k - limit_k) / limit_k)
        if after_k <= limit_k * (1 + GUARD):
            rise_k = after_k
            admitted.append(k)
        rise_k *= math.exp(-spacing_s / TAU)
    return admitted, closest


@given(st.integers(1, 300), jumps, spacings, limits, starts)
def test_first_denied_and_admitted_match_brute_force(asked, jump_k, spacing_s, limit_k, start_k):
    admitted, closest = play(asked, jump_k, spacing_s, limit_k, start_k)
    # A decision nearer to the limit than rounding over the train can go to either side.
    assume(closest > 1e-11)
    assert admitted_of(asked, jump_k, spacing_s, limit_k, start_k) == len(admitted)
    denied = first_denied_index(jump_k, spacing_s, limit_k, start_k)
    expected = next((k for k in range(asked) if k not in set(admitted)), None)
    assert (denied if denied is not None and denied < asked else None) == expected


@given(st.integers(0, 200), jumps, spacings, starts)
def test_peak_trough_and_mean_match_brute_force(index, jump_k, spacing_s, start_k):
    rise_k = start_k
    for _ in range(index):
        rise_k = (rise_k + jump_k) * math.exp(-spacing_s / TAU)
    peak_k = rise_k + jump_k
    peak, mean, trough = train_rise_k(jump_k, spacing_s, index, start_k)
    assert peak == pytest.approx(peak_k, rel=1e-11, abs=1e-11)
    assert trough == pytest.approx(peak_k * math.exp(-spacing_s / TAU), rel=1e-11, abs=1e-11)
    steps = 20_000  # midpoint rule: error (spacing/tau)^2 / 24 / steps^2
    by_hand = sum(peak_k * math.exp(-(n + 0.5) / steps * spacing_s / TAU) for n in range(0, steps, 100)) * 100 / steps
    assert mean == pytest.approx(by_hand, rel=1e-2, abs=1e-9)
    assert min(peak, trough) - 1e-9 <= mean <= max(peak, trough) + 1e-9


def test_the_published_rates():
    # 69 K/W times mean power: thesis 3.5.2 gives 25 and 10.1 K.
    assert predict_thermal(120).mean_rise_k == pytest.approx(24.84, rel=1e-12)
    assert predict_thermal(49).mean_rise_k == pytest.approx(10.143, rel=1e-12)
    assert predict_thermal(120).peak_rise_k - predict_thermal(120).trough_rise_k == pytest.approx(pulse_rise_k(), rel=1e-12)


def test_steady_state_is_where_a_long_train_ends():
    forever, long = predict_thermal(90.0), predict_thermal(90.0, minutes=60.0)
    for name in ("mean_rise_k", "peak_rise_k", "trough_rise_k"):
        assert getattr(long, name) == pytest.approx(getattr(forever, name), rel=1e-12)  # exp(-35)


def test_the_first_denied_pulse_at_two_hertz_under_20_kelvin():
    prediction = predict_thermal(120, limit_k=20.0, minutes=30)
    admitted, _ = play(3601, pulse_rise_k(), 0.5, 20.0)
    first = next(k for k in range(3601) if k not in set(admitted))
    assert prediction.asked == 3601
    assert (prediction.first_denied_index, prediction.first_denied_s) == (first, first * 0.5)
    assert prediction.admitted == len(admitted)


def test_a_limit_that_is_never_met_denies_nothing():
    prediction = predict_thermal(120, limit_k=25.0, minutes=10)
    assert prediction.first_denied_index is None
    assert prediction.admitted == prediction.asked == 1201


@given(jumps, limits)
def test_the_least_spacing_is_sustainable_and_less_is_not(jump_k, limit_k):
    assume(jump_k < 0.99 * limit_k)
    spacing_s = min_spacing_s(jump_k, limit_k)
    assert train_rise_k(jump_k, spacing_s)[0] == pytest.approx(limit_k, rel=1e-12)
    assert first_denied_index(jump_k, spacing_s * (1 + 1e-9), limit_k) is None
    assert first_denied_index(jump_k, spacing_s * (1 - 1e-6), limit_k) is not None


def test_the_greatest_rate_of_a_prediction_is_the_least_spacing():
    prediction = predict_thermal(120, limit_k=20.0)
    assert prediction.max_rate_per_min == pytest.approx(60 / min_spacing_s(pulse_rise_k(), 20.0), rel=1e-15)
    assert predict_thermal(prediction.max_rate_per_min * (1 - 1e-9), limit_k=20.0).first_denied_index is None


@given(st.floats(0, 40), st.integers(1, 60), st.floats(0.05, 0.6), limits)
def test_after_the_wait_that_many_are_allowed_and_just_before_they_are_not(rise_k, count, jump_k, limit_k):
    wait = wait_s(rise_k, count, jump_k, limit_k)
    if math.isinf(wait):
        assert count * jump_k >= limit_k * (1 - 1e-9)
        return
    assert allowed_now(rise_k * math.exp(-wait * (1 + 1e-9) / TAU) * (1 - 1e-9), jump_k, limit_k) >= count
    if wait > 1e-3:
        assert allowed_now(rise_k * math.exp(-wait * 0.999 / TAU), jump_k, limit_k) < count


def test_a_jump_above_the_limit_is_never_allowed():
    assert min_spacing_s(2.0, 1.0) == math.inf
    assert first_denied_index(2.0, 1.0, 1.0) == 0
    assert admitted_of(100, 2.0, 1.0, 1.0) == 0
    assert wait_s(0.5, 1, 2.0, 1.0) == math.inf


def test_a_jump_equal_to_the_limit_is_allowed_once():
    assert admitted_of(1000, 1.0, 1.0, 1.0) == 1


def test_bursts_every_five_seconds_stay_cool():
    # Thesis 3.5.2: 200 Hz for 50 ms every 5 s. 0.9 J / 5 s = 0.18 W, 12.4 K.
    prediction = predict_thermal(burst_s=50e-3, burst_hz=200.0, every_s=5.0, limit_k=25.0)
    assert prediction.energy_j == pytest.approx(0.9)
    assert prediction.mean_rise_k == pytest.approx(12.42, rel=1e-12)
    assert prediction.first_denied_index is None
    assert 60 / prediction.max_rate_per_min == pytest.approx(min_spacing_s(5 * pulse_rise_k(), 25.0))


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"rate_per_min": 10, "burst_s": 0.05, "every_s": 5},
        {"rate_per_min": -1},
        {"rate_per_min": math.nan},
        {"rate_per_min": 10, "limit_k": 0},
        {"rate_per_min": 10, "minutes": -1},
        {"rate_per_min": 10, "pulse_s": 7.0},
        {"burst_s": 1.0, "every_s": 0.5},
    ],
)
def test_nonsense_is_refused(arguments):
    with pytest.raises(InputError):
        predict_thermal(**arguments)

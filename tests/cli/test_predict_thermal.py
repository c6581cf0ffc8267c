"""``haptics predict thermal`` against the heat figures of thesis 3.5.2, and against the recurrence taken pulse by pulse."""

from __future__ import annotations

import math

import pytest

TAU_S = 102.0
C_K_PER_W = 69.0
JUMP_K = 18.0 * 0.010 * C_K_PER_W / TAU_S  # one 10 ms switch at 18 W


def pulse_by_pulse(rate_per_min, limit_k, minutes):
    """First denied index and number admitted, a denied pulse being dropped."""
    rise_k, admitted, first = 0.0, 0, None
    count = math.floor(minutes * rate_per_min + 1e-9) + 1
    for index in range(count):
        if rise_k + JUMP_K <= limit_k:
            rise_k, admitted = rise_k + JUMP_K, admitted + 1
        elif first is None:
            first = index
        rise_k *= math.exp(-60.0 / rate_per_min / TAU_S)
    return first, admitted


def test_the_answer_has_the_promised_keys(answer):
    keys = {"mean_rise_k", "peak_rise_k", "trough_rise_k", "first_denied_index", "first_denied_s", "admitted", "max_rate_per_min"}
    assert keys <= set(answer("predict", "thermal", "--rate-per-min", 120, "--limit-k", 20))


@pytest.mark.parametrize(("rate_per_min", "mean_k"), [(120, 24.84), (49, 10.14)])
def test_mean_rise_of_the_published_rates(answer, rate_per_min, mean_k):
    told = answer("predict", "thermal", "--rate-per-min", rate_per_min)
    assert told["mean_rise_k"] == pytest.approx(mean_k, abs=0.005)  # two decimals
    assert told["trough_rise_k"] < told["mean_rise_k"] < told["peak_rise_k"]
    assert told["peak_rise_k"] - told["trough_rise_k"] == pytest.approx(JUMP_K, rel=1e-9)


def test_bursts_of_the_published_pattern_hold_ten_pulses_of_five_milliseconds(answer):
    told = answer("predict", "thermal", "--burst-ms", 50, "--burst-hz", 200, "--every-s", 5)
    assert told["mean_rise_k"] == pytest.approx(C_K_PER_W * 18.0 * 0.050 / 5.0)
    assert told["peak_rise_k"] - told["trough_rise_k"] == pytest.approx(18.0 * 0.050 * C_K_PER_W / TAU_S)


@pytest.mark.parametrize(
    ("rate_per_min", "limit_k", "minutes"), [(120, 20.0, 5.0), (120, 25.0, 30.0), (300, 20.0, 10.0), (49, 20.0, 10.0)]
)
def test_denials_are_those_of_the_recurrence(answer, rate_per_min, limit_k, minutes):
    told = answer("predict", "thermal", "--rate-per-min", rate_per_min, "--limit-k", limit_k, "--minutes", minutes)
    first, admitted = pulse_by_pulse(rate_per_min, limit_k, minutes)
    assert told["first_denied_index"] == first
    assert told["admitted"] == admitted
    assert told["first_denied_s"] == (None if first is None else pytest.approx(first * 60.0 / rate_per_min))


def test_the_greatest_rate_is_just_sustainable(answer):
    fastest = answer("predict", "thermal", "--rate-per-min", 120, "--limit-k", 20)["max_rate_per_min"]
    assert fastest < 120
    assert answer("predict", "thermal", "--rate-per-min", fastest * 0.9999, "--limit-k", 20)["first_denied_index"] is None
    assert answer("predict", "thermal", "--rate-per-min", fastest * 1.001, "--limit-k", 20)["first_denied_index"] is not None
    assert answer("predict", "thermal", "--rate-per-min", fastest)["peak_rise_k"] == pytest.approx(20.0)


def test_what_has_no_answer_is_null(answer):
    told = answer("predict", "thermal", "--rate-per-min", 49, "--limit-k", 20)
    assert told["first_denied_index"] is None
    assert told["first_denied_s"] is None
    assert answer("predict", "thermal", "--rate-per-min", 60, "--pulse-ms", 0, "--limit-k", 20)["max_rate_per_min"] is None


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((), "--rate-per-min"),
        (("--rate-per-min", 120, "--burst-ms", 50, "--every-s", 5), "--rate-per-min"),
        (("--burst-ms", 50), "--every-s"),
        (("--burst-ms", 50, "--every-s", 0.01), "--every-s"),
        (("--rate-per-min", 0), "--rate-per-min"),
        (("--rate-per-min", "nan"), "--rate-per-min"),
        (("--rate-per-min", "fast"), "rate-per-min"),
        (("--rate-per-min", 120, "--limit-k", -3), "--limit-k"),
        (("--rate-per-min", 120, "--pulse-ms", -1), "--pulse-ms"),
        (("--rate-per-min", 120, "--minutes", -1), "minutes"),
    ],
)
def test_nonsense_is_refused_by_name(refused, arguments, word):
    assert word in refused("predict", "thermal", *arguments)

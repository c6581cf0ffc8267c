"""``haptics predict latch`` against the drive and flight figures of thesis 3.4.3, 3.4.5 and 3.5.1."""

from __future__ import annotations

import pytest


def test_the_answer_has_the_promised_keys(answer):
    assert {"switched", "arrival_ms", "impact_m_s", "energy_j", "valid", "reasons"} <= set(answer("predict", "latch"))


def test_the_published_flight_back_takes_six_milliseconds(answer):
    told = answer("predict", "latch", "--direction", "on-off", "--volts", 5)
    assert told["switched"] is True
    assert told["arrival_ms"] == pytest.approx(6.0, abs=0.05)  # stated to the millisecond; half of the next digit's ten
    assert told["impact_m_s"] > 0
    assert told["valid"] is True


def test_one_switch_costs_what_volts_and_ohms_say(answer):
    told = answer("predict", "latch", "--pulse-ms", 10)
    # 5 V across 1.38 ohm for 10 ms (3.4.3), less what the moving pin gives back
    assert told["energy_j"] == pytest.approx(5.0**2 / 1.38 * 0.010, rel=0.02)


def test_a_pulse_too_short_does_not_switch_and_has_no_arrival(answer):
    told = answer("predict", "latch", "--pulse-ms", 0.5)
    assert told["switched"] is False
    assert told["arrival_ms"] is None
    assert told["impact_m_s"] is None
    assert told["valid"] is True


@pytest.mark.parametrize("direction", ["off-on", "on-off"])
def test_the_least_pulse_divides_those_that_switch_from_those_that_do_not(answer, direction):
    min_ms = answer("predict", "latch", "--direction", direction)["min_pulse_ms"]
    assert answer("predict", "latch", "--direction", direction, "--pulse-ms", 1.03 * min_ms)["switched"] is True
    assert answer("predict", "latch", "--direction", direction, "--pulse-ms", 0.97 * min_ms)["switched"] is False


def test_volts_that_never_switch_have_no_least_pulse(answer):
    told = answer("predict", "latch", "--volts", 0)
    assert told["switched"] is False
    assert told["min_pulse_ms"] is None


@pytest.mark.parametrize("arguments", [("--pulse-ms", 12), ("--volts", 8)])
def test_beyond_the_stated_drive_there_is_an_answer_that_is_not_valid(answer, arguments):
    told = answer("predict", "latch", *arguments)
    assert told["valid"] is False
    assert told["reasons"]


@pytest.mark.parametrize("level", ["event", "dynamic"])
def test_both_levels_answer_alike_for_the_stated_drive(answer, level):
    told = answer("predict", "latch", "--level", level, "--direction", "on-off")
    assert told["level"] == level
    assert told["arrival_ms"] == pytest.approx(6.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--pulse-ms", -1), "--pulse-ms"),
        (("--pulse-ms", "nan"), "--pulse-ms"),
        (("--pulse-ms", 20_000), "--pulse-ms"),
        (("--volts", -5), "volts"),
        (("--direction", "up"), "direction"),
        (("--level", "exact"), "level"),
        (("--rise-k", "inf"), "--rise-k"),
    ],
)
def test_nonsense_is_refused_by_name(refused, arguments, word):
    assert word in refused("predict", "latch", *arguments)

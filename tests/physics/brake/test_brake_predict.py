from __future__ import annotations

import itertools
import math

import pytest

from haptics.errors import InputError
from haptics.physics.brake.predict import predict_brake, predict_volts


def test_the_figures_of_the_thesis():
    p = predict_brake(1500.0, "index", frequency_hz=20.0)
    assert p.valid
    assert p.reasons == ()
    assert p.capacitance_f == pytest.approx(2.547e-9, abs=0.5e-12)
    assert p.compression_ideal_n == pytest.approx(220.0, abs=0.5)
    assert p.friction_ideal_n == pytest.approx(44.0, abs=0.1)
    assert p.power_eq44_w == pytest.approx(57.3e-3, abs=0.05e-3)
    assert p.field_v_per_um == pytest.approx(115.4, abs=0.05)
    assert p.force_n == pytest.approx(20.0, rel=0.1)
    assert 0 < p.force_sd_n < 2.0
    assert p.amplitude_v == pytest.approx(1500.0, rel=1e-6)
    assert p.supply_power_w > 2 * p.power_eq44_w


def test_the_thumb_extrapolates_to_15_newton():
    assert predict_brake(1500.0, "thumb").force_n == pytest.approx(14.8, abs=0.1)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"volts": 1600.0}, "measured"),
        ({"volts": 1000.0, "thickness_m": 5e-6}, "controller"),
        ({"volts": 1000.0, "thickness_m": 3e-6}, "breakdown"),
        ({"volts": 2500.0, "thickness_m": 50e-6}, "supply's 2000"),
        ({"volts": 1500.0, "frequency_hz": 70.0}, "full swing"),
        ({"volts": 1500.0, "frequency_hz": 40.0, "clutches": 2}, "full swing"),
        ({"volts": 100.0, "frequency_hz": 1500.0}, "full swing"),
        ({"volts": 500.0, "frequency_hz": 0.0}, "charge behind"),
    ],
)
def test_beyond_the_valid_range_the_answer_says_why(arguments, word):
    p = predict_brake(**arguments)
    assert not p.valid
    assert any(word in reason for reason in p.reasons)


def test_past_breakdown_there_is_no_force():
    p = predict_brake(1000.0, thickness_m=3e-6)
    assert p.force_n == p.force_sd_n == 0.0


def test_force_is_that_of_the_amplitude_reached():
    slow, fast = predict_brake(1500.0, frequency_hz=20.0), predict_brake(1500.0, frequency_hz=200.0)
    assert fast.amplitude_v < 500.0
    assert fast.force_n == pytest.approx(predict_brake(fast.amplitude_v).force_n, rel=1e-6)
    assert fast.force_n < slow.force_n / 5


def test_two_brakes_on_one_supply_charge_half_as_fast():
    one, two = predict_brake(1000.0), predict_brake(1000.0, clutches=2)
    assert two.t90_ms == pytest.approx(2 * one.t90_ms, rel=0.06)  # stray is shared
    assert two.supply_power_w > 1.8 * one.supply_power_w
    assert two.force_n == pytest.approx(one.force_n)


@pytest.mark.parametrize(
    ("finger", "law", "force_n"),
    list(itertools.product(("index", "thumb"), ("ideal", "threshold", "closing_gap"), (1.0, 4.0, 12.0))),
)
def test_the_inverse_gives_the_force(finger, law, force_n):
    p = predict_volts(force_n, finger, law=law)
    assert p.valid
    assert p.force_n == pytest.approx(force_n, rel=1e-4)


def test_extremes_of_geometry_answer_finitely():
    for overlap, thickness, volts in itertools.product((0.0, 1e-9, 1.0), (1e-6, 1e-3), (0.0, 1e-3, 300.0, 1e5)):
        p = predict_brake(volts, overlap_m2=overlap, thickness_m=thickness)
        assert math.isfinite(p.force_n)
        assert math.isfinite(p.supply_power_w)
        assert p.amplitude_v <= max(volts, 0.0)


@pytest.mark.parametrize(
    "arguments",
    [
        {"volts": -1.0},
        {"volts": math.nan},
        {"volts": 100.0, "finger": "ring"},
        {"volts": 100.0, "law": "best"},
        {"volts": 100.0, "strips": 0},
        {"volts": 100.0, "overlap_m2": -1e-4},
        {"volts": 100.0, "thickness_m": 0.0},
        {"volts": 100.0, "frequency_hz": -5.0},
        {"volts": 100.0, "permittivity": 0.5},
    ],
)
def test_nonsense_is_refused(arguments):
    with pytest.raises(InputError):
        predict_brake(**arguments)
    with pytest.raises(InputError):
        predict_volts(-1.0)

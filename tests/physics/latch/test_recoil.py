"""The recoil envelope against the published peak and decay times (thesis 3.5.1), as they would be read off an accelerometer."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.pulse import switch
from haptics.physics.latch.recoil import RECOIL, SAMPLE_RATE_HZ, SURFACES, predict_recoil, recoil_m_s2
from haptics.physics.parameters import provenance

G = 9.80665
TAUS_S = {"bare": 5.9e-3, "silicone": 4.1e-3, "foam": 1.8e-3}


@pytest.mark.parametrize("surface", SURFACES)
def test_peak_and_decay_are_the_published_ones(surface):
    assert recoil_m_s2(0.0, surface) == pytest.approx(10 * G, rel=1e-15)
    assert recoil_m_s2(TAUS_S[surface], surface) == pytest.approx(10 * G / math.e, rel=1e-15)


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("seed", range(3))
def test_the_decay_time_is_found_again_in_twenty_noisy_switches(surface, seed):
    # As measured: 20 switches at 3200 Hz, each as loud as it happens to be, aligned, averaged; then ln a = ln a0 - t/tau.
    generator = np.random.default_rng(seed)
    answer = predict_recoil(surface, length_s=4 * TAUS_S[surface])
    times_s, clean = np.array(answer.times_s), np.array(answer.acceleration_m_s2)
    loudness, noise = generator.normal(1, 0.1, (20, 1)), generator.normal(0, 0.3, (20, times_s.size))
    mean = np.mean(loudness * clean + noise, axis=0)
    # One sample's logarithm is off by noise / sqrt(20) / signal; weights and the slope's uncertainty follow from it.
    sd = 0.3 / math.sqrt(20) / clean
    (slope, _), covariance = np.polyfit(times_s, np.log(mean), 1, w=1 / sd, cov="unscaled")
    tau_s = -1 / slope
    tau_sd_s = math.sqrt(covariance[0, 0]) * tau_s**2
    assert tau_sd_s < 0.01 * tau_s
    assert tau_s == pytest.approx(TAUS_S[surface], abs=4 * tau_sd_s)


def test_samples_are_those_of_the_accelerometer():
    answer = predict_recoil("foam", length_s=10e-3)
    assert answer.sample_rate_hz == SAMPLE_RATE_HZ == 3200.0
    assert len(answer.times_s) == 33  # 10 ms are 32 intervals
    assert np.diff(answer.times_s) == pytest.approx(np.full(32, 1 / 3200), rel=1e-12)
    assert answer.times_s[0] == 0.0
    assert list(answer.acceleration_m_s2) == pytest.approx([10 * G * math.exp(-k / 3200 / 1.8e-3) for k in range(33)], rel=1e-14)
    assert len(predict_recoil("foam", length_s=0.0).times_s) == 1
    # 0.29 s at 100 Hz is a hair below 29 intervals in binary; it must not cost the last one.
    assert len(predict_recoil("foam", length_s=0.29, sample_rate_hz=100.0).times_s) == 30


def test_limits():
    assert recoil_m_s2(-1e-12, "bare") == 0.0
    assert recoil_m_s2(-math.ulp(1.0), "bare") == 0.0
    assert recoil_m_s2(1e6, "bare") == 0.0
    assert recoil_m_s2(0.0, "bare", relative_speed=0.0, extrapolate=True) == 0.0
    assert predict_recoil("bare", relative_speed=0.0).above_tenth_s == 0.0


def test_softer_landings_die_sooner_from_the_same_peak():
    for harder, softer in itertools.pairwise(SURFACES):
        assert recoil_m_s2(0.0, harder) == recoil_m_s2(0.0, softer)
        assert recoil_m_s2(3e-3, harder) > recoil_m_s2(3e-3, softer)


def test_the_peak_goes_with_impact_speed_and_says_that_this_is_assumed():
    answer = predict_recoil("silicone", relative_speed=0.5)
    assert answer.peak_g == pytest.approx(5.0, rel=1e-15)
    assert not answer.valid
    assert "by assumption" in answer.reasons[0]
    assert predict_recoil("silicone").valid
    squared = RECOIL.with_values(speed_power=2.0)
    assert recoil_m_s2(1e-3, "bare", 0.5, squared, extrapolate=True) == pytest.approx(recoil_m_s2(1e-3, "bare") / 4, rel=1e-15)
    assert {row.name: row.provenance for row in provenance(RECOIL)}["speed_power"] == "assumed"


def test_the_bare_law_refuses_an_impact_that_was_not_measured() -> None:
    with pytest.raises(InputError, match=r"relative_speed = 0\.5.*nominal impact only.*extrapolate=True"):
        recoil_m_s2(0.0, "bare", 0.5)
    assert recoil_m_s2(0.0, "bare", 0.5, extrapolate=True) == pytest.approx(5.0 * G, rel=1e-15)


def test_time_above_a_tenth_is_when_the_envelope_gets_there():
    answer = predict_recoil("bare")
    assert recoil_m_s2(answer.above_tenth_s, "bare") == pytest.approx(answer.peak_m_s2 / 10, rel=1e-14)


def test_the_envelope_is_no_net_motion():
    # The momentum it would integrate to is far beyond what the magnet brings, so no speed may be had from it.
    impact_m_s = switch(10e-3, direction="on-off").impact_m_s
    assert impact_m_s is not None
    brought_n_s = LATCH.mass_kg * impact_m_s
    for surface in SURFACES:
        assert RECOIL.pendulum_kg * 10 * G * TAUS_S[surface] > 20 * brought_n_s


def test_nonsense_is_refused():
    for call, word in (
        (lambda: recoil_m_s2(0.0, "wood"), "bare, silicone, foam"),
        (lambda: predict_recoil("wood"), "surface"),
        (lambda: recoil_m_s2(math.nan, "bare"), "time_s"),
        (lambda: recoil_m_s2(-1.0, "bare", -1.0), "relative_speed"),
        (lambda: predict_recoil("bare", length_s=-1e-3), "length_s"),
        (lambda: predict_recoil("bare", length_s=2.0), "length_s"),
        (lambda: predict_recoil("bare", sample_rate_hz=0.0), "sample_rate_hz"),
        (lambda: RECOIL.with_values(tau_foam_s=0.0), "tau_foam_s"),
    ):
        with pytest.raises(InputError, match=word):
            call()

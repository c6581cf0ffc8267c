from __future__ import annotations

import itertools
import math

import pytest

from haptics.errors import InputError
from haptics.physics.piezo import GRASP_BURST_S, PIEZO, acceleration_m_s2, burst_energy_j, envelope


def test_a_grasp_costs_1800_microjoule():
    assert burst_energy_j() == pytest.approx(6e-3 * 0.3, rel=1e-15)


def test_full_vibration_is_the_published_acceleration():
    peak = max(abs(acceleration_m_s2(0.2 + k * 1e-5)) for k in range(1000))
    assert peak == pytest.approx(1.2 * 9.80665, rel=1e-3)  # 417 samples a period


def test_the_vibration_is_at_240_hertz():
    samples = [acceleration_m_s2(0.1 + k * 1e-5) for k in range(10_001)]
    rising = sum(1 for a, b in itertools.pairwise(samples) if a < 0 <= b)
    assert rising == pytest.approx(24, abs=1)  # a tenth of a second


def test_the_envelope_rises_holds_and_dies_away():
    assert envelope(-1.0) == envelope(0.0) == 0.0
    assert envelope(PIEZO.tau_s) == pytest.approx(1 - math.exp(-1), rel=1e-12)
    assert envelope(GRASP_BURST_S) == pytest.approx(1.0, rel=1e-12)
    assert envelope(GRASP_BURST_S + PIEZO.tau_s) == pytest.approx(math.exp(-1), rel=1e-12)
    assert envelope(1.0, burst_s=0.0) == 0.0


def test_a_negative_burst_is_refused():
    with pytest.raises(InputError):
        burst_energy_j(-1.0)
    with pytest.raises(InputError):
        envelope(0.1, -0.3)

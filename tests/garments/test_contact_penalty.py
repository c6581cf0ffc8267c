"""The contact penalty: nothing outside, eq. 5.3's parabola inside, no kink between."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.garments.equilibrium.contact import Contact

R = 20e-6


@pytest.fixture
def contact() -> Contact:
    return Contact(np.array([1000.0]), R)


def test_nothing_outside_and_beyond_reach(contact):
    for phi in (0.0, 1e-9, 0.01, np.inf):
        at = np.array([phi])
        assert contact.energy_j(at) == contact.slope_n(at) == contact.stiffness_n_m(at) == 0


def test_deep_inside_it_is_the_parabola_shifted_by_half_the_rounding(contact):
    s = 1e-3
    parabola = 0.5 * 1000 * (s - R / 2) ** 2
    assert contact.energy_j(np.array([-s]))[0] == pytest.approx(parabola, rel=1e-4)
    assert contact.slope_n(np.array([-s]))[0] == pytest.approx(-1000 * (s - R / 2))
    assert contact.stiffness_n_m(np.array([-s]))[0] == 1000


@pytest.mark.parametrize("depth", [2e-6, 15e-6, R - 1e-9, R + 1e-9, 50e-6])
def test_slope_and_stiffness_are_the_energys_derivatives(contact, depth):
    h = 1e-10
    low, high = np.array([-depth - h]), np.array([-depth + h])
    assert (contact.energy_j(high) - contact.energy_j(low)) / (2 * h) == pytest.approx(
        contact.slope_n(np.array([-depth])), rel=1e-4
    )
    difference = (contact.slope_n(high) - contact.slope_n(low)) / (2 * h)
    assert difference == pytest.approx(contact.stiffness_n_m(np.array([-depth])), rel=1e-4)


def test_two_derivatives_are_continuous_where_it_sets_in_and_where_it_is_full(contact):
    for at in (0.0, -R):
        below, above = np.array([at - 1e-12]), np.array([at + 1e-12])
        assert contact.energy_j(below) == pytest.approx(contact.energy_j(above), abs=1e-13)
        assert contact.slope_n(below) == pytest.approx(contact.slope_n(above), abs=1e-8)
        assert contact.stiffness_n_m(below) == pytest.approx(contact.stiffness_n_m(above), abs=1e-3)

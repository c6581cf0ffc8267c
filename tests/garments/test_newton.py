"""Newton's method on energies whose minimum is known."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.errors import HapticsError
from haptics.garments.equilibrium.cholesky import NotDefinite
from haptics.garments.equilibrium.newton import LARGEST_STEP_M, equilibrium

AREA_M2 = 1e-5
"""Of the one vertex: damping is a stiffness per area."""


class Dense:
    """A dense Cholesky that counts."""

    name = "dense"

    def __init__(self):
        self.factored = 0

    def factorise(self, values):
        try:
            self._root = np.linalg.cholesky(values)
        except np.linalg.LinAlgError as error:
            raise NotDefinite(str(error)) from error
        self.factored += 1

    def solve(self, right):
        return np.linalg.solve(self._root.T, np.linalg.solve(self._root, right))


class Well:
    """One vertex in the energy f(r) around the origin, by its distance r: f, f', f''."""

    def __init__(self, f, slope, bend):
        self.f, self.slope, self.bend = f, slope, bend

    def __call__(self, x):
        return WellState(self, x)


class WellState:
    def __init__(self, well, x):
        self.well, self.positions_m = well, x
        self.r = np.linalg.norm(x)
        self.energy_j = float(well.f(self.r))
        self.force_n = well.slope(self.r) * x / self.r

    def stiffness(self, damping_n_m3):
        along = (self.positions_m / self.r).ravel()
        out = np.outer(along, along)
        matrix = self.well.bend(self.r) * out + self.well.slope(self.r) / self.r * (np.eye(3) - out)
        return matrix + damping_n_m3 * AREA_M2 * np.eye(3)

    def after(self, step_m):
        return self.positions_m + step_m


SPRING = Well(lambda r: 50 * (r - 0.1) ** 2, lambda r: 100 * (r - 0.1), lambda r: 100.0)
"""A spring of 100 N/m, 0.1 m long: its stiffness across is negative while it is pushed together."""


def test_a_long_spring_is_found_quadratically():
    solver = Dense()
    found = equilibrium(SPRING, solver, np.array([[0.103, 0.004, 0.0]]), 1e-12)
    assert found.converged
    assert np.linalg.norm(found.positions_m) == pytest.approx(0.1, abs=1e-13)
    assert found.steps <= 6


def test_no_step_is_longer_than_a_centimetre():
    found = equilibrium(SPRING, Dense(), np.array([[0.2, 0.01, 0.0]]), 1e-10)
    assert found.converged
    assert found.steps >= 0.1 / LARGEST_STEP_M


def test_where_the_stiffness_is_indefinite_damping_finds_the_way():
    found = equilibrium(SPRING, Dense(), np.array([[0.03, 1e-3, 0.0]]), 1e-10)
    assert found.converged
    assert np.linalg.norm(found.positions_m) == pytest.approx(0.1, abs=1e-11)


def test_at_rest_nothing_is_factored():
    solver = Dense()
    found = equilibrium(SPRING, solver, np.array([[0.1, 0.0, 0.0]]), 1e-9)
    assert found.converged
    assert found.steps == 0
    assert solver.factored == 0


def test_too_few_steps_are_told_as_not_converged():
    found = equilibrium(SPRING, Dense(), np.array([[0.2, 0.0, 0.0]]), 1e-10, max_steps=3)
    assert not found.converged
    assert found.residual_n == pytest.approx(100 * (np.linalg.norm(found.positions_m) - 0.1))


def test_a_kink_does_not_stop_it():
    """Slack below 0.1 m, a spring above, and a weak pull home: the minimum lies just past the kink of the stiffness."""
    slack = Well(
        lambda r: 50 * max(r - 0.1, 0) ** 2 - 0.01 * r + 0.5 * 1e-3 * r**2,
        lambda r: 100 * max(r - 0.1, 0) - 0.01 + 1e-3 * r,
        lambda r: (100.0 if r > 0.1 else 0.0) + 1e-3,
    )
    found = equilibrium(slack, Dense(), np.array([[0.05, 0.02, 0.0]]), 1e-11)
    assert found.converged
    assert np.linalg.norm(found.positions_m) == pytest.approx(0.1 + (0.01 - 1e-4) / 100.001, abs=1e-9)


def test_forces_that_are_no_numbers_are_an_error():
    broken = Well(lambda r: r, lambda r: np.nan, lambda r: 1.0)
    with pytest.raises(HapticsError, match="not finite"):
        equilibrium(broken, Dense(), np.array([[0.1, 0.0, 0.0]]), 1e-9)

"""Equilibrium by Newton's method with a sparse Cholesky factor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from haptics.errors import HapticsError
from haptics.garments.equilibrium.cholesky import NotDefinite, SparseCholesky
from haptics.garments.mesh import Floats

LARGEST_STEP_M = 0.01
"""No vertex moves farther in one step: a longer one may jump across the body."""
MAX_STEPS = 300
SUFFICIENT = 1e-4
"""Part of the decrease predicted by the slope that a step must reach (Armijo)."""
DROWNED = 1e-13
"""Energy differences below this part of the energy are rounding; there the force decides."""
HALVINGS = 40
NEAR = 0.2
"""A step that leaves less than this part of the force is followed by others with the same factor."""
MIN_DAMPING_N_M3, FIRST_DAMPING_N_M3, MAX_DAMPING_N_M3 = 30.0, 1e4, 1e16
DAMPING_FACTOR = 8.0


class State(Protocol):
    """An energy at some positions, with its derivatives there.

    Unknowns that are fixed have no force and a row of the identity.
    """

    @property
    def positions_m(self) -> Floats:
        """Positions of the vertices, m, ``(vertices, 3)``."""
        ...

    @property
    def energy_j(self) -> float:
        """Energy there, J."""
        ...

    @property
    def force_n(self) -> Floats:
        """dE/dx, ``(vertices, 3)``: what must be applied from outside to hold it there."""
        ...

    def stiffness(self, damping_n_m3: float) -> Floats:
        """Second derivative of the energy in the solver's pattern.

        :param damping_n_m3: stiffness per area added at each vertex, N/m3; 0 adds none.
        :return: the matrix's entries, N/m, ``(entries,)``.
        """
        ...

    def after(self, step_m: Floats) -> Floats:
        """Positions after a step: their sum, but for terms of second order that the problem knows better.

        :param step_m: the step of each vertex, m, ``(vertices, 3)``.
        :return: positions, m, ``(vertices, 3)``.
        """
        ...


@dataclass(frozen=True, eq=False)
class Solution:
    """Where Newton's method ended.

    :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
    :param converged: the residual is within the tolerance.
    :param residual_n: 2-norm of all nodal forces, N.
    :param steps: Newton steps made.
    """

    positions_m: Floats
    converged: bool
    residual_n: float
    steps: int


def equilibrium(
    state_at: Callable[[Floats], State],
    solver: SparseCholesky,
    start_m: Floats,
    tolerance_n: float,
    damping_n_m3: float = 0.0,
    max_steps: int = MAX_STEPS,
) -> Solution:
    """Positions with no force left, from ``start_m``.

    Newton's steps, shortened to ``LARGEST_STEP_M`` and until the energy falls as its slope predicts. Damping, a stiffness per
    area that holds each vertex where it is, grows while steps have to be shortened or the stiffness has no Cholesky factor, and
    dies out as soon as whole steps succeed: slack cloth, that nothing holds, does not fly off, and the end is Newton's own
    quadratic one. Close to the end, where differences of the energy are rounding, a step must lessen the force instead, and a
    factor serves several steps.

    :param state_at: gives the energy and its derivatives at positions, m, ``(vertices, 3)``.
    :param solver: for matrices of the state's pattern.
    :param start_m: positions to start from, m, ``(vertices, 3)``.
    :param tolerance_n: on the 2-norm of the nodal forces, N.
    :param damping_n_m3: damping to begin with, N/m3: none near the solution, some 1e5 far from it.
    :param max_steps: Newton steps after which the search ends unconverged.
    :return: where the search ended; ``converged`` is false where no step helped or there were too many.
    :raises HapticsError: forces that are not finite.
    """
    state, damping = state_at(np.array(start_m)), damping_n_m3
    for step in range(max_steps):
        residual = _residual_n(state)
        if residual <= tolerance_n:
            return Solution(state.positions_m, True, residual, step)
        damping = _factorise(state, solver, damping)
        if damping > MAX_DAMPING_N_M3:
            return Solution(state.positions_m, False, residual, step)
        direction = -solver.solve(state.force_n.ravel()).reshape(state.force_n.shape)
        next_state, part = _advance(state_at, state, direction)
        if part == 0.0:
            return Solution(state.positions_m, False, residual, step + 1)
        state = _chords(state_at, solver, next_state, tolerance_n) if _size(next_state.force_n) < NEAR * residual else next_state
        damping = _next_damping(damping, part)
    residual = _residual_n(state)
    return Solution(state.positions_m, residual <= tolerance_n, residual, max_steps)


def _chords(state_at: Callable[[Floats], State], solver: SparseCholesky, state: State, tolerance_n: float) -> State:
    """Steps with the factor that is there, while they lessen the force well: near the end the stiffness hardly changes."""
    while (residual := _residual_n(state)) > tolerance_n:
        trial = state_at(state.after(-solver.solve(state.force_n.ravel()).reshape(state.force_n.shape)))
        if not _size(trial.force_n) < NEAR * residual:
            break
        state = trial
    return state


def _residual_n(state: State) -> float:
    residual = _size(state.force_n)
    if not np.isfinite(residual):
        raise HapticsError("nodal forces are not finite; the start is too far from equilibrium")
    return residual


def _size(forces: Floats) -> float:
    """2-norm: not by BLAS, whose threads would get in the way of the solver's."""
    return float(np.sqrt(np.sum(forces * forces)))


def _factorise(state: State, solver: SparseCholesky, damping: float) -> float:
    """Factor the stiffness with the smallest damping that gives a factor; returns it, or more than the maximum if none does."""
    while damping <= MAX_DAMPING_N_M3:
        try:
            solver.factorise(state.stiffness(damping))
            return damping
        except NotDefinite:
            damping = max(DAMPING_FACTOR * damping, FIRST_DAMPING_N_M3)
    return damping


def _next_damping(damping: float, part: float) -> float:
    if part > 0.9:
        damping /= DAMPING_FACTOR
    elif part < 0.3:
        damping = max(DAMPING_FACTOR * damping, MIN_DAMPING_N_M3)
    return damping if damping >= MIN_DAMPING_N_M3 else 0.0


def _advance(state_at: Callable[[Floats], State], state: State, direction: Floats) -> tuple[State, float]:
    """The next state, and what part of the whole step was taken: 0 where none helps."""
    slope, residual = float(np.sum(state.force_n * direction)), _size(state.force_n)
    part = min(1.0, LARGEST_STEP_M / max(float(np.sqrt(np.einsum("ij,ij->i", direction, direction).max())), 1e-300))
    for _ in range(HALVINGS):
        trial = state_at(state.after(part * direction))
        if trial.energy_j - state.energy_j <= SUFFICIENT * part * slope:
            return trial, part
        drowned = abs(part * slope) <= DROWNED * abs(state.energy_j)
        if drowned and _size(trial.force_n) < residual:
            return trial, part
        part *= 0.5
    return state, 0.0

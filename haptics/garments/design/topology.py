"""Where to reinforce: bi-directional evolutionary structural optimisation with two materials (thesis 5.5.4).

Begins fully reinforced. Each step finds the equilibrium, ranks the triangles by what their reinforcement is worth, and lets the
reinforced area shrink by a fixed part: the lowest lose theirs, and cloth that ranks above them gains it, up to a limit. Every
step in between is a design for its own coverage.

At the target the procedure goes on exchanging triangles, and where loops open and close its steps differ widely. So once it has
settled, the search goes on from the best design with half as many exchanged, a quarter, and so on, until none is better. Drawn
designs that come near take part: evolution goes downhill from the full garment only, and may miss what a hand has seen.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from haptics.errors import InputError
from haptics.garments.design.designs import COVERAGE_TOLERANCE, DesignSequence, DesignStep, DesignStore, Reached, asked_for
from haptics.garments.design.rating import Densities, Unconverged, coverage_of, first_by_area, solved
from haptics.garments.design.sensitivity import mesh_filter, pass_spread_m, sensitivities
from haptics.garments.materials import CLOTH, REINFORCED
from haptics.garments.mesh import Bools, Floats
from haptics.physics.parameters import Parameters, parameter
from haptics.units import in_range

if TYPE_CHECKING:
    from haptics.garments.design.drawn import DrawnDesign
    from haptics.garments.equilibrium.simulation import Equilibrium, Reinforceable

SMALLEST_COVERAGE = 0.01
RIVAL = 0.9
"""A drawn design of more than this part of the best density found is tried."""
FEWEST_EXCHANGED = 2
"""Triangles: a step that may exchange fewer is not worth its equilibrium."""
DRAFT_TRIANGLES = 3600
"""Triangles of a garment at the level `draft`: about twice its vertices."""

Progress = Callable[[int, DesignStep], None]
"""Called after each completed step, with its number from 0."""


def steps_about(coverage: float, parameters: BesoParameters | None = None) -> int:
    """About how many steps a design of a coverage takes from the fully reinforced garment.

    :param coverage: reinforced over designable area, 0.01 to 1.
    :param parameters: of the evolution; None takes the defaults.
    :return: number of steps.
    """
    p = parameters or BesoParameters()
    return math.ceil(math.log(coverage) / math.log(1 - p.evolution_rate)) + 2 * int(p.settled_steps)


class DesignInterrupted(Unconverged):
    """A step found no equilibrium, so that nothing could be ranked. The steps before it are kept.

    :param message: which step failed, for people.
    :param residual_n: force left over, N.
    :param sequence: the steps before; None if it was the first.
    """

    def __init__(self, message: str, residual_n: float, sequence: DesignSequence | None):
        self.sequence = sequence
        super().__init__(message, residual_n)


@dataclass(frozen=True)
class BesoParameters(Parameters):
    """How the design evolves (5.5.4).

    :param filter_spread_m: how far the filter spreads a sensitivity (root mean square), m, 0 to 1: what sets the width of the
        finest bands, whatever the mesh. None takes that of one plain pass on this garment at the level `draft`; 0 is the plain
        filter, whose reach depends on the mesh.
    :raises InputError: a value outside its range.
    """

    evolution_rate: float = parameter(
        0.015, "", "stated", "ER, 5.6.2: part of the reinforced area that goes each step", 1e-4, 0.5
    )
    admission_limit: float = parameter(
        0.015, "", "stated", "AR max, 5.6.2: part of the area that may be added in a step", 0.0, 1.0
    )
    penalty: float = parameter(1.6, "", "stated", "p, 5.5.2", 1.0, 10.0)
    d_min: float = parameter(0.001, "", "stated", "5.5.2", 1e-9, 1.0)
    stiffness_ratio: float = parameter(
        REINFORCED.young_pa * REINFORCED.thickness_m / (CLOTH.young_pa * CLOTH.thickness_m),
        "",
        "derived",
        "E t of reinforced cloth over that of cloth, 5.6.1",
        1.0,
        1e9,
    )
    settled_change: float = parameter(
        0.001, "", "assumed", "tau, 5.5.4: change of the mean energy from one span of steps to the next", 0.0, 1.0
    )
    settled_steps: float = parameter(5, "", "assumed", "N, 5.5.4: steps in such a span", 1, 1000)
    max_extra_steps: float = parameter(30, "", "assumed", "steps at the target after which it ends anyhow", 1, 10000)
    filter_spread_m: float | None = field(default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.filter_spread_m is not None:
            in_range("filter_spread_m", self.filter_spread_m, 0.0, 1.0, "m")


def optimise(
    cloth: Reinforceable,
    coverage: float,
    parameters: BesoParameters = BesoParameters(),
    store: DesignStore | None = None,
    progress: Progress | None = None,
    start: Bools | None = None,
    rivals: Sequence[DrawnDesign] = (),
) -> DesignSequence:
    """The reinforcement of a coverage that stores the maximum energy when the cloth is loaded (eq. 5.11), and all before it.

    A step follows only from a converged equilibrium, warm-started from the last one and, where that fails, begun afresh.
    Triangles that are not designable stay cloth. Equal ranks go by the triangles' numbers.

    :param cloth: the garment on its body at the end of its motion, or a patch.
    :param coverage: reinforced over designable area, from 0.01 to 1; met within 0.3 % of the designable area.
    :param parameters: of the evolution.
    :param store: continued where it ends; each completed step goes to it.
    :param progress: called after each completed step with its number from 0 and the step; None: nobody is.
    :param start: the design to begin with, ``(triangles,)``, smaller ones grow; None for the fully reinforced garment.
    :param rivals: drawn designs of the same coverage. Those that come near the best one found are tried, too, and improved.
    :return: all steps; ``final`` is the one asked for.
    :raises InputError: a coverage out of range, a mesh too coarse for it, a start that reinforces nothing or what is not
        designable, or a store begun with other settings.
    :raises DesignInterrupted: a step has no equilibrium. Nothing is lost: it holds the steps so far, as does the store.
    """
    evolution = _Evolution(cloth, coverage, parameters, start, rivals)
    sequence = store.load(evolution.settings) if store else None
    while sequence is None or not sequence.complete:
        sequence = evolution.step(sequence)
        if store:
            store.save(evolution.settings, sequence)
        if progress:
            progress(len(sequence.steps) - 1, sequence.steps[-1])
    return sequence


def evolve(alpha: Floats, design: Bools, designable: Bools, areas_m2: Floats, area_m2: float, max_added_m2: float) -> Bools:
    """The next design: steps 3 to 5 of 5.5.4.

    The triangles of highest ``alpha``, as many as come nearest to ``area_m2``. If that adds more than ``max_added_m2``, only the
    best of the cloth up to that area, and the best of the reinforced ones for the rest.

    :param alpha: sensitivities, J/m2, ``(triangles,)``.
    :param design: reinforced triangles so far, ``(triangles,)``.
    :param designable: triangles that may be reinforced, ``(triangles,)``.
    :param areas_m2: area of each triangle, m2, ``(triangles,)``.
    :param area_m2: reinforced area of the next design, m2.
    :param max_added_m2: largest area of cloth that becomes reinforced, m2.
    :return: reinforced triangles, ``(triangles,)``.
    """
    ranked = np.lexsort((np.arange(len(alpha)), -alpha))
    ranked = ranked[designable[ranked]]
    best = first_by_area(ranked, areas_m2, area_m2)
    new = best[~design[best]]
    if areas_m2[new].sum() > max_added_m2:
        new = new[np.cumsum(areas_m2[new]) <= max_added_m2]
        kept = first_by_area(ranked[design[ranked]], areas_m2, area_m2 - float(areas_m2[new].sum()))
        best = np.concatenate([new, kept])
    out = np.zeros(len(design), bool)
    out[best] = True
    return out


@dataclass(frozen=True, eq=False)
class _Next:
    """A design to be tried, where the search for its equilibrium starts, and the sensitivities averaged with its own."""

    design: Bools
    start_m: Floats | None = None
    history_j_m2: Floats | None = None


class _Evolution:
    """The procedure on one cloth: each step follows from the sequence so far and nothing else, so that it can be resumed."""

    def __init__(
        self,
        cloth: Reinforceable,
        coverage: float,
        parameters: BesoParameters,
        start: Bools | None,
        rivals: Sequence[DrawnDesign],
    ):
        in_range("coverage", coverage, SMALLEST_COVERAGE, 1.0)
        self.cloth, self.coverage, self.p = cloth, coverage, parameters
        self.areas, self.designable = cloth.areas_m2, cloth.designable
        self.designable_m2 = float(self.areas[self.designable].sum())
        largest = float(self.areas[self.designable].max())
        if largest > 2 * COVERAGE_TOLERANCE * self.designable_m2:
            raise InputError(
                f"the largest triangle is {largest / self.designable_m2:.2%} of the designable area; allowed: at most "
                f"{2 * COVERAGE_TOLERANCE:.1%}, or a coverage cannot be met (take a finer level)"
            )
        self.goal_m2 = coverage * self.designable_m2
        self.first = self.designable.copy() if start is None else _checked_start(start, self.designable)
        spread_m = parameters.filter_spread_m
        if spread_m is None:
            spread_m = pass_spread_m(float(self.areas.sum()) / DRAFT_TRIANGLES)
        if self.areas[self.first].sum() < self.goal_m2:
            in_range("admission_limit of a design that grows", parameters.admission_limit, 2 * COVERAGE_TOLERANCE, 1.0)
        self.smooth = mesh_filter(cloth.rest, spread_m)
        self.rivals = rivals
        self.settings = _settings(cloth, coverage, parameters, self.first, rivals)

    def step(self, before: DesignSequence | None) -> DesignSequence:
        following = self._next(before) if before else _Next(self.first)
        design = following.design
        try:
            state = solved(self.cloth, design, following.start_m)
            full = before.full if before else self._full_densities(state)
        except Unconverged as error:
            done = len(before.steps) if before else 0
            raise DesignInterrupted(
                f"step {done}: {error}; the {done} steps before it are kept", error.residual_n, before
            ) from error
        ratio = Densities.of(design, self.areas, state.element_energy_j).over(full)
        made = DesignStep(
            design,
            coverage_of(self.cloth, design),
            state.energy_j,
            ratio.reinforced_j_m2,
            ratio.eq65_j_m2,
            state.residual_n,
            state.iterations,
        )
        steps = (*before.steps, made) if before else (made,)
        alpha = self.smooth(
            sensitivities(design, self.areas, state.element_energy_j, self.p.stiffness_ratio, self.p.penalty, self.p.d_min)
        )
        history = following.history_j_m2
        latest = Reached(state.positions_m, alpha if history is None else 0.5 * (alpha + history))
        final = latest if before is None or asked_for(steps, self.coverage) is made else before.at_final
        return DesignSequence(steps, self.coverage, full, final, latest, self._complete(steps))

    def _full_densities(self, first: Equilibrium) -> Densities:
        full = first if np.array_equal(self.first, self.designable) else solved(self.cloth, self.designable)
        return Densities.of(self.designable, self.areas, full.element_energy_j)

    def _target_m2(self, step: int) -> float:
        """A_i. From the first area and the step's number: an area rounded to whole triangles could stand still."""
        first = float(self.areas[self.first].sum())
        if first >= self.goal_m2:
            return max(self.goal_m2, first * (1 - self.p.evolution_rate) ** step)
        return min(self.goal_m2, first * (1 + self.p.evolution_rate) ** step)

    def _next(self, before: DesignSequence) -> _Next:
        steps = before.steps
        tries, settled = self._tries(steps), self._settled_after(steps)
        if settled is None:
            return self._evolved(before.at_latest, steps[-1].design, self._target_m2(len(steps)))
        if tries is None:
            return _Next(self._contest(steps[:settled])[len(steps) - settled])
        return self._evolved(before.at_final, before.final.design, self.goal_m2, 0.5 ** (tries + 1))

    def _evolved(self, reached: Reached, design: Bools, area_m2: float, part: float = 1.0) -> _Next:
        admitted_m2 = part * self.p.admission_limit * self.designable_m2
        following = evolve(reached.history_j_m2, design, self.designable, self.areas, area_m2, admitted_m2)
        return _Next(following, reached.positions_m, reached.history_j_m2)

    def _settled_after(self, steps: tuple[DesignStep, ...]) -> int | None:
        """How many steps the procedure of 5.5.4 took; None while it is not through."""
        return next((n for n in range(1, len(steps) + 1) if self._settled(steps[:n])), None)

    def _contest(self, steps: tuple[DesignStep, ...]) -> list[Bools]:
        """The drawn designs that come near the best one found."""
        return [rival.design for rival in self.rivals if rival.density > RIVAL * asked_for(steps, self.coverage).density]

    def _tries(self, steps: tuple[DesignStep, ...]) -> int | None:
        """How many steps since the best one, once procedure and contest are over; None before."""
        settled = self._settled_after(steps)
        over = settled + len(self._contest(steps[:settled])) if settled is not None else len(steps) + 1
        if len(steps) < over:
            return None
        best = asked_for(steps, self.coverage)
        return len(steps) - 1 - max(over - 1, next(n for n, step in enumerate(steps) if step is best))

    def _complete(self, steps: tuple[DesignStep, ...]) -> bool:
        """No better design found, however few triangles are exchanged."""
        tries = self._tries(steps)
        if tries is None:
            return False
        admitted_m2 = 0.5 ** (tries + 1) * self.p.admission_limit * self.designable_m2
        return admitted_m2 < FEWEST_EXCHANGED * float(self.areas[self.designable].mean())

    def _settled(self, steps: tuple[DesignStep, ...]) -> bool:
        """At the target, and the energy has settled: its mean over N steps is that over the N before (5.5.4)."""
        there = 0
        for number in reversed(range(len(steps))):
            if self._target_m2(number) != self.goal_m2 or abs(steps[number].coverage - self.coverage) > COVERAGE_TOLERANCE:
                break
            there += 1
        span = int(self.p.settled_steps)
        if there < 2 * span:
            return there >= self.p.max_extra_steps
        energies = np.array([step.energy_j for step in steps[-2 * span :]])
        change = abs(energies[span:].sum() - energies[:span].sum()) / energies[span:].sum()
        return bool(change <= self.p.settled_change) or there >= self.p.max_extra_steps


def _checked_start(start: Bools, designable: Bools) -> Bools:
    if start.shape != designable.shape or start.dtype != np.bool_:
        raise InputError(f"start is {start.dtype} of shape {start.shape}; expected bool of shape {designable.shape}")
    outside = np.flatnonzero(start & ~designable)
    if len(outside) or not start.any():
        what = f"triangle {outside[0]}, which is not designable" if len(outside) else "nothing"
        raise InputError(f"start reinforces {what}; expected at least 1 triangle, designable ones only")
    return start.copy()


def _settings(
    cloth: Reinforceable, coverage: float, parameters: BesoParameters, first: Bools, rivals: Sequence[DrawnDesign]
) -> dict[str, Any]:
    mesh = hashlib.sha256()
    for part in (cloth.rest.vertices_m, cloth.triangles, cloth.designable):
        mesh.update(np.ascontiguousarray(part).tobytes())
    return {
        "coverage": coverage,
        "mesh": mesh.hexdigest(),
        "start": "full" if np.array_equal(first, cloth.designable) else _digest(first),
        "rivals": [_digest(rival.design) for rival in rivals],
        **{f"beso.{name}": value for name, value in vars(parameters).items()},
    }


def _digest(design: Bools) -> str:
    return hashlib.sha256(np.packbits(design).tobytes()).hexdigest()

"""How much a reinforcement gives for its area: energy densities, against those of the fully reinforced garment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from haptics.errors import HapticsError, InputError
from haptics.garments.mesh import Bools, Floats, Ints

if TYPE_CHECKING:
    from haptics.garments.equilibrium.simulation import Equilibrium, Reinforceable


class Unconverged(HapticsError):
    """No equilibrium was found, from the start that was given nor from scratch: there is nothing to rate or to rank.

    :ivar residual_n: force left over.
    """

    def __init__(self, message: str, residual_n: float):
        self.residual_n = residual_n
        super().__init__(message)


@dataclass(frozen=True)
class Densities:
    """Energy by reinforced area, J/m2.

    :param reinforced_j_m2: energy of the reinforced triangles over their area (thesis 5.6).
    :param eq65_j_m2: energy of all triangles over the reinforced area (eq. 6.5).
    """

    reinforced_j_m2: float
    eq65_j_m2: float

    @classmethod
    def of(cls, design: Bools, areas_m2: Floats, element_energy_j: Floats) -> Densities:
        """Of a loaded design, ``(triangles,)`` each.

        :raises InputError: nothing is reinforced.
        """
        area_m2 = float(areas_m2[design].sum())
        if area_m2 <= 0:
            raise InputError("design has no reinforced triangle; an energy density needs at least 1")
        return cls(float(element_energy_j[design].sum()) / area_m2, float(element_energy_j.sum()) / area_m2)

    def over(self, full: Densities) -> Densities:
        """As multiples of those of the fully reinforced garment: ``density_increase``, without unit."""
        return Densities(self.reinforced_j_m2 / full.reinforced_j_m2, self.eq65_j_m2 / full.eq65_j_m2)


def coverage_of(cloth: Reinforceable, design: Bools) -> float:
    """Reinforced area over designable area."""
    return float(cloth.areas_m2[design].sum() / cloth.areas_m2[cloth.designable].sum())


def first_by_area(ranked: Ints, areas_m2: Floats, area_m2: float) -> Ints:
    """The first of ``ranked`` (triangle numbers) whose areas add up nearest to ``area_m2``."""
    total = np.concatenate([[0.0], np.cumsum(areas_m2[ranked])])
    return ranked[: int(np.argmin(np.abs(total - area_m2)))]


def solved(cloth: Reinforceable, design: Bools, start: Floats | None = None) -> Equilibrium:
    """The equilibrium of a design from ``start``; where that fails, from scratch.

    :raises Unconverged: neither gives one.
    """
    state = cloth.solve(design, start)
    if not state.converged and start is not None:
        state = cloth.solve(design, None)
    if state.converged:
        return state
    raise Unconverged(
        f"no equilibrium: {state.residual_n:.3g} N are left over; allowed: at most {state.tolerance_n:.3g} N "
        f"(design with {int(design.sum())} of {len(design)} triangles reinforced)",
        state.residual_n,
    )

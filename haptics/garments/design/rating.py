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
    """No equilibrium was found, neither from the start that was given nor from scratch: there is nothing to rate or to rank.

    :param message: what failed, for people.
    :param residual_n: force left over, N.
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
        """Densities of a loaded design.

        :param design: reinforced triangles, ``(triangles,)``.
        :param areas_m2: area of each triangle at rest, m2, ``(triangles,)``.
        :param element_energy_j: strain energy of each triangle, J, ``(triangles,)``.
        :return: both densities, J/m2.
        :raises InputError: nothing is reinforced.
        """
        area_m2 = float(areas_m2[design].sum())
        if area_m2 <= 0:
            raise InputError("design has no reinforced triangle; an energy density needs at least 1")
        return cls(float(element_energy_j[design].sum()) / area_m2, float(element_energy_j.sum()) / area_m2)

    def over(self, full: Densities) -> Densities:
        """As multiples of those of the fully reinforced garment: ``density_increase``, without unit.

        :param full: densities of the fully reinforced garment, J/m2.
        :return: the two ratios, no unit.
        """
        return Densities(self.reinforced_j_m2 / full.reinforced_j_m2, self.eq65_j_m2 / full.eq65_j_m2)


def coverage_of(cloth: Reinforceable, design: Bools) -> float:
    """Reinforced area over designable area.

    :param cloth: the garment on its body, or a patch.
    :param design: reinforced triangles, ``(triangles,)``.
    :return: 0 to 1.
    """
    return float(cloth.areas_m2[design].sum() / cloth.areas_m2[cloth.designable].sum())


def first_by_area(ranked: Ints, areas_m2: Floats, area_m2: float) -> Ints:
    """The first of some triangles whose areas add up nearest to an area.

    :param ranked: triangle numbers, the first to take first, ``(n,)``.
    :param areas_m2: area of each triangle, m2, ``(triangles,)``.
    :param area_m2: area asked for, m2.
    :return: the first of ``ranked``.
    """
    total = np.concatenate([[0.0], np.cumsum(areas_m2[ranked])])
    return ranked[: int(np.argmin(np.abs(total - area_m2)))]


def solved(cloth: Reinforceable, design: Bools, start: Floats | None = None) -> Equilibrium:
    """The equilibrium of a design from ``start``; where that fails, from scratch.

    :param cloth: the garment on its body, or a patch.
    :param design: reinforced triangles, ``(triangles,)``.
    :param start: positions to start from, m, ``(vertices, 3)``; None starts from scratch.
    :return: a converged equilibrium.
    :raises Unconverged: neither gives one.
    """
    state = cloth.solve(design, start)
    if not state.converged and start is not None:
        state = cloth.solve(design, None)
    if state.converged:
        return state
    raise Unconverged(
        f"no equilibrium: residual {state.residual_n:.3g} N; allowed: at most {state.tolerance_n:.3g} N "
        f"(design with {int(design.sum())} of {len(design)} triangles reinforced)",
        state.residual_n,
    )

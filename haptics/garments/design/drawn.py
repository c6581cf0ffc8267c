"""Designs as a person would draw them, of the same area as an optimised one (thesis 5.7): a line and an X.

`line`: a strip along the shortest path between two openings, where the attachments are. `x`: two strips that cross where strain
is at its maximum and go round the garment to meet again on the other side, above and below: two loops. Neither fixes where around
the limb it lies, so that several places are tried and the best is the baseline: the openings whose connecting paths are strained
hardest, then eight places around, one of them the hardest strained path; for the X also two lengths of its legs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from haptics.errors import InputError
from haptics.garments.design.geodesic import SurfaceGraph, boundary_loops
from haptics.garments.design.rating import Densities, Unconverged, coverage_of, first_by_area, solved
from haptics.garments.mesh import Bools, Floats, Ints
from haptics.units import in_range, one_of

if TYPE_CHECKING:
    from haptics.garments.equilibrium.simulation import Equilibrium, Reinforceable

SHAPES = ("line", "x")
PLACES = 8
"""Places around the garment that are tried."""
REACHES = (0.5, 0.25)
"""How far the X reaches from its crossing, up and down, as a part of the distance between the openings: all of it, or half."""


@dataclass(frozen=True, eq=False)
class DrawnDesign:
    """The best of the places tried.

    :param shape: `line` or `x`.
    :param design: reinforced triangles, ``(triangles,)``.
    :param place: where it lies, for people.
    :param coverage: reinforced over designable area, 0 to 1.
    :param energy_j: strain energy of the whole garment, J.
    :param density: as in ``DesignStep``, no unit.
    :param density_eq65: as in ``DesignStep``, no unit.
    :param tried: the density at each place; None where no equilibrium was found.
    """

    shape: str
    design: Bools
    place: str
    coverage: float
    energy_j: float
    density: float
    density_eq65: float
    tried: dict[str, float | None]


def best_drawn(cloth: Reinforceable, shape: str, coverage: float, full: Equilibrium | None = None) -> DrawnDesign:
    """The baseline: ``shape`` with ``coverage`` at the place where its energy density is at its maximum.

    :param cloth: the garment on its body, or a patch.
    :param shape: `line` or `x`.
    :param coverage: reinforced over designable area, 0.01 to 1; met to half a triangle.
    :param full: the fully reinforced equilibrium, if it is known already.
    :return: the best place, with the densities of all that were tried.
    :raises InputError: a shape or coverage that is not allowed; fewer than two openings.
    :raises Unconverged: no equilibrium of the full design, or at none of the places.
    """
    full = full or solved(cloth, cloth.designable)
    whole = Densities.of(cloth.designable, cloth.areas_m2, full.element_energy_j)
    tried: dict[str, float | None] = {}
    best: DrawnDesign | None = None
    for place, design in drawn_designs(cloth, shape, coverage, full).items():
        try:
            state = solved(cloth, design, full.positions_m)
        except Unconverged:
            tried[place] = None
            continue
        ratio = Densities.of(design, cloth.areas_m2, state.element_energy_j).over(whole)
        tried[place] = ratio.reinforced_j_m2
        if best is None or ratio.reinforced_j_m2 > best.density:
            at = coverage_of(cloth, design)
            best = DrawnDesign(shape, design, place, at, state.energy_j, ratio.reinforced_j_m2, ratio.eq65_j_m2, tried)
    if best is None:
        raise Unconverged(f"{shape}: no equilibrium at any of the {len(tried)} places tried", np.inf)
    return best


def drawn_designs(cloth: Reinforceable, shape: str, coverage: float, full: Equilibrium) -> dict[str, Bools]:
    """The designs that are tried, by their places, ``(triangles,)`` each.

    :param cloth: the garment on its body, or a patch.
    :param shape: `line` or `x`.
    :param coverage: reinforced over designable area, 0.01 to 1; met to half a triangle.
    :param full: the fully reinforced equilibrium, whose strain decides where to draw.
    :return: reinforced triangles by the place's name, ``(triangles,)`` each.
    :raises InputError: as ``best_drawn``.
    """
    one_of("shape", shape, SHAPES)
    in_range("coverage", coverage, 0.01, 1.0)
    around = _Around(cloth, full)
    if shape == "line":
        paths = {f"{360 * k / PLACES:g} deg": around.lines[k] for k in range(PLACES)}
    else:
        paths = {f"{360 * k / PLACES:g} deg, reach {reach:g}": around.cross(k, reach) for k in range(PLACES) for reach in REACHES}
    return {f"{around.between}, {place}": around.strip(path, coverage) for place, path in paths.items()}


class _Around:
    """Paths between two openings of a garment, side by side around it: the place (k, s) is the part s along the k-th path."""

    def __init__(self, cloth: Reinforceable, full: Equilibrium):
        self._cloth, self._graph = cloth, SurfaceGraph(cloth.rest)
        loops = boundary_loops(cloth.rest)
        if len(loops) < 2:
            raise InputError(f"{cloth.rest.name} has {len(loops)} openings; a drawn line or X needs at least 2")
        self._strain = self._graph.at_nodes(_at_vertices(cloth, full.element_energy_j))
        paths = [self._graph.paths_from(loop) for loop in loops]
        strains = {
            (a, b): [self._mean_strain(paths[b].to(int(vertex))) for vertex in loops[a]]
            for a, b in permutations(range(len(loops)), 2)
        }
        a, b = max(strains, key=lambda pair: max(strains[pair]))
        starts = _equally_spaced(np.roll(loops[a], -int(np.argmax(strains[a, b]))), cloth.rest.vertices_m)
        self.between = f"opening {a + 1} to {b + 1}"
        self.lines = [paths[b].to(int(vertex))[::-1] for vertex in starts]

    def strip(self, path: Ints, coverage: float) -> Bools:
        """The triangles nearest to a path, as many as give the coverage."""
        away = self._graph.to_centres(self._graph.paths_from(path).lengths_m)
        away[~self._cloth.designable] = np.inf
        nearest = np.lexsort((np.arange(len(away)), away))[: int(self._cloth.designable.sum())]
        areas = self._cloth.areas_m2
        design = np.zeros(len(away), bool)
        design[first_by_area(nearest, areas, coverage * float(areas[self._cloth.designable].sum()))] = True
        return design

    def cross(self, k: int, reach: float) -> Ints:
        """Nodes of two paths that cross on the k-th line and meet again opposite to it, ``reach`` above and below."""
        middle = self._middle(k)
        crossing = self._graph.paths_from(np.array([self._node(k, middle)]))
        nodes = []
        for up in (-reach, reach):
            meeting = self._graph.paths_from(np.array([self._node(k + PLACES // 2, middle + up)]))
            for side in (-PLACES // 4, PLACES // 4):
                halfway = self._node(k + side, middle + up / 2)
                nodes += [crossing.to(halfway), meeting.to(halfway)]
        return np.unique(np.concatenate(nodes))

    def _node(self, k: int, part: float) -> int:
        line = self.lines[k % PLACES]
        along = self._along(line)
        return int(line[np.argmin(np.abs(along - np.clip(part, 0, 1) * along[-1]))])

    def _middle(self, k: int) -> float:
        """Where along a line its strain energy has its centre: the joint, on a limb."""
        line = self.lines[k]
        along = self._along(line)
        steps, energy = np.diff(along), self._strain[line]
        middles, weights = (along[1:] + along[:-1]) / 2, steps * (energy[1:] + energy[:-1])
        return float(middles @ weights / weights.sum() / along[-1]) if weights.sum() > 0 else 0.5

    def _along(self, path: Ints) -> Floats:
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self._graph.points_m[path], axis=0), axis=1))])

    def _mean_strain(self, path: Ints) -> float:
        along, energy = self._along(path), self._strain[path]
        return float(np.diff(along) @ (energy[1:] + energy[:-1]) / 2 / along[-1])


def _at_vertices(cloth: Reinforceable, element_energy_j: Floats) -> Floats:
    corners, vertices = cloth.triangles.ravel(), len(cloth.rest.vertices_m)
    return np.bincount(corners, np.repeat(element_energy_j, 3), minlength=vertices) / np.bincount(
        corners, np.repeat(cloth.areas_m2, 3), minlength=vertices
    )


def _equally_spaced(loop: Ints, vertices_m: Floats) -> Ints:
    """``PLACES`` vertices of a loop at equal lengths along it, from its first."""
    sides = np.linalg.norm(vertices_m[np.roll(loop, -1)] - vertices_m[loop], axis=1)
    along = np.cumsum(sides) - sides
    return loop[[int(np.argmin(np.abs(along - k / PLACES * sides.sum()))) for k in range(PLACES)]]

"""The 2D bench: a square of cloth between two clamps, pulled apart (thesis 5.6.1).

The cloth lies in a plane. The left clamp holds still, the right one moves by strain times the side; both keep the cloth from
narrowing. The force at the clamp is the sum of the nodal forces there, which is dE/du, E being the strain energy and u the pull.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from haptics.errors import InputError
from haptics.garments.equilibrium.cholesky import open_solver
from haptics.garments.equilibrium.membrane import Membrane
from haptics.garments.equilibrium.newton import equilibrium
from haptics.garments.equilibrium.simulation import Equilibrium, require_float64
from haptics.garments.equilibrium.stiffness import StiffnessPattern
from haptics.garments.materials import CLOTH, REINFORCED, Lame, Material
from haptics.garments.mesh import Bools, Floats, Ints
from haptics.garments.patch.bands import Layout, crossed, fitted, parallel
from haptics.garments.patch.patch_mesh import patch_mesh
from haptics.units import in_range, one_of

DESIGNS = ("none", "full", "strip", "line", "x")
"""``strip`` and ``line``: one band through the centre, at ``angle_deg`` from the pull. ``x``: two, along the diagonals."""
SIDE_M = 0.1
"""Free length between the clamps, and width (5.6.1)."""
ELEMENTS = 4000
"""Triangles, before corners are graded: the force then lies 0.02 to 0.2 % above its limit (docs/explanation/patch.md)."""
TOLERANCE_N = 1e-7
SLACK_PART = 1e-9
"""Slack cloth has no stiffness; this part of the cloth's own keeps the matrix regular. No force or energy comes with it."""

Clamps = Literal["held", "sliding"]
"""held: clamped cloth cannot narrow. sliding: it can, as if held by rollers."""


@dataclass(frozen=True)
class PatchResult:
    """A pull.

    :param force_n: at the right clamp, along the pull, N.
    :param elements: triangles.
    :param coverage: share of the patch that is reinforced, 0 to 1.
    :param energy_j: strain energy, J.
    :param converged: whether the forces within the cloth have died out.
    """

    force_n: float
    elements: int
    coverage: float
    energy_j: float
    converged: bool


class ClampedPatch:
    """The patch between its clamps at one strain. It can be reinforced triangle by triangle (a ``Reinforceable``).

    :param elements: number of triangles before corners are graded, 50 to 200,000.
    :param strain: pull over side, 0 to 2, no unit.
    :param lame: see ``Material.lame_n_m``.
    :param layout: bands whose edges the triangles follow.
    :param cloth: of triangles without reinforcement.
    :param reinforced: of triangles with it.
    :param clamps: ``held`` as on the bench, or ``sliding``.
    :param solver: see ``cholesky.installed_solvers``; None takes the fastest.
    :raises InputError: a number or name outside these.
    """

    def __init__(
        self,
        elements: int = ELEMENTS,
        strain: float = 0.1,
        lame: Lame = "plane",
        layout: Layout = (),
        cloth: Material = CLOTH,
        reinforced: Material = REINFORCED,
        clamps: Clamps = "held",
        solver: str | None = None,
    ):
        in_range("elements", elements, 50, 200_000)
        one_of("clamps", clamps, ("held", "sliding"))
        self._lame = np.array([cloth.lame_n_m(lame), reinforced.lame_n_m(lame)])
        self.rest = patch_mesh(layout, SIDE_M, int(elements))
        self.membrane = Membrane.at_rest(self.rest)
        self.designable: Bools = np.ones(len(self.rest.triangles), dtype=np.bool_)
        along = self.rest.vertices_m[:, 0]
        self._left, self._right = along == along.min(), along == along.max()
        self._fixed = np.zeros(self.rest.vertices_m.shape, dtype=np.bool_)
        self._fixed[:, 2] = True
        self._fixed[self._left | self._right, 0] = True
        if clamps == "held":
            self._fixed[self._left | self._right, 1] = True
        else:  # one vertex, or the patch could drift
            self._fixed[np.flatnonzero(self._left)[0], 1] = True
        self._pattern = StiffnessPattern(len(along), self.triangles, self._fixed)
        self._solver = open_solver(solver, self._pattern.indptr, self._pattern.indices)
        self._layout = layout
        self.pull_to(strain)

    def pull_to(self, strain: float) -> None:
        """Move the right clamp: the next ``solve`` is there.

        :param strain: pull over side, 0 to 2, no unit.
        :raises InputError: a strain outside 0 to 2.
        """
        self.strain = in_range("strain", strain, 0.0, 2.0)

    @property
    def triangles(self) -> Ints:
        """Vertex numbers, ``(triangles, 3)``."""
        return self.rest.triangles

    @property
    def areas_m2(self) -> Floats:
        """Area of each triangle at rest, m2, ``(triangles,)``."""
        return self.rest.areas_m2

    @property
    def centres_m(self) -> Floats:
        """Centres of the triangles from that of the patch, x along the pull, ``(triangles, 2)``."""
        return self.rest.centres_m[:, :2]

    @property
    def layout_design(self) -> Bools:
        """The triangles within the bands of the layout that the mesh follows, ``(triangles,)``."""
        return np.any([band.holds(self.centres_m) for band in self._layout] or [~self.designable], axis=0)

    def coverage(self, design: Bools) -> float:
        """Share of the patch that a design reinforces.

        :param design: reinforced triangles, ``(triangles,)``.
        :return: 0 to 1.
        """
        return float(self.areas_m2[design].sum() / self.areas_m2.sum())

    def solve(self, design: Bools, start: Floats | None = None) -> Equilibrium:
        """The equilibrium with the triangles of ``design`` reinforced.

        :param design: reinforced triangles, ``(triangles,)``.
        :param start: positions to start from, m, ``(vertices, 3)``, float64; None stretches the patch evenly. The clamps are put
            in place.
        :return: the equilibrium, or the nearest to it that was found.
        :raises InputError: arrays of the wrong shape or kind.
        """
        if design.shape != (len(self.triangles),) or design.dtype != np.bool_:
            raise InputError(f"design is {design.dtype} of shape {design.shape}; expected bool of shape ({len(self.triangles)},)")
        even = self.rest.vertices_m * [1 + self.strain, 1.0, 1.0]
        x = even
        if start is not None:
            require_float64("start", start)
            if start.shape != even.shape or not np.isfinite(start).all():
                raise InputError(f"start has shape {start.shape} or is not finite; expected finite numbers of shape {even.shape}")
            x = np.where(self._fixed, even, start)
        self._constants = self._lame[design.astype(np.int64)]
        solution = equilibrium(self.state, self._solver, x, TOLERANCE_N)
        x = solution.positions_m
        energies = self.membrane.element_energy_j(x, self._constants)
        return Equilibrium(
            x,
            solution.converged,
            solution.residual_n,
            TOLERANCE_N,
            solution.steps,
            float(energies.sum()),
            energies,
            self.membrane.stretches(x),
            attachment_j=0.0,
            contact_j=0.0,
        )

    def clamp_forces_n(self, design: Bools, equilibrium: Equilibrium) -> tuple[float, float]:
        """The force that each clamp must apply, along x.

        :param design: reinforced triangles, ``(triangles,)``.
        :param equilibrium: from ``solve`` with that design.
        :return: left and right, N; the right one is positive in a pull.
        """
        forces = self.membrane.gradient_n(equilibrium.positions_m, self._lame[design.astype(np.int64)])[:, 0]
        return float(forces[self._left].sum()), float(forces[self._right].sum())

    def state(self, positions_m: Floats) -> PatchState:
        """The patch at any positions, with the design of the last ``solve``.

        :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
        :return: energy, force and stiffness there.
        """
        return PatchState(self, positions_m)


class PatchState:
    """The patch at some positions: the ``State`` that Newton's method works on.

    :param patch: the patch, with the design of its last ``solve``.
    :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
    """

    def __init__(self, patch: ClampedPatch, positions_m: Floats):
        self._patch, self.positions_m = patch, positions_m
        self.energy_j = float(patch.membrane.element_energy_j(positions_m, patch._constants).sum())

    @property
    def force_n(self) -> Floats:
        """Derivative of the energy by the positions, zero where clamped, N, ``(vertices, 3)``."""
        return self._force_n

    @cached_property
    def _force_n(self) -> Floats:
        patch = self._patch
        return np.where(patch._fixed, 0.0, patch.membrane.gradient_n(self.positions_m, patch._constants))

    def stiffness(self, damping_n_m3: float) -> Floats:
        """Second derivative of the energy in the patch's pattern.

        :param damping_n_m3: stiffness per area added at each vertex, N/m3; 0 adds none.
        :return: the matrix's entries, N/m, ``(entries,)``.
        """
        patch = self._patch
        element = patch.membrane.element_hessians_n_m(self.positions_m, patch._constants)
        vertex = np.zeros((len(self.positions_m), 3, 3))
        vertex[:, range(3), range(3)] = SLACK_PART * patch._lame[0, 1] + damping_n_m3 * patch.rest.vertex_areas_m2[:, None]
        return patch._pattern.values(element, vertex)

    def after(self, step_m: Floats) -> Floats:
        """Positions after a step: their sum.

        :param step_m: the step of each vertex, m, ``(vertices, 3)``.
        :return: positions, m, ``(vertices, 3)``.
        """
        return self.positions_m + step_m


def layout_of(design: str, coverage: float, angle_deg: float = 0.0) -> Layout:
    """The bands of a named design that cover a share of the patch exactly; none for ``none`` and ``full``.

    :param design: one of ``DESIGNS``.
    :param coverage: 0 to 1.
    :param angle_deg: of ``strip`` and ``line`` from the pull, degrees, -90 to 90.
    :return: the bands.
    :raises InputError: a name or number outside these.
    """
    one_of("design", design, DESIGNS)
    in_range("coverage", coverage, 0.0, 1.0)
    in_range("angle", angle_deg, -90.0, 90.0, "degrees")
    if design in ("none", "full"):
        return ()
    return fitted(crossed(45.0) if design == "x" else parallel(1, angle_deg, SIDE_M), coverage, SIDE_M)


def pull(
    design: str | Callable[[Floats], Bools] = "strip",
    coverage: float = 0.4,
    strain: float = 0.1,
    lame: Lame = "plane",
    angle_deg: float = 0.0,
    elements: int = ELEMENTS,
    clamps: Clamps = "held",
) -> PatchResult:
    """Pull a reinforced patch apart.

    :param design: one of ``DESIGNS``, or a function from points in metres, ``(points, 2)``, from the centre and x along the pull,
        to whether each is reinforced, ``(points,)``; it is called with the triangles' centres.
    :param coverage: share to reinforce, 0 to 1. ``none``, ``full`` and a function have their own.
    :param strain: pull over side, 0 to 2, no unit.
    :param lame: see ``Material.lame_n_m``.
    :param angle_deg: of ``strip`` and ``line`` from the pull, degrees, -90 to 90.
    :param elements: number of triangles before corners are graded, 50 to 200,000.
    :param clamps: ``held`` as on the bench, or ``sliding``.
    :return: force, energy and coverage.
    :raises InputError: a name or number outside these.
    """
    in_range("coverage", coverage, 0.0, 1.0)
    named = isinstance(design, str)
    patch = ClampedPatch(elements, strain, lame, layout_of(design, coverage, angle_deg) if named else (), clamps=clamps)
    if named:
        reinforced = patch.designable.copy() if design == "full" else patch.layout_design
    else:
        reinforced = np.asarray(design(patch.centres_m), dtype=np.bool_)
    return pulled(patch, reinforced)


def pulled(patch: ClampedPatch, design: Bools) -> PatchResult:
    """Solve for a design and read the force at the clamp.

    :param patch: the patch at its strain.
    :param design: reinforced triangles, ``(triangles,)``.
    :return: force, energy and coverage.
    """
    found = patch.solve(design)
    _, force = patch.clamp_forces_n(design, found)
    return PatchResult(force, len(patch.triangles), patch.coverage(design), found.energy_j, found.converged)

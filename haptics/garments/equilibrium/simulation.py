"""A garment on a posed body, at rest: where every force on the cloth has died out (thesis 5.4.4, eq. 5.9, 5.10).

E(x) = E_garment + E_attachments + E_contact + a small pull towards the posed body's copy of the garment, which places cloth that
hangs slack and carries no load. Contact and attachments are stiffnesses per area, so that they do not depend on the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from haptics.errors import InputError
from haptics.garments.equilibrium.cholesky import SparseCholesky, open_solver
from haptics.garments.equilibrium.contact import Contact
from haptics.garments.equilibrium.membrane import Membrane
from haptics.garments.equilibrium.newton import equilibrium
from haptics.garments.equilibrium.stiffness import StiffnessPattern
from haptics.garments.equilibrium.surface import ImplicitBody, nearest_vertices, neighbour_lists
from haptics.garments.garment import Garment
from haptics.garments.materials import CLOTH, INTERFACE, REINFORCED, Interface, Lame, Material
from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh, checked_mesh

TOLERANCE_N = 1e-7
"""Force left over in the whole garment, 2-norm (thesis 5.4.4)."""
COLD_DAMPING_N_M3 = 1e5
"""Damping to begin with where the start is the posed body's copy."""
MAX_ROUNDS = 6
"""Times that homes are let follow and the equilibrium is sought again."""
NEAR_N = 1e-3
"""Force left over at which the vertices' homes are looked at for the first time."""
SAME_SKIN_M = 1e-6
"""Skin that shifts by less with a vertex's home counts as the same: a fiftieth of how deep contact gives way."""
DEEP_M = 1e-3
"""Cloth deeper inside the body than contact ever lets it sink is brought to the surface before the start."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A garment whose forces balance, or the nearest to it that was found (then ``converged`` is false).

    :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
    :param converged: the residual is within the tolerance.
    :param residual_n: 2-norm of the nodal forces left, N.
    :param tolerance_n: limit of the residual, N.
    :param iterations: Newton steps made.
    :param energy_j: strain energy of the cloth, J.
    :param element_energy_j: the same of each triangle, J, ``(triangles,)``.
    :param stretches: principal stretches, larger first, 1 at rest, ``(triangles, 2)``.
    :param attachment_j: energy in the attachments, J.
    :param contact_j: energy in the contact with the skin, J.
    """

    positions_m: Floats
    converged: bool
    residual_n: float
    tolerance_n: float
    iterations: int
    energy_j: float
    element_energy_j: Floats
    stretches: Floats
    attachment_j: float
    contact_j: float


@dataclass(frozen=True, eq=False)
class Skin:
    """A posed body as the garment feels it.

    :param surface: its smooth surface.
    :param copy_m: the garment moved along with the body and onto its surface, m, ``(vertices, 3)``.
    :param homes: the body vertex nearest to each vertex of the copy, ``(vertices,)``.
    :param anchors_m: where the centres of the attached triangles are held, m, ``(attached, 3)``.
    """

    surface: ImplicitBody
    copy_m: Floats
    homes: Ints
    anchors_m: Floats


class Reinforceable(Protocol):
    """Cloth that can be reinforced triangle by triangle and then loaded: a garment on a body, a patch on the bench."""

    @property
    def rest(self) -> SurfaceMesh:
        """The mesh without stretch."""
        ...

    @property
    def triangles(self) -> Ints:
        """Vertex numbers, ``(triangles, 3)``."""
        ...

    @property
    def areas_m2(self) -> Floats:
        """Area of each triangle at rest, m2, ``(triangles,)``."""
        ...

    @property
    def designable(self) -> Bools:
        """Triangles that may be reinforced, ``(triangles,)``."""
        ...

    def solve(self, design: Bools, start: Floats | None = None) -> Equilibrium:
        """The loaded state with the triangles of ``design`` reinforced.

        :param design: reinforced triangles, ``(triangles,)``.
        :param start: positions to start from, m, ``(vertices, 3)``; None starts from scratch.
        :return: the equilibrium, or the nearest to it that was found.
        """
        ...


class GarmentOnBody:
    """One garment, one motion: at rest on the body in one pose, then worn in another.

    :param garment: what is worn.
    :param body_triangles: the body's mesh, vertex numbers, ``(n, 3)``.
    :param rest_body_m: its vertices where the garment is at rest, m, ``(body vertices, 3)``, float64.
    :param posed_body_m: its vertices where the garment is worn, m, ``(body vertices, 3)``, float64.
    :param cloth: of triangles without reinforcement.
    :param reinforced: of triangles with it.
    :param interface: what holds the garment to the body.
    :param lame: see ``Material.lame_n_m``.
    :param solver: see ``cholesky.installed_solvers``; None takes the fastest.
    :param tolerance_n: on the 2-norm of the nodal forces, N.
    :raises InputError: a faulty body mesh (see ``checked_mesh``), arrays that do not fit together, or a garment that does not lie
        on the body.
    """

    def __init__(
        self,
        garment: Garment,
        body_triangles: Ints,
        rest_body_m: Floats,
        posed_body_m: Floats,
        cloth: Material = CLOTH,
        reinforced: Material = REINFORCED,
        interface: Interface = INTERFACE,
        lame: Lame = "plane",
        solver: str | None = None,
        tolerance_n: float = TOLERANCE_N,
    ):
        require_float64("rest_body_m", rest_body_m)
        rest_body = self._rest_body = checked_mesh(rest_body_m, body_triangles, "body at rest")
        self.garment, self.interface, self.tolerance_n = garment, interface, tolerance_n
        self._lame = np.array([cloth.lame_n_m(lame), reinforced.lame_n_m(lame)])
        self._lists = neighbour_lists(rest_body)
        copied = garment.on(rest_body_m)
        rest_m, self._rest_homes = ImplicitBody(rest_body, self._lists).project(copied, nearest_vertices(copied, rest_body_m))
        self.rest = SurfaceMesh(rest_m, garment.triangles, garment.name)
        self.membrane = Membrane.at_rest(self.rest)
        areas = self.rest.vertex_areas_m2
        self._contact = Contact(interface.contact_n_m3 * areas, interface.rounding_m)
        self._placing_n_m = interface.regulariser_n_m3 * areas
        self._attached = np.flatnonzero(garment.attached)
        self._attachment_n_m = interface.attachment_n_m3 * self.areas_m2[self._attached]
        self._pattern = StiffnessPattern(len(rest_m), garment.triangles)
        self._solver: SparseCholesky = open_solver(solver, self._pattern.indptr, self._pattern.indices)
        self.wear(posed_body_m)

    def wear(self, posed_body_m: Floats) -> Skin:
        """Put the body into another pose: the next ``solve`` is there.

        The attached parts move with the skin that they lie on.

        :param posed_body_m: the body's vertices, m, ``(body vertices, 3)``, float64.
        :return: the body in that pose, as the garment feels it.
        :raises InputError: as in ``skin``.
        """
        self._skin = self.skin(posed_body_m)
        self._homes = self._skin.homes
        return self._skin

    def skin(self, posed_body_m: Floats) -> Skin:
        """The body in a pose, as this garment feels it.

        :param posed_body_m: the body's vertices, m, ``(body vertices, 3)``, float64.
        :return: its surface, and where the garment's vertices and attachments lie on it.
        :raises InputError: vertices of another body, not finite or not float64.
        """
        require_float64("posed_body_m", posed_body_m)
        shape = self._rest_body.vertices_m.shape
        if posed_body_m.shape != shape or not np.isfinite(posed_body_m).all():
            raise InputError(
                f"posed_body_m has shape {posed_body_m.shape} or is not finite; expected finite numbers of shape {shape}"
            )
        surface = ImplicitBody(self._rest_body.at(posed_body_m, "posed body"), self._lists)
        copy, homes = surface.project(self.garment.on(posed_body_m), self._rest_homes)
        return Skin(surface, copy, homes, copy[self.triangles[self._attached]].mean(axis=1))

    def pose_energy_j(self, positions_m: Floats, skin: Skin) -> float:
        """The part of the energy that depends on the pose: contact, attachments, placing.

        With the positions held, its derivative by an angle of the pose is the whole energy's: the cloth is in equilibrium.

        :param positions_m: the cloth of the last ``solve``, m, ``(vertices, 3)``.
        :param skin: the body in the pose.
        :return: energy, J.
        """
        held, placed = self._away(positions_m, skin)
        return (
            float(self._contact.energy_j(skin.surface.distance_m(positions_m, self._homes)).sum())
            + 0.5 * float(self._attachment_n_m @ np.einsum("ij,ij->i", held, held))
            + 0.5 * float(self._placing_n_m @ np.einsum("ij,ij->i", placed, placed))
        )

    def _away(self, positions_m: Floats, skin: Skin) -> tuple[Floats, Floats]:
        """How far the attached triangles' centres are from where they are held, and each vertex from the posed body's copy."""
        return positions_m[self.triangles[self._attached]].mean(axis=1) - skin.anchors_m, positions_m - skin.copy_m

    @property
    def triangles(self) -> Ints:
        """Vertex numbers of the garment, ``(triangles, 3)``."""
        return self.garment.triangles

    @property
    def areas_m2(self) -> Floats:
        """Area of each triangle at rest, m2, ``(triangles,)``."""
        return self.rest.areas_m2

    @property
    def designable(self) -> Bools:
        """Triangles that may be reinforced, ``(triangles,)``."""
        return self.garment.designable

    @property
    def solver_name(self) -> str:
        """Which sparse Cholesky is at work."""
        return self._solver.name

    def solve(self, design: Bools, start: Floats | None = None) -> Equilibrium:
        """The equilibrium with the triangles of ``design`` reinforced.

        :param design: reinforced triangles, ``(triangles,)``.
        :param start: positions to start from, m, ``(vertices, 3)``, float64: those of a similar design or pose; None starts from
            the posed body's copy.
        :return: the equilibrium, or the nearest to it that was found.
        :raises InputError: arrays of the wrong shape or kind.
        """
        if design.shape != (len(self.triangles),) or design.dtype != np.bool_:
            raise InputError(f"design is {design.dtype} of shape {design.shape}; expected bool of shape ({len(self.triangles)},)")
        if start is not None:
            require_float64("start", start)
            if start.shape != self._skin.copy_m.shape or not np.isfinite(start).all():
                raise InputError(
                    f"start has shape {start.shape} or is not finite; expected finite numbers of shape {self._skin.copy_m.shape}"
                )
        self._constants = self._lame[design.astype(np.int64)]
        # Where the body has moved since, cloth may lie inside it: first onto the skin, from where the contact feels it.
        self._homes = self._skin.homes
        x = self._skin.copy_m if start is None else self._outside(start)
        left = np.full_like(self._homes, -1)
        near = max(self.tolerance_n, NEAR_N)
        solution = equilibrium(self.state, self._solver, x, near, COLD_DAMPING_N_M3 if start is None else 0.0)
        steps, moved = solution.steps, True
        for _ in range(MAX_ROUNDS):
            if not solution.converged or not moved:
                break
            moved = self._go_home(solution.positions_m, left) or solution.residual_n > self.tolerance_n
            if moved:
                solution = equilibrium(self.state, self._solver, solution.positions_m, self.tolerance_n)
                steps += solution.steps
        x = solution.positions_m
        energies = self.membrane.element_energy_j(x, self._constants)
        held, _ = self._away(x, self._skin)
        return Equilibrium(
            x,
            solution.converged,
            solution.residual_n,
            self.tolerance_n,
            steps,
            float(energies.sum()),
            energies,
            self.membrane.stretches(x),
            0.5 * float(self._attachment_n_m @ np.einsum("ij,ij->i", held, held)),
            float(self._contact.energy_j(self._skin.surface.distance_m(x, self._homes)).sum()),
        )

    def state(self, positions_m: Floats) -> WornState:
        """The garment at any positions, with the design of the last ``solve``.

        :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
        :return: energy, force and stiffness there.
        """
        return WornState(self, positions_m)

    def _go_home(self, positions_m: Floats, left: Ints) -> bool:
        """Let the vertices' homes follow them; True where that moves the skin that a vertex feels.

        Homes stay while Newton's method is at work: in a crease another home may see other skin, and energy would jump. There a
        vertex may be drawn to and fro between two homes: none goes back to one that it has ``left``.
        """
        surface, before = self._skin.surface, self._homes
        now = surface.walk_home(positions_m, before)
        now = np.where(now == left, before, now)
        left[:] = np.where(now != before, before, left)
        felt = [np.minimum(surface.distance_m(positions_m, homes), 0.0) for homes in (before, now)]
        self._homes = now
        return bool(np.abs(felt[1] - felt[0]).max() > SAME_SKIN_M)

    def _outside(self, positions_m: Floats) -> Floats:
        """``positions_m`` with what lies too deep inside the body brought onto its surface."""
        self._homes = self._skin.surface.walk_home(positions_m, self._skin.homes)
        deep = self._skin.surface.distance_m(positions_m, self._homes) < -DEEP_M
        x = positions_m.copy()
        if deep.any():
            x[deep], self._homes[deep] = self._skin.surface.project(positions_m[deep], self._homes[deep])
        return x


class WornState:
    """The garment at some positions: energy, force and stiffness, each worked out when first asked for.

    :param worn: the garment, with the design of its last ``solve``.
    :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
    """

    def __init__(self, worn: GarmentOnBody, positions_m: Floats):
        self._worn, self.positions_m = worn, positions_m
        cloth = worn.membrane.element_energy_j(positions_m, worn._constants).sum()
        self.energy_j = float(cloth) + worn.pose_energy_j(positions_m, worn._skin)

    @cached_property
    def _felt(self) -> tuple[Floats, Floats, Floats]:
        return self._worn._skin.surface.distance_and_curvature(self.positions_m, self._worn._homes)

    @property
    def force_n(self) -> Floats:
        """Derivative of the energy by the positions, N, ``(vertices, 3)``."""
        return self._force_n

    @cached_property
    def _force_n(self) -> Floats:
        worn = self._worn
        out = worn.membrane.gradient_n(self.positions_m, worn._constants)
        held, placed = worn._away(self.positions_m, worn._skin)
        pull = worn._attachment_n_m[:, None] * held / 3
        for k in range(3):
            np.add.at(out, worn.triangles[worn._attached, k], pull)
        phi, gradient, _ = self._felt
        return out + worn._placing_n_m[:, None] * placed + worn._contact.slope_n(phi)[:, None] * gradient

    def stiffness(self, damping_n_m3: float) -> Floats:
        """Second derivative of the energy in the garment's pattern.

        :param damping_n_m3: stiffness per area added at each vertex, N/m3; 0 adds none.
        :return: the matrix's entries, N/m, ``(entries,)``.
        """
        worn = self._worn
        element = worn.membrane.element_hessians_n_m(self.positions_m, worn._constants)
        for a in range(3):
            for b in range(3):
                for i in range(3):
                    element[worn._attached, 3 * a + i, 3 * b + i] += worn._attachment_n_m / 9
        phi, gradient, hessian = self._felt
        vertex = worn._contact.stiffness_n_m(phi)[:, None, None] * gradient[:, :, None] * gradient[:, None, :]
        vertex += worn._contact.slope_n(phi)[:, None, None] * hessian
        vertex[:, range(3), range(3)] += (worn._placing_n_m + damping_n_m3 * worn.rest.vertex_areas_m2)[:, None]
        return worn._pattern.values(element, vertex)

    def after(self, step_m: Floats) -> Floats:
        """The cloth after a step, kept from diving into the body and sliding around it where it touches.

        Newton's step knows nothing of skin that a vertex does not touch yet: one that would land deep inside is set down on the
        surface, just deep enough for the next step to feel it. And along a straight line a vertex that slides by d leaves the
        skin by d^2/2R, 10 um for 1 mm on a forearm: vertices in contact end at the depth that the step's normal part asks for.

        :param step_m: Newton's step of each vertex, m, ``(vertices, 3)``.
        :return: positions, m, ``(vertices, 3)``.
        """
        surface, homes, rounding = self._worn._skin.surface, self._worn._homes, self._worn.interface.rounding_m
        phi, gradient, _ = self._felt
        x = self.positions_m + step_m
        touching = phi < 0
        landing = ~touching & (surface.distance_m(x, homes) < -rounding)
        depth = np.full(len(phi), -rounding)
        depth[touching] = phi[touching] + np.einsum("ij,ij->i", gradient[touching], step_m[touching])
        shallow = touching & (phi > -rounding)
        depth[shallow] = np.maximum(depth[shallow], phi[shallow] - rounding)
        moved = np.flatnonzero(touching | landing)
        now, normal = surface.distance_and_slope(x[moved], homes[moved])
        off = np.where(np.isfinite(now), depth[moved] - now, 0.0)
        x[moved] += (off / np.maximum(np.einsum("ij,ij->i", normal, normal), 0.25))[:, None] * normal
        return x


def require_float64(name: str, positions: Floats) -> None:
    """Refuse other kinds of number.

    :param name: what the message calls the array.
    :param positions: the array, of any shape.
    :raises InputError: not float64. In float32 rounding alone leaves some 4e-4 N, thousands of times the tolerance.
    """
    if np.asarray(positions).dtype != np.float64:
        raise InputError(
            f"{name} is {np.asarray(positions).dtype}; expected float64 "
            "(in float32 rounding alone leaves 4e-4 N, the tolerance is 1e-7 N)"
        )

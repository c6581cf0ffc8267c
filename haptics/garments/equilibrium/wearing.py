"""A garment worn through a whole motion: energy and joint torque by angle (thesis 5.3, evaluation)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from haptics.errors import InputError
from haptics.garments.bodies.body import Body
from haptics.garments.bodies.motions import Motion
from haptics.garments.equilibrium.simulation import TOLERANCE_N, Equilibrium, GarmentOnBody
from haptics.garments.garment import Garment
from haptics.garments.materials import CLOTH, INTERFACE, REINFORCED, Interface, Lame, Material
from haptics.garments.mesh import Bools, Floats

TURN_RAD = 1e-6
"""Half the change of angle over which the energy's slope is taken: 0.3 um at the end of a forearm."""


@dataclass(frozen=True, eq=False)
class WornMotion:
    """A garment on a body that makes one motion.

    :param body: who wears it.
    :param garment: what is worn.
    :param motion: what the body does.
    :param angle_deg: how far, degrees from straight.
    :param simulation: the garment, at rest where the motion starts, worn where it ends.
    """

    body: Body
    garment: Garment
    motion: Motion
    angle_deg: float
    simulation: GarmentOnBody

    def posed_m(self, angle_deg: float) -> Floats:
        """The body's vertices at an angle of the motion.

        :param angle_deg: degrees from straight, 0 to the motion's largest.
        :return: positions, m, ``(body vertices, 3)``.
        :raises InputError: an angle that the motion does not allow.
        """
        return self.body.posed_m(self.motion.pose(angle_deg))


@dataclass(frozen=True, eq=False)
class MotionEvaluation:
    """A design over a motion, from rest to the end.

    :param angles_deg: degrees from straight, ``(angles,)``.
    :param energy_j: strain energy of the cloth, J, ``(angles,)``.
    :param stored_j: all that is stored, in attachments and contact too: what the wearer has spent, J, ``(angles,)``.
    :param torque_n_m: d(stored)/d(angle) in the motion's direction, N m, ``(angles,)``: what the wearer must add. Where several
        joints move it is the sum of their torques, each times the joint's share of the angle.
    :param equilibria: one for each angle.
    """

    angles_deg: Floats
    energy_j: Floats
    stored_j: Floats
    torque_n_m: Floats
    equilibria: tuple[Equilibrium, ...]

    @property
    def converged(self) -> bool:
        """Every equilibrium was found."""
        return all(e.converged for e in self.equilibria)


def wear(
    body: Body,
    garment: Garment,
    motion: Motion,
    angle_deg: float | None = None,
    cloth: Material = CLOTH,
    reinforced: Material = REINFORCED,
    interface: Interface = INTERFACE,
    lame: Lame = "plane",
    solver: str | None = None,
    tolerance_n: float = TOLERANCE_N,
) -> WornMotion:
    """Put ``garment`` on ``body`` at the rest of ``motion`` and move it to the end.

    :param body: who wears it.
    :param garment: what is worn, cut for this body.
    :param motion: what the body does.
    :param angle_deg: how far, degrees from straight; None takes the motion's default.
    :param cloth: of triangles without reinforcement.
    :param reinforced: of triangles with it.
    :param interface: what holds the garment to the body.
    :param lame: see ``Material.lame_n_m``.
    :param solver: see ``cholesky.installed_solvers``; None takes the fastest.
    :param tolerance_n: on the 2-norm of the nodal forces, N.
    :return: the garment, worn at the end of the motion.
    :raises InputError: an angle that is not allowed, or one of ``GarmentOnBody``.
    """
    angle = motion.checked_deg(angle_deg)
    rest, end = (body.posed_m(motion.pose(a)) for a in (motion.rest_deg(angle), motion.end_deg(angle)))
    simulation = GarmentOnBody(garment, body.triangles, rest, end, cloth, reinforced, interface, lame, solver, tolerance_n)
    return WornMotion(body, garment, motion, angle, simulation)


def follow(worn: WornMotion, design: Bools, angles_deg: Sequence[float]) -> Iterator[tuple[Equilibrium, float, float]]:
    """The garment from angle to angle, each equilibrium started from the one before carried along with the skin.

    The simulation is back in the motion's end pose afterwards.

    :param worn: the garment on its body.
    :param design: reinforced triangles, ``(triangles,)``.
    :param angles_deg: degrees from straight, in the order of the motion.
    :return: yields for each angle the equilibrium, the energy stored in all (J) and the torque in the motion's direction (N m).
    :raises InputError: an angle that the motion does not allow.
    """
    simulation = worn.simulation
    direction = np.sign(worn.motion.end_deg(worn.angle_deg) - worn.motion.rest_deg(worn.angle_deg))
    before = None
    try:
        for angle in angles_deg:
            skin = simulation.wear(worn.posed_m(angle))
            start = None if before is None else before[0] + skin.copy_m - before[1]
            found = simulation.solve(design, start)
            before = found.positions_m, skin.copy_m
            pose_energy = simulation.pose_energy_j(found.positions_m, skin)
            yield found, found.energy_j + pose_energy, direction * _slope_n_m(worn, found.positions_m, angle)
    finally:
        simulation.wear(worn.posed_m(worn.motion.end_deg(worn.angle_deg)))


def evaluate_motion(worn: WornMotion, design: Bools, angles_deg: Sequence[float]) -> MotionEvaluation:
    """Energy and torque of a design at each of some angles, in their order.

    :param worn: the garment on its body.
    :param design: reinforced triangles, ``(triangles,)``.
    :param angles_deg: degrees from straight, at least one; ``motion.path`` gives some.
    :return: curves over the angles; ``converged`` is false where an equilibrium is missing.
    :raises InputError: no angle, or one that the motion does not allow.
    """
    if not len(angles_deg):
        raise InputError("angles_deg is empty; expected at least one angle")
    found = list(follow(worn, design, angles_deg))
    return MotionEvaluation(
        np.array(angles_deg, dtype=np.float64),
        np.array([e.energy_j for e, _, _ in found]),
        np.array([stored for _, stored, _ in found]),
        np.array([torque for _, _, torque in found]),
        tuple(e for e, _, _ in found),
    )


def _slope_n_m(worn: WornMotion, positions_m: Floats, angle_deg: float) -> float:
    """dE/d(angle) with the cloth held: in equilibrium the whole derivative. One-sided at the ends of the allowed angles."""
    turn = np.degrees(TURN_RAD)
    low, high = max(angle_deg - turn, 0.0), min(angle_deg + turn, worn.motion.largest_deg)

    def energy_j(angle: float) -> float:
        return worn.simulation.pose_energy_j(positions_m, worn.simulation.skin(worn.posed_m(angle)))

    if low == 0.0 or high == worn.motion.largest_deg:  # second order from three points on one side
        side = turn if low == 0.0 else -turn
        points = [energy_j(angle_deg + k * side) for k in range(3)]
        return (-1.5 * points[0] + 2.0 * points[1] - 0.5 * points[2]) / np.radians(side)
    return (energy_j(high) - energy_j(low)) / np.radians(high - low)

"""One to eight brakes, what drives them and what pulls on them: one parameter set for every level of the brake model."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.physics.brake.charging import DRIVE, DriveParameters
from haptics.physics.brake.contact import CONTACT, ContactParameters
from haptics.physics.brake.finger import FINGER, FingerParameters
from haptics.physics.brake.fitted_law import ForceLaw
from haptics.physics.brake.force_laws import default_law
from haptics.physics.brake.parameters import BRAKE, BrakeParameters, capacitance_f
from haptics.units import in_range, one_of

MAX_OUTPUTS = 8
_TABLE_POINTS = 1000
"""Minimum number of table steps between 0 V and breakdown."""


@dataclass(frozen=True)
class BrakeSystem:
    """Brakes in parallel on one supply.

    :param brake: strips and dielectric.
    :param drive: supply and bridge.
    :param contact: lag of the contact.
    :param finger: what pulls.
    :param laws: of the holding force, one for each output; their number is the number of outputs, 1 to 8.
    :param force_gain: a brake's force over its law's; one for all, or one each, 0 to 10.
    :param overlaps_m2: of each brake at first; none: ``brake.overlap_m2``. 0 means that nothing is connected: no force at all.
    :param strips: stacked pairs in each brake, 1 to 64.
    :param reversal: clamped or direct, see ``charging``.
    :raises InputError: anything outside these.
    """

    brake: BrakeParameters = BRAKE
    drive: DriveParameters = DRIVE
    contact: ContactParameters = CONTACT
    finger: FingerParameters = FINGER
    laws: tuple[ForceLaw, ...] = (default_law("index"),)
    force_gain: tuple[float, ...] = (1.0,)
    overlaps_m2: tuple[float, ...] | None = None
    strips: int = 1
    reversal: str = "clamped"

    def __post_init__(self) -> None:
        if not 1 <= len(self.laws) <= MAX_OUTPUTS:
            raise InputError(f"{len(self.laws)} force laws given; 1 to {MAX_OUTPUTS} allowed, one per output")
        if len(self.force_gain) not in (1, len(self.laws)):
            raise InputError(
                f"force_gain has {len(self.force_gain)} gains; allowed: one for all, or {len(self.laws)}, one per output"
            )
        if self.overlaps_m2 is not None and len(self.overlaps_m2) != len(self.laws):
            raise InputError(f"overlaps_m2 has {len(self.overlaps_m2)} overlaps; expected {len(self.laws)}, one per output")
        for gain in self.force_gain:
            in_range("force_gain", gain, 0.0, 10.0)
        for overlap_m2 in self.overlaps_m2 or ():
            in_range("overlaps_m2", overlap_m2, 0.0, 1.0, "m2")
        in_range("strips", self.strips, 1, 64)
        one_of("reversal", self.reversal, ("clamped", "direct"))

    @property
    def outputs(self) -> int:
        """Number of outputs, one for each law."""
        return len(self.laws)

    @property
    def breakdown_v(self) -> float:
        """Volts above which there is no brake but a fault, thickness times breakdown field."""
        return self.brake.breakdown_v_per_m * self.brake.thickness_m

    def overlap_m2(self, output: int) -> float:
        """Overlap at first, before anything slid.

        :param output: from 0.
        :return: area (m2).
        """
        return self.brake.overlap_m2 if self.overlaps_m2 is None else self.overlaps_m2[output]

    def capacitance_f(self, output: int, slid_m: float = 0.0) -> float:
        """Capacitance of one output whose strips have slid apart.

        :param output: from 0.
        :param slid_m: how far (m), 0 or more.
        :return: capacitance (F).
        """
        left_m2 = self.overlap_m2(output) * self.share(output, slid_m)
        return capacitance_f(left_m2, self.brake.thickness_m, self.brake.permittivity, self.strips)

    def share(self, output: int, slid_m: float) -> float:
        """Overlap that is left over overlap at first.

        :param output: from 0.
        :param slid_m: how far the strips slid apart (m), 0 or more.
        :return: 0 to 1; 0 where nothing is connected.
        """
        full_m2 = self.overlap_m2(output)
        return max(0.0, 1.0 - self.brake.width_m * slid_m / full_m2) if full_m2 > 0.0 else 0.0

    def full_force_n(self, output: int, volts: float) -> float:
        """Steady capacity before anything slid, by the output's law and gain.

        It extrapolates the law: plants go wherever a board drives them, and ``check_volts`` is their limit.

        :param output: from 0.
        :param volts: amplitude (V), 0 or more.
        :return: capacity (N); 0 where nothing is connected.
        """
        return self.full_force(output)(volts)

    def full_force(self, output: int) -> Callable[[float], float]:
        """``full_force_n`` of one output as a function of volts: what does not depend on them is computed once.

        :param output: from 0.
        :return: capacity (N) at an amplitude (V).
        """
        full_m2, brake = self.overlap_m2(output), self.brake
        if full_m2 <= 0.0:
            return lambda _: 0.0
        gain = self.force_gain[output if len(self.force_gain) > 1 else 0]
        force_n = self.laws[output].of_volts(full_m2, brake.thickness_m, brake.permittivity, self.strips)
        return lambda volts: gain * force_n(volts)

    def check_volts(self, volts: float) -> float:
        """Refuse volts that supply or dielectric do not stand.

        :param volts: setpoint (V).
        :return: the same volts, as a float.
        :raises InputError: negative, above the supply's, or past breakdown.
        """
        volts = in_range("volts", volts, 0.0, self.drive.supply_volts, "V")
        if volts > self.breakdown_v:
            field, max_field = volts / self.brake.thickness_m * 1e-6, self.brake.breakdown_v_per_m * 1e-6
            raise InputError(
                f"volts = {volts:g} V makes a field of {field:.4g} V/um, past breakdown: a fault, not a force; "
                f"must be at most {self.breakdown_v:g} V ({max_field:g} V/um)"
            )
        return volts


class ForceTable:
    """Steady capacity of one output over volts, straight between points a volt apart (closer where breakdown is below 1 kV).

    For the thesis' brake within 3 uN of the law, and far cheaper. Every law is linear in overlap but for the off force, so that
    one table serves any overlap: ``F = F_off + share (F_full - F_off)``.

    :param system: the brakes.
    :param output: whose force it is, from 0.
    """

    def __init__(self, system: BrakeSystem, output: int):
        self._system, self._output = system, output
        self._points: dict[int, float] = {}
        self.per_volt = table_per_volt(system)
        self.off_n = system.full_force_n(output, 0.0)

    def force_n(self, volts: float, share: float = 1.0) -> float:
        """Steady capacity at a voltage.

        :param volts: magnitude (V).
        :param share: overlap left over overlap at first, 0 to 1.
        :return: capacity (N).
        """
        at = volts * self.per_volt
        low = int(at)
        points = self._points
        if low in points and low + 1 in points:
            below, above = points[low], points[low + 1]
        else:
            below, above = self._point(low), self._point(low + 1)
        full_n = below + (above - below) * (at - low)
        return full_n if share == 1.0 else self.off_n + (full_n - self.off_n) * share

    def _point(self, index: int) -> float:
        points = self._points
        if index not in points:
            points[index] = self._system.full_force_n(self._output, index / self.per_volt)
        return points[index]

    def array(self, up_to_v: float) -> NDArray[np.float64]:
        """The points from 0 V on, for compiled loops.

        :param up_to_v: the points reach beyond these volts.
        :return: (points,), N, ``1 / per_volt`` V apart.
        """
        return np.array([self._point(k) for k in range(int(up_to_v * self.per_volt) + 3)])


def table_per_volt(system: BrakeSystem) -> float:
    """How densely a force table stands.

    :param system: the brakes; the lower their breakdown, the denser.
    :return: points a volt, a whole number from 1.
    """
    return float(max(1, math.ceil(_TABLE_POINTS / system.breakdown_v)))

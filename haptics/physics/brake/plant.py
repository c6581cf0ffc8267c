"""What every level of the brake model offers to a board: one interface, so that levels swap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.system import BrakeSystem


@dataclass(frozen=True, slots=True)
class BrakeEvent:
    """Something a brake did.

    :param time_s: when (s), in the clock of ``drive`` and ``advance``.
    :param output: which brake, from 0.
    :param kind: half_capacity: capacity passed half of what the drive's volts will give; once a drive at most.
    :param force_n: capacity that was passed (N).
    """

    time_s: float
    output: int
    kind: str
    force_n: float


class BrakePlant(Protocol):
    """One to eight brakes on one supply, driven by a setpoint and pulled by hands, that carry themselves through time.

    Times are seconds in any one clock and must not go back. Forces and positions of the stepped levels are those at the last
    whole step; steps lie on a fixed grid from the start on, so that how time is cut into calls of ``advance`` changes nothing.
    Every method raises ``InputError`` for a time that goes back, an output there is none of, or a number outside its range.
    """

    level: str
    """Name of the level, one of ``levels.LEVELS``."""
    stage: OutputStage
    """Supply and bridge: every level has its volts, charge and energy from the closed form."""

    @property
    def system(self) -> BrakeSystem:
        """What was built: brakes, supply, contact, finger."""
        ...

    def drive(self, time_s: float, mask: int, volts: float, frequency_hz: float) -> None:
        """From ``time_s`` on: a square wave on the outputs in ``mask``, all others shorted; see ``OutputStage.drive``.

        :param time_s: when (s), not before ``now_s``.
        :param mask: one bit an output; 0 shorts all.
        :param volts: amplitude (V), 0 to the supply's.
        :param frequency_hz: of the wave (Hz), 0 (constant) to the bridge's.
        :raises InputError: also volts past breakdown: there is no force then, but a fault.
        """
        ...

    def pins(self, time_s: float, mask: int, volts: float, polarity: int, enabled: bool = True) -> None:
        """From ``time_s`` on, what a controller's pins set, edge by edge; see ``OutputStage.pins``.

        Volts past breakdown are no error here: the dielectric breaks down when it sees them.

        :param time_s: when (s), not before ``now_s``.
        :param mask: outputs on the bridge, one bit each.
        :param volts: setpoint of the supply (V), 0 to the supply's.
        :param polarity: of the bridge, +1 or -1; 0: its legs are shorted.
        :param enabled: False: the supply gives nothing.
        """
        ...

    def move(self, output: int, time_s: float, position_m: float, speed_m_s: float = 0.0) -> None:
        """From ``time_s`` on the hand of this output is at ``position_m + speed_m_s (t - time_s)``.

        :param output: whose hand, from 0.
        :param time_s: when (s), not before ``now_s``.
        :param position_m: within 10 m.
        :param speed_m_s: within 100 m/s.
        """
        ...

    def set_output(
        self,
        time_s: float,
        output: int,
        *,
        travel_m: float | None = None,
        leak_ohm: float | None = None,
        breakdown_v: float | None = None,
    ) -> None:
        """Change an output while it runs.

        :param time_s: when (s), not before ``now_s``.
        :param output: which, from 0.
        :param travel_m: strips slid apart besides what a hand does (m), 0 to 10; None: as it was.
        :param leak_ohm: leak across the output (ohm), infinite: none; None: as it was.
        :param breakdown_v: volts that the dielectric stands from now on, infinite: any; None: as it was.
        """
        ...

    def advance(self, to_s: float) -> None:
        """Carry everything to a time.

        :param to_s: time (s), not before ``now_s``.
        """
        ...

    def take_events(self) -> list[BrakeEvent]:
        """Events since the last call, in order. One may come up to a step after ``advance`` has passed it.

        :return: events in order of time; empty if there were none.
        """
        ...

    def voltage_v(self, output: int) -> float:
        """Signed voltage on one output now.

        :param output: from 0.
        :return: volts.
        """
        ...

    def amplitude_v(self, output: int) -> float:
        """Amplitude reached; see ``OutputStage.amplitude_v``.

        :param output: from 0.
        :return: volts, unsigned.
        """
        ...

    def steady_force_n(self, output: int, volts: float) -> float:
        """Capacity that the law gives at constant volts with the overlap there is now.

        :param output: from 0.
        :param volts: amplitude (V), up to the supply's and to breakdown.
        :return: capacity (N).
        """
        ...

    @property
    def now_s(self) -> float:
        """Time advanced to (s)."""
        ...

    @property
    def mask(self) -> int:
        """Outputs on the bridge, one bit each."""
        ...

    @property
    def voltages_v(self) -> list[float]:
        """Signed volts on every output."""
        ...

    @property
    def capacity_n(self) -> list[float]:
        """What each brake can hold now (N)."""
        ...

    @property
    def tension_n(self) -> list[float]:
        """What each finger feels (N), at most the capacity."""
        ...

    @property
    def slip_m(self) -> list[float]:
        """How far each brake's strips were pulled apart by its hand (m)."""
        ...

    @property
    def finger_m(self) -> list[float]:
        """Where each finger is (m), 0 at first."""
        ...

    @property
    def bus_v(self) -> float:
        """Volts at the supply's output."""
        ...

    @property
    def supply_current_a(self) -> float:
        """What the supply gives now (A), bleeder included."""
        ...

    @property
    def supply_energy_j(self) -> float:
        """Energy that the supply has given since the start (J)."""
        ...

    @property
    def supply_charge_c(self) -> float:
        """Charge that the supply has given since the start (C)."""
        ...

    @property
    def stored_charge_c(self) -> float:
        """Sum of the magnitudes of charge on all outputs (C)."""
        ...

    @property
    def next_event_s(self) -> float | None:
        """When volts (level ``static``: or forces) next change their course by themselves (s), or None."""
        ...

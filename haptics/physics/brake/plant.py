"""What every level of the brake model offers to a board: one interface, so that levels swap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.system import BrakeSystem


@dataclass(frozen=True, slots=True)
class BrakeEvent:
    """Something a brake did. ``time_s`` in the clock of ``drive`` and ``advance``.

    half_capacity: capacity passed half of what the drive's volts will give, ``force_n``; once a drive at most.
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

    @property
    def level(self) -> str: ...

    @property
    def system(self) -> BrakeSystem: ...

    @property
    def stage(self) -> OutputStage:
        """Supply and bridge: every level has its volts, charge and energy from the closed form."""
        ...

    def drive(self, time_s: float, mask: int, volts: float, frequency_hz: float) -> None:
        """From ``time_s`` on: a square wave on the outputs in ``mask``, all others shorted; see ``OutputStage.drive``.

        :raises InputError: also volts past breakdown: there is no force then, but a fault.
        """
        ...

    def pins(self, time_s: float, mask: int, volts: float, polarity: int, enabled: bool = True) -> None:
        """From ``time_s`` on, what a controller's pins say, edge by edge; see ``OutputStage.pins``.

        Volts past breakdown are no error here: the dielectric breaks down when it sees them.
        """
        ...

    def move(self, output: int, time_s: float, position_m: float, speed_m_s: float = 0.0) -> None:
        """From ``time_s`` on the hand of this output is at ``position_m + speed_m_s (t - time_s)``, within 10 m and 100 m/s."""
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
        """Slide strips apart by ``travel_m`` besides what a hand does, put a leak across the output (infinite: none), or say what
        volts the dielectric stands from now on."""
        ...

    def advance(self, to_s: float) -> None:
        """Carry everything to ``to_s``."""
        ...

    def take_events(self) -> list[BrakeEvent]:
        """Events since the last call, in order. One may come up to a step after ``advance`` has passed it."""
        ...

    def voltage_v(self, output: int) -> float: ...

    def amplitude_v(self, output: int) -> float:
        """Amplitude reached; see ``OutputStage.amplitude_v``."""
        ...

    def steady_force_n(self, output: int, volts: float) -> float:
        """Capacity that the law gives at constant ``volts`` with the overlap there is now."""
        ...

    @property
    def now_s(self) -> float: ...

    @property
    def mask(self) -> int: ...

    @property
    def voltages_v(self) -> list[float]: ...

    @property
    def capacity_n(self) -> list[float]:
        """What each brake can hold now."""
        ...

    @property
    def tension_n(self) -> list[float]:
        """What each finger feels, at most the capacity."""
        ...

    @property
    def slip_m(self) -> list[float]:
        """How far each brake's strips were pulled apart by its hand."""
        ...

    @property
    def finger_m(self) -> list[float]: ...

    @property
    def bus_v(self) -> float: ...

    @property
    def supply_current_a(self) -> float: ...

    @property
    def supply_energy_j(self) -> float: ...

    @property
    def supply_charge_c(self) -> float: ...

    @property
    def stored_charge_c(self) -> float: ...

    @property
    def next_event_s(self) -> float | None:
        """When volts (level ``static``: or forces) next change their course by themselves, or None."""
        ...

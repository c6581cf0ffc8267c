"""What every level of the latch model offers to a board: one interface, so that levels swap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

Latched = Literal["on", "off", "between"]
EventKind = Literal["reached_skin", "left_skin", "reached_off"]


@dataclass(frozen=True, slots=True)
class LatchEvent:
    """Something the pin did. ``time_s`` is exact, in the clock of ``drive`` and ``advance``.

    reached_skin: at the stop on the skin side, for the first time since it was away. left_skin: further than
    ``near_stop_m`` from that stop again. reached_off: at the off stop, for the first time since it was away.
    Bounces closer than ``near_stop_m`` make no events.
    """

    time_s: float
    kind: EventKind
    speed_m_s: float


class LatchPlant(Protocol):
    """One actuator that is driven by terminal volts and carries itself through time.

    Times are seconds in any one clock and must not go back. Volts are positive toward the skin; 0 means that the bridge
    shorts the coil (its current dies away with ``L/R``; braking by induced current is in the model and negligible).
    How time is cut into calls of ``advance`` does not change the result; only the calls of ``drive`` do.
    """

    rise_k: float
    """The coil's rise above the room; set by the owner, taken up at the next ``drive``."""

    def drive(self, time_s: float, volts: float) -> None:
        """Put ``volts`` on the terminals from ``time_s`` on."""
        ...

    def advance(self, to_s: float) -> None:
        """Carry the actuator to ``to_s``; costs next to nothing while at rest."""
        ...

    def load_skin(self, time_s: float, stiffness_n_m: float, at_m: float) -> None:
        """From ``time_s`` on, a skin of this stiffness begins at this position (0 N/m: none)."""
        ...

    def take_events(self) -> list[LatchEvent]:
        """Events since the last call, in order. One may come up to a step (20 us) after ``advance`` has passed it."""
        ...

    @property
    def position_m(self) -> float:
        """0 at the off stop, ``stroke_m`` at the skin's; a little beyond while a stop is compressed."""
        ...

    @property
    def speed_m_s(self) -> float: ...

    @property
    def current_a(self) -> float: ...

    @property
    def energy_j(self) -> float:
        """Electrical energy taken at the terminals since the beginning."""
        ...

    @property
    def at_rest(self) -> bool: ...

    @property
    def latched(self) -> Latched: ...

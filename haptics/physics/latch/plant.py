"""What every level of the latch model offers to a board: one interface, so that levels swap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

from haptics.errors import InputError
from haptics.physics.latch.parameters import LatchParameters

Latched = Literal["on", "off", "between"]
DEEPEST = 0.9
"""How deep into a stop the plates' law is followed, in plate lengths; at a whole one it has a pole."""
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
        """Events since the last call, in order. One may come up to a step (50 us) after ``advance`` has passed it."""
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
    def outside(self) -> tuple[str, ...]:
        """What was asked of the actuator that its level does not answer for; empty if nothing."""
        ...

    @property
    def latched(self) -> Latched: ...


def checked_resistance(parameters: LatchParameters, rise_k: float) -> float:
    """Resistance (ohm) of a coil that is ``rise_k`` above the room, ``R0 (1 + alpha rise)``.

    :raises InputError: it would not be positive.
    """
    resistance = parameters.resistance_ohm * (1.0 + parameters.resistance_per_k * rise_k)
    if not 0.0 < resistance < math.inf:
        raise InputError(f"rise_k = {rise_k:g} K makes the coil's resistance {resistance:g} ohm; it must stay positive")
    return resistance


def checked_time(to_s: float, now_s: float) -> float:
    """``to_s`` if it is a time that comes, and not before ``now_s``.

    :raises InputError: it is not.
    """
    if not now_s <= to_s < math.inf:
        raise InputError(f"time = {to_s!r} s is not allowed; allowed: any from {now_s!r} s on; time only moves forward")
    return to_s


class BeyondStop(InputError):
    """A pin is pressed so deep into a stop that the plates' law has no meaning there."""


def beyond_stop(parameters: LatchParameters, volts: float) -> BeyondStop:
    """What to raise then, in words."""
    return BeyondStop(
        f"volts = {volts:g} V is not allowed with {parameters}: it presses the pin more than "
        f"{DEEPEST * parameters.plate_length_m * 1e3:.3g} mm into a stop, past all that the forces are known for"
    )


def latched_at(position_m: float, parameters: LatchParameters) -> Latched:
    """The stop that a pin at this position is latched to: closer than ``near_stop_m``."""
    if position_m > parameters.stroke_m - parameters.near_stop_m:
        return "on"
    return "off" if position_m < parameters.near_stop_m else "between"

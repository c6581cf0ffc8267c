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
    """Something the pin did. Bounces closer than ``near_stop_m`` make no events.

    :param time_s: when (s), exact, in the clock of ``drive`` and ``advance``.
    :param kind: reached_skin: at the stop on the skin side, for the first time since it was away. left_skin: further than
        ``near_stop_m`` from that stop again. reached_off: at the off stop, for the first time since it was away.
    :param speed_m_s: of the pin then (m/s), positive toward the skin.
    """

    time_s: float
    kind: EventKind
    speed_m_s: float


class LatchPlant(Protocol):
    """One tactor that is driven by terminal volts and carries itself through time.

    Times are seconds in any one clock and must not go back. Volts are positive toward the skin; 0 means that the bridge
    shorts the coil (its current dies away with ``L/R``; braking by induced current is in the model and negligible).
    How time is cut into calls of ``advance`` does not change the result; only the calls of ``drive`` do.
    """

    rise_k: float
    """The coil's rise above the room; set by the owner, taken up at the next ``drive``."""

    def drive(self, time_s: float, volts: float) -> None:
        """Put volts on the terminals.

        :param time_s: when (s), not before the time advanced to.
        :param volts: within 1 kV; positive toward the skin, 0 shorts the coil.
        :raises InputError: time going back, a number outside its range, or a coil so cold that no resistance is left.
        """
        ...

    def advance(self, to_s: float) -> None:
        """Carry the tactor to a time; costs next to nothing while at rest.

        :param to_s: time (s), not before the time advanced to.
        :raises InputError: time going back; at any level but ``event``, a pin pressed deeper into a stop than the forces are
            known for.
        """
        ...

    def load_skin(self, time_s: float, stiffness_n_m: float, at_m: float) -> None:
        """Put a skin under the pin.

        :param time_s: when (s), not before the time advanced to.
        :param stiffness_n_m: of the skin (N/m), 0: none.
        :param at_m: position (m) where the pin meets it.
        :raises InputError: time going back, or a number outside its range.
        """
        ...

    def take_events(self) -> list[LatchEvent]:
        """Events since the last call, in order. One may come up to a step (50 us) after ``advance`` has passed it.

        :return: events in order of time; empty if there were none.
        """
        ...

    @property
    def position_m(self) -> float:
        """Position (m): 0 at the off stop, ``stroke_m`` at the skin's; a little beyond while a stop is compressed."""
        ...

    @property
    def speed_m_s(self) -> float:
        """Speed of the pin (m/s), positive toward the skin."""
        ...

    @property
    def current_a(self) -> float:
        """Current through the coil (A), positive toward the skin."""
        ...

    @property
    def energy_j(self) -> float:
        """Electrical energy taken at the terminals since the beginning (J)."""
        ...

    @property
    def at_rest(self) -> bool:
        """Whether the pin is still and the current settled."""
        ...

    @property
    def outside(self) -> tuple[str, ...]:
        """What was asked of the tactor that its level does not answer for; empty if nothing."""
        ...

    @property
    def latched(self) -> Latched:
        """The stop that the pin is latched to, or between."""
        ...


def checked_resistance(parameters: LatchParameters, rise_k: float) -> float:
    """Resistance of a warm coil, ``R0 (1 + alpha rise)``.

    :param parameters: of the tactor.
    :param rise_k: the coil's rise above the room (K).
    :return: resistance (ohm).
    :raises InputError: it would not be positive.
    """
    resistance = parameters.resistance_ohm * (1.0 + parameters.resistance_per_k * rise_k)
    if not 0.0 < resistance < math.inf:
        raise InputError(f"rise_k = {rise_k:g} K makes the coil's resistance {resistance:g} ohm; it must stay positive")
    return resistance


def checked_time(to_s: float, now_s: float) -> float:
    """Refuse a time that goes back or never comes.

    :param to_s: time asked for (s).
    :param now_s: time advanced to (s).
    :return: ``to_s``.
    :raises InputError: it is not.
    """
    if not now_s <= to_s < math.inf:
        raise InputError(f"time = {to_s!r} s; must be at least {now_s!r} s; time only moves forward")
    return to_s


class BeyondStop(InputError):
    """A pin is pressed so deep into a stop that the plates' law has no meaning there."""


def beyond_stop(parameters: LatchParameters, volts: float) -> BeyondStop:
    """The error for a pin pressed too deep into a stop.

    :param parameters: of the tactor.
    :param volts: that press it (V).
    :return: the error, to be raised.
    """
    return BeyondStop(
        f"volts = {volts:g} V is not allowed with {parameters}: it presses the pin more than "
        f"{DEEPEST * parameters.plate_length_m * 1e3:.3g} mm into a stop, past all that the forces are known for"
    )


def latched_at(position_m: float, parameters: LatchParameters) -> Latched:
    """The stop that a pin at a position is latched to: closer than ``near_stop_m``.

    :param position_m: of the pin (m).
    :param parameters: of the tactor.
    :return: on, off or between.
    """
    if position_m > parameters.stroke_m - parameters.near_stop_m:
        return "on"
    return "off" if position_m < parameters.near_stop_m else "between"

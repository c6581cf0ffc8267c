"""What a link session tells its owner, in the order it happened. ``time_ns`` is host time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from haptics.errors import LinkError
from haptics.link.clock import ClockFit
from haptics.link.messages import Fault

NO_CHANNEL = 255
"""Channel of a fault that belongs to none."""


@dataclass(frozen=True, slots=True)
class Identified:
    """A board said who it is; ``identity`` is the message's named tuple."""

    time_ns: int
    identity: Any


@dataclass(frozen=True, slots=True)
class Ready:
    """Identified, clock measured, limits configured: commands are taken. Nothing is armed."""

    time_ns: int


@dataclass(frozen=True, slots=True)
class Telemetry:
    """``message`` is the named tuple as sent; ``time_ns`` is its board time on the host's clock."""

    time_ns: int
    message: Any


@dataclass(frozen=True, slots=True)
class FaultReported:
    """The board latched a fault; ``fault`` is a number if this table does not know it; ``channel`` may be ``NO_CHANNEL``."""

    time_ns: int
    fault: Fault | int
    channel: int
    value: int


@dataclass(frozen=True, slots=True)
class Disarmed:
    """The board is no longer armed and nobody here asked for that."""

    time_ns: int
    reason: str


@dataclass(frozen=True, slots=True)
class Rebooted:
    """The board started anew: its clock and queue are void, and it stays disarmed until somebody arms it."""

    time_ns: int
    old_boot_id: int
    new_boot_id: int


@dataclass(frozen=True, slots=True)
class Failed:
    """The handshake ended without a usable board (``NotABoard``, ``WrongFirmware``, ``CommandRefused``, ``ReplyTimeout``)."""

    time_ns: int
    error: LinkError


@dataclass(frozen=True, slots=True)
class Lost:
    """The port or the board went away; every open command has failed with ``error``."""

    time_ns: int
    error: LinkError


Event = Identified | Ready | ClockFit | Telemetry | FaultReported | Disarmed | Rebooted | Failed | Lost

"""What a link session reports to its owner, in the order it happened. ``time_ns`` is host time."""

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
    """A board sent its identity.

    :param time_ns: when it came, host time (ns).
    :param identity: the ``identity`` message.
    """

    time_ns: int
    identity: Any


@dataclass(frozen=True, slots=True)
class Ready:
    """Identified, clock measured, limits configured: commands are taken. Nothing is armed.

    :param time_ns: host time (ns).
    """

    time_ns: int


@dataclass(frozen=True, slots=True)
class Telemetry:
    """A telemetry message came.

    :param time_ns: its board time on the host's clock (ns).
    :param message: the message as sent, its fields in the table's units.
    """

    time_ns: int
    message: Any


@dataclass(frozen=True, slots=True)
class FaultReported:
    """The board latched a fault.

    :param time_ns: when, board time on the host's clock (ns).
    :param fault: the fault; a plain number if this table has no such fault.
    :param channel: output it belongs to, from 0, or ``NO_CHANNEL``.
    :param value: what was measured; its unit depends on the fault (``docs/reference/protocol.md``).
    """

    time_ns: int
    fault: Fault | int
    channel: int
    value: int


@dataclass(frozen=True, slots=True)
class Disarmed:
    """The board is no longer armed and its owner did not ask for that.

    :param time_ns: when this was noticed, host time (ns).
    :param reason: what showed it, in words.
    """

    time_ns: int
    reason: str


@dataclass(frozen=True, slots=True)
class FoundArmed:
    """During the handshake the board was still armed, by a host that is gone; it is stopped.

    :param time_ns: when this was noticed, host time (ns).
    """

    time_ns: int


@dataclass(frozen=True, slots=True)
class Rebooted:
    """The board started anew: its clock and queue are void, and it stays disarmed until somebody arms it.

    :param time_ns: when this was noticed, host time (ns).
    :param old_boot_id: u32 of the boot before.
    :param new_boot_id: u32 of this boot.
    """

    time_ns: int
    old_boot_id: int
    new_boot_id: int


@dataclass(frozen=True, slots=True)
class Failed:
    """The handshake ended without a usable board.

    :param time_ns: host time (ns).
    :param error: why: ``NotABoard``, ``WrongFirmware``, ``CommandRefused`` or ``ReplyTimeout``.
    """

    time_ns: int
    error: LinkError


@dataclass(frozen=True, slots=True)
class Lost:
    """The port or the board went away; every open command has failed.

    :param time_ns: host time (ns).
    :param error: why; open commands carry the same reason.
    """

    time_ns: int
    error: LinkError


Event = Identified | Ready | ClockFit | Telemetry | FaultReported | Disarmed | FoundArmed | Rebooted | Failed | Lost

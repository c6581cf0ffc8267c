"""What a driver reports of a request."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ResultKind = Literal["contact", "release", "pulse", "burst", "brake", "piezo"]
Reason = Literal[
    "superseded",  # by a newer request for the same pin, or by a release of the brake
    "heat",  # no room under the limit of the coil's temperature rise
    "current",  # as many coils are on as the supply can feed
    "contact",  # a pulse or burst for a pin that rests on the skin
    "outranked",  # a brake that an owner of higher priority, or of more volts, holds
    "cut",  # a burst, played in part
    "late",  # its time had passed
    "unarmed",  # no board is armed for it
    "ended",  # the glove went off first
    "stopped",  # likewise
    "clock",  # the board's clock is not known well enough to give it a time
    "unknown",  # the board did not answer, so nobody knows
    "company",  # refused with another coil's pulse in the same command
    "hot",  # by the board: its account of on-time is full
    "full",  # by the board: another pulse is in the way, or its queue is full
    "far",  # by the board: too far ahead
    "interlock",  # by the board: it is not armed, or a fault is latched
    "bad_value",  # by the board: beyond one of its limits
    "bad_length",  # by the board: not its protocol
]
"""Why a request was denied, or played only in part. What to do about each: ``docs/how-to/live.md``."""


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one request.

    :param site: of the array, or the name of a brake.
    :param kind: what was asked for.
    :param played: a board took it; a burst that was cut counts if one cycle of it played.
    :param reason: why it was denied or cut; None if it was played whole.
    :param requested_ns: when it was asked for, ns on the glove's clock.
    :param start_ns: when it begins, or was to, likewise; None if it came to no such time.
    :param owner: who asked for it, ``scene`` or ``program``; empty for what the driver did by itself, such as the withdrawing
        sweep of an arming.
    :param retry_ns: where it was denied, from when on the same can be asked for with hope, likewise; None where no waiting helps.
    """

    site: str
    kind: ResultKind
    played: bool
    reason: Reason | None
    requested_ns: int
    start_ns: int | None
    owner: str = ""
    retry_ns: int | None = None

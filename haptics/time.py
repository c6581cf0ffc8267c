"""Time: integer nanoseconds everywhere, from a clock that is handed in.

Virtual time makes a run repeatable to the byte; monotonic time runs hardware. Nothing below ``session`` picks a clock.
"""

from __future__ import annotations

import time as _time
from typing import Protocol

from haptics.errors import InputError

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
NS_PER_US = 1_000
LATEST_NS = 1 << 62
"""No time is later: 146 years, in whole numbers that a recording can hold."""


def seconds_to_ns(seconds: float) -> int:
    """Seconds as integer nanoseconds.

    :param seconds: s, of either sign.
    :return: ns, rounded to nearest.
    """
    return round(seconds * NS_PER_S)


class Clock(Protocol):
    """Something that has the time in nanoseconds and never goes back."""

    def now_ns(self) -> int:
        """The time.

        :return: ns, from a start of the clock's own.
        """
        ...


class VirtualClock:
    """A clock that moves only when it is moved.

    :param start_ns: what it shows at first, ns.
    """

    def __init__(self, start_ns: int = 0):
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """The time.

        :return: ns.
        """
        return self._now_ns

    def advance_to(self, to_ns: int) -> None:
        """Move forward.

        :param to_ns: to this time, ns.
        :raises InputError: ``to_ns`` lies in the past.
        """
        if to_ns < self._now_ns:
            raise InputError(f"to_ns = {to_ns} lies before the clock's {self._now_ns}; time only moves forward")
        self._now_ns = to_ns


class MonotonicClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """The time.

        :return: ns, from a start of the machine's own; it stands while the machine sleeps.
        """
        return _time.monotonic_ns()

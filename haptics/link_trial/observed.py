"""What a trial can see of a simulated board beyond its serial line: each edge of its outputs, and its own clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

Listener = Callable[[int, str, int, int], None]


@runtime_checkable
class ObservedPort(Protocol):
    """A simulated port that reports what its board's outputs really did. Times are nanoseconds of its world."""

    @property
    def virtual(self) -> bool:
        """Whether this port's time moves only when it is advanced."""
        ...

    @property
    def out_waiting(self) -> int:
        """Bytes that have not reached the board yet."""
        ...

    def watch(self, listener: Listener) -> None:
        """Report each edge of the outputs.

        :param listener: called as ``listener(time_ns, kind, channel, drive)``; kind is coil, brake or piezo, drive is 1 (on), -1
            (on with the other sign) or 0 (off).
        """
        ...

    def tick_ns(self, tick: int) -> int:
        """World time at which the board's own clock shows a tick, the one nearest to now.

        :param tick: u32.
        :return: nanoseconds.
        """
        ...

    def next_event(self) -> int | None:
        """Time of the next thing that happens by itself.

        :return: nanoseconds, or None if nothing is due.
        """
        ...

    def energised(self) -> list[int]:
        """Channels that carry current or dangerous volts now.

        :return: channel numbers, from 0.
        """
        ...

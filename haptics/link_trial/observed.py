"""What a trial can see of a simulated board beyond its serial line: each edge of its outputs, and its own clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

Listener = Callable[[int, str, int, int], None]


@runtime_checkable
class ObservedPort(Protocol):
    """A simulated port that tells what its board's outputs truly did. Times are nanoseconds of its world."""

    @property
    def virtual(self) -> bool:
        """Whether this port's time moves only when it is told to."""
        ...

    @property
    def out_waiting(self) -> int:
        """Bytes that have not reached the board yet."""
        ...

    def watch(self, listener: Listener) -> None:
        """Call ``listener(time_ns, kind, channel, drive)`` at each edge: coil, brake or piezo; 1, -1 (back) or 0 (off)."""
        ...

    def tick_ns(self, tick: int) -> int:
        """World time at which the board's own clock shows ``tick`` (u32), the one nearest to now."""
        ...

    def next_event(self) -> int | None:
        """Time of the next thing that happens by itself, or None."""
        ...

    def energised(self) -> list[int]:
        """Channels that carry current or dangerous volts now."""
        ...

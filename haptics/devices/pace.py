"""How far ahead commands leave the host: enough for the line and its clock, and for the time until the next tick."""

from __future__ import annotations

from collections import deque

from haptics.time import NS_PER_MS

COMMAND_LEAD_NS = 3 * NS_PER_MS
"""A command leaves the host this long before it acts: a tick, three frames at 500 kbaud, and the error of the clock."""
SHORTEST_LEAD_NS = COMMAND_LEAD_NS - NS_PER_MS
"""Without the tick. What would have to act sooner acts this much after now, rather than reach the board too late."""
LONGEST_SPACING_NS = 34 * NS_PER_MS
"""Ticks at 30 Hz. The lead grows no further: what it gives out cannot be taken back."""
_REMEMBERED = 5


class TickSpacing:
    """The time from tick to tick: the median of the last five, so that one late tick is not taken for a slow loop.

    :ivar ns: the spacing, 0 before there were three of them.
    """

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._spacings_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self.ns = 0

    def observe(self, now_ns: int) -> None:
        """There was a tick.

        :param now_ns: when, ns.
        """
        last_ns, self._last_ns = self._last_ns, now_ns
        if last_ns is None:
            return
        spacings_ns = self._spacings_ns
        spacings_ns.append(now_ns - last_ns)
        if now_ns - last_ns != self.ns and len(spacings_ns) > _REMEMBERED // 2:  # one more like the median leaves it as it is
            self.ns = sorted(spacings_ns)[len(spacings_ns) // 2]

    @property
    def lead_ns(self) -> int:
        """How far past a tick starts are given out, so that the spans of successive ticks touch."""
        return max(COMMAND_LEAD_NS, SHORTEST_LEAD_NS + min(self.ns, LONGEST_SPACING_NS))

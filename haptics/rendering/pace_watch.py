"""Whether a loop is ticked as often as it was planned for."""

from __future__ import annotations

from haptics.devices.pace import TickSpacing
from haptics.time import NS_PER_MS


class PaceWatch:
    """Watches the spacing of ticks.

    :param tick_ns: the planned length of a tick; at twice that or more the loop is too slow.
    """

    def __init__(self, tick_ns: int):
        self._tick_ns, self._spacing = tick_ns, TickSpacing()
        self._overrunning, self._overdue = False, 0

    @property
    def lead_ns(self) -> int:
        """How far past a tick starts are given out, so that the spans of successive ticks touch."""
        return self._spacing.lead_ns

    def observe(self, now_ns: int, overdue: int) -> str | None:
        """Take note of a tick.

        :param now_ns: the tick's time.
        :param overdue: pulses that came too late, counted from the start.
        :return: in words that the loop is too slow, once until it is fast enough again; else None.
        """
        self._spacing.observe(now_ns)
        was, spacing_ns = self._overrunning, self._spacing.ns
        self._overrunning = spacing_ns >= (1.5 if was else 2.0) * self._tick_ns
        if was or not self._overrunning:
            return None
        late, self._overdue = overdue - self._overdue, overdue
        came_late = f"{late} pulse{'s' * (late != 1)} came late; " if late else ""
        return f"ticked every {spacing_ns / NS_PER_MS:.3g} ms; {came_late}tick every {self._tick_ns / NS_PER_MS:.3g} ms"

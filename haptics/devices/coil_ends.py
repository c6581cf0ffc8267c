"""Strokes that adjoin for the host adjoin on the board, too, however fast its clock runs."""

from __future__ import annotations

from collections.abc import Mapping

from haptics.link.clock import signed_ticks
from haptics.link.messages import DURATION_UNIT_US, TICK_HZ

_TICKS_PER_UNIT = DURATION_UNIT_US * TICK_HZ // 1_000_000
_LONGEST_OVERLAP = TICK_HZ // 10_000
"""Ticks of 100 us: what a clock off by 0.6 %, as far as one may be, makes of a stroke of 10 ms, and what estimates move. More
than that is no matter of clocks, and for the board to refuse."""


class CoilEnds:
    """Board ticks at which each coil's last stroke ends.

    A start is the host's time on the board's clock, a duration is the board's own. Where that clock runs slow, a stroke of 3 ms
    has not ended when 3 ms have passed for the host: the stroke right behind it would be refused as ``full``, and a pin that was
    to come back would stay out.
    """

    def __init__(self) -> None:
        self._ends: dict[int, int] = {}

    def start(self, ticks: int, durations: Mapping[int, int]) -> int:
        """When a command has to start, so that on none of its coils it cuts into the stroke ahead.

        :param ticks: wanted start in board ticks (u32).
        :param durations: by coil, in the message's unit of 50 us.
        :return: start in board ticks (u32), at most 100 us later.
        """
        overlap = max((signed_ticks(self._ends[coil], ticks) for coil in durations if coil in self._ends), default=0)
        if 0 < overlap <= _LONGEST_OVERLAP:
            ticks = (ticks + overlap) % 2**32
        for coil, duration in durations.items():
            self._ends[coil] = (ticks + duration * _TICKS_PER_UNIT) % 2**32
        return ticks

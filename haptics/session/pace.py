"""The pace of a loop: absolute deadlines, in real time or in virtual time."""

from __future__ import annotations

import time

from haptics.time import NS_PER_S


class Pace:
    """Waits for each tick in real time and counts those missed by over a period; virtual time is on time.

    :param realtime: on the machine's clock.
    :param tick_ns: period, ns.

    :ivar missed: ticks that came over a period late; None in virtual time.
    """

    def __init__(self, realtime: bool, tick_ns: int):
        self._tick_ns = tick_ns
        self.missed: int | None = 0 if realtime else None

    def wait_for(self, planned_ns: int) -> int:
        """Wait for a tick.

        :param planned_ns: its time.
        :return: the time now, ns; later than planned where it is missed.
        """
        if self.missed is None:
            return planned_ns
        ahead_ns = planned_ns - time.monotonic_ns()
        if ahead_ns > 0:
            time.sleep(ahead_ns / NS_PER_S)
        now_ns = time.monotonic_ns()
        self.missed += now_ns - planned_ns > self._tick_ns
        return now_ns

"""Links served by the loop that uses them, in real time: no threads, so nothing takes the interpreter away from a tick.

A reply is noticed at the next poll, so the clock's error bound grows by half the polling period; a loop that hangs stops
feeding its boards, and they make themselves safe.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from haptics.link.connection import Link
from haptics.time import NS_PER_S, Clock, MonotonicClock, seconds_to_ns

POLL_S = 0.5e-3


class PollingRunner:
    """Serves links whenever it is called.

    :param links: links on open ports.
    :param clock: a clock that passes by itself; None: the machine's monotonic one.
    """

    def __init__(self, links: Sequence[Link], clock: Clock | None = None):
        self.links: Sequence[Link] = list(links)
        self.clock = clock if clock is not None else MonotonicClock()

    def now_ns(self) -> int:
        """The machine's time.

        :return: nanoseconds of the runner's clock.
        """
        return self.clock.now_ns()

    def poll(self) -> None:
        """Read what has come, do what is due, and write what is to be sent; waits for nothing."""
        for link in self.links:
            if link.error is None:
                link.service(self.clock.now_ns())

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Poll until a condition holds.

        :param condition: asked after each poll.
        :param timeout_s: longest wait (s).
        :return: whether the condition holds.
        """
        end_ns = self.now_ns() + seconds_to_ns(timeout_s)
        while True:
            self.poll()
            if condition():
                return True
            left_s = (end_ns - self.now_ns()) / NS_PER_S
            if left_s <= 0.0:
                return False
            time.sleep(min(POLL_S, left_s))

    def close(self) -> None:
        """Close the ports."""
        for link in self.links:
            link.close()

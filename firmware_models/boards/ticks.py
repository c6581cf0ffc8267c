"""A board's own clock: u32 ticks at 2 MHz nominal, which began somewhere and runs a little fast or slow.

``tick(t) = offset + floor((t - t0) * 2 MHz * (1 + drift))``, in whole numbers throughout, so that a time stamp names one
edge and nothing else.
"""

from __future__ import annotations

from haptics.link.messages import TICK_HZ

_WRAP = 1 << 32
_HALF = 1 << 31
_PPB = 1_000_000_000
_NS_PER_S = 1_000_000_000


def signed_difference(a: int, b: int) -> int:
    """``a - b`` of two u32 tick counts, across the wrap if that is nearer.

    :param a: count, 0 to 2**32 - 1.
    :param b: count, 0 to 2**32 - 1.
    :return: ticks, -2**31 to 2**31 - 1.
    """
    return ((a - b + _HALF) % _WRAP) - _HALF


class TickCounter:
    """World time to ticks and back.

    :param start_ns: world time at power-on, ns.
    :param hz: what counts, Hz; nominally, a divisor of 1 GHz times 1e9.
    :param offset: count at power-on (u32).
    :param drift_ppb: how much faster than nominal the board's crystal runs, parts in 1e9.
    """

    def __init__(self, start_ns: int, offset: int, drift_ppb: int, hz: int = TICK_HZ):
        self._start_ns = start_ns
        self._offset = offset
        self._rate = _PPB + drift_ppb
        self._scale = _NS_PER_S * _PPB // hz

    def count(self, time_ns: int) -> int:
        """Ticks at a time, not wrapped.

        :param time_ns: world time, ns.
        :return: ticks, ``offset`` at power-on.
        """
        return self._offset + (time_ns - self._start_ns) * self._rate // self._scale

    def u32(self, time_ns: int) -> int:
        """The count as it is sent.

        :param time_ns: world time, ns.
        :return: ticks modulo 2**32.
        """
        return self.count(time_ns) % _WRAP

    def time_ns(self, count: int) -> int:
        """First nanosecond at which the counter shows ``count``.

        :param count: ticks, not wrapped.
        :return: world time, ns.
        """
        return self._start_ns - (-(count - self._offset) * self._scale // self._rate)

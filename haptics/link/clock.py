"""The board's clock as seen from the host: what tick it is there, and how wrong that may be.

Four time stamps an exchange: the host sends at ``t0``, the board receives at tick ``b1`` and answers at ``b2``, the host has the
answer at ``t3``. Whatever the delays were, ``b1`` lies after ``t0`` and ``b2`` before ``t3``: an interval, not a guess. The
intervals of several exchanges are carried to the newest one and cut with each other, so the bound is as hard as its two
assumptions: the board's rate lies within ``tolerance`` of nominal, and within ``drift`` of its own mean over the window.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from haptics.link.messages import TICK_HZ
from haptics.time import NS_PER_S
from haptics.units import in_range

_WRAP = 1 << 32
_HALF = 1 << 31
_NS_PER_TICK = NS_PER_S / TICK_HZ


def signed_ticks(later: int, earlier: int) -> int:
    """``later - earlier`` of two wrapping tick counts, by the shorter arc.

    :param later: a u32 tick count.
    :param earlier: another one.
    :return: ticks from ``earlier`` to ``later``, -2**31 to 2**31 - 1 (negative where ``later`` comes first).
    """
    return ((later - earlier + _HALF) % _WRAP) - _HALF


class TickExtender:
    """Extends u32 ticks, which wrap every 2147 s, to a count that does not wrap: the one nearest to the latest seen."""

    def __init__(self) -> None:
        self._latest: int | None = None

    def extend(self, ticks: int) -> int:
        """Unwrapped count of ``ticks``; right as long as it lies within 1073 s of the latest seen.

        :param ticks: a u32 tick count; the first one sets the origin.
        :return: ticks (0.5 µs each) that do not wrap.
        """
        if self._latest is None:
            self._latest = ticks
            return ticks
        count = self._latest + signed_ticks(ticks, self._latest)
        self._latest = max(self._latest, count)
        return count


@dataclass(frozen=True, slots=True)
class ClockFit:
    """The board's clock at one moment.

    ``ticks(t) = reference_ticks + (t - reference_ns) / ns_per_tick``, true within ``error_bound_s(t)``.

    :param reference_ns: host time of the newest exchange.
    :param reference_ticks: unwrapped board ticks then.
    :param ns_per_tick: host nanoseconds a tick (500 nominal).
    :param error_s: half width of what the exchanges leave open at the reference, jitter included.
    :param drift: relative uncertainty of the rate; the bound grows by it with age.
    """

    reference_ns: int
    reference_ticks: float
    ns_per_tick: float
    error_s: float
    drift: float

    @property
    def offset_s(self) -> float:
        """Host time less board time (at nominal rate) at the reference."""
        return (self.reference_ns - self.reference_ticks * _NS_PER_TICK) / NS_PER_S

    @property
    def skew(self) -> float:
        """How much faster than nominal the board's clock runs, relative."""
        return _NS_PER_TICK / self.ns_per_tick - 1.0

    def age_s(self, host_ns: int) -> float:
        """Distance of ``host_ns`` from the newest exchange.

        :param host_ns: host time (ns), before or after the newest exchange.
        :return: seconds, never negative.
        """
        return abs(host_ns - self.reference_ns) / NS_PER_S

    def error_bound_s(self, host_ns: int) -> float:
        """``(RTT - turn-around)/2 + jitter + drift * age``, the first terms cut down by earlier exchanges.

        :param host_ns: host time (ns).
        :return: by how much the board's clock may differ from this fit at that time (s).
        """
        return self.error_s + self.drift * self.age_s(host_ns)

    def ticks_at(self, host_ns: int) -> int:
        """Unwrapped board ticks at a host time.

        :param host_ns: host time (ns).
        :return: unwrapped ticks, rounded to a whole one.
        """
        return round(self.reference_ticks + (host_ns - self.reference_ns) / self.ns_per_tick)

    def host_ns_at(self, count: int) -> int:
        """Host time of an unwrapped tick count.

        :param count: unwrapped ticks.
        :return: host time (ns).
        """
        return self.reference_ns + round((count - self.reference_ticks) * self.ns_per_tick)

    def to_ticks(self, host_ns: int) -> int:
        """Board ticks as sent (u32) at a host time.

        :param host_ns: host time (ns).
        :return: ticks, u32.
        """
        return self.ticks_at(host_ns) % _WRAP

    def to_host_ns(self, ticks: int, near_ns: int) -> int:
        """Host time of u32 ``ticks``, the one nearest to ``near_ns``.

        :param ticks: a u32 tick count.
        :param near_ns: host time (ns) within 1073 s of the answer; it decides between the wraps.
        :return: host time (ns).
        """
        near = self.ticks_at(near_ns)
        return self.host_ns_at(near + signed_ticks(ticks, near % _WRAP))


@dataclass(frozen=True, slots=True)
class _Exchange:
    """``host - board`` lay within ``offset ± half`` when the board's clock showed ``board`` (ns since the first exchange)."""

    board: float
    offset: float
    half: float


class ClockModel:
    """Learns a board's clock from exchanges. ``fit`` is the newest estimate, None before the first exchange.

    :param tolerance: largest relative deviation of the board's rate from nominal, 0 to 0.1 (ceramic resonators: 0.5 %).
    :param drift: largest relative wander of the rate about its mean within the window, 0 to 0.1 (temperature).
    :param jitter_s: how early or late a stamp itself may be (s): at least one tick, 0.5 µs, at most 1 s.
    :param window: exchanges kept, 1 to 1000.
    :raises InputError: a value outside its range.
    """

    def __init__(self, tolerance: float = 6e-3, drift: float = 2e-5, jitter_s: float = 2e-6, window: int = 16):
        self._tolerance = in_range("tolerance", tolerance, 0.0, 0.1)
        self._drift = in_range("drift", drift, 0.0, 0.1)
        self._jitter_ns = in_range("jitter_s", jitter_s, 1.0 / TICK_HZ, 1.0, "s") * NS_PER_S
        self._exchanges: deque[_Exchange] = deque(maxlen=int(in_range("window", window, 1, 1000)))
        self._extender = TickExtender()
        self._origin: tuple[int, int] | None = None
        self.fit: ClockFit | None = None

    def add(self, sent_ns: int, received_ticks: int, replied_ticks: int, arrived_ns: int) -> bool:
        """Learn from one exchange.

        An exchange that contradicts the earlier ones makes the model forget those: the board's clock jumped. One that contradicts
        itself (an answer sent before the question came, or quicker than the round trip) is dropped.

        :param sent_ns: host time (ns) at which the question was sent.
        :param received_ticks: board ticks (u32) when its last byte had arrived.
        :param replied_ticks: board ticks (u32) when the answer's first byte went out.
        :param arrived_ns: host time (ns) at which the answer was read.
        :return: whether the exchange agrees with the earlier ones and with itself.
        """
        turn_ns = signed_ticks(replied_ticks, received_ticks) * _NS_PER_TICK
        received = self._extender.extend(received_ticks)
        if self._origin is None:
            self._origin = sent_ns, received
        host_0, ticks_0 = self._origin
        board = (received - ticks_0) * _NS_PER_TICK + turn_ns / 2
        half = (arrived_ns - sent_ns - turn_ns) / 2 + self._tolerance * abs(turn_ns) / 2 + self._jitter_ns
        if turn_ns < 0 or half < 0:
            return False
        newest = _Exchange(board, (sent_ns - host_0 + arrived_ns - host_0) / 2 - board, half)
        estimate = self._estimate(newest)
        consistent = estimate is not None
        if estimate is None:
            self._exchanges.clear()
            estimate = newest.offset, newest.half, 0.0, self._tolerance
        self._exchanges.append(newest)
        offset, half, slope, slope_half = estimate
        self.fit = ClockFit(
            reference_ns=host_0 + round(board + offset),
            reference_ticks=ticks_0 + board / _NS_PER_TICK,
            ns_per_tick=_NS_PER_TICK * (1.0 + slope),
            error_s=(half + 1.0) / NS_PER_S,  # 1 ns for rounding
            drift=slope_half,
        )
        return consistent

    def _estimate(self, newest: _Exchange) -> tuple[float, float, float, float] | None:
        """Offset at ``newest`` and its half width, slope of the offset over board time and its half width; None if empty."""
        low, high = -self._tolerance, self._tolerance
        for old in self._exchanges:
            span = newest.board - old.board
            if span <= 0.0:
                return None
            rise, open_ = newest.offset - old.offset, newest.half + old.half
            low = max(low, (rise - open_) / span - self._drift)
            high = min(high, (rise + open_) / span + self._drift)
        if low > high:
            return None
        slope, slope_half = (low + high) / 2, (high - low) / 2 + self._drift
        bottom, top = newest.offset - newest.half, newest.offset + newest.half
        for old in self._exchanges:
            span = newest.board - old.board
            carried, open_ = old.offset + slope * span, old.half + slope_half * span
            bottom, top = max(bottom, carried - open_), min(top, carried + open_)
        if bottom > top:
            return None
        return (bottom + top) / 2, (top - bottom) / 2, slope, slope_half

"""An engine's clock as ours: times of its poses on the glove's clock, and how wrong they may be.

Peers count from their own start, drift, and jump when their machine is set. What is known of them comes from exchanges, as with a
board (``haptics.link.clock``): each bounds the difference of the clocks whatever the delays were. The mapping follows the newest
fit at a limited rate, so that a better fit bends the time of poses rather than tears it, and never runs backwards. Nothing that
keeps a glove safe depends on it: watchdogs go by when poses arrive.
"""

from __future__ import annotations

from haptics.errors import InputError
from haptics.link.clock import ClockModel
from haptics.link.messages import TICK_HZ
from haptics.time import LATEST_NS, NS_PER_MS, NS_PER_S
from haptics.units import in_range, whole_number

_NS_PER_TICK = NS_PER_S // TICK_HZ
_WRAP = 1 << 32
TOLERANCE = 1e-3
"""No clock of a machine runs faster or slower than this (a crystal is within 1e-4; what it is disciplined by adds to it)."""
DRIFT = 2e-5
SLEW = 5e-3
"""How much faster or slower than the peer's clock its mapped time runs at most, while it follows a better fit."""
STEP_NS = 50 * NS_PER_MS
"""A mapping that is off by more than this is not bent but set anew: the peer's clock was."""


class PeerClock:
    """The clock of whoever sends poses: exchange times with it before the first pose, and about once a second from then on.

    :param slew: how fast the mapping follows the fit, 1e-4 to 0.1 s/s.
    :raises InputError: out of range.

    :ivar jumps: how often the peer's clock was found to have jumped.
    """

    def __init__(self, slew: float = SLEW):
        self._slew = in_range("slew", slew, 1e-4, 0.1, "s/s")
        self._model = ClockModel(TOLERANCE, DRIFT)
        self._origin_ns: int | None = None
        self._offset_ns: int | None = None
        self._latest_ns = 0
        self.jumps = 0

    def exchange(self, sent_ns: int, received_ns: int, replied_ns: int, arrived_ns: int) -> bool:
        """Learn from one question and its answer.

        :param sent_ns: when we sent the question, ns on the glove's clock.
        :param received_ns: when the peer had it, ns on the peer's clock.
        :param replied_ns: when the peer answered, likewise.
        :param arrived_ns: when we had the answer, ns on the glove's clock.
        :return: whether it agrees with the exchanges before. One that does not tells of a clock that jumped: they are forgotten.
            One that contradicts itself (answered before it was asked, or in longer than the round trip took) is dropped.
        :raises InputError: no times, or an answer that was here before the question was sent.
        """
        sent_ns = whole_number("sent_ns", sent_ns, -LATEST_NS, LATEST_NS)
        received_ns = whole_number("received_ns", received_ns, -LATEST_NS, LATEST_NS)
        replied_ns = whole_number("replied_ns", replied_ns, -LATEST_NS, LATEST_NS)
        arrived_ns = whole_number("arrived_ns", arrived_ns, -LATEST_NS, LATEST_NS)
        if arrived_ns < sent_ns:
            raise InputError(f"arrived_ns = {arrived_ns} lies before sent_ns = {sent_ns}; both are on the glove's clock")
        if replied_ns < received_ns:
            return False
        if self._origin_ns is None:
            self._origin_ns = received_ns
        if self._add(sent_ns, received_ns, replied_ns, arrived_ns):
            return True
        if arrived_ns - sent_ns < replied_ns - received_ns:
            return False
        self.jumps += 1
        self._model, self._origin_ns = ClockModel(TOLERANCE, DRIFT), received_ns
        self._add(sent_ns, received_ns, replied_ns, arrived_ns)
        return False

    def _add(self, sent_ns: int, received_ns: int, replied_ns: int, arrived_ns: int) -> bool:
        received, replied = self._count(received_ns), self._count(replied_ns)
        fit = self._model.fit
        if fit is not None and abs(received - fit.reference_ticks) > _WRAP // 4:  # farther than ticks that wrap can tell
            return False
        return self._model.add(sent_ns, round(received) % _WRAP, round(replied) % _WRAP, arrived_ns)

    def _count(self, peer_ns: int) -> float:
        assert self._origin_ns is not None
        return (peer_ns - self._origin_ns) / _NS_PER_TICK

    @property
    def known(self) -> bool:
        """Whether there was an exchange yet."""
        return self._model.fit is not None

    def to_host_ns(self, peer_ns: int) -> int:
        """The glove's time of a peer's time. Later times of the peer are later ones of ours, unless its clock jumped.

        :param peer_ns: ns on the peer's clock.
        :return: ns on the glove's clock.
        :raises InputError: no time, or there was no exchange yet (``known``).
        """
        peer_ns = whole_number("peer_ns", peer_ns, -LATEST_NS, LATEST_NS)
        wanted_ns = self._wanted_offset_ns(peer_ns)
        if self._offset_ns is None or abs(wanted_ns - self._offset_ns) > STEP_NS:
            self._offset_ns = wanted_ns
        elif peer_ns > self._latest_ns:
            most_ns = int(self._slew * (peer_ns - self._latest_ns))
            self._offset_ns += min(max(wanted_ns - self._offset_ns, -most_ns), most_ns)
        self._latest_ns = max(self._latest_ns, peer_ns) if abs(peer_ns - self._latest_ns) < NS_PER_S else peer_ns
        return peer_ns + self._offset_ns

    def bound_s(self, peer_ns: int) -> float:
        """By how much the mapped time may be wrong.

        :param peer_ns: ns on the peer's clock.
        :return: s: what the exchanges leave open, what their age adds, and what the mapping still has to follow.
        :raises InputError: no time, or there was no exchange yet.
        """
        peer_ns = whole_number("peer_ns", peer_ns, -LATEST_NS, LATEST_NS)
        wanted_ns = self._wanted_offset_ns(peer_ns)
        behind_ns = 0 if self._offset_ns is None else abs(wanted_ns - self._offset_ns)
        assert self._model.fit is not None
        return self._model.fit.error_bound_s(peer_ns + wanted_ns) + behind_ns / NS_PER_S

    def _wanted_offset_ns(self, peer_ns: int) -> int:
        """Ours less the peer's, by the newest fit."""
        fit = self._model.fit
        if fit is None or self._origin_ns is None:
            raise InputError("no exchange with this peer's clock yet; its times mean nothing here (exchange)")
        # In whole numbers, as a float holds a nanosecond of a day, not of an epoch.
        since_ns = (self._count(peer_ns) - fit.reference_ticks) * (fit.ns_per_tick - _NS_PER_TICK)
        return fit.reference_ns - self._origin_ns - round(fit.reference_ticks * _NS_PER_TICK) + round(since_ns)

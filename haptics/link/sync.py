"""When to ask a board for its clock: several exchanges in a row, then further and further apart, and what went unanswered."""

from __future__ import annotations

from haptics.link.clock import ClockModel, signed_ticks
from haptics.link.commands import NEVER_NS
from haptics.link.framing import BITS_PER_BYTE, FRAMING_BYTES, encode_frame
from haptics.link.messages import BY_NAME, TICK_HZ, encode, payload_size
from haptics.link.settings import LinkCounters, LinkSettings
from haptics.time import NS_PER_S

UNMEASURED = "the board's clock was not measured yet"
_SHORTEST = 0.97  # of a byte's time at the nominal baud: no receiver follows a sender that is faster yet
_SYNC = BY_NAME["sync"].type
_ASKED, _ANSWERED = (payload_size(name) + FRAMING_BYTES for name in ("sync", "sync_reply"))


class ClockExchanges:
    """The sequence of ``sync`` and ``sync_reply`` with one boot of one board.

    :param baud: of the line, 0 if nobody knows. Question and answer differ in length, so that their middle is not the middle of
        the exchange; what each takes at least on the line is known, and is cut off the interval. A line that is quicker than its
        baud (a USB device without any serial line behind it) is found out by its first exchange, and then believed no more.
    """

    def __init__(self, settings: LinkSettings, counters: LinkCounters, baud: int = 0):
        self._settings, self._counters = settings, counters
        self._byte_ns = int(_SHORTEST * BITS_PER_BYTE * NS_PER_S / baud) if baud else 0
        self.model = self._new_model()
        self.due_ns = NEVER_NS
        self.missed = 0
        self._token = 0
        self._sent_ns: int | None = None
        self._left = 0
        self._gap_ns = settings.sync_first_gap_ns

    def _new_model(self) -> ClockModel:
        return ClockModel(self._settings.rate_tolerance, self._settings.drift, self._settings.jitter_s)

    def uncertain(self, host_ns: int) -> str | None:
        """Why nothing may be scheduled at ``host_ns``, or None."""
        fit, settings = self.model.fit, self._settings
        if fit is None:
            return UNMEASURED
        if (age_s := fit.age_s(host_ns)) > settings.max_age_s:
            return f"the board's clock was measured {age_s:.2f} s from that time; allowed: {settings.max_age_s:g} s"
        if (bound_s := fit.error_bound_s(host_ns)) > settings.max_error_s:
            return f"the board's clock is known within {bound_s * 1e3:.2f} ms; allowed: {settings.max_error_s * 1e3:g} ms"
        return None

    @property
    def started(self) -> bool:
        """The first run of exchanges is complete."""
        return self._left == 0 and self.model.fit is not None

    def begin(self, now_ns: int) -> None:
        """Ask often for a while; what was learnt stays."""
        self._left, self._gap_ns = self._settings.sync_exchanges, self._settings.sync_first_gap_ns
        self.missed, self._sent_ns, self.due_ns = 0, None, now_ns

    def frame(self, now_ns: int) -> bytes:
        """The next question. One still open is given up and counted as missed."""
        if self._sent_ns is not None:
            self.missed += 1
            self._counters.syncs_missed += 1
        self._token = (self._token + 1) & 0xFFFFFFFF
        self._sent_ns = now_ns
        self.due_ns = now_ns + self._settings.sync_timeout_ns
        return encode_frame(_SYNC, 0, encode("sync", self._token))

    def answer(self, token: int, received: int, sent: int, now_ns: int) -> bool | None:
        """Take a reply: True if it fits, False if it contradicts what was known, None if nobody waits for it."""
        if self._sent_ns is None or token != self._token:
            self._counters.stray_replies += 1
            return None
        asked_ns, self._sent_ns, self.missed = self._sent_ns, None, 0
        fits = self._learn(asked_ns, received, sent, now_ns)
        self._left = max(self._left - 1, 0)
        if self._left:
            self.due_ns = now_ns
        else:
            self.due_ns = now_ns + self._gap_ns
            self._gap_ns = min(2 * self._gap_ns, self._settings.sync_every_ns)
        if not fits:
            self._counters.clock_contradictions += 1
        return fits

    def _learn(self, asked_ns: int, received: int, sent: int, now_ns: int) -> bool:
        turn_ns = signed_ticks(sent, received) * NS_PER_S // TICK_HZ
        if self._byte_ns and now_ns - asked_ns - turn_ns < (_ASKED + _ANSWERED) * self._byte_ns:
            self._byte_ns = 0
            self.model = self._new_model()
        return self.model.add(asked_ns + _ASKED * self._byte_ns, received, sent, now_ns - _ANSWERED * self._byte_ns)

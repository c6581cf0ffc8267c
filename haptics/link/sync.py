"""When to ask a board for its clock: several exchanges in a row, then further and further apart, and what went unanswered."""

from __future__ import annotations

import math

from haptics.link.clock import ClockModel, signed_ticks
from haptics.link.commands import NEVER_NS
from haptics.link.framing import BITS_PER_BYTE, FRAMING_BYTES, encode_frame
from haptics.link.messages import BY_NAME, TICK_HZ, encode, payload_size
from haptics.link.settings import LinkCounters, LinkSettings
from haptics.time import NS_PER_MS, NS_PER_S

UNMEASURED = "the board's clock has not been measured yet"
_SHORTEST = 0.97  # of a byte's time at the nominal baud: no receiver follows a sender that is faster yet
_SYNC = BY_NAME["sync"].type
_GOLDEN = 0.6180339887498949
_QUIET_NS = 100 * NS_PER_MS
"""Longer than any coil pulse and than the largest shift, so that what is asked for after it cannot pass what was before."""
_LONGEST_PAUSE_NS = 64 * NS_PER_MS
_ASKED, _ANSWERED = (payload_size(name) + FRAMING_BYTES for name in ("sync", "sync_reply"))


class ClockExchanges:
    """The sequence of ``sync`` and ``sync_reply`` with one boot of one board.

    ``model`` is what was learnt, ``due_ns`` when the next question is due, ``missed`` how many in a row went unanswered.

    :param settings: how often to ask, and what errors are accepted.
    :param counters: the session's; missed and contradicting exchanges are counted there.
    :param baud: of the line, 0 if unknown. Question and answer differ in length, so that their middle is not the middle of
        the exchange; what each takes at least on the line is known, and is cut off the interval. A line that is quicker than its
        baud (a USB device without any serial line behind it) is detected by its first exchange, and the baud is then ignored.
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
        self._longest_ns = 0
        self._phase = 0.0
        self._shift_ns = 0
        self._shift_wanted_ns = 0
        self._scheduled_ns = -NEVER_NS

    def _new_model(self) -> ClockModel:
        return ClockModel(self._settings.rate_tolerance, self._settings.drift, self._settings.jitter_s)

    def uncertain(self, host_ns: int, exact: bool = False) -> str | None:
        """Why nothing may be scheduled at a time.

        :param host_ns: host time (ns).
        :param exact: hold the clock to ``exact_error_s``, by which a bench may measure, in place of ``max_error_s``.
        :return: the reason in words, or None if the clock is known well enough.
        """
        fit, settings = self.model.fit, self._settings
        if fit is None:
            return UNMEASURED
        if (age_s := fit.age_s(host_ns)) > settings.max_age_s:
            return f"the board's clock was last measured {age_s:.2f} s from that time; limit {settings.max_age_s:g} s"
        allowed_s = settings.exact_error_s if exact else settings.max_error_s
        if (bound_s := fit.error_bound_s(host_ns)) > allowed_s:
            self._counters.clock_refusals += 1
            self._counters.clock_refused_ms = max(self._counters.clock_refused_ms, bound_s * 1e3)
            return f"the board's clock is known within {bound_s * 1e3:.2f} ms; limit {allowed_s * 1e3:g} ms"
        return None

    @property
    def shift_ns(self) -> int:
        """How much later than asked for commands are scheduled now (ns), because the clock is known only coarsely."""
        return self._shift_ns

    def shifted_ns(self, host_ns: int) -> int:
        """When to schedule what is asked for at ``host_ns``: at that time, or later by what the clock may be wrong.

        A board whose clock is ahead by that still gets the command in time, and what plays is late by at most twice as much. The
        shift grows at once, and shrinks only after a tenth of a second without commands: they keep their order and never overlap.

        :param host_ns: host time (ns) asked for.
        :return: host time (ns) to schedule at.
        """
        if self._shift_wanted_ns > self._shift_ns or host_ns - self._scheduled_ns > _QUIET_NS:
            self._shift_ns = self._shift_wanted_ns
        self._scheduled_ns = max(self._scheduled_ns, host_ns)
        return host_ns + self._shift_ns

    @property
    def started(self) -> bool:
        """The first run of exchanges is complete."""
        return self._left == 0 and self.model.fit is not None

    @property
    def reply_timeout_ns(self) -> int:
        """How long to wait for the answer to a command (ns): on a line that holds answers back, longer than the longest took."""
        return max(self._settings.reply_timeout_ns, self._longest_ns + self._longest_ns // 4)

    def begin(self, now_ns: int) -> None:
        """Ask often for a while; what was learnt stays.

        :param now_ns: host time now (ns).
        """
        self._left, self._gap_ns = self._settings.sync_exchanges, self._settings.sync_first_gap_ns
        self.missed, self._sent_ns, self.due_ns, self._longest_ns = 0, None, now_ns, 0

    def frame(self, now_ns: int) -> bytes:
        """The next question. One still open is given up and counted as missed.

        :param now_ns: host time now (ns), at which it is sent.
        :return: wire bytes.
        """
        if self._sent_ns is not None:
            self.missed += 1
            self._counters.syncs_missed += 1
        self._token = (self._token + 1) & 0xFFFFFFFF
        self._sent_ns = now_ns
        self.due_ns = now_ns + self._settings.sync_timeout_ns
        return encode_frame(_SYNC, 0, encode("sync", self._token))

    def answer(self, token: int, received: int, sent: int, now_ns: int) -> bool | None:
        """Take a reply.

        :param token: as in the question.
        :param received: board ticks (u32) when the question had arrived.
        :param sent: board ticks (u32) when the answer went out.
        :param now_ns: host time (ns) at which it was read.
        :return: True if it fits, False if it contradicts what was known, None if no question with this token is open.
        """
        if self._sent_ns is None or token != self._token:
            self._counters.stray_replies += 1
            return None
        asked_ns, self._sent_ns, self.missed = self._sent_ns, None, 0
        fits = self._learn(asked_ns, received, sent, now_ns)
        self._left = max(self._left - 1, 0)
        pause_ns = self._pause_ns(now_ns - asked_ns)
        if self._left:
            self.due_ns = now_ns + pause_ns
        else:
            self.due_ns = now_ns + self._gap_ns + pause_ns
            self._gap_ns = min(2 * self._gap_ns, self._settings.sync_every_ns)
        self._plan_shift()
        if not fits:
            self._counters.clock_contradictions += 1
        return fits

    def _pause_ns(self, took_ns: int) -> int:
        """A wait before the next question, where the line holds answers back, and the clock is known coarsely yet.

        A line that hands bytes on every 16 ms answers right after it has done so; asked again at once it would take its longest
        every time. Waits that are multiples of the golden ratio, modulo the longest answer, come upon all its phases soon.
        """
        fit = self.model.fit
        if fit is None or fit.error_s <= self._settings.exact_error_s:
            return 0
        self._longest_ns = min(max(self._longest_ns, took_ns), _LONGEST_PAUSE_NS)
        self._phase = (self._phase + _GOLDEN) % 1.0
        return int(self._phase * self._longest_ns)

    def _plan_shift(self) -> None:
        """The error bound at the next exchange, in whole milliseconds; nothing where the clock is known well."""
        fit = self.model.fit
        if fit is None:
            return
        bound_s = min(fit.error_bound_s(self.due_ns), self._settings.max_error_s)
        self._shift_wanted_ns = 0 if bound_s <= self._settings.fine_error_s else math.ceil(bound_s * 1e3) * NS_PER_MS

    def _learn(self, asked_ns: int, received: int, sent: int, now_ns: int) -> bool:
        turn_ns = signed_ticks(sent, received) * NS_PER_S // TICK_HZ
        if self._byte_ns and now_ns - asked_ns - turn_ns < (_ASKED + _ANSWERED) * self._byte_ns:
            self._byte_ns = 0
            self.model = self._new_model()
        return self.model.add(asked_ns + _ASKED * self._byte_ns, received, sent, now_ns - _ANSWERED * self._byte_ns)

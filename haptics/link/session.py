"""One board on one line, as a state machine fed bytes and time: it yields bytes, events, and the time of its next deadline.

See ``docs/reference/protocol.md`` for what both sides promise. No I/O, no clock, no threads: whoever owns the session calls

* ``receive(data, now_ns)`` with what came, ``poll(now_ns)`` at ``next_deadline_ns`` or more often,
* ``outgoing()`` after each of these and after ``send``, ``arm``, ``stop``; what it returns is to be written at once,
* ``events()`` for what happened, ``lost(...)`` when the port went away.

No bytes raise an error. ``send`` raises on wrong arguments only; all else is an outcome of the ``Pending``.
"""

from __future__ import annotations

from typing import Any

from haptics.errors import ClockUncertain, InputError, LinkError, LinkLost, NotABoard, ReplyTimeout
from haptics.link import handshake
from haptics.link.clock import ClockFit
from haptics.link.commands import NEVER_NS, Pending
from haptics.link.framing import encode_frame
from haptics.link.messages import BY_NAME, MESSAGES, Board, encode
from haptics.link.receiving import Limits, Receiving
from haptics.link.settings import LinkSettings
from haptics.link.state import OVER, Phase, Tap
from haptics.link.sync import UNMEASURED
from haptics.time import NS_PER_S

_TIMED = frozenset(m.name for m in MESSAGES if m.sender == "host" and m.fields and m.fields[0].name == "time")
_KEEPALIVE = encode_frame(BY_NAME["keepalive"].type, 0)


class LinkSession(Receiving):
    """A host's side of the protocol.

    ``counters`` hold what came and went since ``start``; ``seen`` the first bytes that came. ``error`` is why it ended, if it
    did.

    :param board: the board expected, or None to take whichever answers.
    :param port_name: how errors name the port.
    :param settings: times and counts; None: the defaults, for 500 kbaud.
    :param limits: stricter limits to configure, in the order of ``identity.limits``; or a function that makes them from the
        identity once it is known; or None. The board is asked afterwards which limits it keeps; where those differ, the handshake
        fails.
    :param baud: of the line, 0 if unknown; see ``ClockExchanges``.
    :param tap: called with ``(time_ns, "in" | "out", bytes)`` for every byte both ways.
    :raises InputError: limits that do not fit ``configure``.
    """

    def __init__(
        self,
        board: Board | None,
        port_name: str,
        *,
        settings: LinkSettings | None = None,
        limits: Limits | None = None,
        baud: int = 0,
        tap: Tap | None = None,
    ):
        super().__init__(board, port_name, settings or LinkSettings(), limits, baud)
        self.tap = tap

    # What the owner may ask -----------------------------------------------------------------------------------------

    @property
    def last_sent_ns(self) -> int:
        """When a frame last went out (host ns): what a board's dead-man counts from."""
        return self._last_sent_ns

    @property
    def next_deadline_ns(self) -> int | None:
        """When ``poll`` is to be called next (ns); None if nothing is due unless something happens."""
        return self._deadline_ns if self._deadline_ns < NEVER_NS else None

    def to_ticks(self, host_ns: int) -> int:
        """Board ticks for a command at a host time; on a coarse line ``shift_ns`` later.

        :param host_ns: host time (ns).
        :return: ticks, u32.
        :raises ClockUncertain: the board's clock is not known well enough at that time.
        """
        self._need_clock(host_ns)
        return self._fit().to_ticks(self._exchanges.shifted_ns(host_ns))

    def exact_ticks(self, host_ns: int) -> int:
        """Board ticks at a host time, to measure by.

        :param host_ns: host time (ns).
        :return: ticks, u32.
        :raises ClockUncertain: the board's clock is not known within ``exact_error_s`` at that time.
        """
        self._need_clock(host_ns, exact=True)
        return self._fit().to_ticks(host_ns)

    @property
    def shift_ns(self) -> int:
        """How much later than asked for commands are scheduled (ns), as the clock is known only coarsely; 0 on a good line."""
        return self._exchanges.shift_ns

    def to_host_ns(self, ticks: int) -> int:
        """Host time of board ticks within 1073 s of the last call's time.

        :param ticks: board ticks, u32.
        :return: host time (ns).
        :raises ClockUncertain: the board's clock was never measured.
        """
        return self._fit().to_host_ns(ticks, self._now_ns)

    def _need_clock(self, host_ns: int, exact: bool = False) -> None:
        uncertain = self._exchanges.uncertain(host_ns, exact)
        if uncertain is not None:
            raise ClockUncertain(self.port_name, uncertain)

    def _fit(self) -> ClockFit:
        if self.clock is None:
            raise ClockUncertain(self.port_name, UNMEASURED)
        return self.clock

    def diagnosis(self) -> NotABoard:
        """Why no board was found so far.

        :return: the error to raise.
        """
        return handshake.diagnosis(
            self.port_name, self.counters, self._deframer.sample or self.seen, self._inquiry.tries, self._inquiry.waited_s
        )

    # What the owner may do ------------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        """Begin, or begin anew: ask who is there, measure the clock, configure. Never arms.

        :param now_ns: host time now (ns).
        """
        self._window.fail_all(LinkError, "the link was restarted")
        self._reset()
        self._now_ns = now_ns
        self.phase = Phase.IDENTIFYING
        self._inquiry.begin("start", now_ns, self.counters)
        self._work(now_ns)

    def send(self, name: str, *values: Any, now_ns: int) -> Pending:
        """Send a command.

        :param name: a command of the message table that this board knows; ``stop`` goes as ``stop`` does.
        :param values: its fields in the order of the table, ``time`` from ``to_ticks``.
        :param now_ns: host time now (ns).
        :return: the command; failed at once where it may not be sent now.
        :raises InputError: no such command for this board, or values that do not fit.
        """
        self._now_ns = now_ns
        self._check_name(name)
        if name == "stop":
            return self.stop(now_ns)
        pending = Pending(name, encode(name, *values))
        refusal = self._refusal(name, now_ns)
        if refusal is not None:
            pending.fail(refusal)
            return pending
        if name == "disarm":
            self.armed = False
            self._window.fail_all(LinkError, "disarmed")  # nothing asked for before it is sent, or sent again, after it
        self._window.submit(pending, self._latest_ns(values[0], now_ns) if name in _TIMED else NEVER_NS)
        self._work(now_ns)
        return pending

    def _latest_ns(self, ticks: int, now_ns: int) -> int:
        """Until when a waiting command for ``ticks`` is worth sending: half an exchange before, which is the clock's bound."""
        fit = self.clock
        return NEVER_NS if fit is None else max(now_ns, fit.to_host_ns(ticks, now_ns) - round(fit.error_s * NS_PER_S))

    def arm(self, now_ns: int) -> Pending:
        """Arm the board that was identified, and no other: its boot id goes along.

        :param now_ns: host time now (ns).
        :return: the command; its outcome comes later.
        """
        return self.send("arm", self.identity.boot_id if self.identity is not None else 0, now_ns=now_ns)

    def stop(self, now_ns: int) -> Pending:
        """At once, past every queue. Whatever else waits or is open fails, and nothing more is sent until this is answered.

        :param now_ns: host time now (ns).
        :return: the stop to watch: the one under way already, if there is one.
        """
        self._now_ns = now_ns
        self.armed = False
        pending = Pending("stop")
        if self.phase in (Phase.IDLE, *OVER):
            pending.fail(LinkError(self.port_name, self.error.seen if self.error else "the link was not started", "stop"))
            return pending
        self._out.clear()
        pending = self._stopping = self._window.submit_alone(pending, self.settings.stop_tries, "stopped")
        self._work(now_ns)
        return pending

    # Bytes and time -------------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now_ns: int) -> None:
        """Take bytes from the port.

        :param data: the bytes; may be empty.
        :param now_ns: host time (ns) at which they were read.
        """
        self._now_ns = now_ns
        if not data:
            return
        if self.tap is not None:
            self.tap(now_ns, "in", data)
        self.counters.bytes_in += len(data)
        if len(self.seen) < 32:
            self.seen = (self.seen + data)[:32]
        frames = self._deframer.feed(data)
        self.counters.bad_frames = self._deframer.bad_frames
        for frame in frames:
            self._dispatch(frame, now_ns)
        if frames:
            self._work(now_ns)

    def poll(self, now_ns: int) -> None:
        """Do what is due.

        :param now_ns: host time now (ns).
        """
        self._now_ns = now_ns
        if now_ns >= self._deadline_ns:
            self._work(now_ns)

    def outgoing(self) -> bytes:
        """Bytes to write now.

        :return: the bytes, handed out once; empty if there are none.
        """
        if not self._out:
            return b""
        data = b"".join(self._out)
        self._out.clear()
        self.counters.bytes_out += len(data)
        if self.tap is not None:
            self.tap(self._now_ns, "out", data)
        return data

    # What is due ----------------------------------------------------------------------------------------------------

    def _work(self, now_ns: int) -> None:
        """Everything that is due, and when something will be next."""
        window = self._window
        window.pump(now_ns, self._emit, hold=self._inquiry.reason is not None and window.alone is None)
        self.counters.retries, self.counters.given_up = window.retries, window.given_up
        if self._configuring is not None and self._configuring.done:
            self._configured(now_ns)
        if self._stopping is not None and self._stopping.done:
            self._stopped(now_ns)
        self._deadline_ns = window.next_due_ns
        if window.alone is None:
            for due_ns in (self._ask(now_ns), self._measure(now_ns), self._keep_alive(now_ns)):
                self._deadline_ns = min(self._deadline_ns, due_ns)
        if self.phase in OVER:
            self._deadline_ns = NEVER_NS

    def _ask(self, now_ns: int) -> int:
        """Identify, and again, until an answer comes or patience ends."""
        inquiry = self._inquiry
        if now_ns >= inquiry.due_ns:
            if inquiry.exhausted:
                self._give_up(now_ns)
            else:
                self._window.repeat_no_more()
                self._emit(inquiry.frame(now_ns))
        return inquiry.due_ns

    def _measure(self, now_ns: int) -> int:
        """Ask for the board's clock when that is due."""
        exchanges = self._exchanges
        if self._inquiry.reason is not None:
            return NEVER_NS
        if now_ns >= exchanges.due_ns:
            frame = exchanges.frame(now_ns)
            if exchanges.missed >= self.settings.sync_misses:
                self._suspect(f"{exchanges.missed} clock exchanges in a row went unanswered", now_ns)
                return self._ask(now_ns)
            self._emit(frame)
        return exchanges.due_ns

    def _keep_alive(self, now_ns: int) -> int:
        if self.identity is None or self.phase in OVER:
            return NEVER_NS
        if now_ns - self._last_sent_ns >= self.settings.keepalive_every_ns:
            self.counters.keepalives += 1
            self._emit(_KEEPALIVE)
        return self._last_sent_ns + self.settings.keepalive_every_ns

    def _stopped(self, now_ns: int) -> None:
        """A stop without an answer ends the session: a board that hears nothing more makes itself safe."""
        pending, self._stopping = self._stopping, None
        if pending is not None and isinstance(pending.error, ReplyTimeout) and self.identity is not None:
            seen = f"stop was not answered ({pending.error.seen})"
            self.lost(LinkLost(self.port_name, seen, "stop", "cut the supply if in doubt"), now_ns)

    def _give_up(self, now_ns: int) -> None:
        if self.phase is Phase.IDENTIFYING:
            self._fail(self.diagnosis(), now_ns)
            return
        self.lost(handshake.silence(self.port_name, self.counters, self._inquiry, self._deframer.sample or self.seen), now_ns)

    # Refusals -------------------------------------------------------------------------------------------------------

    def _check_name(self, name: str) -> None:
        allowed = handshake.commands_for(self.board)
        if name not in allowed:
            raise InputError(f"command {name!r} is not one of {self.port_name}; known: {', '.join(allowed)}")

    def _refusal(self, name: str, now_ns: int) -> LinkError | None:
        if self.phase in OVER and self.error is not None:
            kind = LinkLost if self.phase is Phase.LOST else LinkError
            return kind(self.port_name, self.error.seen, name, self.error.advice)
        if not self.ready:
            return LinkError(self.port_name, f"not ready, still {self.phase.value}", name)
        if len(self._window) >= self.settings.queue_limit:
            return LinkError(self.port_name, f"{len(self._window)} commands are waiting already", name, "send more slowly")
        if name in _TIMED:
            uncertain = self._exchanges.uncertain(now_ns)
            if uncertain is not None:
                return ClockUncertain(self.port_name, uncertain, name)
        return None

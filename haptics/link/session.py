"""One board on one line, as a state machine fed bytes and time: it yields bytes, events, and the next time it wants to be asked.

See ``docs/reference/protocol.md`` for what both sides promise. No I/O, no clock, no threads: whoever owns the session calls

* ``receive(data, now_ns)`` with what came, ``poll(now_ns)`` at ``next_deadline_ns`` or more often,
* ``outgoing()`` after each of these and after ``send``, ``arm``, ``stop``; what it returns is to be written at once,
* ``events()`` for what happened, ``lost(...)`` when the port went away.

Nothing raises on bytes. ``send`` raises on wrong arguments only; all else comes out of the ``Pending``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any

from haptics.errors import ClockUncertain, CommandRefused, InputError, LinkError, LinkLost, NotABoard, ReplyTimeout, WrongFirmware
from haptics.link import events as happened, handshake
from haptics.link.clock import ClockFit
from haptics.link.commands import NEVER_NS, CommandWindow, Pending, status_name
from haptics.link.framing import Deframer, Frame, encode_frame
from haptics.link.messages import BY_NAME, BY_TYPE, MESSAGES, Board, Fault, State, Status, decode, encode, payload_size
from haptics.link.settings import LinkCounters, LinkSettings
from haptics.link.sync import UNMEASURED, ClockExchanges
from haptics.time import NS_PER_S

Tap = Callable[[int, str, bytes], None]

_DOWN = (int(State.DISARMED), int(State.FAULT))
_TIMED = frozenset(m.name for m in MESSAGES if m.sender == "host" and m.fields and m.fields[0].name == "time")
_SIZES = {m.type: payload_size(m.name) for m in MESSAGES if m.sender == "board"}
_KEEPALIVE = encode_frame(BY_NAME["keepalive"].type, 0)
_IDENTITIES = 3
"""That tell other limits than were configured, before the board is not believed."""


class Phase(Enum):
    """How far a session has come."""

    IDLE = "idle"
    IDENTIFYING = "identifying"
    SYNCING = "syncing"
    CONFIGURING = "configuring"
    READY = "ready"
    FAILED = "failed"
    LOST = "lost"


_OVER = (Phase.FAILED, Phase.LOST)


class LinkSession:
    """A host's side of the protocol.

    :param board: the board expected, or None to take whichever answers.
    :param port_name: how errors name the port.
    :param limits: stricter limits to configure, in the order of ``identity.limits``; or what makes them of the identity, once it
        is known; or None. The board is asked afterwards what it keeps to; where that is not these very limits, the handshake
        fails.
    :param baud: of the line, 0 if nobody knows; see ``ClockExchanges``.
    :param tap: called with ``(time_ns, "in" | "out", bytes)`` for every byte both ways.
    """

    EVENTS_KEPT = 4096

    def __init__(
        self,
        board: Board | None,
        port_name: str,
        *,
        settings: LinkSettings | None = None,
        limits: Sequence[int] | Callable[[Any], Sequence[int]] | None = None,
        baud: int = 0,
        tap: Tap | None = None,
    ):
        self.expected, self.port_name, self.tap = board, port_name, tap
        self._baud = baud
        self.settings = settings or LinkSettings()
        if limits is not None and not callable(limits):
            encode("configure", tuple(limits))  # a wrong number is refused here, not once a board has answered
        self._limits = limits
        self._configured_limits: tuple[int, ...] = ()
        self._events: deque[happened.Event] = deque()
        self._now_ns = 0
        self._deadline_ns = NEVER_NS
        self._handlers: dict[int, Callable[[Frame, Any, int], None]] = {
            BY_NAME["identity"].type: self._on_identity,
            BY_NAME["sync_reply"].type: self._on_sync_reply,
            BY_NAME["reply"].type: self._on_reply,
            BY_NAME["tactiles_telemetry"].type: self._on_telemetry,
            BY_NAME["brake_telemetry"].type: self._on_telemetry,
            BY_NAME["fault"].type: self._on_fault,
        }
        self._reset()

    def _reset(self) -> None:
        s = self.settings
        self.phase = Phase.IDLE
        self.error: LinkError | None = None
        self.identity: Any = None
        self.armed = False
        self.counters = LinkCounters()
        self.seen = b""  # the first bytes that came, for a diagnosis
        self._out: list[bytes] = []
        self._deframer = Deframer()
        self._window = CommandWindow(self.port_name, s.in_flight, s.reply_timeout_ns, s.tries)
        self._exchanges = ClockExchanges(s, self.counters, self._baud)
        self._inquiry = handshake.Inquiry(s.identify_every_ns, s.identify_tries)
        self._last_sent_ns = 0
        self._armed_ticks = 0
        self._configuring: Pending | None = None
        self._stopping: Pending | None = None
        self._stopped_first = False
        self._unlike = 0  # identities since the board took its limits, none of which told them

    # What the owner may ask -----------------------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        """Commands are taken."""
        return self.phase is Phase.READY

    @property
    def board(self) -> Board | None:
        """The board that answered, or the one expected."""
        return Board(self.identity.board) if self.identity is not None else self.expected

    @property
    def clock(self) -> ClockFit | None:
        """The board's clock, or None before it was measured."""
        return self._exchanges.model.fit

    @property
    def last_sent_ns(self) -> int:
        """When a frame last went out: what a board's dead-man counts from."""
        return self._last_sent_ns

    @property
    def next_deadline_ns(self) -> int | None:
        """When ``poll`` wants to be called next; None if nothing is due unless something happens."""
        return self._deadline_ns if self._deadline_ns < NEVER_NS else None

    def events(self) -> list[happened.Event]:
        """What happened since the last call."""
        taken = list(self._events)
        self._events.clear()
        return taken

    def to_ticks(self, host_ns: int) -> int:
        """Board ticks (u32) for a command at a host time; on a coarse line ``shift_ns`` later.

        :raises ClockUncertain: the board's clock is not known well enough at that time.
        """
        self._need_clock(host_ns)
        return self._fit().to_ticks(self._exchanges.shifted_ns(host_ns))

    def exact_ticks(self, host_ns: int) -> int:
        """Board ticks (u32) at a host time, to measure by.

        :raises ClockUncertain: the board's clock is not known within ``exact_error_s`` at that time.
        """
        self._need_clock(host_ns, exact=True)
        return self._fit().to_ticks(host_ns)

    @property
    def shift_ns(self) -> int:
        """How much later than asked for commands are scheduled, because the clock is known only coarsely; 0 on a good line."""
        return self._exchanges.shift_ns

    def _need_clock(self, host_ns: int, exact: bool = False) -> None:
        uncertain = self._exchanges.uncertain(host_ns, exact)
        if uncertain is not None:
            raise ClockUncertain(self.port_name, uncertain)

    def to_host_ns(self, ticks: int) -> int:
        """Host time of board ticks (u32) within 1073 s of the last call's time.

        :raises ClockUncertain: the board's clock was never measured.
        """
        return self._fit().to_host_ns(ticks, self._now_ns)

    def _fit(self) -> ClockFit:
        if self.clock is None:
            raise ClockUncertain(self.port_name, UNMEASURED)
        return self.clock

    # What the owner may do ------------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        """Begin, or begin anew: ask who is there, measure the clock, configure. Never arms."""
        self._window.fail_all(LinkError, "the link was started anew")
        self._reset()
        self._now_ns = now_ns
        self.phase = Phase.IDENTIFYING
        self._inquiry.begin("start", now_ns, self.counters)
        self._work(now_ns)

    def send(self, name: str, *values: Any, now_ns: int) -> Pending:
        """Send a command; ``values`` are its fields in the order of the table, ``time`` from ``to_ticks``.

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
        """Arm the board that was identified, and no other: its boot id goes along."""
        return self.send("arm", self.identity.boot_id if self.identity is not None else 0, now_ns=now_ns)

    def stop(self, now_ns: int) -> Pending:
        """At once, past every queue. Whatever else waits or is open fails, and nothing more is sent until this is answered."""
        self._now_ns = now_ns
        self.armed = False
        pending = Pending("stop")
        if self.phase in (Phase.IDLE, *_OVER):
            pending.fail(LinkError(self.port_name, self.error.seen if self.error else "the link was not started", "stop"))
            return pending
        self._out.clear()
        pending = self._stopping = self._window.submit_alone(pending, self.settings.stop_tries, "stopped")
        self._work(now_ns)
        return pending

    def lost(self, error: LinkError, now_ns: int) -> None:
        """The port went away: every open command fails with that reason."""
        if self.phase is Phase.LOST:
            return
        self._end(Phase.LOST, error)
        self._window.fail_all(type(error) if type(error) in (LinkLost, NotABoard) else LinkLost, error.seen)
        self._tell(happened.Lost(now_ns, error))

    # Bytes and time -------------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now_ns: int) -> None:
        """Take bytes that were read at ``now_ns``."""
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
        """Do what is due at ``now_ns``."""
        self._now_ns = now_ns
        if now_ns >= self._deadline_ns:
            self._work(now_ns)

    def outgoing(self) -> bytes:
        """Bytes to write now."""
        if not self._out:
            return b""
        data = b"".join(self._out)
        self._out.clear()
        self.counters.bytes_out += len(data)
        if self.tap is not None:
            self.tap(self._now_ns, "out", data)
        return data

    # Sending --------------------------------------------------------------------------------------------------------

    def _emit(self, frame: bytes) -> None:
        self._out.append(frame)
        self._last_sent_ns = self._now_ns

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
        if self.phase in _OVER:
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
        if self.identity is None or self.phase in _OVER:
            return NEVER_NS
        if now_ns - self._last_sent_ns >= self.settings.keepalive_every_ns:
            self.counters.keepalives += 1
            self._emit(_KEEPALIVE)
        return self._last_sent_ns + self.settings.keepalive_every_ns

    # Receiving ------------------------------------------------------------------------------------------------------

    def _dispatch(self, frame: Frame, now_ns: int) -> None:
        message = BY_TYPE.get(frame.type)
        self.counters.frames_in += 1
        if message is not None and message.sender == "host":
            self.counters.echoes += 1
        elif message is not None and message.name == "identity" and self._is_of_another_table(frame):
            seen = f"its identity has {len(frame.payload)} bytes, this package's {_SIZES[frame.type]}"
            self._fail(WrongFirmware(self.port_name, seen, "identify", handshake.FLASH), now_ns)
        elif message is None or len(frame.payload) != _SIZES[frame.type] or self.board not in (None, *message.boards):
            self.counters.strange_frames += 1
        elif self.phase not in (Phase.IDLE, *_OVER):
            self._handlers[frame.type](frame, decode(message.name, frame.payload), now_ns)

    def _is_of_another_table(self, frame: Frame) -> bool:
        return self.phase is Phase.IDENTIFYING and len(frame.payload) != _SIZES[frame.type]

    def _on_identity(self, frame: Frame, identity: Any, now_ns: int) -> None:
        mismatch = handshake.mismatch(identity, self.expected)
        if mismatch is not None:
            seen, advice = mismatch
            self._fail(WrongFirmware(self.port_name, seen, "identify", advice), now_ns)
            return
        known, self.identity = self.identity, identity
        if known is None:
            self._identified(now_ns)
        elif known.boot_id != identity.boot_id:
            self._window.fail_all(LinkLost, f"the board rebooted (boot id {known.boot_id:08x}, now {identity.boot_id:08x})")
            self.armed = False
            self._tell(happened.Rebooted(now_ns, known.boot_id, identity.boot_id))
            self._identified(now_ns)
        elif self.phase is Phase.CONFIGURING and self._configuring is None:
            self._verify(now_ns)
        elif self._inquiry.reason is not None:
            self._inquiry.end()
            self._exchanges.begin(now_ns)

    def _identified(self, now_ns: int) -> None:
        self.phase = Phase.SYNCING
        self._inquiry.end()
        self._configuring = None
        self._stopped_first = False
        self._exchanges = ClockExchanges(self.settings, self.counters, self._baud)
        self._exchanges.begin(now_ns)
        self._tell(happened.Identified(now_ns, self.identity))

    def _on_sync_reply(self, frame: Frame, reply: Any, now_ns: int) -> None:
        fits = self._exchanges.answer(reply.token, reply.received, reply.sent, now_ns)
        if fits is None:
            return
        if not fits:
            self._suspect("its clock jumped", now_ns)
        self._window.timeout_ns = self._exchanges.reply_timeout_ns
        if self.clock is not None:
            self._tell(self.clock)
        if self.phase is Phase.SYNCING and self._exchanges.started:
            self._configure(now_ns)

    def _configure(self, now_ns: int) -> None:
        if self._limits is None:
            self._become_ready(now_ns)
            return
        self.phase = Phase.CONFIGURING
        self._configured_limits = tuple(self._limits(self.identity) if callable(self._limits) else self._limits)
        self._configuring = Pending("configure", encode("configure", self._configured_limits))
        self._window.submit(self._configuring)

    def _configured(self, now_ns: int) -> None:
        pending, self._configuring = self._configuring, None
        if pending is None or self.phase is not Phase.CONFIGURING:
            return
        if pending.ok:
            self._unlike = 0
            self._suspect("its limits are verified", now_ns)
        elif pending.error is not None and self._window.alone is not None:
            self._configure(now_ns)  # a stop came in between
        elif pending.status == Status.INTERLOCK and not self._stopped_first:
            self._stop_first(now_ns)
        else:
            seen = f"answered {status_name(pending.status)}, detail {pending.detail}"
            advice = "limits may only be made stricter than the board's own"
            refused = CommandRefused(self.port_name, seen, "configure", status_name(pending.status), advice)
            self._fail(pending.error or refused, now_ns)

    def _verify(self, now_ns: int) -> None:
        """A board that was configured has said once more who it is, and by which limits; a late answer may be of before."""
        different = handshake.different_limits(self.identity, self._configured_limits)
        self._unlike += 1
        if different is None:
            self._inquiry.end()
            self._become_ready(now_ns)
        elif self._unlike >= _IDENTITIES:
            self._fail(LinkError(self.port_name, different, "configure", handshake.FLASH), now_ns)

    def _stop_first(self, now_ns: int) -> None:
        """The board is still armed by a host that is gone, and takes no limits: it is made safe, then configured."""
        self._stopped_first = True
        self._stopping = self._window.submit_alone(Pending("stop"), self.settings.stop_tries, "stopped")
        self._configure(now_ns)
        self._window.pump(now_ns, self._emit)

    def _become_ready(self, now_ns: int) -> None:
        self.phase = Phase.READY
        self._tell(happened.Ready(now_ns))

    def _on_reply(self, frame: Frame, reply: Any, now_ns: int) -> None:
        fit = self.clock
        board_time_ns = fit.to_host_ns(reply.time, now_ns) if fit is not None else None
        pending = self._window.resolve(frame.seq, reply.status, reply.detail, board_time_ns)
        if pending is None:
            self.counters.stray_replies += 1
        elif pending.name == "arm" and pending.ok:
            self.armed, self._armed_ticks = True, reply.time
        elif pending.name == "disarm":
            self.armed = False  # also if an earlier arm was answered in between
        elif pending.status == Status.INTERLOCK and self.armed:
            self._disarmed(f"it refused {pending.name}: interlock", now_ns)

    def _on_telemetry(self, frame: Frame, message: Any, now_ns: int) -> None:
        fit = self.clock
        if fit is None:
            return
        time_ns = fit.to_host_ns(message.time, now_ns)
        if self.ready and abs(time_ns - now_ns) > self.settings.clock_jump_s * NS_PER_S:
            self._suspect("its telemetry tells another time", now_ns)
            return
        self._tell(happened.Telemetry(time_ns, message))
        news = self.armed and message.state in _DOWN and handshake.after(message.time, self._armed_ticks)
        if news:
            self._disarmed(f"telemetry says {State(message.state).name.lower()}, faults {message.faults:#06x}", now_ns)

    def _on_fault(self, frame: Frame, message: Any, now_ns: int) -> None:
        fit = self.clock
        time_ns = fit.to_host_ns(message.time, now_ns) if fit is not None else now_ns
        known = message.code in Fault.__members__.values()
        fault = Fault(message.code) if known else message.code
        self._tell(happened.FaultReported(time_ns, fault, message.channel, message.value))
        if self.armed and handshake.after(message.time, self._armed_ticks):
            self._disarmed(f"fault {Fault(message.code).name.lower() if known else message.code}", now_ns)

    # Trouble --------------------------------------------------------------------------------------------------------

    def _disarmed(self, reason: str, now_ns: int) -> None:
        self.armed = False
        self._tell(happened.Disarmed(now_ns, reason))
        self._suspect(reason, now_ns)

    def _suspect(self, reason: str, now_ns: int) -> None:
        """Ask again who is there; meanwhile commands wait."""
        if self._inquiry.reason is None:
            self.seen = self._deframer.sample = b""
        self._inquiry.begin(reason, now_ns, self.counters)

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

    def diagnosis(self) -> NotABoard:
        """Why no board was found so far, in words."""
        return handshake.diagnosis(
            self.port_name, self.counters, self._deframer.sample or self.seen, self._inquiry.tries, self._inquiry.waited_s
        )

    def _fail(self, error: LinkError, now_ns: int) -> None:
        self._end(Phase.FAILED, error)
        self._window.fail_all(type(error) if type(error) in (NotABoard, WrongFirmware) else LinkError, error.seen)
        self._tell(happened.Failed(now_ns, error))

    def _end(self, phase: Phase, error: LinkError) -> None:
        self.phase, self.error = phase, error
        self.armed = False
        self._inquiry.end()
        self._configuring = None
        self._out.clear()
        self._exchanges.due_ns = self._deadline_ns = NEVER_NS

    def _tell(self, event: happened.Event) -> None:
        if len(self._events) >= self.EVENTS_KEPT:
            self._events.popleft()
            self.counters.events_dropped += 1
        self._events.append(event)

    # Refusals -------------------------------------------------------------------------------------------------------

    def _check_name(self, name: str) -> None:
        allowed = handshake.commands_for(self.board)
        if name not in allowed:
            raise InputError(f"command {name!r} is not for {self.port_name}; allowed: {', '.join(allowed)}")

    def _refusal(self, name: str, now_ns: int) -> LinkError | None:
        if self.phase in _OVER and self.error is not None:
            kind = LinkLost if self.phase is Phase.LOST else LinkError
            return kind(self.port_name, self.error.seen, name, self.error.advice)
        if not self.ready:
            return LinkError(self.port_name, f"not ready, still {self.phase.value}", name)
        if len(self._window) >= self.settings.queue_limit:
            return LinkError(self.port_name, f"{len(self._window)} commands wait already", name, "send more slowly")
        if name in _TIMED:
            uncertain = self._exchanges.uncertain(now_ns)
            if uncertain is not None:
                return ClockUncertain(self.port_name, uncertain, name)
        return None

"""What a session does with the frames of its board: identity, clock, limits, replies, telemetry, faults."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from haptics.errors import CommandRefused, LinkError, LinkLost, WrongFirmware
from haptics.link import events as happened, handshake
from haptics.link.commands import Pending, status_name
from haptics.link.framing import Frame
from haptics.link.messages import BY_NAME, BY_TYPE, MESSAGES, Board, Fault, State, Status, decode, encode, payload_size
from haptics.link.settings import LinkSettings
from haptics.link.state import OVER, Phase, SessionState
from haptics.link.sync import ClockExchanges
from haptics.time import NS_PER_S

Limits = Sequence[int] | Callable[[Any], Sequence[int]]
"""Limits to configure, in the order of ``identity.limits``, or a function that makes them from the identity."""

_DOWN = (int(State.DISARMED), int(State.FAULT))
_SIZES = {m.type: payload_size(m.name) for m in MESSAGES if m.sender == "board"}
_IDENTITIES = 3
"""With other limits than those configured, until the board is given up: the first may be a late answer from before."""


class Receiving(SessionState):
    """A session as far as frames drive it: from ``identity`` to ready, and what is learnt from then on.

    :param board: the board expected, or None to take whichever answers.
    :param port_name: how errors name the port.
    :param settings: times and counts.
    :param limits: limits to configure, or None.
    :param baud: of the line, 0 if unknown.
    :raises InputError: limits that do not fit ``configure``.
    """

    def __init__(self, board: Board | None, port_name: str, settings: LinkSettings, limits: Limits | None, baud: int):
        if limits is not None and not callable(limits):
            encode("configure", tuple(limits))  # a wrong number is refused here, not once a board has answered
        self._limits = limits
        self._configured_limits: tuple[int, ...] = ()
        self._handlers: dict[int, Callable[[Frame, Any, int], None]] = {
            BY_NAME["identity"].type: self._on_identity,
            BY_NAME["sync_reply"].type: self._on_sync_reply,
            BY_NAME["reply"].type: self._on_reply,
            BY_NAME["tactiles_telemetry"].type: self._on_telemetry,
            BY_NAME["brake_telemetry"].type: self._on_telemetry,
            BY_NAME["fault"].type: self._on_fault,
        }
        super().__init__(board, port_name, settings, baud)

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
        elif self.phase not in (Phase.IDLE, *OVER):
            self._handlers[frame.type](frame, decode(message.name, frame.payload), now_ns)

    def _is_of_another_table(self, frame: Frame) -> bool:
        return self.phase is Phase.IDENTIFYING and len(frame.payload) != _SIZES[frame.type]

    # Identity and clock ---------------------------------------------------------------------------------------------

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

    # Limits ---------------------------------------------------------------------------------------------------------

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
        """Compare the limits in an identity sent after ``configure`` with those configured; a late answer may be from before."""
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
        self._tell(happened.FoundArmed(now_ns))
        self._stopping = self._window.submit_alone(Pending("stop"), self.settings.stop_tries, "stopped")
        self._configure(now_ns)
        self._window.pump(now_ns, self._emit)

    def _become_ready(self, now_ns: int) -> None:
        self.phase = Phase.READY
        self._tell(happened.Ready(now_ns))

    # Once it is ready -----------------------------------------------------------------------------------------------

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
            self._suspect("its telemetry shows another time", now_ns)
            return
        self._tell(happened.Telemetry(time_ns, message))
        news = self.armed and message.state in _DOWN and handshake.after(message.time, self._armed_ticks)
        if news:
            self._disarmed(f"telemetry reports {State(message.state).name.lower()}, faults {message.faults:#06x}", now_ns)

    def _on_fault(self, frame: Frame, message: Any, now_ns: int) -> None:
        fit = self.clock
        time_ns = fit.to_host_ns(message.time, now_ns) if fit is not None else now_ns
        known = message.code in Fault.__members__.values()
        fault = Fault(message.code) if known else message.code
        self._tell(happened.FaultReported(time_ns, fault, message.channel, message.value))
        if self.armed and handshake.after(message.time, self._armed_ticks):
            self._disarmed(f"fault {Fault(message.code).name.lower() if known else message.code}", now_ns)

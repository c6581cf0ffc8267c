"""What every simulated board's firmware does: frames in, one reply each, faults that latch, a dead-man, telemetry.

The model is event driven: ``advance`` runs what is due up to a time, ``handle`` takes bytes at the present one. A subclass
adds its commands (methods named in ``_commands``), its outputs and its plant.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from firmware_models.boards.boot import Boots
from firmware_models.boards.ticks import signed_difference
from firmware_models.line.uart import NEVER_NS, Line
from firmware_models.options import Option
from haptics.link.framing import Deframer, Frame, encode_frame
from haptics.link.messages import (
    BY_NAME,
    BY_TYPE,
    PROTOCOL_VERSION,
    REMEMBERED_REPLIES,
    TICK_HZ,
    Board,
    Fault,
    State,
    Status,
    decode,
    encode,
    payload_size,
    schema_hash,
)
from haptics.time import NS_PER_MS

DEAD_MAN_MS = 100
TELEMETRY_PERIOD_NS = 20 * NS_PER_MS
TELEMETRY_SHARE = 0.4
FARTHEST_TICKS = TICK_HZ  # commands may lie one second ahead
WHOLE_BOARD = 255  # the channel of a fault that has none
_TURN_AROUND_NS = (20_000, 60_000)
_U16 = 0xFFFF


class Refusal(Exception):
    """A command that is not carried out; becomes its reply.

    :param status: why, as the reply states it.
    :param detail: what the status needs beside it (docs/reference/protocol.md); cut to 65535.
    """

    def __init__(self, status: Status, detail: int = 0):
        self.status, self.detail = status, min(detail, _U16)


class Trip(NamedTuple):
    """A guard that fired.

    :param fault: what was seen.
    :param channel: output or coil, from 0; ``WHOLE_BOARD`` where it is none in particular.
    :param value: what was measured, in the fault's unit (docs/reference/protocol.md).
    """

    fault: Fault
    channel: int
    value: int


class FirmwareModel:
    """Base of the simulated boards.

    :param options: values of ``BOARD_OPTIONS`` and the subclass's own.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on.
    """

    kind: Board
    channels: int
    build: bytes
    telemetry_name: str
    stricter_upward: frozenset[int] = frozenset()
    """Which of the limits are made stricter by raising them."""

    @classmethod
    def options(cls) -> dict[str, Option]:
        """URL keys of this board beside ``BOARD_OPTIONS``.

        :return: default, unit and range by key.
        """
        raise NotImplementedError

    @classmethod
    def built_limits(cls, options: Mapping[str, Any]) -> tuple[int, ...]:
        """Limits at power-on; a host may only make them stricter.

        :param options: values of ``BOARD_OPTIONS`` and the board's own.
        :return: in the order and the units of ``identity.limits``.
        """
        raise NotImplementedError

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int):
        self._options = options
        self._boots = Boots(options, self.kind)
        self.plant_rng, self._latency_rng = self._boots.plant_rng, self._boots.latency_rng
        self.start_ns = self.now_ns = start_ns
        self._line = transmitter
        self._next_ns = NEVER_NS
        self._power_on()
        self._commands: dict[str, Callable[[Any], int]] = {
            "configure": self._configure,
            "arm": self._arm,
            "disarm": self._disarm,
            "stop": self._stop,
        }

    def _power_on(self) -> None:
        """A new clock, a new id, and nothing remembered."""
        self.ticks, self.boot_id = self._boots.power_on(self.now_ns)
        self.limits = list(self.built_limits(self._options))
        self.state = State.DISARMED
        self.faults = 0
        self.late = 0
        self._deframer = Deframer()
        self._answered: OrderedDict[int, bytes] = OrderedDict()
        self._fed_ns = self.now_ns
        self._unsolicited_seq = 0
        self._telemetry_ns = NEVER_NS
        self._telemetry_allowed_ns = self.now_ns

    def brown_out(self) -> None:
        """The CPU's supply breaks down for a moment: outputs off at once, a reboot, and a latched fault that states why."""
        self.reset()
        self.faults, self.state = 1 << Fault.BROWN_OUT, State.FAULT
        self.replan()

    def reset(self) -> None:
        """The CPU's reset line is pulled, as opening a port does by DTR: outputs off at once, and a reboot."""
        self._outputs_off()
        self._line.drop_unsent(self.now_ns)
        self._power_on()
        self._forget()
        self.replan()

    # What a subclass provides.

    def _next_output_ns(self) -> int:
        """When an output, a queue or a guard needs attention next, or ``NEVER_NS``."""
        raise NotImplementedError

    def _run_outputs(self) -> None:
        """Do what is due at ``now_ns``."""
        raise NotImplementedError

    def _outputs_off(self) -> None:
        """Nothing energised, queue empty; at once."""
        raise NotImplementedError

    def _forget(self) -> None:
        """After a reboot: what else was in memory."""
        raise NotImplementedError

    def _begin_arming(self) -> None:
        """Leave ``DISARMED``; raises ``Refusal`` if the board is not fit."""
        raise NotImplementedError

    def _cause_gone(self, fault: Fault) -> bool:
        """Whether ``disarm`` may clear this latched fault."""
        raise NotImplementedError

    def _telemetry(self) -> tuple[Any, ...]:
        """Values of the telemetry message behind time, state and faults, ahead of late and bad frames."""
        raise NotImplementedError

    def truth(self) -> dict[str, Any]:
        """The plant as it is now.

        :return: by name; which ones, each board documents.
        """
        raise NotImplementedError

    def _act(self, channel: int, load: Mapping[str, float]) -> None:
        """Act on the plant from outside."""
        raise NotImplementedError

    def energised(self) -> list[int]:
        """Channels that carry current or dangerous volts now.

        :return: channel numbers, from 0, rising.
        """
        raise NotImplementedError

    def set_load(self, channel: int, **load: float) -> None:
        """Act on the hardware from outside.

        :param channel: coil or output, from 0.
        :param load: what the plant's ``load`` takes; ``brown_out`` and ``reset``, not 0, do what the methods of these names do.
        :raises InputError: no such channel, an unknown key, or a value out of range; see the plant's ``load``.
        """
        browned_out, resets = load.pop("brown_out", 0), load.pop("reset", 0)
        self._act(channel, load)
        if browned_out:
            self.brown_out()
        if resets:
            self.reset()
        self.replan()

    # Time.

    def next_event(self) -> int:
        """When this board does something by itself next.

        :return: world time, ns; ``NEVER_NS`` if it will not.
        """
        return self._next_ns

    def advance(self, to_ns: int) -> None:
        """Run everything due up to and including ``to_ns``.

        :param to_ns: world time, ns; not before ``now_ns``.
        """
        while self._next_ns <= to_ns:
            self.now_ns = self._next_ns
            if self._dead_man_ns() <= self.now_ns:
                self.latch(Fault.DEAD_MAN, WHOLE_BOARD, (self.now_ns - self._fed_ns) // NS_PER_MS)
            self._run_outputs()
            if self._telemetry_ns <= self.now_ns:
                self._send_telemetry()
            self.replan()
        self.now_ns = to_ns

    def replan(self) -> None:
        """Work out the next event afresh."""
        self._next_ns = min(self._telemetry_ns, self._dead_man_ns(), self._next_output_ns())

    def _dead_man_ns(self) -> int:
        return self._fed_ns + DEAD_MAN_MS * NS_PER_MS if self.armed else NEVER_NS

    @property
    def armed(self) -> bool:
        """From arm until made safe."""
        return self.state in (State.SELF_TEST, State.ARMED, State.DRIVING)

    # Bytes.

    def handle(self, data: bytes) -> None:
        """Take bytes whose last bit has just come in.

        :param data: any bytes: whole frames, parts of them, noise.
        """
        for frame in self._deframer.feed(data):
            self._take(frame)
        self.replan()

    def _take(self, frame: Frame) -> None:
        """Answer a frame. One whose number is kept is a repetition, whatever is in it, and gets the reply of the first time."""
        message = BY_TYPE.get(frame.type)
        if message is not None and (message.sender != "host" or self.kind not in message.boards):
            message = None
        name = message.name if message is not None and len(frame.payload) == payload_size(message.name) else ""
        if name:
            self._fed_ns = self.now_ns
        if name == "identify":
            self._identify(frame.seq)
        elif frame.seq in self._answered and name != "stop":
            self._send(self._answered[frame.seq])
        elif name == "sync":
            self._sync(frame.seq, decode("sync", frame.payload).token)
        elif name in self._commands:
            self._answer(frame.seq, *self._carry_out(name, frame.payload))
        elif name != "keepalive":
            self._answer(frame.seq, Status.BAD_LENGTH if message is not None and not name else Status.UNKNOWN, 0)

    def _carry_out(self, name: str, payload: bytes) -> tuple[Status, int]:
        try:
            return Status.OK, self._commands[name](decode(name, payload))
        except Refusal as refusal:
            self.late += refusal.status == Status.LATE
            return refusal.status, refusal.detail

    def _answer(self, seq: int, status: Status, detail: int) -> None:
        """Reply to a command, and keep the reply if it has a number."""
        reply = self._reply_to(seq, status, detail)
        if seq:
            self._answered[seq] = reply
            if len(self._answered) > REMEMBERED_REPLIES:
                self._answered.popitem(last=False)
        self._send(reply)

    def _reply_to(self, seq: int, status: Status, detail: int) -> bytes:
        payload = encode("reply", status, self.ticks.u32(self.now_ns), detail & _U16)
        return encode_frame(BY_NAME["reply"].type, seq, payload)

    def _ready_ns(self) -> int:
        """When an answer to what came in now is ready to go out."""
        return self.now_ns + int(self._latency_rng.integers(*_TURN_AROUND_NS))

    def _send(self, data: bytes) -> None:
        self._line.send(data, self._ready_ns())

    def _send_unsolicited(self, name: str, *values: Any) -> int:
        """Send a message that answers no command; returns its length."""
        data = encode_frame(BY_NAME[name].type, self._unsolicited_seq, encode(name, *values))
        self._unsolicited_seq = (self._unsolicited_seq + 1) % 256
        self._line.send(data, self.now_ns)
        return len(data)

    # Answers.

    def _identify(self, seq: int) -> None:
        """Answer, begin telemetry, and forget old replies: a new host counts its sequence numbers from anywhere."""
        self._answered.clear()
        if self._telemetry_ns == NEVER_NS:
            self._telemetry_ns = self.now_ns + TELEMETRY_PERIOD_NS
        payload = encode(
            "identity",
            PROTOCOL_VERSION,
            self.kind,
            self.channels,
            TICK_HZ,
            schema_hash(),
            self.boot_id,
            self.build,
            DEAD_MAN_MS,
            self.limits,
        )
        self._send(encode_frame(BY_NAME["identity"].type, seq, payload))

    def _sync(self, seq: int, token: int) -> None:
        """Stamp the arrival, and the moment at which the line is free for the answer's first bit."""
        going_ns = max(self._ready_ns(), self._line.busy_until_ns)
        payload = encode("sync_reply", token, self.ticks.u32(self.now_ns), self.ticks.u32(going_ns))
        self._line.send(encode_frame(BY_NAME["sync_reply"].type, seq, payload), going_ns)

    def _send_telemetry(self) -> None:
        """Send if the line is idle and the share keeps; otherwise this one is dropped."""
        self._telemetry_ns += TELEMETRY_PERIOD_NS
        if self._line.busy_until_ns > self.now_ns or self._telemetry_allowed_ns > self.now_ns:
            return
        head = (self.ticks.u32(self.now_ns), self.state, self.faults)
        tail = (self.late & _U16, self._deframer.bad_frames & _U16)
        length = self._send_unsolicited(self.telemetry_name, *head, *self._telemetry(), *tail)
        self._telemetry_allowed_ns = self.now_ns + int(self._line.duration_ns(length) / TELEMETRY_SHARE)

    # Commands both boards know.

    def _configure(self, message: Any) -> int:
        if self.armed:
            raise Refusal(Status.INTERLOCK)
        for index, (wanted, present) in enumerate(zip(message.limits, self.limits, strict=True)):
            if wanted < present if index in self.stricter_upward else wanted > present:
                raise Refusal(Status.BAD_VALUE, 0)
        self.limits = list(message.limits)
        return 0

    def _arm(self, message: Any) -> int:
        if message.boot_id != self.boot_id:
            raise Refusal(Status.BAD_VALUE, 0)
        if self.faults:
            raise Refusal(Status.INTERLOCK, self.faults)
        if not self.armed:
            self._begin_arming()
        return 0

    def _disarm(self, message: Any) -> int:
        self._outputs_off()
        for fault in Fault:
            if self.faults >> fault & 1 and self._cause_gone(fault):
                self.faults &= ~(1 << fault)
        self.state = self._resting_state()
        return self.faults

    def _stop(self, message: Any) -> int:
        self._outputs_off()
        self.state = self._resting_state()
        return self.faults

    def _resting_state(self) -> State:
        """Where the board stands once its outputs are off."""
        return State.FAULT if self.faults else State.DISARMED

    # Shared by the commands.

    def latch(self, fault: Fault, channel: int, value: int) -> None:
        """Make safe, remember why, and report it to a host that has introduced itself.

        :param fault: what was seen.
        :param channel: output or coil, from 0, or ``WHOLE_BOARD``.
        :param value: what was measured, in the fault's unit; reported within 0 to 65535.
        """
        self._outputs_off()
        self.faults |= 1 << fault
        self.state = State.FAULT
        if self._telemetry_ns != NEVER_NS:
            self._send_unsolicited("fault", self.ticks.u32(self.now_ns), fault, channel, min(max(value, 0), _U16))

    def _require_armed(self) -> None:
        """A timed command needs a board that is armed and has tested itself."""
        if not self.armed or self.state == State.SELF_TEST:
            raise Refusal(Status.INTERLOCK, self.faults)

    def _due(self, tick: int) -> int:
        """Full tick count of a command's u32 time.

        :raises Refusal: the time has passed, or lies more than a second ahead.
        """
        present = self.ticks.count(self.now_ns)
        ahead = signed_difference(tick, present % (1 << 32))
        if ahead < 0:
            raise Refusal(Status.LATE, -ahead // 32)
        if ahead > FARTHEST_TICKS:
            raise Refusal(Status.FAR)
        return present + ahead

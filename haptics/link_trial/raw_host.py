"""A host that speaks raw frames on any open port: on a board's virtual clock where it has one, in real time elsewhere.

It keeps every frame it hears, and judges only whether it was answered. What a simulated board's outputs
did is in ``edges``; hardware has none.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

from haptics.errors import LinkError
from haptics.link.clock import signed_ticks
from haptics.link.handshake import UNNUMBERED
from haptics.link.messages import BY_NAME, BY_TYPE, OPEN_COMMANDS, TICK_HZ, Board, State, Status, decode, encode, payload_size
from haptics.link.ports import BytePort, PortErrors, read_waiting
from haptics.link.simulated import SimulatedPort, simulated
from haptics.link_trial.observed import ObservedPort
from haptics.link_trial.raw_frames import checksum, frame, unstuffed
from haptics.time import NS_PER_MS

TICKS_PER_MS = TICK_HZ // 1000
_ANSWERS = ("identity", "sync_reply", "reply")
_BOOT_MS = 4000.0
_KEEPALIVE_MS = 30.0
_SPARE_MS = 40.0  # a real machine needs some milliseconds for a question and its answer
_LARGEST_NUMBER = 255


class Broken(Exception):
    """A rule was broken; the message is what was seen."""


class NotApplicable(Exception):
    """A rule cannot be tried on this board or port; the message is the reason."""


class Heard(NamedTuple):
    """A frame from the board.

    :param time_ns: when its last byte was read (host's ``now_ns``).
    :param name: of the message.
    :param seq: its sequence number.
    :param message: its fields.
    """

    time_ns: int
    name: str
    seq: int
    message: Any


class Edge(NamedTuple):
    """An output of a simulated board went on or off.

    :param time_ns: when (world ns).
    :param kind: coil, brake or piezo.
    :param channel: from 0.
    :param drive: 1 on, -1 on with the other sign, 0 off.
    """

    time_ns: int
    kind: str
    channel: int
    drive: int


def need(condition: bool, seen: str) -> None:
    """Require a condition.

    :param condition: what must hold.
    :param seen: what was observed, for the message.
    :raises Broken: it does not hold.
    """
    if not condition:
        raise Broken(seen)


class RawHost:
    """A host on an open port.

    ``heard``: all frames so far. ``strange``: what came and was no frame of a board. ``identity``: the last one heard.
    ``simulated``, ``observed``: the port where it gives access to its board's truth, else None.

    :param port: from ``open_port``.
    :param name: how errors name it.
    """

    def __init__(self, port: BytePort, name: str):
        self.port, self.name = port, name
        in_virtual_time = isinstance(port, ObservedPort) and port.virtual
        self.simulated: SimulatedPort | None = simulated(port) if in_virtual_time else None
        self.observed: ObservedPort | None = port if isinstance(port, ObservedPort) and in_virtual_time else None
        self.heard: list[Heard] = []
        self.strange: list[bytes] = []
        self.edges: list[Edge] = []
        self.identity: Any = None
        self._buffer = b""
        self._seq = 0
        self._begun_ns = 0 if in_virtual_time else time.monotonic_ns()
        self._now_ns = 0
        if self.observed is not None:
            self.observed.watch(self._note_edge)

    def _note_edge(self, time_ns: int, kind: str, channel: int, drive: int) -> None:
        self.edges.append(Edge(time_ns, kind, channel, drive))

    # Time.

    @property
    def now_ns(self) -> int:
        """The board's world's time if it is virtual, else time since this host was made."""
        return self._now_ns if self.simulated is not None else time.monotonic_ns() - self._begun_ns

    @property
    def world(self) -> SimulatedPort:
        """The simulated port.

        :raises NotApplicable: this is hardware, or runs in real time.
        """
        if self.simulated is None:
            raise NotApplicable("only a simulated board in virtual time shows this")
        return self.simulated

    @property
    def outputs(self) -> ObservedPort:
        """The port that reports its board's outputs.

        :raises NotApplicable: this is hardware, or runs in real time.
        """
        if self.observed is None:
            raise NotApplicable("only a simulated board in virtual time shows its outputs")
        return self.observed

    def run_to(self, to_ns: int) -> None:
        """Listen up to a time, and send nothing.

        :param to_ns: as ``now_ns`` counts.
        :raises LinkLost: the port went away.
        """
        with PortErrors(self.name, "read"):
            if self.simulated is None:
                while self.now_ns < to_ns:
                    self._read()
            else:
                self._step(self.simulated, to_ns)

    def _step(self, board: SimulatedPort, to_ns: int) -> None:
        while self._now_ns < to_ns:
            event_ns = board.next_event()
            self._now_ns = to_ns if event_ns is None else min(max(event_ns, self._now_ns + 1), to_ns)
            board.advance(self._now_ns)
            self._read()

    def run(self, ms: float) -> None:
        """Listen for some time, and send nothing: an armed board makes itself safe after a tenth of a second.

        :param ms: how long (ms).
        """
        self.run_to(self.now_ns + round(ms * NS_PER_MS))

    def live(self, ms: float) -> None:
        """Listen for some time, and keep the board's dead-man fed.

        :param ms: how long (ms).
        """
        end_ns = self.now_ns + round(ms * NS_PER_MS)
        while self.now_ns < end_ns:
            self.send("keepalive", seq=0)
            self.run_to(min(self.now_ns + round(_KEEPALIVE_MS * NS_PER_MS), end_ns))

    def wait_out(self, ms: float) -> None:
        """Live on until what was scheduled some time after a ``tick_in`` before now is over.

        :param ms: how long after that tick (ms).
        """
        self.live(ms + self._spare_ms)

    # Bytes.

    def write(self, data: bytes) -> None:
        """Send bytes as they are.

        :param data: the bytes.
        :raises LinkLost: the port went away.
        """
        with PortErrors(self.name, "write"):
            self.port.write(data)

    def _read(self) -> None:
        came = read_waiting(self.port)
        self._buffer += came or (b"" if self.simulated is not None else self.port.read(1))
        *pieces, self._buffer = self._buffer.split(b"\0")
        for piece in filter(None, pieces):
            self._hear(piece)

    def _hear(self, piece: bytes) -> None:
        body = unstuffed(piece) or b""
        message = BY_TYPE.get(body[0]) if body else None
        whole = len(body) >= 4 and checksum(body[:-2]) == body[-2:]
        if not whole or message is None or message.sender != "board" or len(body) != payload_size(message.name) + 4:
            self.strange.append(piece)
            return
        self.heard.append(Heard(self.now_ns, message.name, body[1], decode(message.name, body[2:-2])))
        if message.name == "identity":
            self.identity = self.heard[-1].message

    def number(self) -> int:
        """The next sequence number.

        :return: 1 to 255, 1 following 255.
        """
        self._seq = self._seq % _LARGEST_NUMBER + 1
        return self._seq

    def send(self, name: str, *values: Any, seq: int | None = None) -> int:
        """Send a message.

        :param name: in the message table.
        :param values: its fields.
        :param seq: its number; None: the next one, or 0 for messages that carry none.
        :return: the number it was sent under.
        """
        if seq is None:
            seq = 0 if name in UNNUMBERED else self.number()
        self.write(frame(BY_NAME[name].type, seq, encode(name, *values)))
        return seq

    # Questions.

    def answers(self, data: bytes, count: int = 1, wait_ms: float | None = None) -> list[Heard]:
        """Send bytes and wait for answers.

        :param data: frames, or anything else.
        :param count: answers to wait for.
        :param wait_ms: longest wait (ms); None: ``patience_ms``.
        :return: answers that came, more than ``count`` if there were more.
        """
        mark = len(self.heard)
        self.write(data)
        end_ns = self.now_ns + round((wait_ms or self.patience_ms) * NS_PER_MS)
        while len(found := [one for one in self.heard[mark:] if one.name in _ANSWERS]) < count and self.now_ns < end_ns:
            self._run_on(end_ns)
        return found

    def _run_on(self, end_ns: int) -> None:
        """A little further: to the next event, or by what one read of a real port takes."""
        event_ns = self.simulated.next_event() if self.simulated is not None else self.now_ns + NS_PER_MS
        self.run_to(end_ns if event_ns is None else min(event_ns, end_ns))

    @property
    def patience_ms(self) -> float:
        """How long an answer may take (ms): in real time, longer than any machine is busy with other things."""
        return 20.0 if self.simulated is not None else 250.0

    def ask(self, name: str, *values: Any, seq: int | None = None) -> Any:
        """Send a message and wait for its answer.

        :param name: in the message table.
        :param values: its fields.
        :param seq: its number; None: the next one, or 0 for messages that carry none.
        :return: the message that answers.
        :raises Broken: none came, or one with another number.
        """
        if seq is None:
            seq = 0 if name in UNNUMBERED else self.number()
        found = self.answers(frame(BY_NAME[name].type, seq, encode(name, *values)))
        need(bool(found), f"no answer to {name} number {seq} within {self.patience_ms:g} ms")
        need(found[0].seq == seq, f"{name} number {seq} was answered under number {found[0].seq}")
        return found[0].message

    def expect(self, name: str, *values: Any, status: Status = Status.OK, detail: int | None = 0, seq: int | None = None) -> Any:
        """Send a command and compare its reply with what is expected.

        :param name: in the message table.
        :param values: its fields.
        :param status: expected status.
        :param detail: expected detail; None: any.
        :param seq: its number; None: the next one.
        :return: the reply.
        :raises Broken: the reply differs.
        """
        reply = self.ask(name, *values, seq=seq)
        wanted = status.name.lower() if detail is None else f"{status.name.lower()}, detail {detail}"
        fits = reply.status == status and detail in (None, reply.detail)
        need(fits, f"{name} was answered {reply_in_words(reply)}; expected {wanted}")
        return reply

    def meet(self) -> Any:
        """Send ``identify`` until an answer comes: a board may be silent for some seconds while it boots.

        :return: the board's identity.
        :raises LinkError: no board answers.
        """
        end_ns = self.now_ns + round(_BOOT_MS * NS_PER_MS)
        while self.now_ns < end_ns:
            found = self.answers(b"\0" + frame(BY_NAME["identify"].type, 0), wait_ms=100.0)
            if any(one.name == "identity" for one in found):
                return self.identity
        raise LinkError(
            self.name, f"no identity within {_BOOT_MS / 1000:g} s; {self._seen()}", "identify", "try haptics link identify"
        )

    def _seen(self) -> str:
        """What came so far, in words."""
        first = self.strange[0] if self.strange else self._buffer
        if not self.heard and not first:
            return "no byte came"
        quoted = f", beginning with {first[:32]!r}" if first else ""
        return f"{len(self.heard)} frames of a board came, and {len(self.strange)} other pieces{quoted}"

    @property
    def board(self) -> Board:
        """Which board was met."""
        return Board(self.identity.board)

    def tick(self) -> int:
        """The board's clock a moment ago.

        :return: ticks, u32.
        """
        return self.ask("sync", 1).sent

    def tick_in(self, ms: float) -> int:
        """The board's tick some time from now; in real time a little later, for what is still to be sent before.

        :param ms: how long from now (ms).
        :return: ticks, u32.
        """
        return (self.tick() + round((ms + (self._spare_ms if ms > 0 else 0)) * TICKS_PER_MS)) % 2**32

    @property
    def _spare_ms(self) -> float:
        return 0.0 if self.simulated is not None else _SPARE_MS

    def arm(self) -> None:
        """Arm, and wait until a brake controller has tested itself.

        :raises Broken: it does not arm.
        """
        boot_id = self.ask("identify").boot_id
        self.expect("arm", boot_id)
        state = State.SELF_TEST
        for _ in range(25):
            state = State(self.telemetry().state)
            if state == State.ARMED:
                return
        raise Broken(f"armed, but {state.name.lower()} half a second later")

    def rest(self) -> None:
        """Disarm, and clear the faults whose cause is gone; returns once telemetry shows it."""
        self.ask("disarm")
        for _ in range(10):
            if self.telemetry().state in (State.DISARMED, State.FAULT):
                return

    def telemetry(self, feed: bool = True) -> Any:
        """The next telemetry that was sent after now.

        :param feed: ask for the board's clock first, which feeds its dead-man; False: take the next telemetry that comes.
        :return: the message.
        :raises Broken: none comes.
        """
        mark = len(self.heard)
        now = self.tick() if feed else None
        end_ns = self.now_ns + round(5 * self.patience_ms * NS_PER_MS)
        while self.now_ns < end_ns:
            for one in self.heard[mark:]:
                if one.name.endswith("telemetry") and (now is None or signed_ticks(one.message.time, now) > 0):
                    return one.message
            mark = len(self.heard)
            self._run_on(end_ns)
        raise Broken(f"no telemetry within {5 * self.patience_ms:g} ms")

    def all(self, name: str, since: int = 0) -> list[Heard]:
        """Frames of one name.

        :param name: of the message; ``telemetry`` is that of either board.
        :param since: index in ``heard`` of the first frame looked at.
        :return: frames in their order.
        """
        return [one for one in self.heard[since:] if one.name == name or (name == "telemetry" and one.name.endswith(name))]

    def flood(self, name: str, *values: Any, count: int) -> list[int]:
        """Send numbered commands as fast as the line takes them, eight open at a time.

        :param name: in the message table.
        :param values: fields of each.
        :param count: how many; rounded down to a multiple of eight.
        :return: the numbers they were sent under.
        :raises Broken: a reply is missing.
        """
        sent: list[int] = []
        for _ in range(count // OPEN_COMMANDS):
            numbers = [self.number() for _ in range(OPEN_COMMANDS)]
            found = self.answers(b"".join(frame(BY_NAME[name].type, n, encode(name, *values)) for n in numbers), OPEN_COMMANDS)
            answered = [one.seq for one in found]
            need(answered == numbers, f"numbers {numbers} were sent at once, and answered were {answered}")
            sent += numbers
        return sent


def reply_in_words(reply: Any) -> str:
    """A reply in words.

    :param reply: the message.
    :return: status and detail.
    """
    known = reply.status in Status.__members__.values()
    return f"{Status(reply.status).name.lower() if known else f'status {reply.status}'}, detail {reply.detail}"

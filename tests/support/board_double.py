"""A small board written from docs/reference/protocol.md alone, and a line to lose things on.

It has a CRC and a COBS coder of its own.
"""

from __future__ import annotations

import heapq
import re
import struct
from collections.abc import Callable
from pathlib import Path

PROTOCOL_PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "protocol.md"
SCHEMA_HASH = int(re.search(r"It is 0x([0-9A-F]{8})\.", PROTOCOL_PAGE.read_text()).group(1), 16)  # type: ignore[union-attr]

IDENTIFY, SYNC, CONFIGURE, ARM, DISARM, STOP, KEEPALIVE, PULSE, CANCEL = 1, 2, 3, 4, 5, 6, 7, 0x10, 0x11
LENGTHS = {IDENTIFY: 0, SYNC: 4, CONFIGURE: 10, ARM: 4, DISARM: 0, STOP: 0, KEEPALIVE: 0, PULSE: 23, CANCEL: 2}
OK, LATE, FAR, FULL, BAD_LENGTH, UNKNOWN, INTERLOCK, BAD_VALUE, HOT = range(9)
MS = 1_000_000


def crc16_x25(data: bytes) -> int:
    """Bit by bit."""
    register = 0xFFFF
    for byte in data:
        for bit in range(8):
            feedback = (register ^ (byte >> bit)) & 1
            register >>= 1
            if feedback:
                register ^= 0x8408
    return register ^ 0xFFFF


def stuff(data: bytes) -> bytes:
    """COBS of fewer than 254 bytes."""
    return b"".join(bytes([len(run) + 1]) + run for run in data.split(b"\0"))


def unstuff(data: bytes) -> bytes | None:
    """Inverse of ``stuff``; None if it is no COBS."""
    out, at = b"", 0
    while at < len(data):
        code = data[at]
        run = data[at + 1 : at + code]
        if code == 0 or len(run) != code - 1:
            return None
        at += code
        out += run + (b"\0" if at < len(data) else b"")
    return out


def frame(type_: int, seq: int, payload: bytes = b"") -> bytes:
    """Wire bytes, delimiter included."""
    body = bytes([type_, seq]) + payload
    return stuff(body + struct.pack("<H", crc16_x25(body))) + b"\0"


def parse(raw: bytes) -> tuple[int, int, bytes] | None:
    """Type, number and payload of one frame without its delimiter; None if it is none."""
    body = unstuff(raw)
    if body is None or len(body) < 4 or crc16_x25(body[:-2]) != struct.unpack("<H", body[-2:])[0]:
        return None
    return body[0], body[1], body[2:-2]


class BoardDouble:
    """A tactiles board that notes what it carries out. ``handle`` returns the bytes it answers."""

    def __init__(self, boot_id: int = 0xB0070001, ticks_0: int = 12345, skew: float = 0.0, born_ns: int = 0):
        self.boot_id, self.ticks_0, self.skew, self.born_ns = boot_id, ticks_0, skew, born_ns
        self.schema_hash, self.kind, self.protocol = SCHEMA_HASH, 1, 1
        self.limits: tuple[int, ...] = (200, 2000, 32, 4500, 2500)
        self.armed = False
        self.silent = False
        self.turn_around_ns = 50_000
        self.carried_out: list[tuple[int, int, bytes]] = []
        self.heard: list[tuple[int, int, bytes]] = []
        self._kept: dict[int, bytes] = {}
        self._buffer = b""

    def ticks(self, now_ns: int) -> int:
        return (self.ticks_0 + int((now_ns - self.born_ns) * 2e-3 * (1 + self.skew))) % 2**32

    def types(self) -> list[int]:
        return [type_ for type_, _, _ in self.carried_out]

    def handle(self, data: bytes, now_ns: int) -> bytes:
        *whole, self._buffer = (self._buffer + data).split(b"\0")
        answers = b""
        for raw in whole:
            parsed = parse(raw) if raw else None
            if parsed is not None:
                self.heard.append(parsed)
                if not self.silent:
                    answers += self._answer(*parsed, now_ns)
        return answers

    def _answer(self, type_: int, seq: int, payload: bytes, now_ns: int) -> bytes:
        going = self.ticks(now_ns + self.turn_around_ns)
        if type_ == IDENTIFY:
            self._kept.clear()
            fields = (
                self.protocol,
                self.kind,
                15 if self.kind == 1 else 5,
                2_000_000,
                self.schema_hash,
                self.boot_id,
                b"double",
                100,
                *self.limits,
            )
            return frame(0x81, seq, struct.pack("<BBBIII8sH5H", *fields))
        if type_ == SYNC:
            return frame(0x82, seq, payload + struct.pack("<II", self.ticks(now_ns), going))
        if type_ == KEEPALIVE:
            return b""
        if seq in self._kept:
            return self._kept[seq]
        status, detail = self._carry_out(type_, payload, now_ns)
        if status == OK:
            self.carried_out.append((type_, seq, payload))
        answer = frame(0x90, seq, struct.pack("<BIH", status, going, detail))
        if seq:
            self._kept[seq] = answer
            if len(self._kept) > 16:
                del self._kept[next(iter(self._kept))]
        return answer

    def _carry_out(self, type_: int, payload: bytes, now_ns: int) -> tuple[int, int]:
        if type_ not in LENGTHS:
            return UNKNOWN, 0
        if len(payload) != LENGTHS[type_]:
            return BAD_LENGTH, 0
        if type_ == ARM:
            if struct.unpack("<I", payload)[0] != self.boot_id:
                return BAD_VALUE, 0
            self.armed = True
        elif type_ in (DISARM, STOP):
            self.armed = False
        elif type_ == CONFIGURE:
            if struct.unpack("<5H", payload)[0] > 200:
                return BAD_VALUE, 0
            self.limits = struct.unpack("<5H", payload)
        elif type_ == PULSE:
            if not self.armed:
                return INTERLOCK, 0
            ahead = (struct.unpack("<I", payload[:4])[0] - self.ticks(now_ns) + 2**31) % 2**32 - 2**31
            if ahead < 0:
                return LATE, min(-ahead // 32, 65535)
            if ahead > 2_000_000:
                return FAR, 0
        return OK, 0

    def telemetry(self, now_ns: int, state: int | None = None, faults: int = 0) -> bytes:
        state = state if state is not None else 2 if self.armed else 0
        return frame(0xA0, 0, struct.pack("<IBH15H15B5H", self.ticks(now_ns), state, faults, *[0] * 35))

    def fault(self, now_ns: int, code: int, channel: int = 255) -> bytes:
        return frame(0xA2, 0, struct.pack("<IBBH", self.ticks(now_ns), code, channel, 0))

    def reboot(self, boot_id: int, now_ns: int) -> None:
        self.boot_id, self.born_ns, self.ticks_0, self.armed = boot_id, now_ns, 0, False
        self._kept.clear()
        self._buffer = b""


class Bench:
    """A session, a board double, and two wires with a delay between them, in virtual time.

    ``up`` and ``down`` are called with (now_ns, bytes) and return what comes out at the other end as (delay_ns, bytes),
    or None for what is lost.
    """

    def __init__(self, session, board: BoardDouble, delay_ns: int = 300_000):
        self.session, self.board, self.now_ns = session, board, 0
        self.up: Callable[[int, bytes], tuple[int, bytes] | None] = lambda now_ns, data: (delay_ns, data)
        self.down: Callable[[int, bytes], tuple[int, bytes] | None] = lambda now_ns, data: (delay_ns, data)
        self._wires: list[tuple[int, int, str, bytes]] = []
        self._count = 0
        self._last = {"up": 0, "down": 0}
        self.events: list[object] = []

    def put(self, direction: str, data: bytes, at_ns: int) -> None:
        """Hand bytes to a wire: first in, first out."""
        for piece in re.findall(rb"[^\0]*\0|[^\0]+", data):
            passed = getattr(self, direction)(at_ns, piece)
            if passed is not None:
                self._last[direction] = max(self._last[direction], at_ns + passed[0])
                self._count += 1
                heapq.heappush(self._wires, (self._last[direction], self._count, direction, passed[1]))

    def flush(self) -> None:
        data = self.session.outgoing()
        if data:
            self.put("up", data, self.now_ns)
        self.events += self.session.events()

    def run_until(self, t_ns: int) -> None:
        self.flush()
        while True:
            deadline_ns = self.session.next_deadline_ns
            times = [time for time in (deadline_ns, self._wires[0][0] if self._wires else None) if time is not None]
            if not times or min(times) > t_ns:
                break
            self.now_ns = max(self.now_ns, min(times))
            while self._wires and self._wires[0][0] <= self.now_ns:
                _, _, direction, data = heapq.heappop(self._wires)
                if direction == "up":
                    answers = self.board.handle(data, self.now_ns)
                    if answers:
                        self.put("down", answers, self.now_ns + self.board.turn_around_ns)
                else:
                    self.session.receive(data, self.now_ns)
                    self.flush()
            self.session.poll(self.now_ns)
            self.flush()
        self.now_ns = t_ns
        self.session.poll(t_ns)
        self.flush()

    def run(self, ms: float) -> None:
        self.run_until(self.now_ns + round(ms * MS))

    def happened(self, kind: type) -> list:
        return [event for event in self.events if isinstance(event, kind)]

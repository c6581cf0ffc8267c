"""What a board may have energised, and until when: by the frames that were written to it, its replies, and its lid.

The oracle cuts and checks both streams by itself (COBS and CRC-16/X-25 written here from the protocol page). Its permission is
revocable: what was accepted counts until a later drive replaces it, its time ends, or the board was stopped, disarmed, latched a
fault, fell silent or had its lid opened; none of that comes back but by a new arm and a new command. Edges are judged once all
that was said before them has been answered.
"""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

NEVER_NS = 1 << 62
NS_PER_S = 1_000_000_000
MS = 1_000_000
TICKS_PER_MS = 2000
BYTE_NS = 20_000  # ten bits at 500 kbaud
DEAD_MAN_NS = 100 * MS
SELF_TEST_NS = 30 * MS  # five outputs, each shorted for 1 ms and charged twice
SELF_TEST_V = 42.4
DISCHARGE_NS = 5 * MS
HIGHEST_V = 1500
LONGEST_TTL_MS = 2000
LONGEST_PULSE = 200
MAX_COILS = 3  # 12 A, 3.907 A each
LID_NS = 8 * MS  # a board looks at its lid each 5 ms at least
LENGTHS = {0x01: 0, 0x02: 4, 0x03: 10, 0x04: 4, 0x05: 0, 0x06: 0, 0x07: 0, 0x10: 23, 0x11: 2, 0x20: 11, 0x21: 7}
IDENTIFY, SYNC, CONFIGURE, ARM, DISARM, STOP, KEEPALIVE, PULSE, CANCEL, DRIVE, PIEZO = LENGTHS
REPLY, FAULT = 0x90, 0xA2
KEPT_REPLIES = 16
PAST_NS = 50 * MS  # what ended longer ago explains nothing


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x8408 if byte & 1 else 0)
        table.append(byte)
    return table


_CRC = _crc_table()


def crc(data: bytes) -> int:
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _CRC[(value ^ byte) & 0xFF]
    return value ^ 0xFFFF


def stuff(data: bytes) -> bytes:
    return b"".join(bytes((len(run) + 1,)) + run for run in data.split(b"\x00")) + b"\x00"


def unstuff(data: bytes) -> bytes | None:
    """None if it is not stuffed right."""
    out, at = bytearray(), 0
    while at < len(data):
        run = data[at]
        if at + run > len(data):
            return None
        out += data[at + 1 : at + run]
        at += run
        if at < len(data) and run < 255:
            out.append(0)
    return bytes(out)


def frame(kind: int, seq: int, payload: bytes = b"") -> bytes:
    body = bytes((kind, seq)) + payload
    return stuff(body + struct.pack("<H", crc(body)))


class Frames:
    """Whole frames of a stream, each with the place of its last byte."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        found, at = [], -len(self._rest)
        *pieces, rest = (bytes(self._rest) + data).split(b"\x00")
        self._rest = bytearray(rest)
        for piece in pieces:
            at += len(piece) + 1
            body = unstuff(piece) if 5 <= len(piece) <= 69 else None
            if body is not None and len(body) >= 4 and crc(body[:-2]) == struct.unpack("<H", body[-2:])[0]:
                found.append((at, body[:-2]))
        return found


class Asked(NamedTuple):
    """A frame that owes a reply; ``kind`` 0: a repetition, or one that cannot be read."""

    time_ns: int
    kind: int
    seq: int
    payload: bytes


@dataclass
class Permit:
    """What one accepted command allows: a coil's pulse, a drive, a burst."""

    due_ns: int
    end_ns: int
    granted_ns: int
    mask: int = 0
    sign: int = 0
    volts: int = 0
    frequency_dhz: int = 0
    revoked_ns: int = NEVER_NS
    played: bool = False

    @property
    def half_period_ns(self) -> int:
        """For so long may volts stand above an amplitude that was lowered."""
        return 5 * NS_PER_S // self.frequency_dhz if self.frequency_dhz else 0

    def holds(self, time_ns: int) -> bool:
        return self.granted_ns <= time_ns < self.revoked_ns


class Oracle:
    """Holds each edge, and what stands, against what may be.

    :param punctual_ns: how late a coil may go on. :param late_ns: how late anything may go off.
    :param may_lose: the board may lose frames, as a chip does when more short ones come in than there is room for replies.
    """

    def __init__(self, port: Any, punctual_ns: int, late_ns: int, may_lose: bool):
        self._port, self._boot_id = port, port.board.boot_id
        self._punctual_ns, self._late_ns, self._may_lose = punctual_ns, late_ns, may_lose
        self._written, self._read = Frames(), Frames()
        self._kept: deque[int] = deque(maxlen=KEPT_REPLIES)
        self._asked: deque[Asked] = deque()
        self._edges: deque[tuple[int, str, int, int]] = deque()
        self._sights: deque[tuple[int, list[float]]] = deque()  # volts that were seen
        self._heard_ns = port.now_ns
        self.permits: dict[str, list[Permit]] = {"coil": [], "brake": [], "piezo": []}
        self._armed: list[list[int]] = []  # from when until when
        self._opened_ns = -NEVER_NS
        self.lid_open = False
        self.valid = 0
        self.on: dict[tuple[str, int], int] = {}
        self.starts = {"coil": 0, "brake": 0, "piezo": 0}
        self.wrong: list[str] = []
        port.watch(lambda *edge: self._edges.append(edge))

    @property
    def armed(self) -> bool:
        return bool(self._armed) and self._armed[-1][1] == NEVER_NS

    # What is said and done.

    def write(self, data: bytes) -> None:
        """These bytes go out now, on a line that is idle."""
        for at, body in self._written.feed(data):
            self._take(self._port.now_ns + at * BYTE_NS, body[0], body[1], body[2:])
        self._port.write(data)

    def move_lid(self) -> None:
        """Open it, or close it when it was open long enough to be noticed; unless something is not answered yet."""
        if self._asked or (self.lid_open and self._port.now_ns - self._opened_ns < 2 * LID_NS):
            return
        self.lid_open = not self.lid_open
        self._port.set_load(0, lid_open=int(self.lid_open))
        if self.lid_open:
            self._opened_ns = self._port.now_ns
            self._end(self._opened_ns, LID_NS)

    def settle(self) -> None:
        """Read what the board said, and judge as far as it has answered."""
        for _, body in self._read.feed(self._port.read(65_536)):
            if body[0] == REPLY:
                self._answered(body)
            elif body[0] == FAULT:
                self._end(self._port.tick_ns(struct.unpack("<I", body[2:6])[0]))
        now_ns = self._port.now_ns
        if "volts" in (truth := self._port.truth()):
            self._sights.append((now_ns, [abs(volts) for volts in truth["volts"]]))
        self._judge(min(now_ns, self._asked[0].time_ns - 1) if self._asked else now_ns)

    def _take(self, time_ns: int, kind: int, seq: int, payload: bytes) -> None:
        readable = LENGTHS.get(kind) == len(payload)
        if time_ns - self._heard_ns >= DEAD_MAN_NS:
            self._end(self._heard_ns + DEAD_MAN_NS)
        if readable:
            self.valid += 1
            self._heard_ns = time_ns
        if readable and kind == IDENTIFY:
            self._kept.clear()
            return
        repeated = seq in self._kept
        if readable and kind in (SYNC, KEEPALIVE) and not repeated:
            return
        fresh = readable and (not repeated or kind == STOP)
        self._asked.append(Asked(time_ns, kind if fresh else 0, seq, payload))
        if seq and not repeated:
            self._kept.append(seq)

    def _answered(self, body: bytes) -> None:
        asked = self._asked.popleft()
        while self._may_lose and body[1] != asked.seq:
            if asked.seq in self._kept:
                self._kept.remove(asked.seq)
            asked = self._asked.popleft()
        status, tick = body[2], struct.unpack("<I", body[3:7])[0]
        if body[1] != asked.seq:
            self.wrong.append(f"reply to {body[1]} where {asked.seq} was asked")
        if status != 0 or not asked.kind:
            return
        time_ns = max(self._port.tick_ns(tick), asked.time_ns - 500)
        unnoticed = self.lid_open and time_ns - self._opened_ns < LID_NS  # it may not have looked yet
        if asked.kind in (STOP, DISARM):
            self._end(time_ns)
        elif asked.kind == ARM and not unnoticed:
            self._arm(time_ns, struct.unpack("<I", asked.payload)[0])
        elif asked.kind in (PULSE, DRIVE, PIEZO):
            if not self.armed and not unnoticed:
                self.wrong.append(f"{asked.kind:#x} was taken at {time_ns / MS} ms by a board that is not armed")
            self._grant(asked.kind, asked.payload, time_ns)
            if unnoticed:
                self._end(self._opened_ns, LID_NS)
        elif asked.kind == CANCEL:
            for permit in self.permits["coil"]:
                if permit.due_ns > time_ns and struct.unpack("<H", asked.payload)[0] & permit.mask:
                    permit.revoked_ns = min(permit.revoked_ns, time_ns)

    def _arm(self, time_ns: int, boot_id: int) -> None:
        if boot_id != self._boot_id or (self.lid_open and not self.armed):
            self.wrong.append(f"armed at {time_ns / MS} ms by boot id {boot_id:08x}, lid open: {self.lid_open}")
        if not self.armed:
            self._armed.append([time_ns, NEVER_NS])

    def _grant(self, kind: int, payload: bytes, time_ns: int) -> None:
        tick = struct.unpack("<I", payload[:4])[0]
        due_ns = self._port.tick_ns(tick)

        def after(ms: float) -> int:
            return self._port.tick_ns((tick + round(ms * TICKS_PER_MS)) % 2**32)

        if kind == PULSE:
            channels, toward = struct.unpack("<HH", payload[4:8])
            for channel in range(15):
                units = payload[8 + channel]
                if channels >> channel & 1 and not 0 < units <= LONGEST_PULSE:
                    self.wrong.append(f"a pulse of {units} units was taken")
                elif channels >> channel & 1:
                    sign = 1 if toward >> channel & 1 else -1
                    self.permits["coil"].append(Permit(due_ns, after(units / 20), time_ns, mask=1 << channel, sign=sign))
        elif kind == DRIVE:
            mask, volts, frequency_dhz, ttl_ms = struct.unpack("<BHHH", payload[4:])
            if mask and volts and not (volts <= HIGHEST_V and 0 < ttl_ms <= LONGEST_TTL_MS and mask < 32 and frequency_dhz >= 5):
                self.wrong.append(f"a drive of {volts} V for {ttl_ms} ms at {frequency_dhz} dHz on {mask:#x} was taken")
            drive = Permit(due_ns, after(ttl_ms), time_ns, mask if volts else 0, 0, volts if mask else 0, frequency_dhz)
            self.permits["brake"].append(drive)
        else:
            mask, duration_ms = struct.unpack("<BH", payload[4:])
            self.permits["piezo"].append(Permit(due_ns, after(duration_ms), time_ns, mask=mask))

    def _end(self, time_ns: int, unnoticed_ns: int = 0) -> None:
        """From then on, or once the board can have noticed, nothing that was granted so far is permitted."""
        if self.armed:
            self._armed[-1][1] = time_ns + unnoticed_ns
        for permits in self.permits.values():
            for permit in permits:
                permit.revoked_ns = min(permit.revoked_ns, time_ns + unnoticed_ns + self._late_ns)

    # What may be.

    def _judge(self, until_ns: int) -> None:
        if until_ns - self._heard_ns >= DEAD_MAN_NS and self.armed:
            self._end(self._heard_ns + DEAD_MAN_NS)
        while self._edges and self._edges[0][0] <= until_ns:
            self._switched(*self._edges.popleft())
        while self._sights and self._sights[0][0] <= until_ns:
            time_ns, volts = self._sights.popleft()
            for channel, seen in enumerate(volts):
                if seen > SELF_TEST_V and seen > (most := self._highest_v(channel, time_ns)):
                    self.wrong.append(f"{seen:.1f} V on output {channel} at {time_ns / MS} ms, where {most:.1f} may be")
        self._standing(until_ns)
        for kind, permits in self.permits.items():
            self.permits[kind] = [p for p in permits if min(p.end_ns, p.revoked_ns) + p.half_period_ns > until_ns - PAST_NS]
        self._armed = [span for span in self._armed if span[1] > until_ns - PAST_NS]

    def _switched(self, time_ns: int, kind: str, channel: int, drive: int) -> None:
        since_ns = self.on.pop((kind, channel), None)
        if since_ns is not None and not self._may_stand(kind, channel, time_ns):
            self.wrong.append(f"{kind} {channel} was on until {time_ns / MS} ms, longer than it may")
        if not drive:
            return
        self.on[kind, channel] = time_ns
        self.starts[kind] += 1
        if not self._may_start(kind, channel, drive, time_ns):
            self.wrong.append(f"{kind} {channel} went on at {time_ns / MS} ms, and nothing that holds says so")
        coils = sum(what == "coil" for what, _ in self.on)
        if coils > MAX_COILS:
            self.wrong.append(f"{coils} coils on at {time_ns / MS} ms")

    def _standing(self, time_ns: int) -> None:
        for kind, channel in self.on:
            if not self._may_stand(kind, channel, time_ns):
                self.wrong.append(f"{kind} {channel} is on at {time_ns / MS} ms, longer than it may")

    def _may_start(self, kind: str, channel: int, drive: int, time_ns: int) -> bool:
        if kind != "coil":
            return self._may_stand(kind, channel, time_ns)
        for permit in self.permits["coil"]:
            in_time = 0 <= time_ns - permit.due_ns <= self._punctual_ns
            if in_time and permit.mask == 1 << channel and permit.sign == drive and not permit.played and permit.holds(time_ns):
                permit.played = True
                return True
        return False

    def _may_stand(self, kind: str, channel: int, time_ns: int) -> bool:
        """Permission may have ended so long ago as the board may be late."""
        since_ns = time_ns - self._late_ns
        moments = {time_ns, since_ns} | {moment for span in self._armed for moment in (span[1] - 1, span[0] + SELF_TEST_NS - 1)}
        moments |= {moment for one in self.permits[kind] for moment in (one.due_ns, one.end_ns - 1)}
        return any(since_ns <= one <= time_ns and self._permitted(kind, channel, one) for one in moments)

    def _permitted(self, kind: str, channel: int, time_ns: int) -> bool:
        if kind == "brake":
            if any(since_ns <= time_ns < min(until_ns, since_ns + SELF_TEST_NS) for since_ns, until_ns in self._armed):
                return True
            drive = self._in_force(time_ns)
            return drive is not None and bool(drive.mask >> channel & 1) and time_ns < drive.end_ns
        return any(
            one.mask >> channel & 1 and one.due_ns <= time_ns < one.end_ns and one.holds(time_ns) for one in self.permits[kind]
        )

    def _in_force(self, time_ns: int) -> Permit | None:
        """The drive whose tick came last, and of equals the one that was taken last."""
        come = [one for one in self.permits["brake"] if one.due_ns <= time_ns and one.holds(time_ns)]
        return max(reversed(come), key=lambda one: one.due_ns, default=None)

    def _highest_v(self, channel: int, time_ns: int) -> float:
        """Volts of what was in force within a discharge, or, of the same wave, within its half period; else of a self test."""
        waves = {(one.mask, one.frequency_dhz) for at in (0, DISCHARGE_NS) if (one := self._in_force(time_ns - at)) is not None}
        most = SELF_TEST_V
        drives = self.permits["brake"]
        for place, one in enumerate(drives):
            later = [o.due_ns for n, o in enumerate(drives) if (o.due_ns, n) > (one.due_ns, place) and o.due_ns < o.revoked_ns]
            ended_ns = min(one.end_ns, one.revoked_ns, *later)
            fades_ns = DISCHARGE_NS + self._late_ns
            if (one.mask, one.frequency_dhz) in waves:
                fades_ns += one.half_period_ns
            if one.mask >> channel & 1 and one.due_ns <= time_ns <= ended_ns + fades_ns:
                most = max(most, 1.05 * one.volts)
        return most

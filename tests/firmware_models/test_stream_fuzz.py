"""Streams of noise, of frames and of broken frames into every board: nothing goes on but what a valid frame commanded.

The oracle cuts and checks the stream by itself (COBS and CRC-16/X-25 written here from the protocol page). It knows what was
written, not what the board made of it: an output may go on only at the tick that some valid frame names, once, on a channel and
with a sign that it names; whether a frame had to be obeyed is not its business. Whether anything went on at all is checked, lest
nothing be tested.
"""

from __future__ import annotations

import ctypes.util
import shutil
import struct
from random import Random
from typing import Any

import pytest
import serial

MS = 1_000_000
TICKS_PER_MS = 2000
LONGEST_PULSE_NS = 10 * MS + 500  # by a crystal that is 50 ppm slow
MOST_COILS = 3  # 12 A, 3.907 A each
SELF_TEST_V = 42.4
SELF_TEST_NS = 30 * MS  # five outputs, each shorted for 1 ms and charged twice; and what the arm took on the line
DISCHARGE_NS = 5 * MS
HIGHEST_V = 1500.0
LENGTHS = {0x01: 0, 0x02: 4, 0x03: 10, 0x04: 4, 0x05: 0, 0x06: 0, 0x07: 0, 0x10: 23, 0x11: 2, 0x20: 11, 0x21: 7}
IDENTIFY, SYNC, CONFIGURE, ARM, DISARM, STOP, KEEPALIVE, PULSE, CANCEL, DRIVE, PIEZO = LENGTHS
TOOLS = {"py": (), "c": ("cc", "make"), "avr": ("cc", "make", "avr-gcc")}
PUNCTUAL_NS = {"py": 500, "c": 500, "avr": 50_000}  # a frame may come in within the very tick that it names


def missing(core: str) -> list[str]:
    tools = [tool for tool in TOOLS[core] if shutil.which(tool) is None]
    return tools + ["libsimavr"] * (core == "avr" and ctypes.util.find_library("simavr") is None)


def on(*cores: str) -> Any:
    marks = {
        core: pytest.mark.skipif(bool(missing(core)), reason=f"no core {core} here: {missing(core)} not found") for core in cores
    }
    return pytest.mark.parametrize("core", [pytest.param(core, marks=mark) for core, mark in marks.items()])


# The wire, once more.


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


def test_this_coder_is_the_pages():
    assert crc(b"123456789") == 0x906E
    assert frame(STOP, 4) == bytes.fromhex("05 06 04 b3 1d 00".replace(" ", ""))
    assert unstuff(frame(SYNC, 0, struct.pack("<I", 7))[:-1])[:6] == bytes((2, 0, 7, 0, 0, 0))


class Commands:
    """What valid frames in the stream ask of outputs."""

    def __init__(self, port: Any, boot_id: int):
        self._port, self._boot_id = port, boot_id
        self._rest = bytearray()
        self.valid = 0
        self.armed_ns = -1
        self.pulses: dict[int, list[list[Any]]] = {channel: [] for channel in range(15)}  # [due_ns, sign, durations, plays]
        self.drives: list[tuple[int, int, int]] = []  # due_ns, end_ns, mask
        self.bursts: list[tuple[int, int, int]] = []

    def testing(self, time_ns: int) -> bool:
        """Whether a self test may go on."""
        return self.armed_ns >= 0 and time_ns - self.armed_ns <= SELF_TEST_NS

    def highest_v(self, now_ns: int) -> float:
        """The most volts that there may be on an output: those of drives only where one is in force or just was."""
        driving = any(due_ns <= now_ns <= end_ns + DISCHARGE_NS for due_ns, end_ns, _ in self.drives)
        return HIGHEST_V * 1.05 if driving else SELF_TEST_V

    def read(self, data: bytes) -> None:
        *pieces, rest = (bytes(self._rest) + data).split(b"\x00")
        self._rest = bytearray(rest)
        for piece in pieces:
            body = unstuff(piece) if 5 <= len(piece) <= 69 else None
            if body is None or len(body) < 4 or crc(body[:-2]) != struct.unpack("<H", body[-2:])[0]:
                continue
            if LENGTHS.get(body[0]) == len(body) - 4:
                self._take(body[0], body[2:-2])

    def _take(self, kind: int, payload: bytes) -> None:
        self.valid += 1
        now_ns = self._port.now_ns
        if kind == ARM and struct.unpack("<I", payload)[0] == self._boot_id:
            self.armed_ns = now_ns
        elif kind == PULSE:
            tick, channels, toward = struct.unpack("<IHH", payload[:8])
            due_ns = self._port.tick_ns(tick)
            for channel in range(15):
                if channels >> channel & 1:
                    kept = [entry for entry in self.pulses[channel] if entry[0] > now_ns - 50 * MS]
                    self.pulses[channel] = [*kept, [due_ns, 1 if toward >> channel & 1 else -1, payload[8 + channel], 0]]
        elif kind == DRIVE:
            tick, mask, _, _, ttl = struct.unpack("<IBHHH", payload)
            due_ns = self._port.tick_ns(tick)
            self.drives = [one for one in self.drives if one[1] > now_ns - 50 * MS] + [(due_ns, due_ns + ttl * MS, mask)]
        elif kind == PIEZO:
            tick, mask, duration = struct.unpack("<IBH", payload)
            due_ns = self._port.tick_ns(tick)
            self.bursts = [one for one in self.bursts if one[1] > now_ns - 50 * MS] + [(due_ns, due_ns + duration * MS, mask)]


class Oracle:
    """Holds each edge against the commands."""

    def __init__(self, commands: Commands, punctual_ns: int):
        self._commands, self._punctual_ns = commands, punctual_ns
        self.on: dict[tuple[str, int], int] = {}
        self.starts = {"coil": 0, "brake": 0, "piezo": 0}
        self.wrong: list[str] = []

    def switched(self, time_ns: int, kind: str, channel: int, drive: int) -> None:
        since_ns = self.on.pop((kind, channel), None)
        if kind == "coil" and since_ns is not None and time_ns - since_ns > LONGEST_PULSE_NS + self._punctual_ns:
            self.wrong.append(f"coil {channel} was on for {(time_ns - since_ns) / MS} ms")
        if not drive:
            return
        self.on[kind, channel] = time_ns
        self.starts[kind] += 1
        if not getattr(self, f"_{kind}")(time_ns, channel, drive):
            self.wrong.append(f"{kind} {channel} went on at {time_ns / MS} ms, and no valid frame says so")
        coils = sum(what == "coil" for what, _ in self.on)
        if coils > MOST_COILS:
            self.wrong.append(f"{coils} coils on at {time_ns / MS} ms")

    def _coil(self, time_ns: int, channel: int, drive: int) -> bool:
        for entry in self._commands.pulses[channel]:
            if 0 <= time_ns - entry[0] <= self._punctual_ns and entry[1] == drive and not entry[3]:
                entry[3] += 1
                return self._commands.armed_ns >= 0
        return False

    def _brake(self, time_ns: int, channel: int, _: int) -> bool:
        """By a drive of this output that is in force; or in the self test that a valid arm begins."""
        return self._commands.testing(time_ns) or _in_force(self._commands.drives, time_ns, channel)

    def _piezo(self, time_ns: int, channel: int, _: int) -> bool:
        return _in_force(self._commands.bursts, time_ns, channel)


def _in_force(spans: list[tuple[int, int, int]], time_ns: int, channel: int) -> bool:
    return any(due_ns <= time_ns <= end_ns and mask >> channel & 1 for due_ns, end_ns, mask in spans)


class Streams:
    """Bytes of all kinds, seeded."""

    def __init__(self, board: str, boot_id: int, random: Random):
        self._board, self._boot_id, self._random = board, boot_id, random
        self._seq = 0

    def next(self, tick: int) -> bytes:
        """A few bytes; ``tick``: what the board's clock shows."""
        random = self._random
        kind = random.random()
        if kind < 0.12:
            return random.randbytes(random.randint(1, 40))
        if kind < 0.18:
            return bytes(random.choice((0, 1, 2, 0xFF)) for _ in range(random.randint(1, 90)))
        data = b"".join(self._frame(tick) for _ in range(random.randint(1, 4)))
        return self._broken(data) if kind < 0.5 else data

    def _frame(self, tick: int) -> bytes:
        random = self._random
        self._seq = self._seq % 255 + 1
        seq = self._seq if random.random() < 0.9 else random.randrange(256)
        kind = random.random()
        if kind < 0.55:
            return frame(*self._timed(tick, seq))
        if kind < 0.70:
            arm = frame(ARM, seq, struct.pack("<I", self._boot_id if random.random() < 0.9 else random.getrandbits(32)))
            self._seq = self._seq % 255 + 1
            return frame(DISARM, self._seq) + arm if random.random() < 0.4 else arm
        if kind < 0.72:
            return frame(STOP, seq)
        chosen = random.choice((IDENTIFY, SYNC, KEEPALIVE, KEEPALIVE, CANCEL, PULSE, DRIVE, PIEZO, random.randrange(256)))
        length = LENGTHS.get(chosen, random.randrange(60)) if random.random() < 0.8 else random.randrange(60)
        return frame(chosen, seq, random.randbytes(length))

    def _timed(self, tick: int, seq: int) -> tuple[int, int, bytes]:
        random = self._random
        at = (tick + random.randint(-2, 60) * TICKS_PER_MS + random.randrange(TICKS_PER_MS)) % 2**32
        if self._board == "tactiles":
            channels = sum(1 << random.randrange(15) for _ in range(random.randint(1, 2))) & 0x7FFF
            durations = bytes(random.randint(0, 255) if random.random() < 0.1 else random.randint(1, 200) for _ in range(15))
            return PULSE, seq, struct.pack("<IHH", at, channels, random.getrandbits(15)) + durations
        if random.random() < 0.5:
            return PIEZO, seq, struct.pack("<IBH", at, random.randrange(64), random.randint(0, 40))
        volts = random.randrange(65_536) if random.random() < 0.1 else random.randint(0, 1500)
        return DRIVE, seq, struct.pack("<IBHHH", at, random.randrange(40), volts, random.randint(0, 600), random.randint(0, 60))

    def _broken(self, data: bytes) -> bytes:
        random, broken = self._random, bytearray(data)
        for _ in range(random.randint(1, 3)):
            at = random.randrange(len(broken))
            how = random.randrange(5)
            if how == 0:
                broken[at] ^= 1 << random.randrange(8)
            elif how == 1 and len(broken) > 1:
                del broken[at]
            elif how == 2:
                broken.insert(at, random.randrange(256))
            elif how == 3 and at:
                del broken[at:]
            else:
                broken[at : at + 20] = broken[at : at + 20] * 2
        return bytes(broken)


def play(core: str, board: str, amount: int, seed: int) -> Oracle:
    """``amount`` bytes into a board; then a new host, which must find it well."""
    if "firmware_models" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("firmware_models")
    port: Any = serial.serial_for_url(f"sim://{board}?core={core}&clock=virtual&seed={seed}", baudrate=500_000, timeout=0)
    try:
        port.advance(100 * MS)  # a chip has booted by then
        boot_id = port.board.boot_id
        commands = Commands(port, boot_id)
        oracle = Oracle(commands, PUNCTUAL_NS[core])
        port.watch(oracle.switched)
        random = Random(f"{seed} {board}")
        streams, written = Streams(board, boot_id, random), 0
        while written < amount:
            data = streams.next(port.board.ticks.u32(port.now_ns))
            commands.read(data)
            port.write(data)
            written += len(data)
            pause_ns = random.choice((0, 0, 0, 1, 3, 8, 150 if random.random() < 0.02 else 0)) * MS
            port.advance(port.now_ns + len(data) * 20_000 + pause_ns)
            port.read(65_536)
            if board == "brake":
                assert max(map(abs, port.truth()["volts"])) <= commands.highest_v(port.now_ns)
            assert oracle.wrong == []
        assert commands.valid > written // 200
        port.advance(port.now_ns + 110 * MS)
        assert port.energised() == []
        port.read(65_536)
        assert port.board.boot_id == boot_id  # it never crashed
        _recovers(port, board, boot_id, commands, oracle)
        assert oracle.wrong == []
    finally:
        port.close()
    return oracle


def _recovers(port: Any, board: str, boot_id: int, commands: Commands, oracle: Oracle) -> None:
    def say(*frames: bytes) -> None:
        for data in frames:
            commands.read(data)
            port.write(data)
            port.advance(port.now_ns + 5 * MS)

    say(b"\x00" + frame(IDENTIFY, 0), frame(DISARM, 1), frame(ARM, 2, struct.pack("<I", boot_id)))
    for _ in range(3):
        say(frame(KEEPALIVE, 0))
    before = dict(oracle.starts)
    tick = (port.board.ticks.u32(port.now_ns) + 8 * TICKS_PER_MS) % 2**32
    if board == "tactiles":
        say(frame(PULSE, 3, struct.pack("<IHH", tick, 1 << 4, 0) + bytes([100] * 15)))
    else:
        say(frame(DRIVE, 3, struct.pack("<IBHHH", tick, 1, 300, 200, 8)))
    say(frame(KEEPALIVE, 0), frame(KEEPALIVE, 0))
    kind = "coil" if board == "tactiles" else "brake"
    assert oracle.starts[kind] == before[kind] + 1


def check(core: str, board: str, amount: int, seed: int = 1) -> None:
    starts = play(core, board, amount, seed).starts
    if board == "tactiles":
        assert starts["coil"] > amount / 1000
    else:
        assert starts["brake"] > amount / 2000
        assert starts["piezo"] > amount / 2000


@on("py", "c", "avr")
@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_nothing_goes_on_but_by_a_valid_frame(core, board):
    check(core, board, 20_000 if core == "avr" else 100_000)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@on("py", "c")
@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_nothing_goes_on_in_ten_million_bytes_either(core, board):
    check(core, board, 10_000_000, seed=2)

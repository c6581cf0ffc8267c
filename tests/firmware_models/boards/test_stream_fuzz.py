"""Streams of noise, of frames and of broken frames into every board, and a lid that opens: nothing is on but what holds.

The oracle (``stream_oracle.py``) knows what was written, what the board answered and what has ended since; what an output does
beyond that is wrong. Whether anything went on at all is checked, lest nothing be tested; and that the oracle sees it is shown
on Python boards that are broken on purpose.
"""

from __future__ import annotations

import struct
from random import Random
from typing import Any

import pytest
import serial
from cores import on_cores
from stream_oracle import (
    ARM,
    BYTE_NS,
    CANCEL,
    DISARM,
    DRIVE,
    IDENTIFY,
    KEEPALIVE,
    LENGTHS,
    MS,
    PIEZO,
    PULSE,
    STOP,
    SYNC,
    TICKS_PER_MS,
    Oracle,
    crc,
    frame,
    unstuff,
)

from firmware_models.boards.board import FirmwareModel
from firmware_models.boards.brake_board import BrakeBoard
from firmware_models.boards.tactiles_board import TactilesBoard
from haptics.link.messages import Fault, State

PUNCTUAL_NS = {"py": 500, "c": 500, "avr": 50_000}  # a frame may come in within the very tick that it names
LATE_NS = {"py": 1000, "c": 1000, "avr": 200_000}  # of what goes off: on the chip up to 102 us, and a main loop that is busy


def test_this_coder_is_the_pages():
    assert crc(b"123456789") == 0x906E
    assert frame(STOP, 4) == bytes.fromhex("05 06 04 b3 1d 00".replace(" ", ""))
    assert unstuff(frame(SYNC, 0, struct.pack("<I", 7))[:-1])[:6] == bytes((2, 0, 7, 0, 0, 0))


class Streams:
    """Bytes of all kinds, seeded."""

    def __init__(self, board: str, boot_id: int, random: Random):
        self._board, self._boot_id, self._random = board, boot_id, random
        self._seq = 0
        self._wave = (1, 100)

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
        if kind < 0.74:
            return frame(*self._timed(tick, seq))
        if kind < 0.82:
            arm = frame(ARM, seq, struct.pack("<I", self._boot_id if random.random() < 0.9 else random.getrandbits(32)))
            self._seq = self._seq % 255 + 1
            return frame(DISARM, self._seq) + arm if random.random() < 0.3 else arm
        if kind < 0.83:
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
        volts = random.randrange(65_536) if random.random() < 0.1 else random.randint(0, random.choice((300, 900, 1500)))
        if random.random() < 0.2:  # else it goes on with the wave of the one before
            self._wave = random.randrange(34), random.randint(0, 250)
        ttl_ms = random.randint(0, 60 if random.random() < 0.6 else 500)
        return DRIVE, seq, struct.pack("<IBHHH", at, self._wave[0], volts, self._wave[1], ttl_ms)

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


def play(core: str, board: str, amount: int, seed: int, query: str = "") -> Oracle:
    """``amount`` bytes into a board; then a new host, which must find it well."""
    if "firmware_models" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("firmware_models")
    port: Any = serial.serial_for_url(f"sim://{board}?core={core}&clock=virtual&seed={seed}{query}", baudrate=500_000, timeout=0)
    try:
        port.advance(100 * MS)  # a chip has booted by then
        boot_id = port.board.boot_id
        oracle = Oracle(port, PUNCTUAL_NS[core], LATE_NS[core], may_lose=core == "avr")
        random = Random(f"{seed} {board}")
        streams, written = Streams(board, boot_id, random), 0
        while written < amount:
            data = streams.next(port.board.ticks.u32(port.now_ns))
            oracle.write(data)
            written += len(data)
            pause_ns = random.choice((0, 0, 0, 1, 3, 8, 150 if random.random() < 0.02 else 0)) * MS
            port.advance(port.now_ns + len(data) * BYTE_NS + pause_ns)
            oracle.settle()
            assert oracle.wrong == []
            if board == "brake" and random.random() < (0.05 if oracle.lid_open else 0.01):
                oracle.move_lid()
        assert oracle.valid > written // 200
        port.advance(port.now_ns + 110 * MS)
        assert port.energised() == []
        oracle.settle()
        if oracle.lid_open:
            oracle.move_lid()
        assert port.board.boot_id == boot_id  # it never crashed
        _recovers(port, board, boot_id, oracle)
        assert oracle.wrong == []
    finally:
        port.close()
    return oracle


def _recovers(port: Any, board: str, boot_id: int, oracle: Oracle) -> None:
    def send(*frames: bytes) -> None:
        for data in frames:
            oracle.write(data)
            port.advance(port.now_ns + 5 * MS)
            oracle.settle()

    send(b"\x00" + frame(IDENTIFY, 0), frame(DISARM, 1), frame(ARM, 2, struct.pack("<I", boot_id)))
    for _ in range(3):
        send(frame(KEEPALIVE, 0))
    before = dict(oracle.starts)
    tick = (port.board.ticks.u32(port.now_ns) + 8 * TICKS_PER_MS) % 2**32
    if board == "tactiles":
        send(frame(PULSE, 3, struct.pack("<IHH", tick, 1 << 4, 0) + bytes([100] * 15)))
    else:
        send(frame(DRIVE, 3, struct.pack("<IBHHH", tick, 1, 300, 200, 8)))
    send(frame(KEEPALIVE, 0), frame(KEEPALIVE, 0))
    kind = "coil" if board == "tactiles" else "brake"
    assert oracle.starts[kind] == before[kind] + 1


def check(core: str, board: str, amount: int, seed: int = 1) -> None:
    starts = play(core, board, amount, seed).starts
    if board == "tactiles":
        assert starts["coil"] > amount / 1000
    else:
        assert starts["brake"] > amount / 2000
        assert starts["piezo"] > amount / 2000


@on_cores("py", "c", "avr")
@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_nothing_goes_on_but_by_a_valid_frame(core, board):
    check(core, board, 15_000 if core == "avr" else 60_000)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@on_cores("py", "c")
@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_nothing_goes_on_in_ten_million_bytes_either(core, board):
    check(core, board, 10_000_000, seed=2)


# That the oracle sees what is broken.


def stop_changes_the_state_only(patch: pytest.MonkeyPatch) -> None:
    def idle(self: Any, message: Any) -> int:
        self.state = State.DISARMED
        return 0

    patch.setattr(FirmwareModel, "_stop", idle)


def drives_wait_on(patch: pytest.MonkeyPatch) -> None:
    off = BrakeBoard._outputs_off

    def forgetful(self: Any) -> None:
        waiting = list(self._queue)
        off(self)
        self._queue = waiting

    patch.setattr(BrakeBoard, "_outputs_off", forgetful)


def bursts_go_on(patch: pytest.MonkeyPatch) -> None:
    off = BrakeBoard._outputs_off

    def forgetful(self: Any) -> None:
        bursts = list(self._bursts)
        off(self)
        self._bursts = bursts

    patch.setattr(BrakeBoard, "_outputs_off", forgetful)


def a_replaced_drive_comes_back(patch: pytest.MonkeyPatch) -> None:
    """Its volts last as long as the longer of the two."""
    begin = BrakeBoard._begin

    def longer(self: Any, drive: Any) -> None:
        end_ns = drive.end_ns if self._drive is None else max(self._drive.end_ns, drive.end_ns)
        begin(self, drive._replace(end_ns=end_ns))

    patch.setattr(BrakeBoard, "_begin", longer)


def volts_outlast_their_time(patch: pytest.MonkeyPatch) -> None:
    take = BrakeBoard._take_drive
    patch.setattr(BrakeBoard, "_take_drive", lambda self, message: take(self, message._replace(ttl=message.ttl + 5)))


def an_open_lid_changes_nothing(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(BrakeBoard, "_act", lambda self, channel, load: self.plant.load(channel, self.now_ns, **load))


def takes_any_amplitude(patch: pytest.MonkeyPatch) -> None:
    check = BrakeBoard._check_drive

    def lenient(self: Any, message: Any) -> None:
        check(self, message._replace(amplitude=min(message.amplitude, 100)))

    patch.setattr(BrakeBoard, "_check_drive", lenient)


def makes_a_tenth_more_volts(patch: pytest.MonkeyPatch) -> None:
    begin = BrakeBoard._begin
    patch.setattr(BrakeBoard, "_begin", lambda self, drive: begin(self, drive._replace(volts=round(1.1 * drive.volts))))
    patch.setattr("firmware_models.boards.brake_guards.OVER_VOLTAGE", 2.0)


def takes_commands_while_disarmed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(FirmwareModel, "_require_armed", lambda self: None)


def no_dead_man(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(FirmwareModel, "_dead_man_ns", lambda self: 1 << 62)


def faults_change_nothing(patch: pytest.MonkeyPatch) -> None:
    """A latched fault is reported, and the drive goes on."""
    off = BrakeBoard._outputs_off

    def latch(self: Any, fault: Fault, channel: int, value: int) -> None:
        patch.setattr(BrakeBoard, "_outputs_off", lambda self: None)
        reported(self, fault, channel, value)
        patch.setattr(BrakeBoard, "_outputs_off", off)

    reported = FirmwareModel.latch
    patch.setattr(FirmwareModel, "latch", latch)


def pulses_wait_on(patch: pytest.MonkeyPatch) -> None:
    off = TactilesBoard._outputs_off

    def forgetful(self: Any) -> None:
        waiting = list(self._queue)
        off(self)
        self._queue = waiting

    patch.setattr(TactilesBoard, "_outputs_off", forgetful)


def cancel_forgets_nothing(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(TactilesBoard, "_cancel", lambda self, message: 0)


def pulses_are_half_as_long_again(patch: pytest.MonkeyPatch) -> None:
    pulse = TactilesBoard._pulse

    def longer(self: Any, message: Any) -> int:
        return pulse(self, message._replace(duration=tuple(min(3 * units // 2, 255) for units in message.duration)))

    patch.setattr(TactilesBoard, "_pulse", longer)


@pytest.mark.parametrize(
    ("board", "breakage"),
    [
        ("brake", stop_changes_the_state_only),
        ("brake", drives_wait_on),
        ("brake", bursts_go_on),
        ("brake", a_replaced_drive_comes_back),
        ("brake", volts_outlast_their_time),
        ("brake", an_open_lid_changes_nothing),
        ("brake", takes_any_amplitude),
        ("brake", makes_a_tenth_more_volts),
        ("brake", takes_commands_while_disarmed),
        ("brake", no_dead_man),
        ("brake", faults_change_nothing),
        ("tactiles", stop_changes_the_state_only),
        ("tactiles", pulses_wait_on),
        ("tactiles", cancel_forgets_nothing),
        ("tactiles", pulses_are_half_as_long_again),
        ("tactiles", takes_commands_while_disarmed),
        ("tactiles", no_dead_man),
    ],
)
def test_a_board_that_is_broken_is_found_out(monkeypatch, board, breakage):
    breakage(monkeypatch)
    with pytest.raises(AssertionError):
        play("py", board, 60_000, seed=1)

"""The C core on the host, in ticks: frames in, frames and edges out, senses as a test likes them. Its coder is its own."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from firmware_models.cores.toolchain import host_library
from haptics.link.messages import BY_NAME, BY_TYPE, Board, decode, encode

FIRMWARE = Path(__file__).parents[2] / "firmware_models" / "firmware"
WRAP = 1 << 32
MS = 2000
BYTE_TICKS = 40  # ten bits at 500 kbaud
FEED = 1 << 15
BOOT_ID = 0xC0FFEE01
BUILT = {Board.TACTILES: (200, 12_000, 64, 3000, 2500), Board.BRAKE: (1500, 500, 10_000, 2000, 45_000)}
SUPPLY, CURRENT = 0, 1  # senses of the coil board


class Settings(ctypes.Structure):
    _fields_ = (("limits", ctypes.c_uint16 * 5), ("nominal_pf", ctypes.c_uint16))


class CoilHeat(ctypes.Structure):
    _fields_ = (("on_time", ctypes.c_uint32), ("check", ctypes.c_uint16))


class Memory(ctypes.Structure):
    """What outlives a boot."""

    _fields_ = (("heat", CoilHeat * 15), ("notes", ctypes.c_uint8))


_TRANSMIT = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint32)
_BUSY = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_void_p)
_OUTPUTS = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32)
_CONVERT = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_void_p, ctypes.c_uint32)


class Calls(ctypes.Structure):
    _fields_ = (
        ("transmit", _TRANSMIT),
        ("uplink_busy", _BUSY),
        ("outputs", _OUTPUTS),
        ("convert", _CONVERT),
        ("interlock_closed", _BUSY),
    )


class Sent(NamedTuple):
    """A frame of the board: when its first byte began to leave, and what it holds."""

    tick: int
    name: str
    seq: int
    message: Any


def build_library() -> ctypes.CDLL:
    """The library as the firmware's own Makefile makes it, from the cache of builds if it is there."""
    for tool in ("cc", "make"):
        if shutil.which(tool) is None:
            pytest.skip(f"no C core: {tool} is not installed")
    return load_library(host_library())


def load_library(path: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    u32, pointer = ctypes.c_uint32, ctypes.c_void_p
    library.host_new.argtypes = (
        *(u32, ctypes.POINTER(Settings), u32, u32, u32),
        *(ctypes.POINTER(Memory), ctypes.POINTER(Calls), pointer),
    )
    library.host_new.restype = pointer
    library.host_free.argtypes = (pointer,)
    library.host_free.restype = None
    library.host_receive.argtypes = (pointer, ctypes.c_char_p, u32, u32)
    library.host_receive.restype = None
    library.host_run.argtypes = (pointer, u32)
    library.host_run.restype = None
    library.host_next.argtypes = (pointer, u32)
    for name in ("host_next", "host_state", "host_faults"):
        getattr(library, name).restype = u32
    library.host_state.argtypes = library.host_faults.argtypes = (pointer,)
    return library


def crc16_x25(data: bytes) -> int:
    """Bit by bit, as the protocol page has it."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc ^ 0xFFFF


def stuffed(body: bytes) -> bytes:
    """Consistent overhead byte stuffing of fewer than 254 bytes: each piece between zeros behind its length + 1."""
    return b"".join(bytes([len(piece) + 1]) + piece for piece in body.split(b"\0"))


def unstuffed(raw: bytes) -> bytes:
    pieces = []
    while raw:
        pieces.append(raw[1 : raw[0]])
        raw = raw[raw[0] :]
    return b"\0".join(pieces)


def frame(type_: int, seq: int, payload: bytes = b"") -> bytes:
    body = bytes((type_, seq)) + payload
    return stuffed(body + crc16_x25(body).to_bytes(2, "little")) + b"\0"


class Bench:
    """One board. ``now`` counts ticks without wrapping; the board sees its lower 32 bits."""

    def __init__(
        self,
        library: ctypes.CDLL,
        board: Board = Board.TACTILES,
        start: int = 1_000_000,
        limits: tuple[int, ...] | None = None,
        brown_out: bool = False,
        byte_ticks: int = BYTE_TICKS,
        nominal_pf: int = 2547,
        memory: Memory | None = None,
    ):
        self.memory = memory or Memory()
        self.board = board
        self.now = start
        self.word = 0
        self.edges: list[tuple[int, int]] = []
        self.sent: list[Sent] = []
        self.byte_ticks = byte_ticks
        self.lid_closed = True
        self.senses: Callable[[int], int] = lambda channel: {SUPPLY: 500, CURRENT: 0}.get(channel, 0)
        self._library = library
        self._free_at = start
        self._seq = 0
        self._calls = Calls(
            _TRANSMIT(lambda _, data, count: self._transmit(bytes(data[:count]))),
            _BUSY(lambda _: max(0, self._free_at - self.now)),
            _OUTPUTS(lambda _, word: self._outputs(word)),
            _CONVERT(lambda _, channel: self.senses(channel)),
            _BUSY(lambda _: self.lid_closed),
        )
        settings = Settings((ctypes.c_uint16 * 5)(*(limits or BUILT[board])), nominal_pf)
        kept, calls = ctypes.byref(self.memory), ctypes.byref(self._calls)
        self._host = library.host_new(board, ctypes.byref(settings), BOOT_ID, brown_out, start % WRAP, kept, calls, None)

    def close(self) -> None:
        self._library.host_free(self._host)

    def _transmit(self, data: bytes) -> None:
        begins = max(self.now, self._free_at)
        self._free_at = begins + self.byte_ticks * len(data)
        assert data.endswith(b"\0")
        assert data.count(b"\0") == 1
        body = unstuffed(data[:-1])
        assert crc16_x25(body[:-2]) == int.from_bytes(body[-2:], "little")
        name = BY_TYPE[body[0]].name
        self.sent.append(Sent(begins, name, body[1], decode(name, body[2:-2])))

    def _outputs(self, word: int) -> None:
        assert word != self.word
        self.word = word
        self.edges.append((self.now, word))

    @property
    def state(self) -> int:
        return self._library.host_state(self._host)

    @property
    def faults(self) -> int:
        return self._library.host_faults(self._host)

    @property
    def next(self) -> int:
        """Ticks until the board wants to be run."""
        return self._library.host_next(self._host, self.now % WRAP)

    def run(self, ticks: int) -> None:
        """From one event to the next, as whoever needs the edges' times does."""
        end = self.now + ticks
        while self.now < end:
            self.now = min(self.now + self.next, end)
            self._library.host_run(self._host, self.now % WRAP)

    def jump(self, ticks: int) -> None:
        """All at once."""
        self.now += ticks
        self._library.host_run(self._host, self.now % WRAP)

    def live(self, ticks: int) -> None:
        """Run, with a keepalive each 30 ms."""
        end = self.now + ticks
        while self.now < end:
            self.send("keepalive", seq=0)
            self.run(min(30 * MS, end - self.now))

    def feed(self, data: bytes) -> None:
        self._library.host_receive(self._host, data, len(data), self.now % WRAP)

    def next_seq(self) -> int:
        self._seq = self._seq % 255 + 1
        return self._seq

    def send(self, name: str, *values: Any, seq: int | None = None) -> int:
        seq = self.next_seq() if seq is None else seq
        self.feed(frame(BY_NAME[name].type, seq, encode(name, *values)))
        return seq

    def ask(self, name: str, *values: Any, seq: int | None = None) -> Any:
        """Send, and the message that answers at once."""
        before = len(self.sent)
        seq = self.send(name, *values, seq=seq)
        answers = [s for s in self.sent[before:] if s.seq == seq and s.name in ("identity", "sync_reply", "reply")]
        assert len(answers) == 1
        return answers[0].message

    def answer(self, name: str, *values: Any, seq: int | None = None) -> tuple[int, int]:
        """Status and detail of the reply."""
        reply = self.ask(name, *values, seq=seq)
        assert reply.time == self.now % WRAP
        return reply.status, reply.detail

    def arm(self) -> None:
        assert self.answer("arm", BOOT_ID) == (0, 0)

    def all(self, name: str) -> list[Sent]:
        return [s for s in self.sent if s.name == name]

    def telemetry(self) -> Any:
        """The next one."""
        name = f"{self.board.name.lower()}_telemetry"
        before = len(self.all(name))
        for _ in range(100):
            self.run(self.next)
            if len(self.all(name)) > before:
                return self.all(name)[-1].message
        raise AssertionError("no telemetry came")


def in_ticks(now: int, ms: float) -> int:
    """The board's tick ``ms`` from now."""
    return (now + round(ms * MS)) % WRAP

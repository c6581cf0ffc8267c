"""A C brake controller on a circuit: commands in, the output word and its circuit's volts out."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from brake_circuit import ENABLED, NEGATIVE, POSITIVE, Circuit
from core_bench import FIRMWARE, MS, WRAP, Bench, load_library

from haptics.link.messages import Board, Fault, State, Status

BRIDGE = POSITIVE | NEGATIVE
OK = (Status.OK, 0)
NOMINAL_PF = 2547


class BrakeBench(Bench):
    """A controller on a circuit."""

    lead_ms = 1.0  # of the drives that hold

    def __init__(self, library: ctypes.CDLL, circuit: Circuit | None = None, start: int = WRAP - 300 * MS, **kwargs):
        self.circuit = circuit or Circuit()
        self.circuit.now = start
        super().__init__(library, Board.BRAKE, start, **kwargs)
        self.senses = self._sense

    @property
    def clock(self) -> int:
        """What the core's clock shows, unwrapped."""
        return self.now

    def _sense(self, sense: int) -> int:
        self.circuit.advance(self.clock)
        return self.circuit.counts(sense)

    def _outputs(self, word: int) -> None:
        assert word != self.word
        self.word = word
        self.edges.append((self.clock, word))
        self.circuit.switch(word, self.clock)

    def change(self, **fields) -> None:
        """The circuit is another from now on."""
        self.circuit.advance(max(self.now, self.clock))
        for name, value in fields.items():
            setattr(self.circuit, name, value)

    def armed(self) -> BrakeBench:
        """Armed, the self test over; its edges forgotten."""
        self.arm()
        self.run_until(State.ARMED, 50)
        self.edges.clear()
        return self

    def run_until(self, state: State, ms: float) -> int:
        """Ticks until the board is in that state, kept alive."""
        begun = self.now
        while self.state != state:
            assert self.now - begun < ms * MS, f"state {self.state}, faults {self.faults:#x}"
            if (self.now - begun) % (20 * MS) < MS // 10:
                self.send("keepalive", seq=0)
            self.run(MS // 10)
        return self.now - begun

    def drive(self, ahead_ms: float, mask: int, volts: int, dhz: int, ttl_ms: int) -> int:
        """Accepted; the tick at which it begins."""
        start = self.now + round(ahead_ms * MS)
        assert self.answer("drive", start % WRAP, mask, volts, dhz, ttl_ms) == OK
        return start

    def hold(self, ms: float, mask: int, volts: int, dhz: int, each_ms: int = 50) -> None:
        """Renewed all the time."""
        end = self.now + round(ms * MS)
        while self.now < end:
            if self.state in (State.ARMED, State.DRIVING, State.DISCHARGING):
                self.drive(self.lead_ms, mask, volts, dhz, 2 * each_ms)
            self.run(min(each_ms * MS, end - self.now))

    def fault(self) -> tuple[Fault, int, int]:
        """The one fault that latched: which, channel, value."""
        (sent,) = self.all("fault")
        assert self.faults == 1 << sent.message.code
        assert self.state == State.FAULT
        assert self.word == 0
        return Fault(sent.message.code), sent.message.channel, sent.message.value


class SlowBench(BrakeBench):
    """The core on ``slow_host.c``: its clock may be ahead of ours."""

    lead_ms = 8.0

    @property
    def clock(self) -> int:
        host = getattr(self, "_host", None)
        if host is None:
            return self.now
        return self.now + (self._library.host_clock(host) - self.now + WRAP // 2) % WRAP - WRAP // 2

    def answer(self, name: str, *values, seq: int | None = None) -> tuple[int, int]:
        reply = self.ask(name, *values, seq=seq)
        return reply.status, reply.detail


def build_slow_library(folder: Path) -> ctypes.CDLL:
    """The core on ``slow_host.c``."""
    cc = shutil.which("cc")
    if cc is None:
        pytest.skip("no C core: cc is not installed")
    made = folder / "slow.so"
    core = FIRMWARE / "core"
    sources = [str(core / name) for name in ("board.c", "framing.c")] + [str(path) for path in sorted(core.glob("brake*.c"))]
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-I{core}", f"-I{FIRMWARE / 'host'}"]
    subprocess.run([cc, *flags, str(Path(__file__).with_name("slow_host.c")), *sources, "-o", str(made)], check=True)
    library = load_library(made)
    library.host_clock.argtypes = (ctypes.c_void_p,)
    library.host_clock.restype = ctypes.c_uint32
    return library


def max_dhz(pf: float, volts: int) -> int:
    """I / (2 C V)."""
    return min(10_000, math.floor(10 * 500e-6 / (2 * pf * 1e-12 * volts)))


def reversals(edges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Tick and new polarity of each half period, the first included."""
    return [(tick, word & BRIDGE) for tick, word in edges if word & BRIDGE and word & ENABLED]


def benches(library: ctypes.CDLL) -> Iterator[Callable[..., BrakeBench]]:
    """For a fixture: opens benches on the library, and closes them."""
    opened: list[BrakeBench] = []

    def open_bench(*args, **kwargs) -> BrakeBench:
        opened.append(BrakeBench(library, *args, **kwargs))
        return opened[-1]

    yield open_bench
    for one in opened:
        one.close()

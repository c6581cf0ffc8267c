"""The coil board's queue while its edge interrupt comes at the worst moments: nothing is lost, doubled, late or left on."""

from __future__ import annotations

import ctypes
import random
import shutil
import subprocess
from pathlib import Path

import pytest
from core_bench import FEED, FIRMWARE, MS, WRAP, frame, unstuffed

from haptics.link.messages import BY_NAME, Status, decode, encode

ALL = 0x7FFF
PORT = Path(__file__).parents[2] / "support" / "interrupting_port.c"


@pytest.fixture(scope="module")
def racing(tmp_path_factory) -> ctypes.CDLL:
    cc = shutil.which("cc")
    if cc is None:
        pytest.skip("no C core: cc is not installed")
    made = tmp_path_factory.mktemp("racing") / "racing.so"
    core = FIRMWARE / "core"
    sources = [str(core / name) for name in ("board.c", "framing.c", "tactiles.c", "coil_heat.c")]
    command = [cc, "-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-I{core}", str(PORT), *sources]
    subprocess.run([*command, "-o", str(made)], check=True)
    library = ctypes.CDLL(str(made))
    library.racing_ask.restype = ctypes.POINTER(ctypes.c_uint8)
    for name in ("racing_now", "racing_edges", "racing_begun", "racing_queued"):
        getattr(library, name).restype = ctypes.c_uint32
    return library


class Racing:
    def __init__(self, library: ctypes.CDLL, seed: int, step: int):
        self._library = library
        self._seq = 0
        library.racing_start(seed, step)
        assert self.ask("arm", 1).status == Status.OK

    @property
    def now(self) -> int:
        return self._library.racing_now()

    def ask(self, name: str, *values):
        self._seq = self._seq % 255 + 1
        data = frame(BY_NAME[name].type, self._seq, encode(name, *values))
        answer = bytes(self._library.racing_ask(data, len(data))[:13])
        body = unstuffed(answer[:-1])
        assert body[1] == self._seq
        return decode("reply", body[2:-2])

    def run(self, ticks: int) -> None:
        self._library.racing_run((self.now + ticks) % WRAP)

    def edges(self) -> list[tuple[int, int]]:
        due, word = ctypes.POINTER(ctypes.c_uint32)(), ctypes.POINTER(ctypes.c_uint32)()
        count = self._library.racing_edges(ctypes.byref(due), ctypes.byref(word))
        return [(due[k], word[k]) for k in range(count)]

    @property
    def begun(self) -> int:
        return self._library.racing_begun()

    @property
    def queued(self) -> int:
        return self._library.racing_queued()


def moved(tick: int) -> int:
    """Ticks of a run that crosses the wrap, in order."""
    return (tick + WRAP // 2) % WRAP


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("step", [5, 60, 400])
def test_every_accepted_pulse_is_played_once_at_its_ticks(racing, seed, step) -> None:
    rng = random.Random(seed)
    h = Racing(racing, seed, step)
    accepted: list[tuple[int, int, int]] = []  # channel, start, end
    answers: dict[int, int] = {}
    for _ in range(1500):
        start = moved(h.now) + rng.randrange(rng.choice((200, 2000, 20_000)))
        channels = 1 << rng.randrange(15) | rng.choice((0, 1 << rng.randrange(15)))
        durations = [rng.randrange(1, rng.choice((3, 30, 201))) for _ in range(15)]
        reply = h.ask("pulse", moved(start), channels, 0, durations)
        answers[reply.status] = answers.get(reply.status, 0) + 1
        new = [(k, start, start + 100 * durations[k]) for k in range(15) if channels >> k & 1]
        taken = sum({1 << a[0] for a in new for b in accepted if a[0] == b[0] and a[1] < b[2] and b[1] < a[2]})
        if reply.status == Status.OK:
            assert not taken
            accepted += new
        elif reply.status == Status.FULL and 0 < reply.detail < 0x8000:
            assert reply.detail == taken
        h.run(rng.randrange(1, rng.choice((10, 1000, 10_000))))
    for _ in range(4):
        h.run(20 * MS)
        h.ask("cancel", 0)
    expected, word = [], FEED
    for tick in sorted({start for _, start, _ in accepted} | {end for *_, end in accepted}):
        on = FEED | sum(1 << k for k, start, end in accepted if start <= tick < end)
        if on != word:
            expected.append((tick, on))
        word = on
    edges = h.edges()
    assert all(bin(word & ALL).count("1") <= 3 for _, word in edges)
    played, word = [], FEED
    for due, on in edges:  # an edge that changes nothing is one pulse behind another
        if on != word:
            played.append((moved(due), on))
        word = on
    assert played == expected
    assert (h.begun, h.queued) == (len(accepted), 0)
    assert answers[Status.OK] > 100
    assert answers[Status.FULL] > 100
    if step > 5:
        assert answers[Status.LATE] > 10


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("step", [5, 60, 400])
def test_cancelling_while_pulses_begin_neither_loses_nor_leaves_any(racing, seed, step) -> None:
    rng = random.Random(seed)
    h = Racing(racing, seed, step)
    accepted = forgotten = 0
    for _ in range(1000):
        channel = rng.randrange(15)
        reply = h.ask("pulse", (h.now + rng.randrange(300, 4000)) % WRAP, 1 << channel, 0, [rng.randrange(1, 6)] * 15)
        accepted += reply.status == Status.OK
        if rng.random() < 0.5:
            forgotten += h.ask("cancel", rng.randrange(1 << 15)).detail
        h.run(rng.randrange(1, 300))
    h.run(20 * MS)
    assert h.begun == accepted - forgotten
    assert h.begun > 50
    assert forgotten > 100
    assert h.queued == 0
    edges = h.edges()
    assert edges[-1][1] == FEED
    assert all(bin(word & ALL).count("1") <= 3 for _, word in edges)


@pytest.mark.parametrize(("silent_ms", "status"), [(98, Status.OK), (101, Status.INTERLOCK)])
def test_a_frame_that_waited_for_a_busy_main_loop_beyond_the_dead_mans_time_comes_too_late(racing, silent_ms, status) -> None:
    """Nothing was polled in between: the frame itself must find the board safe."""
    r = Racing(racing, 1, 5)
    racing.racing_sleep(silent_ms * MS)
    assert r.ask("pulse", (r.now + 5 * MS) % WRAP, 1, 1, [100] * 15).status == status

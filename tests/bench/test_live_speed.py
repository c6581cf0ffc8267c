"""What a live session costs while nothing happens, how much it remembers, and how soon it is there."""

from __future__ import annotations

import gc
import os
import statistics
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from ledger import Ledger

import haptics
from haptics.time import NS_PER_MS

pytestmark = pytest.mark.bench
SECONDS = 4.0
"""Of each idle measurement."""
SLEEPER = f"""
import time
end_s = time.monotonic() + {SECONDS}
begun_s = time.process_time()
while time.monotonic() < end_s:
    time.sleep(1e-3)
print(time.process_time() - begun_s)
"""
IDLE = """
import sys, time
import haptics
scene = haptics.load_scene("desk").placed((0.0, 0.0, 0.0))
with haptics.live(scene, tactiles=sys.argv[1]) as session:
    time.sleep(1.0)
    begun_s = time.process_time()
    time.sleep({seconds})
    print(time.process_time() - begun_s)
    assert session.glove.state().armed == ("tactiles",)
"""
STARTS = """
import time
begun_s = time.perf_counter()
import haptics
with haptics.live("playground") as session:
    print(time.perf_counter() - begun_s)
"""
MINUTES = 30


def printed(code: str, *words: str) -> float:
    """The number that a fresh interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code, *words], check=True, capture_output=True, text=True)
    return float(done.stdout.split()[-1])


def resident_bytes() -> int:
    """Memory that this process holds, once what is not used was given back; of Linux."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_an_idle_live_session_beside_a_sleeper(bench: Ledger, tmp_path) -> None:
    """The board is in a process of its own, as a real one is: its CPU time is not the session's."""
    port = tmp_path / "port"
    command = [sys.executable, "-m", "haptics.cli.main", "link", "simulate", "tactiles", "--link", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as board:
        assert board.stdout is not None
        board.stdout.readline()
        pairs = [(printed(IDLE.format(seconds=SECONDS), str(port)), printed(SLEEPER)) for _ in range(3)]
        board.terminate()
    bench.note("an idle live session, share of one core", f"{100 * min(a for a, _ in pairs) / SECONDS:.1f} %")
    ratio = statistics.median(a / b for a, b in pairs)
    bench.ratio("live.idle", "CPU time of an idle live session, over that of a bare 1 kHz sleeper", ratio, at_most=4)


def test_half_an_hour_of_poses_leaves_no_memory_behind(bench: Ledger) -> None:
    """The open hand moves up and down through a desk at 60 Hz: touches, pulses, denials; growth after a minute of it."""
    recording = haptics.load_hand("synthetic")
    frames = [frame for frame in recording.frames("right") if frame.time_ns < 1_000_000_000]
    there_and_back = [*frames[::2], *frames[::-2]]
    with haptics.open(tactiles="sim://tactiles?level=event", brake="sim://brake", clock="virtual") as glove:
        glove.arm()
        session = haptics.Session(haptics.load_scene("desk").placed_for(recording), glove)
        session.begin()
        number = 0

        def play(seconds: float) -> None:
            nonlocal number
            end_ns = glove.now_ns() + round(seconds * 1e9)
            while glove.now_ns() < end_ns:
                for _ in range(16):
                    session.tick(glove.now_ns() + NS_PER_MS)
                session.submit(replace(there_and_back[number % len(there_and_back)], time_ns=glove.now_ns()))
                number += 1

        play(60.0)
        before = resident_bytes()
        play(60.0 * MINUTES)
        grown = resident_bytes() - before
    bench.ratio("live.memory", f"memory growth over {MINUTES} minutes of a live session, MB", grown / 1e6, at_most=2)


def test_a_live_session_is_there_soon(bench: Ledger) -> None:
    """Caches are warm from the first start; simulated boards, whose models are part of it."""
    printed(STARTS)
    pairs = [
        (
            printed(STARTS),
            printed("import time; begun_s = time.perf_counter(); import numpy; print(time.perf_counter() - begun_s)"),
        )
        for _ in range(5)
    ]
    bench.note("from a fresh interpreter to an armed live session", f"{min(a for a, _ in pairs):.2f} s")
    ratio = statistics.median(a / b for a, b in pairs)
    bench.ratio("live.start", "a fresh interpreter's way to an armed live session, over importing numpy", ratio, at_most=20)

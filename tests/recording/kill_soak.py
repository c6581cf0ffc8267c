"""A writer that reports what it has acknowledged, to be killed at any moment; run by ``test_kill.py`` as a child process."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

from haptics.recording import Journal, read_journal

ROW = np.dtype([("time_ns", "<i8"), ("value", "<f8", (3,)), ("name", "S12")])
STREAMS = ("a", "b")


def row(step: int) -> tuple[int, tuple[float, float, float], str]:
    """What the writer writes as its row number ``step``."""
    return step, (step / 3.0, -step, step * step), f"row {step}"


def write(path: Path, seed: int) -> None:
    """Rows for ever, in bursts of random length; after each commit a line on standard output: rows acknowledged."""
    rng = random.Random(seed)
    journal = Journal.create(path, {"seed": seed}, rows_per_segment=64)
    streams = [journal.stream(name, ROW) for name in STREAMS]
    step = 0
    while True:
        for _ in range(rng.randrange(1, 100)):
            for stream in streams:
                stream.append(row(step))
            step += 1
        journal.commit()
        os.write(1, b"%d\n" % step)


def kill_once(path: Path, seed: int) -> tuple[int, int]:
    """Start a writer, kill it after a random number of lines; returns (rows acknowledged, rows recovered).

    :raises AssertionError: a row came back changed.
    """
    lines = random.Random(seed).randrange(1, 60)
    command, paths = [sys.executable, __file__, str(path), str(seed)], os.pathsep.join(sys.path)
    with subprocess.Popen(command, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": paths}) as child:
        assert child.stdout is not None
        acknowledged = 0
        for _ in range(lines):
            acknowledged = int(child.stdout.readline())
        child.send_signal(signal.SIGKILL)
        rest = child.stdout.read().split(b"\n")
        acknowledged = max([acknowledged, *(int(line) for line in rest[:-1])])
    contents = read_journal(path)
    recovered = min(contents.count(name) for name in STREAMS)
    for name in STREAMS:
        rows = contents.stream(name)
        steps = np.arange(len(rows))
        assert np.array_equal(rows["time_ns"], steps)
        assert np.array_equal(rows["value"], np.stack([steps / 3.0, -steps, steps * steps], axis=1))
        assert rows["name"].tolist() == [f"row {step}".encode()[:12] for step in steps]
    return acknowledged, recovered


if __name__ == "__main__":
    write(Path(sys.argv[1]), int(sys.argv[2]))

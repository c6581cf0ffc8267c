"""What a run of benchmarks finds: ratios, each of two things measured side by side in one run, with the bound it is held to.

Machines differ by a factor of two and more, so no bound is on a time. What there is no natural peer for is held against a fixed
reference work of the same kind: interpreted Python, a compiled loop, a sweep through memory. Every ratio is appended to
``history.csv``, so that drift shows.
"""

from __future__ import annotations

import csv
import statistics
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

HISTORY = Path(__file__).with_name("history.csv")
RECENT = 5
"""Drift is against the median of so many earlier runs."""
Job = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the table; ``key`` is empty for a figure that is only shown."""

    key: str
    what: str
    figure: str
    bound: str = ""
    ratio: float = 0.0
    kept: bool = True


class Ledger:
    """Collects what is measured; ``tests/bench/conftest.py`` prints it and keeps the history."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []

    def note(self, what: str, figure: str) -> None:
        """A figure of this machine, for people: no bound."""
        self.entries.append(Entry("", f"  {what}", figure))

    def ratio(self, key: str, what: str, ratio: float, *, at_most: float | None = None, at_least: float | None = None) -> None:
        """A ratio of two things measured side by side, held to one bound.

        :raises AssertionError: the bound is not kept.
        """
        assert (at_most is None) != (at_least is None), "one bound"
        bound = f"<= {at_most:g}" if at_most is not None else f">= {at_least:g}"
        kept = ratio <= at_most if at_most is not None else ratio >= (at_least or 0.0)
        self.entries.append(Entry(key, what, f"{ratio:.3g}", bound, ratio, kept))
        assert kept, f"{what}: {ratio:.3g}, bound {bound}"


def cpu_s(job: Job) -> float:
    """CPU seconds of this process that a job takes."""
    began = time.process_time()
    job()
    return time.process_time() - began


def side_by_side(job: Job, beside: Job, times: int = 5) -> tuple[float, float, float]:
    """CPU seconds of either at best, and the median of the ratios of neighbours; what slows the machine slows both."""
    pairs = [(cpu_s(job), cpu_s(beside)) for _ in range(times)]
    return min(a for a, _ in pairs), min(b for _, b in pairs), statistics.median(a / b for a, b in pairs)


class _Counter:
    """Something to call and to count in."""

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}

    def count(self, number: int) -> int:
        found = self.counts.get(number & 63, 0) + 1
        self.counts[number & 63] = found
        return found


def interpreted(calls: int = 20_000) -> int:
    """Plain Python, as rendering loops are made of: so many calls of a method that reads and writes a dictionary."""
    counter, total = _Counter(), 0
    for number in range(calls):
        total += counter.count(number)
    return total


@cache
def compiled() -> Callable[[int], float]:
    """A compiled loop of floating point that takes so many steps of a damped spring."""
    import numba

    @numba.njit
    def spring(steps: int) -> float:
        x, v = 1.0, 0.0
        for _ in range(steps):
            v += 1e-3 * (-100.0 * x - 0.1 * v - x * x * x)
            x += 1e-3 * v
        return x

    spring(1)
    return spring


def gathered(count: int) -> Job:
    """A sweep of what a mesh of so many vertices takes from memory: gather three corners, add, scatter."""
    rng = np.random.default_rng(1)
    corners = np.clip(np.arange(2 * count)[:, None] // 2 + rng.integers(-200, 200, (2 * count, 3)), 0, count - 1)
    vertices, sums = rng.random((count, 3)), np.zeros((count, 3))

    def sweep() -> None:
        faces = vertices[corners]
        products = np.einsum("fij,fkj->fik", faces, faces)
        for corner in range(3):
            np.add.at(sums, corners[:, corner], products[:, corner])

    return sweep


def history() -> dict[str, list[float]]:
    """Ratios of earlier runs by key, in their order."""
    found: dict[str, list[float]] = {}
    if HISTORY.exists():
        with HISTORY.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                found.setdefault(row["key"], []).append(float(row["ratio"]))
    return found


def keep(entries: list[Entry]) -> None:
    """Append the ratios of this run, with day and commit."""
    git = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=HISTORY.parent)
    commit, day, new = git.stdout.strip() or "none", time.strftime("%Y-%m-%d"), not HISTORY.exists()
    with HISTORY.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(["day", "commit", "key", "ratio"])
        writer.writerows([day, commit, one.key, f"{one.ratio:.4g}"] for one in entries if one.key)


def table(entries: list[Entry], earlier: dict[str, list[float]]) -> list[str]:
    """Lines to print: what, measured, bound, and the drift against recent runs."""
    lines = [f"{'':<84}{'measured':>12}{'bound':>10}{'drift':>9}"]
    for one in entries:
        recent = earlier.get(one.key, [])[-RECENT:]
        drift = f"{100 * (one.ratio / statistics.median(recent) - 1):+.0f} %" if recent and one.key else ""
        lines.append(f"{one.what:<84}{one.figure:>12}{one.bound:>10}{drift:>9}{'' if one.kept else '  NOT KEPT'}")
    return lines

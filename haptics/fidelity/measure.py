"""Every level of every model against its reference: errors over declared cases, and what each level costs here.

A row is one observable of one level over one kind of case. Cases that a level refuses, or reports as outside of what it answers
for, are counted in ``refused`` and have no error. The reference's own rows have none either; its cost stands beside the others'.
Median and 95 % are over a random sample; the worst of the latch is over the hardest of twelve times as many cases besides.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from haptics.fidelity.cases import brake as brake_cases, latch as latch_cases, thermal as thermal_cases
from haptics.fidelity.cost import Cost, brake_cost, latch_cost, thermal_cost
from haptics.fidelity.measured import Measured, MeasuredRow
from haptics.physics.brake import levels as brake
from haptics.physics.latch import pulse as latch
from haptics.physics.thermal.plant import LEVELS as THERMAL_LEVELS
from haptics.units import one_of
from haptics.version import __version__

KINDS = ("typical", "edge")
UNITS = {
    "wrong final state": "share",
    "arrival time": "ms",
    "impact speed": "%",
    "energy": "%",
    "temperature": "K",
    "coil temperature": "K",
    "force over time": "N",
    "plateau": "%",
    "ripple": "%",
    "response time": "ms",
    "release time": "ms",
    "supply power": "%",
}
"""Unit of each observable's error. A share is of the cases: 0 or 1 for each."""
_COUNTS = {"latch": (400, 60), "thermal": (40, 6), "brake": (150, 6)}
"""Cases of each kind: all, and with ``quick``."""
_SCREENED = 12
"""So many times more cases of the latch are looked through for the hardest."""

Progress = Callable[[str], None]


def measure(
    quick: bool = False, seed: int = 1, progress: Progress = lambda _: None, models: Sequence[str] = tuple(_COUNTS)
) -> Measured:
    """Run all levels over all cases; some five minutes, or half a minute when ``quick``.

    :param quick: True: fewer cases.
    :param seed: of the cases.
    :param progress: called with a line on what is being done.
    :param models: latch, thermal or brake; all by default.
    :return: errors and costs of every level.
    :raises InputError: an unknown model.
    """
    rows: list[MeasuredRow] = []
    for model in models:
        rows += _MODELS[one_of("model", model, tuple(_MODELS))](_COUNTS[model][quick], seed, progress)
    return Measured(machine(), __version__, seed, tuple(rows))


def machine() -> dict[str, Any]:
    """What the costs were measured on.

    :return: processor, cores, system and Python, by these names.
    """
    return {"processor": _processor(), "cores": os.cpu_count(), "system": platform.system(), "python": platform.python_version()}


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as info:
            return next(line.split(":", 1)[1].strip() for line in info if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _rows(
    model: str,
    level: str,
    cases: str,
    found: Iterable[dict[str, float] | None],
    cost: Cost,
    hardest: Sequence[dict[str, float] | None] = (),
) -> list[MeasuredRow]:
    """:param hardest: errors of chosen cases, which count for the worst only."""
    values: dict[str, list[float]] = {}
    refused = 0
    for errors in found:
        refused += errors is None
        for observable, error in (errors or {}).items():
            values.setdefault(observable, []).append(error)
    worst = {observable: max(of) for observable, of in values.items()}
    for errors in hardest:
        for observable, error in (errors or {}).items():
            worst[observable] = max(worst.get(observable, 0.0), error)
    return [
        MeasuredRow(
            model, level, observable, UNITS[observable], cases, len(of), refused,
            float(np.median(of)), float(np.quantile(of, 0.95)), worst[observable], cost.us_per_event, cost.s_per_sim_s,
        )
        for observable, of in values.items()
    ]  # fmt: skip


def _latch(count: int, seed: int, progress: Progress) -> list[MeasuredRow]:
    costs = {level: latch_cost(level) for level in latch.LEVELS}
    rows: list[MeasuredRow] = []
    for kind in KINDS:
        progress(f"latch, {count} {kind} cases")
        cases = latch_cases.latch_cases(kind, count, seed)
        cases += latch_cases.hardest_cases(kind, _SCREENED * count, seed + 77)
        true = [latch_cases.play(case, "reference") for case in cases]
        for level in latch.LEVELS:
            runs = true if level == "reference" else [latch_cases.play(case, level) for case in cases]
            found = [None if r is None or t is None else latch_cases.errors(r, t) for r, t in zip(runs, true, strict=True)]
            rows += _rows("latch", level, kind, found[:count], costs[level], found[count:])
    return rows


def _thermal(count: int, seed: int, progress: Progress) -> list[MeasuredRow]:
    rows: list[MeasuredRow] = []
    for level in THERMAL_LEVELS:
        progress(f"thermal, level {level}")
        cost = thermal_cost(level)
        for kind in KINDS:
            found = [thermal_cases.errors(case, level) for case in thermal_cases.thermal_cases(kind, count, seed)]
            rows += _rows("thermal", level, kind, found, cost)
    return rows


def _brake(count: int, seed: int, progress: Progress) -> list[MeasuredRow]:
    costs = {level: brake_cost(level) for level in brake.LEVELS}
    rows: list[MeasuredRow] = []
    for kind in KINDS:
        progress(f"brake, {count} {kind} cases")
        cases = brake_cases.brake_cases(kind, count, seed)
        true = [brake_cases.play(case, "reference") for case in cases]
        for level in brake.LEVELS:
            runs = true if level == "reference" else [brake_cases.play(case, level) for case in cases]
            rows += _rows("brake", level, kind, [brake_cases.errors(r, t) for r, t in zip(runs, true, strict=True)], costs[level])
    return rows


_MODELS: dict[str, Callable[[int, int, Progress], list[MeasuredRow]]] = {"latch": _latch, "thermal": _thermal, "brake": _brake}

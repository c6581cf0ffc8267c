"""The proof of a plan: the same hand through the planned run and through one in which every model runs at its reference.

Both get the same commands (decisions come from poses, not from plants), so that events match one to one; every observable of the
plan is compared on the plants' truth, and held against the plan's tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from haptics.fidelity.notice import NOTICES, force_notice
from haptics.judging.truth import Truth
from haptics.time import NS_PER_MS

HELD_NS = 60 * NS_PER_MS
"""A brake's force counts as held from this long after half of it was there."""
LET_GO_NS = 2 * NS_PER_MS
"""And until this long before it is let go."""


@dataclass(frozen=True, slots=True)
class ProofRow:
    """One observable of a plan, compared.

    :param observable: its name, such as ``arrival time``.
    :param unit: of ``worst`` and ``limit``.
    :param n: how many values were compared.
    :param worst: the largest difference between planned and reference run.
    :param limit: the largest difference that the plan allows.
    :param kept: whether ``worst`` is within ``limit``.
    """

    observable: str
    unit: str
    n: int
    worst: float
    limit: float
    kept: bool


@dataclass(frozen=True, slots=True)
class Proof:
    """How the planned run differs from the all-reference run, and the CPU time of either.

    :param scene: names of what was played.
    :param hand: likewise, with ``scene``.
    :param tolerance: error allowed, as a share of what is just noticed.
    :param levels: the plan: the level of each model, by the model's name.
    :param rows: one for each observable that a run had.
    :param planned_cpu_s: CPU time of the planned run, s.
    :param reference_cpu_s: CPU time of the all-reference run, s.
    """

    scene: str
    hand: str
    tolerance: float
    levels: dict[str, str]
    rows: tuple[ProofRow, ...]
    planned_cpu_s: float
    reference_cpu_s: float

    @property
    def kept(self) -> bool:
        """Whether every observable stayed within its tolerance."""
        return all(row.kept for row in self.rows)


@dataclass(frozen=True, slots=True)
class Played:
    """What of a run is compared.

    :param truth: what its plants did.
    :param admissions: (site, kind, played, reason) of every request to the tactors, or None if the run had none.
    :param brakes: name and drive voltage (V) of each brake output, or None if the run had none.
    """

    truth: Truth
    admissions: list[tuple[str, str, bool, str | None]] | None
    brakes: tuple[tuple[str, float], ...] | None


def compare(planned: Played, reference: Played, tolerance: float) -> tuple[ProofRow, ...]:
    """Hold every observable that either run has against the plan's tolerance.

    :param planned: the run with the plan's levels.
    :param reference: the same hand with every model at its reference.
    :param tolerance: error allowed, as a share of what is just noticed.
    :return: a row for each observable with at least one value.
    """
    rows = [*_pins(planned, reference), *_brakes(planned, reference)]
    return tuple(
        ProofRow(name, unit, len(found), float(max(found)), limit, max(found) <= limit)
        for name, unit, found, limit in ((name, unit, found, at_third * tolerance * 3.0) for name, unit, found, at_third in rows)
        if len(found)
    )


_Row = tuple[str, str, Sequence[float], float]


def _pins(planned: Played, reference: Played) -> list[_Row]:
    """Arrivals matched one to one, by channel and kind, in order."""
    one, other = _arrivals(planned), _arrivals(reference)
    differ = [float(len(one.get(key, ())) != len(other.get(key, ()))) for key in one.keys() | other.keys()]
    differ += [float(a != b) for a, b in zip(planned.truth.latched, reference.truth.latched, strict=True)]
    pairs = [pair for key in one.keys() & other.keys() for pair in zip(one[key], other[key], strict=False)]
    moved_k = np.abs(planned.truth.peak_rise_k - reference.truth.peak_rise_k)
    admitted = [float(planned.admissions != reference.admissions)]
    return [
        ("wrong final state", "share", differ, NOTICES["wrong final state"].tolerance),
        ("arrival time", "ms", [abs(a[0] - b[0]) / NS_PER_MS for a, b in pairs], NOTICES["arrival time"].tolerance),
        ("impact speed", "%", [100.0 * abs(a[1] / b[1] - 1.0) for a, b in pairs if b[1]], NOTICES["impact speed"].tolerance),
        ("temperature", "K", moved_k.tolist() if planned.admissions is not None else [], NOTICES["temperature"].tolerance),
        ("admission", "share", admitted if planned.admissions is not None else [], 0.0),
    ]


def _arrivals(played: Played) -> dict[tuple[int, str], list[tuple[int, float]]]:
    """(time, speed) of each stop reached, once for each time that the pin came from the other one."""
    found: dict[tuple[int, str], list[tuple[int, float]]] = {}
    last: dict[int, str] = {}
    truth = played.truth
    for (time_ns, channel, kind), speed in sorted(zip(truth.pins, truth.pin_speeds_m_s, strict=True)):
        if kind != "left_skin" and last.get(channel, "reached_off") != kind:
            last[channel] = kind
            found.setdefault((channel, kind), []).append((time_ns, speed))
    return found


def _brakes(planned: Played, reference: Played) -> list[_Row]:
    if planned.brakes is None or not planned.truth.forces_n:
        return []
    half = [sorted(event for event in s.truth.brakes if event[2] == "half_capacity") for s in (planned, reference)]
    matched = [float(len(half[0]) != len(half[1]))]
    rises = [abs(a[0] - b[0]) / NS_PER_MS for a, b in zip(*half, strict=False)]
    times = np.array([at for at, _ in planned.truth.forces_n])
    forces, true = (np.array([force for _, force in s.truth.forces_n])[:, : len(planned.brakes)] for s in (planned, reference))
    rows: list[_Row] = [
        ("closed or not", "share", matched, 0.0),
        ("response time", "ms", rises, NOTICES["response time"].tolerance),
    ]
    for channel, (name, volts) in enumerate(planned.brakes):
        held = _held(times, channel, reference)
        if not held.any():
            continue
        finger = name if name in ("index", "thumb") else "index"
        notice = force_notice(finger, volts)
        off = [100.0 * abs(float(forces[held, channel].mean() / true[held, channel].mean()) - 1.0)]
        rows.append((f"plateau, {name}", "%", off, notice.tolerance))
    return rows


def _held(times_ns: np.ndarray, channel: int, played: Played) -> np.ndarray:
    """Samples at which the brake has held for a while and goes on holding."""
    events = [(at, kind) for at, one, kind in sorted(played.truth.brakes) if one == channel]
    held = np.zeros(len(times_ns), dtype=bool)
    since = None
    for at, kind in [*events, (int(times_ns[-1]), "shorted")]:
        if kind == "half_capacity":
            since = at + HELD_NS
        elif kind == "shorted" and since is not None:
            held |= (times_ns >= since) & (times_ns <= at - LET_GO_NS)
            since = None
    return held

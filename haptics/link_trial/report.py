"""What came of a trial: counts of commands and effects, and which promises were broken, in words."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Quantiles:
    """Of a set of times, in microseconds."""

    p50: float
    p99: float
    max: float


def quantiles_us(values_ns: list[int]) -> Quantiles | None:
    """Quantiles (nearest rank) of magnitudes; None of none."""
    ordered = sorted(abs(value) for value in values_ns)
    if not ordered:
        return None
    ranks = (len(ordered) - 1) // 2, (99 * len(ordered) - 1) // 100, len(ordered) - 1
    return Quantiles(*(ordered[rank] / 1000 for rank in ranks))


@dataclass(frozen=True, slots=True)
class StressReport:
    """``sent = acknowledged + refused + unknown_outcomes``.

    ``refused``: by the board with a reply (of them ``late``: its time had passed), or by the host before sending.
    ``unknown_outcomes``: given up without a reply. ``min_margin_ms``: the shortest time that an acknowledged command lay ahead
    when the board dealt with it. ``retried``: repetitions. ``pulses``: outputs that acknowledged commands put on. ``lost``:
    acknowledged, and never played though nothing disarmed the board. ``disarmed``: how often the board
    disarmed itself and was armed again; ``disarmed_because``: what it said, each time it said so. None where this port cannot
    tell: the edges, and what is on in silence.
    ``edge_error_us``: magnitude, edge against the commanded tick on the board's own clock.
    ``max_energised_after_silence_ms``: from the last byte that reached the board until its outputs are off for good;
    ``silence_limit_ms``: the dead-man time, 1 ms to notice, and 5 ms for a brake to discharge. ``ended``: why the link ended
    early.
    """

    port: str
    seed: int
    faults: str
    sent: int
    acknowledged: int
    refused: int
    unknown_outcomes: int
    late: int
    min_margin_ms: float | None
    retried: int
    pulses: int
    lost: int | None
    duplicate_effects: int
    played_late: int | None
    played_early: int | None
    played_uncommanded: int | None
    played_too_long: int | None
    played_too_short: int | None
    disarmed: int
    disarmed_because: list[str]
    max_energised_after_silence_ms: float | None
    silence_limit_ms: float
    edge_error_us: Quantiles | None
    lasted_s: float
    ended: str | None
    violations: list[str]

"""Trains of pulses on a bench: how they are played, and what the accelerometer and the board say came of them.

A cycle is a pulse toward the skin and one back (thesis 3.4.5). Its landing on the off plate is felt: a sample that is loud
beside noise and beside what still rings of the landing before it. A train's rate is the slope of its landings over their number,
put on top of the spacing of the commands; all bursts of one rate have that slope in common.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from haptics.time import seconds_to_ns
from rigs.bench import Bench
from rigs.fitting import Vector, quadrature
from rigs.instruments import Samples
from rigs.landings import LOUD_SDS, RATE_SD, Trace, meeting_telemetry, traces
from rigs.result import Quantity

GAP_S = 50e-6
"""Between two pulses of one coil: the unit of a pulse's length. A board refuses pulses that meet."""
LEAD_S = 0.1
"""Commands leave this long before a burst: 20 of them take a fifth of it on a line of 500 kbaud."""
REST_S = 0.4
RINGS_ON = 1.5
"""A landing is louder than this times what the last samples, half a ring, were."""
_HALF_RING = 5
_WHOLE_AT_ONCE_S = 0.5


@dataclass(frozen=True)
class Train:
    """What is asked for: ``cycles`` in each of ``bursts``, ``toward_s`` and ``back_s`` long, the return ``back_at_s`` into a cycle."""

    name: str
    rate_hz: float
    toward_s: float
    back_s: float
    back_at_s: float
    cycles: int
    bursts: int

    @property
    def on_s(self) -> float:
        """Time for which the coil is on in one burst."""
        return self.cycles * (self.toward_s + self.back_s)

    @property
    def length_s(self) -> float:
        """Of one burst."""
        return self.cycles / self.rate_hz


@dataclass(frozen=True)
class Played:
    """One train as it went: when each burst began, and what the board says of its pulses."""

    train: Train
    starts_ns: tuple[int, ...]
    refused: int
    played: int

    @property
    def asked(self) -> int:
        """Pulses, two a cycle."""
        return 2 * self.train.cycles * len(self.starts_ns)


@dataclass(frozen=True)
class Delivered:
    """What was felt of a train. ``late_s`` (n,): each landing after its cycle's command, nan: none. ``cycle`` (n,): its number.

    ``spacing_s`` and ``jitter_s`` None: too few landings.
    """

    played: Played
    cycle: Vector
    late_s: Vector
    spacing_s: Quantity | None
    jitter_s: Quantity | None

    @property
    def landings(self) -> int:
        """How many were felt."""
        return int(np.isfinite(self.late_s).sum())

    @property
    def whole(self) -> bool:
        """No pulse was refused or lost, and every cycle landed."""
        return self.played.refused == 0 and self.played.played == self.played.asked and self.landings == len(self.late_s)

    @property
    def rate_hz(self) -> Quantity | None:
        """Landings a second."""
        if self.spacing_s is None:
            return None
        rate_hz = 1.0 / self.spacing_s.value
        return Quantity(rate_hz, rate_hz**2 * self.spacing_s.sd, "Hz")

    @property
    def travel_s(self) -> float:
        """From the return's command to the landing, mean."""
        return float(np.nanmean(self.late_s)) - self.played.train.back_at_s

    def row(self) -> dict[str, float | int | str | None]:
        """For a table."""
        rate, jitter, train = self.rate_hz, self.jitter_s, self.played.train
        return {
            "train": train.name,
            "asked_hz": train.rate_hz,
            "bursts": len(self.played.starts_ns),
            "cycles": len(self.late_s),
            "pulses_asked": self.played.asked,
            "pulses_refused": self.played.refused,
            "pulses_played": self.played.played,
            "landings": self.landings,
            "rate_hz": None if rate is None else rate.value,
            "rate_sd_hz": None if rate is None else rate.sd,
            "jitter_s": None if jitter is None else jitter.value,
            "jitter_sd_s": None if jitter is None else jitter.sd,
        }


def play(bench: Bench, train: Train, phases_s: Sequence[float]) -> Played:
    """Play all bursts of a train, with rests between.

    :param phases_s: telemetry is to come so long after a burst's beginning, one for each burst.
    """
    before, count = len(bench.refusals()), _counter(bench)
    starts_ns: list[int] = []
    for phase_s in phases_s[: train.bursts]:
        start_ns = meeting_telemetry(bench, bench.now_ns + seconds_to_ns(2.0 * LEAD_S), phase_s)
        starts_ns.append(start_ns)
        for k in range(train.cycles):
            cycle_ns = start_ns + seconds_to_ns(k / train.rate_hz)
            # One estimate of the board's clock for a whole burst: pulses that all but meet must not be moved apart or together.
            ahead_of_ns = start_ns if train.length_s <= _WHOLE_AT_ONCE_S else cycle_ns
            bench.wait_until(ahead_of_ns - seconds_to_ns(LEAD_S))
            bench.pulse([bench.options.channel], cycle_ns, train.toward_s, toward_skin=True)
            bench.pulse([bench.options.channel], cycle_ns + seconds_to_ns(train.back_at_s), train.back_s, toward_skin=False)
        bench.wait_until(start_ns + seconds_to_ns(train.length_s + REST_S))
    return Played(train, tuple(starts_ns), len(bench.refusals()) - before, (_counter(bench) - count) & 0xFFFF)


def felt(samples: Samples, played: Played, earliest_s: float) -> Delivered:
    """The landings of a train.

    :param earliest_s: after a cycle's command, when its landing is looked for first; until one cycle later, or 20 ms.
    """
    train = played.train
    cycle: list[float] = []
    late_s: list[float] = []
    within_s = min(1.0 / train.rate_hz, 20e-3)
    for trace in traces(samples, played.starts_ns, train.length_s + 50e-3):
        loud = loud_samples(trace)
        for k in range(train.cycles):
            cycle.append(k)
            command_s = k / train.rate_hz
            low, high = np.searchsorted(trace.after_s, (command_s + earliest_s, command_s + earliest_s + within_s))
            first = low + int(np.argmax(loud[low:high])) if loud[low:high].any() else None
            at_s = math.nan if first is None else trace.after_s[first] - 0.5 * trace.period_s
            late_s.append(at_s - command_s)
    period_s = float(np.median(np.diff(samples.time_s)))
    return _with_rate(Delivered(played, np.array(cycle), np.array(late_s), None, None), period_s)


def loud_samples(trace: Trace) -> np.ndarray:
    """For each sample (n,): whether something new begins to ring there, or has just begun."""
    loudness = np.abs(trace.g)
    before = np.max([np.concatenate([np.zeros(k), loudness[:-k]]) for k in range(1, _HALF_RING + 1)], axis=0)
    return loudness > LOUD_SDS * trace.noise_g + RINGS_ON * before


def _with_rate(found: Delivered, period_s: float) -> Delivered:
    """Spacing and jitter from the landings, if there are enough."""
    here = np.isfinite(found.late_s)
    cycle, late_s = found.cycle[here], found.late_s[here]
    if len(late_s) < 4 or len(np.unique(cycle)) < 3:
        return found
    slope, height = np.polyfit(cycle, late_s, 1)
    left = late_s - height - slope * cycle
    freedom = len(left) - 2
    # A sample's period is the least that is not known of each; where sampling and train keep step, scatter does not show it.
    steps_s2 = period_s**2 / 12.0
    scatter_s2 = float(np.sum(left**2)) / freedom
    slope_sd_s = math.sqrt(max(scatter_s2, steps_s2) / float(np.sum((cycle - cycle.mean()) ** 2)))
    jitter_s2, jitter_s2_sd = max(scatter_s2 - steps_s2, 0.0), max(scatter_s2, steps_s2) * math.sqrt(2.0 / freedom)
    jitter_s = math.sqrt(jitter_s2)
    jitter_sd_s = jitter_s2_sd / (2.0 * jitter_s) if jitter_s2 > jitter_s2_sd else math.sqrt(jitter_s2_sd)
    spacing_s = 1.0 / found.played.train.rate_hz + float(slope)
    return replace(
        found,
        spacing_s=Quantity(spacing_s, quadrature((slope_sd_s, spacing_s * RATE_SD)), "s"),
        jitter_s=Quantity(jitter_s, jitter_sd_s, "s"),
    )


def _counter(bench: Bench) -> int:
    """Pulses that the board says it played on the channel since power-on, modulo 65536."""
    return int(bench.telemetry[-1][1].played[bench.options.channel]) if bench.telemetry else 0


def whole_up_to(found: Sequence[Delivered]) -> Delivered | None:
    """The fastest train that came whole, all slower ones too; None if the slowest did not."""
    best = None
    for one in sorted(found, key=lambda one: one.played.train.rate_hz):
        if not one.whole:
            break
        best = one
    return best

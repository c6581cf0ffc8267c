"""Trains of pulses on a bench: how they are played, and what accelerometer and board report of them.

A cycle is a pulse toward the skin and one back (thesis 3.4.5). Its landing on the off plate is felt: a sample that is loud
beside noise and beside what still rings of the landing before it. A train's rate is the slope of its landings over their number,
put on top of the spacing of the commands; all bursts of one rate have that slope in common.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptics.time import seconds_to_ns
from rigs.bench import Bench
from rigs.coil_current import meeting_telemetry
from rigs.fitting import Vector, quadrature
from rigs.instruments import Samples
from rigs.landings import LOUD_SDS, RATE_SD, Trace, traces
from rigs.result import Quantity

GAP_S = 50e-6
"""Between two pulses of one coil: the unit of a pulse's length. A board refuses pulses that meet."""
LEAD_S = 0.1
"""Commands leave this long before a burst: 20 of them take a fifth of it on a line of 500 kbaud."""
REST_S = 0.4
LANDS = 0.35
"""A landing is louder than this share of what they are at their loudest, alike in slow and fast trains: none is seen later only
because more still rings."""
RINGS_ON = 1.15
"""It is louder than this times what rang shortly before."""
_BEFORE = range(3, 7)
"""Shortly before: these samples, which hold a crest of any ring from 450 Hz on; the last two may be the landing's own rise."""
_CREST = 4
IN_STEP = 1.85
"""How much the slope of landings, each known to a period of sampling, can be off beside landings that meet sampling at random:
worst of all ratios of the two periods, 9 landings a burst."""
TIMED_ALIKE = 1.0
"""Landings of fast and slow trains are timed alike to this many times the variance of a step of sampling (assumed)."""
SLOW_HZ = 20.0
"""Up to here a cycle is alone: landings of slow trains show how well one is timed."""
_WHOLE_AT_ONCE_S = 0.5


@dataclass(frozen=True)
class Train:
    """Pulse trains to play: bursts of cycles, one pulse toward the skin and one back in each cycle.

    :param name: for people, such as ``200 Hz``.
    :param rate_hz: cycles a second, Hz.
    :param toward_s: length of the pulse toward the skin, s.
    :param back_s: length of the pulse back, s.
    :param back_at_s: start of the pulse back after the cycle's start, s.
    :param cycles: in one burst.
    :param bursts: with rests between them.
    """

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
    """One train as it was played, by the board's own count.

    :param train: what was commanded.
    :param starts_ns: start of each burst on the bench's clock, ns.
    :param refused: pulses that the board refused.
    :param played: pulses that the board counted.
    """

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
    """Landings of one train. The first of each burst is left out of spacing and scatter: it starts from rest, into quiet.

    :param played: the train.
    :param cycle: number of each cycle within its burst (n,).
    :param late_s: landing after its cycle's command (n,), s; nan where none was felt.
    :param ring_left: share of the landing's loudness that rang shortly before (n,).
    :param spacing_s: mean time between landings, s; None if there are too few.
    :param scatter_s2: variance of the landings about even spacing, s^2.
    :param freedom: degrees of freedom of ``scatter_s2``.
    """

    played: Played
    cycle: Vector
    late_s: Vector
    ring_left: Vector
    period_s: float
    """Of sampling."""
    spacing_s: Quantity | None = None
    scatter_s2: float = 0.0
    freedom: int = 0

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
        """For a table.

        :return: rates in Hz, scatter in s, counts; None where there are too few landings.
        """
        rate, train = self.rate_hz, self.played.train
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
            "scatter_s": None if rate is None else math.sqrt(self.scatter_s2),
        }


def play(bench: Bench, train: Train, phases_s: Sequence[float]) -> Played:
    """Play all bursts of a train, with rests between.

    :param bench: armed.
    :param train: to play.
    :param phases_s: telemetry is to come so long after a burst's beginning, one for each burst.
    :return: the train with its start times and counts.
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


def felt(samples: Samples, played: Played, earliest_s: float, lands: float = LANDS) -> Delivered:
    """The landings of a train.

    :param samples: of the accelerometer, g.
    :param played: train to look for.
    :param earliest_s: after a cycle's command, when its landing is looked for first; until one cycle later, or 20 ms.
    :param lands: loudness that makes a landing, over that of a landing at its loudest; with 0 it is timed earliest, from quiet.
    :return: one landing or nan for each cycle.
    """
    train = played.train
    found = traces(samples, played.starts_ns, train.length_s + 50e-3)
    windows = [(trace, k, _window(trace, k / train.rate_hz + earliest_s, train)) for trace in found for k in range(train.cycles)]
    loudest_g = float(np.median([np.abs(trace.g[low:high]).max(initial=0.0) for trace, _, (low, high) in windows]))
    rows: list[tuple[float, float, float]] = []
    for trace, k, (low, high) in windows:
        loud = loud_samples(trace, lands * loudest_g, low, high)
        if not loud.any():
            rows.append((k, math.nan, math.nan))
            continue
        first, loudness = low + int(np.argmax(loud)), np.abs(trace.g)
        before_g = loudness[first - _BEFORE[-1] : first - _BEFORE[0] + 1].max()
        late_s = trace.after_s[first] - 0.5 * trace.period_s - k / train.rate_hz
        rows.append((k, late_s, before_g / loudness[first : first + _CREST].max()))
    cycle, late_s, ring_left = np.array(rows).T
    return _with_rate(Delivered(played, cycle, late_s, ring_left, found[0].period_s))


def loud_samples(trace: Trace, min_g: float, low: int, high: int) -> NDArray[np.bool_]:
    """For each sample from ``low`` to ``high``: whether something new begins to ring there, or has just begun.

    :param trace: after one command.
    :param min_g: what is quieter than this is none, whatever came before.
    :param low: index of the first sample.
    :param high: index after the last sample.
    :return: one value for each sample (high - low,).
    """
    loudness = np.abs(trace.g)
    before_g = np.max([loudness[max(low - k, 0) : max(high - k, 0)] for k in _BEFORE], axis=0)
    return loudness[low:high] > np.maximum(max(LOUD_SDS * trace.noise_g, min_g), RINGS_ON * before_g)


def jitter(one: Delivered, others: Sequence[Delivered]) -> Quantity:
    """Unevenness of a train's landings beyond that of slow ones among ``others``, where only the timing of a landing scatters.

    :param one: the train to judge, with at least one degree of freedom.
    :param others: all trains, among them one of at most 20 Hz.
    :return: standard deviation of a landing, s.
    """
    slow = [other for other in others if other.played.train.rate_hz <= SLOW_HZ and other.freedom > 0]
    freedom = sum(other.freedom for other in slow)
    timing_s2 = sum(other.scatter_s2 * other.freedom for other in slow) / freedom
    alike_s2 = TIMED_ALIKE * one.period_s**2 / 12.0
    sd_s2 = math.hypot(one.scatter_s2 * math.sqrt(2.0 / one.freedom), timing_s2 * math.sqrt(2.0 / freedom), alike_s2)
    jitter_s2 = max(one.scatter_s2 - timing_s2, 0.0)
    jitter_s = math.sqrt(jitter_s2)
    return Quantity(jitter_s, sd_s2 / (2.0 * jitter_s) if jitter_s2 > sd_s2 else math.sqrt(sd_s2), "s")


def _window(trace: Trace, from_s: float, train: Train) -> tuple[int, int]:
    """Where one cycle's landing is looked for."""
    low, high = np.searchsorted(trace.after_s, (from_s, from_s + min(1.0 / train.rate_hz, 20e-3)))
    return int(low), int(high)


def _with_rate(found: Delivered) -> Delivered:
    """Spacing and scatter from the landings, if there are enough."""
    here = np.isfinite(found.late_s) & (found.cycle > 0)
    cycle, late_s = found.cycle[here], found.late_s[here]
    if len(late_s) < 4 or len(np.unique(cycle)) < 2:
        return found
    slope, height = np.polyfit(cycle, late_s, 1)
    freedom = len(late_s) - 2
    scatter_s2 = float(np.sum((late_s - height - slope * cycle) ** 2)) / freedom
    # Where sampling and train keep step, errors of one burst go along with one another, and scatter does not show them.
    steps_s2 = (IN_STEP**2 - 1.0) * found.period_s**2 / 12.0
    slope_sd_s = math.sqrt((scatter_s2 + steps_s2) / float(np.sum((cycle - cycle.mean()) ** 2)))
    spacing_s = 1.0 / found.played.train.rate_hz + float(slope)
    sd_s = quadrature((slope_sd_s, spacing_s * RATE_SD))
    return replace(found, spacing_s=Quantity(spacing_s, sd_s, "s"), scatter_s2=scatter_s2, freedom=freedom)


def _counter(bench: Bench) -> int:
    """Pulses that the board reports as played on the channel since power-on, modulo 65536."""
    return int(bench.telemetry[-1][1].played[bench.options.channel]) if bench.telemetry else 0


def whole_up_to(found: Sequence[Delivered]) -> Delivered | None:
    """The fastest train that came whole, all slower ones too; None if the slowest did not.

    :param found: trains in any order.
    :return: the fastest whole train below the first that was not.
    """
    best = None
    for one in sorted(found, key=lambda one: one.played.train.rate_hz):
        if not one.whole:
            break
        best = one
    return best

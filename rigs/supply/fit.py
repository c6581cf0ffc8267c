"""All stretches of a run put together: the supply, the output's capacitance, and their uncertainties.

Each gain of the probe is one number for a whole run, so its standard deviation is added after averages are taken. What the
probe itself takes from the output is known from its header, and taken out of every quantity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from haptics.errors import InputError
from rigs.fitting import Vector, noise_sd, quadrature
from rigs.instruments import Samples
from rigs.instruments.probe import CLOCK_SD, DIVIDER_SD, LOAD_SD, SHUNT_SD
from rigs.supply.curves import (
    Decay,
    Losses,
    Trace,
    crossing_s,
    cut,
    decay,
    half_periods,
    ramp,
    ramp_capacitance,
    rises,
    shorted_tail,
    supply_tail,
)
from rigs.supply.overlap import OverlapFit, fit_overlap

DISCHARGED_V = 60.0
_AFTER_NS = 10_000_000
_HOLD_S = 10e-3
"""After the ramp, before volts are taken for settled."""
# Student's t for 95 %, over 1.96, by degrees of freedom: a spread of few values is itself uncertain.
_STUDENT = {1: 6.48, 2: 2.20, 3: 1.62, 4: 1.42, 5: 1.31, 6: 1.25, 7: 1.21, 8: 1.18, 9: 1.15, 10: 1.14}


@dataclass(frozen=True)
class Phase:
    """A stretch of the run with volts on the output.

    :param kind: ``charge``, ``power`` or ``travel``.
    :param volts: commanded, V.
    :param frequency_hz: of the square wave, Hz.
    :param start_ns: on the bench's clock, ns.
    :param end_ns: on the bench's clock, ns.
    :param travel_m: travel of the stage, m.
    """

    kind: str
    volts: float
    frequency_hz: float
    start_ns: int
    end_ns: int
    travel_m: float = 0.0


@dataclass(frozen=True)
class PowerPoint:
    """Mean power at the supply's output under one square wave.

    :param phase: the stretch.
    :param power_w: mean of v i, W.
    :param sd_w: its standard deviation, W.
    """

    phase: Phase
    power_w: float
    sd_w: float
    steady_w: float
    """Charge of the half periods times the settled volts: of a supply that does not sag."""


def mean_of(values: Sequence[float] | Vector) -> tuple[float, float]:
    """Mean, and its standard deviation from the spread of the values; wide enough for few of them.

    :param values: at least 2.
    :return: mean and its standard deviation, in the unit of the values.
    :raises InputError: fewer than 2 values.
    """
    count = len(values)
    if count < 2:
        raise InputError(f"{count} values have no spread; at least 2 are needed")
    student = _STUDENT.get(count - 1, 1.0 + 1.4 / (count - 1))
    return float(np.mean(values)), student * float(np.std(values, ddof=1)) / math.sqrt(count)


class SupplyFit:
    """The evaluation of a run; each part is computed when it is first read.

    :param samples: of the probe.
    :param rest_ns: from when to when nothing was on.
    :param phases: in their order.
    :param load_ohm: of the probe.
    :param step: what a count is worth, V and A.
    :raises InputError: too little was recorded for a quantity.
    """

    def __init__(
        self, samples: Samples, rest_ns: tuple[int, int], phases: Sequence[Phase], load_ohm: float, step: tuple[float, float]
    ):
        self.phases = tuple(phases)
        self._samples, self.load_s = samples, 1.0 / load_ohm
        rest = cut(samples, *rest_ns, (0.0, 0.0))
        self.zero = (float(np.mean(rest.volts)), float(np.mean(rest.amps)))
        noises = (noise_sd(rest.volts), noise_sd(rest.amps))
        # Steps of the converter count as noise, and where noise is less than a step, they do not average out.
        self.noise_v, self.noise_a = (max(one, two / math.sqrt(12.0)) for one, two in zip(noises, step, strict=True))
        self._floor = tuple(
            quadrature((one / math.sqrt(len(rest.volts)), two / math.sqrt(12.0) if one < 0.4 * two else 0.0))
            for one, two in zip(noises, step, strict=True)
        )

    def trace(self, phase: Phase) -> Trace:
        """Samples of a phase, and of what follows it at once.

        :param phase: one of ``phases``.
        :return: its samples and 10 ms more.
        """
        return cut(self._samples, phase.start_ns, phase.end_ns + _AFTER_NS, self.zero)

    # One charge after the other.

    @cached_property
    def charges(self) -> list[Trace]:
        """From 0 V to the highest volts, held, and shorted."""
        return [self.trace(phase) for phase in self.phases if phase.kind == "charge"]

    @property
    def asked_v(self) -> float:
        """Commanded volts of the charges, V."""
        return next(phase.volts for phase in self.phases if phase.kind == "charge")

    def held(self, trace: Trace) -> slice:
        """Samples of a charge whose volts have settled.

        :param trace: of a charge.
        :return: range of samples.
        :raises InputError: fewer than 20.
        """
        height = trace.height
        high = 0.9 * float(np.percentile(height, 90))
        first, last = np.flatnonzero(height > high)[[0, -1]]
        start = int(np.searchsorted(trace.time_s, trace.time_s[first] + _HOLD_S))
        if last - start < 20:
            raise InputError(f"volts were held for {last - start} samples beyond {_HOLD_S * 1e3:g} ms; at least 20 are needed")
        return slice(start, int(last) - 2)

    @cached_property
    def settled_v(self) -> tuple[float, float]:
        """Volts of the output that charges settle at, and sd without the gain."""
        value, sd = mean_of([float(np.mean(one.height[self.held(one)])) for one in self.charges])
        return value, quadrature((sd, self._floor[0]))

    @cached_property
    def held_a(self) -> tuple[float, float]:
        """Current that the supply gives then, the probe's share included, and sd without the gain."""
        value, sd = mean_of([float(np.mean(one.amps[self.held(one)])) for one in self.charges])
        return value, quadrature((sd, self._floor[1]))

    @cached_property
    def limit_a(self) -> tuple[float, float]:
        """Current while it limits (5 to 60 % of the volts), and sd without the gain."""
        settled_v = self.settled_v[0]
        means: list[float] = []
        for one in self.charges:
            height = one.height[: self.held(one).start]
            means.append(float(np.mean(one.amps[: len(height)][(height > 0.05 * settled_v) & (height < 0.6 * settled_v)])))
        value, sd = mean_of(means)
        return value, quadrature((sd, self._floor[1]))

    @cached_property
    def supply_decay(self) -> Decay:
        """Time constant with which the current falls when the volts are reached: ``R C``."""
        tails: list[Vector] = []
        for one in self.charges:
            part = ramp(one, rises(one, self.settled_v[0])[0], self.settled_v[0])
            tails.append(supply_tail(one, part, self.limit_a[0], self.held_a[0]))
        return decay(tails, self._step_s, self.noise_a)

    @cached_property
    def discharge(self) -> Decay:
        """Time constant of the shorted output."""
        return decay([shorted_tail(one, self.settled_v[0]) for one in self.charges], self._step_s, self.noise_v)

    @cached_property
    def discharged_within_s(self) -> float:
        """From the last sample at full volts to the first below 60 V, the longest: no discharge took more."""
        spans: list[float] = []
        for one in self.charges:
            last = int(np.flatnonzero(one.height > 0.9 * self.settled_v[0])[-1])
            below = np.flatnonzero(one.height[last:] < DISCHARGED_V)
            spans.append(float(one.time_s[last + int(below[0])] - one.time_s[last]) if len(below) else math.inf)
        return max(spans)

    @property
    def _step_s(self) -> float:
        return float(np.median(self.charges[0].step_s))

    # What else draws current.

    @cached_property
    def losses(self) -> Losses:
        """Bleeder, probe, and the resistance before the output."""
        bleeder_s = max(self.held_a[0] / self.settled_v[0] - self.load_s, 0.0)
        rough = Losses(bleeder_s, self.load_s, 0.0)
        rough_f = self._ramp_capacitance(self.charges[0], self.settled_v[0], rough)[0]
        return Losses(bleeder_s, self.load_s, self.supply_decay.tau_s / rough_f)

    @property
    def output_ohm_sd(self) -> float:
        """Standard deviation of the output's resistance without gains, ohm."""
        return self.losses.output_ohm * self.supply_decay.sd_s / self.supply_decay.tau_s

    # Capacitance.

    def _ramp_capacitance(self, trace: Trace, settled_v: float, losses: Losses) -> tuple[float, float, float]:
        """Mean over the ramps of a trace, its sd, and the mean reduced chi squared."""
        found = [ramp_capacitance(trace, ramp(trace, k, settled_v), losses, self.noise_v) for k in rises(trace, settled_v)]
        values = [one[0] for one in found]
        value, sd = mean_of(values) if len(values) > 1 else (values[0], 0.0)
        return value, sd, float(np.mean([one[1] for one in found]))

    @cached_property
    def capacitance_f(self) -> tuple[float, float, float]:
        """At the output, stray included: value, sd without gains, reduced chi squared of volts against charge."""
        found = [self._ramp_capacitance(one, self.settled_v[0], self.losses) for one in self.charges]
        value, sd = mean_of([one[0] for one in found])
        # An offset of the current is charge as well.
        return value, quadrature((sd, value * self._floor[1] / self.limit_a[0])), float(np.mean([one[2] for one in found]))

    @cached_property
    def travelled(self) -> list[tuple[float, float, float]]:
        """Travel of the stage, capacitance, and its sd without gains, for each stop."""
        rows: list[tuple[float, float, float]] = []
        for phase in self.phases:
            if phase.kind == "travel":
                settled_v = phase.volts * self.settled_v[0] / self.asked_v
                value, sd, _ = self._ramp_capacitance(self.trace(phase), settled_v, self.losses)
                rows.append((phase.travel_m, value, sd))
        return rows

    @cached_property
    def overlap(self) -> OverlapFit | None:
        """Capacitance against travel, where there was a stage."""
        return fit_overlap(self.travelled) if len(self.travelled) >= 4 else None

    # Times and power.

    def start_s(self, trace: Trace) -> float:
        """When a charge began: its ramp carried back to 0 V.

        :param trace: of a charge.
        :return: time since the charge was commanded, s.
        """
        top_v = self.settled_v[0]
        return crossing_s(trace, self.held(trace).start, 0.0, (0.02 * top_v, 0.3 * top_v))

    def times_s(self) -> dict[str, tuple[float, float]]:
        """To 90 % of the volts (``t90``), and from 10 to 80 % (``ramp``), without a probe: value and sd.

        :return: ``t90`` and ``ramp``, each in s with its standard deviation.
        """
        top_v = self.settled_v[0]
        t90: list[float] = []
        between: list[float] = []
        for one in self.charges:
            end = self.held(one).start
            spans = ((0.1, (0.02, 0.26)), (0.8, (0.68, 0.92)), (0.9, (0.8, 0.97)))
            t10, t80, at90 = (crossing_s(one, end, s * top_v, (low * top_v, high * top_v)) for s, (low, high) in spans)
            t90.append(at90 - self.start_s(one))
            between.append(t80 - t10)
        # The mean volts are 45 % of the settled ones in both spans; so much of the current goes into the probe.
        probe = 0.45 * top_v * self.load_s / self.limit_a[0]
        return {
            name: (value * (1.0 - probe), quadrature((sd, value * CLOCK_SD, value * probe * LOAD_SD)))
            for name, (value, sd) in (("t90", mean_of(t90)), ("ramp", mean_of(between)))
        }

    @cached_property
    def powers(self) -> list[PowerPoint]:
        """One for each square wave."""
        return [self._power(phase) for phase in self.phases if phase.kind == "power"]

    def _power(self, phase: Phase) -> PowerPoint:
        trace, settled_v = self.trace(phase), phase.volts * self.settled_v[0] / self.asked_v
        seconds, joules, coulombs = half_periods(trace, settled_v, self.limit_a[0], self.losses)
        energy_j, sd_j = mean_of(joules)
        half_s, charge_c = float(np.mean(seconds)), float(np.mean(coulombs))
        power_w = energy_j / half_s
        mean_square = float(np.mean(trace.amps**2))
        sd_w = quadrature(
            (
                sd_j / half_s,
                power_w * DIVIDER_SD,
                power_w * SHUNT_SD,
                self.output_ohm_sd * mean_square,
                settled_v**2 * self.load_s * LOAD_SD,
                self._floor[0] * charge_c / half_s,
                self._floor[1] * settled_v,
            )
        )
        return PowerPoint(phase, power_w, sd_w, settled_v * charge_c / half_s)

"""Pulls evaluated: slack, rise, plateau and capacity against volts, and the threshold law behind the capacities.

::

    rise       T = k_s (x - slack)                            x: way of the stage
    slip       s = x - slack - T / k_s
    capacity   T = F_off + k (V^2 - V0^2) (1 - a s + a l (1 - exp(-s / l)))
    plateau    mean of T over each whole period of the drive = P (1 - a' s)

``a`` is the overlap lost a metre; ``l`` is the way that strips slide within the contact's release lag, by which a falling
capacity stays behind. The stage's way is known from its speed and from when its move was sent, less a delay: assumed for the slow
pulls, and for the fast ones found from their own rises.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from rigs.fitting import Fit, Vector, least_squares_fit, quadrature
from rigs.instruments import Samples
from rigs.instruments.loadcell import GAIN_SD
from rigs.instruments.stage import DELAY_S, DELAY_SD_S, POSITION_GAIN_SD
from rigs.result import Quantity

TOP_V = 1500.0
PERIOD_S = 0.1
"""Of the drive in the published pull."""
_RISE = (0.1, 0.75)
"""Shares of the plateau between which the rise is straight: below, the first touch; above, the dips cut it."""
_STRONG_N = 1.0
_SLID_M = 50e-6
"""Slip from which on a sample counts as sliding."""
_END_M = 0.5e-3
"""Before the end of its way the stage brakes."""
_RAMP_S = 0.1
"""After the beginning of its way the stage has its speed."""
_LEAST_PERIODS = 3


@dataclass(frozen=True)
class OnePull:
    """One pull: rest from ``rest_ns``, move sent at ``moved_ns``, to be used until ``until_ns`` (bench's clock)."""

    volts: float
    slow: bool
    speed_m_s: float
    rest_ns: int
    moved_ns: int
    until_ns: int


@dataclass(frozen=True)
class PullRecord:
    """All pulls of one brake and the force while they ran; the stage went home after each."""

    force: Samples
    pulls: tuple[OnePull, ...]
    end_ns: int
    way_m: float
    capacitance_f: float

    @property
    def rate_hz(self) -> float:
        """Samples a second."""
        return (len(self.force.time_s) - 1) / float(self.force.time_s[-1] - self.force.time_s[0])

    def raw(self, from_ns: int, to_ns: int) -> tuple[Vector, Vector]:
        """Seconds since ``from_ns`` and force as read, until ``to_ns``."""
        since_s = self.force.since(from_ns)
        here = (since_s >= 0.0) & (since_s < (to_ns - from_ns) / 1e9)
        return since_s[here], self.force.column()[here]

    def rest_force_n(self) -> Vector:
        """Force as read in the first rest, which is the longest."""
        first = self.pulls[0]
        return self.raw(first.rest_ns, first.moved_ns)[1]

    @cached_property
    def _zeros(self) -> tuple[Vector, Vector]:
        """When the strips hung loose, and what was read then: the middle of each rest and its mean."""
        starts = [one.rest_ns for one in self.pulls]
        spans = [(one.rest_ns, one.moved_ns) for one in self.pulls]
        spans.append((self.end_ns - (self.pulls[0].moved_ns - starts[0]), self.end_ns))
        at_s = [((low + high) / 2 - starts[0]) / 1e9 for low, high in spans]
        return np.array(at_s), np.array([self.raw(low, high)[1].mean() for low, high in spans])

    def of(self, pull: OnePull) -> tuple[Vector, Vector]:
        """Seconds since its move was sent, and force less the zero, which is taken from the rests before and after."""
        seconds, force_n = self.raw(pull.moved_ns, pull.until_ns)
        at_s, zero_n = self._zeros
        later_s = (pull.moved_ns - self.pulls[0].rest_ns) / 1e9
        return seconds, force_n - np.interp(seconds + later_s, at_s, zero_n)


@dataclass(frozen=True)
class Rise:
    """Slack and stiffness of what is pulled, with what the samples' noise makes of them."""

    slack_m: float
    stiffness_n_m: float
    slack_sd_m: float
    stiffness_sd_n_m: float


@dataclass(frozen=True)
class Plateau:
    """Mean tension of one slow pull at no slip yet, its loss over a metre of slip as a share, ripple and peak."""

    volts: float
    force_n: float
    sd_n: float
    slope_per_m: float
    ripple_n: float
    peak_n: float
    slid_m: float


@dataclass(frozen=True)
class Sliding:
    """Samples of one fast pull while the strips slid."""

    volts: float
    slip_m: Vector
    force_n: Vector


@dataclass(frozen=True)
class PullFit:
    """All that the pulls say. ``law``: ``k_n_kv2, threshold_kv, slope_per_mm, lag_mm`` fitted to the sliding samples; in these
    units all parameters are numbers of like size.
    """

    rise: Rise
    plateaus: tuple[Plateau, ...]
    sliding: tuple[Sliding, ...]
    law: Fit
    off_n: float
    off_sd_n: float
    zero_sd_n: float
    """Of the zero of one fast pull."""

    @property
    def k_n_v2(self) -> float:
        """N/V^2."""
        return 1e-6 * self.law.value("k_n_kv2")

    @property
    def threshold_v(self) -> float:
        """V."""
        return 1e3 * self.law.value("threshold_kv")

    def capacity_n(self, volts: float) -> float:
        """Of the whole overlap, by the law."""
        return self.off_n + self.k_n_v2 * max(0.0, volts**2 - self.threshold_v**2)

    def capacity_sd_n(self, volts: float) -> float:
        """Of ``capacity_n``, the load cell's gain included."""
        k, threshold_kv, kilovolts = self.law.value("k_n_kv2"), self.law.value("threshold_kv"), 1e-3 * volts
        of_fit = self.law.sd_of({"k_n_kv2": kilovolts**2 - threshold_kv**2, "threshold_kv": -2.0 * k * threshold_kv})
        return quadrature((of_fit, self.off_sd_n, GAIN_SD * self.capacity_n(volts)))

    @property
    def threshold_sd_v(self) -> float:
        """Of the fit, and of zeros a little off, which the weakest pull takes for force."""
        return quadrature((1e3 * self.law.sd("threshold_kv"), self.zero_sd_n / (2.0 * self.k_n_v2 * self.threshold_v)))

    @property
    def misfit_share(self) -> float:
        """Root mean square of the residuals over the capacity at the top volts."""
        return float(np.sqrt(np.mean(self.law.residuals**2))) / self.capacity_n(TOP_V)

    @property
    def slid_m(self) -> float:
        """How far the strips slid in the published pull at the top volts."""
        return self.plateaus[-1].slid_m

    def plateau_law(self) -> Fit:
        """The threshold law through the plateaus, each weighted with 1 %: what a fit to a published pull gives."""
        kilovolts = 1e-3 * np.array([one.volts for one in self.plateaus])
        force_n = np.array([one.force_n for one in self.plateaus])
        return least_squares_fit(
            lambda values: self.off_n + values[0] * (kilovolts**2 - values[1] ** 2),
            force_n,
            0.01 * force_n,
            {"k_n_kv2": self.law.value("k_n_kv2"), "threshold_kv": self.law.value("threshold_kv")},
        )

    def quantities(self) -> dict[str, Quantity]:
        """What the rig is for."""
        law, rise, top = self.law, self.rise, self.plateaus[-1]
        k, slope = self.k_n_v2, 1e3 * law.value("slope_per_mm")
        return {
            "k_n_v2": Quantity(k, quadrature((1e-6 * law.sd("k_n_kv2"), GAIN_SD * k)), "N/V^2"),
            "threshold_v": Quantity(self.threshold_v, self.threshold_sd_v, "V"),
            "capacity_1500_n": Quantity(self.capacity_n(TOP_V), self.capacity_sd_n(TOP_V), "N"),
            "plateau_1500_n": Quantity(top.force_n, quadrature((top.sd_n, GAIN_SD * top.force_n)), "N"),
            "off_force_n": Quantity(self.off_n, quadrature((self.off_sd_n, GAIN_SD * self.off_n)), "N"),
            "slack_m": Quantity(rise.slack_m, rise.slack_sd_m, "m"),
            "stiffness_n_m": Quantity(rise.stiffness_n_m, rise.stiffness_sd_n_m, "N/m"),
            "overlap_slope_per_m": Quantity(slope, quadrature((1e3 * law.sd("slope_per_mm"), POSITION_GAIN_SD * slope)), "1/m"),
        }

    def levels(self) -> list[dict[str, Any]]:
        """What was seen at each voltage, as plain data."""
        return [
            {
                "volts": one.volts,
                "capacity_n": self.capacity_n(one.volts),
                "plateau_n": one.force_n,
                "plateau_sd_n": one.sd_n,
                "ripple_n": one.ripple_n,
                "peak_n": one.peak_n,
            }
            for one in self.plateaus
        ]

    def notes(self) -> tuple[str, ...]:
        """What a reader should know."""
        top, through = self.plateaus[-1], self.plateau_law()
        capacity_n = self.capacity_n(TOP_V)
        return (
            "k and V0 are of the capacity: what the brake holds while its volts stand still, at the overlap it began with and "
            "the volts asked for.",
            f"At 1500 V the plateau of the published pull (1 mm/s, 10 Hz) is {top.force_n:.2f} N, "
            f"{100 * (1 - top.force_n / capacity_n):.0f} % below the capacity of {capacity_n:.2f} N: the dips at reversals. "
            f"Through the plateaus the same law has k {1e-6 * through.value('k_n_kv2'):.3g} N/V^2 and "
            f"V0 {1e3 * through.value('threshold_kv'):.0f} V.",
        )


def fit_pulls(record: PullRecord, noise_n: float) -> PullFit:
    """Evaluate all pulls. :param noise_n: standard deviation of one sample.

    :raises InputError: too little slides to fit.
    """
    slow = [one for one in record.pulls if one.slow and one.volts]
    fast = [one for one in record.pulls if not one.slow]
    off = next(one for one in record.pulls if not one.volts)
    rise = fit_rise(record, slow, noise_n)
    plateaus = tuple(plateau(record, one, rise) for one in slow)
    sliding = sliding_parts(record, fast, rise)
    off_n, off_sd_n = off_force(record, off, rise, noise_n)
    rest = min(len(record.raw(one.rest_ns, one.moved_ns)[1]) for one in fast)
    zero_sd_n = quadrature((noise_n / (2 * rest) ** 0.5, off_sd_n))
    return PullFit(rise, plateaus, sliding, fit_law(sliding, off_n, noise_n), off_n, off_sd_n, zero_sd_n)


def fit_rise(record: PullRecord, slow: Sequence[OnePull], noise_n: float) -> Rise:
    """One straight line through the rises of all slow pulls."""
    ways: list[Vector] = []
    forces: list[Vector] = []
    for one in slow:
        seconds, force_n = record.of(one)
        held_n = float(np.median(force_n[-len(force_n) // 5 :]))
        if held_n * (_RISE[1] - _RISE[0]) < 20.0 * noise_n:
            continue
        begin = int(np.argmax(force_n > _RISE[0] * held_n))
        end = int(np.argmax(force_n > _RISE[1] * held_n))
        ways.append(one.speed_m_s * (seconds[begin:end] - DELAY_S))
        forces.append(force_n[begin:end])
    way_m, force_n = np.concatenate(ways), np.concatenate(forces)
    mean_m, mean_n = float(way_m.mean()), float(force_n.mean())
    spread_m2 = float(np.sum((way_m - mean_m) ** 2))
    stiffness = float((way_m - mean_m) @ force_n) / spread_m2
    slack_m = mean_m - mean_n / stiffness
    of_noise = noise_n / np.sqrt(spread_m2)
    slack_noise_m = float(np.hypot(noise_n / np.sqrt(len(way_m)), of_noise * (mean_m - slack_m))) / stiffness
    return Rise(
        slack_m,
        stiffness,
        quadrature((slack_noise_m, DELAY_SD_S * slow[0].speed_m_s, POSITION_GAIN_SD * slack_m)),
        quadrature((float(of_noise), stiffness * GAIN_SD, stiffness * POSITION_GAIN_SD)),
    )


def plateau(record: PullRecord, pull: OnePull, rise: Rise) -> Plateau:
    """Means over whole periods from one period after sliding began, and a straight line through them back to no slip.

    :raises InputError: fewer than three periods of sliding.
    """
    seconds, force_n = record.of(pull)
    way_m = pull.speed_m_s * (seconds - DELAY_S)
    held_n = float(np.median(force_n[-len(force_n) // 5 :]))
    begin_s = (rise.slack_m + held_n / rise.stiffness_n_m) / pull.speed_m_s + DELAY_S + PERIOD_S
    end_s = record.way_m / pull.speed_m_s
    periods = int((end_s - begin_s) / PERIOD_S)
    if periods < _LEAST_PERIODS:
        return Plateau(pull.volts, held_n, held_n, 0.0, 0.0, float(force_n.max()), 0.0)
    edges = np.searchsorted(seconds, begin_s + PERIOD_S * np.arange(periods + 1))
    parts = [slice(low, high) for low, high in pairwise(edges)]
    mean_n = np.array([force_n[part].mean() for part in parts])
    slip_m = np.array([way_m[part].mean() for part in parts]) - rise.slack_m - mean_n / rise.stiffness_n_m
    (slope, at_none_n), covariance = np.polyfit(slip_m, mean_n, 1, cov=True)
    ripple_n = float(np.median([np.ptp(force_n[part]) for part in parts]))
    peak_n = float(force_n.max())
    sd_n = float(np.sqrt(covariance[1, 1]))
    return Plateau(pull.volts, float(at_none_n), sd_n, -float(slope / at_none_n), ripple_n, peak_n, float(slip_m[-1]))


def sliding_parts(record: PullRecord, fast: Sequence[OnePull], rise: Rise) -> tuple[Sliding, ...]:
    """What slid in the fast pulls. Their common delay comes from the rises of those that are strong enough."""
    stiffness, slack_m = rise.stiffness_n_m, rise.slack_m
    delays_s: list[float] = []
    for one in fast:
        seconds, force_n = record.of(one)
        most_n = float(force_n.max())
        if most_n > _STRONG_N:
            rising = (seconds < seconds[int(np.argmax(force_n))]) & (force_n > 0.3 * most_n) & (force_n < _RISE[1] * most_n)
            way_m = slack_m + force_n[rising] / stiffness
            delays_s.append(float(np.mean(seconds[rising] - way_m / one.speed_m_s)))
    delay_s = float(np.median(delays_s))
    parts: list[Sliding] = []
    for one in fast:
        seconds, force_n = record.of(one)
        way_m = one.speed_m_s * (seconds - delay_s)
        slip_m = way_m - slack_m - force_n / stiffness
        slides = (slip_m > _SLID_M) & (seconds > _RAMP_S) & (way_m < record.way_m - _END_M)
        parts.append(Sliding(one.volts, slip_m[slides], force_n[slides]))
    return tuple(parts)


def fit_law(sliding: Sequence[Sliding], off_n: float, noise_n: float) -> Fit:
    """The threshold law, with overlap lost and the contact's lag, through all samples that slid.

    :raises InputError: too few of them.
    """
    kilovolts = np.concatenate([np.full(len(one.slip_m), 1e-3 * one.volts) for one in sliding])
    slip_mm = np.concatenate([1e3 * one.slip_m for one in sliding])
    force_n = np.concatenate([one.force_n for one in sliding])

    def model(values: Vector) -> Vector:
        k, threshold_kv, slope, lag_mm = values
        left = 1.0 - slope * (slip_mm + lag_mm * np.expm1(-slip_mm / lag_mm))
        return off_n + k * (kilovolts**2 - threshold_kv**2) * left

    return least_squares_fit(
        model,
        force_n,
        noise_n,
        {"k_n_kv2": 10.0, "threshold_kv": 0.15, "slope_per_mm": 9e-3, "lag_mm": 0.4},
        bounds={"lag_mm": (1e-3, 5.0), "threshold_kv": (0.0, 1.0)},
    )


def off_force(record: PullRecord, off: OnePull, rise: Rise, noise_n: float) -> tuple[float, float]:
    """Mean force of the pull without volts once the strips slide, and its standard deviation."""
    seconds, force_n = record.of(off)
    from_s = (rise.slack_m + _END_M) / off.speed_m_s
    here = force_n[(seconds > from_s) & (seconds < record.way_m / off.speed_m_s)]
    rest = len(record.rest_force_n())
    # The zero at the pull's ends comes from rests of finite length: two of them, half the weight each.
    return float(here.mean()), quadrature((noise_n / len(here) ** 0.5, noise_n / (2 * rest) ** 0.5))

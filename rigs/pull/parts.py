"""One pull taken apart: rise, plateau, sliding part, and the force that is left without volts.

::

    rise       T = k_s (x - slack)          x: travel of the stage
    slip       s = x - slack - T / k_s
    plateau    mean of T over each whole period of the drive = P (1 - a' s)

The stage's travel is known from its speed and from when its move was sent, less a delay: assumed for the slow pulls, and for the
fast ones found from their own rises.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rigs.fitting import Vector, quadrature
from rigs.instruments.loadcell import GAIN_SD
from rigs.instruments.stage import DELAY_S, DELAY_SD_S, POSITION_GAIN_SD
from rigs.pull.record import OnePull, PullRecord

PERIOD_S = 0.1
"""Of the drive in the published pull."""
_RISE = (0.1, 0.75)
"""Shares of the plateau between which the rise is straight: below, the first touch; above, the dips cut it."""
_STRONG_N = 1.0
_SLID_M = 50e-6
"""Slip from which on a sample counts as sliding."""
_END_M = 0.5e-3
"""So far before the end of its travel the stage brakes."""
_RAMP_S = 0.1
"""So long after it started the stage has reached its speed."""
_MIN_PERIODS = 3


@dataclass(frozen=True)
class Rise:
    """Slack and stiffness of what is pulled; the standard deviations come from the samples' noise and the stage's gains.

    :param slack_m: travel before the strips are taut, m.
    :param stiffness_n_m: of strips and frame in series, N/m.
    :param slack_sd_m: standard deviation, m.
    :param stiffness_sd_n_m: standard deviation, N/m.
    """

    slack_m: float
    stiffness_n_m: float
    slack_sd_m: float
    stiffness_sd_n_m: float


@dataclass(frozen=True)
class Plateau:
    """Mean tension of one slow pull.

    :param volts: amplitude, V.
    :param force_n: extrapolated to no slip, N.
    :param sd_n: its standard deviation, N.
    :param slope_per_m: loss over a metre of slip, as a share, 1/m.
    :param ripple_n: median over the periods of maximum less minimum, N.
    :param peak_n: maximum force of the pull, N.
    :param slid_m: slip at the end, m; 0 if the strips slid for fewer than three periods.
    """

    volts: float
    force_n: float
    sd_n: float
    slope_per_m: float
    ripple_n: float
    peak_n: float
    slid_m: float


@dataclass(frozen=True)
class Sliding:
    """Samples of one fast pull while the strips slid.

    :param volts: amplitude, V.
    :param slip_m: of the strips (n,), m.
    :param force_n: (n,), N.
    """

    volts: float
    taut_m: Vector
    """Travel of the stage since the strips were taut (n,), m."""
    slip_m: Vector
    force_n: Vector


def fit_rise(record: PullRecord, slow: Sequence[OnePull], noise_n: float) -> Rise:
    """One straight line through the rises of all slow pulls.

    :param record: of a whole run.
    :param slow: slow pulls with volts on.
    :param noise_n: standard deviation of one sample, N.
    :return: slack and stiffness.
    """
    travels: list[Vector] = []
    forces: list[Vector] = []
    for one in slow:
        seconds, force_n = record.of(one)
        held_n = float(np.median(force_n[-len(force_n) // 5 :]))
        if held_n * (_RISE[1] - _RISE[0]) < 20.0 * noise_n:
            continue
        begin = int(np.argmax(force_n > _RISE[0] * held_n))
        end = int(np.argmax(force_n > _RISE[1] * held_n))
        travels.append(one.speed_m_s * (seconds[begin:end] - DELAY_S))
        forces.append(force_n[begin:end])
    travel_m, force_n = np.concatenate(travels), np.concatenate(forces)
    mean_m, mean_n = float(travel_m.mean()), float(force_n.mean())
    spread_m2 = float(np.sum((travel_m - mean_m) ** 2))
    stiffness = float((travel_m - mean_m) @ force_n) / spread_m2
    slack_m = mean_m - mean_n / stiffness
    of_noise = noise_n / np.sqrt(spread_m2)
    slack_noise_m = float(np.hypot(noise_n / np.sqrt(len(travel_m)), of_noise * (mean_m - slack_m))) / stiffness
    return Rise(
        slack_m,
        stiffness,
        quadrature((slack_noise_m, DELAY_SD_S * slow[0].speed_m_s, POSITION_GAIN_SD * slack_m)),
        quadrature((float(of_noise), stiffness * GAIN_SD, stiffness * POSITION_GAIN_SD)),
    )


def plateau(record: PullRecord, pull: OnePull, rise: Rise) -> Plateau:
    """Means over whole periods from one period after sliding began, and a straight line through them back to no slip.

    :param record: of a whole run.
    :param pull: slow one with volts on.
    :param rise: slack and stiffness.
    :return: of a pull with fewer than three periods of sliding, the median force with itself as standard deviation.
    """
    seconds, force_n = record.of(pull)
    travel_m = pull.speed_m_s * (seconds - DELAY_S)
    held_n = float(np.median(force_n[-len(force_n) // 5 :]))
    begin_s = (rise.slack_m + held_n / rise.stiffness_n_m) / pull.speed_m_s + DELAY_S + PERIOD_S
    end_s = record.travel_m / pull.speed_m_s
    periods = int((end_s - begin_s) / PERIOD_S)
    if periods < _MIN_PERIODS:
        return Plateau(pull.volts, held_n, held_n, 0.0, 0.0, float(force_n.max()), 0.0)
    edges = np.searchsorted(seconds, begin_s + PERIOD_S * np.arange(periods + 1))
    parts = [slice(low, high) for low, high in pairwise(edges)]
    mean_n = np.array([force_n[part].mean() for part in parts])
    slip_m = np.array([travel_m[part].mean() for part in parts]) - rise.slack_m - mean_n / rise.stiffness_n_m
    (slope, at_none_n), covariance = np.polyfit(slip_m, mean_n, 1, cov=True)
    ripple_n = float(np.median([np.ptp(force_n[part]) for part in parts]))
    peak_n = float(force_n.max())
    sd_n = float(np.sqrt(covariance[1, 1]))
    return Plateau(pull.volts, float(at_none_n), sd_n, -float(slope / at_none_n), ripple_n, peak_n, float(slip_m[-1]))


def sliding_parts(record: PullRecord, fast: Sequence[OnePull], rise: Rise) -> tuple[Sliding, ...]:
    """What slid in the fast pulls. Their common delay comes from the rises of those that are strong enough.

    :param record: of a whole run.
    :param fast: fast pulls, one of them above 1 N.
    :param rise: slack and stiffness.
    :return: one for each fast pull.
    """
    stiffness, slack_m = rise.stiffness_n_m, rise.slack_m
    delays_s: list[float] = []
    for one in fast:
        seconds, force_n = record.of(one)
        max_n = float(force_n.max())
        if max_n > _STRONG_N:
            rising = (seconds < seconds[int(np.argmax(force_n))]) & (force_n > 0.3 * max_n) & (force_n < _RISE[1] * max_n)
            travel_m = slack_m + force_n[rising] / stiffness
            delays_s.append(float(np.mean(seconds[rising] - travel_m / one.speed_m_s)))
    delay_s = float(np.median(delays_s))
    parts: list[Sliding] = []
    for one in fast:
        seconds, force_n = record.of(one)
        travel_m = one.speed_m_s * (seconds - delay_s)
        taut_m = travel_m - slack_m
        slip_m = taut_m - force_n / stiffness
        slides = (slip_m > _SLID_M) & (seconds > _RAMP_S) & (travel_m < record.travel_m - _END_M)
        parts.append(Sliding(one.volts, taut_m[slides], slip_m[slides], force_n[slides]))
    return tuple(parts)


def off_force(record: PullRecord, off: OnePull, rise: Rise, noise_n: float) -> tuple[float, float]:
    """Mean force of the pull without volts once the strips slide, and its standard deviation.

    :param record: of a whole run.
    :param off: the pull without volts.
    :param rise: slack and stiffness.
    :param noise_n: standard deviation of one sample, N.
    :return: mean and standard deviation, N.
    """
    seconds, force_n = record.of(off)
    from_s = (rise.slack_m + _END_M) / off.speed_m_s
    slides = (seconds > from_s) & (seconds < record.travel_m / off.speed_m_s)
    zero_sd_n = record.zero_sd_n(off, noise_n, float(seconds[slides].mean()))
    return float(force_n[slides].mean()), quadrature((noise_n / slides.sum() ** 0.5, zero_sd_n))

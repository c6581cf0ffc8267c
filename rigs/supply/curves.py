"""What one stretch of probe samples shows: ramps, times, charges, decays, energy of half periods.

Volts and currents here are what the probe reports, its offsets taken off. The current of a sample is the mean since the sample
before, so that sums over samples are charge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from haptics.errors import InputError
from rigs.fitting import Vector
from rigs.instruments import Samples

_RAMP = (0.05, 0.95)
_TAIL_SAMPLES = 12
_LIMITED = 0.985
"""Share of the limiting current below which the supply has stopped to limit."""
_CLAMPED = (0.9, 0.5)
"""Bridge shorted, most of an interval at least: volts and current below these shares of the settled volts and the limit."""
_UNSEEN = 0.2
"""Time constant over spacing of samples; of several exponentials, each met at another phase, one would show if it were longer."""


@dataclass(frozen=True)
class Trace:
    """Samples of one stretch of a run, offsets taken off.

    :param time_s: since the stretch was commanded (n,), s.
    :param volts: signed (n,), V.
    :param amps: mean current of the supply since the sample before (n,), A.
    :param step_s: since the sample before (n,), s.
    """

    time_s: Vector
    volts: Vector
    amps: Vector
    step_s: Vector

    @property
    def height(self) -> Vector:
        """Magnitude of the volts."""
        return np.abs(self.volts)

    @property
    def middle(self) -> Vector:
        """Magnitude of the volts half way between a sample and the one before (n,)."""
        before = np.concatenate([self.volts[:1], self.volts[:-1]])
        return np.abs(0.5 * (self.volts + before))


@dataclass(frozen=True)
class Losses:
    """What draws current beside the output's capacitance.

    :param bleeder_s: conductance of the supply's bleeder, S.
    :param probe_s: conductance of the probe, S.
    :param output_ohm: resistance between supply and output, ohm.
    """

    bleeder_s: float
    probe_s: float
    output_ohm: float

    def bridge_a(self, trace: Trace) -> Vector:
        """Current into the bridge while it charges: the supply's less its bleeder's, which sees ``R i`` more than the output.

        :param trace: of one stretch.
        :return: (n,), A.
        """
        return (trace.amps - self.bleeder_s * trace.middle) / (1.0 + self.bleeder_s * self.output_ohm)


@dataclass(frozen=True)
class Decay:
    """A time constant from ratios of successive samples.

    :param tau_s: time constant, s; if not resolved, the middle of 0 to its upper bound.
    :param sd_s: its standard deviation, s.
    :param resolved: False: only that it lies within 0 to 2 ``tau_s``.
    """

    tau_s: float
    sd_s: float
    resolved: bool


def cut(samples: Samples, start_ns: int, end_ns: int, zero: tuple[float, float]) -> Trace:
    """Samples from ``start_ns`` to ``end_ns``, offsets ``zero`` (V, A) taken off.

    :param samples: of the probe, V and A.
    :param start_ns: on the bench's clock, ns.
    :param end_ns: on the bench's clock, ns.
    :param zero: offsets, V and A.
    :return: at least 20 samples, times from ``start_ns``.
    :raises InputError: next to none.
    """
    seconds = samples.since(start_ns)
    low, high = np.searchsorted(seconds, [0.0, (end_ns - start_ns) / 1e9])
    if high - low < 20:
        raise InputError(f"{high - low} samples in {(end_ns - start_ns) / 1e9:.3g} s; at least 20 are needed")
    part = slice(int(low), int(high))
    time_s = seconds[part]
    return Trace(
        time_s,
        samples.column(0)[part] - zero[0],
        samples.column(1)[part] - zero[1],
        np.diff(time_s, prepend=time_s[0] * 2 - time_s[1]),
    )


def rises(trace: Trace, settled_v: float) -> list[int]:
    """First sample of each rise above half of the settled volts, of either sign.

    :param trace: of one stretch.
    :param settled_v: volts that charges settle at, V.
    :return: indices of samples.
    """
    above = trace.height >= 0.5 * settled_v
    return [int(k) + 1 for k in np.flatnonzero(above[1:] & ~above[:-1])]


def ramp(trace: Trace, rise: int, settled_v: float) -> slice:
    """Samples of the ramp around a rise, from 5 % to 95 % of the settled volts.

    :param trace: of one stretch.
    :param rise: index of a sample within the ramp.
    :param settled_v: volts that charges settle at, V.
    :return: range of samples.
    """
    inside = (trace.height > _RAMP[0] * settled_v) & (trace.height < _RAMP[1] * settled_v)
    low = high = rise
    while low > 0 and inside[low - 1]:
        low -= 1
    while high < len(inside) and inside[high]:
        high += 1
    return slice(low, high)


def ramp_capacitance(trace: Trace, part: slice, losses: Losses, noise_v: float) -> tuple[float, float]:
    """Capacitance as the inverse slope of volts against charge over a ramp; and the reduced chi squared of that straight line.

    The charge is the current summed over the ramp, less what bridge and probe take of it; the current need not be constant.

    :param trace: of one stretch.
    :param part: samples of the ramp, at least 5.
    :param losses: currents that do not charge the output.
    :param noise_v: standard deviation of one sample of the volts, V, above 0.
    :return: capacitance (F), and reduced chi squared: about 1 where noise alone keeps the samples off the line.
    :raises InputError: fewer than 5 samples.
    """
    count = part.stop - part.start
    if count < 5:
        raise InputError(f"a ramp of {count} samples has no slope; at least 5 are needed")
    into_a = losses.bridge_a(trace) - losses.probe_s * trace.middle
    charge_c = np.cumsum((into_a * trace.step_s)[part])
    scale_c = float(charge_c[-1]) or 1.0
    slope, start = np.polyfit(charge_c / scale_c, trace.height[part], 1)
    misfit = trace.height[part] - slope * charge_c / scale_c - start
    return scale_c / float(slope), float(np.sum(misfit**2)) / (count - 2) / noise_v**2


def crossing_s(trace: Trace, end: int, level_v: float, window_v: tuple[float, float]) -> float:
    """When the first ``end`` samples pass ``level_v``: a parabola through those with volts in ``window_v``.

    :param trace: of one stretch.
    :param end: samples to look at.
    :param level_v: volts to find, V.
    :param window_v: lower and upper end of the volts that the parabola goes through, V.
    :return: time since the stretch was commanded, s.
    :raises InputError: fewer than 3 samples there.
    """
    chosen = np.flatnonzero((trace.height[:end] > window_v[0]) & (trace.height[:end] < window_v[1]))
    if len(chosen) < 3:
        raise InputError(f"{len(chosen)} samples between {window_v[0]:.0f} and {window_v[1]:.0f} V; at least 3 are needed")
    scale_v = window_v[1]
    bend = np.polyfit(trace.height[chosen] / scale_v, trace.time_s[chosen], 2)
    return float(np.polyval(bend, level_v / scale_v))


def supply_tail(trace: Trace, part: slice, limit_a: float, hold_a: float) -> Vector:
    """Currents beyond ``hold_a`` once the supply stopped to limit, whole intervals only.

    :param trace: of one charge.
    :param part: samples of its ramp.
    :param limit_a: limiting current, A.
    :param hold_a: current once the volts have settled, A.
    :return: at most 12 currents, A.
    """
    after = np.flatnonzero(trace.amps[part.stop - 1 :] < _LIMITED * limit_a)
    if not len(after):
        return np.zeros(0)
    first = part.stop + int(after[0])  # the interval in which it stopped is the one before
    return trace.amps[first : first + _TAIL_SAMPLES] - hold_a


def shorted_tail(trace: Trace, settled_v: float) -> Vector:
    """Volts after the output was shorted, from the first below 90 %.

    :param trace: of one charge.
    :param settled_v: volts that charges settle at, V.
    :return: at most 12 volts, positive.
    """
    last = int(np.flatnonzero(trace.height > 0.9 * settled_v)[-1])
    return trace.volts[last + 1 : last + 1 + _TAIL_SAMPLES] * np.sign(trace.volts[last])


def decay(tails: list[Vector], step_s: float, noise: float) -> Decay:
    """Time constant of exponentials sampled each ``step_s``: the ratio of successive samples, by least squares.

    :param tails: samples of each exponential (m,).
    :param step_s: between samples, s.
    :param noise: standard deviation of one sample, in the unit of the tails.
    :return: the time constant, or a bound.
    """
    before = np.concatenate([tail[:-1] for tail in tails])
    after = np.concatenate([tail[1:] for tail in tails])
    telling = before > 10.0 * noise  # the noise of the sample before is no matter then
    weight = float(np.sum(before[telling] ** 2))
    if weight == 0.0:
        return Decay(0.5 * _UNSEEN * step_s, _UNSEEN * step_s / math.sqrt(12.0), False)
    ratio = min(float(np.sum(before[telling] * after[telling])) / weight, 0.999)
    sd = noise * math.sqrt((1.0 + ratio**2) / weight)
    if ratio > 5.0 * sd:
        tau_s = -step_s / math.log(ratio)
        return Decay(tau_s, tau_s**2 / step_s * sd / ratio, True)
    max_s = -step_s / math.log(min(max(ratio, 0.0) + 2.0 * sd, 0.999))
    return Decay(0.5 * max_s, max_s / math.sqrt(12.0), False)


def half_periods(trace: Trace, settled_v: float, limit_a: float, losses: Losses) -> tuple[Vector, Vector, Vector]:
    """Seconds, joules and coulombs of each half period (m,) in steady state, at the supply's output; the probe's own left out.

    Volts there are the output's and what falls off in between; while the bridge is shorted, the settled ones.

    :param trace: of one square wave.
    :param settled_v: volts that charges settle at, V.
    :param limit_a: limiting current, A.
    :param losses: what draws current beside the output.
    :return: s, J and C, each (m,).
    :raises InputError: fewer than 3 half periods.
    """
    at = rises(trace, settled_v)[1:]  # the first is a shorter one
    if len(at) < 4:
        raise InputError(f"{max(len(at) - 1, 0)} half periods seen; at least 3 are needed")
    middle = trace.middle
    clamped = (middle < _CLAMPED[0] * settled_v) & (trace.amps < _CLAMPED[1] * limit_a)
    charging_w = trace.amps * (middle + losses.output_ohm * losses.bridge_a(trace))
    idle_a = losses.bleeder_s * settled_v
    # What an interval of a clamp has beyond the bleeder's current belongs to the ramp that begins in it, at next to no volts.
    clamped_w = settled_v * idle_a + (trace.amps - idle_a) * (middle + losses.output_ohm * limit_a)
    probe_a = losses.probe_s * middle
    joules = np.cumsum((np.where(clamped, clamped_w, charging_w) - probe_a * middle) * trace.step_s)
    coulombs = np.cumsum((trace.amps - probe_a) * trace.step_s)
    height = trace.height
    share = np.array([(0.5 * settled_v - height[k - 1]) / (height[k] - height[k - 1]) for k in at])
    where = np.array(at) - 1 + share
    index = np.arange(len(height))
    seconds, energy, charge = (np.diff(np.interp(where, index, one)) for one in (trace.time_s, joules, coulombs))
    return seconds, energy, charge

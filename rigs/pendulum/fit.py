"""Decay and peak of the recoil, from each landing by itself.

After a landing at ``t0`` the accelerometer reads, behind its low-pass,

    a(t) = exp(-(t - t0)/tau) (C cos w(t - t0) + S sin w(t - t0)) + offset

Thesis 3.5.1 averages the magnitude of 20 aligned landings and fits one exponential to it; that is here too
(``thesis_method``), but its points have no uncertainty that follows from the noise, and its first point is the luck of where
sampling met the ring. Instead each landing is fitted by itself, its carrier with it, and the scatter of the landings gives the
uncertainty: what the ring has beside one frequency differs from landing to landing and averages out, and what is left of it
is in the scatter. The weights assume that the model holds to ``IMPURITY`` of the envelope at each point, so that a loud sample
does not count for more than it is worth.

The peak is the envelope at the moment of landing, ahead of the low-pass: ``sqrt(2)`` times the root mean square of all that
rings. When a landing was, the sampling shows to a period; the straight line through 20 of them (the pin gets slower as the
coil warms) shows it better.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from haptics.errors import InputError
from rigs.fitting import Fit, Vector, least_squares_fit, quadrature
from rigs.instruments.accelerometer import BANDWIDTH_SD, DELAY_SD_S, GAIN_SD
from rigs.landings import LINK_SD_S, RATE_SD, Trace
from rigs.result import Quantity

IMPURITY = 0.15
"""What else rings beside one frequency, as a share of the envelope (assumed)."""
METHOD_SD = 0.01
"""What the published method is off by as a share: on landings made up with a known decay it finds 0.6 to 1.1 % too much, as the
logarithm counts the dips of rings that still go together."""
FLIGHT_S = (1e-3, 25e-3)
"""A landing is looked for so long after the command."""
FEWEST = 5
_WINDOW_S = 60e-3
_SKIP = 2
"""Samples left out after the first loud one: the low-pass takes them to follow."""


@dataclass(frozen=True)
class Ring:
    """One landing fitted.

    :param fit: of decay, frequency, amplitudes and offset.
    :param landed_s: moment of landing after the command, s.
    :param tau_s: decay of the envelope, s.
    :param hertz: frequency of the ring, Hz.
    :param amplitude_g: envelope of all that rings at the landing, g.
    :param max_g: maximum magnitude of any sample, g.
    """

    fit: Fit
    landed_s: float
    tau_s: float
    hertz: float
    amplitude_g: float
    max_g: float


@dataclass(frozen=True)
class SurfaceFit:
    """All landings on one surface.

    :param surface: ``bare``, ``silicone`` or ``foam``.
    :param rings: one for each landing.
    :param travel_s: from the command to the landing, s.
    :param average: of all landings, by the thesis' method.
    """

    surface: str
    rings: tuple[Ring, ...]
    travel_s: Quantity
    average: Average
    peak_known: float
    """Standard deviation of the peak as a share: gain, low-pass, moment of landing, purity of the ring."""

    @property
    def reduced_chi2(self) -> float:
        """Mean over the landings."""
        return float(np.mean([ring.fit.reduced_chi2 for ring in self.rings]))

    def quantities(self) -> dict[str, Quantity]:
        """What was measured on this surface, named after it.

        :return: decay (s), peak (g), decay by the thesis' method (s), maximum (g) and frequency (Hz).
        """
        tau_s, tau_sd_s = _mean([ring.tau_s for ring in self.rings])
        peak_g, peak_sd_g = _mean([ring.amplitude_g for ring in self.rings])
        top_g, top_sd_g = _mean([ring.max_g for ring in self.rings])
        hertz, hertz_sd = _mean([ring.hertz for ring in self.rings])
        name = self.surface
        return {
            f"tau_{name}_s": Quantity(tau_s, quadrature((tau_sd_s, tau_s * RATE_SD)), "s"),
            f"peak_g_{name}": Quantity(peak_g, quadrature((peak_sd_g, peak_g * self.peak_known)), "g"),
            f"tau_{name}_thesis_method_s": Quantity(self.average.tau_s, self.average.tau_sd_s, "s"),
            f"max_g_{name}": Quantity(top_g, quadrature((top_sd_g, top_g * GAIN_SD)), "g"),
            f"ring_hz_{name}": Quantity(hertz, quadrature((hertz_sd, hertz * RATE_SD)), "Hz"),
        }


@dataclass(frozen=True)
class Average:
    """As in Fig 3.3: the magnitude of the landings, each shifted so that its maximum is at 0, averaged; and one exponential.

    :param after_s: time since the maximum (n,), s.
    :param g: mean magnitude (n,), g.
    :param sd_g: standard deviation of the mean (n,), g.
    :param tau_s: decay of the exponential, s.
    :param tau_sd_s: its standard deviation, s.
    :param start_g: value of the exponential at 0, g.
    """

    after_s: Vector
    g: Vector
    sd_g: Vector
    tau_s: float
    tau_sd_s: float
    start_g: float


def fit_surface(surface: str, traces: Sequence[Trace], bandwidth_hz: float) -> SurfaceFit:
    """Fit every landing, and put them together.

    :param surface: ``bare``, ``silicone`` or ``foam``.
    :param traces: one for each return of the pin.
    :param bandwidth_hz: of the accelerometer.
    :return: all rings, their average and the travel.
    :raises InputError: fewer than ``FEWEST`` landings.
    """
    found = [(number, trace, first) for number, trace in enumerate(traces) if (first := trace.onset(*FLIGHT_S)) is not None]
    if len(found) < FEWEST:
        raise InputError(f"{len(found)} landings on {surface}; at least {FEWEST} are needed")
    period_s = found[0][1].period_s
    number = np.array([number for number, _, _ in found], dtype=float)
    middle_s = np.array([trace.after_s[first] for _, trace, first in found]) - 0.5 * period_s
    line = np.polyfit(number, middle_s, 1)
    landed_s = np.polyval(line, number)
    landed_sd_s = max(float((middle_s - landed_s).std(ddof=2)), period_s / math.sqrt(12.0)) / math.sqrt(len(found))
    rings = tuple(
        fit_ring(trace, first, float(at_s), bandwidth_hz) for (_, trace, first), at_s in zip(found, landed_s, strict=True)
    )
    tau_s, hertz = (float(np.mean([getattr(ring, name) for ring in rings])) for name in ("tau_s", "hertz"))
    low_pass_sd = BANDWIDTH_SD * (1.0 - low_pass(tau_s, hertz, bandwidth_hz) ** 2)
    return SurfaceFit(
        surface,
        rings,
        Quantity(float(middle_s.mean()), quadrature((landed_sd_s, DELAY_SD_S, LINK_SD_S)), "s"),
        thesis_method([trace for _, trace, _ in found]),
        # What rings beside the fitted frequency is seen in part: IMPURITY of the amplitude is half its square of the whole.
        quadrature((GAIN_SD, low_pass_sd, landed_sd_s / tau_s, 0.5 * IMPURITY**2)),
    )


def fit_ring(trace: Trace, first: int, landed_s: float, bandwidth_hz: float) -> Ring:
    """Fit one landing.

    :param trace: of the landing.
    :param first: number of its first loud sample.
    :param landed_s: after the command, when it was.
    :param bandwidth_hz: of the accelerometer's low-pass, Hz.
    :return: the ring, its amplitude corrected for the low-pass.
    """
    start = first + _SKIP
    since_s = trace.after_s[start:] - landed_s
    since_s = since_s[since_s < _WINDOW_S]
    g = trace.g[start : start + len(since_s)]

    def model(values: Vector) -> Vector:
        return _ringing(values, since_s) + values[4]

    tau_s, hertz = _first_guess(since_s, g, trace)
    fit = None
    sd: Vector | float = np.hypot(trace.noise_g, IMPURITY * np.abs(g).max() * np.exp(-(since_s - since_s[0]) / tau_s))
    for _ in range(2):
        start_at = _start(since_s, g, tau_s, hertz, sd)
        fit = least_squares_fit(model, g, sd, start_at, bounds={"tau_s": (1e-4, 0.2), "hertz": (20.0, 0.5 / trace.period_s)})
        tau_s, hertz = fit.value("tau_s"), fit.value("hertz")
        envelope_g = math.hypot(fit.value("cosine_g"), fit.value("sine_g")) * np.exp(-since_s / tau_s)
        sd = np.hypot(trace.noise_g, IMPURITY * envelope_g)
    assert fit is not None
    amplitude_g = math.hypot(fit.value("cosine_g"), fit.value("sine_g"))
    clear = amplitude_g * np.exp(-since_s / tau_s) > 5.0 * trace.noise_g
    beside = float(np.sum(fit.residuals[clear] ** 2 - trace.noise_g**2) / np.sum(_ringing(fit.values, since_s)[clear] ** 2))
    whole_g = amplitude_g * math.sqrt(1.0 + max(0.0, beside)) / low_pass(tau_s, hertz, bandwidth_hz)
    return Ring(fit, landed_s, tau_s, hertz, whole_g, float(np.abs(trace.g[first:]).max()))


def low_pass(tau_s: float, hertz: float, bandwidth_hz: float) -> float:
    """What a low-pass of first order leaves of a ring's amplitude.

    :param tau_s: decay of the ring, s.
    :param hertz: its frequency, Hz.
    :param bandwidth_hz: cut-off of the filter, Hz.
    :return: share of the amplitude; for ``tau_s`` below the filter's own time constant it exceeds 1.
    """
    cutoff = 2.0 * math.pi * bandwidth_hz
    return cutoff / abs(complex(cutoff - 1.0 / tau_s, 2.0 * math.pi * hertz))


def thesis_method(found: Sequence[Trace]) -> Average:
    """The published evaluation; the uncertainty of its decay is by leaving out one landing after the other.

    :param found: one trace for each landing, at least two.
    :return: the average with its exponential.
    """
    period_s = found[0].period_s
    length = round(_WINDOW_S / period_s)
    before = round(8e-3 / period_s)
    rows: list[Vector] = []
    for trace in found:
        low, high = np.searchsorted(trace.after_s, FLIGHT_S)
        top = int(low + np.argmax(np.abs(trace.g[low:high])))
        row = np.abs(trace.g[top - before : top + length])
        if len(row) == before + length:
            rows.append(row)
    table, after_s = np.array(rows), np.asarray(period_s * np.arange(-before, length), dtype=np.float64)
    floor_g = 3.0 * found[0].noise_g
    tau_s, start_g = _exponential(after_s, table.mean(axis=0), floor_g)
    others = [_exponential(after_s, np.delete(table, k, axis=0).mean(axis=0), floor_g)[0] for k in range(len(table))]
    sd_s = math.sqrt((len(table) - 1) * float(np.var(others)))
    mean_sd_g = table.std(axis=0, ddof=1) / math.sqrt(len(table))
    return Average(after_s, table.mean(axis=0), mean_sd_g, tau_s, quadrature((sd_s, METHOD_SD * tau_s)), start_g)


def _exponential(after_s: Vector, g: Vector, floor_g: float) -> tuple[float, float]:
    """Straight line through the logarithm, from the maximum until ``floor_g``; decay time and value at 0."""
    below = np.flatnonzero((after_s > 0.0) & (g < floor_g))
    part = (after_s >= 0.0) & (np.arange(len(g)) < (below[0] if len(below) else len(g)))
    slope, height = np.polyfit(after_s[part], np.log(g[part]), 1)
    return -1.0 / slope, math.exp(height)


def _ringing(values: Vector, since_s: Vector) -> Vector:
    tau_s, hertz, cosine_g, sine_g = values[:4]
    phase = 2.0 * np.pi * hertz * since_s
    return np.exp(-since_s / tau_s) * (cosine_g * np.cos(phase) + sine_g * np.sin(phase))


def _first_guess(since_s: Vector, g: Vector, trace: Trace) -> tuple[float, float]:
    """Decay from the mean time of the energy, which is half of it; frequency from the maximum of the spectrum."""
    energy = g**2 - trace.noise_g**2
    mean_s = float(np.sum(energy * (since_s - since_s[0])) / np.sum(energy))
    spectrum = np.abs(np.fft.rfft(g, 2048))
    return min(max(2.0 * mean_s, 3e-4), 0.1), max(float(np.argmax(spectrum)) / (2048 * trace.period_s), 30.0)


def _start(since_s: Vector, g: Vector, tau_s: float, hertz: float, sd: Vector | float) -> dict[str, float]:
    """Amplitudes that fit best with this decay and frequency."""
    phase, decay = 2.0 * np.pi * hertz * since_s, np.exp(-since_s / tau_s)
    columns = np.column_stack([decay * np.cos(phase), decay * np.sin(phase), np.ones_like(since_s)])
    weight = 1.0 / np.broadcast_to(np.asarray(sd), g.shape)
    cosine_g, sine_g, offset_g = np.linalg.lstsq(columns * weight[:, np.newaxis], g * weight, rcond=None)[0]
    return {"tau_s": tau_s, "hertz": hertz, "cosine_g": cosine_g, "sine_g": sine_g, "offset_g": offset_g}


def _mean(values: Sequence[float]) -> tuple[float, float]:
    """Mean and its standard deviation from the scatter, wider by Student's t for as few (95 %)."""
    from scipy.stats import t

    count = len(values)
    wider = float(t.ppf(0.975, count - 1)) / 1.959964
    return float(np.mean(values)), wider * float(np.std(values, ddof=1)) / math.sqrt(count)

"""One comparison of a model with the simulator: what was compared, how far apart they are, and how far apart they may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Judgement:
    """One quantity of one case.

    ``ours``, ``ngspice``: a number from each, or the root mean square over time of a curve. ``error_rms``: of a curve over time;
    of a number the same as ``error_worst``, the greatest difference at any of the simulator's instants. ``allowed``: bound of the
    worst error, in ``unit`` like all of these; ``why``: what it is made of.
    """

    case: str
    quantity: str
    ours: float
    ngspice: float
    error_rms: float
    error_worst: float
    unit: str
    allowed: float
    agrees: bool
    why: str


def judged_number(
    case: str, quantity: str, ours: float, simulated: float, unit: str, allowed: float, parts: Mapping[str, float]
) -> Judgement:
    """A judgement of one number. ``parts``: what ``allowed`` is made of, in ``unit`` unless they say otherwise."""
    error = abs(ours - simulated)
    return Judgement(case, quantity, ours, simulated, error, error, unit, allowed, error <= allowed, _why(parts))


def judged_curve(
    case: str, quantity: str, time_s: Floats, ours: Floats, simulated: Floats, unit: str, parts: Mapping[str, float]
) -> Judgement:
    """A judgement of two curves at the same instants; the sum of ``parts`` is allowed at each."""
    error, allowed = ours - simulated, sum(parts.values())
    worst = float(np.abs(error).max())
    rms, ours_rms, simulated_rms = (mean_square_root(time_s, curve) for curve in (error, ours, simulated))
    return Judgement(case, quantity, ours_rms, simulated_rms, rms, worst, unit, allowed, worst <= allowed, _why(parts))


def mean_square_root(time_s: Floats, curve: Floats) -> float:
    """Root mean square over time of a curve at instants that need not be even."""
    return float(np.sqrt(np.trapezoid(curve**2, time_s) / (time_s[-1] - time_s[0])))


def running_integral(time_s: Floats, curve: Floats) -> tuple[Floats, Floats]:
    """Instants from 0 s on, and the integral up to each by trapezoids; before the first instant the curve counts as constant."""
    time_s, curve = np.append(0.0, time_s), np.append(curve[0], curve)
    return time_s, np.append(0.0, np.cumsum(0.5 * (curve[1:] + curve[:-1]) * np.diff(time_s)))


def _why(parts: Mapping[str, float]) -> str:
    return " + ".join(f"{name} {value:.2g}" for name, value in parts.items() if value > 0.0)

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

    :param case: name of the case.
    :param quantity: what was compared.
    :param ours: the model's number, or the root mean square over time of its curve, in ``unit``.
    :param ngspice: the same of the simulator.
    :param error_rms: root mean square over time of the difference of two curves; of a number the same as ``error_worst``.
    :param error_worst: maximum difference at any of the simulator's instants.
    :param unit: of all numbers here.
    :param allowed: bound of ``error_worst``.
    :param agrees: the worst error is within it.
    :param why: what the bound is made of.
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
    """A judgement of one number. ``parts``: what ``allowed`` is made of, in ``unit`` unless their names state another.

    :param case: name of the case.
    :param quantity: what is compared.
    :param ours: number of the model, in ``unit``.
    :param simulated: number of the simulator, in ``unit``.
    :param unit: of the numbers.
    :param allowed: bound of the difference, in ``unit``.
    :param parts: what ``allowed`` is made of, by name, in ``unit`` unless their names state another.
    :return: the judgement.
    """
    error = abs(ours - simulated)
    return Judgement(case, quantity, ours, simulated, error, error, unit, allowed, error <= allowed, _why(parts))


def judged_curve(
    case: str, quantity: str, time_s: Floats, ours: Floats, simulated: Floats, unit: str, parts: Mapping[str, float]
) -> Judgement:
    """A judgement of two curves at the same instants; the sum of ``parts`` is allowed at each.

    :param case: name of the case.
    :param quantity: what is compared.
    :param time_s: instants (n,), s, ascending.
    :param ours: curve of the model (n,), in ``unit``.
    :param simulated: curve of the simulator (n,), in ``unit``.
    :param unit: of the curves.
    :param parts: bounds by name, in ``unit``; their sum is allowed at each instant.
    :return: the judgement.
    """
    error, allowed = ours - simulated, sum(parts.values())
    worst = float(np.abs(error).max())
    rms, ours_rms, simulated_rms = (mean_square_root(time_s, curve) for curve in (error, ours, simulated))
    return Judgement(case, quantity, ours_rms, simulated_rms, rms, worst, unit, allowed, worst <= allowed, _why(parts))


def mean_square_root(time_s: Floats, curve: Floats) -> float:
    """Root mean square over time of a curve at instants that need not be even.

    :param time_s: instants (n,), s, ascending.
    :param curve: values (n,).
    :return: in the unit of the curve.
    """
    return float(np.sqrt(np.trapezoid(curve**2, time_s) / (time_s[-1] - time_s[0])))


def running_integral(time_s: Floats, curve: Floats) -> tuple[Floats, Floats]:
    """Instants from 0 s on, and the integral up to each by trapezoids; before the first instant the curve counts as constant.

    :param time_s: instants (n,), s, ascending.
    :param curve: values (n,).
    :return: instants with 0 s first (n + 1,), and the integral up to each (n + 1,), in the curve's unit times s.
    """
    time_s, curve = np.append(0.0, time_s), np.append(curve[0], curve)
    return time_s, np.append(0.0, np.cumsum(0.5 * (curve[1:] + curve[:-1]) * np.diff(time_s)))


def _why(parts: Mapping[str, float]) -> str:
    return " + ".join(f"{name} {value:.2g}" for name, value in parts.items() if value > 0.0)

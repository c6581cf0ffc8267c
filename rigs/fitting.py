"""Least squares with known noise, priors on nuisance parameters, and the fit's own uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """A least-squares fit.

    Where the reduced chi squared exceeds 1 the covariance is already scaled by it: the noise was larger than stated, or the model
    is incomplete.

    :param names: of the parameters (k,), in the order of ``values``.
    :param values: best values (k,).
    :param covariance: of the values (k, k).
    :param reduced_chi2: chi squared of the data over its degrees of freedom.
    :param residuals: data less model (n,), in the data's unit.
    """

    names: tuple[str, ...]
    values: Vector
    covariance: NDArray[np.float64]
    reduced_chi2: float
    residuals: Vector

    def value(self, name: str) -> float:
        """Best value of one parameter.

        :param name: one of ``names``.
        :return: its best value.
        """
        return float(self.values[self.names.index(name)])

    def sd(self, name: str) -> float:
        """Its standard deviation.

        :param name: one of ``names``.
        :return: its standard deviation.
        """
        at = self.names.index(name)
        return math.sqrt(self.covariance[at, at])

    def sd_of(self, slope: Mapping[str, float]) -> float:
        """Standard deviation of a quantity with these partial derivatives, others 0.

        :param slope: partial derivative of the quantity by each parameter's name; 0 for names left out.
        :return: standard deviation of the quantity.
        """
        gradient = np.array([slope.get(name, 0.0) for name in self.names])
        return math.sqrt(float(gradient @ self.covariance @ gradient))


def least_squares_fit(
    model: Callable[[Vector], Vector],
    data: Vector,
    sd: Vector | float,
    start: Mapping[str, float],
    priors: Mapping[str, tuple[float, float]] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> Fit:
    """Parameters that make ``model(parameters)`` (n,) closest to ``data`` (n,), each point weighted by its ``sd``.

    :param model: from parameter values (k,) to predicted data (n,).
    :param data: measured values (n,), finite.
    :param sd: standard deviation of each point (n,), or one for all, > 0.
    :param start: names, in the order that ``model`` takes them, and where to begin.
    :param priors: mean and sd of what is known of some beforehand; they count as data, but not in chi squared.
    :param bounds: where a parameter may lie.
    :return: the fit, parameters in the order of ``start``.
    :raises InputError: fewer points than parameters, a name not in ``start``, data that are not finite, or no convergence.
    """
    from scipy.optimize import least_squares

    names = tuple(start)
    for name in (*(priors or {}), *(bounds or {})):
        if name not in start:
            raise InputError(f"parameter {name!r} is not fitted; allowed: {', '.join(names)}")
    if len(data) <= len(names):
        raise InputError(f"{len(data)} points cannot fit {len(names)} parameters ({', '.join(names)})")
    if not np.all(np.isfinite(data)):
        raise InputError(f"{np.count_nonzero(~np.isfinite(data))} of {len(data)} points are not finite; nothing is fitted")
    weight = 1.0 / np.broadcast_to(np.asarray(sd, dtype=float), data.shape)
    known = [(names.index(name), mean, spread) for name, (mean, spread) in (priors or {}).items()]
    first = np.array([start[name] for name in names])
    scale = np.where(first != 0.0, np.abs(first), 1.0)

    def misfit(scaled: Vector) -> Vector:
        values = scaled * scale
        prior = [(values[at] - mean) / spread for at, mean, spread in known]
        return np.concatenate([(model(values) - data) * weight, prior])

    limits = [(bounds or {}).get(name, (-math.inf, math.inf)) for name in names]
    low, high = (np.array(side) / scale for side in zip(*limits, strict=True))
    found = least_squares(misfit, first / scale, bounds=(low, high), x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    if not found.success:
        raise InputError(f"the fit of {', '.join(names)} does not converge: {found.message}")
    values = found.x * scale
    jacobian = found.jac / scale
    residuals = data - model(values)
    reduced = float(np.sum((residuals * weight) ** 2) / (len(data) - len(names)))
    # Parameters of very different size: inverted with each column at length 1, or the small ones would be cut off.
    length = np.linalg.norm(jacobian, axis=0)
    length[length == 0.0] = 1.0
    unit = jacobian / length
    covariance = np.linalg.pinv(unit.T @ unit, hermitian=True) / np.outer(length, length) * max(1.0, reduced)
    return Fit(names, values, covariance, reduced, residuals)


def noise_sd(samples: Vector) -> float:
    """Standard deviation of white noise on something slow, from successive differences: ``sqrt(mean(d^2) / 2)``.

    :param samples: evenly spaced (n,), at least 10.
    :return: standard deviation in the unit of the samples.
    :raises InputError: fewer than 10 samples.
    """
    if len(samples) < 10:
        raise InputError(f"{len(samples)} samples do not show their noise; at least 10 are needed")
    return float(np.sqrt(np.mean(np.diff(samples) ** 2) / 2.0))


def quadrature(parts: Sequence[float]) -> float:
    """Independent standard deviations together.

    :param parts: standard deviations in one unit.
    :return: root of the sum of squares.
    """
    return math.sqrt(sum(part * part for part in parts))

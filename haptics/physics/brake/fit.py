"""The brake's published forces, the fit of each law to them, and how well a law predicts a point it has not seen.

Published points (thesis Table 4.2, 4.7.3) are means of several pulls, that is plateaus; their scatter is given only for 1500 V,
as 10 %. Each point is weighted with 10 % of itself and, in quadrature, 0.03 N for the load cell near zero (assumed).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

from haptics.errors import InputError
from haptics.physics.brake.fitted_law import ForceLaw
from haptics.physics.brake.force_laws import ClosingGapLaw, Covariance, IdealLaw, ThresholdLaw
from haptics.units import in_range, one_of

Points = tuple[tuple[float, float], ...]
"""(V, N) pairs, measured at the geometry of the published brake."""
PUBLISHED_POINTS: dict[str, Points] = {
    "index": ((200.0, 0.10), (400.0, 1.34), (800.0, 6.04), (1500.0, 20.0)),
    "thumb": ((200.0, 0.16), (400.0, 1.05), (800.0, 3.91)),
}
"""(V, N) for each finger. The 20 N at 1500 V are not given by finger; they are taken for the index."""
RELATIVE_SD = 0.10
FLOOR_SD_N = 0.03


@dataclass(frozen=True)
class ForceFit:
    """A law fitted to points.

    A covariance is infinite where the best fit lies at the edge of the law (no threshold, no closing), for there the points do
    not bound the parameter.

    :param law: with the fitted values.
    :param names: of the fitted parameters.
    :param values: in the order of ``names``, SI.
    :param covariance: of the values, in the same order.
    :param volts: of the points (V).
    :param residuals_n: law less point (N), in the order of the points.
    :param chi2: sum of squared residuals over their deviations.
    :param degrees_of_freedom: points less parameters.
    """

    law: ForceLaw
    names: tuple[str, ...]
    values: tuple[float, ...]
    covariance: Covariance
    volts: tuple[float, ...]
    residuals_n: tuple[float, ...]
    chi2: float
    degrees_of_freedom: int

    @property
    def reduced_chi2(self) -> float | None:
        """Chi squared for each degree of freedom; None if the points determine the parameters exactly."""
        return self.chi2 / self.degrees_of_freedom if self.degrees_of_freedom else None

    @property
    def sds(self) -> tuple[float, ...]:
        """Standard deviation of each parameter."""
        return tuple(math.sqrt(self.covariance[i][i]) for i in range(len(self.names)))


@dataclass(frozen=True)
class LeftOut:
    """One point predicted by a fit to the others. What cannot be had is None, and ``note`` states why.

    :param volts: of the point.
    :param measured_n: force published there (N).
    :param predicted_n: by the fit to the others (N).
    :param predicted_sd_n: standard deviation of the prediction (N).
    :param error_n: prediction less measurement (N).
    :param error_sigma: the same over the standard deviation of both together.
    :param degrees_of_freedom: of the fit to the others.
    :param note: why something is None, or that there are only as many others as parameters; empty otherwise.
    """

    volts: float
    measured_n: float
    predicted_n: float | None
    predicted_sd_n: float | None
    error_n: float | None
    error_sigma: float | None
    degrees_of_freedom: int
    note: str


def point_sd_n(force_n: float) -> float:
    """Standard deviation of a published force: 10 % of it and 0.03 N, in quadrature.

    :param force_n: published force (N).
    :return: standard deviation (N).
    """
    return math.hypot(RELATIVE_SD * force_n, FLOOR_SD_N)


def fit_ideal(points: Points) -> ForceFit:
    """Effective friction of ``IdealLaw``.

    :param points: (V, N) pairs, at the geometry of the published brake; at least as many as parameters.
    :return: the fit; its law is fitted up to the maximum of the points' volts.
    :raises InputError: fewer points than parameters, or points on which the fit does not converge.
    """
    return _fit(points, ("friction",), (0.1,), (1.0,), lambda v, c, to_v: IdealLaw(v[0], c[0][0] ** 0.5, fitted_to_v=to_v))


def fit_threshold(points: Points) -> ForceFit:
    """``k`` and ``V0`` of ``ThresholdLaw``.

    :param points: as ``fit_ideal``, at least two.
    :return: as ``fit_ideal``.
    :raises InputError: as ``fit_ideal``.
    """
    names, start, scale = ("k_n_v2", "threshold_v"), (9e-6, 150.0), (1e-6, 100.0)
    return _fit(points, names, start, scale, lambda v, c, to_v: ThresholdLaw(v[0], v[1], c, fitted_to_v=to_v))


def fit_closing_gap(points: Points) -> ForceFit:
    """Remaining gap and closing pressure of ``ClosingGapLaw``, friction kept at 0.2.

    :param points: as ``fit_ideal``, at least two.
    :return: as ``fit_ideal``.
    :raises InputError: as ``fit_ideal``.
    """
    names, start, scale = ("gap_m", "pressure_pa"), (2e-6, 2e4), (1e-6, 1e4)
    return _fit(points, names, start, scale, lambda v, c, to_v: ClosingGapLaw(v[0], v[1], c, fitted_to_v=to_v))


FITS: dict[str, Callable[[Points], ForceFit]] = {
    "ideal": fit_ideal,
    "threshold": fit_threshold,
    "closing_gap": fit_closing_gap,
}
"""The fit of each law, by its name."""


def leave_one_out(law: str, points: Points) -> tuple[LeftOut, ...]:
    """Each point in turn left out, the law fitted to the others, the point predicted.

    :param law: one of ``FITS``.
    :param points: (V, N) pairs.
    :return: one answer for each point, in order.
    :raises InputError: an unknown law, or a point that is nonsense.
    """
    fit = FITS[one_of("law", law, tuple(FITS))]
    return tuple(_left_out(fit, points[:i] + points[i + 1 :], *points[i]) for i in range(len(points)))


def _left_out(fit: Callable[[Points], ForceFit], others: Points, volts: float, measured_n: float) -> LeftOut:
    try:
        fitted = fit(others)
    except InputError as error:
        return LeftOut(volts, measured_n, None, None, None, None, 0, str(error))
    notes: list[str] = []
    if fitted.degrees_of_freedom == 0:
        notes.append(f"{len(others)} points for {len(fitted.names)} parameters leave nothing to check this fit by")
    # A point left out may lie beyond the others: what the law makes of it there is the question.
    predicted_n = fitted.law.force_n(volts, extrapolate=True)
    sd_n = fitted.law.force_sd_n(volts, extrapolate=True)
    error_n = predicted_n - measured_n
    if not math.isfinite(sd_n):
        notes.append("their best fit is at the edge of the law, so the prediction has no uncertainty of its own")
        return LeftOut(volts, measured_n, predicted_n, None, error_n, None, fitted.degrees_of_freedom, "; ".join(notes))
    sigma = error_n / math.hypot(sd_n, point_sd_n(measured_n))
    return LeftOut(volts, measured_n, predicted_n, sd_n, error_n, sigma, fitted.degrees_of_freedom, "; ".join(notes))


def _fit(
    points: Points,
    names: tuple[str, ...],
    start: tuple[float, ...],
    scale: tuple[float, ...],
    make: Callable[[tuple[float, ...], Covariance, float], ForceLaw],
) -> ForceFit:
    import numpy as np
    from scipy.optimize import OptimizeWarning, curve_fit  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

    if len(points) < len(names):
        raise InputError(f"{len(points)} points cannot fit {len(names)} parameters ({', '.join(names)})")
    volts = np.array([in_range("volts", v, 0.0, 1e5, "V") for v, _ in points])
    forces = np.array([in_range("force_n", f, 0.0, 1e5, "N") for _, f in points])
    sd = np.array([point_sd_n(float(f)) for f in forces])
    none, to_v = tuple((0.0,) * len(names) for _ in names), float(volts.max())

    def model(v: np.ndarray, *scaled: float) -> np.ndarray:
        law = make(tuple(s * u for s, u in zip(scaled, scale, strict=True)), none, to_v)
        return np.array([law.force_n(float(x)) for x in v])

    scaled0 = [s / u for s, u in zip(start, scale, strict=True)]
    with warnings.catch_warnings():
        # A fit at the edge of its law has an infinite covariance; the warning adds nothing.
        warnings.simplefilter("ignore", OptimizeWarning)
        try:
            best, covariance = cast(
                Any, curve_fit(model, volts, forces, scaled0, sigma=sd, absolute_sigma=True, xtol=1e-12, ftol=1e-12)
            )
        except RuntimeError as error:
            raise InputError(f"the fit of {', '.join(names)} does not converge on these points: {error}") from error
    unit = np.array(scale)
    values = tuple(float(x) for x in best * unit)
    spread: Covariance = tuple(tuple(float(x) for x in row) for row in covariance * np.outer(unit, unit))
    law = make(values, spread, to_v)
    residuals = model(volts, *best) - forces
    return ForceFit(
        law=law,
        names=names,
        values=values,
        covariance=spread,
        volts=tuple(float(v) for v in volts),
        residuals_n=tuple(float(r) for r in residuals),
        chi2=float(np.sum((residuals / sd) ** 2)),
        degrees_of_freedom=len(points) - len(names),
    )

"""The brake's published forces, and the fits of each law to them.

Published points (thesis Table 4.2, 4.7.3) are means of several pulls, that is plateaus; their scatter is given only for 1500 V,
as 10 %. Each point is weighted with 10 % of itself and, in quadrature, 0.03 N for the load cell near zero (assumed).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.brake_force import ClosingGapLaw, Covariance, ForceLaw, IdealLaw, ThresholdLaw
from haptics.units import in_range

PUBLISHED_POINTS: dict[str, tuple[tuple[float, float], ...]] = {
    "index": ((200.0, 0.10), (400.0, 1.34), (800.0, 6.04), (1500.0, 20.0)),
    "thumb": ((200.0, 0.16), (400.0, 1.05), (800.0, 3.91)),
}
"""(V, N) for each finger. The 20 N at 1500 V were not told apart by finger; they are taken for the index."""
RELATIVE_SD = 0.10
FLOOR_SD_N = 0.03


@dataclass(frozen=True)
class ForceFit:
    """A law fitted to points: values in the order of its covariance, residuals (law - point), chi squared."""

    law: ForceLaw
    names: tuple[str, ...]
    values: tuple[float, ...]
    covariance: Covariance
    volts: tuple[float, ...]
    residuals_n: tuple[float, ...]
    chi2: float
    degrees_of_freedom: int


def fit_ideal(points: tuple[tuple[float, float], ...]) -> ForceFit:
    """Effective friction of ``IdealLaw``.

    :param points: (V, N) pairs, at the geometry of the published brake. :raises InputError: fewer points than parameters.
    """
    return _fit(points, ("friction",), (0.1,), (1.0,), lambda v, c: IdealLaw(v[0], c[0][0] ** 0.5))


def fit_threshold(points: tuple[tuple[float, float], ...]) -> ForceFit:
    """``k`` and ``V0`` of ``ThresholdLaw``. See ``fit_ideal``."""
    return _fit(points, ("k_n_v2", "threshold_v"), (9e-6, 150.0), (1e-6, 100.0), lambda v, c: ThresholdLaw(v[0], v[1], c))


def fit_closing_gap(points: tuple[tuple[float, float], ...]) -> ForceFit:
    """Remaining gap and closing pressure of ``ClosingGapLaw``, friction kept at 0.2. See ``fit_ideal``."""
    return _fit(points, ("gap_m", "pressure_pa"), (2e-6, 2e4), (1e-6, 1e4), lambda v, c: ClosingGapLaw(v[0], v[1], c))


def _fit(
    points: tuple[tuple[float, float], ...],
    names: tuple[str, ...],
    start: tuple[float, ...],
    scale: tuple[float, ...],
    make: Callable[[tuple[float, ...], Covariance], ForceLaw],
) -> ForceFit:
    import numpy as np
    from scipy.optimize import curve_fit

    if len(points) < len(names):
        raise InputError(f"{len(points)} points cannot fit {len(names)} parameters ({', '.join(names)})")
    volts = np.array([in_range("volts", v, 0.0, 1e5, "V") for v, _ in points])
    forces = np.array([in_range("force_n", f, 0.0, 1e5, "N") for _, f in points])
    sd = np.hypot(RELATIVE_SD * forces, FLOOR_SD_N)
    none = tuple((0.0,) * len(names) for _ in names)

    def model(v: np.ndarray, *scaled: float) -> np.ndarray:
        law = make(tuple(s * u for s, u in zip(scaled, scale, strict=True)), none)
        return np.array([law.force_n(float(x)) for x in v])

    scaled0 = [s / u for s, u in zip(start, scale, strict=True)]
    best, covariance = curve_fit(model, volts, forces, scaled0, sigma=sd, absolute_sigma=True, xtol=1e-12, ftol=1e-12)
    unit = np.array(scale)
    values = tuple(float(x) for x in best * unit)
    spread: Covariance = tuple(tuple(float(x) for x in row) for row in covariance * np.outer(unit, unit))
    law = make(values, spread)
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

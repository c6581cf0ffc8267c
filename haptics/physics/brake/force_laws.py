"""How much a brake holds at an amplitude: three laws side by side, with their uncertainty.

- ``IdealLaw``: friction under Eq 4.2's pressure. An upper bound only: 44 N at 1500 V where 20 N was measured.
- ``ThresholdLaw``, the default: a preload keeps the strips apart until the pull exceeds it.
- ``ClosingGapLaw``: friction as stated (0.2), the loss put down to air that pressure squeezes out. Compare with it when
  thickness changes, for there the two laws part.

All take amplitude in volts, overlap (m2), thickness (m), relative permittivity, and ``strips`` stacked pairs. The force is the
holding capacity while the amplitude lasts; the published points behind the constants are plateaus of a pull at 10 Hz, so
what the dips at polarity reversal cost is inside the constants. None of the laws knows breakdown: ``predict_brake`` does.

Each is fitted from 0 V (the off force is known) to its ``fitted_to_v`` on one film, 13 um of permittivity 3.4 (thesis 4.4.2).
Overlap and strips only multiply the force; other volts and films are extrapolation, refused unless ``extrapolate=True``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.brake.fitted_law import ForceLaw
from haptics.physics.brake.parameters import BRAKE, MAX_VOLTS, compression_n
from haptics.units import VACUUM_PERMITTIVITY_F_PER_M, in_range, one_of

OFF_FORCE_N = 5e-3
"""Force with the brake off: a few millinewton (stated, thesis 4.9); 5 mN assumed."""

Covariance = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class IdealLaw(ForceLaw):
    """``F = mu n e_r e_0 A V^2 / 2 d^2`` (Eq 4.2, 4.3).

    :param friction: coefficient, 0.2 as stated, or the effective one of a fit.
    :param friction_sd: its standard deviation.
    :param name: of the law.
    :param fitted_to_v: maximum amplitude (V) that it was held against points at.
    """

    friction: float = BRAKE.friction
    friction_sd: float = 0.0
    name: str = "ideal"
    fitted_to_v: float = MAX_VOLTS

    def _force_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        return self.friction * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)

    def _force_sd_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        return self.friction_sd * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)

    def _volts_for(self, force_n: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        return math.sqrt(force_n / _per_volt2("IdealLaw", self._force_n(1.0, overlap_m2, thickness_m, permittivity, strips)))


@dataclass(frozen=True)
class ThresholdLaw(ForceLaw):
    """``F = n k (A/A0) (e_r/e_r0) (d0/d)^2 max(0, V^2 - V0'^2) + F_off`` with ``V0' = V0 (d/d0) sqrt(e_r0/e_r)``.

    The threshold is a preload pressure: it is met by the same electrostatic pressure whatever the dielectric.

    :param k_n_v2: N/V^2 at 11 cm2, 13 um, 3.4.
    :param threshold_v: V0 (V), same geometry.
    :param covariance: of ``(k_n_v2, threshold_v)``; zero: taken as exact.
    :param off_force_n: force at 0 V (N).
    :param name: of the law.
    :param fitted_to_v: maximum amplitude (V) of the points behind it.
    """

    k_n_v2: float
    threshold_v: float
    covariance: Covariance = ((0.0, 0.0), (0.0, 0.0))
    off_force_n: float = OFF_FORCE_N
    name: str = "threshold"
    fitted_to_v: float = MAX_VOLTS

    def _force_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        return self.of_volts(overlap_m2, thickness_m, permittivity, strips)(volts)

    def of_volts(self, overlap_m2: float, thickness_m: float, permittivity: float, strips: int = 1) -> Callable[[float], float]:
        per_v2 = self.k_n_v2 * self._scale(overlap_m2, thickness_m, permittivity, strips)
        threshold_v2, off_n = self._threshold_v2(thickness_m, permittivity), self.off_force_n

        def force_n(volts: float) -> float:
            in_range("volts", volts, -1e6, 1e6, "V")
            return per_v2 * max(0.0, volts**2 - threshold_v2) + off_n

        return force_n

    def _force_sd_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        over_v2 = self._over_v2(volts, thickness_m, permittivity)
        if over_v2 <= 0.0:
            return 0.0
        scale = self._scale(overlap_m2, thickness_m, permittivity, strips)
        stretch2 = (volts**2 - over_v2) / self.threshold_v**2 if self.threshold_v else 0.0
        return _propagate((scale * over_v2, -2.0 * scale * self.k_n_v2 * self.threshold_v * stretch2), self.covariance)

    def _volts_for(self, force_n: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        if force_n <= self.off_force_n:
            return 0.0
        scale = _per_volt2("ThresholdLaw", self.k_n_v2 * self._scale(overlap_m2, thickness_m, permittivity, strips))
        return math.sqrt((force_n - self.off_force_n) / scale - self._over_v2(0.0, thickness_m, permittivity))

    def _scale(self, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        return compression_n(1.0, overlap_m2, thickness_m, permittivity, strips) / _REFERENCE_N

    def _over_v2(self, volts: float, thickness_m: float, permittivity: float) -> float:
        in_range("volts", volts, -1e6, 1e6, "V")
        return volts**2 - self._threshold_v2(thickness_m, permittivity)

    def _threshold_v2(self, thickness_m: float, permittivity: float) -> float:
        stretch2 = (thickness_m / BRAKE.thickness_m) ** 2 * BRAKE.permittivity / permittivity
        return self.threshold_v**2 * stretch2


@dataclass(frozen=True)
class ClosingGapLaw(ForceLaw):
    """``F = mu n e_0 A V^2 / (2 e_r (d/e_r + g)^2) + F_off`` with an air gap that pressure closes, ``g = g_r (1 + (p0/p)^2)``.

    ``p = e_0 (V e_r / d)^2 / 2`` is the pressure there would be without air; ``g_r`` what roughness leaves for good.

    :param gap_m: g_r (m).
    :param pressure_pa: p0 (Pa).
    :param covariance: of ``(gap_m, pressure_pa)``; zero: taken as exact.
    :param friction: coefficient, 0.2 as stated.
    :param off_force_n: force at 0 V (N).
    :param name: of the law.
    :param fitted_to_v: maximum amplitude (V) of the points behind it.
    """

    gap_m: float
    pressure_pa: float
    covariance: Covariance = ((0.0, 0.0), (0.0, 0.0))
    friction: float = BRAKE.friction
    off_force_n: float = OFF_FORCE_N
    name: str = "closing_gap"
    fitted_to_v: float = MAX_VOLTS

    def _force_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        ideal_n = self.friction * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)
        return ideal_n * self._closed_share(volts, thickness_m, permittivity) ** 2 + self.off_force_n

    def _force_sd_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        ideal_n = self.friction * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)
        share = self._closed_share(volts, thickness_m, permittivity)
        if share == 0.0:
            return 0.0
        ratio2 = (self.pressure_pa / self._pressure_pa(volts, thickness_m, permittivity)) ** 2
        slope = -2.0 * ideal_n * share**3 * permittivity / thickness_m  # dF/dg
        return _propagate((slope * (1.0 + ratio2), slope * self.gap_m * 2.0 * ratio2 / self.pressure_pa), self.covariance)

    def _volts_for(self, force_n: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        """By bisection: the law is monotonic."""
        if force_n <= self.off_force_n:
            return 0.0
        _per_volt2("ClosingGapLaw", compression_n(1.0, overlap_m2, thickness_m, permittivity, strips))
        low, high = 0.0, 1.0
        while self._force_n(high, overlap_m2, thickness_m, permittivity, strips) < force_n:
            low, high = high, 2.0 * high
            if high > 1e6:
                raise InputError(f"force_n = {force_n:g} N takes more than a million volts with this geometry")
        for _ in range(100):
            middle = 0.5 * (low + high)
            if self._force_n(middle, overlap_m2, thickness_m, permittivity, strips) < force_n:
                low = middle
            else:
                high = middle
        return high

    def _pressure_pa(self, volts: float, thickness_m: float, permittivity: float) -> float:
        return 0.5 * VACUUM_PERMITTIVITY_F_PER_M * (volts * permittivity / thickness_m) ** 2

    def _closed_share(self, volts: float, thickness_m: float, permittivity: float) -> float:
        """Field in the gap over the field there would be without it: ``1 / (1 + g e_r / d)``."""
        p = self._pressure_pa(volts, thickness_m, permittivity)
        if p < 1e-100:  # its inverse square would overflow; the gap is open beyond meaning long before
            return 0.0
        return 1.0 / (1.0 + self.gap_m * (1.0 + (self.pressure_pa / p) ** 2) * permittivity / thickness_m)


_REFERENCE_N = compression_n(1.0, BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity)
"""Compression at 1 V of the brake that was measured."""


def _per_volt2(law: str, value: float) -> float:
    if value <= 0.0:
        raise InputError(f"{law}: without overlap (or friction) no voltage holds any force")
    return value


def _propagate(gradient: tuple[float, ...], covariance: Covariance) -> float:
    variance = sum(a * b * covariance[i][j] for i, a in enumerate(gradient) for j, b in enumerate(gradient))
    return math.sqrt(max(0.0, variance))


_THUMB_TO_V = 800.0
"""The thumb's published points end here (thesis Table 4.2)."""
INDEX_THRESHOLD = ThresholdLaw(9.630792e-6, 172.2985, ((3.448912e-13, 1.913865e-6), (1.913865e-6, 96.59728)))
THUMB_THRESHOLD = ThresholdLaw(
    6.619931e-6, 124.6853, ((2.990047e-13, 7.076532e-6), (7.076532e-6, 551.5510)), fitted_to_v=_THUMB_TO_V
)
INDEX_CLOSING_GAP = ClosingGapLaw(1.747485e-6, 21111.07, ((2.958355e-14, -3.473391e-4), (-3.473391e-4, 1.512056e7)))
THUMB_CLOSING_GAP = ClosingGapLaw(
    2.877880e-6, 9646.578, ((6.439668e-14, -3.412947e-4), (-3.412947e-4, 7.581055e6)), fitted_to_v=_THUMB_TO_V
)
"""What ``fit`` makes of the published points; a test fits again and compares."""
FINGERS = ("index", "thumb")
LAWS = ("ideal", "threshold", "closing_gap")


def force_law(finger: str = "index", law: str = "threshold") -> ForceLaw:
    """The law the package uses for a finger. The ideal law has no fit: friction as stated, the same for both fingers.

    :param finger: index (points up to 1500 V) or thumb (up to 800 V).
    :param law: ideal, threshold or closing_gap.
    :return: the law, fitted to the finger's published points (thesis Table 4.2, 4.7.3).
    :raises InputError: an unknown finger or law.
    """
    one_of("finger", finger, FINGERS)
    if one_of("law", law, LAWS) == "ideal":
        return IdealLaw()
    if law == "threshold":
        return INDEX_THRESHOLD if finger == "index" else THUMB_THRESHOLD
    return INDEX_CLOSING_GAP if finger == "index" else THUMB_CLOSING_GAP


def default_law(finger: str = "index") -> ForceLaw:
    """The threshold law of a finger, see ``law_choice`` for why.

    :param finger: index or thumb.
    :return: the law, as ``force_law(finger, "threshold")``.
    :raises InputError: an unknown finger.
    """
    return force_law(finger, "threshold")

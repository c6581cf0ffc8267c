"""How much a brake holds at an amplitude: three laws side by side, with their uncertainty.

- ``IdealLaw``: friction under Eq 4.2's pressure. Valid as an upper bound only: 44 N at 1500 V where 20 N was measured.
- ``ThresholdLaw``, the default: a preload keeps the strips apart until the pull exceeds it. Valid from the threshold to
  1500 V, where it is fitted; at the 13 um of the published brake, other geometry by scaling.
- ``ClosingGapLaw``: friction as stated (0.2), the loss put down to air that pressure squeezes out. The same range; the one
  to compare with when thickness changes, for there the two laws part.

All take amplitude in volts, overlap (m2), thickness (m), relative permittivity, and ``strips`` stacked pairs. The force is the
holding capacity while the amplitude lasts; the published points behind the constants are plateaus of a pull at 10 Hz, so
what the dips at polarity reversal cost is inside the constants. None of the laws knows breakdown: ``predict_brake`` does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from haptics.errors import InputError
from haptics.physics.brake.parameters import BRAKE, compression_n
from haptics.units import VACUUM_PERMITTIVITY_F_PER_M, in_range, one_of

OFF_FORCE_N = 5e-3
"""Force with the brake off: a few millinewton (stated, thesis 4.9); 5 mN assumed."""

Covariance = tuple[tuple[float, ...], ...]


class ForceLaw(Protocol):
    """What every law answers."""

    @property
    def name(self) -> str: ...

    def force_n(
        self, volts: float, overlap_m2: float = ..., thickness_m: float = ..., permittivity: float = ..., strips: int = ...
    ) -> float: ...

    def force_sd_n(
        self, volts: float, overlap_m2: float = ..., thickness_m: float = ..., permittivity: float = ..., strips: int = ...
    ) -> float: ...

    def volts_for(
        self, force_n: float, overlap_m2: float = ..., thickness_m: float = ..., permittivity: float = ..., strips: int = ...
    ) -> float: ...


@dataclass(frozen=True)
class IdealLaw:
    """``F = mu n e_r e_0 A V^2 / 2 d^2`` (Eq 4.2, 4.3).

    :param friction: 0.2 as stated, or the effective one of a fit. :param friction_sd: its standard deviation.
    """

    friction: float = BRAKE.friction
    friction_sd: float = 0.0
    name: str = "ideal"

    def force_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Holding force (N) at an amplitude (V).

        :raises InputError: nonsense in any argument.
        """
        return self.friction * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)

    def force_sd_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Standard deviation (N) from that of the friction coefficient."""
        return self.friction_sd * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)

    def volts_for(
        self,
        force_n: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Amplitude (V) that holds ``force_n``; 0 for 0 N.

        :raises InputError: a negative force, or no overlap.
        """
        in_range("force_n", force_n, 0.0, 1e6, "N")
        return math.sqrt(force_n / _per_volt2("IdealLaw", self.force_n(1.0, overlap_m2, thickness_m, permittivity, strips)))


@dataclass(frozen=True)
class ThresholdLaw:
    """``F = n k (A/A0) (e_r/e_r0) (d0/d)^2 max(0, V^2 - V0'^2) + F_off`` with ``V0' = V0 (d/d0) sqrt(e_r0/e_r)``.

    The threshold is a preload pressure: it is met by the same electrostatic pressure whatever the dielectric.

    :param k_n_v2: N/V^2 at 11 cm2, 13 um, 3.4. :param threshold_v: V0 (V), same geometry.
    :param covariance: of ``(k_n_v2, threshold_v)``.
    """

    k_n_v2: float
    threshold_v: float
    covariance: Covariance = ((0.0, 0.0), (0.0, 0.0))
    off_force_n: float = OFF_FORCE_N
    name: str = "threshold"

    def force_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Holding force (N) at an amplitude (V).

        :raises InputError: nonsense in any argument.
        """
        over_v2 = self._over_v2(volts, thickness_m, permittivity)
        return self.k_n_v2 * self._scale(overlap_m2, thickness_m, permittivity, strips) * max(0.0, over_v2) + self.off_force_n

    def force_sd_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Standard deviation (N) from the fit's covariance, to first order; 0 below the threshold."""
        over_v2 = self._over_v2(volts, thickness_m, permittivity)
        if over_v2 <= 0.0:
            return 0.0
        scale = self._scale(overlap_m2, thickness_m, permittivity, strips)
        stretch2 = (volts**2 - over_v2) / self.threshold_v**2 if self.threshold_v else 0.0
        return _propagate((scale * over_v2, -2.0 * scale * self.k_n_v2 * self.threshold_v * stretch2), self.covariance)

    def volts_for(
        self,
        force_n: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Amplitude (V) that holds ``force_n``; 0 for what the brake holds when off.

        :raises InputError: a negative force, or no overlap.
        """
        in_range("force_n", force_n, 0.0, 1e6, "N")
        if force_n <= self.off_force_n:
            return 0.0
        scale = _per_volt2("ThresholdLaw", self.k_n_v2 * self._scale(overlap_m2, thickness_m, permittivity, strips))
        return math.sqrt((force_n - self.off_force_n) / scale - self._over_v2(0.0, thickness_m, permittivity))

    def _scale(self, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float:
        return compression_n(1.0, overlap_m2, thickness_m, permittivity, strips) / _REFERENCE_N

    def _over_v2(self, volts: float, thickness_m: float, permittivity: float) -> float:
        in_range("volts", volts, -1e6, 1e6, "V")
        stretch2 = (thickness_m / BRAKE.thickness_m) ** 2 * BRAKE.permittivity / permittivity
        return volts**2 - self.threshold_v**2 * stretch2


@dataclass(frozen=True)
class ClosingGapLaw:
    """``F = mu n e_0 A V^2 / (2 e_r (d/e_r + g)^2) + F_off`` with an air gap that pressure closes, ``g = g_r (1 + (p0/p)^2)``.

    ``p = e_0 (V e_r / d)^2 / 2`` is the pressure there would be without air; ``g_r`` what roughness leaves for good.

    :param gap_m: g_r (m). :param pressure_pa: p0 (Pa). :param covariance: of ``(gap_m, pressure_pa)``.
    """

    gap_m: float
    pressure_pa: float
    covariance: Covariance = ((0.0, 0.0), (0.0, 0.0))
    friction: float = BRAKE.friction
    off_force_n: float = OFF_FORCE_N
    name: str = "closing_gap"

    def force_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Holding force (N) at an amplitude (V).

        :raises InputError: nonsense in any argument.
        """
        ideal_n = self.friction * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)
        return ideal_n * self._closed_share(volts, thickness_m, permittivity) ** 2 + self.off_force_n

    def force_sd_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Standard deviation (N) from the fit's covariance, to first order."""
        ideal_n = self.friction * compression_n(volts, overlap_m2, thickness_m, permittivity, strips)
        share = self._closed_share(volts, thickness_m, permittivity)
        if share == 0.0:
            return 0.0
        ratio2 = (self.pressure_pa / self._pressure_pa(volts, thickness_m, permittivity)) ** 2
        slope = -2.0 * ideal_n * share**3 * permittivity / thickness_m  # dF/dg
        return _propagate((slope * (1.0 + ratio2), slope * self.gap_m * 2.0 * ratio2 / self.pressure_pa), self.covariance)

    def volts_for(
        self,
        force_n: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
    ) -> float:
        """Amplitude (V) that holds ``force_n``, by bisection (the law is monotonic); 0 for what it holds when off.

        :raises InputError: a negative force, no overlap, or a force that takes more than a million volts.
        """
        in_range("force_n", force_n, 0.0, 1e6, "N")
        if force_n <= self.off_force_n:
            return 0.0
        _per_volt2("ClosingGapLaw", compression_n(1.0, overlap_m2, thickness_m, permittivity, strips))
        low, high = 0.0, 1.0
        while self.force_n(high, overlap_m2, thickness_m, permittivity, strips) < force_n:
            low, high = high, 2.0 * high
            if high > 1e6:
                raise InputError(f"force_n = {force_n:g} N takes more than a million volts with this geometry")
        for _ in range(100):
            middle = 0.5 * (low + high)
            if self.force_n(middle, overlap_m2, thickness_m, permittivity, strips) < force_n:
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


INDEX_THRESHOLD = ThresholdLaw(9.630792e-6, 172.2985, ((3.448912e-13, 1.913865e-6), (1.913865e-6, 96.59728)))
THUMB_THRESHOLD = ThresholdLaw(6.619931e-6, 124.6853, ((2.990047e-13, 7.076532e-6), (7.076532e-6, 551.5510)))
INDEX_CLOSING_GAP = ClosingGapLaw(1.747485e-6, 21111.07, ((2.958355e-14, -3.473391e-4), (-3.473391e-4, 1.512056e7)))
THUMB_CLOSING_GAP = ClosingGapLaw(2.877880e-6, 9646.578, ((6.439668e-14, -3.412947e-4), (-3.412947e-4, 7.581055e6)))
"""What ``fit`` makes of the published points; a test fits again and compares."""
FINGERS = ("index", "thumb")
LAWS = ("ideal", "threshold", "closing_gap")


def force_law(finger: str = "index", law: str = "threshold") -> ForceLaw:
    """The law the package uses for a finger. The ideal law is the same for both: friction as stated, no fit.

    :raises InputError: an unknown finger or law.
    """
    one_of("finger", finger, FINGERS)
    if one_of("law", law, LAWS) == "ideal":
        return IdealLaw()
    if law == "threshold":
        return INDEX_THRESHOLD if finger == "index" else THUMB_THRESHOLD
    return INDEX_CLOSING_GAP if finger == "index" else THUMB_CLOSING_GAP


def default_law(finger: str = "index") -> ForceLaw:
    """The threshold law of a finger.

    :raises InputError: an unknown finger.
    """
    return force_law(finger, "threshold")

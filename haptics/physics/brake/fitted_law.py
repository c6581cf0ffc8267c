"""What every force law of the brake answers, and the refusal of what it was not fitted for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from haptics.physics.brake.parameters import BRAKE
from haptics.physics.fitted import ROUNDING, refuse_outside
from haptics.units import in_range


class ForceLaw(ABC):
    """Holding force over amplitude: what every law answers, and where it was fitted.

    A law gives ``name``, ``fitted_to_v`` and the three private methods; ranges are checked here.
    """

    name: str
    """As ``force_law`` knows it: ideal, threshold or closing_gap."""
    fitted_to_v: float
    """Maximum amplitude (V) of the points behind the law."""

    def force_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
        *,
        extrapolate: bool = False,
    ) -> float:
        """Holding force at an amplitude.

        :param volts: amplitude (V), up to ``fitted_to_v``; its sign has no effect.
        :param overlap_m2: area of one pair of strips that overlaps (m2), 0 to 1; 11 cm2 by default.
        :param thickness_m: of the dielectric (m), 0.1 um to 10 mm; fitted at 13 um.
        :param permittivity: relative, of the dielectric, 1 to 1000; fitted at 3.4.
        :param strips: stacked pairs of strips, 1 to 1000.
        :param extrapolate: True: answer for volts and films outside the fit.
        :return: force (N) that the brake holds before it slides.
        :raises InputError: an argument outside its range, or outside the fit without ``extrapolate``.
        """
        if not extrapolate:
            self._refuse_outside("volts", volts, "V", volts, thickness_m, permittivity)
        return self._force_n(volts, overlap_m2, thickness_m, permittivity, strips)

    def of_volts(self, overlap_m2: float, thickness_m: float, permittivity: float, strips: int = 1) -> Callable[[float], float]:
        """``force_n`` with ``extrapolate`` as a function of volts, for who asks often.

        :param overlap_m2: as ``force_n``.
        :param thickness_m: as ``force_n``.
        :param permittivity: as ``force_n``.
        :param strips: as ``force_n``.
        :return: force (N) at an amplitude (V).
        """
        return lambda volts: self._force_n(volts, overlap_m2, thickness_m, permittivity, strips)

    def force_sd_n(
        self,
        volts: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
        *,
        extrapolate: bool = False,
    ) -> float:
        """Standard deviation of ``force_n`` from the fit's covariance, to first order; 0 below a threshold.

        :param volts: as ``force_n``.
        :param overlap_m2: as ``force_n``.
        :param thickness_m: as ``force_n``.
        :param permittivity: as ``force_n``.
        :param strips: as ``force_n``.
        :param extrapolate: as ``force_n``.
        :return: standard deviation (N); it knows nothing of what extrapolation adds.
        :raises InputError: as ``force_n``.
        """
        if not extrapolate:
            self._refuse_outside("volts", volts, "V", volts, thickness_m, permittivity)
        return self._force_sd_n(volts, overlap_m2, thickness_m, permittivity, strips)

    def volts_for(
        self,
        force_n: float,
        overlap_m2: float = BRAKE.overlap_m2,
        thickness_m: float = BRAKE.thickness_m,
        permittivity: float = BRAKE.permittivity,
        strips: int = 1,
        *,
        extrapolate: bool = False,
    ) -> float:
        """The inverse of ``force_n``: amplitude that holds a force.

        :param force_n: force to hold (N), 0 to 1e6.
        :param overlap_m2: as ``force_n``, but more than 0.
        :param thickness_m: as ``force_n``.
        :param permittivity: as ``force_n``.
        :param strips: as ``force_n``.
        :param extrapolate: as ``force_n``.
        :return: amplitude (V); 0 for what the brake holds when off.
        :raises InputError: a negative force, no overlap, or volts or a film outside the fit without ``extrapolate``.
        """
        in_range("force_n", force_n, 0.0, 1e6, "N")
        volts = self._volts_for(force_n, overlap_m2, thickness_m, permittivity, strips)
        if not extrapolate:
            self._refuse_outside("force_n", force_n, "N", volts, thickness_m, permittivity)
        return volts

    def outside(
        self, volts: float, thickness_m: float = BRAKE.thickness_m, permittivity: float = BRAKE.permittivity
    ) -> tuple[str, ...]:
        """What about a question lies outside the fit.

        :param volts: as ``force_n``.
        :param thickness_m: as ``force_n``.
        :param permittivity: as ``force_n``.
        :return: one sentence for each departure; empty inside the fit.
        :raises InputError: an argument outside its range.
        """
        in_range("volts", volts, -1e6, 1e6, "V")
        in_range("thickness_m", thickness_m, 1e-7, 1e-2, "m")
        in_range("permittivity", permittivity, 1.0, 1e3)
        found: list[str] = []
        if abs(volts) > self.fitted_to_v * (1.0 + ROUNDING):
            found.append(f"{abs(volts):.5g} V is above the {self.fitted_to_v:g} V up to which law {self.name} was fitted")
        if abs(thickness_m - BRAKE.thickness_m) > ROUNDING * BRAKE.thickness_m:
            of, at = thickness_m * 1e6, BRAKE.thickness_m * 1e6
            found.append(f"a thickness of {of:.4g} um is not the {at:.4g} um at which law {self.name} was fitted")
        if abs(permittivity - BRAKE.permittivity) > ROUNDING * BRAKE.permittivity:
            found.append(
                f"a permittivity of {permittivity:g} is not the {BRAKE.permittivity:g} at which law {self.name} was fitted"
            )
        return tuple(found)

    def _refuse_outside(self, asked: str, value: float, unit: str, volts: float, thickness_m: float, permittivity: float) -> None:
        if outside := self.outside(volts, thickness_m, permittivity):
            film = f"thickness_m = {thickness_m:g} m, permittivity = {permittivity:g}"
            refuse_outside(f"{asked} = {value:g} {unit}, {film}", outside)

    @abstractmethod
    def _force_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float: ...

    @abstractmethod
    def _force_sd_n(self, volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float: ...

    @abstractmethod
    def _volts_for(self, force_n: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int) -> float: ...

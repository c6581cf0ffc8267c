"""Pulls evaluated: slack, rise, plateau and capacity against volts, and the threshold law behind the capacities.

::

    capacity   F = F_off + k (V^2 - V0^2)           of the whole overlap
    sliding    l dT/dx = F - (F - F_off) a s - T    from where the rise meets F

``a`` is the overlap lost a metre of slip ``s``; ``l`` is the travel of the stage within the contact's release lag, by which a
falling capacity stays behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigs.fitting import Fit, Vector, least_squares_fit, quadrature
from rigs.instruments.loadcell import GAIN_SD
from rigs.instruments.stage import POSITION_GAIN_SD
from rigs.pull.parts import Plateau, Rise, Sliding, fit_rise, off_force, plateau, sliding_parts
from rigs.pull.record import PullRecord
from rigs.result import Quantity

TOP_V = 1500.0
BETWEEN_SD = 0.003
"""Of a plateau between two pulls, as a share: how straight the depth of dips goes from one to the next (assumed)."""
TABLE_V = (200.0, 400.0, 800.0)
"""Amplitudes of Table 4.2."""
DIP_SD = 0.003
"""Of a plateau, as a share: how deep dips are depends on what is shorter than a millisecond. Level ``lagged`` with its grid of
half a millisecond is up to 0.5 % above level ``reference`` (assumed to be alike on a bench)."""


@dataclass(frozen=True)
class PullFit:
    """The evaluation of all pulls.

    :param rise: slack and stiffness.
    :param plateaus: one for each slow pull, lowest volts first.
    :param sliding: one for each fast pull, lowest volts first.
    :param law: ``k_n_kv2, threshold_kv, slope_per_mm, lag_mm`` fitted to the sliding samples; in these units all have similar
        magnitudes.
    :param off_n: force without volts, N.
    :param off_sd_n: its standard deviation, N.
    """

    rise: Rise
    plateaus: tuple[Plateau, ...]
    sliding: tuple[Sliding, ...]
    law: Fit
    off_n: float
    off_sd_n: float
    zero_sd_n: float
    """Of the zero of one fast pull."""

    @property
    def k_n_v2(self) -> float:
        """N/V^2."""
        return 1e-6 * self.law.value("k_n_kv2")

    @property
    def threshold_v(self) -> float:
        """V."""
        return 1e3 * self.law.value("threshold_kv")

    def capacity_n(self, volts: float) -> float:
        """Of the whole overlap, by the law.

        :param volts: V, >= 0.
        :return: N; the force without volts below the threshold.
        """
        return self.off_n + self.k_n_v2 * max(0.0, volts**2 - self.threshold_v**2)

    def capacity_sd_n(self, volts: float) -> float:
        """Of ``capacity_n``, the load cell's gain included.

        :param volts: V, >= 0.
        :return: standard deviation, N.
        """
        k, threshold_kv, kilovolts = self.law.value("k_n_kv2"), self.law.value("threshold_kv"), 1e-3 * volts
        of_fit = self.law.sd_of({"k_n_kv2": kilovolts**2 - threshold_kv**2, "threshold_kv": -2.0 * k * threshold_kv})
        return quadrature((of_fit, self.off_sd_n, GAIN_SD * self.capacity_n(volts)))

    @property
    def threshold_sd_v(self) -> float:
        """Of the fit, and of zeros a little off, which the weakest pull takes for force."""
        return quadrature((1e3 * self.law.sd("threshold_kv"), self.zero_sd_n / (2.0 * self.k_n_v2 * self.threshold_v)))

    @property
    def misfit_share(self) -> float:
        """Root mean square of the residuals over the capacity at the top volts."""
        return float(np.sqrt(np.mean(self.law.residuals**2))) / self.capacity_n(TOP_V)

    @property
    def slid_m(self) -> float:
        """How far the strips slid in the published pull at the top volts."""
        return self.plateaus[-1].slid_m

    def plateau_law(self) -> Fit:
        """The threshold law through the plateaus, each weighted with 1 %: what a fit to a published pull gives.

        :return: ``k_n_kv2`` and ``threshold_kv``.
        """
        kilovolts = 1e-3 * np.array([one.volts for one in self.plateaus])
        force_n = np.array([one.force_n for one in self.plateaus])
        return least_squares_fit(
            lambda values: self.off_n + values[0] * (kilovolts**2 - values[1] ** 2),
            force_n,
            0.01 * force_n,
            {"k_n_kv2": self.law.value("k_n_kv2"), "threshold_kv": self.law.value("threshold_kv")},
        )

    def plateau_at(self, volts: float) -> Quantity:
        """Plateau at volts that were not pulled at: the capacity there, times plateau over capacity, smooth between the pulls.

        At the threshold nothing is held that could dip. (The law through the plateaus is 2 % off at 400 V: dips deepen with the
        time that charging takes, and not with the square of the volts.)

        :param volts: from the threshold to 1500 V.
        :return: N, with its standard deviation.
        """
        from scipy.interpolate import PchipInterpolator

        at_v = [self.threshold_v, *(one.volts for one in self.plateaus)]
        left = PchipInterpolator(at_v, [1.0, *(one.force_n / self.capacity_n(one.volts) for one in self.plateaus)])
        force_n = float(left(volts)) * self.capacity_n(volts)
        return Quantity(force_n, quadrature((self.capacity_sd_n(volts), DIP_SD * force_n, BETWEEN_SD * force_n)), "N")

    def quantities(self) -> dict[str, Quantity]:
        """What the rig is for.

        :return: by name, in SI units.
        """
        law, rise, top = self.law, self.rise, self.plateaus[-1]
        k, slope = self.k_n_v2, 1e3 * law.value("slope_per_mm")
        return {
            "k_n_v2": Quantity(k, quadrature((1e-6 * law.sd("k_n_kv2"), GAIN_SD * k)), "N/V^2"),
            "threshold_v": Quantity(self.threshold_v, self.threshold_sd_v, "V"),
            "capacity_1500_n": Quantity(self.capacity_n(TOP_V), self.capacity_sd_n(TOP_V), "N"),
            "plateau_1500_n": Quantity(top.force_n, quadrature((top.sd_n, GAIN_SD * top.force_n, DIP_SD * top.force_n)), "N"),
            **{f"plateau_{volts:.0f}_n": self.plateau_at(volts) for volts in TABLE_V},
            "off_force_n": Quantity(self.off_n, quadrature((self.off_sd_n, GAIN_SD * self.off_n)), "N"),
            "slack_m": Quantity(rise.slack_m, rise.slack_sd_m, "m"),
            "stiffness_n_m": Quantity(rise.stiffness_n_m, rise.stiffness_sd_n_m, "N/m"),
            "overlap_slope_per_m": Quantity(slope, quadrature((1e3 * law.sd("slope_per_mm"), POSITION_GAIN_SD * slope)), "1/m"),
        }

    def levels(self) -> list[dict[str, Any]]:
        """What was seen at each voltage, as plain data.

        :return: one entry for each slow pull: V and N.
        """
        return [
            {
                "volts": one.volts,
                "capacity_n": self.capacity_n(one.volts),
                "plateau_n": one.force_n,
                "plateau_sd_n": one.sd_n,
                "ripple_n": one.ripple_n,
                "peak_n": one.peak_n,
            }
            for one in self.plateaus
        ]

    def notes(self) -> tuple[str, ...]:
        """What a reader should know.

        :return: sentences for the page.
        """
        top, through = self.plateaus[-1], self.plateau_law()
        capacity_n = self.capacity_n(TOP_V)
        return (
            "k and V0 are of the capacity: what the brake holds while its volts stand still, at the overlap it began with and "
            "the volts asked for.",
            f"At 1500 V the plateau of the published pull (1 mm/s, 10 Hz) is {top.force_n:.2f} N, "
            f"{100 * (1 - top.force_n / capacity_n):.0f} % below the capacity of {capacity_n:.2f} N: the dips at reversals. "
            f"Through the plateaus the same law has k {1e-6 * through.value('k_n_kv2'):.3g} N/V^2 and "
            f"V0 {1e3 * through.value('threshold_kv'):.0f} V.",
        )


def fit_pulls(record: PullRecord, noise_n: float) -> PullFit:
    """Evaluate all pulls.

    :param record: of a whole run.
    :param noise_n: standard deviation of one sample.
    :return: the evaluation.
    :raises InputError: too little slides to fit.
    """
    slow = [one for one in record.pulls if one.slow and one.volts]
    fast = [one for one in record.pulls if not one.slow]
    off = next(one for one in record.pulls if not one.volts)
    rise = fit_rise(record, slow, noise_n)
    plateaus = tuple(plateau(record, one, rise) for one in slow)
    sliding = sliding_parts(record, fast, rise)
    off_n, off_sd_n = off_force(record, off, rise, noise_n)
    zero_sd_n = quadrature((record.zero_sd_n(fast[0], noise_n, 0.5 * record.travel_m / fast[0].speed_m_s), off_sd_n))
    return PullFit(rise, plateaus, sliding, fit_law(sliding, rise, off_n, noise_n), off_n, off_sd_n, zero_sd_n)


def fit_law(sliding: Sequence[Sliding], rise: Rise, off_n: float, noise_n: float) -> Fit:
    """The threshold law, with overlap lost and the contact's lag, through all samples that slid.

    Since the strips began to slide the stage has travelled ``w = x - slack - F/k_s``, and ``T`` solves the line above:
    ``T = F - (c / b) (w - (l / b) (1 - exp(-b w / l)))`` with ``c = (F - F_off) a`` and ``b = 1 - c / k_s``.

    :param sliding: samples of each fast pull.
    :param rise: slack and stiffness from the slow pulls.
    :param off_n: force without volts, N.
    :param noise_n: standard deviation of one sample, N.
    :return: ``k_n_kv2, threshold_kv, slope_per_mm, lag_mm``.
    :raises InputError: too few of them.
    """
    kilovolts = np.concatenate([np.full(len(one.taut_m), 1e-3 * one.volts) for one in sliding])
    taut_mm = np.concatenate([1e3 * one.taut_m for one in sliding])
    force_n = np.concatenate([one.force_n for one in sliding])
    stiffness_n_mm = 1e-3 * rise.stiffness_n_m

    def model(values: Vector) -> Vector:
        k, threshold_kv, slope, lag_mm = values
        over_n = k * (kilovolts**2 - threshold_kv**2)
        lost_n_mm = slope * over_n
        stays = 1.0 - lost_n_mm / stiffness_n_mm
        gone_mm = np.maximum(taut_mm - (off_n + over_n) / stiffness_n_mm, 0.0)
        behind_mm = lag_mm / stays * -np.expm1(-stays * gone_mm / lag_mm)
        return off_n + over_n - lost_n_mm / stays * (gone_mm - behind_mm)

    return least_squares_fit(
        model,
        force_n,
        noise_n,
        {"k_n_kv2": 10.0, "threshold_kv": 0.15, "slope_per_mm": 9e-3, "lag_mm": 0.4},
        bounds={"lag_mm": (1e-3, 5.0), "threshold_kv": (0.0, 1.0)},
    )

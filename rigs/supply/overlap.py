"""Capacitance of a brake against how far its strips were pulled apart: an overlap sensor.

A hand first takes out the slack; from there on every metre takes ``e_r e_0 w / d`` of capacitance (from Eq 4.1: 23 pF/mm).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigs.fitting import Vector, least_squares_fit


@dataclass(frozen=True)
class OverlapFit:
    """``C = whole_f - sensitivity max(0, x - slack)``: strips slide once the slack is out.

    :param whole_f: capacitance at full overlap, F.
    :param sensitivity_f_m: loss over travel, F/m.
    :param sensitivity_sd: its standard deviation, F/m.
    :param slack_m: travel before the strips slide, m.
    :param reduced_chi2: of the line.
    """

    whole_f: float
    sensitivity_f_m: float
    sensitivity_sd: float
    slack_m: float
    reduced_chi2: float
    lost_f: float
    """Between the first stop and the last."""

    def at(self, travel_m: Vector) -> Vector:
        """Capacitance at some travels.

        :param travel_m: of the stage (n,), m.
        :return: (n,), F.
        """
        return self.whole_f - self.sensitivity_f_m * np.maximum(0.0, travel_m - self.slack_m)


def fit_overlap(rows: Sequence[tuple[float, float, float]]) -> OverlapFit:
    """The line through all stops.

    :param rows: travel (m), capacitance (F) and its standard deviation (F) at each stop, at least 4.
    :return: the line.
    :raises InputError: too few stops.
    """
    travel_m, c_f, sd_f = (np.array(column) for column in zip(*rows, strict=True))

    def model(values: Vector) -> Vector:
        whole_f, lost_f_m, slack_m = values
        return whole_f - lost_f_m * np.maximum(0.0, travel_m - slack_m)

    farthest_m = float(travel_m.max())
    start = {"whole_f": float(c_f[0]), "lost_f_m": float((c_f[0] - c_f[-1]) / (0.9 * farthest_m)), "slack_m": 0.1 * farthest_m}
    # One sd for all stops: that of a single one is itself too uncertain to weigh by.
    each_f = float(np.sqrt(np.mean(sd_f**2)))
    fit = least_squares_fit(model, c_f, each_f, start, bounds={"slack_m": (0.0, 0.8 * farthest_m)})
    return OverlapFit(
        whole_f=fit.value("whole_f"),
        sensitivity_f_m=fit.value("lost_f_m"),
        sensitivity_sd=fit.sd("lost_f_m"),
        slack_m=fit.value("slack_m"),
        reduced_chi2=fit.reduced_chi2,
        lost_f=float(c_f[0] - c_f[-1]),
    )

"""The pull rig's curves: force over time (Fig 4.7b) and force against volts (Fig 4.7c), with what is published."""

from __future__ import annotations

import numpy as np

from haptics.physics.brake.fit import PUBLISHED_POINTS, point_sd_n
from rigs.pull.fit import TOP_V, PullFit
from rigs.pull.record import PullRecord
from rigs.result import Plot, series

_DRAWN = 500


def pull_plots(record: PullRecord, fit: PullFit, name: str) -> tuple[Plot, ...]:
    """Force of the published pulls over time; capacity and plateau against volts with the law.

    :param record: of a whole run.
    :param fit: its evaluation.
    :param name: of the rig, the first word of each plot's name.
    :return: force against volts, and the pulls.
    """
    curves = []
    for one in record.pulls:
        if one.slow:
            seconds, force_n = record.of(one)
            some = np.linspace(0, len(seconds) - 1, _DRAWN).astype(int)
            curves.append(series(f"{one.volts:g} V", "measured", seconds[some], force_n[some]))
    over_time = Plot(
        name=f"{name}-time",
        title="Strips pulled apart at 1 mm/s, 10 Hz",
        x_label="time (s)",
        y_label="force (N)",
        series=tuple(curves),
    )
    return over_time, _against_volts(fit, name)


def _against_volts(fit: PullFit, name: str) -> Plot:
    volts = np.array([one.volts for one in fit.plateaus])
    every_v = np.linspace(0.0, TOP_V, 151)
    capacity_n = np.array([_capacity_seen_n(fit, one) for one in range(len(fit.sliding))])
    capacity_sd_n = np.array([fit.capacity_sd_n(one) for one in volts])
    plateau_n = np.array([one.force_n for one in fit.plateaus])
    plateau_sd_n = np.array([one.sd_n for one in fit.plateaus])
    published_v, published_n = np.array(PUBLISHED_POINTS["index"]).T
    law_n = np.array([fit.capacity_n(one) for one in volts])
    return Plot(
        name=f"{name}-volts",
        title="Force against volts",
        x_label="amplitude (V)",
        y_label="force (N)",
        series=(
            series("capacity", "measured", volts, capacity_n, 2.0 * capacity_sd_n),
            series("plateau of the pull", "measured", volts, plateau_n, 2.0 * plateau_sd_n),
            series("law of the capacity", "fit", every_v, np.array([fit.capacity_n(one) for one in every_v])),
            series(
                "published, plateaus (Table 4.2, 4.7.3), 2 sd",
                "published",
                published_v,
                published_n,
                np.array([2.0 * point_sd_n(one) for one in published_n]),
            ),
        ),
        residuals=(series("capacity less law", "measured", volts, capacity_n - law_n, 2.0 * capacity_sd_n),),
        residual_label="residual (N)",
    )


def _capacity_seen_n(fit: PullFit, at: int) -> float:
    """Capacity of the whole overlap from the samples of one fast pull: the law there and their mean misfit."""
    ends = np.cumsum([len(one.slip_m) for one in fit.sliding])
    residuals = fit.law.residuals[ends[at] - len(fit.sliding[at].slip_m) : ends[at]]
    return fit.capacity_n(fit.sliding[at].volts) + float(residuals.mean())

"""The pendulum rig's curves: landings averaged, in log scale, with fit and published decay (Fig 3.3); decay of each landing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptics.physics.latch.recoil import RECOIL
from rigs.pendulum.fit import SurfaceFit
from rigs.result import Plot, Series, series

_BEFORE_S, _SHOWN_S = 7e-3, 25e-3


def recoil_plots(fits: Sequence[SurfaceFit], name: str) -> tuple[Plot, ...]:
    """Averaged landings, and the decay of each single one.

    :param fits: one for each surface.
    :param name: of the rig, the first word of each plot's name.
    :return: recoil in a logarithmic scale, then decay by landing.
    """
    return _averaged(fits, name), _each(fits, name)


def _averaged(fits: Sequence[SurfaceFit], name: str) -> Plot:
    curves: list[Series] = []
    residuals: list[Series] = []
    for fit in fits:
        average, published_s = fit.average, RECOIL.tau_s(fit.surface)
        shown = (average.after_s > -_BEFORE_S) & (average.after_s < _SHOWN_S)
        after_s, g, sd_g = average.after_s[shown], average.g[shown], average.sd_g[shown]
        ring = after_s >= 0.0
        line_g = average.start_g * np.exp(-after_s[ring] / average.tau_s)
        stated_g = RECOIL.peak_g * np.exp(-after_s[ring] / published_s)
        above = stated_g > 1e-2
        curves += [
            series(f"measured, {fit.surface}, 1 sd", "measured", 1e3 * after_s, g, sd_g),
            series(f"fit, {fit.surface}: tau {1e3 * average.tau_s:.2f} ms", "fit", 1e3 * after_s[ring][above], line_g[above]),
            series(
                f"published, {fit.surface}: 10 g, tau {1e3 * published_s:g} ms (3.5.1, no sd)",
                "published",
                1e3 * after_s[ring][above],
                stated_g[above],
            ),
        ]
        residuals.append(
            series(
                f"{fit.surface}: measured over fit",
                "measured",
                1e3 * after_s[ring][above],
                np.log(g[ring][above] / line_g[above]),
                sd_g[ring][above] / g[ring][above],
            )
        )
    return Plot(
        name=f"{name}-recoil",
        title="Recoil of landings on the off plate, aligned and averaged",
        x_label="time after the maximum acceleration (ms)",
        y_label="magnitude of acceleration (g)",
        series=tuple(curves),
        residuals=tuple(residuals),
        residual_label="ln of ratio",
        log_y=True,
    )


def _each(fits: Sequence[SurfaceFit], name: str) -> Plot:
    curves: list[Series] = []
    residuals: list[Series] = []
    for fit in fits:
        number = np.arange(1, len(fit.rings) + 1)
        tau_ms = 1e3 * np.array([ring.tau_s for ring in fit.rings])
        sd_ms = 1e3 * np.array([ring.fit.sd("tau_s") for ring in fit.rings])
        mean = fit.quantities()[f"tau_{fit.surface}_s"]
        stated_ms = 1e3 * RECOIL.tau_s(fit.surface)
        ends = number[[0, -1]]
        curves += [
            series(f"measured, {fit.surface}", "measured", number, tau_ms, sd_ms),
            series(f"mean, {fit.surface}, 1 sd", "fit", ends, [1e3 * mean.value] * 2, [1e3 * mean.sd] * 2),
            series(f"published, {fit.surface} (3.5.1)", "published", ends, [stated_ms] * 2),
        ]
        residuals.append(series(f"{fit.surface}: less mean", "measured", number, tau_ms - 1e3 * mean.value, sd_ms))
    return Plot(
        name=f"{name}-landings",
        title="Decay of each landing, its carrier fitted with it",
        x_label="landing",
        y_label="tau (ms)",
        series=tuple(curves),
        residuals=tuple(residuals),
        residual_label="residual (ms)",
    )

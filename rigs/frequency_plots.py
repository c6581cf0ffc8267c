"""The frequency rig's curves: rate delivered against rate asked, and how evenly the landings come."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigs.frequency_trains import Delivered
from rigs.result import Plot, series

_PUBLISHED_HZ = 200.0


def rate_plots(trains: Sequence[Delivered], name: str) -> tuple[Plot, ...]:
    """Of the trains whose rate could be told."""
    told = [(one.played.train.rate_hz, one.rate_hz, one.jitter_s) for one in trains]
    rows = [(asked, rate, jitter) for asked, rate, jitter in told if rate is not None and jitter is not None]
    asked_hz = np.array([asked for asked, _, _ in rows])
    rate_hz, sd_hz = np.array([(rate.value, rate.sd) for _, rate, _ in rows]).reshape(-1, 2).T
    jitter_ms, jitter_sd_ms = 1e3 * np.array([(jitter.value, jitter.sd) for _, _, jitter in rows]).reshape(-1, 2).T
    share = Plot(
        name=f"{name}-rate",
        title="Landings a second, against the rate asked for",
        x_label="asked (Hz)",
        y_label="delivered (Hz)",
        series=(
            series("measured, 1 sd", "measured", asked_hz, rate_hz, sd_hz),
            series("as asked", "fit", asked_hz, asked_hz),
            series("published: up to 200 Hz (3.4.5, 3.5.2)", "published", [_PUBLISHED_HZ], [_PUBLISHED_HZ]),
        ),
        residuals=(series("delivered over asked, less 1", "measured", asked_hz, rate_hz / asked_hz - 1.0, sd_hz / asked_hz),),
        residual_label="relative",
    )
    jitter = Plot(
        name=f"{name}-jitter",
        title="Unevenness of the landings, beyond what sampling leaves open",
        x_label="asked (Hz)",
        y_label="jitter (ms)",
        series=(series("measured, 1 sd", "measured", asked_hz, jitter_ms, jitter_sd_ms),),
    )
    return share, jitter

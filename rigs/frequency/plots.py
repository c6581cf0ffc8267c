"""The frequency rig's curves: rate delivered against rate asked, and how evenly the landings come."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigs.frequency.trains import Delivered
from rigs.result import Plot, series

_PUBLISHED_HZ = 200.0


def rate_plots(trains: Sequence[Delivered], name: str) -> tuple[Plot, ...]:
    """Of the trains whose rate could be determined.

    :param trains: as they were delivered, slowest first.
    :param name: of the rig, the first word of each plot's name.
    :return: delivered against commanded rate, and scatter of the landings.
    """
    rows = [(one, rate) for one in trains if (rate := one.rate_hz) is not None]
    asked_hz = np.array([one.played.train.rate_hz for one, _ in rows])
    rate_hz, sd_hz = np.array([(rate.value, rate.sd) for _, rate in rows]).T
    scatter_ms = 1e3 * np.sqrt([one.scatter_s2 for one, _ in rows])
    scatter_sd_ms = scatter_ms / np.sqrt([2.0 * one.freedom for one, _ in rows])
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
    scatter = Plot(
        name=f"{name}-scatter",
        title="Unevenness of the landings; that of slow trains is of the timing of a landing",
        x_label="asked (Hz)",
        y_label="scatter about even spacing (ms)",
        series=(series("measured, 1 sd", "measured", asked_hz, scatter_ms, scatter_sd_ms),),
    )
    return share, scatter

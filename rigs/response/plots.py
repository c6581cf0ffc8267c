"""The response rig's curves: both edges, all steps together, and the times that were read from them."""

from __future__ import annotations

import numpy as np

from rigs.fitting import Vector
from rigs.response.fit import HIGH, LOW, Crossing, ResponseFit
from rigs.result import Plot, Series, series

_PUBLISHED_S = 0.1


def response_plots(fit: ResponseFit, name: str) -> tuple[Plot, ...]:
    """Grip and release, as shares of the force, with the published bound of 100 ms (thesis 4.7.3).

    :param fit: of all steps.
    :param name: of the rig, the first word of each plot's name.
    :return: rise, then fall.
    """
    grip = _edge(f"{name}-grip", "0 to 1500 V", fit.rise, ((fit.begun, LOW), (fit.response, HIGH)))
    return grip, _edge(f"{name}-release", "1500 V to 0", fit.fall, ((fit.release, LOW),))


def _edge(name: str, title: str, edge: tuple[Vector, Vector], crossings: tuple[tuple[Crossing, float], ...]) -> Plot:
    seconds, share = edge
    marks = np.array([[one.at_s, level] for one, level in crossings])
    drawn: tuple[Series, ...] = (
        series("all steps", "measured", 1e3 * seconds, share),
        series("10 and 90 %", "fit", 1e3 * marks[:, 0], marks[:, 1]),
        series(
            "published: below 100 ms (4.7.3)", "published", 1e3 * np.array([_PUBLISHED_S, _PUBLISHED_S]), np.array([0.0, 1.0])
        ),
    )
    return Plot(name, title, "time since the board switched (ms)", "force over the step's force", drawn)

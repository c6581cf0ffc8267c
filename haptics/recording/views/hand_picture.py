"""The hand in a still picture: seen from the palm, its actuators coloured by temperature rise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.recording.views import view_data

SHAPE = 1.05
"""Width over height of the axes."""

_INK, _SKIN, _EDGE, _BONE = "#2b2f36", "#ecdfd3", "#bfae9f", "#b09c8b"
_FINGER_WIDTH_M, _PALM_MARGIN_M, _BORDER_M = 0.017, 0.016, 0.015
_WRIST, _INDEX_KNUCKLE, _MIDDLE_KNUCKLE, _LITTLE_KNUCKLE = 1, 7, 12, 22
_PALM_OUTLINE = (1, 2, 3, 7, 12, 17, 22, 21)

Floats = NDArray[np.floating[Any]]


def draw_hand(
    axes: Any, joints_m: Floats, centres_m: Floats, rise_k: Floats, out: NDArray[np.bool_], side: str, scale: Any
) -> Any:
    """Draw one pose.

    :param axes: of matplotlib; their limits are set.
    :param joints_m: the 26 joints of OpenXR, m (26, 3).
    :param centres_m: actuators, m (n, 3).
    :param rise_k: of each actuator, K (n,); not finite where unknown.
    :param out: whose pins are out (n,).
    :param side: "left" or "right".
    :param scale: the colour map.
    :return: what matplotlib needs for a colour bar.
    """
    flat = palm_view(joints_m, side)
    points, centres = flat(joints_m), flat(centres_m)
    middle, extent = (points.min(axis=0) + points.max(axis=0)) / 2, np.ptp(points, axis=0) + 2 * _BORDER_M
    window_m = max(extent[1], extent[0] / SHAPE) * np.array([SHAPE, 1.0])
    low, high = middle - window_m / 2, middle + window_m / 2
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.axis("off")
    points_per_m = axes.get_position().height * axes.get_figure(root=False).bbox.height / axes.figure.dpi * 72 / window_m[1]

    palm = points[list(_PALM_OUTLINE)]
    for margin_pt, colour in ((2.0, _EDGE), (0.0, _SKIN)):
        width_pt = _PALM_MARGIN_M * points_per_m + margin_pt
        axes.fill(*palm.T, facecolor=colour, edgecolor=colour, linewidth=width_pt, joinstyle="round", zorder=1)
    for first, chain in zip((1, 2, 2, 2, 2), view_data.CHAINS, strict=True):
        finger = points[chain[first:]]
        for margin_pt, colour in ((2.0, _EDGE), (0.0, _SKIN)):
            width_pt = _FINGER_WIDTH_M * points_per_m + margin_pt
            axes.plot(*finger.T, color=colour, linewidth=width_pt, solid_capstyle="round", solid_joinstyle="round", zorder=2)
        axes.plot(*points[chain].T, color=_BONE, linewidth=1.0, marker="o", markersize=2.5, zorder=3)

    colours = {"cmap": scale, "vmin": 0.0, "vmax": view_data.RISE_SCALE_K, "plotnonfinite": True}
    drawn = None
    for pins, size, edge, width_pt, name in ((~out, 70, "white", 1.2, "pin in"), (out, 170, _INK, 2.0, "pin out")):
        drawn = axes.scatter(*centres[pins].T, c=rise_k[pins], s=size, edgecolors=edge, linewidths=width_pt, zorder=5, **colours)
        axes.scatter([], [], s=size, facecolor=_SKIN, edgecolors=_INK, linewidths=width_pt, label=name)
    axes.legend(loc="lower left", frameon=False, handletextpad=0.3, labelspacing=0.9)
    axes.plot([high[0] - 0.055, high[0] - 0.005], [low[1] + 0.008] * 2, color=_INK, linewidth=1.5)
    axes.text(high[0] - 0.03, low[1] + 0.011, "50 mm", ha="center", va="bottom", color=_INK)
    return drawn


def palm_view(joints_m: Floats, side: str) -> Callable[[Floats], Floats]:
    """A projection onto the palm: fingers up, palm toward the reader.

    :param joints_m: the 26 joints of OpenXR, m (26, 3).
    :param side: "left" or "right".
    :return: a function of points, m (n, 3), to points in the plane, m (n, 2).
    """
    up = joints_m[_MIDDLE_KNUCKLE] - joints_m[_WRIST]
    up = up / (np.linalg.norm(up) or 1.0)
    across = joints_m[_INDEX_KNUCKLE] - joints_m[_LITTLE_KNUCKLE]
    across = across - (across @ up) * up
    across = across / (np.linalg.norm(across) or 1.0) * (-1.0 if side == "left" else 1.0)
    return lambda points: np.stack([(points - joints_m[_WRIST]) @ across, (points - joints_m[_WRIST]) @ up], axis=-1)

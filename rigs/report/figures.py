"""A ``Plot`` drawn with matplotlib: measured points, fitted lines, published points with their error bars, residuals below.

The same plot gives the same bytes: no time, no random identifiers, no settings of the person who runs it.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.extras import install
from rigs.result import Look, Plot, Series

_INK, _FAINT = "#22262d", "#c9ced6"
_COLOURS = {"measured": ("#0072b2", "#56b4e9", "#00507a"), "fit": ("#d55e00", "#e69f00", "#8a3d00"), "truth": ("#777777",)}
_PUBLISHED = ("#009e73", "#cc79a7", "#004d38")
_WIDTH_IN, _HEIGHT_IN, _RESIDUAL_IN = 8.0, 4.2, 1.6
_STYLE = {
    "font.size": 10,
    "axes.edgecolor": _FAINT,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": _FAINT,
    "grid.linewidth": 0.4,
    "text.color": _INK,
    "axes.labelcolor": _INK,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "svg.fonttype": "none",
}


def png_bytes(plot: Plot) -> bytes:
    """The plot as a PNG picture.

    :param plot: to draw.
    :return: the file's bytes, the same for the same plot.
    :raises InputError: matplotlib is not installed.
    """
    return _saved(plot, "png", {"Software": None})


def svg_text(plot: Plot) -> str:
    """The plot as an ``<svg>`` element whose words are text.

    :param plot: to draw.
    :return: the element, the same for the same plot.
    :raises InputError: matplotlib is not installed.
    """
    text = _saved(plot, "svg", {"Date": None, "Creator": None}).decode()
    return text[text.index("<svg") :]


def _saved(plot: Plot, kind: str, metadata: dict[str, Any]) -> bytes:
    try:
        import matplotlib
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f"plots need matplotlib; install with: {install('report')}") from error
    style: Any = {
        **matplotlib.rcParamsDefault,
        **_STYLE,
        "svg.hashsalt": plot.name,
    }  # identifiers differ between plots of one page
    with matplotlib.rc_context(style):
        height_in = _HEIGHT_IN + (_RESIDUAL_IN if plot.residuals else 0.0)
        figure = Figure(figsize=(_WIDTH_IN, height_in), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        _draw(figure, plot)
        out = io.BytesIO()
        figure.savefig(out, format=kind, metadata=metadata)
    return out.getvalue()


def _draw(figure: Any, plot: Plot) -> None:
    if plot.residuals:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[_HEIGHT_IN, _RESIDUAL_IN])
    else:
        above, below = figure.subplots(), None
    _draw_all(above, plot.series)
    above.set_title(plot.title, loc="left", fontsize=11, fontweight="bold")
    above.set_ylabel(plot.y_label)
    if plot.log_y:
        above.set_yscale("log")
    figure.legend(*above.get_legend_handles_labels(), loc="outside lower left", ncols=2, handlelength=1.6)
    if below is None:
        above.set_xlabel(plot.x_label)
        return
    below.axhline(0.0, color=_INK, linewidth=0.8)
    _draw_all(below, plot.residuals)
    below.set_xlabel(plot.x_label)
    below.set_ylabel(plot.residual_label)


def _draw_all(axes: Any, shown: tuple[Series, ...]) -> None:
    used: dict[Look, int] = {}
    for one in shown:
        order = used.get(one.look, 0)
        used[one.look] = order + 1
        colours = _PUBLISHED if one.look == "published" else _COLOURS[one.look]
        _draw_series(axes, one, colours[order % len(colours)])


def _draw_series(axes: Any, one: Series, colour: str) -> None:
    lines = one.look in ("fit", "truth") or (one.look == "published" and one.error is None)
    if lines:
        axes.plot(one.x, one.y, "--" if one.look == "published" else "-", color=colour, label=one.label, linewidth=1.5, zorder=3)
        return
    if one.error is not None:
        mark = "s" if one.look == "published" else "o"
        axes.errorbar(
            one.x, one.y, yerr=np.abs(one.error), fmt=mark, markersize=5, color=colour, capsize=3, label=one.label, zorder=4
        )
        return
    size, alpha = (16, 1.0) if len(one.x) < 100 else (4, 0.6)
    axes.scatter(one.x, one.y, s=size, color=colour, label=one.label, alpha=alpha, linewidths=0, zorder=2)

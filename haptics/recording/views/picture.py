"""A recording as one still picture (extra ``report``).

Above: the hand at the moment when most pins were out, and the run in numbers. Below, over time: which pins were out, which were
pulsed and when the hand touched, the brakes' volts and force, the temperature rises.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.extras import install
from haptics.recording.output import replacing
from haptics.recording.recording import Recording
from haptics.recording.views import view_data
from haptics.recording.views.hand_picture import SHAPE, draw_hand
from haptics.time import NS_PER_S
from haptics.units import engineering

_INK, _FAINT = "#2b2f36", "#c9ced6"
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
_WIDTH_IN, _HEIGHT_IN, _TOP = 11.0, 12.5, 0.4


def write_picture(recording: Recording, path: str | os.PathLike[str], *, force: bool = False) -> Path:
    """Write ``recording`` as a PNG picture.

    :param recording: what to draw.
    :param path: the file to write (``.png``).
    :param force: overwrite it if it exists.
    :return: the file.
    :raises InputError: matplotlib is not installed, or ``path`` exists and ``force`` is not given.
    """
    matplotlib = _matplotlib()
    out = Path(path)
    # a person's own settings must not change what a recording looks like
    style = {**matplotlib.rcParamsDefault, "font.size": 9, "axes.edgecolor": _FAINT, "axes.axisbelow": True}
    style |= {"axes.spines.top": False, "axes.spines.right": False, "text.color": _INK, "axes.labelcolor": _INK}
    style |= {"grid.color": _FAINT, "grid.linewidth": 0.4, "lines.linewidth": 1.3, "legend.frameon": False}
    style |= {"text.parse_math": False}  # a name with $ in it is a name
    with replacing(out, force) as partial, matplotlib.rc_context(style):
        figure = matplotlib.figure.Figure(figsize=(_WIDTH_IN, _HEIGHT_IN), dpi=110, layout="constrained")
        matplotlib.backends.backend_agg.FigureCanvasAgg(figure)
        _draw(figure, recording, matplotlib)
        figure.savefig(partial, format="png", metadata={"Software": None})
    return out


def _draw(figure: Any, recording: Recording, matplotlib: Any) -> None:
    ticks = view_data.rows(recording, "ticks", ())
    sites = view_data.sites_of(recording)
    origin_ns = view_data.start_ns(recording)
    moment_ns = _moment_ns(recording, ticks)
    top, below = figure.subfigures(2, 1, height_ratios=[_TOP, 1 - _TOP])
    title = str(recording.header.get("title") or recording.path.stem).encode(errors="replace").decode()
    top.text(0.04, 0.96, title, fontsize=15, fontweight="bold", va="top")
    top.text(0.66, 0.84, "\n".join(_numbers(recording, ticks, sites.names)), va="top", linespacing=1.6)
    _hand(top, recording, sites, ticks, moment_ns, origin_ns, matplotlib)

    panels = below.subplots(4, 1, sharex=True, height_ratios=[2.6, 1, 1, 1.4])
    time_s = view_data.seconds(ticks["time_ns"], origin_ns)
    _pins(panels[0], recording, sites.names, ticks, origin_ns)
    brakes = view_data.brakes_of(recording)
    _curves(panels[1], time_s, view_data.field(ticks, "volts"), "brake (V)", brakes)
    _curves(panels[2], time_s, view_data.field(ticks, "force_n"), "brake (N)", brakes)
    _rises(panels[3], time_s, view_data.field(ticks, "rise_k"), sites.names)
    if len(panels[1].lines):
        panels[1].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), title="output", alignment="left")
    for panel in panels:
        if moment_ns is not None:
            panel.axvline((moment_ns - origin_ns) / NS_PER_S, color=_INK, linewidth=0.8, linestyle=":")
        panel.margins(x=0)
    panels[-1].set_xlabel("time since the start (s); dotted: the moment shown above")
    below.align_ylabels(panels)


def _moment_ns(recording: Recording, ticks: NDArray[np.void]) -> int | None:
    """When most pins were out, at the middle of the first such stretch; else the middle of the hand's track."""
    out = np.count_nonzero(view_data.field(ticks, "pin_out"), axis=1)
    if out.any():
        first = int(out.argmax())
        length = int(np.argmax(np.append(out[first:] != out[first], True)))
        return int(ticks["time_ns"][first + length // 2])
    poses = view_data.poses_of(recording, view_data.glove_side(recording))
    return int(poses["time_ns"][len(poses) // 2]) if len(poses) else None


def _hand(
    part: Any,
    recording: Recording,
    sites: view_data.Sites,
    ticks: NDArray[np.void],
    moment_ns: int | None,
    origin_ns: int,
    matplotlib: Any,
) -> None:
    # placed by hand, as the width of fingers has to be known in points
    height = 0.81
    width = height * _TOP * _HEIGHT_IN / _WIDTH_IN * SHAPE
    axes = part.add_axes((0.04, 0.01, width, height))
    side = view_data.glove_side(recording)
    poses = view_data.poses_of(recording, side)
    if moment_ns is None or not len(poses):
        axes.axis("off")
        axes.text(0.5, 0.5, "no hand in this recording", ha="center", va="center", transform=axes.transAxes)
        return
    pose = poses[[int(np.abs(poses["time_ns"] - moment_ns).argmin())]]
    row = int(np.abs(ticks["time_ns"] - moment_ns).argmin()) if len(ticks) else 0
    count = len(sites.names)
    rise_k, out = view_data.field(ticks, "rise_k")[row : row + 1], view_data.field(ticks, "pin_out")[row : row + 1]
    rise_k = rise_k[0] if rise_k.shape == (1, count) else np.full(count, np.nan)
    out = out[0] != 0 if out.shape == (1, count) else np.zeros(count, bool)
    scale = matplotlib.colors.LinearSegmentedColormap.from_list("rise", np.array(view_data.RISE_COLOURS) / 255.0)
    drawn = draw_hand(
        axes, pose["position_m"][0], sites.positions(pose)[0], rise_k, out, side, scale.with_extremes(bad="#808080")
    )
    bar = part.colorbar(drawn, cax=part.add_axes((0.05 + width, 0.2, 0.014, 0.5)), extend="max")
    bar.set_label("temperature rise (K)")
    bar.outline.set_visible(False)
    moment_s = (moment_ns - origin_ns) / NS_PER_S
    axes.set_title(f"{side} hand at {moment_s:.2f} s, {np.count_nonzero(out)} pins out, seen from the palm", fontsize=10)


def _numbers(recording: Recording, ticks: NDArray[np.void], names: Sequence[str]) -> list[str]:
    """The run in a few lines."""
    lines = [] if recording.complete else [f"incomplete: {recording.damage} ({recording.lost_bytes} bytes lost)"]
    requests = view_data.rows(recording, "requests", ("played", "reason"))
    if len(requests):
        denied = requests[requests["played"] == 0]
        lines.append(f"pulses: {len(requests)} asked for, {len(requests) - len(denied)} played, {len(denied)} denied")
        reasons = Counter(view_data.text(denied["reason"])).most_common(3)
        lines += [f"    denied for {reason}: {count}" for reason, count in reasons]
    touches = view_data.touches_of(recording)
    if touches:
        lines.append(f"touches: {len(touches)} at {len({site for _, site in touches})} sites")
    for field, label, unit, what in (
        ("rise_k", "hottest", "K", view_data.labels(names, view_data.field(ticks, "rise_k").shape[1], "site")),
        ("volts", "highest voltage", "V", view_data.brakes_of(recording)),
        ("force_n", "largest force", "N", view_data.brakes_of(recording)),
    ):
        values = view_data.field(ticks, field)
        if values.size and np.isfinite(values).any():
            row, column = np.unravel_index(np.nanargmax(values), values.shape)
            where = view_data.labels(what, values.shape[1], "output")[column].replace("_", " ")
            if values[row, column] > 0:
                lines.append(f"{label}: {engineering(values[row, column], unit, 3)} ({where})")
    troubles = [words for _, level, words in view_data.events_of(recording) if level == "WARN" and " denied: " not in words]
    if troubles:
        lines.append(f"faults and refusals: {len(troubles)}")
        lines += [f"    {words[:48]}" for words in troubles[:4]]
    return lines


def _pins(panel: Any, recording: Recording, names: Sequence[str], ticks: NDArray[np.void], origin_ns: int) -> None:
    out = view_data.field(ticks, "pin_out") != 0
    time_s = view_data.seconds(ticks["time_ns"], origin_ns)
    lanes = view_data.labels(names, out.shape[1], "site") if out.size else list(names)
    for lane, state in enumerate(out.T):
        spans = [(time_s[first], time_s[last] - time_s[first]) for first, last in _stretches(state)]
        panel.broken_barh(spans, (lane - 0.36, 0.72), color=_COLOURS[0], linewidth=0)
    pulses = _pulses(recording, lanes, origin_ns)
    if pulses:
        panel.plot(*zip(*pulses, strict=True), "|", color=_COLOURS[2], markersize=5, markeredgewidth=0.9, label="pulse")
    touched = [(time_ns, site) for time_ns, site in view_data.touches_of(recording) if site in lanes]
    touches = [((time_ns - origin_ns) / NS_PER_S, lanes.index(site)) for time_ns, site in touched]
    if touches:
        panel.plot(*zip(*touches, strict=True), "|", color=_COLOURS[1], markersize=9, markeredgewidth=1.6, label="hand touches")
    if pulses or touches:
        panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    panel.set(yticks=range(len(lanes)), ylim=(len(lanes) - 0.5, -0.5), ylabel="pins: out, pulsed")
    panel.set_yticklabels([lane.replace("_", " ") for lane in lanes], fontsize=7.5)
    panel.grid(axis="y")


def _pulses(recording: Recording, lanes: Sequence[str], origin_ns: int) -> list[tuple[float, int]]:
    """When the pulses that were played began, s, and the lane of each."""
    requests = view_data.rows(recording, "requests", ("site", "kind", "played"))
    pulses = requests[(requests["played"] == 1) & (requests["kind"] == b"pulse")] if len(requests) else requests
    sites = (site if isinstance(site, int) else site.decode(errors="replace") for site in pulses["site"].tolist())
    found = zip(view_data.seconds(pulses["time_ns"], origin_ns).tolist(), sites, strict=True)
    places = ((time_s, site if isinstance(site, int) else lanes.index(site) if site in lanes else -1) for time_s, site in found)
    return [(time_s, lane) for time_s, lane in places if 0 <= lane < len(lanes)]


def _curves(panel: Any, time_s: NDArray[np.float64], values: NDArray[Any], label: str, brakes: Sequence[str]) -> None:
    names = view_data.labels(brakes, values.shape[1], "output")
    shown = range(len(brakes)) if brakes else range(len(names))
    for index in shown:
        panel.plot(time_s, values[:, index], color=_COLOURS[index % len(_COLOURS)], label=names[index])
    panel.set_ylabel(label)
    panel.grid()


def _rises(panel: Any, time_s: NDArray[np.float64], rise_k: NDArray[Any], names: Sequence[str]) -> None:
    peak = rise_k.max(axis=0, initial=0.0)
    labels = view_data.labels(names, rise_k.shape[1], "site")
    hottest = [index for index in np.argsort(-peak, kind="stable")[: len(_COLOURS)].tolist() if peak[index] > 0]
    for index in range(rise_k.shape[1]):
        if index not in hottest:
            panel.plot(time_s, rise_k[:, index], color=_FAINT)
    for place, index in enumerate(hottest):
        panel.plot(time_s, rise_k[:, index], color=_COLOURS[place], label=labels[index].replace("_", " "))
    panel.set_ylabel("temperature rise (K)")
    panel.set_ylim(bottom=0.0)
    panel.grid()
    if hottest:
        panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), title="hottest", alignment="left")


def _stretches(state: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Index of the first row of each stretch that is true, and of the first after it (or the last row)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], state, [False]]).astype(np.int8)))
    return [(int(first), min(int(last), len(state) - 1)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _matplotlib() -> Any:
    try:
        import matplotlib
        import matplotlib.backends.backend_agg
        import matplotlib.colors
        import matplotlib.figure
    except ImportError as error:
        raise InputError(f"pictures need matplotlib ({error}): {install('report')}") from error
    return matplotlib

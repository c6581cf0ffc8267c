"""Error against cost, a panel a model: what a level costs for one event, and how far off it is in terms of what is noticed."""

from __future__ import annotations

from pathlib import Path

from haptics.fidelity.measured import Measured, MeasuredRow
from haptics.fidelity.notice import NOTICES, force_notice
from haptics.recording.output import replacing

_FLOOR = 1e-9
"""Errors below this share of the threshold, the references' own among them, are drawn here."""
_PLATEAU_V = 1000.0


def draw(measured: Measured, path: Path, force: bool = False) -> None:
    """Write the picture as PNG; needs the extra ``report``.

    :param measured: errors and costs.
    :param path: of the file to write.
    :param force: True: overwrite it.
    :raises InputError: the file exists and may not be overwritten.
    :raises ImportError: matplotlib is not installed.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    models = list(dict.fromkeys(row.model for row in measured.rows))
    figure = Figure(figsize=(5.4 * len(models), 5.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(models), squeeze=False, sharey=True)[0]
    for panel, model in zip(panels, models, strict=True):
        # Switching trains do not distinguish levels of heat; a coil that stays on does.
        cases = "edge" if model == "thermal" else "typical"
        rows = [row for row in measured.rows if row.model == model and row.cases == cases and _threshold(row)]
        for observable in dict.fromkeys(row.observable for row in rows):
            of = [row for row in rows if row.observable == observable]
            errors = [max(row.worst / _threshold(row), _FLOOR) for row in of]
            panel.plot([row.cost_us_per_event for row in of], errors, "o-", alpha=0.7, label=observable)
        front = _front(rows)
        panel.plot(
            [cost for cost, _, _ in front], [error for _, error, _ in front], "ks--", mfc="none", ms=11, label="Pareto front"
        )
        for level in dict.fromkeys(row.level for row in rows):
            cost = next(row.cost_us_per_event for row in rows if row.level == level)
            panel.annotate(
                level, (cost, 1.0), xytext=(0, 4), textcoords="offset points", rotation=90, ha="center", va="bottom", fontsize=8
            )
        panel.axhline(1.0, color="crimson", lw=1.2, label="noticed")
        panel.axhspan(1.0 / 3.0, 1.0, color="crimson", alpha=0.08)
        panel.set(xscale="log", yscale="log", title=f"{model}, {cases} cases", xlabel="CPU time of one event, us")
        panel.grid(True, which="major", alpha=0.3)
        panel.legend(fontsize=7, loc="lower left")
    panels[0].set_ylabel("worst error / what is just noticed")
    figure.suptitle(
        f"What speed costs in accuracy (version {measured.version}, {measured.machine.get('processor', '')})", fontsize=10
    )
    with replacing(path, force) as partial:
        figure.savefig(partial, format="png", dpi=110)


def _threshold(row: MeasuredRow) -> float:
    """What is just noticed, in the row's unit; 0 for what has no such measure."""
    if row.observable == "plateau":
        return force_notice("index", _PLATEAU_V).threshold
    notice = NOTICES.get(row.observable)
    return 0.0 if notice is None else notice.threshold


def _front(rows: list[MeasuredRow]) -> list[tuple[float, float, str]]:
    """(cost, largest error, level) of the levels that no other beats in both."""
    largest: dict[str, float] = {}
    for row in rows:
        largest[row.level] = max(largest.get(row.level, _FLOOR), row.worst / _threshold(row))
    costs = {row.level: row.cost_us_per_event for row in rows}
    points = sorted((costs[level], error, level) for level, error in largest.items())
    return [p for k, p in enumerate(points) if all(p[1] < other[1] for other in points[:k])]

"""Pictures of designs (extra ``report``): how they evolved, density against coverage, and where the energy sits on the body.

The same design gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from haptics.errors import InputError
from haptics.extras import install
from haptics.garments.mesh import Bools, Floats, SurfaceMesh
from haptics.recording.output import replacing

if TYPE_CHECKING:
    from haptics.garments.design.designs import DesignSequence
    from haptics.garments.equilibrium.wearing import MotionEvaluation, WornMotion

SKIN, CLOTH_COLOUR = np.array([0.93, 0.87, 0.81]), np.array([0.78, 0.80, 0.84])
BAND_COLOUR, REINFORCED_COLOUR = np.array([0.90, 0.62, 0.72]), np.array([0.11, 0.27, 0.62])
INK, FAINT, DENSITY_COLOUR, EQ65_COLOUR = "#22262d", "#c9ced6", "#d55e00", "#777777"
COVERAGE_COLOUR, LINE_COLOUR, X_COLOUR = "#bcd3ea", "#009e73", "#cc79a7"
LIFT_M = 0.006
"""Cloth is drawn so much nearer than skin: the smooth skin it lies on runs through the body's triangles."""
FRONT, BACK = ("front", 35.0, 12.0), ("back", 145.0, 12.0)
"""Both from the wearer's left, where the sleeves are."""
PIXELS = 420
"""Longer side of one view."""
DPI = 130
SHOWN = 6
"""Designs in the picture of the sequence."""
BRIGHTEST = 0.98
"""This quantile of the energy density, by area, has the highest colour; otherwise a few triangles would take all contrast."""
_STYLE: dict[str, Any] = {
    "font.size": 10,
    "axes.edgecolor": FAINT,
    "axes.axisbelow": True,
    "text.color": INK,
    "axes.labelcolor": INK,
    "legend.frameon": False,
}


def why_no_pictures() -> str | None:
    """What to install where pictures cannot be drawn; None where they can.

    :return: a sentence for people, or None.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        return f"pictures need matplotlib ({error}): {install('report')}"
    return None


def draw_sequence(worn: WornMotion, sequence: DesignSequence, path: Path, force: bool = False) -> Path:
    """Designs from full coverage to the one asked for, on the straight body from front and back, with coverage and density.

    :param worn: the garment on its body.
    :param sequence: the designs.
    :param path: a PNG file.
    :param force: overwrite a file that exists.
    :return: the path written.
    :raises InputError: matplotlib is not installed, or ``path`` exists and ``force`` is not given.
    """
    _need_matplotlib()
    straight_m = worn.body.straight_m
    upto = sequence.steps[: sequence.steps.index(sequence.final) + 1]
    shown = spread_out([step.coverage for step in upto], SHOWN)
    colours = [design_colours(worn, sequence.steps[k].design) for k in shown]
    pictures = _front_and_back(worn, straight_m, worn.garment.on(straight_m), colours)
    rows, columns = pictures[0][0].shape[:2]
    with _figure((1.9 * len(shown) + 0.3, 2 * 1.9 * rows / columns + 1.0)) as figure:
        panels = figure.subplots(2, len(shown), squeeze=False)
        for row, (side, line) in enumerate(zip((FRONT, BACK), pictures, strict=True)):
            for column, picture in enumerate(line):
                _show(panels[row, column], picture)
            panels[row, 0].set_ylabel(side[0])
        for column, k in enumerate(shown):
            step = sequence.steps[k]
            panels[0, column].set_title(f"step {k}: {100 * step.coverage:.0f} %\ndensity × {step.density:.2f}", fontsize=10)
        _legend(figure, worn)
        return _write(figure, path, force)


def draw_density(
    sequence: DesignSequence, baselines: Mapping[str, float | None], title: str, path: Path, force: bool = False
) -> Path:
    """Energy density by step with coverage as bars behind it: the axes of the published figures 5.7 to 5.9.

    :param sequence: the designs.
    :param baselines: densities of hand-drawn designs of the same area by their names, no unit; None leaves one out.
    :param title: printed above.
    :param path: a PNG file.
    :param force: overwrite a file that exists.
    :return: the path written.
    :raises InputError: matplotlib is not installed, or ``path`` exists and ``force`` is not given.
    """
    chosen = sequence.steps.index(sequence.final)
    number = np.arange(len(sequence.steps))
    with _figure((8.0, 4.2)) as figure:
        bars = figure.subplots()
        lines = bars.twinx()
        bars.bar(number, [100 * s.coverage for s in sequence.steps], 1.0, color=COVERAGE_COLOUR, label="coverage", linewidth=0)
        lines.plot(
            number, [s.density for s in sequence.steps], color=DENSITY_COLOUR, lw=2, label="density of the reinforced part"
        )
        lines.plot(
            number, [s.density_eq65 for s in sequence.steps], "--", color=EQ65_COLOUR, lw=1.2, label="whole garment (eq. 6.5)"
        )
        lines.plot(chosen, sequence.final.density, "o", color=DENSITY_COLOUR, ms=8, clip_on=False, label="the design asked for")
        for (name, density), colour in zip(baselines.items(), (LINE_COLOUR, X_COLOUR), strict=False):
            if density is not None:
                lines.plot(chosen, density, "D", color=colour, ms=7, clip_on=False, label=f"drawn {name}, equal area")
        lines.axhline(1.0, color=FAINT, lw=0.8)
        lines.set(ylabel="energy density, × fully reinforced", xlim=(-0.5, len(number) - 0.5))
        lines.set_ylim(bottom=0.0)
        bars.set(xlabel="BESO step", ylabel="coverage (%)", ylim=(0, 105))
        # The line belongs in front, and at the left as in the source.
        bars.yaxis.set_label_position("right")
        bars.yaxis.tick_right()
        lines.yaxis.set_label_position("left")
        lines.yaxis.tick_left()
        lines.set_title(title, loc="left", fontsize=11, fontweight="bold")
        handles = [axes.get_legend_handles_labels() for axes in (lines, bars)]
        figure.legend(handles[0][0] + handles[1][0], handles[0][1] + handles[1][1], loc="outside lower left", ncols=3, fontsize=9)
        return _write(figure, path, force)


def draw_energy(
    worn: WornMotion, design: Bools, positions_m: Floats, element_energy_j: Floats, title: str, path: Path, force: bool = False
) -> Path:
    """The design and its energy on the body at the end of the motion, from front and back.

    :param worn: the garment on its body.
    :param design: reinforced triangles, ``(triangles,)``.
    :param positions_m: the equilibrium, m, ``(vertices, 3)``.
    :param element_energy_j: strain energy of each triangle, J, ``(triangles,)``.
    :param title: printed above.
    :param path: a PNG file.
    :param force: overwrite a file that exists.
    :return: the path written.
    :raises InputError: matplotlib is not installed, or ``path`` exists and ``force`` is not given.
    """
    _need_matplotlib()
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    areas_m2 = worn.simulation.areas_m2
    density_j_m2 = element_energy_j / areas_m2
    scale = Normalize(0.0, brightest(density_j_m2, areas_m2))
    colours = colormaps["viridis"](scale(density_j_m2))[:, :3]
    posed_m = worn.posed_m(worn.motion.end_deg(worn.angle_deg))
    front, back = _front_and_back(worn, posed_m, positions_m, [design_colours(worn, design), colours])
    rows, columns = front[0].shape[:2]
    with _figure((11.0, 2.45 * rows / columns + 1.1)) as figure:
        panels = figure.subplots(1, 4)
        names = ("design, front", "design, back", "energy, front", "energy, back")
        for panel, picture, name in zip(panels, (front[0], back[0], front[1], back[1]), names, strict=True):
            _show(panel, picture)
            panel.set_title(name, fontsize=10)
        figure.colorbar(
            ScalarMappable(scale, "viridis"), ax=panels[3], label="strain energy by area (J/m²)", extend="max", shrink=0.8
        )
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
        _legend(figure, worn)
        return _write(figure, path, force)


def draw_motion(evaluations: Mapping[str, MotionEvaluation], title: str, path: Path, force: bool = False) -> Path:
    """Energy and joint torque by angle, one curve for each design.

    :param evaluations: at least one, up to four, by the design's name.
    :param title: printed above.
    :param path: a PNG file.
    :param force: overwrite a file that exists.
    :return: the path written.
    :raises InputError: matplotlib is not installed, or ``path`` exists and ``force`` is not given.
    """
    with _figure((9.0, 3.8)) as figure:
        energy, torque = figure.subplots(1, 2)
        for (name, found), colour in zip(evaluations.items(), (DENSITY_COLOUR, LINE_COLOUR, X_COLOUR, EQ65_COLOUR), strict=False):
            energy.plot(found.angles_deg, found.energy_j, "o-", ms=3, color=colour, label=name)
            torque.plot(found.angles_deg, found.torque_n_m, "o-", ms=3, color=colour)
        energy.set(xlabel="angle from straight (deg)", ylabel="strain energy (J)")
        torque.set(xlabel="angle from straight (deg)", ylabel="torque against the motion (N m)")
        angles = next(iter(evaluations.values())).angles_deg
        for axes in (energy, torque):
            axes.grid(color=FAINT, lw=0.4)
            axes.spines[["top", "right"]].set_visible(False)
            axes.set_xlim(angles[0], angles[-1])  # in the direction of the motion
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
        figure.legend(*energy.get_legend_handles_labels(), loc="outside lower left", ncols=4, fontsize=9)
        return _write(figure, path, force)


def design_colours(worn: WornMotion, design: Bools) -> Floats:
    """Colours of the triangles: reinforced, held to the body, or neither.

    :param worn: the garment on its body.
    :param design: reinforced triangles, ``(triangles,)``.
    :return: red, green, blue, 0 to 1, ``(triangles, 3)``.
    """
    colours = np.where(worn.garment.attached[:, None], BAND_COLOUR, CLOTH_COLOUR)
    return np.where(design[:, None], REINFORCED_COLOUR, colours)


def brightest(density_j_m2: Floats, areas_m2: Floats) -> float:
    """The density that 98 % of the area are below.

    :param density_j_m2: energy by area, J/m2, ``(triangles,)``.
    :param areas_m2: m2, ``(triangles,)``.
    :return: J/m2, at least 1e-12.
    """
    order = np.argsort(density_j_m2)
    below = np.cumsum(areas_m2[order]) / areas_m2.sum()
    return max(float(density_j_m2[order][np.searchsorted(below, BRIGHTEST)]), 1e-12)


def spread_out(coverages: Sequence[float], count: int) -> list[int]:
    """Numbers of some steps, first and last among them, whose coverages fall by equal factors.

    :param coverages: of all steps, in their order, at least one.
    :param count: the largest number of steps to choose.
    :return: sorted step numbers, at most ``count``.
    """
    wanted = np.geomspace(coverages[0], coverages[-1], min(count, len(coverages)))
    nearest = [int(np.argmin(np.abs(np.asarray(coverages) - each))) for each in wanted]
    return sorted({*nearest[:-1], len(coverages) - 1})


def _front_and_back(worn: WornMotion, body_m: Floats, cloth_m: Floats, colours: Sequence[Floats]) -> list[list[Floats]]:
    """The garment on the body in each of the colourings, ``(triangles, 3)``: a row from the front, one from the back.

    All to the same scale.
    """
    from haptics.garments.views.shading import Painted, framed, shaded

    body, cloth = SurfaceMesh(body_m, worn.body.triangles), SurfaceMesh(cloth_m, worn.garment.triangles)
    skin = np.broadcast_to(SKIN, body.triangles.shape).copy()
    views = [framed(cloth_m, azimuth, elevation) for _, azimuth, elevation in (FRONT, BACK)]
    width, height = max(view.width_m for view in views), max(view.height_m for view in views)
    views = [replace(view, width_m=width, height_m=height) for view in views]
    pixels_per_m = PIXELS / max(width, height)
    return [[shaded([Painted(body, skin), Painted(cloth, c, LIFT_M)], view, pixels_per_m) for c in colours] for view in views]


def _show(axes: Any, picture: Floats) -> None:
    axes.imshow(picture, interpolation="antialiased")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _legend(figure: Any, worn: WornMotion) -> None:
    from matplotlib.patches import Patch

    kinds = [("reinforced", REINFORCED_COLOUR), ("cloth", CLOTH_COLOUR)]
    if worn.garment.attached.any():
        kinds.append(("cloth held to the body", BAND_COLOUR))
    figure.legend(
        handles=[Patch(color=tuple(colour), label=name) for name, colour in kinds], loc="outside lower left", ncols=3, fontsize=9
    )


def _need_matplotlib() -> None:
    missing = why_no_pictures()
    if missing:
        raise InputError(missing)


@contextmanager
def _figure(size_in: tuple[float, float]) -> Iterator[Any]:
    """A figure in the project's style, whatever the settings of the person who runs it."""
    _need_matplotlib()
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: Any = {**matplotlib.rcParamsDefault, **_STYLE}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size_in, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def _write(figure: Any, path: Path, force: bool) -> Path:
    with replacing(path, force) as partial:
        figure.savefig(partial, format="png", metadata={"Software": None})
    return path

"""Table 5.1 as a page: published, ours, a drawn line and X of the same area, why they differ, and what the designs look like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from haptics.garments.bodies import MOTIONS
from haptics.recording.output import refuse_existing, replacing
from rigs.characterize import made_with
from rigs.garments.table import MadeRow, TableOptions
from rigs.reference import curve
from rigs.report import Block, Page, render_page
from rigs.report.page import Picture, Table

VERTICES, STEPS, SECONDS, INCREASE = "table51_vertices", "table51_steps", "table51_time", "table51_density"
WHY = (
    "The source's bodies are SMPL shapes in recorded poses. Neither shapes nor poses nor drawings of the designs are "
    "published: ours is another body, and the angles of the motions and the joints' shares of them are assumed. The "
    "published figures are trends to reproduce, not values to hit.",
    "The stiffness of the attachments is published without a unit (k = 0.002 a triangle, 5.4.3) and is assumed here, by "
    "area. How the source drew its line and its X is not published either: ours are the best of several places around the "
    "garment.",
    "How many steps it takes depends on when a design counts as settled; that threshold is not published. Times of a step "
    "are those of an RTX 2080 Ti with L-BFGS there, and of this machine's processor with Newton's method here.",
    "Density is the energy of the reinforced part by its area, over that of the fully reinforced garment (5.6.2). Beside it"
    " stands the measure of eq. 6.5: the energy of the whole garment by the reinforced area.",
)


def write_report(rows: Sequence[MadeRow], options: TableOptions, path: Path, force: bool = False) -> Path:
    """The page as one file that holds its pictures.

    :param rows: to show.
    :param options: that they were made with.
    :param path: of the HTML file.
    :param force: overwrite it if it exists.
    :return: ``path``.
    :raises InputError: it exists and ``force`` is not given; jinja2 is not installed.
    """
    refuse_existing(path, force)
    text = render_page(page_of(rows, options))
    with replacing(path, force) as partial:
        partial.write_text(text, encoding="utf-8")
    return path


def page_of(rows: Sequence[MadeRow], options: TableOptions) -> Page:
    """The page: both tables, why they differ, and each row's pictures.

    :param rows: to show.
    :param options: that they were made with.
    :return: the page, not yet rendered.
    """
    sound = [row for row in rows if row.sound]
    beaten = [row for row in rows if row.beats_drawn]
    summary = (
        f"{len(sound)} of {len(rows)} designs were made without a fault; {len(beaten)} of {len(rows)} store more for their area "
        f"than both the drawn line and the drawn X. Body: {options.body}, mesh: {options.level}."
    )
    tables = [
        Table("energy density, times that of the fully reinforced garment", INCREASE_HEAD, increase_cells(rows)),
        _costs(rows),
    ]
    blocks = [
        Block("Table 5.1, published and ours", warnings=warnings_of(rows), tables=tables),
        Block("Why they differ", text=WHY, tables=[_differences(rows)]),
        *(_pictures(row) for row in rows if row.data is not None),
    ]
    settings = {"body": options.body, "phenotype": _pairs(options.phenotype), "level": options.level}
    settings |= {"solver": ", ".join(sorted({str(row.data["solver"]) for row in rows if row.data}))}
    return Page("Kinesthetic garments: Table 5.1", summary, blocks, settings | made_with())


INCREASE_HEAD = ("design", "motion", "coverage", "published", "ours", "ours, eq. 6.5", "drawn line", "drawn X")


def increase_cells(rows: Sequence[MadeRow]) -> list[tuple[str | None, ...]]:
    """The table of energy densities, times that of the fully reinforced garment, row by row under ``INCREASE_HEAD``.

    :param rows: to show.
    :return: cells of each row; None where the row could not be made.
    """
    cells = []
    for row in rows:
        case, published = row.case, f"{curve(INCREASE).at(row.case.label).y:.2f}"
        if row.data is None:
            cells.append((case.written, case.motion, None, published, None, None, None, None))
            continue
        ratios = (
            row.data["density_increase"],
            row.data["density_increase_eq65"],
            *(row.data[s]["density"] for s in ("line", "x")),
        )
        motion, covered = f"{case.motion}, {row.data['angle_deg']:g}°", f"{100 * row.data['coverage']:.1f} %"
        cells.append((case.written, motion, covered, published, *map(_ratio, ratios)))
    return cells


def _costs(rows: Sequence[MadeRow]) -> Table:
    head = ("design", "vertices, published", "ours", "steps, published", "ours (converged)", "s a step, published", "ours (95 %)")
    cells = []
    for row in rows:
        data = row.data or {}
        seconds = data.get("seconds_per_step", {"median": None, "p95": None})
        cells.append(
            (
                row.case.written,
                f"{1e3 * curve(VERTICES).at(row.case.label).y:.0f}",
                data.get("vertices"),
                f"{curve(STEPS).at(row.case.label).y:.0f}",
                f"{data['steps']} ({data['converged_steps']})" if data else None,
                f"{curve(SECONDS).at(row.case.label).y:.2f}",
                None if seconds["median"] is None else f"{seconds['median']:.2f} ({seconds['p95']:.2f})",
            )
        )
    return Table("what it takes", head, cells)


def _differences(rows: Sequence[MadeRow]) -> Table:
    """For each row what is known to differ, and by how much the result does."""
    head = ("design", "ours over published", "mesh, ours over published", "what is assumed")
    cells = []
    for row in rows:
        share = None if row.data is None else row.data["density_increase"] / curve(INCREASE).at(row.case.label).y
        mesh = None if row.data is None else row.data["vertices"] / (1e3 * curve(VERTICES).at(row.case.label).y)
        motion = MOTIONS[row.case.motion]
        joints = ", ".join(sorted({joint.split("_")[0] for joint in motion.turns}))
        cells.append((row.case.written, _ratio(share), _ratio(mesh), f"{motion.default_deg:g}° and its shares of: {joints}"))
    return Table("row by row", head, cells)


def warnings_of(rows: Sequence[MadeRow]) -> list[str]:
    """What a reader must not overlook: faults, rows that could not be made, designs that a drawn one beats.

    :param rows: to look through.
    :return: one line for each; empty if there is nothing to warn of.
    """
    found = [f"{row.case.written}: {fault}" for row in rows if row.data for fault in row.data["faults"]]
    found += [f"{row.case.written}: {row.why_not}" for row in rows if row.data is None]
    found += [f"{row.case.written}: a drawn design stores more for its area" for row in rows if row.beats_drawn is False]
    return found


def _pictures(row: MadeRow) -> Block:
    assert row.data is not None
    data, read = row.data, lambda name: (row.folder / name).read_bytes()
    text = [
        f"{data['garment']} against {data['motion']} by {data['angle_deg']:g}°: {100 * data['coverage']:.1f} % covered, density "
        f"× {data['density_increase']:.2f}, {data['energy_j']:.3g} J. "
        f"Drawn line: {data['line'].get('place', 'none')}. Drawn X: {data['x'].get('place', 'none')}."
    ]
    pictures = [
        Picture("Designs between full coverage and the last, on the straight body", read("sequence.png")),
        Picture("Energy density by step, coverage behind it", read("density.png")),
        Picture("The design and its energy at the end of the motion", read("garment.png")),
    ]
    return Block(row.case.written, text, pictures=pictures)


def _ratio(value: float | None) -> str | None:
    return None if value is None else f"{value:.2f}"


def _pairs(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in sorted(values.items())) or "default"

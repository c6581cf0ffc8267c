"""``haptics garment report``: the published designs made here, as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from haptics.cli.garment import Body, Force, Json, Level, Phenotype, Solver, phenotype_of, watched
from haptics.cli.show import print_json, print_table


def report(
    out: Annotated[Path, typer.Option(help="page to write, HTML")],
    body: Body = "capsule",
    phenotype: Phenotype = None,
    level: Level = "draft",
    motions: Annotated[
        list[str] | None, typer.Option("--motion", "--motions", help="only this row; repeat [default: all]")
    ] = None,
    coverage: Annotated[float | None, typer.Option(help="of all rows [default: the published ones]")] = None,
    solver: Solver = None,
    folder: Annotated[Path | None, typer.Option(help="designs are kept here, and go on [default: OUT without .html]")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Make the designs of Table 5.1 on a body, and put published numbers, ours, drawn designs and pictures on one page."""
    from haptics.recording.output import check_outputs, make_folder
    from rigs.garments.report import INCREASE_HEAD, increase_cells, warnings_of, write_report
    from rigs.garments.table import TableOptions, make_rows

    check_outputs({"out": out}, force)
    options = TableOptions(body, phenotype_of(phenotype), level, tuple(motions or ()), coverage, solver)
    with watched(min(options.coverage_of(case) for case in options.cases), silent=json) as (progress, say):
        designs = folder or out.with_suffix("")
        make_folder(designs)
        rows = make_rows(options, designs, progress, say)
    write_report(rows, options, out, force)
    if json:
        made = [{"case": row.case.label, "folder": str(row.folder), "why_not": row.why_not, "design": row.data} for row in rows]
        print_json({"rows": made, "files": [str(out)]})
    else:
        print_table(
            "energy density, times that of the fully reinforced garment",
            INCREASE_HEAD,
            increase_cells(rows),
        )
        for one in warnings_of(rows):
            print(f"note: {one}")
        print(f"page: {out}")
    if not all(row.sound for row in rows):
        raise typer.Exit(1)

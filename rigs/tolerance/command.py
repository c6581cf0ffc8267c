"""``haptics tolerance``: what tolerances of devices do to what is felt, and how much a calibration takes away."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from haptics.cli.show import print_json, print_table, progress_unless

if TYPE_CHECKING:
    from rigs.tolerance.study import ToleranceReport


def tolerance(
    devices: Annotated[int, typer.Option(help="devices to draw")] = 400,
    seed: Annotated[int, typer.Option(help="seed of the draws")] = 1,
    spread: Annotated[
        float, typer.Option(help="of the half widths, 0 to 2; 1.732 reads a stated +- as a standard deviation")
    ] = 1.0,
    only: Annotated[list[str] | None, typer.Option("--only", help="a parameter that varies; repeat; all by default")] = None,
    workers: Annotated[int | None, typer.Option(help="processes [default: one a core]")] = None,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Draw devices within their tolerances, and compare what they make felt before and after a bench has calibrated each."""
    from rigs.tolerance.study import process_pool, tolerance_study

    with process_pool(workers) as pool:
        report = tolerance_study(devices, seed, spread=spread, only=only or None, executor=pool, progress=progress_unless(json))
    if json:
        print_json(report)
    else:
        _show(report)


def _show(report: ToleranceReport) -> None:
    from rigs.result import readable

    print_table(
        f"{report.devices} devices, seed {report.seed}: what varies, by {report.spread:g} of the half widths",
        ("parameter", "nominal", "+-", "drawn", "known", "by"),
        (
            (
                p.name,
                readable(p.nominal, p.unit),
                readable(p.half_width, p.unit),
                p.distribution,
                p.provenance,
                f"{p.section or ''} {p.source}".strip(),
            )
            for p in report.parameters
        ),
    )
    print_table(
        "what is off, before and after calibration",
        ("quantity", "JND", "n", "mean", "sd", "2.5 %", "97.5 %", "worst", "beyond JND", "comes of"),
        (
            (
                f"{row.quantity}{when}",
                readable(row.jnd, row.unit),
                found.n,
                *(readable(one, row.unit, 3) for one in (found.mean, found.sd, found.p2_5, found.p97_5, found.worst)),
                f"{100 * found.beyond_jnd:.1f} %",
                ", ".join(f"{cause.parameter} {100 * cause.share:.0f} %" for cause in row.causes) if not when else "",
            )
            for row in report.felt
            for when, found in (("", row.before), (", after", row.after))
        ),
    )
    for row in report.felt:
        if row.removed_share is not None:
            print(f"{row.quantity}: calibration removes {round(100 * row.removed_share)} % of the spread; {row.why}.")

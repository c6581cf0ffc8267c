"""``haptics link stress``: many commands over a bad line."""

from __future__ import annotations

from typing import Annotated

import typer

from haptics.cli.show import print_json, print_pairs


def stress(
    port: Annotated[str, typer.Option("--port", help="the board: sim://tactiles, sim://brake?core=c, /dev/ttyACM0, ...")],
    frames: Annotated[int, typer.Option("--frames", help="number of commands to send")] = 1000,
    faults: Annotated[
        str,
        typer.Option(
            "--faults",
            help="what goes wrong, each a probability a frame: corrupt=0.01,drop=0.01,lose=,insert=,truncate=,duplicate=,delay= "
            "(of delay_ms=30); and unplug_s=, stall_s= (s), garbage= (bytes), dtr_reset=1",
        ),
    ] = "",
    seed: Annotated[int, typer.Option("--seed", help="seed of commands and faults")] = 1,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Arm a board, send it commands over a line with faults, fall silent, and report which promises held. OUTPUTS MOVE.

    Exit code 1: a promise was broken (the last lines name it).
    """
    from haptics.link_trial.stress import stress as run

    report = run(port, frames, faults, seed)
    if json:
        print_json(report)
    else:
        rows = {name: getattr(report, name) for name in report.__dataclass_fields__}
        error = rows.pop("edge_error_us")
        if error is not None:
            rows |= {f"edge_error_us {name}": getattr(error, name) for name in error.__dataclass_fields__}
        violations = rows.pop("violations")
        print_pairs("stress", rows)
        for violation in violations or ["no promise was broken"]:
            typer.echo(violation)
    if report.violations:
        raise typer.Exit(1)

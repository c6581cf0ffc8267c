"""``haptics characterize`` and ``haptics validate``: a rig run, or all of them against the published numbers."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from haptics.cli.show import name_leftovers, print_json, print_pairs, print_table, progress_unless
from haptics.units import whole_number

Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]
Out = Annotated[Path | None, typer.Option(help="folder to write recordings, pictures and the page to [default: NAME-TIME]")]


def characterize(
    name: Annotated[str, typer.Argument(help="thermal, pendulum, frequency, pull, response or supply")],
    port: Annotated[
        str | None, typer.Option(help="port URL of the board; without it, the configuration's or a simulated one")
    ] = None,
    level: Annotated[str | None, typer.Option(help="level of a simulated board's models")] = None,
    seed: Annotated[int, typer.Option(help="seed of simulated boards and instruments")] = 1,
    devices: Annotated[int, typer.Option(help="how many simulated devices, seeds from SEED on")] = 1,
    channel: Annotated[int, typer.Option(help="channel that the instruments are attached to")] = 0,
    surface: Annotated[
        str | None, typer.Option(help="pendulum: what the pin lands on, on hardware: bare, silicone, foam")
    ] = None,
    thermocouple: Annotated[str | None, typer.Option(help="port URL of the thermocouple")] = None,
    accelerometer: Annotated[str | None, typer.Option(help="port URL of the accelerometer")] = None,
    loadcell: Annotated[str | None, typer.Option(help="port URL of the load cell")] = None,
    stage: Annotated[str | None, typer.Option(help="port URL of the motion stage")] = None,
    probe: Annotated[str | None, typer.Option(help="port URL of the high-voltage probe")] = None,
    config: Annotated[Path | None, typer.Option(help="glove.toml; without it, the simulated glove")] = None,
    out: Out = None,
    force: Annotated[bool, typer.Option("--force", help="overwrite files that exist")] = False,
    json: Json = False,
) -> None:
    """Run a bench rig on a board, and write recording, curves and page with uncertainties beside the published numbers."""
    from haptics.session.configuration import load_configuration
    from rigs.bench import BenchOptions
    from rigs.characterize import characterize as run
    from rigs.result import readable

    named = {"thermocouple": thermocouple, "accelerometer": accelerometer, "loadcell": loadcell, "stage": stage, "probe": probe}
    options = BenchOptions(
        port=port,
        level=level,
        seed=seed,
        channel=channel,
        instruments={kind: url for kind, url in named.items() if url is not None},
        surface=surface,
        configuration=load_configuration(config),
        force=force,
        progress=progress_unless(json),
    )
    folder = _folder(out, name)
    name_leftovers(folder)
    done = run(name, options, devices, folder)
    if json:
        print_json(done.to_json())
    else:
        for one in (fault for result in done.results for fault in result.faults):
            print(f"fault: {one.what}: {one.why}")
        print_table(
            f"{name} on {done.port}",
            ("quantity", "value", "standard deviation"),
            ((key, readable(one.value, one.unit), readable(one.sd, one.unit, 2)) for key, one in done.quantities.items()),
        )
        if done.rows:
            _print_rows("against the source", done.rows)
        print_pairs("files", {path.suffix.lstrip("."): path for path in done.files if path.suffix in (".html", ".h5", ".json")})
    if not done.sound:
        raise typer.Exit(1)


def validate(
    seed: Annotated[int, typer.Option(help="seed of simulated boards and instruments")] = 1,
    devices: Annotated[int, typer.Option(help="simulated devices for each rig")] = 3,
    rigs: Annotated[list[str] | None, typer.Option("--rig", help="run only this rig; repeat [default: all]")] = None,
    level: Annotated[str | None, typer.Option(help="level of the simulated boards' models")] = None,
    out: Annotated[Path | None, typer.Option(help="folder for validation.html and .json [default: none]")] = None,
    force: Annotated[bool, typer.Option("--force", help="overwrite files that exist")] = False,
    json: Json = False,
) -> None:
    """Run every rig and print each published number beside ours, with a verdict; exit 1 if one fails without a stated reason."""
    from rigs.bench import BenchOptions
    from rigs.catalogue import RIGS
    from rigs.validation.page import judge_table, refuse_taken, write_validation
    from rigs.validation.validate import validate as run

    whole_number("devices", devices, 1, 1000)
    options = BenchOptions(seed=seed, level=level)
    if out is not None:
        refuse_taken(out, force)
    found = run(options, devices, tuple(rigs or RIGS), progress=progress_unless(json))
    if out is not None:
        write_validation(found, out, force)
    if json:
        print_json(found.to_json())
    else:
        _print_rows("published against ours", found.rows)
        if found.judgements is None:
            print("ngspice is not installed: the models were not compared with circuits")
        else:
            table = judge_table(found.judgements)
            print_table(table.title, table.head, table.rows)
        print_pairs("rows by role and verdict", found.counts)
    if not found.sound:
        raise typer.Exit(1)


def _folder(out: Path | None, name: str) -> Path:
    return out if out is not None else Path(f"{name}-{time.strftime('%Y%m%d-%H%M%S')}")


def _print_rows(title: str, rows: tuple) -> None:
    head = ("quantity", "section", "published", "ours", "role", "verdict", "why")
    print_table(title, head, (row.cells() for row in rows))

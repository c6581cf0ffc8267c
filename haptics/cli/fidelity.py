"""``haptics fidelity``: what levels cost and err, what a scene needs at which level, and when touch is rendered."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from haptics.cli.show import chosen_levels, plain, print_json, print_table, progress_unless
from haptics.cli.typed import Commands
from haptics.units import whole_number

app = Commands(help="Measure the levels of the models, and the error of the loop.", no_args_is_help=True)
Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]


@app.command("measure")
def measure(
    shipped: Annotated[bool, typer.Option("--shipped", help="print what was measured for this version, on its machine")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="a fifth of the cases")] = False,
    seed: Annotated[int, typer.Option(help="seed of the cases")] = 1,
    out: Annotated[Path | None, typer.Option(help="also write the JSON to this file")] = None,
    picture: Annotated[Path | None, typer.Option(help="also draw error against cost, PNG (extra `report`)")] = None,
    force: Annotated[bool, typer.Option("--force", help="overwrite files that exist")] = False,
    json: Json = False,
) -> None:
    """Run every level of every model against its reference: errors of what a person notices, and CPU time on this machine."""
    from json import dumps

    from haptics.fidelity import measured
    from haptics.recording.output import check_outputs, replacing

    _seed(seed)
    check_outputs({"out": out, "picture": picture}, force)
    if shipped:
        table = measured.shipped()
    else:
        from haptics.fidelity.measure import measure as run

        table = run(quick, seed, progress_unless(json))
    data = measured.to_json(table)
    if out is not None:
        with replacing(out, force) as partial:
            partial.write_text(dumps(data, indent=1) + "\n", encoding="utf-8")
    if picture is not None:
        from haptics.fidelity.picture import draw

        draw(table, picture, force)
    if json:
        print_json(data)
        return
    for model in dict.fromkeys(row.model for row in table.rows):
        print_table(
            f"{model}: errors against the reference (version {table.version})",
            ("level", "observable", "cases", "n", "refused", "median", "95th", "worst"),
            (
                (r.level, f"{r.observable}, {r.unit}", r.cases, r.n, r.refused, r.median, r.p95, r.worst)
                for r in table.rows
                if r.model == model and r.worst + r.refused > 0
            ),
        )
    costs = {(r.model, r.level): r for r in table.rows}.values()
    print_table(
        f"CPU time on {', '.join(str(value) for value in table.machine.values())}",
        ("model", "level", "us an event", *(f"s/s, {count}" for count in ("1", "15", "64", "1000"))),
        ((r.model, r.level, r.cost_us_per_event, *r.cost_s_per_sim_s.values()) for r in costs),
    )


@app.command("plan")
def plan(
    scene: Annotated[str, typer.Argument(help="a shipped scene's name or a scene file")],
    tolerance_jnd: Annotated[
        float, typer.Option(help="error allowed, as a share of what is just noticed", show_default="1/3")
    ] = 1 / 3,
    budget: Annotated[float, typer.Option(help="CPU seconds a second that the models may take")] = 0.5,
    level: Annotated[list[str] | None, typer.Option("--level", help="MODEL=LEVEL to take whatever it costs; repeat")] = None,
    json: Json = False,
) -> None:
    """Print which devices a scene needs, at which level, and why."""
    from haptics.fidelity import plan_scene
    from haptics.scene import load_scene

    made = plan_scene(load_scene(scene), tolerance_jnd, budget, chosen_levels(level))
    if json:
        print_json(made)
        return
    print_table(
        f"plan for {made.scene}, errors up to {made.tolerance:.3g} of what is just noticed",
        ("device", "model", "level", "count", "nearest to be noticed", "error", "limit"),
        ((r.device, r.model, r.level, r.count, f"{r.observable} {r.unit}", r.error, r.limit) for r in made.rows),
    )
    for row in made.rows:
        print(f"{row.device}: {row.why}.")
    if made.absent:
        print_table("absent", ("device", "why"), ((a.device, a.why) for a in made.absent))
    if made.over_budget:
        print(made.over_budget)


@app.command("prove")
def prove(
    scene: Annotated[str, typer.Argument(help="a shipped scene's name or a scene file")],
    hand: Annotated[str, typer.Option("--hand", help="a hand recording, or `synthetic`")] = "synthetic",
    side: Annotated[str, typer.Option(help="hand to play: left, right, or auto: the one with most poses")] = "auto",
    tolerance_jnd: Annotated[
        float, typer.Option(help="error allowed, as a share of what is just noticed", show_default="1/3")
    ] = 1 / 3,
    level: Annotated[list[str] | None, typer.Option("--level", help="MODEL=LEVEL of the planned run; repeat")] = None,
    seed: Annotated[int, typer.Option(help="seed of the simulated boards")] = 1,
    json: Json = False,
) -> None:
    """Play a hand through the planned run and through an all-reference run, and hold every difference against its tolerance."""
    from haptics.session.configuration import Configuration
    from haptics.session.prove import prove_plan
    from haptics.session.run import RunOptions

    _seed(seed)
    options = RunOptions(side=side, seed=seed, tolerance_jnd=tolerance_jnd, levels=chosen_levels(level))
    proof = prove_plan(scene, hand, Configuration(), options)
    if json:
        print_json({**plain(proof), "kept": proof.kept})
    else:
        levels = ", ".join(f"{model} {level}" for model, level in proof.levels.items())
        cost = f"{proof.planned_cpu_s:.2g} s of CPU against {proof.reference_cpu_s:.3g} s"
        print_table(
            f"{proof.scene} with {proof.hand}: {levels} against all reference; {cost}",
            ("observable", "unit", "compared", "worst", "limit", "kept"),
            ((r.observable, r.unit, r.n, r.worst, r.limit, r.kept) for r in proof.rows),
        )
    if not proof.kept:
        raise typer.Exit(1)


@app.command("stress")
def stress(
    quick: Annotated[bool, typer.Option("--quick", help="fewer of each")] = False,
    model: Annotated[
        list[str] | None, typer.Option("--model", help="latch, thermal or brake; repeat for more; all by default")
    ] = None,
    seed: Annotated[int, typer.Option(help="seed of what is drawn")] = 1,
    json: Json = False,
) -> None:
    """Try every level at its extremes: what was tried, the worst that came of it, and where it stops being valid."""
    from haptics.fidelity.stress.stress import stress as run

    _seed(seed)
    rows = run(quick, seed, progress_unless(json), model or None)
    if json:
        print_json({"rows": rows, "holds": all(row.holds for row in rows)})
    else:
        print_table(
            "extremes",
            ("model", "level", "extreme", "tried", "refused", "worst", "unit", "bound", "holds", "where it ends"),
            ((r.model, r.level, r.extreme, r.tried, r.refused, r.worst, r.unit, r.bound, r.holds, r.limit) for r in rows),
        )
    if not all(row.holds for row in rows):
        raise typer.Exit(1)


@app.command("onset")
def onset(
    hand: Annotated[list[str] | None, typer.Option("--hand", help="recording, or `synthetic`; repeat for more")] = None,
    folder: Annotated[Path | None, typer.Option(help="all Leap recordings in this folder")] = None,
    side: Annotated[str, typer.Option(help="hands to take: left, right, or auto: both")] = "auto",
    objects: Annotated[int, typer.Option(help="random objects for each recorded hand")] = 150,
    latency_ms: Annotated[list[float] | None, typer.Option("--latency-ms", help="tracker latency, ms; repeat for more")] = None,
    seed: Annotated[int, typer.Option(help="seed of the objects' places")] = 1,
    json: Json = False,
) -> None:
    """Measure the onset error of predicted touch over objects at random places, beside holding the last pose."""
    from haptics.judging.onset_study import onset_study

    _seed(seed)
    rows = onset_study(hand or [], folder, objects, [ms / 1e3 for ms in latency_ms or [0.0, 10.0, 20.0]], seed, side)
    if json:
        print_json({"rows": rows})
        return
    columns = ("n", "signed_median", "median", "p95")
    counts = ("missed", "false", "shallow")
    flat = [
        (r["latency_ms"], how, *(s[name] for name in columns), _percent(s["in_window"]), *(_per_100(s, name) for name in counts))
        for r in plain(rows)
        for how, s in (("predicted", r["fast"]), ("hold", r["fast"]["hold"]))
    ]
    head = ("latency", "rule", "touches", "signed", "median", "95th", "window", "missed", "false", "shallow")
    print_table("onset error, ms, of touches at 100 mm/s or more; missed, false and shallow per 100", head, flat)


def _seed(seed: int) -> None:
    whole_number("seed", seed, 0, 2**31 - 1)


def _per_100(statistics: dict, name: str) -> str:
    return f"{100 * statistics[name] / statistics['n']:.2f}" if statistics["n"] else "-"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"

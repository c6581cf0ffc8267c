"""``haptics fidelity``: what a scene needs at which level, and how close in time touch is rendered."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from haptics.cli.show import plain, print_json, print_table

app = typer.Typer(help="Levels of the models, and the loop's own error.", no_args_is_help=True)
Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]


@app.command("plan")
def plan(
    scene: Annotated[str, typer.Argument(help="a shipped scene's name or a scene file")],
    json: Json = False,
) -> None:
    """Print which devices a scene needs, at which level, and why."""
    from haptics.fidelity import plan_scene
    from haptics.scene import load_scene

    made = plan_scene(load_scene(scene))
    if json:
        print_json(made)
        return
    print_table(
        f"plan for {made.scene}", ("device", "model", "level", "why"), ((r.device, r.model, r.level, r.why) for r in made.rows)
    )
    if made.absent:
        print_table("absent", ("device", "why"), ((a.device, a.why) for a in made.absent))


@app.command("onset")
def onset(
    hand: Annotated[list[str] | None, typer.Option("--hand", help="recording, or `synthetic`; repeat for more")] = None,
    folder: Annotated[Path | None, typer.Option(help="all Leap recordings in this folder")] = None,
    objects: Annotated[int, typer.Option(help="random objects for each recorded hand")] = 150,
    latency_ms: Annotated[list[float] | None, typer.Option("--latency-ms", help="tracker latency, ms; repeat for more")] = None,
    seed: Annotated[int, typer.Option(help="seed of the objects' places")] = 1,
    json: Json = False,
) -> None:
    """Onset error of predicted touch over objects at random places, beside holding the last pose."""
    from haptics.session.onset_study import onset_study

    rows = onset_study(hand or [], folder, objects, [ms / 1e3 for ms in latency_ms or [0.0, 10.0, 20.0]], seed)
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
    head = ("latency", "rule", "touches", "signed", "median", "95 %", "window", "missed", "false", "shallow")
    print_table("onset error, ms, of touches at 100 mm/s or more; missed, false and shallow per 100", head, flat)


def _per_100(statistics: dict, name: str) -> str:
    return f"{100 * statistics[name] / statistics['n']:.2f}" if statistics["n"] else "-"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"

"""``haptics run`` and ``haptics scenes``: the main job, and what there is to run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from haptics.cli.show import (
    chosen_levels,
    name_leftovers,
    note_first_start,
    plain,
    print_json,
    print_pairs,
    print_table,
    printing,
)
from haptics.errors import HapticsError


def run(
    scene: Annotated[str, typer.Argument(help="a shipped scene's name (see `haptics scenes`) or a scene file")],
    hand: Annotated[str, typer.Option("--hand", help="a hand recording, or `synthetic` for the shipped motion")] = "synthetic",
    side: Annotated[
        str | None, typer.Option(help="hand that wears the glove: left, right or auto [default: as configured]")
    ] = None,
    port_tactiles: Annotated[str | None, typer.Option(help="port URL of the tactor array")] = None,
    port_brake: Annotated[str | None, typer.Option(help="port URL of the brake controller")] = None,
    realtime: Annotated[bool, typer.Option("--realtime", help="play in real time (needed for hardware)")] = False,
    latency_ms: Annotated[float | None, typer.Option(help="age of a pose when it arrives, ms [default: 10]")] = None,
    seed: Annotated[int, typer.Option(help="seed of the simulated boards")] = 1,
    config: Annotated[Path | None, typer.Option(help="glove.toml; without it, the simulated glove")] = None,
    calibration: Annotated[str | None, typer.Option(help="name of the calibration of the hand [default: as configured]")] = None,
    out: Annotated[Path | None, typer.Option(help="recording to write (HDF5) [default: SCENE-TIME.h5]")] = None,
    rrd: Annotated[Path | None, typer.Option(help="also write a rerun recording (extra `view`)")] = None,
    picture: Annotated[Path | None, typer.Option(help="also write a still picture, PNG (extra `report`)")] = None,
    level: Annotated[list[str] | None, typer.Option("--level", help="MODEL=LEVEL instead of the plan's choice; repeat")] = None,
    tolerance_jnd: Annotated[
        float, typer.Option(help="error the plan allows, as a share of what is just noticed", show_default="1/3")
    ] = 1 / 3,
    budget: Annotated[float, typer.Option(help="CPU time that the plan's models may take, s a second")] = 0.5,
    force: Annotated[bool, typer.Option("--force", help="overwrite files that exist")] = False,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Play a hand's motion through a scene on the devices, record everything, and report what was felt."""
    from haptics.scene.calibration.store import load_calibration
    from haptics.session.configuration import load_configuration
    from haptics.session.run import RunOptions, run_scene

    name_leftovers(Path.cwd() if out is None else out.parent)
    if not json:
        note_first_start()
    report = run_scene(
        scene,
        hand,
        load_configuration(config),
        RunOptions(
            port_tactiles=port_tactiles,
            port_brake=port_brake,
            side=side,
            realtime=realtime,
            latency_s=None if latency_ms is None else latency_ms / 1e3,
            seed=seed,
            out=out,
            rrd=rrd,
            picture=picture,
            force=force,
            progress=not json,
            levels=chosen_levels(level),
            tolerance_jnd=tolerance_jnd,
            budget_s_per_s=budget,
            calibration=None if calibration is None else load_calibration(calibration),
        ),
    )
    try:
        if json:
            print_json(report)
        else:
            with printing():
                _show(plain(report))
    except HapticsError as error:
        error.add_note(f"the recording {report['recording']} is complete")
        raise
    if report["faults"]:
        raise typer.Exit(1)


def _show(report: dict) -> None:
    hand, pulses, ticks = report["hand"], report["pulses"], report["ticks"]
    denied = ", ".join(f"{n} {reason}" for reason, n in pulses["denied"].items()) or "none"
    onset = report["onset_error_ms"]
    print_pairs(
        f"{report['scene']} with {hand['source']}",
        {
            "hand": f"{hand['frames']} frames, {hand['duration_s']:.2f} s, {hand['side']}",
            **({"calibration": hand["calibration"]} if "calibration" in hand else {}),
            "contacts, grasps": f"{report['contacts']}, {report['grasps']}",
            "pulses": f"{pulses['requested']} asked for, {pulses['played']} played; denied: {denied}",
            "onset error": _onset(onset),
            "  without prediction": _onset(onset["hold"]),
            "ticks": f"{ticks['count']}, missed: {'virtual time' if ticks['missed'] is None else ticks['missed']}",
            "recording": report["recording"],
        },
    )
    if report["notes"]:
        print("\n".join(f"note: {note}" for note in report["notes"]))
    if report["actuators"]:
        busiest = sorted(report["actuators"], key=lambda a: -a["peak_rise_k"])[:8]
        print_table(
            "tactors (warmest first)",
            ("site", "switches", "peak rise, K", "headroom, K"),
            ((a["site"], a["switches"], a["peak_rise_k"], a["headroom_k"]) for a in busiest),
        )
    if report["brakes"]:
        print_table(
            "brakes",
            ("name", "peak voltage, V", "peak force, N", "energy, J"),
            ((b["name"], b["peak_volts"], b["peak_force_n"], b["energy_j"]) for b in report["brakes"]),
        )
    print_table("plan", ("device", "level", "why"), ((p["device"], p["level"], p["why"]) for p in report["plan"]))
    for fault in report["faults"]:
        print(f"fault: {fault}")


def _onset(onset: dict) -> str:
    if not onset["n"]:
        return "no touches to measure"
    median = "-" if onset["median"] is None else f"{onset['median']:.1f} ms"
    return (
        f"median {median} of {onset['n']} touches, {onset['missed']} missed, {onset['false']} false, "
        f"{100 * (onset['in_window'] or 0):.0f} % in the window"
    )


def scenes(json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False) -> None:
    """List the shipped scenes."""
    from haptics.scene import shipped_scenes

    rows = [{"name": name, "summary": summary} for name, summary in shipped_scenes()]
    if json:
        print_json({"scenes": rows})
    else:
        print_table("scenes", ("name", "what it is"), ((row["name"], row["summary"]) for row in rows))

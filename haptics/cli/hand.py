"""``haptics hand``: look into files of recorded hands, and write them as plain ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from haptics.cli.show import plain, print_json, print_pairs, print_table, printing
from haptics.cli.typed import Commands

if TYPE_CHECKING:
    from haptics.scene.hand_files.account import HandAccount

app = Commands(help="Look into recorded hands, and bring those of other programs into a plain form.", no_args_is_help=True)
_HAND = "a file of recorded hands, or `synthetic` for the shipped motion"


@app.command("info")
def info(
    file: Annotated[str, typer.Argument(help=_HAND)],
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Print what a file of hands holds: hands, rate, joints read and made, what was taken for granted, lost and refused."""
    from haptics.scene.hand_files.account import account_of
    from haptics.scene.hand_files.load import load_hand

    found = account_of(load_hand(file))
    print_json(found) if json else _show(found)


@app.command("convert")
def convert(
    file: Annotated[str, typer.Argument(help=_HAND)],
    out: Annotated[Path, typer.Argument(help="file to write: .csv (a row a pose) or .jsonl (a line a pose)")],
    basis: Annotated[
        str | None, typer.Option(help="whose axes FILE has: openxr, webxr, unity, unreal or godot [default: as it says]")
    ] = None,
    unit: Annotated[str | None, typer.Option(help="unit of its lengths: m, cm or mm [default: as it says]")] = None,
    time: Annotated[str | None, typer.Option(help="unit of its times: ns, us, ms or s [default: as it says]")] = None,
    side: Annotated[
        str | None, typer.Option(help="left or right: whose hand it is where it does not say, and the only one written")
    ] = None,
    mirrored: Annotated[
        bool | None,
        typer.Option(
            "--mirrored/--not-mirrored", help="whether landmarks are of a mirrored picture [default: as it says, or not]"
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="overwrite a file that exists")] = False,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Write hands in OpenXR's basis, metres and nanoseconds, and say what was lost. Options say of FILE what it does not."""
    from haptics.scene.hand_files.load import load_hand, shipped_hands
    from haptics.scene.hand_files.written import convert as write

    recording = load_hand(file, basis=basis, unit=unit, time=time, side=side, mirrored=mirrored)
    done = write(recording, out, None if file in shipped_hands() else Path(file), force=force)
    if json:
        print_json({**plain(done), "notes": recording.notes})
        return
    lost = f"{done.off_mm:.3g} mm at most between what was read and what {done.path.name} gives back"
    print_pairs(f"converted {file}", {"written": done.path, "poses": done.poses, "lost": lost})
    with printing():
        for loss in done.losses:
            print(f"loss: {loss}")
        for note in recording.notes:
            if note not in done.losses:
                print(f"note: {note}")


def _show(found: HandAccount) -> None:
    print_pairs(
        found.source,
        {
            "is": found.format,
            "basis": found.basis,
            "units": f"{found.unit}, {found.time}",
            "frames": found.frames,
            "duration_s": found.duration_s,
            "joints read": len(found.joints_read),
            "joints made": ", ".join(found.joints_made) or "none",
            "orientations": found.orientations,
        },
    )
    print_table(
        "hands",
        ("side", "poses", "tracks", "rate, Hz", "jitter, ms", "refused", "plays"),
        (
            (hand.side, hand.poses, hand.tracks, hand.rate_hz, hand.jitter_ms, hand.refused, "yes" if hand.playable else "no")
            for hand in found.hands
        ),
    )
    with printing():
        for name, count in found.dropped.items():
            print(f"left out: {count} {name}")
        for loss in found.losses:
            print(f"loss: {loss}")
        for pose in found.refused:
            at = "" if pose.time_ns is None else f" at {pose.time_ns / 1e9:.3f} s"
            print(f"refused{at}: {pose.reason}")
        for note in found.notes:
            print(f"note: {note}")

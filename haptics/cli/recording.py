"""``haptics recording`` and ``haptics replay``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from haptics.cli.show import print_json, print_pairs, printing
from haptics.cli.typed import Commands
from haptics.errors import InputError

app = Commands(help="Look into recordings, and save what a crash left.", no_args_is_help=True)


@app.command("recover")
def recover(
    journal: Annotated[Path, typer.Argument(help="the journal a run left behind (*.journal)")],
    out: Annotated[Path | None, typer.Option(help="HDF5 file to write [default: beside the journal]")] = None,
    force: Annotated[bool, typer.Option("--force", help="overwrite a file that exists")] = False,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Make an HDF5 recording of everything a run had committed before it died."""
    from haptics.recording import recover as recover_journal
    from haptics.recording.output import with_suffix

    result = recover_journal(journal, out or with_suffix(journal, ".h5"), force=force)
    if json:
        print_json(result)
        return
    print_pairs(
        f"recovered {journal}",
        {
            "recording": result.path,
            "complete": _yes(result.complete),
            "lost": f"{result.lost_bytes} bytes",
            "damage": result.damage or "none",
            "journal": "kept" if result.journal_kept else "removed: all of it is in the recording",
            **_rows(result.rows),
        },
    )


@app.command("info")
def info(
    path: Annotated[Path, typer.Argument(help="recording (*.h5), or the journal of one (*.journal)")],
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Print what a recording holds, whether it is complete, what was lost and what is damaged. Exit code 1: it is damaged."""
    from haptics.recording.condition import condition_of

    found = condition_of(path)
    if json:
        print_json(found)
    else:
        shown = {"is": found.kind, "complete": _yes(found.complete), "lost": _bytes(found.lost_bytes)}
        shown |= {"damaged": found.damaged or "no", "verified": _yes(found.verified)}
        print_pairs(str(path), shown | _rows(found.rows))
        with printing():
            for note in found.notes:
                print(f"note: {note}")
    if found.damaged:
        raise typer.Exit(1)


@app.command("view")
def view(
    path: Annotated[Path, typer.Argument(help="recording (*.h5), whoever made it")],
    picture: Annotated[Path | None, typer.Option(help="still picture to write, PNG (extra `report`)")] = None,
    rrd: Annotated[Path | None, typer.Option(help="file for rerun to write (extra `view`)")] = None,
    force: Annotated[bool, typer.Option("--force", help="overwrite files that exist")] = False,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Make a picture of a recording, or a file to look into with rerun."""
    from haptics.recording import load, write_picture, write_rrd
    from haptics.recording.output import check_outputs

    if picture is None and rrd is None:
        raise InputError("nothing to write; give --picture FILE.png, --rrd FILE.rrd or both")
    check_outputs({"picture": picture, "rrd": rrd}, force, {"the recording": path})
    recording = load(path)
    if picture is not None:
        write_picture(recording, picture, force=force)
    if rrd is not None:
        write_rrd(recording, rrd, force=force)
    made = [file for file in (picture, rrd) if file is not None]
    print_json({"files": made}) if json else print_pairs(f"views of {path}", {"files": ", ".join(map(str, made))})


def replay(
    path: Annotated[Path, typer.Argument(help="recording (*.h5)")],
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Play a recording again and compare the bytes on the wire, or a live session's decisions. Exit code 1: they differ."""
    from haptics.session.replay import replay_recording

    result = replay_recording(path)
    print_json(result) if json else print_pairs(f"replay of {path}", _flat(result))
    if not result.identical:
        raise typer.Exit(1)


def _yes(true: bool) -> str:
    return "yes" if true else "no"


def _bytes(count: int | None) -> str:
    return "unknown" if count is None else f"{count} bytes"


def _rows(counts: dict[str, int]) -> dict[str, int]:
    return {f"rows of {name}": count for name, count in counts.items()}


def _flat(result: object) -> dict:
    from haptics.cli.show import plain

    data = plain(result)
    return data if isinstance(data, dict) else {"result": data}

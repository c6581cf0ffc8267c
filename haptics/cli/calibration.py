"""``haptics calibrate`` and ``haptics calibration``: a person's hand, by name."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from haptics.cli.show import print_json, print_pairs, print_table, printing
from haptics.cli.typed import Commands
from haptics.errors import InputError

if TYPE_CHECKING:
    from haptics.scene.calibration.hand_calibration import HandCalibration

app = Commands(help="Calibrations of people's hands that are kept.", no_args_is_help=True)


def calibrate(
    name: Annotated[str, typer.Argument(help="whose hand: letters, digits, - and _")],
    hand: Annotated[
        str, typer.Option("--hand", help="a recording that goes through the poses, or `routine` for the motion that ships")
    ],
    side: Annotated[str, typer.Option(help="hand to calibrate: left, right or auto, the one seen most")] = "auto",
    force: Annotated[bool, typer.Option("--force", help="overwrite a calibration of that name")] = False,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Make a calibration of a hand from poses: flat, a fist, the thumb's tip on that of each finger, each held for a second."""
    from haptics.scene.calibration.from_recording import calibrate as calibrated
    from haptics.scene.calibration.store import save_calibration

    calibration = calibrated(name, hand, side, date.today())
    _tell(calibration, save_calibration(calibration, force), json)


@app.command("list")
def list_saved(json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False) -> None:
    """List the calibrations that there are."""
    from haptics.scene.calibration.store import calibrations_folder, load_calibration, saved_calibrations

    rows = []
    for name in saved_calibrations():
        try:
            one = load_calibration(name)
            rows.append({"name": name, "side": one.side, "made_on": one.made_on and one.made_on.isoformat(), "fault": None})
        except InputError as error:
            rows.append({"name": name, "side": None, "made_on": None, "fault": str(error)})
    if json:
        print_json({"folder": calibrations_folder(), "calibrations": rows})
    else:
        title = f"calibrations in {calibrations_folder()}"
        print_table(title, ("name", "hand", "made on", "fault"), (tuple(row.values()) for row in rows))


@app.command("show")
def show(
    name: Annotated[str, typer.Argument(help="of a calibration")],
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Print a calibration."""
    from haptics.scene.calibration.store import calibrations_folder, load_calibration

    _tell(load_calibration(name), calibrations_folder() / f"{name}.toml", json)


@app.command("remove")
def remove(
    name: Annotated[str, typer.Argument(help="of a calibration")],
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Remove a calibration."""
    from haptics.scene.calibration.store import remove_calibration

    path = remove_calibration(name)
    if json:
        print_json({"removed": path})
    else:
        with printing():
            print(f"removed {path}")


def _tell(calibration: HandCalibration, path: Path, json: bool) -> None:
    if json:
        print_json({"name": calibration.name, "path": path, **calibration.table()})
        return
    told: dict[str, Any] = {"hand": calibration.side, "made on": calibration.made_on, "made from": calibration.made_from or None}
    for finger, radius_m in calibration.tip_radius_m.items():
        sd_m = calibration.tip_radius_sd_m.get(finger)
        told[f"radius of the {finger}'s tip"] = f"{1e3 * radius_m:.1f} mm" + ("" if sd_m is None else f" ± {1e3 * sd_m:.1f} mm")
    if calibration.breadth_m is not None:
        told["breadth at the knuckles"] = f"{1e3 * calibration.breadth_m:.1f} mm"
    told |= {"tactors moved": len([site for site, by in calibration.offset_m.items() if any(by)]), "file": path}
    print_pairs(f"calibration {calibration.name}", told)
    with printing():
        for note in calibration.notes:
            print(f"note: {note}")

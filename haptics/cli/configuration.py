"""``haptics config``: check a configuration file, or print the schema it must follow."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from haptics.cli.show import print_json
from haptics.cli.typed import Commands

app = Commands(help="Check the glove's configuration file.", no_args_is_help=True)


@app.command("check")
def check(
    path: Annotated[Path, typer.Argument(help="glove.toml")],
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Check a configuration file, and print what it sets, with defaults filled in."""
    from haptics.session.configuration import load_configuration

    configuration = load_configuration(path)
    if json:
        keys = {
            **configuration.model_dump(mode="json"),
            "hand_calibration": configuration.hand_calibration,
        }  # None is left out there
        print_json({"path": str(path), "valid": True, "configuration": keys})
        return
    print(f"{path}: valid")
    of = "" if configuration.hand_calibration is None else f", calibration {configuration.hand_calibration}"
    print(f"  hand      {configuration.side}, tracker latency {configuration.tracker_latency_s * 1e3:g} ms{of}")
    tactiles, brake = configuration.tactiles, configuration.brake
    limits = f"{tactiles.rise_limit_k:g} K, {tactiles.current_limit_a:g} A"
    print(f"  tactiles  {tactiles.port}, {len(tactiles.sites)} sites, {limits}")
    volts = f"{brake.amplitude_v:g} V at {brake.frequency_hz:g} Hz, at most {brake.max_amplitude_v:g} V"
    print(f"  brake     {brake.port}, {', '.join(brake.channels)}, {volts}")


@app.command("schema")
def schema(json: Annotated[bool, typer.Option("--json", help="print one JSON object: it always is one")] = True) -> None:
    """Print the JSON schema of the configuration."""
    from haptics.session.configuration import Configuration

    print_json(Configuration.model_json_schema())

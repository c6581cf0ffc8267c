"""Characterise every actuator of a glove, and its brakes, and write what was found into its configuration file.

``python tools/characterise_array.py OUT.toml [--config GLOVE.toml] [--sites index_tip,...] [--brakes]``. Drivers that are given
the new file with ``--config`` budget heat and choose volts by it. On hardware the script asks for the instruments to be moved
from one actuator to the next; simulated ones are measured side by side.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import tomlkit

from haptics.cli.program import run_program
from haptics.errors import HapticsError, InputError
from haptics.link.port_url import is_simulated
from haptics.recording.output import replacing
from haptics.session.configuration import Configuration, check_configuration, load_configuration
from rigs.bench import BenchOptions
from rigs.characterize import run_jobs, run_one
from rigs.result import RigResult


def measure(rig: str, places: dict[str, int], options: BenchOptions, ask: Callable[[str], None]) -> dict[str, RigResult]:
    """One result for each place (site or brake) and its channel.

    :param rig: `thermal` or `pull`.
    :param places: channel of each place.
    :param options: board and instruments; the channel is set here.
    :param ask: called, on hardware, with what to attach before each measurement; returns when that is done.
    :return: result by place.
    :raises HapticsError: a bench failed.
    """
    jobs = [replace(options, channel=channel) for channel in places.values()]
    board = "tactiles" if rig == "thermal" else "brake"
    if is_simulated(options.board_url(board)):
        return dict(zip(places, run_jobs([(rig, job) for job in jobs], None, lambda _: None), strict=True))
    results = {}
    for place, job in zip(places, jobs, strict=True):
        ask(f"{rig}: attach the instruments to {place} (channel {job.channel}), then press enter ")
        results[place] = run_one(rig, job)
    return results


def calibration(heat: dict[str, RigResult], pulls: dict[str, RigResult]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Tables for ``[tactiles.calibration]`` and ``[brake.calibration]`` of what showed no fault.

    The power is that of a cold pulse: a warm coil takes less, so that a budget kept by it errs to the safe side. Standard
    deviations go along: the budget counts three of them.

    :param heat: results of the thermal rig by site.
    :param pulls: results of the pull tester by brake.
    :return: the two tables, values in the units of their keys.
    """
    tactors = {
        site: {
            key: round(value, 3)
            for key, value in (
                ("tau_s", result.quantities["tau_s"].value),
                ("tau_sd_s", result.quantities["tau_s"].sd),
                ("c_k_per_w", result.quantities["c_k_per_w"].value),
                ("c_sd_k_per_w", result.quantities["c_k_per_w"].sd),
                ("power_w", result.quantities["pulse_power_w"].value),
                ("power_sd_w", result.quantities["pulse_power_w"].sd),
            )
        }
        for site, result in heat.items()
        if result.sound
    }
    brakes = {
        name: {
            "k_n_v2": float(f"{result.quantities['k_n_v2'].value:.4g}"),
            "threshold_v": round(result.quantities["threshold_v"].value, 1),
        }
        for name, result in pulls.items()
        if result.sound
    }
    return tactors, brakes


def written(base: str, tactors: dict[str, Any], brakes: dict[str, Any]) -> str:
    """The text of a configuration with these calibrations in it; comments and all else stay as they are.

    :param base: TOML text, or empty.
    :param tactors: calibration by site, as of ``calibration``.
    :param brakes: calibration by brake, as of ``calibration``.
    :return: TOML text.
    :raises InputError: the result is no valid configuration.
    """
    document = tomlkit.parse(base)
    for part, tables in (("tactiles", tactors), ("brake", brakes)):
        if tables:
            section = document.setdefault(part, tomlkit.table())
            found = section.setdefault("calibration", tomlkit.table(is_super_table=True))
            for name, values in tables.items():
                found[name] = values
    check_configuration(document.unwrap(), "with the new calibration")
    return tomlkit.dumps(document)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Characterise a glove and write its calibration.")
    parser.add_argument("out", type=Path, help="configuration file to write")
    parser.add_argument("--config", type=Path, help="configuration to start from [default: the simulated glove]")
    parser.add_argument("--sites", help="sites to measure, separated by commas [default: all]")
    parser.add_argument("--brakes", action="store_true", help="measure the brakes too (pull tester)")
    parser.add_argument("--seed", type=int, default=1, help="seed of simulated boards and instruments [default: %(default)s]")
    parser.add_argument("--thermocouple", help="port URL of the instrument, on hardware")
    parser.add_argument("--loadcell", help="port URL of the instrument, on hardware")
    parser.add_argument("--stage", help="port URL of the instrument, on hardware")
    parser.add_argument("--force", action="store_true", help="overwrite a file that exists")
    arguments = parser.parse_args()
    try:
        sys.exit(_characterise(arguments, load_configuration(arguments.config)))
    except HapticsError as error:
        sys.exit(f"characterise_array: {error}")


def _characterise(arguments: argparse.Namespace, configuration: Configuration) -> int:
    base = arguments.config.read_text(encoding="utf-8") if arguments.config else ""
    channels = {site: k for k, site in enumerate(configuration.tactiles.sites)}
    wanted = arguments.sites.split(",") if arguments.sites else list(channels)
    unknown = [site for site in wanted if site not in channels]
    if unknown:
        raise InputError(f"sites = {', '.join(unknown)} have no actuator; allowed: {', '.join(channels)}")
    ports = {"thermal": ("thermocouple",), "pull": ("loadcell", "stage")}
    given = {rig: {kind: getattr(arguments, kind) for kind in kinds if getattr(arguments, kind)} for rig, kinds in ports.items()}
    options = BenchOptions(seed=arguments.seed, configuration=configuration)
    with replacing(arguments.out, arguments.force) as partial:
        heat = measure(
            "thermal", {site: channels[site] for site in wanted}, replace(options, instruments=given["thermal"]), input
        )
        brakes = {name: k for k, name in enumerate(configuration.brake.channels)} if arguments.brakes else {}
        pulls = measure("pull", brakes, replace(options, instruments=given["pull"]), input)
        partial.write_text(written(base, *calibration(heat, pulls)), encoding="utf-8")
    failed = 0
    for place, result in {**heat, **pulls}.items():
        numbers = ", ".join(f"{name} {one.value:.4g} ± {one.sd:.2g} {one.unit}" for name, one in result.quantities.items())
        trouble = "; ".join(f"{fault.what}: {fault.why}" for fault in result.faults)
        failed += not result.sound
        print(f"{place}: {numbers or trouble}")
    print(arguments.out)
    return 1 if failed else 0


if __name__ == "__main__":
    run_program(main)

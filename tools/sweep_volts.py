"""Sweep volts and frequency on one brake output and write what the board reports: ``python tools/sweep_volts.py OUT.csv``.

One row for each setting: volts reached, capacitance, leakage and supply current by the board's own telemetry, each the mean over
the time held, and whether the board took the command. Nothing is pulled; for forces there is ``haptics characterize pull``.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from haptics.cli.program import run_program
from haptics.errors import HapticsError, InputError
from haptics.recording.output import replacing
from haptics.session.configuration import load_configuration
from haptics.units import in_range
from rigs.bench import Bench, BenchOptions

HEAD = (
    "volts asked (V)",
    "frequency (Hz)",
    "volts reached (V)",
    "capacitance (pF)",
    "leakage (uA)",
    "supply current (uA)",
    "taken",
)
_SETTLE_S = 0.2


def sweep(
    bench: Bench, volts: Sequence[float], frequencies_hz: Sequence[float], hold_s: float
) -> Iterator[tuple[float | str, ...]]:
    """A row for each pair of volts and frequency; the output is released in between.

    :param bench: a bench with a brake controller, armed.
    :param volts: amplitudes, V, 0 to 1500.
    :param frequencies_hz: Hz, 0.5 to 1000.
    :param hold_s: how long each pair is held after it settled, s.
    :return: yields the columns of ``HEAD``.
    :raises HapticsError: the board faults, or the link is lost.
    """
    channel = bench.options.channel
    for frequency_hz in frequencies_hz:
        for asked_v in volts:
            before = len(bench.glove.brakes.take_refusals()) if bench.glove.brakes else 0
            start_ns = bench.engage(channel, asked_v, frequency_hz)
            bench.wait(_SETTLE_S + hold_s)
            seen = [message for time_ns, message in bench.telemetry if time_ns > start_ns + _SETTLE_S * 1e9]
            bench.release(channel)
            bench.wait(_SETTLE_S)
            refused = bench.glove.brakes.take_refusals() if bench.glove.brakes else []
            faults = bench.faults()
            if faults:
                raise HapticsError(f"{asked_v:g} V at {frequency_hz:g} Hz: {faults[0].why}")
            if not seen:
                raise HapticsError(f"{asked_v:g} V at {frequency_hz:g} Hz: no telemetry came")
            yield (
                asked_v,
                frequency_hz,
                float(np.max([message.output[channel] for message in seen])),
                float(np.mean([message.capacitance[channel] for message in seen])),
                float(np.mean([message.leakage[channel] for message in seen])) / 10.0,
                float(np.mean([message.supply_current for message in seen])),
                "yes" if len(refused) == before == 0 else refused[0].reason,
            )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(
        description="Sweep volts and frequency on a brake output and write what the board reports as CSV."
    )
    parser.add_argument("out", type=Path, help="CSV file to write")
    parser.add_argument("--port", help="port URL of the brake controller [default: the configuration's]")
    parser.add_argument("--config", type=Path, help="configuration file (glove.toml) [default: the simulated glove]")
    parser.add_argument("--channel", type=int, default=0, help="output of the board, from 0 [default: %(default)s]")
    parser.add_argument(
        "--volts", default="250,500,750,1000,1250,1500", help="amplitudes, V, separated by commas [default: %(default)s]"
    )
    parser.add_argument("--frequencies", default="10,20", help="frequencies, Hz, separated by commas [default: %(default)s]")
    parser.add_argument("--hold-s", type=float, default=1.0, help="how long each setting is held, s [default: %(default)s]")
    parser.add_argument("--seed", type=int, default=1, help="seed of a simulated board [default: %(default)s]")
    parser.add_argument("--force", action="store_true", help="overwrite a file that exists")
    arguments = parser.parse_args()
    try:
        volts = [in_range("volts", text, 0.0, 1500.0, "V") for text in _numbers("volts", arguments.volts)]
        frequencies = [in_range("frequency", text, 0.5, 1000.0, "Hz") for text in _numbers("frequencies", arguments.frequencies)]
        hold_s = in_range("hold-s", arguments.hold_s, 0.1, 600.0, "s")
        options = BenchOptions(
            port=arguments.port,
            seed=arguments.seed,
            channel=arguments.channel,
            configuration=load_configuration(arguments.config),
        )
        with replacing(arguments.out, arguments.force) as partial, Bench("brake", [], options, rig="sweep") as bench:
            bench.arm()
            with partial.open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(HEAD)
                for row in sweep(bench, volts, frequencies, hold_s):
                    writer.writerow(row)
                    print("\t".join(f"{value:g}" if isinstance(value, float) else value for value in row))
    except HapticsError as error:
        sys.exit(f"sweep_volts: {error}")


def _numbers(name: str, text: str) -> list[float]:
    try:
        return [float(one) for one in text.split(",")]
    except ValueError as error:
        raise InputError(
            f"{name} = {text!r} is not a list; expected numbers separated by commas [default: %(default)s]"
        ) from error


if __name__ == "__main__":
    run_program(main)

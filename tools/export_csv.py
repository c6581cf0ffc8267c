"""Export the streams of a recording as CSV files, one a stream: ``python tools/export_csv.py RECORDING FOLDER``.

Array fields become one column an element (``rise_k[0]`` ...); units stand in the column names; opaque bytes are written as
hexadecimal text.
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

from haptics.cli.program import run_program
from haptics.errors import HapticsError, InputError
from haptics.recording import Recording, load
from haptics.recording.output import make_folder, replacing


def export(recording: Recording, folder: Path) -> list[Path]:
    """Write each stream into a folder.

    :param recording: what to export.
    :param folder: new or empty; made if need be.
    :return: the files, one for each stream.
    :raises InputError: the folder exists and is not empty.
    """
    make_folder(folder)
    if any(folder.iterdir()):
        raise InputError(f"{folder} is not empty; expected a new or empty folder")
    written = []
    for name, spec in recording.streams.items():
        rows = recording.stream(name)
        columns: list[tuple[str, np.ndarray]] = []
        for field in spec.fields:
            unit = f" ({spec.units[field]})" if field in spec.units else ""
            values = rows[field].reshape(len(rows), -1) if len(rows) else np.empty((0, 1), rows[field].dtype)
            labels = [field + unit] if values.shape[1] == 1 else [f"{field}[{i}]{unit}" for i in range(values.shape[1])]
            columns += zip(labels, values.T, strict=True)
        path = folder / f"{name}.csv"
        with replacing(path, force=False) as partial, partial.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([label for label, _ in columns])
            writer.writerows(zip(*([_text(value) for value in values.tolist()] for _, values in columns), strict=True))
        written.append(path)
    return written


def _text(value: object) -> object:
    if not isinstance(value, bytes):
        return value
    return value.decode("ascii") if value.isascii() and b"\0" not in value else value.hex()


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Export a recording's streams as CSV.")
    parser.add_argument("recording", type=Path, help="recording (*.h5)")
    parser.add_argument("folder", type=Path, help="new folder for the CSV files")
    arguments = parser.parse_args()
    try:
        for path in export(load(arguments.recording), arguments.folder):
            print(path)
    except HapticsError as error:
        sys.exit(f"export_csv: {error}")


if __name__ == "__main__":
    run_program(main)

"""Compare two recordings, stream by stream: ``python tools/compare_recordings.py A.h5 B.h5 [--tolerance X] [--stream NAME]``.

Rows are brought to the first recording's times, counted from each stream's first row, straight between rows. For every number of
every stream both have: the root mean square and the maximum difference, and the maximum as a share of the field's span. Exit
code 1 if a share is above the tolerance, or a stream is in one recording only.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from haptics.cli.program import run_program
from haptics.cli.show import print_table
from haptics.errors import HapticsError, InputError
from haptics.recording import Recording, load
from haptics.units import in_range


@dataclass(frozen=True)
class Difference:
    """One number of one stream.

    :param stream: its stream.
    :param field: its name in the stream.
    :param unit: of the number; empty where none is known.
    :param rows: rows of the stream in the first and in the second recording.
    :param rms: root mean square of the difference, in the number's unit.
    :param greatest: maximum of the difference without sign, in the number's unit.
    :param share: the same over the span of both, no unit.
    """

    stream: str
    field: str
    unit: str
    rows: tuple[int, int]
    rms: float
    greatest: float
    share: float


def compare(first: Recording, second: Recording, only: str | None = None) -> list[Difference]:
    """Differences of the numbers that both recordings have, ``second`` less ``first``.

    :param first: gives the times and the span.
    :param second: brought to the times of the first.
    :param only: a stream's name; None compares all.
    :return: a row for each number of each stream.
    :raises InputError: a stream of that name is in neither.
    """
    names = [name for name in first.streams if name in second.streams and only in (None, name)]
    if only is not None and not names:
        raise InputError(
            f"stream = {only!r} is not in both; in both: {', '.join(n for n in first.streams if n in second.streams)}"
        )
    return [row for name in names for row in _stream(name, first, second)]


def only_in_one(first: Recording, second: Recording) -> list[str]:
    """Streams that are in one recording and missing in the other.

    :param first: the recordings.
    :param second: likewise, with ``first``.
    :return: their names, sorted.
    """
    return sorted(set(first.streams) ^ set(second.streams))


def _stream(name: str, first: Recording, second: Recording) -> list[Difference]:
    a, b = first.stream(name), second.stream(name)
    if not len(a) or not len(b):
        return []
    found = []
    at_s, other_s = _seconds(a), _seconds(b)
    overlap = at_s <= other_s[-1]
    for field in first.streams[name].fields:
        if field == "time_ns" or field not in second.streams[name].fields or a[field].dtype.kind not in "biuf":
            continue
        left, right = (rows[field].reshape(len(rows), -1).astype(float) for rows in (a, b))
        if left.shape[1] != right.shape[1]:
            raise InputError(f"stream {name}: {field} has {left.shape[1]} and {right.shape[1]} values a row; they must agree")
        moved = np.column_stack([np.interp(at_s[overlap], other_s, column) for column in right.T])
        apart = moved - left[overlap]
        span = float(max(left.max(), right.max()) - min(left.min(), right.min()))
        greatest = float(np.abs(apart).max(initial=0.0))
        found.append(
            Difference(
                name,
                field,
                first.streams[name].units.get(field, ""),
                (len(a), len(b)),
                float(np.sqrt(np.mean(apart**2))) if apart.size else 0.0,
                greatest,
                greatest / span if span > 0.0 else 0.0,
            )
        )
    return found


def _seconds(rows: Any) -> np.ndarray:
    return (rows["time_ns"] - rows["time_ns"][0]) / 1e9


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Compare two recordings.")
    parser.add_argument("first", type=Path, help="recording (*.h5)")
    parser.add_argument("second", type=Path, help="recording (*.h5)")
    parser.add_argument("--stream", help="only this stream")
    parser.add_argument(
        "--tolerance",
        type=float,
        default=0.0,
        help="maximum difference allowed, as a share of the field's span [default: %(default)s]",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    try:
        tolerance = in_range("tolerance", arguments.tolerance, 0.0, 1e9)
        first, second = load(arguments.first), load(arguments.second)
        rows = compare(first, second, arguments.stream)
        alone = [] if arguments.stream else only_in_one(first, second)
    except HapticsError as error:
        sys.exit(f"compare_recordings: {error}")
    same = not alone and all(row.share <= tolerance for row in rows)
    if arguments.json:
        print(json.dumps({"same": same, "only_in_one": alone, "differences": [asdict(row) for row in rows]}, indent=1))
    else:
        cells = ((r.stream, r.field, r.unit, f"{r.rows[0]} / {r.rows[1]}", r.rms, r.greatest, r.share) for r in rows)
        print_table(
            f"{arguments.second} less {arguments.first}", ("stream", "field", "unit", "rows", "rms", "max", "share"), cells
        )
        for name in alone:
            print(f"only in one: {name}")
        print("the same within the tolerance" if same else "different")
    sys.exit(0 if same else 1)


if __name__ == "__main__":
    run_program(main)

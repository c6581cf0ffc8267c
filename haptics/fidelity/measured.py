"""The table of measured errors and costs: what a row holds, and the table that ships with this version."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import Any

from haptics.errors import InputError

SHIPPED = "data/measured.json"


@dataclass(frozen=True, slots=True)
class MeasuredRow:
    """Errors of one observable at one level, and the level's cost.

    :param model: latch, thermal or brake.
    :param level: of the model.
    :param observable: what is compared.
    :param unit: of the errors.
    :param cases: typical or edge.
    :param n: cases that count.
    :param refused: cases that the level did not answer.
    :param median: of the errors.
    :param p95: 95 % of the errors are below.
    :param worst: largest error, hardest cases included.
    :param cost_us_per_event: CPU time of one event (us).
    :param cost_s_per_sim_s: CPU seconds for a simulated second, by number of devices.
    """

    model: str
    level: str
    observable: str
    unit: str
    cases: str
    n: int
    refused: int
    median: float
    p95: float
    worst: float
    cost_us_per_event: float
    cost_s_per_sim_s: dict[str, float]


@dataclass(frozen=True, slots=True)
class Measured:
    """What was measured, where and with which version.

    :param machine: see ``measure.machine``.
    :param version: of the package.
    :param seed: of the cases.
    :param rows: errors and costs.
    """

    machine: dict[str, Any]
    version: str
    seed: int
    rows: tuple[MeasuredRow, ...]

    def row(self, model: str, level: str, observable: str, cases: str = "typical") -> MeasuredRow:
        """One row.

        :param model: latch, thermal or brake.
        :param level: of the model.
        :param observable: what is compared.
        :param cases: typical or edge.
        :return: the row.
        :raises InputError: there is none.
        """
        for row in self.rows:
            if (row.model, row.level, row.observable, row.cases) == (model, level, observable, cases):
                return row
        raise InputError(
            f"no measured row for {model} at level {level}, {observable}, {cases} cases; run: haptics fidelity measure"
        )


def shipped() -> Measured:
    """What was measured when this version was made.

    :return: the table that ships with the package.
    """
    return from_json(json.loads(files("haptics.fidelity").joinpath(SHIPPED).read_text(encoding="utf-8")))


def to_json(measured: Measured) -> dict[str, Any]:
    """Plain data, numbers of four digits: more would change with every run.

    :param measured: a table.
    :return: lists and dictionaries.
    """
    data = asdict(measured)
    data["rows"] = [_rounded(row) for row in data["rows"]]
    return data


def from_json(data: dict[str, Any]) -> Measured:
    """The inverse of ``to_json``.

    :param data: as from ``to_json``.
    :return: the table.
    """
    return Measured(data["machine"], data["version"], data["seed"], tuple(MeasuredRow(**row) for row in data["rows"]))


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return float(f"{value:.4g}") if isinstance(value, float) else value

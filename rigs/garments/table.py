"""The published designs of Table 5.1, and the same garments and motions designed here: one folder a row, so that it can go on."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from haptics.errors import InputError, LimitError
from haptics.garments.bodies import MOTIONS
from haptics.garments.design.drawn import SHAPES
from haptics.garments.design.job import DesignJob
from haptics.garments.design.topology import SMALLEST_COVERAGE, Progress
from haptics.garments.design_run import FILES, run_design
from haptics.units import in_range


@dataclass(frozen=True)
class Case:
    """One row of Table 5.1.

    :param label: its name in the reference data.
    :param written: its name in the source.
    :param garment: name of the garment.
    :param motion: name of the motion.
    :param coverage: share of the garment's area to reinforce (5.6.2), 0.01 to 1.
    """

    label: str
    written: str
    garment: str
    motion: str
    coverage: float


CASES = (
    Case("arm_flexion", "Arm Flexion", "sleeve", "elbow_flexion", 0.15),
    Case("arm_extension", "Arm Extension", "sleeve", "elbow_extension", 0.15),
    Case("knee_flexion", "Knee Flexion", "knee_sleeve", "knee_flexion", 0.10),
    Case("knee_extension", "Knee Extension", "knee_sleeve", "knee_extension", 0.15),
    Case("slouch", "Slouch", "shirt", "slouch", 0.10),
    Case("crouch", "Crouch", "shorts", "crouch", 0.15),
    Case("lunge", "Lunge", "shorts", "lunge", 0.15),
)
"""Coverages of 5.6.2."""


@dataclass(frozen=True)
class TableOptions:
    """What the rows have in common.

    :param motions: rows to make, by motion; all if empty.
    :param coverage: of all rows, instead of the published ones.
    :param body: of the person, such as ``capsule``.
    :param phenotype: shape parameters of the body by name; empty for the default.
    :param level: fineness of the mesh, such as ``draft``.
    :param solver: linear solver by name; None takes the fastest installed.
    :raises InputError: a motion that is no row, or a coverage that is not 0.01 to 1.
    """

    body: str = "capsule"
    phenotype: Mapping[str, float] = field(default_factory=dict)
    level: str = "draft"
    motions: Sequence[str] = ()
    coverage: float | None = None
    solver: str | None = None

    def __post_init__(self) -> None:
        known = [case.motion for case in CASES]
        for motion in self.motions:
            if motion not in known:
                raise InputError(f"motion = {motion!r} is not a row of Table 5.1; allowed: {', '.join(known)}")
        if self.coverage is not None:
            in_range("coverage", self.coverage, SMALLEST_COVERAGE, 1.0)

    @property
    def cases(self) -> list[Case]:
        """Rows to make, in the order of the table."""
        return [case for case in CASES if not self.motions or case.motion in self.motions]

    def coverage_of(self, case: Case) -> float:
        """What a row is asked to cover.

        :param case: one row.
        :return: share of the area, 0.01 to 1.
        """
        return case.coverage if self.coverage is None else self.coverage


@dataclass(frozen=True)
class MadeRow:
    """A row made here.

    :param data: what ``haptics garment design --json`` prints; None where the garment has no equilibrium to begin with.
    :param why_not: the reason then.
    :param case: the row.
    :param folder: that holds its design.
    """

    case: Case
    folder: Path
    data: Mapping[str, Any] | None
    why_not: str = ""

    @property
    def sound(self) -> bool:
        """Designed without a fault."""
        return self.data is not None and not self.data["faults"]

    @property
    def beats_drawn(self) -> bool | None:
        """Whether the design stores more for its area than the drawn ones; None where one of them is missing."""
        if self.data is None:
            return None
        drawn = [self.data[shape]["density"] for shape in SHAPES]
        return None if None in drawn else self.data["density_increase"] > max(drawn)


def make_rows(
    options: TableOptions, folder: Path, progress: Progress | None = None, say: Callable[[str], None] | None = None
) -> list[MadeRow]:
    """Design each row in a folder of its own within ``folder``; a row that is complete there is read, a begun one goes on.

    :param options: of all rows.
    :param folder: parent of one folder for each row.
    :param progress: called with number and state of each step.
    :param say: called with a line of text at each stage.
    :return: one for each case, in order.
    :raises InputError: a body or solver that is not there, or a folder that was begun with other settings.
    """
    return [_row(case, options, folder / f"{case.garment}-{case.motion}", progress, say) for case in options.cases]


def _row(
    case: Case, options: TableOptions, folder: Path, progress: Progress | None, say: Callable[[str], None] | None
) -> MadeRow:
    job = DesignJob(
        case.garment,
        case.motion,
        options.coverage_of(case),
        level=options.level,
        body=options.body,
        phenotype=options.phenotype,
        solver=options.solver,
    )
    done = _finished(job, folder)
    if done is not None:
        return MadeRow(case, folder, done)
    try:
        report = run_design(job, folder, resume=True, progress=progress, say=say)
    except LimitError as error:
        return MadeRow(case, folder, None, str(error))
    return MadeRow(case, folder, report.to_json())


def _finished(job: DesignJob, folder: Path) -> dict[str, Any] | None:
    """What an earlier run reported of the same job, if that is complete and its files are there."""
    path = folder / "design.json"
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        same = (
            (data["garment"], data["motion"], data["coverage_asked"]) == (job.garment, job.motion, job.coverage)
            and (data["body"], data["phenotype"], data["level"]) == (job.body, dict(job.phenotype), job.level)
            and (data["lame"], data["angle_deg"]) == (job.lame, MOTIONS[job.motion].checked_deg(job.angle_deg))
            and job.solver in (None, data["solver"])
        )
        return data if same and data["complete"] and all((folder / name).is_file() for name in FILES) else None
    except (ValueError, KeyError, TypeError):
        return None  # not ours or damaged: made again

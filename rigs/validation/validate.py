"""Every rig against every published number that a device here can meet: one table, and what cannot be met, with why.

Three kinds of rows. A *rig* measured it, on simulated or real devices. A *model* computes it from stated numbers, without any
measurement. Nothing answers it, and the row states why. Rows whose number was used to set up the shipped plants are marked
``calibration``: they show that the plants are what they should be, and prove nothing.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from typing import Any

from rigs.bench import BenchOptions
from rigs.catalogue import RIGS, rig
from rigs.characterize import Characterisation, gathered, run_jobs
from rigs.comparison import Row, compare, compared, not_met
from rigs.judge import Judgement, judge
from rigs.result import Answer
from rigs.validation.model_numbers import EXPLAINED, model_numbers
from rigs.validation.unanswered import UNANSWERED


@dataclass(frozen=True)
class Validation:
    """All rows, the results of each rig, and what the circuit simulator found of the electrical and thermal models.

    :param rows: of rigs, models and unanswered numbers.
    :param characterisations: one for each rig that was run.
    :param judgements: None where ngspice is not installed.
    """

    rows: tuple[Row, ...]
    characterisations: tuple[Characterisation, ...]
    judgements: tuple[Judgement, ...] | None

    @property
    def sound(self) -> bool:
        """No validation row fails without a stated contradiction, no rig saw a fault, and the judge agrees everywhere."""
        return (
            not any(row.fails for row in self.rows)
            and all(done.sound for done in self.characterisations)
            and all(one.agrees for one in self.judgements or ())
        )

    @property
    def counts(self) -> dict[str, int]:
        """Rows by role and verdict."""
        found = Counter(f"{row.role}: {row.verdict}" for row in self.rows)
        return dict(sorted(found.items()))

    def to_json(self) -> dict[str, Any]:
        """Plain data.

        :return: keys as ``haptics validate --json`` prints them.
        """
        return {
            "rows": [row.to_json() for row in self.rows],
            "counts": self.counts,
            "sound": self.sound,
            "rigs": [done.to_json() for done in self.characterisations],
            "judge": None if self.judgements is None else [asdict(one) for one in self.judgements],
        }


def validate(
    options: BenchOptions,
    devices: int = 3,
    rigs: Sequence[str] = tuple(RIGS),
    *,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda what: None,
) -> Validation:
    """Run rigs on ``devices`` simulated devices each, seeds from ``options.seed`` on, and compare.

    :param options: of the benches; ``record`` does not count.
    :param devices: simulated devices for each rig, >= 1.
    :param rigs: names of the rigs to run; rows of the others state that they were not run.
    :param executor: what runs the rigs; a pool of processes if None.
    :param progress: called with a line of text for each run.
    :return: all rows, results and judgements.
    :raises InputError: an unknown rig, or a port that is not simulated.
    :raises HapticsError: a bench failed.
    """
    chosen = [rig(name) for name in rigs]
    jobs = [(one.NAME, replace(options, seed=options.seed + k, record=None)) for one in chosen for k in range(devices)]
    results = run_jobs(jobs, executor, progress)
    done = tuple(gathered(one.NAME, options, results[k * devices : (k + 1) * devices]) for k, one in enumerate(chosen))
    progress("ngspice")
    judgements = None if shutil.which("ngspice") is None else tuple(judge(quick=True, progress=progress))
    return Validation(tuple(_rows(done, rigs)), done, judgements)


def _rows(done: Sequence[Characterisation], rigs: Sequence[str]) -> list[Row]:
    rows = [row for one in done for row in compare(rig(one.rig).PUBLISHED, one.quantities)]
    for name in RIGS:
        if name not in rigs:
            rows += [not_met(key, answer, f"rig {name} was not run") for key, answer in rig(name).PUBLISHED.items()]
    for number, (quantity, why) in model_numbers().items():
        rows.append(compared(number, Answer(number, EXPLAINED.get(number)), quantity, why))
    rows += [not_met(number, Answer(number), why) for number, why in UNANSWERED.items()]
    return rows

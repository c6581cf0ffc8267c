"""All cases, run one after the other."""

from __future__ import annotations

from collections.abc import Callable

from rigs.judge.cases.brake import BrakeCase, brake_cases
from rigs.judge.cases.coil import CoilCase, coil_cases
from rigs.judge.cases.heat import HeatCase, heat_cases
from rigs.judge.judgement import Judgement

__all__ = ["Judgement", "all_cases", "judge"]


def all_cases(quick: bool = False) -> list[BrakeCase | CoilCase | HeatCase]:
    """The declared cases; ``quick``: a few of each kind.

    :param quick: only a few of each kind.
    :return: brake, coil and heat cases.
    """
    cases: list[BrakeCase | CoilCase | HeatCase] = [*brake_cases(), *coil_cases(), *heat_cases()]
    return [case for case in cases if case.quick] if quick else cases


def judge(quick: bool = False, progress: Callable[[str], None] | None = None) -> list[Judgement]:
    """Every model against ngspice over the declared cases, a row for each quantity.

    :param quick: only a few cases of each kind.
    :param progress: called with each case's name before it runs.
    :return: one judgement for each quantity of each case.
    :raises HapticsError: ngspice is not installed, or gives up on a circuit.
    """
    rows: list[Judgement] = []
    for case in all_cases(quick):
        if progress is not None:
            progress(case.name)
        rows += case.judged()
    return rows

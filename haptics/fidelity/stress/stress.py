"""Every model at its extremes: what was tried, the worst that came of it, and where a level stops being valid.

The rule that is tried: outside its validity a level refuses (``InputError``) or reports it; it never gives a plausible wrong
number, NaN or infinity. A row states one extreme of one level; it ``holds`` if its worst error is within the bound written
beside it and nothing that should have been refused was answered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from haptics.fidelity.stress.brake import stress_brake
from haptics.fidelity.stress.latch import stress_latch
from haptics.fidelity.stress.tally import StressRow
from haptics.fidelity.stress.thermal import stress_thermal
from haptics.units import one_of

Progress = Callable[[str], None]


def stress(
    quick: bool = False, seed: int = 1, progress: Progress = lambda _: None, models: Sequence[str] | None = None
) -> list[StressRow]:
    """Try everything; about a minute, or ten seconds when ``quick``.

    :param quick: True: fewer cases.
    :param seed: of drawn cases.
    :param progress: called with a model's name when it begins.
    :param models: latch, thermal or brake; all by default.
    :return: a row for each extreme of each level.
    :raises InputError: an unknown model.
    """
    known = {"latch": stress_latch, "thermal": stress_thermal, "brake": stress_brake}
    rows: list[StressRow] = []
    for model in known if models is None else models:
        progress(model)
        rows += known[one_of("model", model, tuple(known))](quick, seed)
    return rows

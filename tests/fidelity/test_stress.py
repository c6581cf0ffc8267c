"""Extremes: every level holds at all of them, and the tally itself would tell if one did not."""

from __future__ import annotations

import math

import pytest

from haptics.errors import InputError
from haptics.fidelity.stress.stress import stress
from haptics.fidelity.stress.tally import Tally

MODELS = {
    "latch": {"event", "table", "dynamic", "reference"},
    "thermal": {"exact", "two_node"},
    "brake": {"static", "lagged", "dynamic", "reference"},
}


def refuse() -> float:
    raise InputError("no")


@pytest.mark.parametrize("model", ["thermal", *(pytest.param(model, marks=pytest.mark.slow) for model in ("latch", "brake"))])
def test_every_level_holds_at_its_extremes(model):
    rows = stress(quick=True, models=[model])
    assert {row.level for row in rows} == MODELS[model]
    assert not [row for row in rows if not row.holds]
    assert all(row.tried > 0 and math.isfinite(row.worst) for row in rows)
    assert sum(row.refused for row in rows) > 5  # nonsense is refused


@pytest.mark.soak
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("seed", range(3))
def test_every_level_holds_at_very_many_extremes(model, seed):
    assert not [row for row in stress(seed=seed, models=[model]) if not row.holds]


@pytest.mark.parametrize(
    ("answer", "must_refuse", "holds"),
    [
        (lambda: 0.5, False, True),
        (lambda: 1.5, False, False),
        (lambda: math.nan, False, False),
        (lambda: math.inf, False, False),
        (lambda: None, False, True),
        (refuse, True, True),
        (lambda: 0.0, True, False),
    ],
)
def test_a_tally_tells_a_wrong_number_a_nan_and_an_answer_that_should_have_been_refused(answer, must_refuse, holds):
    tally = Tally("latch", "event", "x", "ms", 1.0)
    tally.ask(answer, must_refuse=must_refuse)
    assert tally.row().holds is holds


def test_nothing_tried_is_nothing_held():
    assert not Tally("latch", "event", "x", "ms", 1.0).row().holds


def test_an_unknown_model_is_refused():
    with pytest.raises(InputError, match="garment"):
        stress(models=["garment"])

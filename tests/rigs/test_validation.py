"""``haptics validate``: every published number beside ours, in one table and on one page."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import shorter
import typer
from typer.testing import CliRunner

from haptics.errors import InputError
from rigs.catalogue import RIGS, rig
from rigs.characterize import run_one
from rigs.commands import validate as validate_command
from rigs.comparison import compared
from rigs.reference import published
from rigs.result import Answer, Quantity
from rigs.validation.unanswered import UNANSWERED
from rigs.validation.validate import Validation

KEYS = {"quantity", "section", "published", "tolerance", "ours", "uncertainty", "unit", "role", "verdict", "why"}
VERDICTS = {"agrees", "differs", "not identifiable", "contradiction in the source"}

pytestmark = pytest.mark.slow


def in_this_process(jobs, executor, progress):
    """``run_jobs`` without a pool of processes, which would not know that the rigs are shorter."""
    return tuple(run_one(name, job) for name, job in jobs)


@pytest.fixture(scope="module")
def validated(tmp_path_factory) -> tuple[dict, Path]:
    """The command on rigs with fewer steps; those of full length are judged by their own tests, and together below."""
    out = tmp_path_factory.mktemp("validation")
    command = typer.Typer()
    command.command()(validate_command)
    with pytest.MonkeyPatch.context() as patch:
        for shorten in (shorter.thermal, shorter.pendulum, shorter.frequency, shorter.response, shorter.supply):
            shorten(patch.setattr)
        shorter.pull(patch.setattr, (0.0, 250.0, 500.0, 1000.0, 1500.0))
        patch.setattr(sys.modules[Validation.__module__], "run_jobs", in_this_process)
        done = CliRunner().invoke(command, ["--devices", "1", "--out", str(out), "--json"])
    assert done.exit_code == 0, done.output[-3000:]
    return json.loads(done.stdout), out


@pytest.mark.soak
@pytest.mark.timeout(1200)
def test_every_rig_at_full_length_answers_soundly(tmp_path):
    command = [sys.executable, "-m", "haptics.cli.main", "validate", "--devices", "2", "--out", str(tmp_path), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1100, check=False)
    assert done.returncode == 0, done.stderr + done.stdout[-3000:]
    assert json.loads(done.stdout)["sound"]


def test_every_row_has_what_the_contract_says(validated):
    found, out = validated
    assert len(found["rows"]) > 40
    for row in found["rows"]:
        assert set(row) >= KEYS
        assert row["verdict"] in VERDICTS
        assert row["role"] in ("validation", "calibration")
        if row["verdict"] != "agrees":
            assert row["why"], row
    assert sum(found["counts"].values()) == len(found["rows"])
    assert json.loads((out / "validation.json").read_text())["counts"] == found["counts"]


def test_every_rig_ran_without_a_fault_and_answers_what_it_is_there_for(validated):
    found, _ = validated
    assert [one["rig"] for one in found["rigs"]] == list(RIGS)
    assert not [one["faults"] for one in found["rigs"] if one["faults"]]
    answered = {row["name"] for row in found["rows"] if row["ours"] is not None}
    for name in RIGS:
        assert set(rig(name).PUBLISHED) <= answered


def test_numbers_that_set_up_the_plants_are_not_counted_as_validation(validated):
    found, _ = validated
    roles = {row["name"]: row["role"] for row in found["rows"]}
    assert roles["tau_s"] == roles["c_nominal_k_per_w"] == roles["tau_foam_s"] == "calibration"
    assert roles["slew_n_s"] == roles["power_20hz_w"] == "validation"


def test_the_judge_agrees_with_every_circuit(validated):
    found, _ = validated
    if found["judge"] is None:
        pytest.skip("no ngspice here")
    assert len(found["judge"]) > 20
    assert all(one["agrees"] for one in found["judge"])


def test_the_page_has_every_rigs_curves_with_units_readable_in_a_browser(validated, browser):
    _, out = validated
    page = browser.look(out / "validation.html", height=12_000)
    assert len(page.seen["figures"]) >= 2 * len(RIGS)
    for figure in page.seen["figures"]:
        assert not figure["outside"]
        assert sum("(" in word and word.endswith(")") for word in figure["words"]) >= 2, figure["words"]  # both axes have a unit
    assert not page.seen["wide"]
    for colour in ((0, 114, 178), (213, 94, 0), (0, 158, 115)):  # measured, fit, published
        assert page.count(*colour) > 500


def test_a_number_that_differs_without_a_contradiction_fails():
    row = compared("x", Answer("capacitance"), Quantity(3e-9, 0.0, "F"))
    assert row.verdict == "differs"
    assert row.fails
    assert not Validation((row,), (), ()).sound


def test_a_contradiction_explains_only_the_numbers_that_it_is_about():
    row = compared("x", Answer("predicted_charge_time", "time_to_charge"), Quantity(7.6e-3, 0.0, "s"))
    assert row.verdict == "contradiction in the source"
    assert not row.fails
    with pytest.raises(InputError, match="contradiction"):
        compared("x", Answer("thermal_tau", "time_to_charge"), Quantity(50.0, 0.1, "s"))


def test_a_calibration_row_that_differs_is_shown_and_does_not_count():
    row = compared("x", Answer("thermal_tau"), Quantity(150.0, 0.1, "s"))
    assert (row.verdict, row.role, row.fails) == ("differs", "calibration", False)


def test_what_is_said_to_be_unanswered_is_published_and_not_answered():
    answered = {answer.published for name in RIGS for answer in rig(name).PUBLISHED.values()}
    for number in UNANSWERED:
        assert published(number).id == number
    assert not answered & set(UNANSWERED)

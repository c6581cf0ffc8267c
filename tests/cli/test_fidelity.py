"""``haptics fidelity`` as a program meets it: the contract of its JSON, its exit codes, and what it refuses."""

from __future__ import annotations

import json

import pytest
from shared_proofs import shared_proofs


def test_the_shipped_measurement_keeps_its_contract(answer):
    table = answer("fidelity", "measure", "--shipped")
    assert table.keys() >= {"machine", "version", "rows"}
    for row in table["rows"]:
        assert row.keys() >= {
            "model", "level", "observable", "unit", "n", "median", "p95", "worst", "cost_us_per_event", "cost_s_per_sim_s"
        }  # fmt: skip
        assert row["cost_s_per_sim_s"].keys() == {"1", "15", "64", "1000"}


@pytest.mark.slow
def test_a_measurement_is_written_whole_and_not_over_another(command, tmp_path):
    out, picture = tmp_path / "table.json", tmp_path / "table.png"
    code, _, err = command("fidelity", "measure", "--shipped", "--out", out, "--picture", picture)
    assert code == 0, err
    assert json.loads(out.read_text())["rows"]
    assert picture.read_bytes()[:4] == b"\x89PNG"
    code, _, err = command("fidelity", "measure", "--shipped", "--out", out)
    assert code == 2
    assert "exists" in err


def test_a_plan_keeps_its_contract(answer):
    plan = answer("fidelity", "plan", "playground", "--tolerance-jnd", "0.5")
    assert plan["scene"] == "playground"
    assert plan["tolerance"] == 0.5
    for row in plan["rows"]:
        assert row.keys() >= {"device", "model", "level", "error", "limit", "observable", "why"}
    for absence in plan["absent"]:
        assert absence.keys() >= {"device", "why"}


def test_tables_name_what_they_show(command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")  # no word is broken between lines
    for words, named in (
        (("fidelity", "plan", "desk"), ("latch", "unnoticed", "no grasp")),
        (("fidelity", "measure", "--shipped"), ("arrival time, ms", "dynamic", "us an event")),
        (("fidelity", "stress", "--quick", "--model", "thermal"), ("two_node", "100 years", "yes")),
    ):
        code, out, _ = command(*words)
        assert code == 0
        text = " ".join(out.split())
        assert all(word in text for word in named), text


@pytest.mark.slow
def test_a_proof_says_whether_it_was_kept_by_its_exit_code(command, strict_json):
    coarse = ("--level", "latch=event", "--level", "brake=static", "--tolerance-jnd", "0.01")
    with shared_proofs():
        kept, told, _ = command("fidelity", "prove", "playground", "--json")
        code, out, _ = command("fidelity", "prove", "playground", *coarse, "--json")
    assert kept == 0
    assert strict_json(told)["kept"] is True
    assert code == 1
    proof = strict_json(out)
    assert proof["kept"] is False
    assert proof["levels"]["latch"] == "event"


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("fidelity", "plan", "desk", "--tolerance-jnd", "0"), "--tolerance-jnd = 0"),
        (("fidelity", "plan", "desk", "--budget", "-1"), "budget"),
        (("fidelity", "plan", "desk", "--level", "latch"), "MODEL=LEVEL"),
        (("fidelity", "plan", "desk", "--level", "latch=fast"), "fast"),
        (("fidelity", "stress", "--model", "garment"), "garment"),
        (("fidelity", "prove", "nowhere"), "nowhere"),
        (("run", "desk", "--level", "brake=exact"), "exact"),
    ],
)
def test_nonsense_is_refused_by_name(refused, words, named):
    assert named in refused(*words)


@pytest.mark.parametrize("level", ["event", "table", "dynamic", "reference"])
def test_a_pulse_beyond_the_stated_drive_is_answered_and_called_not_valid(answer, level):
    outcome = answer("predict", "latch", "--pulse-ms", "60", "--volts", "6", "--level", level)
    assert outcome["valid"] is False
    assert outcome["switched"] is True
    assert outcome["arrival_ms"] == pytest.approx(4.124, abs=0.01)
    reasons = " ".join(outcome["reasons"])
    assert "60 ms" in reasons
    assert "6 V" in reasons


@pytest.mark.slow
def test_levels_of_a_brake_differ_where_they_should(answer):
    found = {
        level: answer("predict", "brake", "--volts", "1000", "--hz", "10", "--level", level)
        for level in ("static", "lagged", "reference")
    }
    assert {row["level"] for row in found.values()} == {"static", "lagged", "reference"}
    assert found["static"]["ripple_n"] < 0.3 * found["lagged"]["ripple_n"]  # overlap that slides away; no dips
    assert found["lagged"]["plateau_n"] == pytest.approx(found["reference"]["plateau_n"], rel=0.01)

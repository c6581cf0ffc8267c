"""``haptics link identify``, ``monitor``, ``conformance``: who is there, how the line does, and a diagnosis where it does not."""

from __future__ import annotations

import re

import pytest
import serial

import haptics.link.ports  # noqa: F401  # lets pyserial find the simulated boards
from firmware_models.boards import board as board_module
from firmware_models.boards.board import FirmwareModel

VIRTUAL = "sim://tactiles?clock=virtual"


def test_identify_tells_who_is_there_and_how_its_clock_runs(answer):
    who = answer("link", "identify", "--port", "sim://brake?clock=virtual&ppm=40")
    assert (who["board"], who["build"], who["protocol"], who["channels"]) == ("brake", "py-brk-1", 1, 5)
    assert who["limits"] == pytest.approx(
        {
            "max_amplitude_v": 1500,
            "max_supply_current_a": 500e-6,
            "max_frequency_hz": 1000,
            "max_ttl_s": 2,
            "max_charge_c": 45e-6,
        }
    )
    assert re.fullmatch("[0-9a-f]{8}", who["boot_id"])
    assert 0 < who["clock_error_bound_us"] < 1000
    assert who["clock_skew_ppm"] == pytest.approx(40, abs=400)  # within twice its bound over the 0.7 s that it is watched


@pytest.mark.parametrize(
    ("arguments", "seen", "advice"),
    [
        ((f"{VIRTUAL}&faults=drop=1",), "no byte came back", "check power, cable"),
        ((VIRTUAL, "--baud", "115200"), "no byte came back", "the baud rate (boards use 500000)"),
        ((f"{VIRTUAL}&faults=drop=1,garbage=400",), "that form no frame", "the baud rate is probably wrong"),
        (("/dev/no-such-port",), "no such port", "sim://tactiles"),
        (("sim://nobody",), "nobody", "there are sim://tactiles, sim://brake"),
    ],
    ids=["silent", "wrong baud", "noise", "missing", "no such board"],
)
@pytest.mark.parametrize("name", ["identify", "monitor", "conformance"])
def test_who_cannot_be_reached_is_diagnosed_and_the_exit_code_is_2(refused, name, arguments, seen, advice):
    error = refused("link", name, "--port", *arguments)
    if name == "conformance" and seen in ("no byte came back", "that form no frame"):
        seen, advice = "no identity within 4 s", "try haptics link identify"
    assert seen in error
    assert advice in error


@pytest.mark.parametrize("name", ["identify", "monitor"])
def test_another_firmware_is_named_and_what_to_do_about_it(refused, monkeypatch, name):
    monkeypatch.setattr(board_module, "schema_hash", lambda: 0x12345678)
    error = refused("link", name, "--port", VIRTUAL)
    assert "the board's message table is 12345678" in error
    assert "make firmware-flash" in error


@pytest.mark.parametrize("name", ["identify", "monitor", "conformance"])
def test_a_busy_port_is_named_with_who_has_it(refused, name):
    url = f"{VIRTUAL}&world=busy"
    with serial.serial_for_url(url, timeout=0):
        error = refused("link", name, "--port", url)
    assert "port already open in this program" in error
    assert "close it there first" in error


def test_a_monitor_counts_telemetry_and_what_the_line_carries_and_arms_nothing(answer):
    seen = answer("link", "monitor", "--port", VIRTUAL, "--for-s", 2)
    assert (seen["state"], seen["faults"], seen["error"]) == ("disarmed", [], None)
    assert seen["elapsed_s"] == pytest.approx(2)
    assert seen["telemetry"] in (99, 100, 101)
    assert seen["telemetry_missed"] == 0
    assert seen["telemetry_hz"] == pytest.approx(50, abs=1)
    assert seen["telemetry_share"] == pytest.approx(seen["telemetry"] * 68 / 100_000, rel=1e-6)  # 68 bytes each, 50 000 a second
    assert seen["telemetry_share"] <= seen["uplink_share"] < 0.1
    assert not any(seen["counters"][name] for name in ("retries", "given_up", "bad_frames", "echoes", "stray_replies"))
    assert 0 < seen["clock_error_bound_us"] < 1000
    assert seen["min_lead_ms"] == pytest.approx(2e-3 * seen["clock_error_bound_us"] + 29 * 10 / 500, rel=1e-6)


def test_a_monitor_counts_telemetry_that_the_line_lost(answer):
    seen = answer("link", "monitor", "--port", f"{VIRTUAL}&faults=drop=0.2", "--for-s", 4)
    assert seen["telemetry_missed"] > 0
    assert seen["telemetry"] + seen["telemetry_missed"] == pytest.approx(200, abs=5)  # the last ones may not be known yet


def test_an_unplugged_cable_ends_a_monitor_with_1_and_says_what_to_do(command, strict_json):
    code, out, err = command("link", "monitor", "--port", f"{VIRTUAL}&faults=unplug_s=0.5", "--for-s", 2, "--json")
    assert code == 1
    assert "the board is unplugged" in err
    assert "check the cable, and plug it in again" in err
    seen = strict_json(out)
    assert seen["state"] == "lost"
    assert seen["elapsed_s"] < 0.5
    assert seen["telemetry"] > 10


def test_a_monitor_shows_a_person_the_same_in_a_table(command):
    code, out, err = command("link", "monitor", "--port", VIRTUAL, "--for-s", 0.2)
    assert (code, err) == (0, "")
    for row in ("state", "telemetry_missed", "clock_error_bound", "retries", "stray_replies"):
        assert row in out


def test_a_time_below_zero_is_refused(refused):
    assert "for-s" in refused("link", "monitor", "--port", VIRTUAL, "--for-s", -1)


@pytest.mark.slow
@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_conformance_answers_a_row_a_rule(answer, board):
    report = answer("link", "conformance", "--port", f"sim://{board}")
    assert report["identity"]["board"] == board
    assert {row["result"] for row in report["rules"]} == {"ok", "not applicable"}
    assert report["passed"] >= 60
    assert (report["failed"], report["passed"] + report["not_applicable"]) == (0, len(report["rules"]))
    assert all(set(row) == {"id", "title", "result", "seen"} and all(row.values()) for row in report["rules"])


def test_a_broken_rule_makes_the_exit_code_1(command, strict_json, monkeypatch):
    monkeypatch.setattr(FirmwareModel, "_dead_man_ns", lambda self: 1 << 62)
    code, out, _ = command("link", "conformance", "--port", "sim://tactiles", "--json")
    report = strict_json(out)
    assert code == 1
    assert report["failed"] == sum(row["result"] == "failed" for row in report["rules"]) > 0
    assert {"dead-man.armed", "dead-man.pulse"} <= {row["id"] for row in report["rules"] if row["result"] == "failed"}


def test_conformance_in_words_ends_with_the_counts(command):
    code, out, err = command("link", "conformance", "--port", "sim://brake")
    assert (code, err) == (0, "")
    assert re.search(r"\d\d passed, 0 failed, \d\d not applicable", out)

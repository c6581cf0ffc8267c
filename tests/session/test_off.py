"""``haptics off`` exits with 0 only where every board that was named, or found, said that it is off."""

from __future__ import annotations

import json
import sys
import uuid

import pytest
import serial

from firmware_models.boards import board as board_module
from firmware_models.boards.brake_board import BrakeBoard
from haptics.cli import main as cli
from haptics.errors import LinkLost
from haptics.link.messages import Fault
from haptics.link.ports import PortInfo
from haptics.link.settings import LinkSettings
from haptics.session import off as off_module
from haptics.session.off import make_safe

FAST = {"identify_every_ns": 10_000_000, "identify_tries": 4}


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    """Ports without a board are given up after 40 ms and not 4 s."""
    made = off_module.LinkSession
    monkeypatch.setattr(off_module, "LinkSession", lambda board, url: made(board, url, settings=LinkSettings(**FAST)))


@pytest.fixture
def off(monkeypatch, capsys):
    def run(*ports):
        named = [word for port in ports for word in ("--port", port)]
        monkeypatch.setattr(sys, "argv", ["haptics", "off", *named, "--json"])
        code = 0
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code
        return code, json.loads(capsys.readouterr().out)

    return run


def board(name="tactiles", **keys):
    """A board of a world of its own, in real time."""
    query = "&".join(f"{key}={value}" for key, value in {"world": uuid.uuid4().hex, **keys}.items())
    return f"sim://{name}?{query}"


def test_a_named_board_that_is_off_gives_0(off):
    code, seen = off(board(), board("brake"))
    assert (code, seen["safe"]) == (0, True)
    assert [one["board"] for one in seen["ports"]] == ["tactiles", "brake"]


@pytest.mark.parametrize(
    ("port", "said"),
    [
        (lambda: "/dev/does_not_exist", "no such port"),
        (lambda: board(faults="drop=1"), "no byte came back"),
        (lambda: "loop://", "came back unchanged"),
        (lambda: "spy:///dev/ttyACM0", "unknown kind spy://"),
        (lambda: "socket://127.0.0.1:1", "no such port"),
        (lambda: "sim://thermocouple", "no identity"),
        (lambda: __file__, "not a serial port"),
    ],
    ids=["missing", "silent", "loop", "not opened", "nobody listens", "not a board", "a file"],
)
def test_a_named_port_that_cannot_be_made_safe_gives_2_and_the_others_are_made_safe(off, port, said):
    code, seen = off(port(), board())
    assert (code, seen["safe"]) == (2, False)
    bad, good = seen["ports"]
    assert not bad["safe"]
    assert said in bad["result"]
    assert good["safe"]


def test_a_busy_port_gives_2(off):
    url = board()
    with serial.serial_for_url(url, timeout=0):
        code, seen = off(url)
    assert code == 2
    assert "already open" in seen["ports"][0]["result"]


@pytest.fixture
def faulty(monkeypatch):
    """A board with a short on an output, which has tripped."""

    def boots_with_a_fault(self):
        power_on(self)
        self.faults = 1 << Fault.SHORT

    power_on = board_module.FirmwareModel._power_on
    monkeypatch.setattr(board_module.FirmwareModel, "_power_on", boots_with_a_fault)
    monkeypatch.setattr(BrakeBoard, "_cause_gone", lambda self, fault: fault is not Fault.SHORT)
    return board("brake")


def test_a_cause_that_is_left_gives_2(off, faulty):
    code, seen = off(faulty)
    assert "the cause of a latched fault is still there: short" in seen["ports"][0]["result"]
    assert (code, seen["safe"]) == (2, False)


def test_a_cause_that_is_left_at_a_board_that_was_found_gives_1(off, faulty, monkeypatch):
    monkeypatch.setattr(off_module, "list_ports", lambda: [PortInfo(faulty, "found")])
    code, seen = off()
    assert (code, seen["safe"]) == (1, False)


def test_another_firmware_gives_2(off, monkeypatch):
    monkeypatch.setattr(board_module, "schema_hash", lambda: 0x12345678)
    code, seen = off(board())
    assert code == 2
    assert "message table" in seen["ports"][0]["result"]


def test_a_board_whose_clock_cannot_be_had_is_told_to_stop_all_the_same(monkeypatch):
    told = []
    stop = off_module.Link.stop
    monkeypatch.setattr(off_module.Link, "stop", lambda link, now_ns: told.append(link.name) or stop(link, now_ns))
    monkeypatch.setattr("haptics.link.sync.ClockExchanges.answer", lambda *_: None)
    (seen,) = make_safe([url := board()], timeout_s=0.3)
    assert told == [url]
    assert not seen.safe
    assert "still syncing" in seen.result


@pytest.mark.parametrize(
    ("url", "code"),
    [(lambda: board(), 0), (lambda: board(faults="drop=1"), 0), (lambda: "/dev/just_unplugged", 1)],
    ids=["a board", "no board", "gone"],
)
def test_without_names_whatever_is_found_counts(off, monkeypatch, url, code):
    monkeypatch.setattr(off_module, "list_ports", lambda: [PortInfo(url(), "found")])
    seen_code, seen = off()
    assert (seen_code, seen["safe"]) == (code, code == 0)


def test_a_port_lost_in_the_middle_is_not_safe(monkeypatch):
    def gone(self, name, *values, now_ns):
        raise LinkLost(self.name, "the port went away")

    monkeypatch.setattr(off_module.Link, "send", gone)
    (seen,) = make_safe([board()])
    assert not seen.safe


def test_a_found_port_that_speaks_in_whole_frames_is_a_board_whatever_else_it_says(off, monkeypatch):
    monkeypatch.setattr("haptics.link.session.LinkSession._on_identity", lambda *_: None)
    monkeypatch.setattr(off_module, "list_ports", lambda: [PortInfo(board(), "found")])
    code, seen = off()
    assert "no identity" in seen["ports"][0]["result"]
    assert (code, seen["safe"]) == (1, False)

"""``socket://`` wherever a port may be named: a board behind a real TCP socket is opened, armed, driven and recorded."""

from __future__ import annotations

import json
import sys

import pytest
from tcp_board import TcpBoard

import haptics
from haptics.cli import main as cli
from haptics.link.ports import read_waiting

pytestmark = pytest.mark.timeout(120)


class Flag:
    """A port whose ``in_waiting`` is a flag, as pyserial's ``socket://`` has it."""

    def __init__(self, data: bytes, endless: bool = False):
        self.data, self.endless, self.reads = bytearray(data), endless, 0

    @property
    def in_waiting(self) -> int:
        return int(bool(self.data) or self.endless)

    def read(self, size: int = 1, /) -> bytes:
        self.reads += 1
        taken = b"x" * size if self.endless else bytes(self.data[:size])
        del self.data[:size]
        return taken


class Counts(Flag):
    """A port that says how much waits."""

    @property
    def in_waiting(self) -> int:
        return len(self.data)


@pytest.mark.parametrize("port", [Flag, Counts])
@pytest.mark.parametrize("data", [b"", b"a", b"telemetry of some length", bytes(1000)])
def test_all_that_waits_is_read_whatever_in_waiting_means(port, data):
    assert read_waiting(port(data)) == data


def test_a_port_that_counts_is_read_once():
    port = Counts(bytes(500))
    read_waiting(port)
    assert port.reads == 1


def test_a_peer_that_never_pauses_does_not_keep_its_reader():
    assert 0 < len(read_waiting(Flag(b"", endless=True))) <= 4096


@pytest.fixture
def command(monkeypatch, capsys):
    def run(*words):
        monkeypatch.setattr(sys, "argv", ["haptics", *map(str, words)])
        code = 0
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code
        out, err = capsys.readouterr()
        return code, out, err

    return run


def test_a_glove_is_opened_armed_and_driven_over_tcp():
    with TcpBoard("brake") as board, haptics.open(brake=board.url) as glove:
        glove.arm()
        assert glove.state().armed == ("brake",) or glove.state().faults  # a machine too busy for the dead-man says so


@pytest.mark.slow
def test_a_board_behind_tcp_is_identified_monitored_and_made_safe(command):
    with TcpBoard() as board:
        code, out, _ = command("link", "identify", "--port", board.url, "--json")
        assert (code, json.loads(out)["board"]) == (0, "tactiles")
        code, out, _ = command("link", "monitor", "--port", board.url, "--for-s", 0.3, "--json")
        assert code == 0
        assert json.loads(out)["telemetry"] > 0
        code, out, _ = command("off", "--port", board.url, "--json")
        assert (code, json.loads(out)["safe"]) == (0, True)


@pytest.mark.slow
def test_a_run_over_tcp_gets_through_to_its_report(command, tmp_path):
    """What is felt is up to how busy this machine is; that the link comes up, and telemetry and replies do, is not."""
    with TcpBoard("brake") as board:
        out_file = tmp_path / "run.h5"
        code, out, err = command(
            "run", "playground", "--realtime", "--port-brake", board.url, "--out", out_file, "--json", "--level", "latch=event"
        )
        assert code in (0, 1), err
        report = json.loads(out)
        assert report["failed_share"].keys() == {"tactiles", "brake"}
        assert haptics.load_hand(out_file).frame_count > 0

"""Every fault of the line and of the board, on every firmware: what it did to outputs, and what a person is told.

Faults of frames are each played alone on one frame in five, both ways, under commands; the trial holds every edge of the outputs
against the commands, and falls silent at its end. Events are played once.
"""

from __future__ import annotations

import re
from typing import Any

import pytest
from cores import on_every_core

from haptics.errors import ClockUncertain, LinkError, LinkLost, NotABoard, PortBusy, WrongFirmware
from haptics.link import Board, Link, LinkSession, VirtualRunner, connect, open_port
from haptics.link.events import Rebooted
from haptics.link.line_faults import FrameFaults, LineFaults
from haptics.link.messages import Fault, State, Status
from haptics.link.runner import finish
from haptics.link_trial.stress import stress

MS = 1_000_000
DEAD_MAN_MS = 101  # 100 ms, and one to notice
ON_MS = 9
boards = pytest.mark.parametrize("board", ["tactiles", "brake"])


class Host:
    """A session in virtual time on a simulated port, and what its outputs do."""

    def __init__(self, core: str, board: str = "tactiles", keys: str = "", baud: int = 500_000):
        self.port: Any = open_port(f"sim://{board}?core={core}&clock=virtual&seed=3{keys}", baud)
        self.link = Link(self.port, LinkSession(Board[board.upper()], f"sim://{board}", baud=baud))
        self.runner = VirtualRunner([self.link])
        self.edges: list[tuple[int, int]] = []
        self.port.watch(lambda time_ns, kind, channel, drive: self.edges.append((time_ns, drive)))

    @property
    def now_ns(self) -> int:
        return self.runner.now_ns()

    def connect(self) -> None:
        connect(self.runner)

    def arm(self) -> None:
        finish(self.runner, self.link.arm(self.now_ns), port=self.link.name)
        self.run(15)
        self.edges.clear()

    def run(self, ms: float) -> None:
        self.runner.run_until(self.now_ns + round(ms * MS))

    def pulse(self, in_ms: float, channel: int = 2) -> Any:
        """One coil for 9 ms; or one brake."""
        tick = self.link.to_ticks(self.now_ns + round(in_ms * MS))
        if self.link.board == Board.BRAKE:
            return self.link.send("drive", tick, 1, 400, 200, ON_MS, now_ns=self.now_ns)
        return self.link.send("pulse", tick, 1 << channel, 1 << channel, [ON_MS * 20] * 15, now_ns=self.now_ns)

    @property
    def starts(self) -> int:
        return sum(drive != 0 for _, drive in self.edges)

    def line(self, direction: str, **faults: float) -> None:
        """What the line does to frames of one direction from now on."""
        cable = self.port._cable
        line = cable.to_board if direction == "out" else cable.to_host
        line._faults = FrameFaults(LineFaults(**faults), 1, direction)

    def off_within_dead_man(self) -> None:
        """The world goes on for a second without its host."""
        silent_ns = self.now_ns
        self.port.advance(silent_ns + DEAD_MAN_MS * MS + (5 * MS if self.link.board == Board.BRAKE else 0))
        assert self.port.energised() == []
        before = len(self.edges)
        self.port.advance(silent_ns + 1000 * MS)
        assert self.port.energised() == []
        assert all(drive == 0 for _, drive in self.edges[before:])


@pytest.fixture
def host():
    opened: list[Host] = []

    def make(*arguments: Any, **keys: Any) -> Host:
        opened.append(Host(*arguments, **keys))
        return opened[-1]

    yield make
    for one in opened:
        one.link.close()


# Frames.


@on_every_core
@boards
@pytest.mark.parametrize("kind", ["corrupt", "drop", "lose", "insert", "truncate", "duplicate", "delay"])
def test_a_fault_of_frames_has_nothing_played_twice_or_late(core, board, kind):
    report = stress(f"sim://{board}?core={core}", 60, f"{kind}=0.2", seed=4)
    assert report.violations == []
    assert report.acknowledged + report.refused + report.unknown_outcomes == 60
    assert report.acknowledged > 30
    if kind not in ("duplicate",):
        assert report.retried > 0


@on_every_core
@boards
def test_a_lost_reply_is_asked_for_again_and_the_command_played_once(host, core, board):
    h = host(core, board, "&faults=drop=0")
    h.connect()
    h.arm()
    h.line("in", drop=1.0)
    pending = h.pulse(45)
    h.run(10)
    h.line("in")
    h.run(20)
    assert pending.ok
    assert h.link.session.counters.retries >= 1
    h.run(60)
    assert h.starts == 1


@on_every_core
def test_a_command_whose_every_reply_is_lost_is_said_to_be_unknown(host, core):
    h = host(core, keys="&faults=drop=0")
    h.connect()
    h.arm()
    h.line("in", drop=1.0)
    pending = h.pulse(30)
    h.run(90)
    with pytest.raises(LinkError, match=r"whether it was carried out is unknown.*check cable and power"):
        pending.result()
    assert h.starts == 1


@on_every_core
def test_a_spike_beyond_a_commands_time_makes_it_late_and_not_played(host, core):
    h = host(core, keys="&faults=drop=0")
    h.connect()
    h.arm()
    h.line("out", delay=1.0, delay_ms=40)
    pending = h.pulse(20)
    h.run(1)
    h.line("out")
    h.run(80)
    assert pending.status == Status.LATE
    assert h.starts == 0


# Events.


@on_every_core
@boards
@pytest.mark.parametrize(
    ("fault", "said"), [("stall_s", "takes no bytes.*plug it in again"), ("unplug_s", "went away.*check the cable")]
)
def test_a_link_that_breaks_in_mid_write_is_lost_and_the_board_makes_itself_safe(host, core, board, fault, said):
    probe = host(core, board)
    probe.connect()
    probe.arm()
    probe.run(20)
    at_ns = probe.now_ns
    h = host(core, board, f"&faults={fault}={(at_ns + 200_000) / 1e9}")
    h.connect()
    h.arm()
    h.runner.run_until(at_ns)
    pending = h.pulse(20)  # 0.58 ms on the wire, a brake's 0.34
    h.run(40)
    with pytest.raises(LinkLost, match="whether it was carried out is unknown"):
        pending.result()
    assert isinstance(h.link.error, LinkLost)
    assert re.search(said, str(h.link.error))
    assert h.starts == 0  # half a frame is none
    h.off_within_dead_man()
    assert h.port.truth()["state"] == State.FAULT


@on_every_core
@boards
def test_a_brown_out_voids_everything_and_waits_for_a_hand(host, core, board):
    h = host(core, board)
    h.connect()
    h.arm()
    boot_id = h.link.identity.boot_id
    h.pulse(20)
    h.run(25)
    assert h.port.energised() != []
    waiting = h.pulse(60)
    h.run(5)
    assert waiting.ok
    h.port.set_load(0, brown_out=1)
    h.run(8)
    assert h.port.energised() == []
    h.run(1500)
    events = h.link.events()
    assert any(isinstance(event, Rebooted) for event in events)
    assert h.link.identity.boot_id != boot_id
    assert not h.link.armed
    assert h.starts == 1  # what waited was forgotten
    refused = finish_or_error(h, h.link.arm(h.now_ns))
    assert refused.status == "interlock"
    assert finish(h.runner, h.link.send("disarm", now_ns=h.now_ns)).detail == 0
    h.arm()
    h.pulse(20)
    h.run(60)
    assert h.starts == 1


def finish_or_error(h: Host, pending: Any) -> Any:
    with pytest.raises(LinkError) as refused:
        finish(h.runner, pending, port=h.link.name)
    return refused.value


@on_every_core
@boards
def test_nothing_is_scheduled_by_a_clock_that_was_not_looked_at_for_long(host, core, board):
    h = host(core, board)
    h.connect()
    h.arm()
    tick = h.link.to_ticks(h.now_ns)
    h.port.advance(h.now_ns + 3000 * MS)  # the host sleeps
    h.runner.clock.advance_to(h.port.now_ns)
    with pytest.raises(ClockUncertain, match="clock"):
        h.link.to_ticks(h.now_ns + 20 * MS)
    values = (tick, 1, 1, [20] * 15) if board == "tactiles" else (tick, 1, 100, 200, 5)
    pending = h.link.send("pulse" if board == "tactiles" else "drive", *values, now_ns=h.now_ns)
    with pytest.raises(ClockUncertain):
        pending.result()
    h.run(700)
    assert h.starts == 0
    assert h.port.board.faults == 1 << Fault.DEAD_MAN
    assert not h.link.armed
    h.link.to_ticks(h.now_ns + 20 * MS)  # measured again


@on_every_core
@boards
def test_firmware_of_another_table_is_identified_and_nothing_more(host, core, board, monkeypatch):
    monkeypatch.setattr("haptics.link.handshake._SCHEMA_HASH", 0x12345678)
    h = host(core, board)
    with pytest.raises(WrongFirmware, match=r"message table is .* this package's 12345678.*make firmware-flash"):
        h.connect()
    with pytest.raises(LinkError):
        h.link.arm(h.now_ns).result()
    h.port.advance(h.now_ns + 500 * MS)
    assert h.port.truth()["state"] == State.DISARMED
    assert h.edges == []


@on_every_core
@boards
def test_a_port_that_is_open_already_says_so(host, core, board):
    h = host(core, board, "&world=twice")
    with pytest.raises(PortBusy, match=r"already open in this program.*close it there first"):
        open_port(f"sim://{board}?core={core}&clock=virtual&seed=3&world=twice")
    h.connect()  # and the first is none the worse


@on_every_core
@boards
def test_a_wrong_baud_is_said_to_be_one_after_so_many_tries(host, core, board):
    h = host(core, board, baud=115_200)
    with pytest.raises(NotABoard, match=r"no identity in 40 tries.*baud rate"):
        h.connect()
    assert h.port.truth()["state"] == State.DISARMED


@on_every_core
@boards
@pytest.mark.parametrize("keys", ["&faults=dtr_reset=1", "&faults=garbage=200", "&faults=dtr_reset=1,garbage=200"])
def test_a_board_that_resets_or_babbles_when_opened_is_found(host, core, board, keys):
    h = host(core, board, keys)
    h.connect()
    assert h.now_ns >= (1000 * MS if "dtr" in keys else 0)
    assert (h.link.session.counters.bad_frames > 0) == ("garbage" in keys)
    assert not h.link.armed
    h.arm()
    h.pulse(20)
    h.run(60)
    assert h.starts == 1


@on_every_core
@boards
def test_opening_again_resets_a_board_that_was_driving(host, core, board):
    url = f"sim://{board}?core={core}&clock=virtual&seed=3&world=again&faults=dtr_reset=1"
    stays: Any = open_port(f"sim://{'brake' if board == 'tactiles' else 'tactiles'}?clock=virtual&world=again")
    h = host(core, board, "&world=again&faults=dtr_reset=1")
    h.connect()
    h.arm()
    boot_id = h.link.identity.boot_id
    h.pulse(20)
    h.run(25)
    assert h.port.energised() != []
    h.link.close()
    port = open_port(url)
    h.link.reopen(port, h.now_ns)
    h.port = port
    h.run(6)
    assert h.port.energised() == []
    assert h.runner.wait_for(lambda: h.link.ready, 3.0)
    assert h.link.identity.boot_id != boot_id
    assert not h.link.armed
    stays.close()

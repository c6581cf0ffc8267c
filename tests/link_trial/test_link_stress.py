"""``haptics link stress``: many commands over a bad line, on every firmware; and that it would notice what it is for."""

from __future__ import annotations

import json
from bisect import insort

import pytest
from cores import on_every_core
from typer.testing import CliRunner

from firmware_models.boards.tactiles_board import Pulse, TactilesBoard
from firmware_models.protocol_sim import Serial
from haptics.cli.main import app
from haptics.errors import InputError
from haptics.link.connection import Link
from haptics.link.messages import State
from haptics.link_trial import stress as stress_module
from haptics.link_trial.effects import Effects
from haptics.link_trial.report import StressReport, quantiles_us
from haptics.link_trial.stress import stress
from haptics.link_trial.workload import Command, Output

MS = 1_000_000
BAD_LINE = "corrupt=0.01,drop=0.01,delay=0.005"


def check(report: StressReport, frames: int) -> None:
    """What was promised: nothing twice, nothing late, most acknowledged, and an outcome for each."""
    assert report.violations == []
    assert report.duplicate_effects == report.played_late == report.lost == 0
    assert report.sent == frames
    assert report.acknowledged + report.refused + report.unknown_outcomes == frames
    assert report.acknowledged >= 0.95 * frames
    assert report.retried > 0.02 * frames  # the line was bad indeed: 1 % corrupt and 1 % lost each way


@pytest.mark.slow
@on_every_core
def test_pulses_over_a_bad_line_are_played_once_and_in_time(core):
    frames = 300 if core == "avr" else 1500
    check(stress(f"sim://tactiles?core={core}", frames, BAD_LINE), frames)


@pytest.mark.slow
@on_every_core
def test_drives_and_bursts_over_a_bad_line_are_played_once_and_in_time(core):
    check(stress(f"sim://brake?core={core}", 200, BAD_LINE), 200)


@pytest.mark.soak
@pytest.mark.timeout(3600)
@on_every_core
def test_a_hundred_thousand_pulses_over_a_bad_line(core):
    frames = 5_000 if core == "avr" else 100_000
    check(stress(f"sim://tactiles?core={core}", frames, BAD_LINE), frames)


@pytest.mark.soak
@pytest.mark.timeout(3600)
@on_every_core
def test_many_drives_over_a_bad_line(core):
    frames = 1_000 if core == "avr" else 10_000
    check(stress(f"sim://brake?core={core}", frames, BAD_LINE), frames)


@pytest.mark.slow
@on_every_core
def test_in_silence_outputs_are_off_within_the_dead_man_time(core):
    coils, brakes = (stress(f"sim://{board}?core={core}", 5) for board in ("tactiles", "brake"))
    assert 50.0 < coils.max_energised_after_silence_ms <= 101.0
    assert 50.0 < brakes.max_energised_after_silence_ms <= 106.0


def test_on_a_sound_line_every_command_is_acknowledged_at_once():
    report = stress("sim://tactiles", 200)
    assert (report.acknowledged, report.retried, report.edge_error_us.max) == (200, 0, 0.0)
    assert report.pulses > 200


def test_the_same_seed_gives_the_same_report_and_another_one_another():
    first, again, other = (stress("sim://tactiles", 100, "drop=0.05", seed=seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_a_very_bad_line_still_plays_nothing_twice():
    report = stress("sim://tactiles", 300, "corrupt=0.1,drop=0.1,lose=0.05,insert=0.05,truncate=0.05,duplicate=0.2,delay=0.02")
    assert report.violations == []
    assert report.unknown_outcomes > 0
    assert report.sent == report.acknowledged + report.refused + report.unknown_outcomes == 300


def test_a_board_that_disarms_in_silences_is_armed_again_and_counted():
    report = stress("sim://tactiles", 600, "delay=0.02,delay_ms=130")
    assert report.disarmed > 0
    assert report.violations == []
    assert report.sent == 600


@pytest.mark.parametrize("event", ["unplug_s=1,delay=0.3", "stall_s=1,delay=0.3"])
def test_a_link_that_is_meant_to_end_ends_with_every_outcome_accounted_for(event):
    report = stress("sim://tactiles", 2000, event)
    assert report.ended is not None
    assert report.sent == report.acknowledged + report.refused + report.unknown_outcomes < 2000
    assert report.unknown_outcomes > 0
    assert report.violations == []


# It notices.


def test_a_board_that_forgets_its_replies_is_caught(monkeypatch):
    monkeypatch.setattr("firmware_models.boards.board.REMEMBERED_REPLIES", 0)
    report = stress("sim://tactiles", 300, "drop=0.1")
    assert any("though the board had refused" in violation for violation in report.violations)


def test_a_board_that_plays_twice_is_caught(monkeypatch):
    def twice(queue: list[Pulse], pulse: Pulse) -> None:
        insort(queue, pulse)
        insort(queue, pulse._replace(start_ns=pulse.start_ns + 40 * MS, end_ns=pulse.end_ns + 40 * MS))

    monkeypatch.setattr("firmware_models.boards.tactiles_board.insort", twice)
    report = stress("sim://tactiles", 30)
    assert report.duplicate_effects > 20
    assert any("twice" in violation for violation in report.violations)


def test_a_board_that_plays_late_commands_is_caught(monkeypatch):
    honest = TactilesBoard._due
    monkeypatch.setattr(TactilesBoard, "_due", lambda self, tick: honest(self, (tick + 2000) % 2**32))
    report = stress("sim://tactiles", 50)
    assert report.played_late > 0
    assert report.violations != []


def test_a_board_that_loses_commands_is_caught(monkeypatch):
    monkeypatch.setattr("firmware_models.boards.tactiles_board.insort", lambda queue, pulse: None)
    report = stress("sim://tactiles", 50)
    assert report.lost == 50


def test_a_board_without_dead_man_is_caught(monkeypatch):
    monkeypatch.setattr(TactilesBoard, "_dead_man_ns", lambda self: 1 << 62)
    report = stress("sim://tactiles", 5)
    assert report.max_energised_after_silence_ms > 200
    assert any("silent" in violation for violation in report.violations)


def test_a_board_that_cuts_pulses_short_is_caught(monkeypatch):
    monkeypatch.setattr("firmware_models.boards.tactiles_board._TICKS_PER_UNIT", 50)
    report = stress("sim://tactiles", 50)
    assert report.played_too_short > 30
    assert any("too soon" in violation for violation in report.violations)


def test_a_board_that_comes_back_by_itself_is_caught_while_it_is_down(monkeypatch):
    """A dead-man that forgets one pulse of its queue: it is played 40 ms after the board went down."""
    honest = TactilesBoard._outputs_off

    def leaky(board: TactilesBoard) -> None:
        honest(board)
        if board.state != State.DISARMED:
            begin, end = board.now_ns + 40 * MS, board.now_ns + 42 * MS
            board._queue.append(Pulse(begin, end, 0, 0, 7, 1))

    monkeypatch.setattr(TactilesBoard, "_outputs_off", leaky)
    report = stress("sim://tactiles", 400, "delay=0.02,delay_ms=130")
    assert report.disarmed > 0
    assert len(report.disarmed_because) >= report.disarmed
    assert report.violations != []


def test_a_board_that_is_never_on_in_silence_is_not_taken_for_a_safe_one(monkeypatch):
    monkeypatch.setattr(Serial, "energised", lambda self: [])
    report = stress("sim://tactiles", 5)
    assert report.max_energised_after_silence_ms is None
    assert any("could not be judged" in violation for violation in report.violations)


def test_a_run_that_is_broken_off_leaves_no_board_to_its_dead_man(monkeypatch):
    """The board is off when its port is closed, in the middle of commands that would go on."""
    send, close, left = stress_module._Trial._send, Link.close, []

    def broken_off(self, command):
        send(self, command)
        if self._observed.energised():
            raise KeyboardInterrupt

    def closed(self):
        left.append((self.port.energised(), self.port._cable.board.armed))
        close(self)

    monkeypatch.setattr(stress_module._Trial, "_send", broken_off)
    monkeypatch.setattr(Link, "close", closed)
    with pytest.raises(KeyboardInterrupt):
        stress("sim://tactiles", 400)
    assert left == [([], False)]


def pulse(start_ns: int, channel: int = 3, on_ns: int = 5 * MS) -> Command:
    return Command("pulse", start_ns, (), (Output("coil", channel, 1, on_ns),))


@pytest.mark.parametrize(
    ("edges", "counts"),
    [
        ([(10.0, 1), (15.0, 0)], {}),
        ([], {}),
        ([(10.099, 1), (15.099, 0)], {}),
        ([(10.0, 1), (15.0, 0), (10.09, 1)], {"duplicates": 1}),
        ([(10.0, 1), (15.0, 0), (40.0, 1)], {"duplicates": 1}),
        ([(10.101, 1), (15.0, 0)], {"late": 1}),
        ([(9.89, 1), (15.0, 0)], {"early": 1}),
        ([(10.0, -1), (15.0, 0)], {"reversed": 1}),
        ([(10.0, 1), (15.199, 0)], {}),
        ([(10.0, 1), (15.201, 0)], {"too_long": 1}),
        ([(10.0, 1), (14.801, 0)], {}),
        ([(10.0, 1), (14.799, 0)], {"cut_ns": [14_799_000]}),
    ],
)
def test_edges_are_told_apart(edges, counts):
    effects = Effects(listening=True)
    effects.expect(pulse(10 * MS), 10 * MS)
    for time_ms, drive in edges:
        effects.switched(round(time_ms * MS), "coil", 3, drive)
    names = ("duplicates", "late", "early", "uncommanded", "reversed", "too_long", "cut_ns")
    assert {name: getattr(effects, name) for name in names if getattr(effects, name)} == counts


def test_an_output_that_nobody_commanded_is_told():
    effects = Effects(listening=True)
    effects.expect(pulse(10 * MS), 10 * MS)
    effects.switched(10 * MS, "coil", 4, 1)
    assert effects.uncommanded == 1


def test_quantiles_are_those_of_magnitudes():
    assert quantiles_us([]) is None
    found = quantiles_us([-1000 * n for n in range(1, 101)])
    assert (found.p50, found.p99, found.max) == (50.0, 99.0, 100.0)


# The command.


def test_the_command_prints_one_object_with_the_promised_keys():
    done = CliRunner().invoke(
        app, ["link", "stress", "--port", "sim://tactiles", "--frames", "30", "--faults", "drop=0.05", "--json"]
    )
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["sent"] == 30
    assert report["acknowledged"] + report["refused"] + report["unknown_outcomes"] == 30
    assert set(report["edge_error_us"]) == {"p50", "p99", "max"}
    assert {"retried", "lost", "late", "duplicate_effects", "max_energised_after_silence_ms", "violations"} <= set(report)


@pytest.mark.slow
def test_the_command_prints_a_table_and_fails_where_a_promise_is_broken(monkeypatch):
    assert "duplicate_effects" in CliRunner().invoke(app, ["link", "stress", "--port", "sim://tactiles", "--frames", "5"]).stdout
    monkeypatch.setattr("firmware_models.boards.tactiles_board.insort", lambda queue, pulse: None)
    done = CliRunner().invoke(app, ["link", "stress", "--port", "sim://tactiles", "--frames", "5"])
    assert done.exit_code == 1
    assert "never played" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("sim://tactiles", 0, ""), "frames = 0"),
        (("sim://tactiles", 5, "drop=2"), "drop = 2"),
        (("sim://tactiles?faults=drop=0", 5, "drop=0.1"), "the port's URL names faults too"),
        (("sim://thermometer", 5, ""), "thermometer"),
    ],
)
def test_what_cannot_be_used_is_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        stress(*arguments)

"""A brake controller in its own process, the host killed while it brakes: volts fall by the board's own hand, and stay down.

Judged by the board's own time stamps, so that a busy machine makes these tests slower and never wrong.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pty_board import COMMAND, PATIENCE_S, PtyBoard, wait_until

import haptics as product
from haptics.errors import CommandRefused
from haptics.recording import load, read_journal

pytestmark = [
    pytest.mark.slow,
    pytest.mark.pty,
    pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals exist on POSIX systems only"),
    pytest.mark.timeout(180),
]

DEAD_MAN_NS = 100_000_000
DISCHARGE_NS = 5_000_000  # what the controller allows itself before it calls its bridge stuck
TRIES = 5
"""A machine that is busy for longer than the dead-man makes a board safe before its host is killed; that is no trial."""
BRAKING = """
import sys, time
import haptics

with haptics.open(brake=sys.argv[1]) as glove:
    glove.arm()
    while not glove.state().faults:
        glove.brake("index", volts=1000.0, ttl_s=1.0)  # outlives the dead-man by far
        time.sleep(0.02)
"""


def driving(line: dict[str, Any]) -> bool:
    """Volts that a host asked for; those of the self test are none."""
    return bool(line["energised"]) and line["state"] == "DRIVING"


class Board(PtyBoard):
    """A brake controller behind a pseudo-terminal, and the trace of what it did."""

    def __init__(self, folder: Path):
        super().__init__(folder, "brake")

    def kill_braking_host(self, command: list[str], delay_s: float) -> list[dict[str, Any]]:
        """Start a host, kill it ``delay_s`` after its first volts; returns the trace from its start until the board is off.

        Empty if no volts were on by then.
        """
        begin = len(self.lines())
        host = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=self.folder)
        try:
            wait_until(lambda: host.poll() is not None or any(driving(line) for line in self.lines(begin)))
            driven_ns = next((line["time_ns"] for line in self.lines(begin) if driving(line)), 0)
            wait_until(lambda: time.monotonic_ns() >= driven_ns + delay_s * 1e9)
            last = (self.lines(begin) or [{"energised": [], "state": ""}])[-1]
        finally:
            host.kill()
            host.wait()
        wait_until(lambda: self.process.poll() is not None or (self.lines()[-1]["state"] in ("FAULT", "DISARMED")))
        wait_until(lambda: self.process.poll() is not None or not self.lines()[-1]["energised"])
        return self.lines(begin) if driving(last) else []


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    made = Board(tmp_path)
    yield made
    made.end()
    assert made.process.returncode == 0


def fell_in_time(lines: list[dict[str, Any]]) -> None:
    """Off within dead-man and discharge of the host's last byte, by the board's own time."""
    fault = next(line for line in lines if line["state"] == "FAULT")
    assert fault["faults"] == 1  # the dead-man and nothing else
    last_on = max(number for number, line in enumerate(lines) if line["energised"])
    off = lines[last_on + 1]
    assert off["time_ns"] - fault["host_byte_ns"] <= DEAD_MAN_NS + DISCHARGE_NS
    assert not any(line["energised"] for line in lines[last_on + 1 :])


def kill_until_it_counts(haptics, board: Board, command: list[str], rng: random.Random, within_s: float) -> list[dict[str, Any]]:
    for _ in range(TRIES):
        lines = board.kill_braking_host(command, rng.uniform(0.0, within_s))
        if lines:
            return lines
        assert haptics("off", "--port", board.port).code == 0
        for left in board.folder.glob("*.journal"):  # which no run overwrites
            left.unlink()
    raise AssertionError(f"no volts were on at any of {TRIES} kills; is the machine that busy?")


def kill_braking_scripts(haptics, board: Board, kills: int, seed: int) -> None:
    rng = random.Random(seed)
    command = [sys.executable, "-c", BRAKING, str(board.port)]
    for _ in range(kills):
        lines = kill_until_it_counts(haptics, board, command, rng, 0.3)
        fell_in_time(lines)
        assert lines[-1]["state"] == "FAULT"

        number = len(board.lines())
        with product.open(brake=str(board.port)) as glove, pytest.raises(CommandRefused, match=r"dead_man.*haptics off"):
            glove.arm()  # a host that comes back finds the fault latched
        done = haptics("off", "--port", board.port, "--json")
        assert (done.code, done.json["ports"][0]["safe"]) == (0, True)
        wait_until(lambda: board.lines()[-1]["state"] == "DISARMED")
        assert board.lines()[-1]["faults"] == 0
        assert not any(line["energised"] for line in board.lines(number))


def test_volts_fall_when_a_braking_script_is_killed_and_only_a_person_brings_them_back(haptics, board):
    kill_braking_scripts(haptics, board, kills=2, seed=1)


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_a_hundred_killed_braking_scripts(haptics, board):
    kill_braking_scripts(haptics, board, kills=100, seed=2)


def test_volts_fall_when_a_run_is_killed_in_a_grasp_and_its_recording_is_recovered(haptics, board, tmp_path):
    rng = random.Random(3)
    out = tmp_path / "run.h5"
    journal = out.with_suffix(".journal")
    run = [*COMMAND, "run", "playground", "--realtime", "--port-brake", str(board.port), "--out", str(out), "--force"]
    fell_in_time(kill_until_it_counts(haptics, board, run, rng, 0.1))

    acknowledged = {name: rows.tobytes() for name, rows in rows_of(journal).items()}
    done = haptics("recording", "recover", journal, "--force", "--json")
    assert done.code == 0, done.err
    recovered = load(out)
    assert not recovered.complete
    assert {name: recovered.stream(name).tobytes() for name in recovered.streams} == acknowledged
    assert len(recovered.stream("brake_telemetry")) > 0


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_run_that_is_asked_to_end_in_a_grasp_makes_the_board_safe_itself(haptics, board, tmp_path, name):
    out = tmp_path / "run.h5"
    command = [*COMMAND, "run", "playground", "--realtime", "--port-brake", str(board.port), "--out", str(out), "--force"]
    for _ in range(TRIES):
        begin = len(board.lines())
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as run:
            wait_until(lambda run=run, begin=begin: run.poll() is not None or any(map(driving, board.lines(begin))))
            if run.poll() is None:
                run.send_signal(getattr(signal, name))
            words = run.communicate(timeout=PATIENCE_S)[1]
        assert "Traceback" not in words, words
        seen = board.lines(begin)
        if run.returncode == 128 + getattr(signal, name) and not any(line["state"] == "FAULT" for line in seen):
            break
        assert haptics("off", "--port", board.port).code == 0  # the machine was too busy for the run; that is no trial
    else:
        raise AssertionError(f"no run was asked to end while it drove the board: {words}")
    assert any(driving(line) for line in seen)
    assert (seen[-1]["state"], seen[-1]["energised"], seen[-1]["faults"]) == ("DISARMED", [], 0)
    assert f"interrupted by {name}" in words
    assert f"the recording {out} is incomplete" in words
    assert not load(out).complete


def rows_of(journal: Path) -> dict[str, Any]:
    contents = read_journal(journal)
    return {name: contents.stream(name) for name in contents.streams}

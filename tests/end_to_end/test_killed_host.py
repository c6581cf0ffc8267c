"""A glove's host is killed, stopped, or loses a board: what is on falls by the boards' own hand, and the next host finds out.

Boards are in processes of their own, behind pseudo-terminals, and are judged by the trace that they keep on their own clock. A
machine that is busy for longer than a dead-man makes boards safe before the host is killed; that is no trial, and tried again.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pty_board import PtyBoard, wait_until

import haptics
from haptics.errors import CommandRefused

pytestmark = [
    pytest.mark.slow,
    pytest.mark.pty,
    pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals exist on POSIX systems only"),
    pytest.mark.timeout(240),
]

SAFE_NS = 150_000_000
"""Everything is off so long after the host was heard last."""
TRIES = 5
OUT = ("thumb_tip", "index_tip", "middle_tip")
OUT_CHANNELS = [haptics.SITES.index(site) for site in OUT]
PULSED, PULSES = "palm_index", 20
HOLDING = """
import sys, time
import haptics

with haptics.open(tactiles=sys.argv[1], brake=sys.argv[2]) as glove:
    glove.arm()
    for site in sys.argv[3].split(","):
        glove.contact(site)
    while not (faults := glove.state().faults):
        glove.brake("index", volts=1000.0, ttl_s=60.0)
        glove.pulse(sys.argv[4])
        time.sleep(0.03)
    sys.exit("; ".join(faults))
"""
Boards = dict[str, PtyBoard]


@pytest.fixture
def boards(tmp_path: Path) -> Iterator[Boards]:
    made = {kind: PtyBoard(tmp_path, kind) for kind in ("tactiles", "brake")}
    yield made
    for board in made.values():
        board.end()


def holds(boards: Boards, began: int = 0) -> bool:
    """Pins are out, a brake is on, and a coil has had pulses enough to be warm."""
    array, brake = boards["tactiles"].last, boards["brake"].last
    pulses = [line for line in boards["tactiles"].lines(began) if haptics.SITES.index(PULSED) in line["energised"]]
    if len(pulses) < PULSES:
        return False
    out = set(OUT_CHANNELS) <= set(array["pins_out"]) and array["state"] in ("ARMED", "DRIVING")
    return out and brake["state"] == "DRIVING" and 0 in brake["energised"]


def opened(boards: Boards) -> haptics.Glove:
    return haptics.open(tactiles=str(boards["tactiles"].port), brake=str(boards["brake"].port))


def end_a_holding_host(boards: Boards, how: str) -> dict[str, list[dict[str, Any]]]:
    """Each board's trace from a host that held on, until the board was safe."""
    for _ in range(TRIES):
        began = {kind: len(board.lines()) for kind, board in boards.items()}
        ports = [str(board.port) for board in boards.values()]
        host = subprocess.Popen([sys.executable, "-c", HOLDING, *ports, ",".join(OUT), PULSED], stderr=subprocess.DEVNULL)
        try:
            wait_until(lambda host=host, began=began: host.poll() is not None or holds(boards, began["tactiles"]))
            held = host.poll() is None
            if held:
                host.send_signal(getattr(signal, how))
                held = holds(boards, began["tactiles"])
                wait_until(lambda: all(board.last["state"] == "FAULT" for board in boards.values()))
                wait_until(lambda: not any(board.last["energised"] for board in boards.values()))
        finally:
            host.kill()
            host.wait()
        if held:
            return {kind: board.lines(began[kind]) for kind, board in boards.items()}
        with opened(boards) as glove:
            glove.clear()
    raise AssertionError(f"no host held on at any of {TRIES} tries; is the machine that busy?")


def is_safe_in_time(lines: list[dict[str, Any]]) -> None:
    fault = next(line for line in lines if line["state"] == "FAULT")
    assert fault["faults"] == 1  # the dead-man and nothing else
    on = [number for number, line in enumerate(lines) if line["energised"]]
    assert on
    off = lines[on[-1] + 1]
    assert off["time_ns"] - fault["host_byte_ns"] <= SAFE_NS


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_all_is_off_in_time_and_the_next_host_finds_pins_heat_and_fault(boards, how):
    traces = end_a_holding_host(boards, how)
    for lines in traces.values():
        is_safe_in_time(lines)
    assert set(OUT_CHANNELS) <= set(boards["tactiles"].last["pins_out"])  # a pin needs energy to go back

    with opened(boards) as glove:
        wait_until(lambda: len(glove.state().latched) == 2)
        notes = glove.state().notes
        for kind in boards:
            assert any(note.startswith(f"{kind}: found with a latched fault: dead_man") for note in notes), notes
        with pytest.raises(CommandRefused, match="dead_man"):
            glove.arm()  # nobody has looked yet
        assert glove.clear() == {}
        quiet = {kind: len(board.lines()) for kind, board in boards.items()}
        glove.arm()
        assert boards["tactiles"].last["pins_out"] == []
        moved = {channel for line in boards["tactiles"].lines(quiet["tactiles"]) for channel in line["energised"]}
        assert set(OUT_CHANNELS) <= moved
        state = glove.state()
        assert state.pins_out == ()
        assert set(state.armed) == set(boards)
        assert state.rise_k[PULSED] > 2 * state.rise_k["palm_little"] > 0.0  # pulses of the killed host; withdrawn and no more


def test_a_stopped_host_that_goes_on_drives_nothing(boards):
    for _ in range(TRIES):
        ports = [str(board.port) for board in boards.values()]
        host = subprocess.Popen([sys.executable, "-c", HOLDING, *ports, ",".join(OUT), PULSED], stderr=subprocess.PIPE, text=True)
        wait_until(lambda host=host: host.poll() is not None or holds(boards))
        if host.poll() is None:
            break
        host.communicate()
    host.send_signal(signal.SIGSTOP)
    wait_until(lambda: all(board.last["state"] == "FAULT" and not board.last["energised"] for board in boards.values()))
    safe = {kind: len(board.lines()) for kind, board in boards.items()}
    stopped_ns = max(board.last["time_ns"] for board in boards.values())
    wait_until(lambda: time.monotonic_ns() > stopped_ns + SAFE_NS)  # by the host's own account, too, it is too late then
    host.send_signal(signal.SIGCONT)
    words = host.communicate(timeout=60)[1]
    assert re.search(r"did not serve the glove|host silent for", words), words
    for kind, board in boards.items():
        assert not any(line["energised"] for line in board.lines(safe[kind]))


def test_a_board_that_was_unplugged_is_found_again_disarmed_and_can_be_armed(boards):
    array = boards["tactiles"]
    with opened(boards) as glove:
        glove.arm()
        glove.contact("index_tip")
        array.pull()
        wait_until(lambda: any(fault.startswith("tactiles") for fault in glove.state().faults))
        assert glove.state().armed in (("brake",), ())
        array.start()
        again = "tactiles: the board is there again; it is disarmed until armed by hand"
        wait_until(lambda: again in glove.state().notes)
        assert "tactiles" not in glove.state().armed
        assert not any(line["energised"] for line in array.lines())
        for _ in range(TRIES):
            glove.off()
            glove.arm()
            glove.contact("index_tip")
            wait_until(lambda: len(glove.state().armed) < 2 or array.last["pins_out"])
            if array.last["pins_out"] == [haptics.SITES.index("index_tip")]:
                break
        else:
            raise AssertionError("no pin came out after arming")
    assert array.last["pins_out"] == []

"""However a command is asked to end, the glove goes off first, the recording is kept, and both are said."""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from haptics.ends import orderly
from haptics.errors import CommandRefused
from haptics.recording import load
from rigs.tolerance.study import process_pool

pytestmark = [pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them"), pytest.mark.slow]

CHILD = Path(__file__).with_name("ended_command.py")
RUN = ("run", "playground", "--json", "--out")
RIG = ("characterize", "pull", "--seed", "3", "--json", "--out")
ASKED = {"SIGINT": 130, "SIGTERM": 143, "SIGHUP": 129}


class Command:
    """A command under way that says where it is."""

    def __init__(self, process: subprocess.Popen[str]):
        self.process = process
        self.said: list[str] = []

    def until(self, word: str) -> None:
        """Wait until it says the word."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said.append(line.rstrip())
            if self.said[-1] == word:
                return
        raise AssertionError(f"it ended before it was {word!r}: {self.said} {self.process.communicate()[1]}")

    def go_on(self) -> None:
        """Let it."""
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def ended(self) -> str:
        """What it says on standard error until it ends; never a traceback."""
        rest, words = self.process.communicate(timeout=240)
        self.said += rest.splitlines()
        assert "Traceback" not in words, words
        assert "is off" in self.said
        assert not {"PINS ARE OUT", "VOLTS ARE UP", "IT IS ARMED"} & set(self.said), self.said
        return words


@contextmanager
def under_way(*words: object, moment: str = "armed") -> Iterator[Command]:
    command = [sys.executable, str(CHILD), *map(str, words), "--", moment]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield Command(process)
        finally:
            process.kill()


@pytest.mark.parametrize("name", ASKED)
@pytest.mark.parametrize("command", [RUN, RIG], ids=["run", "characterize"])
def test_whoever_asks_the_glove_goes_off_and_what_was_recorded_is_named(tmp_path, command, name):
    out = tmp_path / ("r.h5" if command is RUN else "bench")
    with under_way(*command, out) as host:
        host.until("armed")
        host.process.send_signal(getattr(signal, name))
        words = host.ended()
    record = out if command is RUN else out / "pull.h5"
    assert host.process.returncode == ASKED[name]
    assert f"interrupted by {name}" in words
    assert f"the recording {record} is incomplete" in words
    recording = load(record)
    assert not recording.complete
    assert len(recording.stream("wire")) > 100
    assert not list(tmp_path.rglob("*.journal"))


@pytest.mark.parametrize("command", [RUN, RIG], ids=["run", "characterize"])
def test_pressing_it_again_and_again_breaks_nothing_off(tmp_path, command):
    out = tmp_path / ("r.h5" if command is RUN else "bench")
    with under_way(*command, out, moment="off") as host:
        host.until("armed")
        host.process.send_signal(signal.SIGINT)
        host.until("going off")
        for asked in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
            host.process.send_signal(asked)
        host.go_on()
        words = host.ended()
    assert host.process.returncode == 130  # as it was asked first
    assert "is incomplete" in words
    assert not load(out if command is RUN else out / "pull.h5").complete
    assert not list(tmp_path.rglob("*.journal"))


def test_an_end_that_is_asked_for_while_a_run_goes_off_by_itself_lets_it(tmp_path):
    with under_way(*RUN, tmp_path / "r.h5", moment="off") as host:
        host.until("armed")
        host.go_on()
        host.until("going off")
        host.process.send_signal(signal.SIGTERM)
        host.until("going off")  # broken off once, so it is begun anew
        host.go_on()
        words = host.ended()
    assert host.process.returncode == 143
    assert f"the recording {tmp_path / 'r.h5'} is" in words


def test_rigs_side_by_side_end_with_who_started_them(tmp_path):
    command = [sys.executable, "-m", "haptics.cli.main", "characterize", "thermal", "--devices", "2", "--out", str(tmp_path)]
    journals = [tmp_path / f"thermal-{k}.journal" for k in range(2)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as host:
        deadline = time.monotonic() + 60
        while not all(journal.exists() and journal.stat().st_size > 20_000 for journal in journals):
            assert host.poll() is None, host.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.002)
        host.send_signal(signal.SIGTERM)
        words = host.communicate(timeout=60)[1]
    assert host.returncode == 143
    assert "Traceback" not in words
    for k in range(2):
        out = tmp_path / f"thermal-{k}.h5"  # a rig that was done when it was asked is whole
        assert load(out).complete or f"the recording {out} is incomplete" in words
    assert not list(tmp_path.glob("*.journal"))


@pytest.mark.timeout(60)
def test_who_is_asked_to_end_waits_for_no_worker():
    def asked() -> None:
        with process_pool(1) as pool:
            pool.submit(time.sleep, 3600)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        asked()


def test_errors_of_rigs_in_other_processes_come_home_whole():
    error = CommandRefused("sim://brake", "not now", "arm", "interlock", "close the lid")
    error.add_note("the recording r.h5 is incomplete")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


SCRIPT = """
import os, sys
from haptics.ends import orderly, unbroken
with orderly():
    try:
        os.write(1, b"open\\n")
        sys.stdin.readline()
    finally:
        with unbroken:
            os.write(1, b"closed\\n")
os.write(1, b"went on\\n")
"""


@pytest.mark.parametrize("name", ASKED)
def test_a_script_ends_by_the_signal_that_it_was_sent_after_it_is_off(name):
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", SCRIPT], stdin=pipe, stdout=pipe, stderr=pipe, text=True) as script:
        host = Command(script)
        host.until("open")
        script.send_signal(getattr(signal, name))
        rest, words = script.communicate(timeout=60)
    assert rest == "closed\n"
    assert script.returncode == -getattr(signal, name)
    assert name in words


def test_a_signal_that_is_ignored_stays_ignored_and_a_handler_of_ones_own_is_kept():
    def own(number: int, frame: object) -> None: ...

    before = {number: signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGTERM, signal.SIGINT)}
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, own)
        with orderly():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) is own
            assert signal.getsignal(signal.SIGINT) is not before[signal.SIGINT]
        assert signal.getsignal(signal.SIGINT) is before[signal.SIGINT]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

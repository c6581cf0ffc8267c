"""The main job on each firmware: the whole of it, and the C core alone on the very calls that the job made."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from firmware_models.cores import compiled_board
from firmware_models.cores.compiled_board import CompiledBoard
from firmware_models.cores.toolchain import image, lockstep_library
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene
from haptics.time import NS_PER_S

pytestmark = pytest.mark.bench

SCENE, HAND = "playground", "synthetic"


def run(core: str, out: Path) -> float:
    """CPU seconds of the main job."""
    ports = {f"port_{board}": f"sim://{board}?core={core}" for board in ("tactiles", "brake")}
    begun = time.process_time()
    run_scene(SCENE, HAND, Configuration(), RunOptions(out=out, force=True, seed=1, **ports))
    return time.process_time() - begun


def test_the_main_job_runs_in_real_time_on_every_firmware(row, tmp_path) -> None:
    lockstep_library()
    for board in ("tactiles", "brake"):
        image(board)
    simulated_s = 4.05  # of the shipped motion, with its going off
    speeds = {core: simulated_s / min(run(core, tmp_path / "job.h5") for _ in range(3)) for core in ("py", "c", "avr")}
    for core, speed in speeds.items():
        row(f"main job on core={core}, simulated seconds a second of CPU", f"{speed:.2f}", "> 1")
    assert min(speeds.values()) > 1


class Recorded:
    """The library, noting what is called and what the board answers it; ``replay`` does the same calls once more."""

    def __init__(self, board: CompiledBoard, library: Any):
        self.board, self.library = board, library
        self.calls: list[tuple[Any, ...]] = []
        self.answers: list[int] = []
        self.sent: list[bytes] = []
        self.words: list[int] = []

    def __getattr__(self, name: str) -> Any:
        function = getattr(self.library, name)

        def noted(*arguments: Any) -> Any:
            if name not in ("host_free", "host_state", "host_faults"):
                self.calls.append((function, *arguments[1 if name != "host_new" else 0 :]))
            return function(*arguments)

        return noted if name.startswith("host_") else function

    def replay(self) -> float:
        """CPU seconds of all calls; what the core does must be what it did."""
        answers: Iterator[int] = iter(self.answers)
        sent: list[bytes] = []
        words: list[int] = []
        calls = compiled_board._Calls(
            compiled_board._TRANSMIT(lambda _user, data, count: sent.append(ctypes.string_at(data, count))),
            compiled_board._ASK(lambda _user: next(answers)),
            compiled_board._OUTPUTS(lambda _user, word: words.append(word)),
            compiled_board._CONVERT(lambda _user, sense: next(answers)),
            compiled_board._ASK(lambda _user: next(answers)),
        )
        (new, *settings, _memory, _, user), *others = self.calls
        memory = compiled_board._Memory()  # a new board, as that one was
        begun = time.process_time()
        host = new(*settings, memory, ctypes.byref(calls), user)
        for function, *arguments in others:
            function(host, *arguments)
        took_s = time.process_time() - begun
        self.library.host_free(host)
        assert sent == self.sent
        assert words == self.words
        return took_s


def test_the_c_core_alone_is_a_hundred_times_faster_than_the_job(row, tmp_path, monkeypatch) -> None:
    recorded: list[Recorded] = []
    usual = CompiledBoard.__init__

    def recording(self: CompiledBoard, *arguments: Any) -> None:
        """A board whose every call to the core, and answer to it, is kept."""
        notes = Recorded(self, compiled_board._library.__wrapped__() if not recorded else recorded[0].library)
        recorded.append(notes)
        for name in ("_uplink_busy", "_convert", "_interlock_closed"):

            def answer(*asked: Any, ask: Any = getattr(self, name), notes: Recorded = notes) -> int:
                notes.answers.append(int(ask(*asked) or 0))
                return notes.answers[-1]

            monkeypatch.setattr(self, name, answer, raising=False)
        send, put = self._transmit, self._outputs
        self._transmit = lambda data, count: (notes.sent.append(bytes(data[:count])), send(data, count))[1]  # type: ignore[method-assign]
        self._outputs = lambda word: (notes.words.append(word), put(word))[1]  # type: ignore[method-assign]
        monkeypatch.setattr(compiled_board, "_library", lambda: notes)
        usual(self, *arguments)

    monkeypatch.setattr(CompiledBoard, "__init__", recording)
    run("c", tmp_path / "job.h5")
    simulated_s = max(notes.board.now_ns - notes.board.start_ns for notes in recorded) / NS_PER_S
    took_s = min(sum(notes.replay() for notes in recorded) for _ in range(5))
    calls = sum(len(notes.calls) + len(notes.answers) for notes in recorded)
    row(
        f"C core of both boards in the main job ({calls} calls there and back), simulated s a s of CPU",
        f"{simulated_s / took_s:.0f}",
        "> 100",
    )
    assert simulated_s / took_s > 100

"""The main job on each firmware: the whole of it, and the C core alone on the very calls that the job made."""

from __future__ import annotations

import ctypes
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ledger import Ledger

from firmware_models.cores import compiled_board
from firmware_models.cores.compiled_board import CompiledBoard
from firmware_models.cores.toolchain import image, lockstep_library
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene

pytestmark = pytest.mark.bench

SCENE, HAND = "playground", "synthetic"
SIMULATED_S = 4.05
"""Of the shipped motion, with its going off."""


def run(core: str, out: Path) -> float:
    """CPU seconds of the main job."""
    ports = {f"port_{board}": f"sim://{board}?core={core}" for board in ("tactiles", "brake")}
    begun = time.process_time()
    run_scene(SCENE, HAND, Configuration(), RunOptions(out=out, force=True, seed=1, **ports))
    return time.process_time() - begun


def test_what_the_main_job_costs_on_each_firmware(bench: Ledger, tmp_path: Path) -> None:
    lockstep_library()
    for board in ("tactiles", "brake"):
        image(board)
    costs = {core: [] for core in ("py", "c", "avr")}
    for _ in range(4):
        for core, taken in costs.items():
            taken.append(run(core, tmp_path / "job.h5"))
    for core, taken in costs.items():
        bench.note(f"main job on core={core}, simulated seconds a second of CPU", f"{SIMULATED_S / min(taken[1:]):.2f}")
    for core, at_most in (("c", 1.5), ("avr", 4.0)):
        ratio = statistics.median(a / b for a, b in list(zip(costs[core], costs["py"], strict=True))[1:])
        bench.ratio(f"job.{core}", f"the main job on core={core}, over core=py", ratio, at_most=at_most)


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


def test_the_c_core_alone_is_a_small_part_of_the_job(bench: Ledger, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    job_s = run("c", tmp_path / "job.h5")
    took_s = min(sum(notes.replay() for notes in recorded) for _ in range(5))
    calls = sum(len(notes.calls) + len(notes.answers) for notes in recorded)
    bench.note(f"the C core alone in the main job ({calls} calls there and back), s of CPU", f"{took_s:.4f}")
    bench.ratio("job.core_alone", "the main job on core=c, over the C core alone on the same calls", job_s / took_s, at_least=30)

"""The C core under streams that a coverage-guided fuzzer makes up, watched by an oracle of its own.

What must hold whatever comes in: no output that no valid frame commanded, none beyond its limits or after permission has ended,
hardware that breaks is noticed, safe in silence, and a new host finds a board that works (see firmware/fuzz/fuzz.h). That the
oracle sees it is shown on cores broken on purpose, one after another: that a fuzzer finds nothing means nothing without that.

``fuzz_examples`` has a program for each of them that it found once. Every search begins with these, and goes on if they find
nothing, as where firmware/fuzz takes bytes for other programs than before; then put what it found in the place of the old one.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from firmware_models.cores.toolchain import FIRMWARE

BOARDS = ("tactiles", "brake")
EXAMPLES = Path(__file__).with_name("fuzz_examples")
WITHOUT_SANITIZERS = "FUZZ_FLAGS=-O0 -std=c99 -fsanitize=fuzzer"  # the oracle needs none
ENOUGH_RUNS = 30_000  # without examples, the slowest of these took a third of it

END = "    w->end = d->start + d->ttl * TICKS_PER_MS;"
LID = "if (b->armed && !port_interlock_closed(b)) {"
BROKEN = {
    "tactiles": {
        "arms on any boot id": ("board.c", "if (boot_id != b->boot_id)", "if (!boot_id)"),
        "forgets the dead-man": ("board.c", "silence >= DEAD_MAN_TICKS", "silence >= 3 * DEAD_MAN_TICKS"),
        "believes any checksum": ("framing.c", "d->crc == CRC_OF_WHOLE", "1"),
        "carries out a repetition": (
            "board.c",
            "if (earlier && !(readable && type == MESSAGE_STOP)) {",
            "if (earlier && !readable) {",
        ),
        "takes looser limits": (
            "board.c",
            "return greater_is_stricter ? limit",
            "return greater_is_stricter && b->armed ? limit",
        ),
        "puts any number of coils on": ("tactiles.c", "active + r->count > t->allowed_on", "false"),
        "keeps no account of on-time": ("coil_heat.c", "> heat_of_ms(limit_ms);", "> heat_of_ms(limit_ms + 10u);"),
        "leaves coils on after a stop": ("tactiles.c", "    port_apply(b, 0);\n    line->coils", "    line->coils"),
        "takes pulses of any length": ("tactiles.c", "duration == 0 || duration > b->limits[0]", "duration == 0"),
        "plays two pulses of a coil at once": ("tactiles.c", "taken &= r->channels;", "taken = 0;"),
        "does not watch its supply": ("tactiles.c", "    if (supply < b->limits[3])", "    if (supply == 0)"),
        "does not find a stuck driver": ("tactiles.c", "(doubtful && (!max_on || t->doubts > LONG_DOUBT))", "false"),
    },
    "brake": {
        "volts go on after a stop": ("brake_edges.c", "    apply(k, 0);\n    if (e->wave", "    if (e->wave"),
        "drives wait on after a stop": ("brake_edges.c", "    e->waiting = e->taken = 0;", "    e->taken = 0;"),
        "a replaced drive comes back": (
            "brake_wave.c",
            END,
            END.replace(
                "    w->end", "    if (w->phase == WAVE_WAITING || before(w->end, d->start + d->ttl * TICKS_PER_MS))\n    w->end"
            ),
        ),
        "volts outlast their time": ("brake_wave.c", END, END.replace("d->ttl", "(d->ttl + 20u)")),
        "an open lid changes nothing": ("brake.c", LID, LID.replace("b->armed", "b->faults")),
        "a lid counts only while driving": ("brake.c", LID, LID.replace("b->armed", "b->state == STATE_DRIVING")),
        "arms with an open lid": ("brake.c", "if (!port_interlock_closed(b) || touchable", "if (touchable"),
        "takes any amplitude": ("brake.c", "if (d->amplitude > limits", "if (d->amplitude > 2 * limits"),
        "takes any charge": ("brake.c", "if (charge > UINT32_C(1000) *", "if (charge > UINT32_C(2000) *"),
        "takes drives while disarmed": (
            "brake.c",
            "    if (!board_ready(b, detail))\n        return STATUS_INTERLOCK;\n    if (type",
            "    if (!board_ready(b, detail) && b->state != STATE_DISARMED)\n        return STATUS_INTERLOCK;\n    if (type",
        ),
        "takes drives in the self test": ("board.c", "if (b->armed && b->state != STATE_SELF_TEST)", "if (b->armed)"),
        "forgets the dead-man": ("board.c", "silence >= DEAD_MAN_TICKS", "silence >= 3 * DEAD_MAN_TICKS"),
        "arms over a fault": (
            "board.c",
            "    if (b->faults) {\n        *detail",
            "    if (b->faults == 0xffffu) {\n        *detail",
        ),
        "does not turn its bridge": ("brake_wave.c", "    w->negative = !w->negative;\n", "    w->negative = w->negative;\n"),
        "does not watch its volts": ("brake_guards.c", "return surely * UINT32_C(100) >", "return surely >"),
        "does not watch its current": ("brake_guards.c", "l->current > OVER_CURRENT_UA;", "l->current > 2 * OVER_CURRENT_UA;"),
    },
}


def build(board: str, sources: Path, out: Path, *flags: str) -> Path:
    """The fuzzer of one board."""
    if shutil.which("clang") is None or shutil.which("make") is None:
        pytest.skip("clang and make are needed to fuzz the C core (packages clang, libclang-rt-dev, make)")
    target = out / f"fuzz_{board}"
    subprocess.run(["make", "--silent", "-C", sources, target, f"OUT={out}", *flags], check=True)
    return target


def fuzz(board: str, program: Path, folder: Path, *limits: str) -> subprocess.CompletedProcess[str]:
    """Plays the examples, then searches; what is found lies in the folder."""
    corpus = folder / "corpus"
    corpus.mkdir()
    fixed = ["-seed=1", "-max_len=400", "-len_control=0", "-timeout=20", f"-artifact_prefix={folder}/"]
    return subprocess.run([program, corpus, EXAMPLES / board, *fixed, *limits], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("board", BOARDS)
def test_no_stream_makes_the_core_do_what_nobody_commanded(board, tmp_path) -> None:
    done = fuzz(board, build(board, FIRMWARE, tmp_path), tmp_path, "-runs=500", "-max_total_time=60")
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.soak
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("board", BOARDS)
def test_no_stream_found_in_a_long_search_either(board, tmp_path) -> None:
    seconds = os.environ.get("HAPTICS_FUZZ_S", "1200")
    done = fuzz(board, build(board, FIRMWARE, tmp_path), tmp_path, f"-max_total_time={seconds}")
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    """Sources and objects of both fuzzers; after a change of one source, that one is compiled and all are linked."""
    folder = tmp_path_factory.mktemp("sound")
    shutil.copytree(FIRMWARE, folder / "firmware")
    for board in BOARDS:
        build(board, folder / "firmware", folder / "out", WITHOUT_SANITIZERS)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("board", "fault"), [(board, fault) for board in BOARDS for fault in BROKEN[board]])
def test_a_broken_core_is_found_out(board, fault, sound, tmp_path) -> None:
    name, right, wrong = BROKEN[board][fault]
    broken = tmp_path / "broken"
    shutil.copytree(sound, broken)
    source = broken / "firmware" / "core" / name
    text = source.read_text()
    assert text.count(right) == 1
    source.write_text(text.replace(right, wrong))
    program = build(board, broken / "firmware", broken / "out", WITHOUT_SANITIZERS)
    done = fuzz(board, program, tmp_path, f"-runs={ENOUGH_RUNS}")
    assert done.returncode != 0, "the fuzzer found nothing"
    # coils beyond what there is room for write over what the oracle would have looked at
    assert "broke a promise" in done.stderr or "DEADLYSIGNAL" in done.stderr, done.stderr[-1000:]

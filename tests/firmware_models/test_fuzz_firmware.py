"""The C core under streams that a coverage-guided fuzzer makes up, with sanitizers, watched by an oracle of its own.

What must hold whatever comes in: no output that no valid frame commanded, none beyond its limits, safe in silence, and a new host
finds a board that works (see firmware/fuzz/fuzz.h). That the oracle can tell is shown on cores broken on purpose.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from firmware_models.toolchain import FIRMWARE

BOARDS = ("tactiles", "brake")
BROKEN = {
    "arms on any boot id": ("tactiles", "board.c", "if (boot_id != b->boot_id)", "if (!boot_id)"),
    "forgets the dead-man": ("tactiles", "board.c", "silence >= DEAD_MAN_TICKS", "silence >= 3 * DEAD_MAN_TICKS"),
    "believes any checksum": ("tactiles", "framing.c", "d->crc == CRC_OF_WHOLE", "1"),
    "puts any number of coils on": ("tactiles", "tactiles.c", "active + r->count > t->allowed_on", "false"),
    "keeps no account of on-time": ("tactiles", "coil_heat.c", "> heat_of_ms(limit_ms);", "> heat_of_ms(limit_ms + 10u);"),
}


def build(board: str, sources: Path, out: Path) -> Path:
    """The fuzzer of one board."""
    if shutil.which("clang") is None or shutil.which("make") is None:
        pytest.skip("clang and make are needed to fuzz the C core (packages clang, libclang-rt-dev, make)")
    target = out / f"fuzz_{board}"
    subprocess.run(["make", "--silent", "-C", sources, target, f"OUT={out}"], check=True)
    return target


def fuzz(program: Path, corpus: Path, *limits: str) -> subprocess.CompletedProcess[str]:
    corpus.mkdir(exist_ok=True)
    command = [program, corpus, "-seed=1", "-max_len=1500", f"-artifact_prefix={corpus.parent}/", *limits]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("board", BOARDS)
def test_no_stream_makes_the_core_do_what_nobody_commanded(board, tmp_path) -> None:
    done = fuzz(build(board, FIRMWARE, tmp_path), tmp_path / "corpus", "-runs=60000", "-max_total_time=60")
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.soak
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("board", BOARDS)
def test_no_stream_found_in_a_long_search_either(board, tmp_path) -> None:
    seconds = os.environ.get("HAPTICS_FUZZ_S", "1200")
    done = fuzz(build(board, FIRMWARE, tmp_path), tmp_path / "corpus", f"-max_total_time={seconds}")
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.parametrize("fault", BROKEN)
def test_a_broken_core_is_found_out(fault, tmp_path) -> None:
    board, name, right, wrong = BROKEN[fault]
    sources = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, sources)
    text = (sources / "core" / name).read_text()
    assert text.count(right) == 1
    (sources / "core" / name).write_text(text.replace(right, wrong))
    done = fuzz(build(board, sources, tmp_path), tmp_path / "corpus", "-max_total_time=120")
    assert done.returncode != 0
    assert "broke a promise" in done.stderr or "runtime error" in done.stderr

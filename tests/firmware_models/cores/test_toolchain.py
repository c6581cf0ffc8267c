"""The build cache: built once, anew when anything changes, by many at once, and plain words where a tool is missing."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from avr_bench import needs_avr

from firmware_models.cores import toolchain
from haptics.errors import InputError
from haptics.link.messages import Board

needs_cc = pytest.mark.skipif(
    shutil.which("make") is None or shutil.which(os.environ.get("CC") or "cc") is None, reason="no make or cc here"
)


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("HAPTICS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def builds(cache: Path) -> list[str]:
    return sorted(path.name for path in (cache / "firmware").iterdir())


@needs_cc
def test_the_library_is_built_once_and_loads(cache) -> None:
    path = toolchain.host_library()
    made = path.stat().st_mtime_ns
    assert cache in path.parents
    assert ctypes.CDLL(str(path)).host_new
    assert toolchain.host_library() == path
    assert path.stat().st_mtime_ns == made
    assert len(builds(cache)) == 1


@needs_avr
def test_each_image_and_the_simulator_are_built(cache) -> None:
    for board in ("tactiles", "brake"):
        image = toolchain.image(board)
        assert image.read_text().startswith(":")  # Intel hex
    assert ctypes.CDLL(str(toolchain.lockstep_library())).lockstep_new
    assert [name.split("-")[0] for name in builds(cache)] == ["brake", "lockstep", "tactiles"]


@needs_cc
def test_another_source_is_another_build(cache, tmp_path, monkeypatch) -> None:
    sources = tmp_path / "firmware"
    shutil.copytree(toolchain.FIRMWARE, sources)
    monkeypatch.setattr(toolchain, "FIRMWARE", sources)
    first = toolchain.host_library()
    header = sources / "core" / "port.h"
    header.write_text(header.read_text() + "/* changed */\n")
    second = toolchain.host_library()
    assert first != second
    assert first.exists()


@needs_cc
def test_processes_that_build_at_the_same_time_do_not_disturb_each_other(cache) -> None:
    program = "import ctypes; from firmware_models.cores.toolchain import host_library; ctypes.CDLL(str(host_library())).host_new"
    environment = {**os.environ, "HAPTICS_CACHE": str(cache)}

    def run(_: int) -> subprocess.CompletedProcess[str]:
        return subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)

    with ThreadPoolExecutor(3) as pool:
        done = list(pool.map(run, range(3)))
    assert [(d.returncode, d.stderr) for d in done] == [(0, "")] * 3
    assert len(builds(cache)) == 1


@pytest.mark.parametrize(
    ("build", "tool", "packages"),
    [
        (toolchain.host_library, "cc", "gcc"),
        (toolchain.lockstep_library, "cc", "gcc"),
        (lambda: toolchain.image("tactiles"), "avr-gcc", "avr-libc"),
    ],
)
def test_a_missing_compiler_is_said_plainly(cache, monkeypatch, build, tool, packages) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(cache))
    with pytest.raises(InputError, match=f"{tool} not found.*{packages}.*core=py works without"):
        build()


@needs_cc
def test_missing_make_is_said_plainly(cache, monkeypatch) -> None:
    which = shutil.which
    monkeypatch.setattr(toolchain.shutil, "which", lambda name: None if name == "make" else which(name))
    with pytest.raises(InputError, match=r"make not found.*core=py works without"):
        toolchain.host_library()


@needs_cc
def test_a_missing_simulator_is_said_plainly(cache, monkeypatch) -> None:
    monkeypatch.setattr(toolchain, "_SIMAVR_HEADER", "#include <no_such_simavr/sim_avr.h>\n")
    with pytest.raises(InputError, match=r"libsimavr.*libsimavr-dev.*core=py works without"):
        toolchain.lockstep_library()


@needs_cc
def test_a_build_that_fails_says_what_the_compiler_said_and_leaves_nothing(cache, tmp_path, monkeypatch) -> None:
    sources = tmp_path / "firmware"
    shutil.copytree(toolchain.FIRMWARE, sources)
    monkeypatch.setattr(toolchain, "FIRMWARE", sources)
    (sources / "core" / "framing.c").write_text("#error a broken source\n")
    with pytest.raises(InputError, match=r"(?s)could not be built.*a broken source.*core=py works without"):
        toolchain.host_library()
    assert builds(cache) == []


def test_a_board_that_there_is_not_is_refused(cache) -> None:
    with pytest.raises(InputError, match="tactiles, brake"):
        toolchain.image("glove")


def test_the_cache_is_where_the_platform_keeps_such_things(monkeypatch, tmp_path) -> None:
    monkeypatch.delenv("HAPTICS_CACHE", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert toolchain.cache_folder() == tmp_path / "wearable-haptics"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert toolchain.cache_folder() == tmp_path / ".cache" / "wearable-haptics"


def test_the_sources_lie_inside_the_package() -> None:
    package = Path(toolchain.__file__).parents[1]
    assert toolchain.FIRMWARE.is_relative_to(package)
    for name in ("Makefile", "core/board.c", "core/port.h", "avr/main.c", "host/host.h", "simavr/lockstep.c"):
        assert (toolchain.FIRMWARE / name).is_file()
    assert {kind.name.lower() for kind in Board} == {"tactiles", "brake"}

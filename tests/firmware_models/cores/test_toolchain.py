"""The build cache: built once, anew when anything changes, by many at once, and plain words where a tool is missing."""

from __future__ import annotations

import ctypes
import os
import re
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


MAKEFILE = """
host: $(OUT)/libcore.so
lockstep: $(OUT)/liblockstep.so
tactiles brake: %: $(OUT)/%.hex
$(OUT)/%.so: core.c
\tmkdir -p $(OUT)
\tcc -shared -fPIC -o $@ $<
$(OUT)/%.hex:
\tmkdir -p $(OUT)
\techo :00000001FF > $@
"""


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("HAPTICS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def sources(tmp_path, monkeypatch) -> Path:
    """A firmware of one line in the place of the real one: how it is built and kept does not depend on what it is."""
    folder = tmp_path / "firmware"
    folder.mkdir()
    (folder / "core.c").write_text("int host_new(void) { return 1; }\n")
    (folder / "Makefile").write_text(MAKEFILE)
    monkeypatch.setattr(toolchain, "FIRMWARE", folder)
    return folder


def builds(cache: Path) -> list[str]:
    return sorted(path.name for path in (cache / "firmware").iterdir())


@needs_cc
def test_the_library_is_built_once_and_loads(cache, sources) -> None:
    path = toolchain.host_library()
    made = path.stat().st_mtime_ns
    assert cache in path.parents
    assert ctypes.CDLL(str(path)).host_new
    assert toolchain.host_library() == path
    assert path.stat().st_mtime_ns == made
    assert len(builds(cache)) == 1


@needs_avr
def test_each_image_and_the_simulator_are_built(cache, sources) -> None:
    for board in ("tactiles", "brake"):
        image = toolchain.image(board)
        assert image.read_text().startswith(":")  # Intel hex
    assert ctypes.CDLL(str(toolchain.lockstep_library())).host_new
    assert [name.split("-")[0] for name in builds(cache)] == ["brake", "lockstep", "tactiles"]


@needs_cc
def test_another_source_is_another_build(cache, sources) -> None:
    first = toolchain.host_library()
    (sources / "core.c").write_text("int host_new(void) { return 2; }\n")
    second = toolchain.host_library()
    (sources / "port.h").write_text("/* a header */\n")
    third = toolchain.host_library()
    assert [ctypes.CDLL(str(path)).host_new() for path in (first, second, third)] == [1, 2, 2]
    assert len(builds(cache)) == 3


@needs_cc
def test_processes_that_build_at_the_same_time_do_not_disturb_each_other(cache, sources) -> None:
    program = f"""import ctypes, pathlib
from firmware_models.cores import toolchain
toolchain.FIRMWARE = pathlib.Path({str(sources)!r})
ctypes.CDLL(str(toolchain.host_library())).host_new"""
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
def test_a_missing_compiler_is_named_plainly(cache, monkeypatch, build, tool, packages) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(cache))
    with pytest.raises(InputError, match=f"{tool} not found.*{packages}.*core=py works without"):
        build()


@needs_cc
def test_missing_make_is_named_plainly(cache, monkeypatch) -> None:
    which = shutil.which
    monkeypatch.setattr(toolchain.shutil, "which", lambda name: None if name == "make" else which(name))
    with pytest.raises(InputError, match=r"make not found.*core=py works without"):
        toolchain.host_library()


@needs_cc
def test_a_missing_simulator_is_named_plainly(cache, monkeypatch) -> None:
    monkeypatch.setattr(toolchain, "_SIMAVR_HEADER", "#include <no_such_simavr/sim_avr.h>\n")
    with pytest.raises(InputError, match=r"libsimavr.*libsimavr-dev.*core=py works without"):
        toolchain.lockstep_library()


@needs_cc
def test_a_build_that_fails_shows_what_the_compiler_printed_and_leaves_nothing(cache, sources) -> None:
    (sources / "core.c").write_text("#error a broken source\n")
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


def test_every_macro_of_the_makefile_is_one_that_a_source_reads() -> None:
    """No compiler warns of a definition that no source reads; then the image runs with the default of another CPU."""
    makefile = (toolchain.FIRMWARE / "Makefile").read_text()
    sources = "".join(path.read_text() for path in toolchain.FIRMWARE.rglob("*.[ch]"))
    macros = set(re.findall(r"-D(\w+)", makefile)) - {"F_CPU"}  # avr-libc's own
    assert macros == {"ENCODING_TICKS", "MIN_LEAD_TICKS"}
    assert all(f"#ifndef {macro}\n" in sources for macro in macros)

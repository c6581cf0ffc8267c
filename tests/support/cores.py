"""The firmware that a simulated board may run, each skipped where its tools are missing; the chip is simulated slowly."""

from __future__ import annotations

import ctypes.util
import shutil

import pytest

_NEEDED = {"py": (), "c": ("cc", "make"), "avr": ("cc", "make", "avr-gcc")}
CORE_NAMES = tuple(_NEEDED)


def marks_of(core: str) -> list[pytest.MarkDecorator]:
    """What a test of a core is marked with."""
    missing = [tool for tool in _NEEDED[core] if shutil.which(tool) is None]
    if core == "avr" and ctypes.util.find_library("simavr") is None:
        missing.append("libsimavr")
    skip = pytest.mark.skipif(bool(missing), reason=f"no core {core} here: {missing} not found")
    return [skip, pytest.mark.slow] if core == "avr" else [skip]


def on_cores(*cores: str) -> pytest.MarkDecorator:
    """Run a test with each of these as its argument ``core``."""
    return pytest.mark.parametrize("core", [pytest.param(core, marks=marks_of(core)) for core in cores])


CORES = [pytest.param(core, marks=marks_of(core)) for core in CORE_NAMES]
on_every_core = on_cores(*CORE_NAMES)

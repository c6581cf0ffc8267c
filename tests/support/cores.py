"""The firmware that a simulated board may run, each skipped where its tools are missing."""

from __future__ import annotations

import ctypes.util
import shutil

import pytest

_NEEDED = {"py": (), "c": ("cc", "make"), "avr": ("cc", "make", "avr-gcc")}


def _missing(core: str) -> list[str]:
    missing = [tool for tool in _NEEDED[core] if shutil.which(tool) is None]
    if core == "avr" and ctypes.util.find_library("simavr") is None:
        missing.append("libsimavr")
    return missing


CORES = [
    pytest.param(core, marks=pytest.mark.skipif(bool(_missing(core)), reason=f"no core {core} here: {_missing(core)} not found"))
    for core in _NEEDED
]
on_every_core = pytest.mark.parametrize("core", CORES)

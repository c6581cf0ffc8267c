"""The firmware that a simulated board may run, each skipped where its tools are missing; the chip is simulated slowly."""

from __future__ import annotations

import ctypes.util
import shutil

import pytest

_NEEDED = {"py": (), "c": ("cc", "make"), "avr": ("cc", "make", "avr-gcc")}
CORE_NAMES = tuple(_NEEDED)


def _marks(core: str) -> list[pytest.MarkDecorator]:
    missing = [tool for tool in _NEEDED[core] if shutil.which(tool) is None]
    if core == "avr" and ctypes.util.find_library("simavr") is None:
        missing.append("libsimavr")
    skip = pytest.mark.skipif(bool(missing), reason=f"no core {core} here: {missing} not found")
    return [skip, pytest.mark.slow] if core == "avr" else [skip]


def on_cores(*cores: str) -> pytest.MarkDecorator:
    """Run a test with each of these as its argument ``core``."""
    return pytest.mark.parametrize("core", [core_param(core) for core in cores])


def core_param(core: str, *more: object) -> object:
    """A parameter set that begins with a core, under the core's marks."""
    return pytest.param(core, *more, marks=_marks(core))


CORES = [core_param(core) for core in CORE_NAMES]
on_every_core = on_cores(*CORE_NAMES)

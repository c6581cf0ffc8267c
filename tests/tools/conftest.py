"""Scripts of ``tools/``, run as a person runs them, but within this process: what they import is loaded once."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parents[2] / "tools"
Answer = tuple[int, str, str]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """Run ``python tools/NAME.py ARGS...``; returns exit code, standard output, standard error."""

    def run(name: str, *args: object) -> Answer:
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *map(str, args)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            runpy.run_path(str(TOOLS / f"{name}.py"), run_name="__main__")
        code = stop.value.code
        out, err = capsys.readouterr()
        if isinstance(code, str):  # what Python itself does with a message
            code, err = 1, f"{err}{code}\n"
        return code or 0, out, err

    return run

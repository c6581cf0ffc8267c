"""The command line as a user runs it, in this process: exit code, JSON, standard error."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from haptics.cli import main as cli


@dataclass
class Finished:
    """One finished command."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def haptics(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Finished]:
    """Run ``haptics ARGS...``."""

    def command(*args: object) -> Finished:
        out, err = io.StringIO(), io.StringIO()
        monkeypatch.setattr(sys, "argv", ["haptics", *map(str, args)])
        code = 0
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                cli.main()
            except SystemExit as stop:
                code = stop.code if isinstance(stop.code, int) else 1
        return Finished(code, out.getvalue(), err.getvalue())

    return command

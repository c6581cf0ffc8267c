"""The command line as a person or a program meets it: an exit code, and on standard output one strict JSON object."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

import pytest

from haptics.cli import main as cli


@pytest.fixture
def strict_json() -> Callable[[str], Any]:
    """Read JSON by the standard: NaN and Infinity, which Python's reader lets pass, are refused."""

    def refuse(constant: str) -> Any:
        raise ValueError(f"{constant} is no JSON")

    return lambda text: json.loads(text, parse_constant=refuse)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run ``haptics ARGS...``; returns exit code, standard output, standard error."""

    def run(*args: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["haptics", *map(str, args)])
        code = 0
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out, err

    return run


@pytest.fixture
def answer(command: Callable[..., tuple[int, str, str]], strict_json: Callable[[str], Any]) -> Callable[..., dict[str, Any]]:
    """What ``haptics ARGS... --json`` answers; the command must succeed."""

    def ask(*args: object) -> dict[str, Any]:
        code, out, err = command(*args, "--json")
        assert code == 0, err
        data = strict_json(out)
        assert isinstance(data, dict)
        return data

    return ask


@pytest.fixture
def refused(command: Callable[..., tuple[int, str, str]]) -> Callable[..., str]:
    """Why ``haptics ARGS...`` was refused; it must exit with 2, print no answer and say one thing on standard error."""

    def ask(*args: object) -> str:
        code, out, err = command(*args)
        assert (code, out) == (2, "")
        assert err.strip()
        return err

    return ask

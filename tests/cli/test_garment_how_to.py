"""The how-to keeps its word: every command on the page runs, one after another, in an empty folder."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from quick_garments import quick_garments
from test_drawn_garments import drawn_around, write

pytestmark = pytest.mark.slow


pytest.importorskip("matplotlib", reason="extra `report`")

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "garments.md").read_text(encoding="utf-8")
ENOUGH = "0.99"
"""A few steps of a design show as well as a hundred that the commands fit together."""
COMMANDS = ("bodies", "design", "evaluate", "export", "patch", "report")


@pytest.fixture(scope="module", autouse=True)
def _quick():
    with quick_garments():
        yield


def commands() -> list[list[str]]:
    blocks = re.findall(r"^```sh\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)
    return [shlex.split(line) for block in blocks for line in block.splitlines()]


@pytest.mark.slow
def test_every_command_runs_in_the_order_of_the_page(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    known = [words for words in commands() if words[0] == "haptics"]
    assert {words[2] for words in known} == set(COMMANDS)
    for words in known:
        if "report" in words:
            words = [*words, "--coverage", ENOUGH]
        if "mine.obj" in words:  # what the reader has drawn around the exported body
            write(tmp_path / "mine.obj", *drawn_around(tmp_path / "body.obj"))
        code, out, err = command(*(ENOUGH if word == "0.15" else word for word in words[1:]))
        assert code == 0, f"{shlex.join(words)}\n{err}"
        assert out.strip()
    assert (tmp_path / "table.html").stat().st_size > 50_000
    for name in ("sleeve/designs.h5", "sleeve/motion.png", "table/sleeve-elbow_flexion/design.json"):
        assert (tmp_path / name).is_file()
    assert {path.suffix for path in (tmp_path / "cut").iterdir()} == {".svg", ".dxf", ".obj", ".mtl", ".ply"}


def test_the_page_uses_no_command_that_this_test_does_not_know():
    assert {words[0] for words in commands()} == {"haptics", "pip"}


def test_every_option_that_the_page_names_exists(command):
    helps = "".join(command("garment", name, "--help")[1] for name in COMMANDS)
    assert not {option for option in re.findall(r"`(--[a-z-]+)", PAGE) if option not in helps}

"""How-to pages keep their word: their files, commands and Python work in the order of the page."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "how-to"
PAGES = ("calibration", "live", "live-scene", "own-hand", "own-scene", "own-pattern", "board-fault", "recording-stream")
_FILE = re.compile(r"`([\w-]+\.toml)`")


def text(page: str) -> str:
    return (FOLDER / f"{page}.md").read_text(encoding="utf-8")


def blocks(page: str) -> list[tuple[str, str, str]]:
    """Language, content, and the text before, of each block of a page."""
    pieces = re.split(r"^```(\w*)\n(.*?)^```$", text(page), flags=re.MULTILINE | re.DOTALL)
    return [(pieces[n + 1], pieces[n + 2], pieces[n]) for n in range(0, len(pieces) - 2, 3)]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_a_page_works_in_the_order_of_the_page(page, haptics, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HAPTICS_CONFIG_FOLDER", str(tmp_path))
    names: dict[str, object] = {}
    printed = ""
    for language, content, before in blocks(page):
        if language == "toml":
            Path(_FILE.findall(before)[-1]).write_text(content, encoding="utf-8")
        elif language == "python":
            exec(compile(content, f"{page}.md", "exec"), names)
            printed = capsys.readouterr().out
        elif language == "sh":
            for words in map(shlex.split, content.splitlines()):
                assert words[0] == "haptics"
                done = haptics(*words[1:])
                assert done.code == 0, f"{shlex.join(words)}\n{done.err}"
                assert done.out.strip()
        elif language:  # a block without a language shows lines of the code itself, out of their place
            assert language == "text"
            assert content == printed


def test_the_hand_of_the_page_is_the_one_that_it_was_made_from(tmp_path, monkeypatch):
    import haptics

    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for language, content, _ in blocks("own-hand"):
        if language == "python":
            exec(compile(content, "own-hand.md", "exec"), names)
    mine, shipped = haptics.load_hand("mine.csv"), haptics.load_hand("synthetic")
    assert (mine.refused, mine.frame_count) == ((), shipped.frame_count)
    off_m = abs(mine.tracks[0].joint_m("index_tip") - shipped.tracks[0].joint_m("index_tip")).max()
    assert off_m < 1e-7  # as many digits as the page writes


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_points_at_is_there(page):
    for target in re.findall(r"\]\(([^)#]+)", text(page)):
        assert (FOLDER / target).exists(), target

"""The pages on Python keep their word: every snippet runs, in the order of its page, and prints what the page shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = ("how-to/python.md", "reference/joints.md")


def blocks(page: str, language: str) -> list[str]:
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES)
def test_every_snippet_runs(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    space: dict[str, object] = {}
    snippets = blocks(page, "python")
    assert snippets
    for snippet in snippets:
        exec(compile(snippet, page, "exec"), space)
    printed = capsys.readouterr().out
    for shown in blocks(page, "text"):
        assert shown in printed
    for shown in re.findall(r"print\(.*\) +# (\[.*\])$", "\n".join(snippets), flags=re.MULTILINE):
        assert shown in printed


def test_the_table_of_joints_is_the_programs():
    import haptics

    text = (DOCS / "reference" / "joints.md").read_text(encoding="utf-8")
    assert haptics.JOINTS.index("index_metacarpal") == 6
    assert haptics.JOINTS.index("middle_metacarpal") == 11
    assert haptics.JOINTS.index("ring_metacarpal") == 16
    assert haptics.JOINTS.index("little_metacarpal") == 21
    assert all(f"`{name}`" in text for name in haptics.BASES)
    assert "names the 15 places" in text
    assert len(haptics.SITES) == 15
    assert all(f"`{name}`" in text for name in haptics.SITES)

"""Python on the pages of docs runs as it stands, a page's snippets one after another, in an empty folder."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import pytest
from pages import CHECKOUT, PAGES, blocks

DOCS = CHECKOUT / "docs"
HAVE: dict[str, dict[str, Any]] = {
    "how-to/ends.md": {
        "open_my_glove": lambda: type("Mine", (), {"close": lambda self: None})(),
        "work": lambda glove: nullcontext(),
    },
}
"""What a page takes for granted."""
ELSEWHERE = {"tutorial.md", "calibration.md", "live.md", "live-scene.md", "own-hand.md", "own-scene.md", "own-pattern.md"}
"""Pages whose snippets run in order with their commands and files, in tests of their own."""
WITH_PYTHON = [page for page in PAGES if page.is_relative_to(DOCS) and page.name not in ELSEWHERE and blocks(page, "python")]


@pytest.mark.parametrize("page", WITH_PYTHON, ids=[page.relative_to(DOCS).as_posix() for page in WITH_PYTHON])
def test_python_on_a_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = dict(HAVE.get(page.relative_to(DOCS).as_posix(), {}))
    for block in blocks(page, "python"):
        exec(compile(block, page.name, "exec"), names)


def test_what_a_snippet_on_published_numbers_claims():
    from rigs.reference import curve, published

    tau = published("thermal_tau")
    assert (tau.value, tau.unit, tau.tolerance, tau.section) == (102.0, "s", 5.0, "3.5.2")
    assert tau.compare(98.0, sd=1.5) == "agrees"
    assert curve("force_index").compare(400.0, 1.36) == "agrees"

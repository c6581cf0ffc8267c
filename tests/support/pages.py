"""The pages of the project as tests read them: their snippets, headings and links."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
PAGES = sorted([*CHECKOUT.glob("*.md"), *(p for p in (CHECKOUT / "docs").rglob("*.md") if not {"api", "_build"} & set(p.parts))])
_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)


def blocks(page: Path, language: str) -> list[str]:
    """Snippets of a page in a language."""
    return [text for kind, text in _FENCE.findall(page.read_text(encoding="utf-8")) if kind == language]


def commands(page: Path) -> list[list[str]]:
    """Command lines of a page, without comments, split into words."""
    found, pending = [], ""
    for line in "".join(blocks(page, "sh")).splitlines(keepends=True):
        try:
            words = shlex.split(pending + line, comments=True)
        except ValueError:  # a quotation goes on in the next line
            pending += line
            continue
        found, pending = [*found, words] if words else found, ""
    return found


def prose(page: Path) -> str:
    """A page without its fenced blocks and code spans."""
    return re.sub(r"`[^`\n]*`", "`code`", _FENCE.sub("", page.read_text(encoding="utf-8")))


def links(page: Path) -> list[str]:
    """Where a page's links and pictures lead."""
    return re.findall(r"\]\(([^)\s]+)\)", prose(page))


def anchors(page: Path) -> set[str]:
    """Names by which headings of a page can be reached, as code hosts and the site make them."""
    text = _FENCE.sub("", page.read_text(encoding="utf-8"))
    found: set[str] = set()
    for heading in re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        found.add(re.sub(r"[^\w\- ]", "", plain).replace(" ", "-"))
    return found


def needs_hardware(words: list[str]) -> bool:
    """Whether a command line is for a machine with boards."""
    return words[:2] == ["haptics", "off"] or any("/dev/" in word for word in words)

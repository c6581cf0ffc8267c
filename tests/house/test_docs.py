"""The pages hold together: every link leads to a page and a heading that are there, every page is found, every command exists."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from pages import CHECKOUT, PAGES, anchors, blocks, commands, links

from haptics.cli.commands import add_installed_commands, app

DOCS = CHECKOUT / "docs"
IDS = [page.relative_to(CHECKOUT).as_posix() for page in PAGES]


def faults_of_links(page: Path) -> list[str]:
    found = []
    for link in links(page):
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if "://" in link or link.startswith("mailto:"):
            continue
        if not target.exists():
            found.append(f"{link}: no such file")
        elif anchor and anchor not in anchors(target):
            found.append(f"{link}: no such heading")
    return found


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_link_leads_somewhere(page):
    assert faults_of_links(page) == []


def test_a_dead_link_and_a_dead_anchor_are_found(tmp_path):
    page = tmp_path / "a.md"
    page.write_text("# One `two`\n\n[good](#one-two) [dead](#three) [gone](b.md)\n")
    assert faults_of_links(page) == ["#three: no such heading", "b.md: no such file"]


def test_every_page_is_reached_from_the_start_page():
    seen, waiting = set(), [DOCS / "index.md"]
    while waiting:
        page = waiting.pop()
        seen.add(page)
        targets = {(page.parent / link.partition("#")[0]).resolve() for link in links(page) if "://" not in link}
        waiting += [target for target in targets if target.suffix == ".md" and target not in seen]
    assert {page for page in PAGES if page.is_relative_to(DOCS)} <= seen


def known_commands() -> dict[str, set[str]]:
    """Every command with its options."""
    import typer

    add_installed_commands()
    found: dict[str, set[str]] = {}

    def walk(command: object, name: str) -> None:
        for word, one in getattr(command, "commands", {}).items():
            walk(one, f"{name} {word}".strip())
        found[name] = {option for one in command.params for option in one.opts if option.startswith("-")}  # type: ignore[attr-defined]

    walk(typer.main.get_command(app), "")
    return found


KNOWN = known_commands()


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_every_command_line_names_a_command_and_its_options(page):
    for words in commands(page):
        if words[0] != "haptics":
            continue
        name = next((" ".join(words[1 : 1 + count]) for count in (2, 1) if " ".join(words[1 : 1 + count]) in KNOWN), None)
        assert name, words
        used = {word.partition("=")[0] for word in words if word.startswith("--")} - {"--help"}
        assert used <= KNOWN[name], words


def test_every_command_named_in_a_sentence_exists():
    for page in PAGES:
        for words in re.findall(r"`haptics (?!journal)([a-z]+(?: [a-z]+)?)", page.read_text(encoding="utf-8")):
            group = words.split()[0]
            grouped = any(name.startswith(f"{group} ") for name in KNOWN)
            assert (words if grouped else group) in KNOWN, f"{page}: haptics {words}"


def test_the_page_of_commands_has_every_command():
    lines = [" ".join(words) for words in commands(DOCS / "reference" / "commands.md")]
    leaves = [name for name in KNOWN if not any(other.startswith(f"{name} ") for other in KNOWN) and name]
    assert [name for name in leaves if not any(line.startswith(f"haptics {name}") for line in lines)] == []


def test_every_make_target_that_is_named_exists():
    targets = set(re.findall(r"^([a-z-]+):", (CHECKOUT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    for page in PAGES:
        named = {words[1] for words in commands(page) if words[0] == "make" and not words[1].startswith("-")}
        named |= set(re.findall(r"`make ([a-z-]+)[^`]*`", page.read_text(encoding="utf-8")))
        if page.name != "CHANGELOG.md":
            assert named <= targets, page


def test_no_page_installs_from_an_index_that_does_not_have_us():
    for page in PAGES:
        assert not [words for words in commands(page) if words[0] == "pip" and any("wearable-haptics" in word for word in words)]


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_python_on_pages_compiles(page):
    for block in blocks(page, "python"):
        compile(block, page.name, "exec")


def test_the_site_needs_no_network_and_its_reference_is_complete():
    sys.path.insert(0, str(DOCS))
    try:
        import site_parts
    finally:
        sys.path.remove(str(DOCS))
    text = site_parts.command_reference()
    for name, options in KNOWN.items():
        if name and not any(other.startswith(f"{name} ") for other in KNOWN):
            section = text.partition(f"## haptics {name}\n")[2].partition("\n## ")[0]
            assert section, name
            assert [option for option in options if option not in section] == []
    lines = [":param a: one. :param b, c: two.", "and more", ":return: |x|"]
    site_parts.fields_apart(None, "function", "f", None, None, lines)
    assert lines == [":param a: one.", ":param b: as c", ":param c: two.", "", "and more", r":return: \|x\|"]


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("sphinx") is None, reason="extra `docs`")
def test_the_pages_build_into_a_site_without_a_warning(tmp_path):
    """Without the reference made of docstrings, which takes a minute: ``make docs`` has it."""
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-d", tmp_path / "trees"]
    options = ["-D", "exclude_patterns=reference/api/*/*"]
    environment = {**os.environ, "HAPTICS_DOCS_PAGES_ONLY": "1"}
    done = subprocess.run(
        [*command, *options, DOCS, tmp_path / "site"], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "tutorial.html").is_file()

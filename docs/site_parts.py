"""What the site has and the plain pages do not: contents, the commands' help as a page, fields of docstrings set apart."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
ROOMS = () if os.environ.get("HAPTICS_DOCS_PAGES_ONLY") else ("haptics", "firmware_models", "rigs")
"""Packages whose docstrings become the reference of modules; tests of the pages leave it out, since it takes a minute."""
SECTIONS = {
    "Begin": ["tutorial"],
    "How-tos": ["how-to/*"],
    "Reference": [
        "reference/*",
        "reference/api/commands",
        "reference/api/names",
        *(f"reference/api/{room}/{room}" for room in ROOMS),
    ],
    "Explanations": ["architecture", "explanation/*"],
    "Decisions": ["decisions/README", "decisions/0*"],
}
_FIELD = re.compile(r"(?<=\S)\s+(?=:(?:param|ivar|return|returns|raises|yield)\b[^:\n]*:(?:\s|$))")
_SEVERAL = re.compile(r"^(\s*):(param|ivar) ([\w*]+(?:, [\w*]+)+):(.*)$")
_BAR = re.compile(r"(?<![`\\])\|(?![^`]*``)")  # an absolute value, not a substitution


def contents(app: Any, page: str, source: list[str]) -> None:
    """Add the table of contents to the start page as Sphinx reads it.

    :param app: Sphinx. :param page: its name. :param source: its text, in the only item, changed in place.
    """
    if page == "index":
        trees = (
            "\n".join(("```{toctree}", ":hidden:", f":caption: {title}", ":glob:", "", *pages, "```"))
            for title, pages in SECTIONS.items()
        )
        source[0] += "\n\n" + "\n\n".join(trees) + "\n"


def fields_apart(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Give each field of a docstring a line of its own, since reStructuredText knows no other.

    :param app, what, name, obj, options: as Sphinx hands them; not used.
    :param lines: of the docstring, changed in place: several fields in one line become several lines, a field of several names
        several fields.
    """
    apart: list[str] = []
    for line in lines:
        first, *more = _FIELD.split(line)
        indent = " " * (len(line) - len(line.lstrip()))
        parts = [first, *(indent + part for part in more)]
        if more and not first.lstrip().startswith(":"):
            parts.insert(1, "")  # a field list begins after an empty line
        apart += parts
    named: list[str] = []
    for line in apart:
        found = _SEVERAL.match(line)
        if found is None:
            named.append(line)
            continue
        indent, kind, names, text = found.groups()
        *before, last = names.split(", ")
        named += [f"{indent}:{kind} {one}: as {last}" for one in before] + [f"{indent}:{kind} {last}:{text}"]
    for place in range(len(named) - 1, 0, -1):
        if named[place - 1].startswith(":") and named[place].strip() and not named[place].startswith((":", " ")):
            named.insert(place, "")  # and ends with one
    lines[:] = [_BAR.sub(r"\\|", line) for line in named]


def write_made_pages(app: Any) -> None:
    """Write the pages that code makes: the help of every command, the public names.

    :param app: Sphinx; the pages lie beside those made of docstrings.
    """
    folder = DOCS / "reference" / "api"
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (("commands", command_reference()), ("names", public_names())):
        page = folder / f"{name}.md"
        if not page.is_file() or page.read_text(encoding="utf-8") != text:  # else Sphinx would read it again
            page.write_text(text, encoding="utf-8")


def public_names() -> str:
    """What ``import haptics`` offers.

    :return: Markdown, a row for each name, with its first line and a link to where it is documented.
    """
    import haptics

    rows = ["# What `import haptics` offers", "", "| name | what it is |", "| --- | --- |"]
    for name in sorted(haptics.__all__):
        one = getattr(haptics, name)
        if callable(one) and hasattr(one, "__module__"):
            first = (one.__doc__ or "").strip().split("\n")[0].replace("|", "\\|").replace("``", "`")
            rows.append(f"| {{py:obj}}`haptics.{name} <{one.__module__}.{one.__qualname__}>` | {first} |")
        else:
            rows.append(f"| `haptics.{name}` | |")
    return "\n".join(rows) + "\n"


def command_reference() -> str:
    """The help of every command.

    :return: Markdown, a section for each command.
    """
    import typer

    from haptics.cli.commands import add_installed_commands, app

    add_installed_commands()
    parts = [
        "# Every command and option",
        "As `haptics COMMAND --help` prints it. Exit codes: 0 fine, 1 a limit or a check failed, 2 usage or set-up.\n",
    ]

    def walk(command: Any, parent: Any, name: str) -> None:
        context = typer.Context(command, info_name=name, parent=parent, max_content_width=100, terminal_width=100)
        for word, one in sorted(getattr(command, "commands", {}).items()):
            walk(one, context, word)
        if not hasattr(command, "commands"):
            parts.append(f"## {context.command_path}\n\n```text\n{command.get_help(context).strip()}\n```\n")

    walk(typer.main.get_command(app), None, "haptics")
    return "\n".join(parts)

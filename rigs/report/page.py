"""One self-contained page: nothing is fetched, so that it can be mailed, and looks the same in ten years."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

from haptics.errors import InputError
from haptics.extras import install
from rigs.report.figures import svg_text
from rigs.result import Plot


@dataclass(frozen=True)
class Table:
    """A table of text.

    :param title: above it.
    :param head: names of the columns.
    :param rows: cells, each row as long as ``head``; None is shown as a dash.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[Any]]


@dataclass(frozen=True)
class Picture:
    """A PNG picture and what it shows.

    :param caption: what it shows.
    :param png: the file's bytes.
    """

    caption: str
    png: bytes

    @property
    def source(self) -> str:
        """The picture itself, as an address."""
        return f"data:image/png;base64,{b64encode(self.png).decode()}"


@dataclass(frozen=True)
class Block:
    """One part of a page, shown in the order of the fields.

    :param title: heading.
    :param text: paragraphs.
    :param warnings: shown apart, in red.
    :param tables: may be empty.
    :param plots: curves; may be empty.
    :param pictures: may be empty.
    """

    title: str
    text: Sequence[str] = ()
    warnings: Sequence[str] = ()
    tables: Sequence[Table] = ()
    plots: Sequence[Plot] = ()
    pictures: Sequence[Picture] = ()


@dataclass(frozen=True)
class Page:
    """One page.

    :param title: heading and title of the window.
    :param summary: a sentence below it.
    :param blocks: parts, in their order.
    :param provenance: what it was made with, for the foot of the page.
    """

    title: str
    summary: str
    blocks: Sequence[Block]
    provenance: Mapping[str, Any] = field(default_factory=dict)


def render_page(page: Page) -> str:
    """The page as HTML.

    :param page: to render.
    :return: one HTML file that fetches nothing.
    :raises InputError: jinja2 or matplotlib is not installed.
    """
    try:
        from jinja2 import Environment, StrictUndefined
    except ImportError as error:
        raise InputError(f"pages need jinja2; install with: {install('report')}") from error
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(files("rigs.report").joinpath("page.html").read_text(encoding="utf-8"))
    figures = {plot.name: svg_text(plot) for block in page.blocks for plot in block.plots}
    return template.render(page=page, figures=figures, cell=_cell)


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)

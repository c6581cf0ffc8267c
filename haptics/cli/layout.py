"""Tables for people: columns where they fit without breaking a word or a number, one value a line where they do not."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from haptics.units import engineering

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

_ENDINGS = {
    **{"v": "V", "n": "N", "j": "J", "w": "W", "a": "A", "k": "K", "f": "F", "c": "C", "hz": "Hz", "deg": "deg", "m": "m"},
    **{"s": "s", "ms": "ms", "us": "µs", "mm": "mm", "m2": "m²", "cm2": "cm²", "n_m": "N m", "m_s": "m/s", "v_per_um": "V/µm"},
    **{"n_per_m": "N/m", "per_min": "1/min", "s_per_s": "s/s"},
}
"""Units as names end in them."""
_SYMBOLS = set(_ENDINGS.values()) | {"J/m²", "A²s", "kV", "%", "h"}
_BESIDE, _EDGES = 3, 1  # characters that rich draws beside each column, and once


def quantity(name: str, value: Any) -> tuple[str, str]:
    """A name and its value for a person: ``energy_j, 0.000012`` is ``energy, 12 µJ``.

    :param name: with the unit at its end, if it has one.
    :param value: anything; only numbers are written with a unit.
    :return: the name without the unit, and the value with it; both as they are where there is none.
    """
    if isinstance(value, bool | str):
        return name, cell(value)
    if name == "volts":
        return name, cell(value, "V")
    for ending in sorted(_ENDINGS, key=len, reverse=True):
        if name.endswith(f"_{ending}"):
            return name[: -len(ending) - 1], cell(value, _ENDINGS[ending])
    return name, cell(value)


def cell(value: Any, unit: str = "") -> str:
    """What stands for a value.

    :param value: a float gets four significant digits, a list commas, None a dash.
    :param unit: of a number.
    :return: one line of text.
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) or (unit and isinstance(value, int)):
        return engineering(value, unit)
    if isinstance(value, list | tuple):
        return ", ".join(cell(one, unit) for one in value) or "-"
    return "-" if value is None else str(value)


def layout(title: str, head: Iterable[str], rows: Iterable[Iterable[Any]], width: int) -> Table | Text:
    """A table if it fits, else its rows as lines ``name: value``.

    :param title: stands above.
    :param head: names of the columns; a unit at the end of one moves into its cells.
    :param rows: values, as many in each as there are names.
    :param width: characters in a line.
    :return: what rich prints.
    """
    columns = [_head(name) for name in head]
    names = [name for name, _ in columns]
    cells = [[cell(value, unit) for value, (_, unit) in zip(row, columns, strict=True)] for row in rows]
    widths = _widths([names, *cells], width)
    if widths is None:
        return _lines(title, names, cells, width)
    from rich.table import Table

    table = Table(title=title, title_justify="left", header_style="bold")
    for name, wide in zip(names, widths, strict=True):
        table.add_column(name, width=wide, overflow="fold")
    for row in cells:
        table.add_row(*row)
    return table


def _head(name: str) -> tuple[str, str]:
    """A column's name and its unit."""
    for symbol in sorted(_SYMBOLS, key=len, reverse=True):
        if name.endswith(f" {symbol}"):
            return name.removesuffix(symbol).rstrip(" ,"), symbol
    return name, ""


def _widths(rows: Sequence[Sequence[str]], width: int) -> list[int] | None:
    """How wide each column is: as it would like, or at least so wide that no word breaks; None if that is too much."""
    from rich.cells import cell_len

    least = [max(cell_len(word) for text in column for word in (text.split() or [""])) for column in zip(*rows, strict=True)]
    wanted = [max(cell_len(line) for text in column for line in text.split("\n")) for column in zip(*rows, strict=True)]
    free = width - _EDGES - _BESIDE * len(least) - sum(least)
    if free < 0:
        return None
    found = list(least)
    for place in sorted(range(len(found)), key=lambda one: wanted[one] - least[one]):  # those that lack little first
        waiting = sum(1 for one in range(len(found)) if wanted[one] - least[one] >= wanted[place] - least[place])
        more = min(wanted[place] - least[place], free // max(waiting, 1))
        found[place] += more
        free -= more
    return found


def _lines(title: str, names: Sequence[str], rows: Iterable[Sequence[str]], width: int) -> Text:
    from rich.text import Text

    lines = [title]
    for row in rows:
        if len(row) == 2:
            lines += _line(row[0], row[1], "", width)
        else:
            lines += _line(names[0], row[0], "", width)
            lines += [line for name, text in zip(names[1:], row[1:], strict=True) for line in _line(name, text, "  ", width)]
    return Text("\n".join(lines), no_wrap=True, overflow="ignore")


def _line(name: str, text: str, indent: str, width: int) -> list[str]:
    return textwrap.wrap(
        f"{name}: {text}",
        max(width, 20),
        initial_indent=indent,
        subsequent_indent=f"{indent}    ",
        break_long_words=False,
        break_on_hyphens=False,
    )

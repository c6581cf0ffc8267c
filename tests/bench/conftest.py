"""The table that a run of benchmarks prints at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

Row = Callable[[str, str, str], None]


@pytest.fixture(scope="module")
def row() -> Iterator[Row]:
    """Takes a line of the table that is printed at the end: what, its figure, its bound."""
    lines = [("", "measured", "bound")]
    yield lambda what, figure, bound: lines.append((what, figure, bound))
    print("\n\n" + "\n".join(f"{what:<76}{figure:>16}{bound:>14}" for what, figure, bound in lines))

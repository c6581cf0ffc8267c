"""How commands print: one JSON object, or a table for people."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from haptics.cli.layout import layout, quantity
from haptics.errors import HapticsError, InputError, nearest

_PIPED_WIDTH = 160


def plain(value: Any) -> Any:
    """``value`` as plain JSON data; what is not finite becomes null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [plain(v) for v in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    tolist = getattr(value, "tolist", None)  # arrays and numpy's numbers
    if callable(tolist):
        return plain(tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


@contextmanager
def printing() -> Iterator[None]:
    """What is printed in it is out when it is left.

    :raises HapticsError: it cannot be: the pipe was closed, the disk behind it is full.
    """
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        why = "it was closed" if isinstance(error, BrokenPipeError) else error.strerror or error
        raise HapticsError(f"standard output cannot be written: {why}") from error


def print_json(value: Any) -> None:
    """One JSON object on standard output."""
    text = json.dumps(plain(value), indent=2, allow_nan=False)
    with printing():
        print(text)


def print_pairs(title: str, pairs: Mapping[str, Any]) -> None:
    """A titled two-column table of names and values; a unit at the end of a name moves to its value."""
    print_table(title, ("quantity", "value"), (quantity(name, value) for name, value in pairs.items()))


def print_table(title: str, head: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """A table for people, as wide as the terminal; into a file or pipe, as wide as it needs."""
    from rich.console import Console

    class Plain(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    with printing():
        console = Plain(width=None if sys.stdout.isatty() or "COLUMNS" in os.environ else _PIPED_WIDTH)
        console.print(layout(title, head, rows, console.width), highlight=False)


def chosen_levels(pairs: list[str] | None) -> dict[str, str]:
    """``MODEL=LEVEL`` arguments as a mapping.

    :raises InputError: no such pair, an unknown model or level, or a model named twice.
    """
    from haptics.fidelity.plan import LADDERS

    chosen: dict[str, str] = {}
    for pair in pairs or ():
        model, found, level = pair.partition("=")
        if not found or model in chosen:
            raise InputError(f"level = {pair!r}; expected MODEL=LEVEL, once for each model, such as latch=dynamic")
        if model not in LADDERS:
            known = f"{', '.join(LADDERS)}{nearest(model, tuple(LADDERS))}"
            raise InputError(f"level = {pair!r}: there is no model {model!r} with levels; expected {known}")
        if level not in LADDERS[model]:
            known = f"{', '.join(LADDERS[model])}{nearest(level, LADDERS[model])}"
            raise InputError(f"level = {pair!r}: {model} has no level {level!r}; expected {known}")
        chosen[model] = level
    return chosen


def progress_unless(silent: bool) -> Callable[[str], None]:
    """Shows what is being done on standard error, where a person looks at it."""
    shown = not silent and sys.stderr.isatty()

    def progress(what: str) -> None:
        if shown:
            print(f"\r\033[K{what} ...", end="", file=sys.stderr, flush=True)

    return progress


def name_leftovers(folder: Path) -> None:
    """Names on standard error which journals sessions left in a folder where another is about to begin, and what saves them."""
    from haptics.recording.leftovers import left_journal, leftovers

    for journal in leftovers(folder):
        with suppress(OSError):
            print(f"haptics: {left_journal(journal)}", file=sys.stderr)


def note_first_start() -> None:
    """Explain, where a person looks at it, why a first start takes longer: inner loops are compiled once, and kept."""
    import haptics.physics

    kept = [Path(os.environ.get("NUMBA_CACHE_DIR") or folder) for folder in haptics.physics.__path__]
    if sys.stderr.isatty() and not any(next(folder.rglob("*.nbi"), None) for folder in kept):
        print("note: first start: compiling the physics for this machine, half a minute; later starts skip it", file=sys.stderr)

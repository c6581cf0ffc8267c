"""``haptics link identify`` and ``haptics link monitor``: who is there, and how the line does. Neither arms anything."""

from __future__ import annotations

import dataclasses
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from haptics.cli.layout import layout, quantity
from haptics.cli.show import plain, print_json, print_pairs
from haptics.link.messages import DEFAULT_BAUD
from haptics.units import in_range, whole_number

if TYPE_CHECKING:
    from haptics.link_trial.monitor import Look

_PORT = typer.Option("--port", help="the board: sim://tactiles, /dev/ttyACM0, ...")
_BAUD = typer.Option("--baud", help="rate of the line, baud")
_JSON = typer.Option("--json", help="print one JSON object")


def identify(
    port: Annotated[str, _PORT],
    baud: Annotated[int, _BAUD] = DEFAULT_BAUD,
    json: Annotated[bool, _JSON] = False,
) -> None:
    """Report which board is behind a port, or why none answers."""
    from haptics.link_trial.monitor import identify as ask

    who = ask(port, bauds(baud))
    if json:
        print_json(who)
    else:
        print_pairs("board", plain(who))


def monitor(
    port: Annotated[str, _PORT],
    for_s: Annotated[float | None, typer.Option("--for-s", help="end after so many seconds [default: when interrupted]")] = None,
    baud: Annotated[int, _BAUD] = DEFAULT_BAUD,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object at the end")] = False,
) -> None:
    """Watch a board and its line: state, faults, clock, telemetry, what was lost. Exit code 1: the link was lost."""
    from haptics.link.runner import connect
    from haptics.link_trial.monitor import Monitor, close, open_link

    if for_s is not None:
        in_range("for-s", for_s, 0.0, float("inf"), "s")
    runner, link = open_link(port, bauds(baud))
    try:
        connect(runner)
        watched = Monitor(runner, link, baud)
        last = _watch(watched, for_s, live=not json and sys.stdout.isatty())
    finally:
        close(runner, link)
    if json:
        print_json(last)
    else:
        print_pairs("link", _rows(last))
    if last.error is not None:
        print(f"haptics: {last.error}", file=sys.stderr)
        raise typer.Exit(1)


def bauds(baud: int) -> int:
    """The rate of a line, checked here since a port's own refusal would blame the port."""
    return whole_number("baud", baud, 50, 4_000_000)


def _watch(watched: Any, for_s: float | None, live: bool) -> Look:
    """Watch, with a table that follows where a person looks at it; ctrl-c ends it."""
    try:
        if not live:
            return watched.watch(for_s)
        from rich.live import Live

        with Live(refresh_per_second=10, transient=True) as screen:
            return watched.watch(for_s, lambda look: screen.update(_table(look, screen.console.width)))
    except KeyboardInterrupt:
        return watched.look()


def _rows(look: Look) -> dict[str, Any]:
    rows = {f.name: getattr(look, f.name) for f in dataclasses.fields(look)}
    rows["faults"] = look.faults or "none"
    rows["notes"] = look.notes[-5:] or "none"
    return {**rows, **{f.name: getattr(look.counters, f.name) for f in dataclasses.fields(look.counters)}, "counters": "below"}


def _table(look: Look, width: int) -> Any:
    rows = (quantity(name, value) for name, value in _rows(look).items())
    return layout(f"{look.port}, ctrl-c ends", ("quantity", "value"), rows, width)

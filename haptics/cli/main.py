"""The ``haptics`` command: arguments in, one library call, a table or ``--json`` out.

Exit codes: 0 fine, 1 a limit or a validation failed, 2 set-up or usage; ended by a signal, 128 and its number (130 Ctrl-C, 143
SIGTERM, 129 SIGHUP). Other packages add commands through the entry point group ``haptics.commands``: ``"group.name"`` adds
``name`` to the group, ``"name"`` adds it to the top.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib.metadata import entry_points
from typing import Any

import typer
from typer.core import TyperGroup

from haptics.cli import configuration, fidelity, garment, link, predict, recording, run
from haptics.ends import Ended, orderly, say
from haptics.errors import HapticsError, LimitError


class _Commands(TyperGroup):
    """Turns what ends a command into lines on standard error and an exit code, before typer has its own way with it."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except (HapticsError, KeyboardInterrupt, OSError) as error:
            _say_all(error)
            sys.exit(_exit_code(error))


app = typer.Typer(
    name="haptics",
    cls=_Commands,
    help="Wearable haptics, from a VR scene to volts on a wrist and back.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_groups = {
    "predict": predict.app,
    "link": link.app,
    "config": configuration.app,
    "recording": recording.app,
    "fidelity": fidelity.app,
    "garment": garment.app,
}
for _name, _group in _groups.items():
    app.add_typer(_group, name=_name)
app.command("run")(run.run)
app.command("scenes")(run.scenes)
app.command("replay")(recording.replay)
app.command("ports")(link.ports)
app.command("off")(link.off)


@cache  # once a process, however often main is called
def _add_installed_commands() -> None:
    for point in sorted(entry_points(group="haptics.commands"), key=lambda p: p.name):
        group, _, name = point.name.rpartition(".")
        (_groups[group] if group else app).command(name)(point.load())


def main() -> None:
    """Run the command line; errors meant for a person become lines on standard error, whoever asks to end it is obeyed."""
    _open_standard_streams()
    with orderly():
        code: Any = 0
        try:
            _add_installed_commands()
            app()
        except SystemExit as stop:
            code = stop.code
        except Ended as error:  # before or after the command itself
            say(error)
            code = error.exit_code
        sys.exit(_flushed(code))


def _exit_code(error: BaseException) -> int:
    if isinstance(error, Ended):
        return error.exit_code
    if isinstance(error, KeyboardInterrupt):
        return 130
    return 1 if isinstance(error, LimitError) else 2


def _say_all(error: BaseException) -> None:
    """What ended the command, and what that ended in its turn: a signal that came while a lost link was dealt with."""
    say(error)
    before = error.__context__
    if isinstance(error, KeyboardInterrupt) and isinstance(before, (HapticsError, KeyboardInterrupt, OSError)):
        _say_all(before)


def _flushed(code: Any) -> Any:
    """The exit code, once all output is out; that nobody can read it is an error too, and must not become a traceback later."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as error:
        if not code:
            why = "it was closed" if isinstance(error, (BrokenPipeError, ValueError)) else error.strerror or error
            say(OSError(f"standard output cannot be written: {why}"))
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - for the interpreter's own flush at its end
        return code or 2
    return code


def _open_standard_streams() -> None:
    """A stream that was closed before we began (``>&-``) takes what is printed and keeps it to itself."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115


if __name__ == "__main__":
    main()

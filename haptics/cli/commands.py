"""All commands of ``haptics``: arguments in, one library call, a table or ``--json`` out.

Exit codes: see ``haptics.cli.program``. Other packages add commands through the entry point group ``haptics.commands``:
``"group.name"`` adds ``name`` to the group, ``"name"`` adds it to the top.
"""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from typer.core import TyperGroup
from typer.main import get_command

from haptics.cli import calibration, configuration, fidelity, garment, hand, predict, recording, run
from haptics.cli.link import app as link
from haptics.cli.program import ENDINGS, ended_by
from haptics.cli.typed import Commands


class _Program(TyperGroup):
    """Turns what ends a command into lines on standard error and an exit code, before typer has its own way with it."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except ENDINGS as error:
            sys.exit(ended_by(error))


app = Commands(
    name="haptics",
    cls=_Program,
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
    "calibration": calibration.app,
    "recording": recording.app,
    "hand": hand.app,
    "fidelity": fidelity.app,
    "garment": garment.app,
}
for _name, _group in _groups.items():
    app.add_typer(_group, name=_name)
app.command("run")(run.run)
app.command("scenes")(run.scenes)
app.command("replay")(recording.replay)
app.command("calibrate")(calibration.calibrate)
app.command("ports")(link.ports)
app.command("off")(link.off)


@cache  # once a process, however often main is called
def add_installed_commands() -> None:
    """Add the commands that other installed packages offer, once."""
    for point in sorted(entry_points(group="haptics.commands"), key=lambda p: p.name):
        group, _, name = point.name.rpartition(".")
        (_groups[group] if group else app).command(name)(point.load())


@cache  # reading every command's signature takes longer than many a command
def _commands() -> Any:
    add_installed_commands()
    return get_command(app)


def command_line() -> None:
    """Run what the arguments of this process say."""
    _commands()()

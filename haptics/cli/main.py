"""The ``haptics`` command: arguments in, one library call, a table or ``--json`` out.

Exit codes: 0 fine, 1 a limit or a validation failed, 2 set-up or usage. Other packages add commands through the entry
point group ``haptics.commands``: ``"group.name"`` adds ``name`` to the group, ``"name"`` adds it to the top.
"""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import entry_points

import typer

from haptics.cli import configuration, fidelity, garment, link, predict, recording, run
from haptics.errors import HapticsError, LimitError

app = typer.Typer(
    name="haptics",
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
    """Run the command line; errors meant for a person become one line on standard error."""
    _add_installed_commands()
    try:
        app()
    except LimitError as error:
        print(f"haptics: {error}", file=sys.stderr)
        sys.exit(1)
    except HapticsError as error:
        print(f"haptics: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("haptics: interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()

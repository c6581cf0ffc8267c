"""``haptics ports``, ``haptics off`` and the ``haptics link`` group."""

from __future__ import annotations

from typing import Annotated

import typer

from haptics.cli.link.conformance import conformance
from haptics.cli.link.monitor import identify, monitor
from haptics.cli.link.stress import stress
from haptics.cli.show import print_json, print_table
from haptics.cli.typed import Commands

app = Commands(help="Look at serial links and boards, and try them.", no_args_is_help=True)
app.command("identify")(identify)
app.command("monitor")(monitor)
app.command("conformance")(conformance)
app.command("stress")(stress)


def ports(json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False) -> None:
    """List serial ports of this machine and the simulated boards."""
    from haptics.link.ports import list_ports

    found = list_ports()
    if json:
        print_json({"ports": found})
    else:
        print_table("ports", ("port", "what", "serial number"), ((p.url, p.description, p.serial_number) for p in found))
        if all(p.simulated for p in found):
            print("no serial port of this machine was found: is the board plugged in, and may you use it (group dialout, uucp)?")


def off(
    port: Annotated[list[str] | None, typer.Option("--port", help="port to make safe; repeat for more [default: all]")] = None,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Make every board that is found safe: nothing energised, disarmed.

    Exit code 0: every board named (or found) reported that it is off. 2: a named one did not. 1: one that was found did not.
    """
    from haptics.session.off import make_safe

    results = make_safe(port)
    safe = all(r.safe for r in results)
    if json:
        print_json({"safe": safe, "ports": results})
    else:
        rows = ((r.port, r.board, "NO" if not r.safe else "yes" if r.board else "no board", r.result) for r in results)
        print_table("off", ("port", "board", "safe", "result"), rows)
        if not results:
            print("no serial port of this machine was found")
    if not safe:
        raise typer.Exit(1 if port is None else 2)

"""``haptics ports``, ``haptics off`` and the ``haptics link`` group."""

from __future__ import annotations

from typing import Annotated

import typer

from haptics.cli.link_conformance import conformance
from haptics.cli.link_monitor import identify, monitor
from haptics.cli.link_stress import stress
from haptics.cli.show import print_json, print_table

app = typer.Typer(help="Serial links and boards.", no_args_is_help=True)
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


def off(
    port: Annotated[list[str] | None, typer.Option("--port", help="port to make safe; repeat for more [default: all]")] = None,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Make every board that is found safe: nothing energised, disarmed."""
    from haptics.session.off import make_safe

    results = make_safe(port)
    if json:
        print_json({"ports": results})
    else:
        print_table("off", ("port", "board", "result"), ((r.port, r.board, r.result) for r in results))
    if any(not r.safe for r in results):
        raise typer.Exit(1 if port is None else 2)

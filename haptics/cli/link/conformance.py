"""``haptics link conformance``: does a board keep the protocol?"""

from __future__ import annotations

from typing import Annotated

import typer

from haptics.cli.link.monitor import bauds
from haptics.cli.show import print_json, print_table, progress_unless
from haptics.link.messages import DEFAULT_BAUD


def conformance(
    port: Annotated[str, typer.Option("--port", help="the board: sim://tactiles, sim://brake?core=avr, /dev/ttyACM0, ...")],
    arm: Annotated[
        bool, typer.Option("--arm", help="on hardware: also the rules that arm it. OUTPUTS MOVE, up to 1000 V")
    ] = False,
    baud: Annotated[int, typer.Option("--baud", help="rate of the line, baud")] = DEFAULT_BAUD,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Hold a board against the protocol, rule by rule. A simulated board is armed; hardware only with --arm.

    Exit code 1: a rule was broken.
    """
    from haptics.link_trial.conformance import FAILED, NOT_APPLICABLE, OK, try_board

    report = try_board(port, arms=arm, baud=bauds(baud), progress=progress_unless(json))
    counts = {"passed": report.count(OK), "failed": report.count(FAILED), "not_applicable": report.count(NOT_APPLICABLE)}
    if json:
        print_json({"port": report.port, "identity": report.identity, "rules": report.rules, **counts})
    else:
        shown = [one for one in report.rules if one.result != NOT_APPLICABLE]
        print_table(
            f"conformance of {port}", ("rule", "result", "what", "seen"), ((r.id, r.result, r.title, r.seen) for r in shown)
        )
        print(f"{counts['passed']} passed, {counts['failed']} failed, {counts['not_applicable']} not applicable")
    if counts["failed"]:
        raise typer.Exit(1)

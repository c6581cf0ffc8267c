"""Make boards safe: whatever is found is told to stop, and asked whether it did.

Faults that latched are cleared if their cause is gone: this is how a person who has looked at a board hands it back. Arming
stays a separate step.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.errors import LinkError, NotABoard
from haptics.link.connection import Link
from haptics.link.ports import list_ports, open_port
from haptics.link.runner import RealtimeRunner, connect, finish
from haptics.link.session import LinkSession
from haptics.session.faults import fault_names


@dataclass(frozen=True, slots=True)
class Off:
    """One port's outcome. ``safe``: a board said it is off and no fault's cause is left, or there is no board there."""

    port: str
    board: str | None
    safe: bool
    result: str


def make_safe(ports: list[str] | None = None, timeout_s: float = 5.0) -> list[Off]:
    """Stop and disarm the boards on these ports, or on every real port found.

    :raises InputError: not a port's name.
    """
    named = ports is not None
    urls = ports if ports is not None else [port.url for port in list_ports() if not port.simulated]
    return [_stop(url, named, timeout_s) for url in urls]


def _stop(url: str, named: bool, timeout_s: float) -> Off:
    try:
        link = Link(open_port(url), LinkSession(None, url))
    except LinkError as error:
        return Off(url, None, False, str(error))
    with RealtimeRunner([link]) as runner:
        try:
            connect(runner, timeout_s=timeout_s)
            finish(runner, link.stop(runner.now_ns()), port=url)
            left = fault_names(finish(runner, link.send("disarm", now_ns=runner.now_ns()), port=url).detail or 0)
        except NotABoard as error:
            return Off(url, None, not named, str(error))
        except LinkError as error:
            return Off(url, None if link.board is None else link.board.name.lower(), False, str(error))
        board = link.board
        result = f"off; the cause of a latched fault is still there: {left}" if left else "off"
        return Off(url, None if board is None else board.name.lower(), not left, result)

"""Make boards safe: whatever is found is stopped, and asked whether it did.

A stop needs no more than a board that has identified itself, so it is sent even where the rest of the handshake fails. Faults
that latched are cleared if their cause is gone: this is how a person who has looked at a board hands it back. Arming stays a
separate step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from haptics.errors import InputError, LinkError, NotABoard
from haptics.link.connection import Link
from haptics.link.ports import list_ports, open_port
from haptics.link.readings import fault_names
from haptics.link.runner import RealtimeRunner, connect, finish
from haptics.link.session import LinkSession


@dataclass(frozen=True, slots=True)
class Off:
    """One port's outcome.

    :param port: its URL.
    :param board: ``tactiles`` or ``brake``, or None if none was found.
    :param safe: a board reported that it is off, and no fault's cause is left. A port that was found, not named, with no board
        behind it counts as safe too.
    :param result: in words.
    """

    port: str
    board: str | None
    safe: bool
    result: str


def make_safe(ports: Sequence[str] | None = None, timeout_s: float = 5.0) -> list[Off]:
    """Stop and disarm the boards on these ports, or on every real port found.

    One that fails, or whose name is none, keeps none of the others from being made safe.

    :param ports: URLs, each looked at once; every real port found if None.
    :param timeout_s: for the handshake with each board, s.
    :return: what became of each, in their order.
    """
    named = ports is not None
    urls = ports if ports is not None else [port.url for port in list_ports() if not port.simulated]
    return [_make_safe(url, named, timeout_s) for url in dict.fromkeys(urls)]


def _make_safe(url: str, named: bool, timeout_s: float) -> Off:
    try:
        link = Link(open_port(url), LinkSession(None, url))
    except (InputError, LinkError) as error:
        return Off(url, None, False, str(error))
    with RealtimeRunner([link]) as runner:
        try:
            left = _off(runner, link, timeout_s)
        except NotABoard as error:
            heard = link.session.counters.frames_in > 0  # whole frames come from a board, whatever else is wrong with the line
            return Off(url, None, not named and not heard, str(error))
        except LinkError as error:
            return Off(url, _name(link), False, str(error))
        result = f"off; the cause of a latched fault is still there: {left}" if left else "off"
        return Off(url, _name(link), not left, result)


def _off(runner: RealtimeRunner, link: Link, timeout_s: float) -> str:
    """Stop, then clear what has latched; returns the faults that stay.

    :raises LinkError: no board, or one that did not answer; it was stopped if it could be.
    """
    try:
        connect(runner, timeout_s=timeout_s)
    except LinkError:
        if link.error is None and link.identity is not None:
            finish(runner, link.stop(runner.now_ns()), port=link.name)
        raise
    finish(runner, link.stop(runner.now_ns()), port=link.name)
    disarmed = finish(runner, link.send("disarm", now_ns=runner.now_ns()), port=link.name)
    return ", ".join(fault_names(disarmed.detail or 0))


def _name(link: Link) -> str | None:
    return None if link.board is None else link.board.name.lower()

"""One tree of errors. Every message names the thing, the value seen, and what to do or what is expected.

``InputError`` is a ``ValueError``: something a caller handed in cannot be used.
``LinkError`` and its children: trouble on the wire, with the port, the command and what was seen.
``LimitError``: the request is well formed but a safety or validity limit forbids it.
"""

from __future__ import annotations

from typing import Any


class HapticsError(Exception):
    """Base of every error this package raises on purpose."""


class InputError(HapticsError, ValueError):
    """An argument or a file cannot be used; the message names it, its value, and what is expected."""


class LimitError(HapticsError):
    """A well-formed request was refused because of a limit (volts, heat, current, validity)."""


class GloveEnded(HapticsError):
    """The glove is closed, or the thread that served it ended; the message says why."""


class DeadManMissed(HapticsError):
    """The boards went without their host for longer than their dead-man, and made themselves safe."""


class LinkError(HapticsError):
    """Trouble on the wire.

    :param port: the port's URL or path.
    :param seen: what was observed, in words.
    :param command: the command under way, if any.
    :param advice: what a person can do about it.
    """

    def __init__(self, port: str, seen: str, command: str | None = None, advice: str | None = None):
        self.port, self.seen, self.command, self.advice = port, seen, command, advice
        about = f"{command}: " if command else ""
        hint = f"; {advice}" if advice else ""
        super().__init__(f"{port}: {about}{seen}{hint}")

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), str(self), self.__dict__)  # rigs run in other processes, and their errors come home


def _rebuilt(kind: type[LinkError], message: str, state: dict[str, Any]) -> LinkError:
    error = kind.__new__(kind, message)
    error.__dict__.update(state)
    return error


class LinkLost(LinkError):
    """The port went away: unplugged, closed by the peer, or the operating system failed it."""


class PortMissing(LinkError):
    """No such port."""


class PortBusy(LinkError):
    """The port is open elsewhere."""


class NotABoard(LinkError):
    """No haptics board was found behind the port: something else answers, or nothing does."""


class WrongFirmware(LinkError):
    """A board answered with another protocol version, message table, or kind of board."""


class CommandRefused(LinkError):
    """The board answered a command with a status other than ok.

    :param port: the port's URL or path.
    :param seen: what was observed, in words.
    :param command: the command's name.
    :param status: the board's, in lower case, such as ``interlock``.
    :param advice: what a person can do about it.
    """

    def __init__(self, port: str, seen: str, command: str, status: str, advice: str | None = None):
        self.status = status
        super().__init__(port, seen, command, advice)


class ReplyTimeout(LinkError):
    """A command got no reply after all its retries; whether it was carried out is unknown."""


class ClockUncertain(LinkError):
    """The estimate of the board's clock is too old or too loose to schedule by."""

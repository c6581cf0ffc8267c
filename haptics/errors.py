"""One tree of errors. Every message names the thing, the value seen, and what to do or what is expected.

``InputError`` is a ``ValueError``: something a caller handed in cannot be used.
``LinkError`` and its children: trouble on the wire, with the port, the command and what was seen.
``LimitError``: the request is well formed but a safety or validity limit forbids it.
"""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from math import inf
from typing import Any


class HapticsError(Exception):
    """Base of every error this package raises on purpose."""


class InputError(HapticsError, ValueError):
    """An argument or a file cannot be used; the message names it, its value, and what is expected."""


class OutOfRange(InputError):
    """A number lies outside its range; kept apart so that a command can name it in the unit that was typed.

    :ivar name: of the argument.
    :ivar value: the number given, in ``unit``.
    :ivar low: begin of the range, in ``unit``; -inf where there is no bound.
    :ivar high: its end, inf where there is none.
    :ivar unit: symbol, empty for a pure number.
    """

    def __init__(self, name: str, value: float, low: float, high: float, unit: str = ""):
        self.name, self.value, self.low, self.high, self.unit = name, value, low, high, unit
        suffix = f" {unit}" if unit else ""
        super().__init__(f"{name} = {_outside(value, low, high)}{suffix}; allowed {span(low, high, unit)}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name, self.value, self.low, self.high, self.unit)


def _outside(number: float, low: float, high: float) -> str:
    """A number that is outside a range, with as many digits as show that it is."""
    short = f"{number:g}"
    return f"{number!r}" if low <= float(short) <= high else short


def span(low: float, high: float, unit: str = "") -> str:
    """A range in words.

    :param low: its begin in ``unit``, -inf where there is none.
    :param high: its end, inf where there is none.
    :param unit: symbol, empty for a pure number.
    :return: such as ``0 to 100 ms``, ``at least 1 V`` or ``any finite number``.
    """
    suffix = f" {unit}" if unit else ""
    if high == inf:
        return f"at least {_plain(low)}{suffix}" if low != -inf else "any finite number"
    if low == -inf:
        return f"at most {_plain(high)}{suffix}"
    return f"{_plain(low)} to {_plain(high)}{suffix}"


def _plain(number: float) -> str:
    """Six digits, or as many as a number below ten thousand million has before its point: 1000000 rather than 1e+06."""
    return f"{number:.10g}" if 1e6 <= abs(number) < 1e10 else f"{number:g}"


def nearest(value: object, known: Sequence[str]) -> str:
    """What a mistyped name may have been meant for, as the end of a message.

    :param value: what was handed in.
    :param known: the names that there are.
    :return: such as ``; did you mean index_tip?``, or nothing where none is near.
    """
    found = get_close_matches(value[:60], known, 1) if isinstance(value, str) else []
    return f"; did you mean {found[0]}?" if found else ""


class NotOneOf(InputError):
    """A word is none of those there are; the nearest is suggested.

    :ivar name: of the argument.
    :ivar value: what was given.
    :ivar shown: how a message shows it.
    :ivar allowed: the words there are.
    """

    def __init__(self, name: str, value: object, shown: str, allowed: Sequence[str]):
        self.name, self.value, self.shown, self.allowed = name, value, shown, tuple(allowed)
        super().__init__(f"{name} = {shown} is not allowed; allowed: {', '.join(self.allowed)}{nearest(value, self.allowed)}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name, self.value, self.shown, self.allowed)


class UnknownArgument(InputError, TypeError):
    """A call names an argument that there is not; a ``TypeError`` like Python's own.

    :ivar function: what was called.
    :ivar name: of the argument.
    :ivar known: the arguments there are.
    """

    def __init__(self, function: str, name: str, known: Sequence[str]):
        self.function, self.name, self.known = function, name, tuple(known)
        super().__init__(
            f"{function}() has no argument {name!r}; known arguments: {', '.join(self.known)}{nearest(name, self.known)}"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.function, self.name, self.known)


class LimitError(HapticsError):
    """A well-formed request was refused because of a limit (volts, heat, current, validity)."""


class GloveEnded(HapticsError):
    """The glove is closed, the thread that served it ended, or the session on it is over; the message says why."""


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

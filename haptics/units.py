"""Checks of ranges with units, and the few physical constants the package shares. SI throughout."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Sequence
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from typing import ParamSpec, TypeVar

from haptics.errors import InputError, NotOneOf, OutOfRange, UnknownArgument, nearest as nearest, span

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")

VACUUM_PERMITTIVITY_F_PER_M = 8.8541878128e-12
STANDARD_GRAVITY_M_S2 = 9.80665


def in_range(name: str, value: float, low: float, high: float, unit: str = "") -> float:
    """A number in a range, both ends included; text that reads as a number is taken.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :param low: smallest value allowed, in ``unit``; ``-math.inf`` for any.
    :param high: largest value allowed, in ``unit``; ``math.inf`` for any.
    :param unit: for the message, such as ``V``; none if empty.
    :return: the value as a float, in ``unit``.
    :raises InputError: not a number, not finite, or outside the range; the message names all of it.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} = {brief(value)} is not a number; must be {span(low, high, unit)}") from error
    if not math.isfinite(number) or not low <= number <= high:
        raise OutOfRange(name, number, low, high, unit)
    return number


def number(name: str, value: object, low: float, high: float, unit: str = "") -> float:
    """As ``in_range``, of what is a number already: text that reads as one, a truth value or an array is refused too.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :param low: smallest value allowed, in ``unit``.
    :param high: largest value allowed, in ``unit``.
    :param unit: for the message; none if empty.
    :return: the value as a float, in ``unit``.
    :raises InputError: not a real number, not finite, or outside the range.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(f"{name} = {brief(value)} is not a number; must be {span(low, high, unit)}")
    return in_range(name, value, low, high, unit)  # type: ignore[arg-type]


def whole_number(name: str, value: object, low: int, high: int, unit: str = "") -> int:
    """A whole number in a range, both ends included.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :param low: smallest value allowed, in ``unit``.
    :param high: largest value allowed, in ``unit``.
    :param unit: for the message; none if empty.
    :return: the value as an int.
    :raises InputError: not an integer (2.0 is none, nor is True), or outside the range.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise InputError(f"{name} = {brief(value)} is not a whole number; must be {span(low, high, unit)}")
    if not low <= int(value) <= high:
        raise InputError(f"{name} = {brief(int(value))}{_suffix(unit)}; allowed {span(low, high, unit)}")
    return int(value)


def file_path(name: str, value: object) -> Path:
    """A path from text or a path: an integer would be taken for an open file.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :return: the path; whether a file is there is not looked at.
    :raises InputError: something else, empty, or with a zero byte in it.
    """
    if not isinstance(value, (str, os.PathLike)):
        raise InputError(f"{name} = {brief(value)} is no file name; expected text or a path")
    path = Path(value)  # type: ignore[arg-type]
    if not str(value):  # which would be the folder one is in
        raise InputError(f"{name} = {brief(value)} is empty; expected a file name")
    if "\0" in str(path):
        raise InputError(f"{name} = {brief(value)} has a zero byte in it; expected a file name")
    return path


def an_instance(name: str, value: object, kind: type, how: str) -> None:
    """Check what a value is.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :param kind: what it has to be.
    :param how: how one gets such a thing, for the message.
    :raises InputError: it is something else.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name} = {brief(value)} is of type {type(value).__name__}; expected a {kind.__name__}, {how}")


def truth(name: str, value: object) -> bool:
    """A truth value, which text and numbers are not: ``"false"`` would count as true.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :return: the value as a bool.
    :raises InputError: neither a bool nor numpy's.
    """
    if not isinstance(value, bool) and type(value).__name__ != "bool":  # numpy's own, which is no subclass
        raise InputError(f"{name} = {brief(value)} is no truth value; allowed: True, False")
    return bool(value)


def a_callable(name: str, value: object, arguments: str) -> None:
    """Check that a value can be called.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :param arguments: what it will be called with, in words, for the message.
    :raises InputError: it cannot.
    """
    if not callable(value):
        raise InputError(f"{name} = {brief(value)} cannot be called; expected a function of {arguments}")


def known_arguments(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Let a function answer an argument that it does not have with those that it has.

    :param function: of the public face.
    :return: the same, which raises ``UnknownArgument`` where Python would have raised a bare ``TypeError``.
    """
    known = tuple(name for name in inspect.signature(function).parameters if name not in ("self", "cls"))

    @wraps(function)
    def checked(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        for name in kwargs:
            if name not in known:
                *owner, called = function.__qualname__.removesuffix(".__init__").split(".")
                if owner and args:  # of the class that the caller knows, not the one that it has the method from
                    owner = [(args[0] if isinstance(args[0], type) else type(args[0])).__name__]
                raise UnknownArgument(".".join((*owner, called)), name, known)
        return function(*args, **kwargs)

    return checked


def one_of(name: str, value: object, allowed: Sequence[str]) -> str:
    """A name out of a few.

    :param name: of the argument as the caller typed it, for the message.
    :param value: what was handed in.
    :param allowed: the names.
    :return: the value.
    :raises InputError: it is none of them; the message lists them, and the nearest.
    """
    if not isinstance(value, str) or value not in allowed:
        raise NotOneOf(name, value, brief(value), allowed)
    return value


def brief(value: object) -> str:
    """A value that was handed in, for a message that names it.

    :param value: anything, also what fails to show itself.
    :return: its ``repr`` on one line of at most 60 characters.
    """
    try:
        text = " ".join(repr(value).split("\n"))
    except Exception:  # Python shows no integer of over 4300 digits, and an object's own repr may fail
        return f"a {type(value).__name__} that cannot be shown"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _suffix(unit: str) -> str:
    return f" {unit}" if unit else ""


_PREFIXES = ("p", "n", "µ", "m", "", "k", "M", "G")
_SCALED = {"V", "A", "W", "J", "N", "F", "C", "Hz", "Pa", "Ω"}
_SCALED_DOWN = {"s", "m"}
"""Nobody says kiloseconds."""


def engineering(value: float, unit: str = "", digits: int = 4) -> str:
    """A quantity as people write it, with the prefix that leaves one to three digits before the point.

    :param value: in ``unit``.
    :param unit: symbol; those that take no prefix (K, %, mm, kg, ...) keep their size.
    :param digits: significant ones, at most; at least two are shown.
    :return: such as ``1.0 kV``, ``2.547 nF``, ``20 ms``, ``0.486 K``.
    """
    if not math.isfinite(value):
        return "-"
    tier = 0
    if value and (unit in _SCALED or unit in _SCALED_DOWN):
        tier = math.floor(math.log10(float(f"{abs(value):.{digits - 1}e}")) / 3)
        tier = max(-4, min(tier, 3 if unit in _SCALED else 0))
    text = _significant(value / 1000.0**tier, digits)
    return f"{text} {_PREFIXES[tier + 4]}{unit}" if unit else text


def _significant(value: float, digits: int) -> str:
    """A number without an exponent where it can do without, at least two significant digits, no idle zeros."""
    if value == 0.0:
        return "0"
    if not 1e-4 <= abs(value) < 1e7:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}"
    before = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}")))) + 1
    text = f"{value:.{max(digits - before, 0)}f}"
    if "." in text:
        text = text.rstrip("0")
        least = len(text.partition(".")[0]) + 1 + max(2 - before, 0)
        text = text.ljust(least, "0") if before < 2 else text.rstrip(".")
    return text

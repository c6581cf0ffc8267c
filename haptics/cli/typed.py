"""Errors name what was typed: ``--pulse-ms = 20000 ms`` where the library, which counts in seconds, knows ``pulse_s = 20 s``.

An option is found by the name of the library's argument: the same name, the same name with another unit at its end, or the one
in ``_KNOWN_AS``.
"""

from __future__ import annotations

import re
from typing import Any

import typer
from typer.core import TyperCommand

from haptics.errors import HapticsError, InputError, LimitError, NotOneOf, OutOfRange, span

_UNITS = {
    "ms": ("ms", "s", 1e3),
    "s": ("s", "s", 1.0),
    "mm": ("mm", "m", 1e3),
    "um": ("µm", "m", 1e6),
    "m": ("m", "m", 1.0),
    "cm2": ("cm²", "m²", 1e4),
    "m2": ("m²", "m²", 1.0),
    "hz": ("Hz", "Hz", 1.0),
    "k": ("K", "K", 1.0),
    "n": ("N", "N", 1.0),
    "deg": ("deg", "deg", 1.0),
}
"""By the ending of a name: its symbol, the SI unit, and how many of it make one of that."""
_SYMBOLS = {"m^2": "m²", "m2": "m²", "degrees": "deg", "°": "deg"} | {symbol: symbol for symbol, _, _ in _UNITS.values()}
_KNOWN_AS = {
    "hz": ("frequency",),
    "sample_hz": ("sample_rate",),
    "burst_hz": ("cycle", "frequency"),
    "volts": ("amplitude",),
    "frames": ("commands",),
    "budget": ("budget_s_per",),
    "level": ("model",),
    "name": ("rig",),
    "rigs": ("rig",),
}
"""Options whose library argument has a name of its own, without its unit."""


class Command(TyperCommand):
    """A command whose errors speak of its options."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the options; a text that is no number is shown with what was expected.

        :param ctx: click's context of this call.
        :param args: the words after the command.
        :return: those that are left.
        :raises typer.BadParameter: an option cannot be read.
        """
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            for fault in getattr(error.__cause__, "errors", list)():
                expected = "a whole number" if fault["type"].startswith("int_") else "a number"
                if fault["type"].endswith("_parsing") or fault["type"] == "int_from_float":
                    error.message = f"{fault['input']!r}; expected {expected}"
            raise

    def invoke(self, ctx: Any) -> Any:
        """Run it.

        :param ctx: click's context of this call.
        :return: what the command returns.
        :raises HapticsError: as the command did, worded for whoever typed it.
        """
        try:
            return super().invoke(ctx)
        except (InputError, LimitError) as error:
            error.args = (as_typed(error, ctx),)
            raise


class Commands(typer.Typer):
    """A group of commands whose errors speak of their options; help is plain text, which no narrow terminal cuts."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(rich_markup_mode=None, **settings)

    def command(self, name: str | None = None, **settings: Any) -> Any:
        """Add a command.

        :param name: as it is typed.
        :param settings: as for ``typer.Typer.command``.
        :return: the decorator that adds it.
        """
        return super().command(name, cls=Command, **settings)


def as_typed(error: HapticsError, ctx: Any) -> str:
    """An error's message for whoever typed the command.

    :param error: as the library raised it.
    :param ctx: click's context of the command.
    :return: the message; unchanged where it is about nothing that was typed.
    """
    text, given = str(error), [one for one in ctx.command.params if _given(one, ctx)]
    for option in given:
        value = str(ctx.params.get(option.name))
        if option.param_type_name == "option" and text.startswith((f"{value}: ", f"{value.partition('?')[0]}: ")):
            return f"{_shown(option)} = {text}"
    if not isinstance(error, OutOfRange | NotOneOf):
        return _NAME.sub(lambda found: _in_words(found, given if found[2] else ctx.command.params), text)
    option = next((one for one in given if _means(one, error.name)), None)
    if option is None:
        return text
    if isinstance(error, NotOneOf):
        return _shown(option) + text[len(error.name) :]
    unit, factor = _conversion(option.name, error.unit)
    typed = _typed(ctx.params.get(option.name), error.value * factor)
    suffix = f" {unit}" if unit else ""
    return f"{_shown(option)} = {typed:.10g}{suffix}; allowed {span(error.low * factor, error.high * factor, unit)}"


def _given(option: Any, ctx: Any) -> bool:
    """Whether it was typed: what a file or a URL holds may have the same name."""
    return getattr(ctx.get_parameter_source(option.name), "name", "") == "COMMANDLINE"


_NAME = re.compile(r"(?<![\w.'\"-])(\w+)( = |(?=\W|$))")


def _in_words(found: re.Match[str], options: list[Any]) -> str:
    """An argument's name in a message of words, as the option that it is; with a value behind it only in the same unit."""
    name, equals = found.groups()
    if not equals and "_" not in name:  # a word like any other
        return found[0]
    option = next((one for one in options if one.name == name or (not equals and _means(one, name))), None)
    return found[0] if option is None else _shown(option) + equals


def _means(option: Any, name: str) -> bool:
    name = name.partition(" of ")[0]  # such as "angle of elbow_flexion"
    return bool(name) and (option.name == name or _stem(name) in (_stem(option.name), *_KNOWN_AS.get(option.name, ())))


def _stem(name: str) -> str:
    stem, _, ending = name.replace("-", "_").rpartition("_")
    return stem if ending in _UNITS and stem else name.replace("-", "_")


def _shown(option: Any) -> str:
    return option.opts[0] if option.param_type_name == "option" else option.name.upper()


def _conversion(option: str, unit: str) -> tuple[str, float]:
    """The unit that an option is typed in, and how many of it make one of the library's ``unit``."""
    symbol, si, per_si = _UNITS.get(option.rpartition("_")[2], ("", "", 1.0))
    unit = _SYMBOLS.get(unit, unit)
    if unit == si and symbol != unit:
        return symbol, per_si
    return unit or symbol, 1.0


def _typed(given: Any, value: float) -> float:
    """The number as it was typed, of those given to an option that may be repeated; ``value`` is it but for rounding."""
    numbers = [one for one in (given if isinstance(given, list | tuple) else [given]) if isinstance(one, int | float)]
    return min(numbers, key=lambda one: abs(one - value), default=value)

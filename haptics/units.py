"""Checks of ranges with units, and the few physical constants the package shares. SI throughout."""

from __future__ import annotations

import math

from haptics.errors import InputError

VACUUM_PERMITTIVITY_F_PER_M = 8.8541878128e-12
STANDARD_GRAVITY_M_S2 = 9.80665


def in_range(name: str, value: float, low: float, high: float, unit: str = "") -> float:
    """``value`` as a float if ``low <= value <= high``.

    :raises InputError: not a number, not finite, or outside the range; the message names all of it.
    """
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} = {value!r} is not a number; allowed: {_span(low, high, unit)}") from error
    if not math.isfinite(number) or not low <= number <= high:
        raise InputError(f"{name} = {number:g}{_suffix(unit)} is not allowed; allowed: {_span(low, high, unit)}")
    return number


def one_of(name: str, value: str, allowed: tuple[str, ...] | list[str]) -> str:
    """``value`` if it is one of ``allowed``.

    :raises InputError: it is not; the message lists what is.
    """
    if value not in allowed:
        raise InputError(f"{name} = {value!r} is not allowed; allowed: {', '.join(allowed)}")
    return value


def _suffix(unit: str) -> str:
    return f" {unit}" if unit else ""


def _span(low: float, high: float, unit: str) -> str:
    if math.isinf(high):
        return f"at least {low:g}{_suffix(unit)}" if not math.isinf(low) else "any finite number"
    return f"{low:g} to {high:g}{_suffix(unit)}"

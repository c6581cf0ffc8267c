"""Laws that were fitted or measured over a range refuse to go past it, unless asked to with ``extrapolate=True``.

A law describes in words what about a question lies outside its range (``outside``); a prediction puts those words into its
answer, and a pure law that returns a bare number raises them. Equations without fitted constants of their own have no such range.
"""

from __future__ import annotations

from collections.abc import Sequence

from haptics.errors import InputError

ROUNDING = 1e-9
"""Relative departure from the end of a range that counts as rounding."""


def refuse_outside(asked: str, outside: Sequence[str], extrapolate: bool = False) -> None:
    """Raise what lies outside a law's range, unless it is meant.

    :param asked: the arguments as the caller names them, with values and units.
    :param outside: what lies outside, one sentence each; empty if nothing does.
    :param extrapolate: True: go past the range knowingly.
    :raises InputError: something lies outside, and ``extrapolate`` is False.
    """
    if outside and not extrapolate:
        raise InputError(f"{asked}: {'; '.join(outside)}; pass extrapolate=True to go past it knowingly")

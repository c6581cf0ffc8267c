"""What may be asked of a simulated board in its URL: ``sim://BOARD?key=value&...``.

Every key is declared once, with its unit and range, by the module that uses it; anything else is refused by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from haptics.errors import InputError, nearest
from haptics.link.port_url import query_of
from haptics.units import in_range, one_of


@dataclass(frozen=True)
class Option:
    """One key of a URL: a number within a range, a word of a choice, or what a reader makes of the text.

    :ivar default: value where the key is not given; None: drawn from the seed, or left to the model, as ``meaning`` states.
    :ivar meaning: a line on what the key sets, for listings.
    :ivar unit: of the number; empty: none.
    :ivar low: smallest number allowed.
    :ivar high: largest number allowed.
    :ivar whole: only whole numbers are allowed.
    :ivar choices: the words allowed; then it is no number.
    :ivar reader: makes the value of the text; then nothing else counts.
    """

    default: float | int | str | None
    meaning: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    whole: bool = False
    choices: tuple[str, ...] = ()
    reader: Callable[[str], Any] | None = None

    def parse(self, key: str, text: str) -> Any:
        """The value of ``text``.

        :param key: the key as it was typed, for messages.
        :param text: the value as it was typed.
        :return: a float, an int if ``whole``, one of the choices, or what the reader made.
        :raises InputError: no number, out of range, or not one of the choices.
        """
        if self.reader is not None:
            return self.reader(text)
        if self.choices:
            return one_of(key, text, self.choices)
        number = in_range(key, text, self.low, self.high, self.unit)  # type: ignore[arg-type]
        if not self.whole:
            return number
        if number != int(number):
            raise InputError(f"{key} = {text}; must be a whole number from {self.low:g} to {self.high:g}")
        return int(number)


def split_url(url: str) -> tuple[str, dict[str, str]]:
    """The parts of a URL ``sim://BOARD?key=value&key=value``.

    :param url: as it was typed.
    :return: board name, and values by key, all as text.
    :raises InputError: not such a URL, or a key given twice.
    """
    parts = urlsplit(url)
    if parts.scheme != "sim" or parts.path not in ("", "/") or parts.fragment:
        raise InputError(f"port = {url!r} is not a simulated board; expected sim://BOARD?key=value&key=value")
    return parts.netloc, query_of(url)


def parse_options(query: Mapping[str, str], allowed: Mapping[str, Option]) -> dict[str, Any]:
    """Values of all ``allowed`` keys, defaults included.

    :param query: texts by key, as they were typed.
    :param allowed: every key there is.
    :return: values by key.
    :raises InputError: unknown key, named with the nearest one there is, or a bad value of a known one.
    """
    for key in query:
        if key not in allowed:
            known = sorted(allowed)
            raise InputError(
                f"{key}={query[key]}: unknown key {key!r} in the port's URL; known keys: {', '.join(known)}{nearest(key, known)}"
            )
    return {key: option.parse(key, query[key]) if key in query else option.default for key, option in allowed.items()}

"""What may be asked of a simulated board in its URL: ``sim://BOARD?key=value&...``.

Every key is declared once, with its unit and range, by the module that uses it; anything else is refused by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from haptics.errors import InputError
from haptics.link.port_url import query_of
from haptics.units import in_range, one_of


@dataclass(frozen=True)
class Option:
    """One key: a number within ``low`` to ``high``, a whole one (``whole``), one of ``choices``, or what ``reader`` makes of it.

    ``default`` None means: drawn from the seed, or left to the model, as ``meaning`` says.
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
            raise InputError(f"{key} = {text} is not allowed; allowed: whole numbers from {self.low:g} to {self.high:g}")
        return int(number)


def split_url(url: str) -> tuple[str, dict[str, str]]:
    """Board name and raw query of ``sim://BOARD?...``.

    :raises InputError: not such a URL, or a key given twice.
    """
    parts = urlsplit(url)
    if parts.scheme != "sim" or parts.path not in ("", "/") or parts.fragment:
        raise InputError(f"port = {url!r} is not a simulated board; allowed: sim://BOARD?key=value&key=value")
    return parts.netloc, query_of(url)


def parse_options(query: Mapping[str, str], allowed: Mapping[str, Option]) -> dict[str, Any]:
    """Values of all ``allowed`` keys, defaults included.

    :raises InputError: unknown key, or a bad value of a known one.
    """
    for key in query:
        if key not in allowed:
            raise InputError(f"{key} = {query[key]!r}: no such key for this board; allowed: {', '.join(sorted(allowed))}")
    return {key: option.parse(key, query[key]) if key in query else option.default for key, option in allowed.items()}

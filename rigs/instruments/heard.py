"""What came from an instrument, for a diagnosis: silence, bytes without an end of line, or lines that mean nothing here."""

from __future__ import annotations

import re
from collections import deque

_QUOTED = 60
_LINES = 2
_DECIMAL_COMMA = re.compile(r"\d,\d")


class Heard:
    """Bytes and strange lines of one instrument; the last lines are kept, as the first are often a bootloader's."""

    def __init__(self) -> None:
        self.bytes_in = 0
        self._first = b""
        self._strange: deque[str] = deque(maxlen=_LINES)

    def take(self, data: bytes) -> None:
        """Bytes came.

        :param data: as read from the port.
        """
        self.bytes_in += len(data)
        if len(self._first) < _QUOTED:
            self._first = (self._first + data)[:_QUOTED]

    def strange(self, line: str) -> None:
        """A whole line came that is nothing known.

        :param line: without its end.
        """
        if line and line not in self._strange:
            self._strange.append(line)

    def in_words(self, expected: str, answered: bool = False) -> str:
        """What was seen instead of ``expected``, and what that suggests; ``answered``: it did say what it is.

        :param expected: what a line should look like, for the message.
        :param answered: the instrument did identify itself.
        :return: one sentence for an error message.
        """
        if self._strange:
            quoted = ", ".join(repr(line[:_QUOTED]) for line in self._strange)
            comma = any(_DECIMAL_COMMA.search(line) for line in self._strange)
            hint = " (a decimal comma? numbers have a point, and blanks between them)" if comma else ""
            return f"it prints {quoted}{hint}; expected {expected}"
        if answered:
            return f"nothing else came; expected {expected}"
        if self.bytes_in:
            return f"{self.bytes_in} bytes came without an end of line, beginning with {self._first!r}; is this its baud rate?"
        return "not one byte came; is it on, on this port, and at this baud rate?"

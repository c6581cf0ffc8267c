"""A large JSON object from a file nobody vouches for, piece by piece.

Text is read, and decompressed if it is gzip, in small chunks, and one value is decoded at a time, so that a file that unpacks
to gigabytes, nests a million deep or ends half way is refused early and in little memory.
"""

from __future__ import annotations

import codecs
import gzip
import json
import math
import re
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import NoReturn

from haptics.errors import InputError

LARGEST_FILE_BYTES = 256 << 20
"""Text beyond this is refused; some six minutes of two hands as a Leap Motion controller writes them."""
LARGEST_VALUE_CHARS = 1 << 20
"""One frame, or one other member of the object, is at most this long; a frame of two hands takes 8 thousand."""
MOST_MEMBERS = 100
"""The object has at most this many members; two are used."""
_CHUNK_BYTES = 256 << 10
_GZIP_MAGIC = b"\x1f\x8b"
_BLANK = re.compile(r"[ \t\r\n]*")


def read_members(path: Path, array: str) -> Iterator[tuple[str, int | None, object]]:
    """The members of the object in ``path`` as ``(name, None, value)``; those of the list ``array`` as ``(array, index, value)``.

    :raises InputError: not a file that can be read; not one JSON object; NaN or Infinity in it; a limit passed. The message
        names the place, what was seen and what is allowed.
    """
    try:
        if not path.is_file():
            what = "is a folder or a device" if path.exists() else "does not exist"
            raise InputError(f"it {what}; allowed: a file")
        plain = path.open("rb")
        with closing(plain):
            packed = plain.read(2) == _GZIP_MAGIC
            plain.seek(0)
            with gzip.open(plain) if packed else plain as file:
                yield from _Reader(file.read).members(array)
    except OSError as error:  # gzip's complaint about its header is one of these
        raise InputError(f"it cannot be read: {error}; allowed: JSON, plain or gzip") from error


class _Reader:
    """A window on the text that moves forward only."""

    def __init__(self, read: Callable[[int], bytes]):
        self._read = read
        self._decoder = json.JSONDecoder(parse_constant=self._note_constant)
        self._to_text = codecs.getincrementaldecoder("utf-8-sig")()
        self._window, self._at, self._before, self._bytes, self._ended = "", 0, 0, 0, False
        self._place, self._constant = "the file", ""

    def members(self, array: str) -> Iterator[tuple[str, int | None, object]]:
        self._expect("{", "the file")
        seen: set[str] = set()
        for _ in self._separated("}"):
            name = self._value("a member's name")
            if not isinstance(name, str):
                self._refuse(f"a member's name is {str(name)[:40]!r}; allowed: a string")
            if name in seen:
                self._refuse(f"{name[:40]!r} is given twice; allowed: once")
            if len(seen) == MOST_MEMBERS:
                self._refuse(f"the object goes on beyond the allowed {MOST_MEMBERS} members")
            seen.add(name)
            self._expect(":", name[:40])
            if name != array:
                yield name, None, self._value(name[:40])
                continue
            self._expect("[", array)
            for index, _ in enumerate(self._separated("]")):
                yield array, index, self._value(f"{array}[{index}]")
        self._place = "the end"
        if self._next():
            self._refuse(f"{self._next()!r} follows the object; allowed: nothing")

    def _separated(self, closing_mark: str) -> Iterator[None]:
        """Stop before each of the items between commas, up to the closing mark."""
        if self._next() == closing_mark:
            self._at += 1
            return
        while True:
            yield
            mark = self._next()
            if mark not in (",", closing_mark) or not mark:
                self._refuse(f"{mark!r} after it; allowed: ',' or {closing_mark!r}" if mark else "the file ends after it")
            self._at += 1
            if mark == closing_mark:
                return

    def _expect(self, mark: str, place: str) -> None:
        self._place = place
        seen = self._next()
        if seen != mark:
            self._refuse(f"{seen!r} seen; allowed: {mark!r}" if seen else f"the file ends; allowed: {mark!r}")
        self._at += 1

    def _next(self) -> str:
        """The next character that is not blank, left in place; empty at the end."""
        while True:
            blank = _BLANK.match(self._window, self._at)
            self._at = blank.end() if blank else self._at
            if self._at < len(self._window):
                return self._window[self._at]
            if not self._more():
                return ""

    def _value(self, place: str) -> object:
        self._place = place
        self._next()
        while True:
            left = len(self._window) - self._at
            self._constant = ""
            try:
                value, end = self._decoder.raw_decode(self._window, self._at)
            except RecursionError:
                self._refuse("lists or objects are nested too deeply; allowed: a frame's few levels")
            except json.JSONDecodeError as error:
                if left > LARGEST_VALUE_CHARS or not self._more():
                    self._refuse_text(error, left)
            except ValueError as error:  # an integer of thousands of digits
                self._refuse(f"a number cannot be read: {error}")
            else:
                # A number at the window's end may go on in the next chunk.
                if end < len(self._window) or not self._more():
                    if end - self._at > LARGEST_VALUE_CHARS:
                        self._refuse(f"it is longer than the allowed {LARGEST_VALUE_CHARS} characters")
                    if self._constant:
                        self._refuse_constant(value)
                    self._at = end
                    return value

    def _more(self) -> bool:
        """Drop what was used and append a chunk; false at the end of the file."""
        if self._ended:
            return False
        try:
            # As much again as a value in hand already takes, so that decoding it anew stays linear in its length.
            data = self._read(max(_CHUNK_BYTES, len(self._window) - self._at))
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            self._refuse(f"the gzip data is broken: {error}; allowed: whole gzip data")
        self._bytes += len(data)
        if self._bytes > LARGEST_FILE_BYTES:
            self._refuse(f"the text is longer than the allowed {LARGEST_FILE_BYTES >> 20} MiB")
        self._ended = not data
        try:
            text = self._to_text.decode(data, final=self._ended)
        except UnicodeDecodeError as error:
            self._refuse(f"byte {error.object[error.start]:#04x} is not UTF-8: {error.reason}")
        self._before += self._at
        self._window = self._window[self._at :] + text
        self._at = 0
        return not self._ended or bool(text)

    def _note_constant(self, name: str) -> float:
        self._constant = self._constant or name
        return math.nan

    def _refuse_constant(self, value: object) -> NoReturn:
        """NaN and Infinity are no JSON; say where the first one stands."""
        left = [(self._place, value)]
        while left:
            self._place, value = left.pop()
            if value != value:
                break
            if isinstance(value, dict):
                left += reversed([(f"{self._place}.{key}", part) for key, part in value.items()])
            elif isinstance(value, list):
                left += reversed([(f"{self._place}[{index}]", part) for index, part in enumerate(value)])
        self._refuse(f"{self._constant} is not allowed; allowed: finite numbers")

    def _refuse_text(self, error: json.JSONDecodeError, left: int) -> NoReturn:
        where = f"at character {self._before + error.pos}"
        if left > LARGEST_VALUE_CHARS:
            self._refuse(f"no JSON value of at most {LARGEST_VALUE_CHARS} characters: {error.msg} {where}")
        self._refuse(f"not JSON, or cut short: {error.msg} {where}")

    def _refuse(self, what: str) -> NoReturn:
        raise InputError(f"{self._place}: {what}")

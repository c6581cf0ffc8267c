"""Large JSON from an untrusted file, value by value.

What counts are the items of one list. It may be a member of an object, or stand alone, or its items may follow each other
without a list, as programs write that add a line for each. Text is read in pieces and one value is decoded at a time, so that
a file that unpacks to gigabytes, nests a million deep or is cut short is refused early and in little memory.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from haptics.errors import InputError
from haptics.scene.hand_files.foreign import READABLE
from haptics.scene.hand_files.text_source import Text, open_text

LARGEST_VALUE_CHARS = 1 << 20
"""One frame, another member, or what stands before the list is at most this long; a frame of two hands takes 8 thousand."""
MIN_PIECE_CHARS = 256 << 10
MAX_MEMBERS = 100
"""An object has at most this many members; two are used."""
_BLANK = re.compile(r"[ \t\r\n]*")


@dataclass(frozen=True, slots=True)
class Item:
    """One item of the list, or one object that stands by itself.

    :param place: where it is, such as ``frames[3]``.
    :param value: as parsed.
    :param broken: why ``value`` must not be used: it holds NaN or Infinity. Empty where it may be.
    """

    place: str
    value: object
    broken: str = ""


@dataclass(frozen=True, slots=True)
class Member:
    """Another member of the object that has the list.

    :param name: its key.
    :param value: as parsed.
    """

    name: str
    value: object


def read_items(path: Path, array: str) -> Iterator[Item | Member]:
    """Read a list item by item, and the members beside it.

    :param path: plain or gzip, in one of the forms named above.
    :param array: the list's key.
    :return: in the file's order; members that stand before the list come before its items.
    :raises InputError: not a file that can be read; not JSON of that form; NaN or Infinity in a member; a limit passed. The
        message names the place, what was seen and what is expected.
    """
    with open_text(path) as text:
        yield from _Reader(text).items(array)


class _Reader:
    """A window on the text that moves forward only."""

    def __init__(self, text: Text):
        self._text = text
        self._decoder = json.JSONDecoder(parse_constant=self._note_constant)
        self._window, self._at, self._before, self._ended = "", 0, 0, False
        self._place, self._constant = "the file", ""

    def items(self, array: str) -> Iterator[Item | Member]:
        mark, what = self._next(), "object"
        if mark and mark not in "{[":
            raise InputError(f"it begins with {mark!r}, so it is not JSON of frames; hands are read from: {READABLE}")
        if mark == "[":
            yield from self._list(array)
            what = "list"
        else:
            for number in itertools.count():
                has_list = yield from self._object(array, f"objects[{number}]")
                if has_list or not self._next():
                    break
        self._place = "the end"
        if self._next():
            self._refuse(f"{self._next()!r} follows the {what}; expected the end of the file")

    def _list(self, array: str) -> Iterator[Item]:
        self._expect("[", array)
        for index, _ in enumerate(self._separated("]")):
            place = f"{array}[{index}]"
            value = self._value(place)
            yield Item(place, value, self._broken(value))

    def _object(self, array: str, place: str) -> Generator[Item | Member, None, bool]:
        """The items of its list and its other members; or, of an object without that list, the whole as one item.

        Returns whether it has the list.
        """
        first = place == "objects[0]"
        self._expect("{", "the file" if first else place)
        began, has_list, broken = self._before + self._at, False, ""
        members: dict[str, object] = {}
        seen: set[str] = set()
        for _ in self._separated("}"):
            name = self._value("a member's name")
            if not isinstance(name, str):
                self._refuse(f"a member's name is {str(name)[:40]!r}; expected a string")
            if name in seen:
                self._refuse(f"{name[:40]!r} is given twice")
            if len(seen) == MAX_MEMBERS:
                self._refuse(f"the object goes on beyond the allowed {MAX_MEMBERS} members")
            seen.add(name)
            at = name[:40] if first else f"{place}.{name[:40]}"
            self._expect(":", at)
            if name == array:
                if broken:
                    raise InputError(broken)
                has_list = True
                yield from (Member(*member) for member in members.items())
                yield from self._list(array)
                continue
            members[name] = self._value(at)
            broken = broken or self._broken(members[name])
            if has_list:
                if broken:
                    raise InputError(broken)
                yield Member(name, members.pop(name))
            elif self._before + self._at - began > LARGEST_VALUE_CHARS:
                self._refuse(
                    f"the object goes on beyond the allowed {LARGEST_VALUE_CHARS} characters with no list {array!r} in it"
                )
        if not has_list:
            yield Item(place, members, broken)
        return has_list

    def _separated(self, closing_mark: str) -> Iterator[None]:
        """Stop before each of the items between commas, up to the closing mark."""
        if self._next() == closing_mark:
            self._at += 1
            return
        while True:
            yield
            mark = self._next()
            if mark not in (",", closing_mark) or not mark:
                self._refuse(f"{mark!r} after it; expected ',' or {closing_mark!r}" if mark else "the file ends after it")
            self._at += 1
            if mark == closing_mark:
                return

    def _expect(self, mark: str, place: str) -> None:
        self._place = place
        seen = self._next()
        if seen != mark:
            self._refuse(f"{seen!r} seen; expected {mark!r}" if seen else f"the file ends; expected {mark!r}")
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
                self._refuse("lists or objects are nested too deeply; a frame has a few levels")
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
                    self._at = end
                    return value

    def _more(self) -> bool:
        """Drop what was used and append a chunk; false at the end of the file."""
        if self._ended:
            return False
        try:
            # As much again as a value in hand already takes, so that decoding it anew stays linear in its length.
            text = self._text(max(MIN_PIECE_CHARS, len(self._window) - self._at))
        except InputError as error:
            self._refuse(str(error))
        self._ended = not text
        self._before += self._at
        self._window = self._window[self._at :] + text
        self._at = 0
        return not self._ended

    def _note_constant(self, name: str) -> float:
        self._constant = self._constant or name
        return math.nan

    def _broken(self, value: object) -> str:
        """NaN and Infinity are not JSON: where the first one stands in the value that was just read, or empty."""
        if not self._constant:
            return ""
        place, left = self._place, [(self._place, value)]
        while left:
            place, value = left.pop()
            if value != value:
                break
            if isinstance(value, dict):
                left += reversed([(f"{place}.{key}", part) for key, part in value.items()])
            elif isinstance(value, list):
                left += reversed([(f"{place}[{index}]", part) for index, part in enumerate(value)])
        return f"{place}: {self._constant} is not allowed; expected finite numbers"

    def _refuse_text(self, error: json.JSONDecodeError, left: int) -> NoReturn:
        where = f"at character {self._before + error.pos}"
        if left > LARGEST_VALUE_CHARS:
            self._refuse(f"not a JSON value of at most {LARGEST_VALUE_CHARS} characters: {error.msg} {where}")
        self._refuse(f"not JSON, or cut short: {error.msg} {where}")

    def _refuse(self, what: str) -> NoReturn:
        raise InputError(f"{self._place}: {what}")

"""lz-string, the compression that browsers' recorders use: LZ78 with a growing code, piece by piece and within bounds.

The stream is bits, first bit first; a number of ``n`` bits comes with its lowest bit first. Code 0 brings a new character of
8 bits, 1 one of 16, 2 ends the text; any other code names an entry of the dictionary, which gains ``w + first(entry)`` after
each code, ``w`` being the entry before. Codes are 2 bits wide for the first one, then 3, and one more whenever the dictionary
has filled what the width can name. What a file holds is that stream in one of these alphabets:

- *base64* (``compressToBase64``) and its form for addresses (``compressToEncodedURIComponent``): 6 bits a character;
- *utf16* (``compressToUTF16``): 15 bits a character, 32 added;
- *bytes* (``compressToUint8Array``): 8 bits a byte.

An entry is a stretch of the text so far, as ``w`` and what follows it always stand side by side there. So the dictionary is two
numbers an entry, and a file that unpacks to gigabytes is refused when it passes a limit.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable

from haptics.errors import InputError

LARGEST_TEXT_CHARS = 64 << 20
"""A text beyond this is refused: it must be kept whole, two bytes a character."""
MAX_ENTRIES = 8 << 20
"""The dictionary has at most this many entries, of eight bytes each; a text as long as allowed takes some six million."""

_LITERAL_BITS = {0: 8, 1: 16}
_END = 2
_RESERVED = 3
_UTF16_LOWEST = 32
_DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
_SIX_BITS = {digit: f"{value:06b}" for value, digit in enumerate(_DIGITS)}
_SIX_BITS |= {"-": _SIX_BITS["/"], "=": "000000", "$": "000000", **dict.fromkeys("\r\n\t", "")}
_IN_SIX_BITS = re.compile(r"[A-Za-z0-9+/=$\r\n\t-]*")
_STARTS_OF_JSON = frozenset("{[ \t\r\n")


def alphabet_of(head: str) -> str | None:
    """Whether a text can be lz-string of JSON.

    :param head: the beginning of the text.
    :return: the alphabet, ``base64`` or ``utf16``; None if it is something else.
    """
    if _IN_SIX_BITS.fullmatch(head) and _begins_json("".join(_SIX_BITS[char] for char in head[:4])):
        return "base64"
    if all(_UTF16_LOWEST <= ord(char) < _UTF16_LOWEST + 0x8000 for char in head) and head:
        return "utf16" if _begins_json(f"{ord(head[0]) - _UTF16_LOWEST:015b}") else None
    return None


def is_lz_bytes(head: bytes) -> bool:
    """Whether bytes can be lz-string, in the alphabet of bytes, of JSON without a blank before it.

    No UTF-8 text begins so.

    :param head: the beginning of the file, at least two bytes.
    :return: whether it can be.
    """
    return len(head) > 1 and head[1] & 0xC0 == 0x80 and _begins_json(f"{head[0]:08b}{head[1]:08b}")


def _begins_json(bits: str) -> bool:
    return len(bits) >= 10 and bits[:2] == "00" and chr(int(bits[9:1:-1], 2)) in _STARTS_OF_JSON


def bits_of_text(text: str, alphabet: str) -> str:
    """The bits that a piece of text stands for.

    :param text: of one alphabet.
    :param alphabet: ``base64`` or ``utf16``.
    :return: text of 0 and 1, 6 or 15 for each character.
    :raises InputError: a character that is not of the alphabet.
    """
    try:
        if alphabet == "base64":
            return "".join([_SIX_BITS[char] for char in text])
        return "".join([f"{_fifteen(char):015b}" for char in text])
    except KeyError as error:
        raise InputError(f"the lz-string data is broken: {error.args[0]!r} is not of its alphabet ({alphabet})") from None


def _fifteen(char: str) -> int:
    value = ord(char) - _UTF16_LOWEST
    if not 0 <= value < 0x8000:
        raise KeyError(char)
    return value


def bits_of_bytes(data: bytes) -> str:
    """The bits of a piece of the alphabet of bytes.

    :param data: the piece.
    :return: text of 0 and 1, 8 for each byte.
    """
    return "".join([f"{byte:08b}" for byte in data])


class LzString:
    """Unpacks one stream.

    :param more_bits: returns the next bits as text of 0 and 1; empty at the end of the file.
    """

    def __init__(self, more_bits: Callable[[], str]):
        self._more_bits = more_bits
        self._bits, self._at = "", 0
        self._text = array("H")
        self._starts, self._lengths = array("I"), array("I")
        self._given = 0
        self._width, self._room = 2, 1  # the room left in the dictionary before codes become wider
        self._before = (0, 0)  # start and length of w
        self._ended = False

    def read(self, chars: int) -> str:
        """Unpack the next characters.

        :param chars: so many at least, unless the text ends before.
        :return: UTF-16 code units as characters; empty at the end.
        :raises InputError: the data is broken or ends before its end mark, or a limit is passed.
        """
        while not self._ended and len(self._text) - self._given < chars:
            self._decode_one()
        piece, self._given = self._text[self._given :], len(self._text)
        return "".join(map(chr, piece))

    def _decode_one(self) -> None:
        code = self._take(self._width)
        if code == _END:
            self._ended = True
            return
        here, first = len(self._text), self._width == 2
        if here > LARGEST_TEXT_CHARS:
            raise InputError(f"the text in lz-string is longer than the allowed {LARGEST_TEXT_CHARS >> 10} Ki characters")
        start, length = self._before
        if code in _LITERAL_BITS:
            self._text.append(self._take(_LITERAL_BITS[code]))
            entry = (here, 1)
            self._remember(*entry)
        elif code - _RESERVED < len(self._starts):
            entry = self._starts[code - _RESERVED], self._lengths[code - _RESERVED]
            self._text.extend(self._text[entry[0] : entry[0] + entry[1]])
        elif code - _RESERVED == len(self._starts) and not first:  # the entry that this code itself completes
            entry = (start, length + 1)
            self._text.extend(self._text[start : start + length])
            self._text.append(self._text[start])
        else:
            raise InputError(f"the lz-string data is broken: code {code} names nothing in a dictionary of {len(self._starts)}")
        if not first:
            self._remember(start, length + 1)
        self._before = (here, entry[1])

    def _remember(self, start: int, length: int) -> None:
        if len(self._starts) >= MAX_ENTRIES:
            raise InputError(f"the lz-string dictionary is larger than the allowed {MAX_ENTRIES >> 20} Mi entries")
        self._starts.append(start)
        self._lengths.append(length)
        self._room -= 1
        if self._room == 0:
            self._room = 1 << self._width
            self._width += 1

    def _take(self, count: int) -> int:
        while len(self._bits) - self._at < count:
            more = self._more_bits()
            if not more:
                raise InputError("the lz-string data is cut short: it ends before its end mark; get the whole file")
            self._bits, self._at = self._bits[self._at :] + more, 0
        bits = self._bits[self._at : self._at + count]
        self._at += count
        return int(bits[::-1], 2)

"""The text of an untrusted file, piece by piece: gzip, lz-string and UTF-16 are recognised by content and undone.

The file's name does not matter, and nothing is read further than asked: what unpacks to gigabytes is refused at a limit.
"""

from __future__ import annotations

import codecs
import gzip
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from haptics.errors import InputError
from haptics.scene.hand_files.foreign import foreign_bytes, foreign_text
from haptics.scene.hand_files.lz_string import LzString, alphabet_of, bits_of_bytes, bits_of_text, is_lz_bytes

LARGEST_FILE_BYTES = 256 << 20
"""A file, unpacked if it is gzip, beyond this is refused; some six minutes of two hands as a Leap Motion controller has them."""
_HEAD_BYTES = 4096
_PACKED_BYTES = 64 << 10
_GZIP_MAGIC = b"\x1f\x8b"

Text = Callable[[int], str]
"""Gives about as many more characters as asked for, at least one; empty at the end."""


@contextmanager
def open_text(path: Path) -> Iterator[Text]:
    """Open a file's text, unpacked.

    :param path: plain, gzip or lz-string, UTF-8 or UTF-16.
    :return: a context manager; inside it, a function that reads piece by piece.
    :raises InputError: here or when read: not a file that can be read, something else (by its name where that is known), broken,
        cut short, or beyond a limit.
    """
    try:
        if not path.is_file():
            what = "is a folder or a device" if path.exists() else "does not exist"
            raise InputError(f"it {what}; expected a file")
        with path.open("rb") as plain:
            packed = plain.read(2) == _GZIP_MAGIC
            plain.seek(0)
            with gzip.open(plain) if packed else plain as file:
                yield _text_of(_Bytes(file.read))
    except OSError as error:  # gzip's complaint about its header is one of these
        raise InputError(f"it cannot be read: {error}") from error


def _text_of(data: _Bytes) -> Text:
    head = data.peek(_HEAD_BYTES)
    what = foreign_bytes(head)
    if what:
        raise InputError(what)
    if is_lz_bytes(head):
        return LzString(lambda: bits_of_bytes(data.read(_PACKED_BYTES))).read
    text = _Decoded(data, _encoding(head))
    start = text.peek()
    alphabet = alphabet_of(start)
    if alphabet is not None:
        return LzString(lambda: bits_of_text(text.read(_PACKED_BYTES), alphabet)).read
    what = foreign_text(start)
    if what:
        raise InputError(what)
    return text.read


def _encoding(head: bytes) -> str:
    """UTF-16 by its mark, or by the zero beside the first character of JSON; else UTF-8."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    zeros = [byte == 0 for byte in head[:2]]
    return {(False, True): "utf-16-le", (True, False): "utf-16-be"}.get((zeros[0], zeros[-1]), "utf-8-sig")


class _Bytes:
    """What the file holds, unpacked, up to the limit."""

    def __init__(self, read: Callable[[int], bytes]):
        self._read, self._ahead, self._count = read, b"", 0

    def peek(self, count: int) -> bytes:
        while len(self._ahead) < count and (more := self._next(count)):
            self._ahead += more
        return self._ahead[:count]

    def read(self, count: int) -> bytes:
        ahead, self._ahead = self._ahead, b""
        return ahead or self._next(count)

    def _next(self, count: int) -> bytes:
        try:
            data = self._read(count)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise InputError(f"the gzip data is broken: {error}; get the whole file") from error
        self._count += len(data)
        if self._count > LARGEST_FILE_BYTES:
            raise InputError(f"the text is longer than the allowed {LARGEST_FILE_BYTES >> 20} MiB")
        return data


class _Decoded:
    """Bytes as characters."""

    def __init__(self, data: _Bytes, encoding: str):
        self._data, self._ahead = data, ""
        self._decoder = codecs.getincrementaldecoder(encoding)()

    def peek(self) -> str:
        """The characters of the bytes that were looked at ahead."""
        self._ahead = self.read(_HEAD_BYTES)
        return self._ahead

    def read(self, count: int) -> str:
        text, self._ahead = self._ahead, ""
        while not text:
            data = self._data.read(count)
            try:
                text = self._decoder.decode(data, final=not data)
            except UnicodeDecodeError as error:
                raise InputError(
                    f"byte {error.object[error.start]:#04x} is not {error.encoding.upper()}: {error.reason}"
                ) from error
            if not data:
                break
        return text

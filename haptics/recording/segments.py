"""The journal's bytes: a magic line, then segments, each with its own checksum.

========  =====  =================================================================
offset    bytes  a segment
========  =====  =================================================================
0         4      marker ``SEG\\n``
4         1      kind, see :class:`Kind`
5         1      zero
6         2      stream number, counted from 0 in order of declaration
8         4      index of the segment in the file, counted from 0
12        4      length of the payload
16        4      CRC-32 (zlib's polynomial) of bytes 0..15 and the payload
20        n      payload
========  =====  =================================================================

All little-endian. The index makes a lost or repeated segment as visible as a flipped bit.
"""

from __future__ import annotations

import enum
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

MAGIC = b"haptics journal 1\n"
MAX_PAYLOAD_BYTES = 2**32 - 1
_MARKER = b"SEG\n"
_HEAD = struct.Struct("<4sBxHII")
_CRC = struct.Struct("<I")
HEAD_BYTES = _HEAD.size + _CRC.size


class Kind(enum.IntEnum):
    """What a segment's payload is."""

    HEADER = 1
    STREAM = 2
    ROWS = 3
    BLOB = 4
    FOOTER = 5


@dataclass(frozen=True)
class Segment:
    """A segment whose checksum was right.

    :ivar kind: a :class:`Kind`, or a number that is none.
    :ivar stream: number of the stream, from 0; 0 for other kinds.
    :ivar offset: of its payload, in bytes from the file's start.
    :ivar payload: its bytes.
    """

    kind: int
    stream: int
    offset: int
    payload: bytes


@dataclass(frozen=True)
class Damage:
    """Where reading stopped short of the file's end.

    :ivar offset: first byte that was not read, from the file's start.
    :ivar why: what was found there.
    :ivar torn: the file ends there, as it does where a writer died; else its bytes are not those that were written.
    """

    offset: int
    why: str
    torn: bool = False


def pack(kind: Kind, stream: int, index: int, payload: bytes | memoryview) -> tuple[bytes, bytes, bytes | memoryview]:
    """One segment, in the parts to write one after another.

    :param kind: what the payload is.
    :param stream: number of the stream, 0 to 65535; 0 for other kinds.
    :param index: of the segment in the file, from 0.
    :param payload: at most ``MAX_PAYLOAD_BYTES``; not copied.
    :return: head, checksum, payload.
    """
    head = _HEAD.pack(_MARKER, kind, stream, index, len(payload))
    return head, _CRC.pack(zlib.crc32(payload, zlib.crc32(head))), payload


def scan(file: BinaryIO) -> Iterator[Segment | Damage]:
    """Segments of an open journal from after its magic line, up to the first that is torn or wrong.

    Holds one payload at a time.

    :param file: open for reading, at any place.
    :return: the segments; the last item is a :class:`Damage` if bytes remain that are no good segment.
    """
    size = os.fstat(file.fileno()).st_size
    offset, index = len(MAGIC), 0
    file.seek(offset)
    while offset < size:
        if size - offset < HEAD_BYTES:
            yield Damage(offset, "the file ends inside a segment's head", torn=True)
            return
        head = file.read(_HEAD.size)
        (crc,) = _CRC.unpack(file.read(_CRC.size))
        marker, kind, stream, found, length = _HEAD.unpack(head)
        if marker != _MARKER:
            yield Damage(offset, "no segment starts here")
            return
        if length > size - offset - HEAD_BYTES:
            yield Damage(offset, "the file ends inside a segment's payload", torn=not _more(file))
            return
        payload = file.read(length)
        if zlib.crc32(payload, zlib.crc32(head)) != crc:
            yield Damage(offset, "wrong checksum")
            return
        if found != index:
            yield Damage(offset, f"segment {found} where {index} was due")
            return
        yield Segment(kind, stream, offset + HEAD_BYTES, payload)
        offset += HEAD_BYTES + length
        index += 1


def _more(file: BinaryIO) -> bool:
    """Whether a segment begins in what is left: then it was not the end of the file that was lost, but a length that is wrong."""
    kept = b""
    while piece := file.read(1 << 20):
        if _MARKER in kept + piece:
            return True
        kept = piece[-len(_MARKER) + 1 :]
    return False

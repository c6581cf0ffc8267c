"""Reading a journal: everything up to the first torn or wrong segment, and how much lies beyond it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.recording.segments import HEAD_BYTES, MAGIC, Damage, Kind, Segment, scan
from haptics.recording.streams import BLOB_NAME, StreamSpec

_HDF5 = b"\x89HDF"
"""How a recording begins."""


@dataclass
class JournalContents:
    """What a journal holds. Rows and attachments are read from the file when asked for, so it has to stay.

    :ivar path: the file.
    :ivar header: provenance, as the session wrote it; None if the file ends before it.
    :ivar footer: what the session wrote last; None unless it ended well.
    :ivar streams: what each stream's rows are, by name, in order of declaration.
    :ivar damage: where reading stopped and why, if it stopped before the file's end.
    :ivar dropped_bytes: how much of the file that leaves out.
    """

    path: Path
    header: dict[str, Any] | None = None
    footer: dict[str, Any] | None = None
    streams: dict[str, StreamSpec] = field(default_factory=dict)
    damage: Damage | None = None
    dropped_bytes: int = 0
    _rows: dict[str, list[tuple[int, int]]] = field(default_factory=dict, repr=False)
    _blobs: dict[str, tuple[int, int]] = field(default_factory=dict, repr=False)

    @property
    def complete(self) -> bool:
        """Whether the journal was closed and nothing is left out."""
        return self.footer is not None and self.damage is None

    @property
    def blobs(self) -> tuple[str, ...]:
        """Names of the attachments."""
        return tuple(self._blobs)

    def blob(self, name: str) -> bytes:
        """An attachment.

        :param name: one of ``blobs``.
        :return: its bytes.
        :raises InputError: there is none of that name.
        """
        if name not in self._blobs:
            raise InputError(f"{self.path} has no attachment {name!r}; it has {', '.join(self._blobs) or 'none'}")
        with self.path.open("rb") as file:
            return _part(file, *self._blobs[name])

    def count(self, name: str) -> int:
        """Number of rows of a stream.

        :param name: one of ``streams``.
        :return: rows.
        :raises KeyError: there is no such stream.
        """
        return sum(length for _, length in self._rows[name]) // self.streams[name].dtype.itemsize

    def batches(self, name: str) -> Iterator[NDArray[np.void]]:
        """The stream's rows, one committed segment at a time.

        :param name: one of ``streams``.
        :return: structured arrays ``(n,)``.
        :raises InputError: there is no such stream.
        """
        if name not in self.streams:
            raise InputError(f"{self.path} has no stream {name!r}; it has {', '.join(self.streams) or 'none'}")
        with self.path.open("rb") as file:
            for place in self._rows[name]:
                yield np.frombuffer(_part(file, *place), self.streams[name].dtype)

    def stream(self, name: str) -> NDArray[np.void]:
        """All rows of a stream.

        :param name: one of ``streams``.
        :return: structured array ``(n,)``, in the order they were recorded.
        :raises InputError: there is no such stream.
        """
        return np.concatenate([*self.batches(name), np.zeros(0, self.streams[name].dtype)])


def read_journal(path: str | os.PathLike[str]) -> JournalContents:
    """Check a journal from its start and list what it holds.

    Damage never raises: reading stops at the first torn or wrong segment. A file cut inside its first line reads as an
    empty journal.

    :param path: the file.
    :return: what it holds, up to where it is damaged.
    :raises InputError: there is no such file, it is a folder, or it is not a journal (with the place where it differs).
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            start = file.read(len(MAGIC))
            if start.startswith(_HDF5):
                raise InputError(f"{path} is an HDF5 file; expected a journal (.journal)")
            if not MAGIC.startswith(start):
                at = next(place for place, (seen, due) in enumerate(zip(start, MAGIC, strict=False)) if seen != due)
                raise InputError(f"{path} is not a haptics journal: byte {at} differs from its first line, {MAGIC!r}")
            contents = JournalContents(path)
            if len(start) < len(MAGIC):
                contents.damage = Damage(0, "the file ends inside its first line", torn=True)
            else:
                contents.damage = _fill(contents, file)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        if os.path.isdir(path):
            raise InputError(f"{path} is a folder; expected a journal (.journal)") from error
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    if contents.damage is not None:
        contents.dropped_bytes = size - contents.damage.offset
    return contents


def _fill(contents: JournalContents, file: BinaryIO) -> Damage | None:
    specs: list[StreamSpec] = []
    for segment in scan(file):
        if isinstance(segment, Damage):
            return segment
        try:
            _take(contents, specs, segment)
        except (
            ArithmeticError,
            AttributeError,
            LookupError,
            MemoryError,
            RecursionError,
            SyntaxError,
            TypeError,
            ValueError,
        ) as error:
            return Damage(segment.offset - HEAD_BYTES, f"a segment that makes no sense: {error}")
    return None if contents.header is not None else Damage(len(MAGIC), "the file ends before its header", torn=True)


def _take(contents: JournalContents, specs: list[StreamSpec], segment: Segment) -> None:
    if (segment.kind == Kind.HEADER) != (contents.header is None) or contents.footer is not None:
        raise ValueError("out of order")
    payload = segment.payload
    if segment.kind == Kind.HEADER:
        contents.header = _plain(payload)
    elif segment.kind == Kind.STREAM:
        spec = StreamSpec.from_json(_plain(payload))
        if segment.stream != len(specs) or spec.name in contents.streams:
            raise ValueError(f"stream {spec.name} is declared twice")
        specs.append(spec)
        contents.streams[spec.name] = spec
        contents._rows[spec.name] = []
    elif segment.kind == Kind.ROWS:
        spec = specs[segment.stream]
        if len(payload) % spec.dtype.itemsize:
            raise ValueError(f"not a whole number of {spec.name}")
        contents._rows[spec.name].append((segment.offset, len(payload)))
    elif segment.kind == Kind.BLOB:
        start = 2 + int.from_bytes(payload[:2], "little")
        if start > len(payload):
            raise ValueError("an attachment's name that ends beyond it")
        name = payload[2:start].decode()
        if not BLOB_NAME.fullmatch(name) or name in contents._blobs:
            raise ValueError(f"an attachment called {name[:40]!r}, or two of that name")
        contents._blobs[name] = (segment.offset + start, len(payload) - start)
    elif segment.kind == Kind.FOOTER:
        contents.footer = _plain(payload)
    else:
        raise ValueError(f"unknown kind {segment.kind}")


def _plain(payload: bytes) -> dict[str, Any]:
    data = json.loads(payload)
    if not isinstance(data, Mapping):
        raise ValueError("not a JSON object")
    return dict(data)


def _part(file: BinaryIO, offset: int, length: int) -> bytes:
    file.seek(offset)
    return file.read(length)

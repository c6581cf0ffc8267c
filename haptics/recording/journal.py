"""The journal: what a session writes while it runs, such that nothing acknowledged is lost when the process is killed.

Rows are copied into a buffer for each stream at once, so a row's arrays may be reused by the caller. ``commit`` hands all
buffered rows to the operating system in one write; from then on they are *acknowledged*. The same rows, committed at the
same places, give the same bytes: no clock is read here.

One thread at a time may use a journal and its streams.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from haptics.ends import unbroken
from haptics.errors import HapticsError, InputError
from haptics.recording.leftovers import refuse_leftover
from haptics.recording.lock import try_lock
from haptics.recording.segments import MAGIC, MAX_PAYLOAD_BYTES, Kind, pack
from haptics.recording.streams import BLOB_NAME, StreamSpec, is_unicode

ROWS_PER_SEGMENT = 1024


class Stream:
    """Rows of one kind on their way into a journal; from :meth:`Journal.stream`.

    :param journal: where they go.
    :param number: of the stream in the journal, from 0 in order of declaration.
    :param spec: what a row is.
    :param rows_per_segment: rows that the buffer holds, at least 1.
    """

    __slots__ = ("_buffer", "_bytes", "_count", "_journal", "number", "spec")

    def __init__(self, journal: Journal, number: int, spec: StreamSpec, rows_per_segment: int):
        self.spec, self.number = spec, number
        self._journal = journal
        self._buffer = np.zeros(rows_per_segment, spec.dtype)
        self._bytes = self._buffer.view(np.uint8).data
        self._count = 0

    def append(self, row: tuple[Any, ...] | np.void) -> None:
        """Buffer one row; commits the journal when the buffer is full.

        Text longer than its field is cut at a whole character; a single number fills an array field.

        :param row: its values in the fields' order.
        :raises InputError: values that do not fit the fields; nothing is buffered then.
        :raises HapticsError: the journal is closed or cannot be written.
        """
        count = self._count
        if count == len(self._buffer):
            self._journal.commit()
            count = self._count
            if count:  # it could not be written, and its writer goes on without
                return
        try:
            if not isinstance(row, (tuple, np.void)):
                raise TypeError("a row is a tuple")
            try:
                self._buffer[count] = row
            except UnicodeEncodeError:
                self._buffer[count] = self._encoded(row)
        except (TypeError, ValueError, OverflowError) as error:
            fields = ", ".join(self.spec.fields)
            raise InputError(f"stream {self.spec.name}: row = {row!r} does not fit the fields {fields}: {error}") from error
        self._count = count + 1

    def extend(self, rows: NDArray[Any]) -> None:
        """Append rows.

        :param rows: structured array ``(n,)`` with the stream's fields by name, in any order.
        :raises InputError: other fields, or not one-dimensional.
        :raises HapticsError: the journal is closed or cannot be written.
        """
        if rows.ndim != 1 or set(rows.dtype.names or ()) != set(self.spec.fields):
            raise InputError(
                f"stream {self.spec.name}: rows of shape {rows.shape} with fields {rows.dtype.names}; "
                f"expected one dimension and the fields {', '.join(self.spec.fields)}"
            )
        done = 0
        while done < len(rows):
            if self._count == len(self._buffer):
                self._journal.commit()
                if self._count:
                    return
            some = rows[done : done + len(self._buffer) - self._count]
            for name in self.spec.fields:  # by name: assignment of whole rows goes by position
                self._buffer[name][self._count : self._count + len(some)] = some[name]
            self._count += len(some)
            done += len(some)

    @property
    def buffered(self) -> int:
        """Rows not yet acknowledged."""
        return self._count

    def take(self) -> memoryview:
        """The buffered rows as they are written.

        :return: their bytes, valid until the next row.
        """
        return self._bytes[: self._count * self._buffer.itemsize]

    def acknowledge(self) -> None:
        """Forget the buffered rows: the operating system has them."""
        self._count = 0

    def _encoded(self, row: Any) -> tuple[Any, ...]:
        # numpy encodes text into S fields as ASCII only; anything else arrives here
        sizes = [self.spec.dtype[name].itemsize for name in self.spec.fields]
        return tuple(
            value.encode(errors="replace")[:size].decode(errors="ignore").encode() if isinstance(value, str) else value
            for value, size in zip(row, sizes, strict=True)
        )


class Journal:
    """An append-only file of checksummed segments; make one with :meth:`create`.

    As a context manager it closes without a footer: what is then in the file is whole, but only
    :func:`haptics.recording.recover` takes it, because nothing states that the session ended well.

    :param path: where it is.
    :param file: open for writing, empty, unbuffered.
    :param rows_per_segment: rows that a stream buffers before it commits by itself, at least 1.
    :param fsync: whether each commit also waits for the disk.
    :ivar raises: whether a write that fails raises. Code that makes a device safe sets it to False first: a full disk must not
        break that off. Then rows that find no place are dropped, and ``error`` holds the reason.
    """

    def __init__(self, path: Path, file: BinaryIO, rows_per_segment: int, fsync: bool):
        self.path = path
        """Where it is; elsewhere after closing if its folder was removed meanwhile."""
        self._file: BinaryIO | None = file
        self._rows_per_segment, self._fsync = rows_per_segment, fsync
        self._streams: dict[str, Stream] = {}
        self._blobs: set[str] = set()
        self._segments = 0
        self._length = 0
        self._torn = False
        self.raises = True
        self.error: HapticsError | None = None
        self.recording: Path | None = None
        """What was made of it when its session ended well."""

    @classmethod
    def create(
        cls,
        path: str | os.PathLike[str],
        header: Mapping[str, Any],
        *,
        force: bool = False,
        rows_per_segment: int = ROWS_PER_SEGMENT,
        fsync: bool = False,
    ) -> Journal:
        """Start a journal.

        :param path: the file to make (``.journal``).
        :param header: plain JSON data (provenance, arguments, seed, plan): the first segment.
        :param force: overwrite a file that holds nothing: one that was begun when its writer died. A journal with anything in it
            is the only copy of what happened, and is never overwritten.
        :param rows_per_segment: a stream with this many buffered rows commits by itself; at least 1.
        :param fsync: each commit also waits for the disk, so that it survives a loss of power (milliseconds each).
        :return: the journal, open and locked.
        :raises InputError: the file exists, is being written, cannot be made, or the header is not plain data.
        :raises HapticsError: the system cannot write; no file is left.
        """
        if rows_per_segment < 1:
            raise InputError(f"rows_per_segment = {rows_per_segment}; expected at least 1")
        path = Path(path)
        payload = _json("header", header)
        refuse_leftover(path, force)
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0) | (0 if force else os.O_EXCL)
        try:
            file = os.fdopen(os.open(path, flags, 0o666), "r+b", buffering=0)
        except OSError as error:
            raise InputError(f"{path}: the journal cannot be made: {error.strerror or error}") from error
        if not try_lock(file):
            file.close()
            raise InputError(f"{path}: another process is still writing this journal")
        file.truncate(0)
        journal = cls(path, file, rows_per_segment, fsync)  # type: ignore[arg-type]
        try:
            journal._write(b"".join((MAGIC, *pack(Kind.HEADER, 0, 0, payload))), 1)
        except HapticsError:
            file.close()
            path.unlink(missing_ok=True)
            raise
        return journal

    def stream(
        self,
        name: str,
        dtype: np.dtype[Any],
        units: Mapping[str, str] | None = None,
        description: str = "",
    ) -> Stream:
        """Declare a stream; see :class:`~haptics.recording.StreamSpec` for what a row may hold.

        :param name: lower-case letters, digits and ``_``.
        :param dtype: type of a row, its first field ``time_ns`` (int64).
        :param units: by field; fields without a unit left out. None: no field has one.
        :param description: a sentence on what it holds.
        :return: where to append rows.
        :raises InputError: the name is taken, or the fields or units cannot be recorded.
        """
        return self.declare(StreamSpec(name, dtype, units or {}, description))

    def declare(self, spec: StreamSpec) -> Stream:
        """Declare a stream by its specification.

        :param spec: what a row is.
        :return: where to append rows.
        :raises InputError: the name is taken.
        """
        if spec.name in self._streams:
            raise InputError(f"stream {spec.name!r} is declared twice in {self.path}")
        stream = Stream(self, len(self._streams), spec, self._rows_per_segment)
        self._put(Kind.STREAM, _json(f"stream {spec.name}", spec.as_json()), stream.number)
        self._streams[spec.name] = stream
        return stream

    def blob(self, name: str, data: bytes) -> None:
        """Attach a file (a configuration, a plan); acknowledged on return.

        :param name: up to 255 letters, digits and ``_ . -``.
        :param data: its bytes, fewer than 4 GiB.
        :raises InputError: the name is taken or is no plain file name, or the data is 4 GiB or more.
        """
        if not BLOB_NAME.fullmatch(name):
            raise InputError(f"attachment name = {name!r}; expected up to 255 letters, digits and _ . -")
        if name in self._blobs:
            raise InputError(f"attachment {name!r} is given twice in {self.path}")
        self._put(Kind.BLOB, len(name).to_bytes(2, "little") + name.encode() + data)
        self._blobs.add(name)

    def commit(self, fsync: bool | None = None) -> int:
        """Hand every buffered row to the operating system.

        :param fsync: wait for the disk too; by default as chosen in :meth:`create`.
        :return: how many rows that acknowledged.
        :raises HapticsError: closed, or the system cannot write (a full disk). The rows stay buffered, the file stays whole up to
            the last commit, and a later commit tries again.
        """
        full = [stream for stream in self._streams.values() if stream.buffered]
        rows = 0
        try:
            with unbroken:  # or what is in the file and what is still to be written would disagree
                if full:
                    parts = []
                    for index, stream in enumerate(full, self._segments):
                        parts += pack(Kind.ROWS, stream.number, index, stream.take())
                    self._write(b"".join(parts), len(full))
                for stream in full:
                    rows += stream.buffered
                    stream.acknowledge()
            if self._fsync if fsync is None else fsync:
                self._sync()
        except HapticsError as error:
            if self.raises:
                raise
            self.error = error
        return rows

    def close(self, footer: Mapping[str, Any] | None = None) -> None:
        """Commit, write the footer, which states that the session ended well, and close; twice is once.

        :param footer: plain JSON data; None: an empty one.
        :raises InputError: the footer is not plain data.
        :raises HapticsError: the system cannot write.
        """
        if self._file is None:
            return
        payload = _json("footer", footer or {})
        self.commit()
        self._put(Kind.FOOTER, payload)
        self._release()

    def abandon(self) -> None:
        """Commit and close without the footer: only :func:`haptics.recording.recover` takes what is there.

        :raises HapticsError: the system cannot write; it is closed all the same.
        """
        if self._file is not None:
            try:
                self.commit()
            finally:
                self._release()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.abandon()

    def _put(self, kind: Kind, payload: bytes, stream: int = 0) -> None:
        if len(payload) > MAX_PAYLOAD_BYTES:
            raise InputError(
                f"{self.path}: a {kind.name.lower()} of {len(payload)} bytes; a segment holds at most {MAX_PAYLOAD_BYTES}"
            )
        with unbroken:
            self._write(b"".join(pack(kind, stream, self._segments, payload)), 1)

    def _write(self, data: bytes, segments: int) -> None:
        file = self._open_file()
        left = memoryview(data)
        try:
            if self._torn:  # a torn segment would hide all that is written after it
                self._cut(file)
            self._torn = True
            while left:
                left = left[file.write(left) :]
        except OSError as error:
            with suppress(OSError):  # a disk that is gone does not even let itself be cut; the next write tries again
                self._cut(file)
            raise HapticsError(f"{self.path}: cannot write the journal: {error.strerror or error}") from error
        self._torn = False
        self._length += len(data)
        self._segments += segments

    def _cut(self, file: BinaryIO) -> None:
        file.seek(self._length)
        file.truncate(self._length)
        self._torn = False

    def _sync(self) -> None:
        try:
            os.fsync(self._open_file().fileno())
        except OSError as error:
            raise HapticsError(f"{self.path}: cannot write the journal: {error.strerror or error}") from error

    def _open_file(self) -> BinaryIO:
        if self._file is None:
            raise HapticsError(f"{self.path}: the journal is closed")
        return self._file

    def _release(self) -> None:
        file, self._file = self._open_file(), None
        with suppress(OSError):  # all is written, or is known not to be
            if not self.path.exists():
                self.path = _rescued(file, self.path)
            file.close()


def _rescued(file: BinaryIO, path: Path) -> Path:
    """A copy of a journal whose folder was removed while it was written: the system keeps it only until it is closed."""
    place = Path(tempfile.mkdtemp(prefix="haptics-")) / path.name
    file.seek(0)
    with place.open("wb") as copy:
        shutil.copyfileobj(file, copy)
    return place


def _json(what: str, data: Mapping[str, Any]) -> bytes:
    try:
        text = json.dumps(dict(data), sort_keys=True, allow_nan=False, ensure_ascii=False)
        return text.encode() if is_unicode(text) else json.dumps(dict(data), sort_keys=True, allow_nan=False).encode()
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} is not plain JSON data: {error}") from error

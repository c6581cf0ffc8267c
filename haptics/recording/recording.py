"""Reading a finished recording, stream by stream, as structured arrays.

A recording is held against its seal when it is opened: one that is damaged, or was changed since, is refused with the place.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.recording.hdf5 import SCHEMA
from haptics.recording.hdf5_file import DamagedFile, attribute_of, dataset_at, group_at, reading, text_at, values_at
from haptics.recording.leftovers import advice, is_journal
from haptics.recording.seal import check_seal
from haptics.recording.streams import StreamSpec
from haptics.units import file_path

_UNSEALED = 1
"""The last layout that was written without a seal."""


class Recording:
    """A finished recording; open one with :func:`load`. Each stream is read when first asked for, and kept.

    :param path: the file.
    :param file: the same, an open ``h5py.File``.
    :param verified: it has a seal, and its bytes agree with it.
    :ivar path: the file.
    :ivar schema: version of the file's layout.
    :ivar header: what the session wrote first (provenance).
    :ivar footer: what it wrote last; empty if it did not end well.
    :ivar complete: the session ended well and nothing is missing.
    :ivar lost_bytes: bytes of the journal that could not be recovered.
    :ivar damage: where and why recovery stopped, or empty.
    :ivar verified: its bytes are those that were written; unknown, and false, for an older layout.
    :ivar blobs: names of the attachments.
    :ivar streams: the streams by name, with fields, units and a description.
    :ivar counts: rows by stream.
    """

    def __init__(self, path: Path, file: Any, verified: bool):
        import h5py

        entry = group_at(file, "entry")
        provenance, attachments = group_at(entry, "provenance"), group_at(entry, "attachments")
        self.path, self.verified = path, verified
        self.schema = int(file.attrs["haptics_schema"])
        self.complete = bool(attribute_of(entry, "complete", np.bool_))
        self.lost_bytes = int(attribute_of(entry, "lost_bytes", np.integer))
        self.damage: str = attribute_of(entry, "damage", str)
        self.header = _object(provenance, "header")
        self.footer = _object(provenance, "footer") if "footer" in provenance else {}
        self.blobs = tuple(attachments)
        self.streams: dict[str, StreamSpec] = {}
        self.counts: dict[str, int] = {}
        for name in entry:
            link = entry.get(name, getlink=True)
            if isinstance(link, h5py.HardLink) and not isinstance(entry[name], h5py.Group):
                continue
            group = group_at(entry, name)
            if "time_ns" in group:
                self.streams[name], self.counts[name] = _stream(group, name)
        self._was = _state(path)
        self._rows: dict[str, NDArray[np.void]] = {}

    @property
    def notes(self) -> tuple[str, ...]:
        """What its user has to know: that it is incomplete, that damage to it cannot be seen."""
        found = [] if self.complete else [f"incomplete: {self.damage} ({self.lost_bytes} bytes lost)"]
        if not self.verified:
            found.append("unverified: written without checksums, so that damage cannot be seen")
        return tuple(found)

    def __contains__(self, name: object) -> bool:
        return name in self.streams

    def stream(self, name: str) -> NDArray[np.void]:
        """All rows of a stream, in the order they were recorded; do not change them.

        :param name: one of ``streams``.
        :return: structured array ``(n,)``, read-only.
        :raises InputError: there is no such stream, or the file was changed or has become unreadable.
        """
        if name not in self.streams:
            raise InputError(f"{self.path} has no stream {name!r}; it has {', '.join(self.streams) or 'none'}")
        if name not in self._rows:
            spec = self.streams[name]
            with self._again() as entry:
                group = group_at(entry, name)
                columns = {field: values_at(group, field) for field in spec.fields}
            rows = np.zeros(self.counts[name], spec.dtype)
            for field, values in columns.items():
                rows[field] = values
            rows.flags.writeable = False
            self._rows[name] = rows
        return self._rows[name]

    def blob(self, name: str) -> bytes:
        """An attachment.

        :param name: one of ``blobs``.
        :return: its bytes.
        :raises InputError: there is none of that name, or the file was changed or has become unreadable.
        """
        if name not in self.blobs:
            raise InputError(f"{self.path} has no attachment {name!r}; it has {', '.join(self.blobs) or 'none'}")
        with self._again() as entry:
            return values_at(group_at(entry, "attachments"), name).tobytes()

    @contextmanager
    def _again(self) -> Iterator[Any]:
        with reading(self.path) as file:
            if _state(self.path) != self._was:
                raise InputError(f"{self.path} was changed after it was opened; open it again")
            yield group_at(file, "entry")


def load(path: str | os.PathLike[str]) -> Recording:
    """Open a recording.

    :param path: the file (``.h5``).
    :return: the recording; rows are read later.
    :raises DamagedFile: it is damaged; the message states where.
    :raises InputError: no such file, a folder, no recording, an unfinished one, or one of a later version (the message states
        what to do).
    """
    path = file_path("path", path)
    found = check_seal(path)
    if found is not None and not found.whole:
        raise DamagedFile(path, found.damage)
    if is_journal(path):
        raise InputError(f"{path} is a journal, not a recording; make one of it: {advice(path)}")
    with reading(path) as file:
        schema = file.attrs.get("haptics_schema")
        if schema is None:
            raise InputError(f"{path} is HDF5 but not a finished haptics recording: it has no attribute haptics_schema")
        if not isinstance(schema, np.integer) or schema < 1:
            raise InputError(f"{path}: haptics_schema = {schema!r}; expected a layout from 1 to {SCHEMA}")
        if schema > SCHEMA:
            raise InputError(
                f"{path} has layout {schema}; this version of haptics reads layouts 1 to {SCHEMA}: "
                "open it with a later one (pip install --upgrade haptics)"
            )
        if found is None and schema > _UNSEALED:
            raise DamagedFile(path, ("the seal at its end is missing",))
        return Recording(path, file, verified=found is not None)


def _state(path: Path) -> tuple[int, int, int]:
    """What changes with a file; not proof, but files do not change by accident behind the system's back."""
    try:
        found = path.stat()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    return found.st_ino, found.st_size, found.st_mtime_ns


def _object(group: Any, name: str) -> dict[str, Any]:
    """A JSON object kept as text."""
    text = text_at(group, name)
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{group.file.filename}: {group.name}/{name} is not JSON: {error}") from error
    if not isinstance(data, Mapping):
        raise InputError(f"{group.file.filename}: {group.name}/{name} is not a JSON object")
    return dict(data)


def _stream(group: Any, name: str) -> tuple[StreamSpec, int]:
    """What a stream's columns hold, and how many rows they all have."""
    where = f"{group.file.filename}: {group.name}"
    columns = {field: dataset_at(group, field) for field in group}
    rows = {field: column.shape[0] if column.shape else -1 for field, column in columns.items()}
    if len(set(rows.values())) != 1 or -1 in rows.values():
        raise InputError(f"{where}: its columns differ in length: {', '.join(f'{k} {n}' for k, n in rows.items())}")
    units = {field: attribute_of(column, "units", str) for field, column in columns.items() if "units" in column.attrs}
    description = attribute_of(group, "description", str) if "description" in group.attrs else ""
    try:
        for field, column in columns.items():
            if column.dtype.names:
                raise TypeError(f"{field} has type {column.dtype}")
        row = np.dtype([(field, np.dtype(column.dtype.str), column.shape[1:]) for field, column in columns.items()])
        return StreamSpec(name, row, units, description), rows["time_ns"]
    except (TypeError, ValueError) as error:
        raise InputError(f"{where} is not a stream: {error}") from error

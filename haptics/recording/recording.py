"""Reading a finished recording, stream by stream, as structured arrays."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.recording.hdf5 import SCHEMA
from haptics.recording.segments import MAGIC
from haptics.recording.streams import StreamSpec


class Recording:
    """A finished recording; open one with :func:`load`. Each stream is read when first asked for, and kept.

    :ivar path: the file.
    :ivar schema: version of the file's layout.
    :ivar header: what the session wrote first (provenance).
    :ivar footer: what it wrote last; empty if it did not end well.
    :ivar complete: the session ended well and nothing is missing.
    :ivar lost_bytes: bytes of the journal that could not be recovered.
    :ivar damage: where and why recovery stopped, or empty.
    :ivar streams: the streams by name, with fields, units and a description.
    """

    def __init__(self, path: Path, file: Any):
        import h5py

        entry = file["entry"]
        self.path = path
        self.schema = int(file.attrs["haptics_schema"])
        self.complete = bool(entry.attrs["complete"])
        self.lost_bytes = int(entry.attrs["lost_bytes"])
        self.damage = str(entry.attrs["damage"])
        self.header: dict[str, Any] = json.loads(entry["provenance/header"][()])
        self.footer: dict[str, Any] = json.loads(entry["provenance/footer"][()]) if "footer" in entry["provenance"] else {}
        self.blobs = tuple(entry["attachments"])
        groups = ((name, part) for name, part in entry.items() if isinstance(part, h5py.Group))
        self.streams = {name: _spec(group) for name, group in groups if "time_ns" in group}
        self._rows: dict[str, NDArray[np.void]] = {}

    def __contains__(self, name: object) -> bool:
        return name in self.streams

    def stream(self, name: str) -> NDArray[np.void]:
        """All rows of a stream ``(n,)`` in the order they were recorded; do not change them.

        :raises InputError: there is no such stream, or the file has become unreadable.
        """
        if name not in self.streams:
            raise InputError(f"{self.path} has no stream {name!r}; it has {', '.join(self.streams) or 'none'}")
        if name not in self._rows:
            with _opened(self.path) as file:
                group = file["entry"][name]
                rows = np.zeros(len(group["time_ns"]), self.streams[name].dtype)
                for field in self.streams[name].fields:
                    rows[field] = group[field][()]
            rows.flags.writeable = False
            self._rows[name] = rows
        return self._rows[name]

    def blob(self, name: str) -> bytes:
        """An attachment.

        :raises InputError: there is none of that name.
        """
        if name not in self.blobs:
            raise InputError(f"{self.path} has no attachment {name!r}; it has {', '.join(self.blobs) or 'none'}")
        with _opened(self.path) as file:
            return bytes(file["entry/attachments"][name][()])


def load(path: str | os.PathLike[str]) -> Recording:
    """Open a recording.

    :raises InputError: no such file, no recording, an unfinished one, or one of a later version (the message says what to do).
    """
    path = Path(path)
    with _opened(path) as file:
        schema = file.attrs.get("haptics_schema")
        if schema is None:
            raise InputError(f"{path} is HDF5 but no finished haptics recording: it has no attribute haptics_schema")
        if not isinstance(schema, np.integer) or schema < 1:
            raise InputError(f"{path}: haptics_schema = {schema!r} is not allowed; allowed: 1 to {SCHEMA}")
        if schema > SCHEMA:
            raise InputError(
                f"{path} has layout {schema}; this version of haptics reads layouts 1 to {SCHEMA}: "
                "open it with a later one (pip install --upgrade haptics)"
            )
        try:
            return Recording(path, file)
        except (KeyError, OSError, TypeError, ValueError) as error:
            raise InputError(f"{path} is not laid out as a haptics recording: {error}") from error


def _opened(path: Path) -> Any:
    import h5py

    try:
        return h5py.File(path, "r")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read as HDF5: {error}{_journal_advice(path)}") from error


def _journal_advice(path: Path) -> str:
    try:
        with path.open("rb") as file:
            journal = file.read(len(MAGIC)) == MAGIC
    except OSError:
        return ""
    return "; it is a journal: recover it (haptics recording recover)" if journal else ""


def _spec(group: Any) -> StreamSpec:
    columns = [(name, np.dtype(dataset.dtype.str), dataset.shape[1:]) for name, dataset in group.items()]
    units = {name: dataset.attrs["units"] for name, dataset in group.items() if "units" in dataset.attrs}
    return StreamSpec(group.name.rsplit("/", 1)[-1], np.dtype(columns), units, group.attrs.get("description", ""))

"""The archive: a journal finalised to HDF5, in plain h5py with NeXus attributes.

::

    /                      NXroot    default, haptics_schema, creator
      entry                NXentry   default, complete, lost_bytes, damage, title
        provenance         NXcollection  header and footer as JSON text; the header's plain values as attributes
        attachments        NXcollection  one dataset for each: text, or bytes as uint8
        <stream>           NXdata if it has a field to plot (signal, axes), else NXcollection
          time_ns (n,)     then one dataset for each field, (n,) or (n, ...), with units

Which plot opens first is the header's ``default_plot``: ``{"stream": "ticks", "signal": "rise_k"}``; without it, the first
stream with rows and a floating-point field. Nothing in the file depends on when or where it was written. At the file's end is
a seal over all of it (:mod:`haptics.recording.seal`).
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from haptics.ends import undisturbed
from haptics.errors import HapticsError, InputError
from haptics.recording.hdf5_file import DAMAGE, writing
from haptics.recording.journal_reader import JournalContents, read_journal
from haptics.recording.lock import being_written
from haptics.recording.output import replacing, same_file
from haptics.recording.seal import seal
from haptics.recording.streams import StreamSpec, field_type, fits_attribute, is_unicode

if TYPE_CHECKING:
    import h5py

SCHEMA = 2
"""Version of the layout above; :func:`haptics.recording.load` opens this and older ones. Layout 1 had no seal."""

_CHUNK_BYTES = 1 << 16
_BATCH_BYTES = 1 << 22


@dataclass(frozen=True)
class Finalised:
    """What became of a journal.

    :ivar path: the recording.
    :ivar complete: the session ended well and nothing is missing.
    :ivar rows: rows by stream.
    :ivar lost_bytes: bytes at the journal's end that could not be used.
    :ivar damage: where and why reading stopped, or empty.
    :ivar journal_kept: the journal still exists.
    """

    path: Path
    complete: bool
    rows: dict[str, int]
    lost_bytes: int
    damage: str
    journal_kept: bool


def finalise(
    journal_path: str | os.PathLike[str],
    out_path: str | os.PathLike[str],
    *,
    force: bool = False,
    keep_journal: bool = False,
) -> Finalised:
    """Turn a closed journal into an HDF5 recording, then remove the journal.

    The recording is written under a temporary name in the same folder, brought to the disk and moved into place, so a
    file under ``out_path`` is always whole.

    :param journal_path: the journal.
    :param out_path: the recording to write (``.h5``).
    :param force: overwrite ``out_path`` if it exists.
    :param keep_journal: do not remove the journal.
    :return: what became of the journal.
    :raises InputError: no journal, one that was not closed or is damaged (use :func:`recover`), or ``out_path`` exists.
    :raises HapticsError: the recording cannot be written (a full disk); the journal is kept.
    """
    contents = read_journal(journal_path)
    if not contents.complete:
        why = contents.damage.why if contents.damage else "it was never closed"
        raise InputError(f"{contents.path} is not complete: {why}; recover it (haptics recording recover)")
    return _convert(contents, Path(out_path), force, keep_journal)


def recover(
    journal_path: str | os.PathLike[str],
    out_path: str | os.PathLike[str],
    *,
    force: bool = False,
    keep_journal: bool = False,
) -> Finalised:
    """Turn what a crash left into an HDF5 recording, marked incomplete, with how much was lost.

    The journal is removed only if all its bytes went into the recording.

    :param journal_path: the journal.
    :param out_path: the recording to write (``.h5``).
    :param force: overwrite ``out_path`` if it exists.
    :param keep_journal: do not remove the journal in any case.
    :return: what became of the journal.
    :raises InputError: no journal, one still being written, one without a single whole segment, or ``out_path`` exists.
    :raises HapticsError: the recording cannot be written (a full disk); the journal is kept.
    """
    contents = read_journal(journal_path)
    if being_written(contents.path):
        raise InputError(f"{contents.path}: another process is still writing this journal")
    if contents.header is None:
        damage = contents.damage
        if damage is None or damage.torn:
            raise InputError(f"{contents.path}: nothing to recover: no whole segment; it can be removed")
        raise InputError(
            f"{contents.path}: nothing can be recovered: its start is damaged, at byte {damage.offset}: {damage.why}"
        )
    return _convert(contents, Path(out_path), force, keep_journal or contents.dropped_bytes > 0)


def _convert(contents: JournalContents, out: Path, force: bool, keep_journal: bool) -> Finalised:
    if same_file(out, contents.path):
        raise InputError(f"{out} is the journal itself; give the recording another name")
    with undisturbed():  # or a signal between moving the one and removing the other would leave both
        try:
            with replacing(out, force) as partial:
                _write(contents, partial)
        except InputError:
            raise
        except HapticsError as error:
            raise HapticsError(f"{error}; the journal {contents.path} is kept") from error
        except DAMAGE as error:
            raise HapticsError(f"{out} cannot be made of the journal {contents.path}, which is kept: {error}") from error
        if not keep_journal:
            _remove(contents.path)
    return Finalised(
        out,
        contents.complete,
        {name: contents.count(name) for name in contents.streams},
        contents.dropped_bytes,
        _damage(contents),
        keep_journal,
    )


def _remove(journal: Path) -> None:
    try:
        journal.unlink()
    except OSError as error:
        raise HapticsError(f"{journal}: its recording is made, and it cannot be removed: {error.strerror or error}") from error


def _write(contents: JournalContents, path: Path) -> None:
    header = contents.header or {}
    plots = _plots(contents, header.get("default_plot"))
    with writing(path) as file:
        file.attrs.update({"NX_class": "NXroot", "default": "entry", "creator": "haptics"})
        entry = _group(file, "entry", "NXentry")
        entry.attrs["complete"] = contents.complete
        entry.attrs["lost_bytes"] = contents.dropped_bytes
        entry.attrs["damage"] = _damage(contents)
        if isinstance(header.get("title"), str) and is_unicode(header["title"]):
            _text(entry, "title", header["title"])
        if plots:
            entry.attrs["default"] = next(iter(plots))
        provenance = _group(entry, "provenance", "NXcollection")
        _text(provenance, "header", _json(header))
        if contents.footer is not None:
            _text(provenance, "footer", _json(contents.footer))
        for name, value in header.items():
            if name.isidentifier() and fits_attribute(name) and _fits_attribute(value):
                provenance.attrs[name] = value
        attachments = _group(entry, "attachments", "NXcollection")
        for name in contents.blobs:
            _attach(attachments, name, contents.blob(name))
        for name, spec in contents.streams.items():
            _write_stream(entry, contents, spec, plots.get(name))
        file.attrs["haptics_schema"] = SCHEMA  # last: without it nothing is taken for a recording
    seal(path)


def _write_stream(entry: h5py.Group, contents: JournalContents, spec: StreamSpec, signal: str | None) -> None:
    group = _group(entry, spec.name, "NXdata" if signal else "NXcollection")
    group.attrs["description"] = spec.description
    if signal:
        _, shape = field_type(spec.dtype, signal)
        group.attrs["signal"] = signal
        group.attrs["axes"] = ["time_ns", *["."] * len(shape)]
        group.attrs["time_ns_indices"] = 0
    rows = contents.count(spec.name)
    datasets = {name: _column(group, spec, name, rows) for name in spec.fields}
    done = 0
    for batch in _gathered(contents.batches(spec.name), max(1, _BATCH_BYTES // spec.dtype.itemsize)):
        for name, dataset in datasets.items():
            dataset[done : done + len(batch)] = batch[name].astype(dataset.dtype)  # marks text as UTF-8
        done += len(batch)


def _column(group: h5py.Group, spec: StreamSpec, name: str, rows: int) -> h5py.Dataset:
    import h5py

    base, shape = field_type(spec.dtype, name)
    row_bytes = base.itemsize * int(np.prod(shape))
    dataset = group.create_dataset(
        name,
        (rows, *shape),
        h5py.string_dtype("utf-8", base.itemsize) if base.kind == "S" else base,
        maxshape=(None, *shape),
        chunks=(max(1, min(rows, _CHUNK_BYTES // row_bytes)), *shape),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
        track_times=False,
    )
    if name in spec.units:
        dataset.attrs["units"] = spec.units[name]
    return dataset


def _gathered(batches: Iterator[NDArray[np.void]], rows: int) -> Iterator[NDArray[np.void]]:
    # segments are small; a chunk that is written twice is compressed twice
    held: list[NDArray[np.void]] = []
    for batch in batches:
        held.append(batch)
        if sum(map(len, held)) >= rows:
            yield np.concatenate(held)
            held = []
    if held:
        yield np.concatenate(held)


def _plots(contents: JournalContents, wanted: Any) -> dict[str, str]:
    """The signal of each stream that can be plotted, that of the default plot first."""
    plots = {}
    for name, spec in contents.streams.items():
        floats = [field for field in spec.fields if field_type(spec.dtype, field)[0].kind == "f"]
        if floats:
            plots[name] = floats[0]
    first = next((name for name in plots if contents.count(name)), None)
    stream, signal = (wanted.get("stream"), wanted.get("signal")) if isinstance(wanted, Mapping) else (None, None)
    if isinstance(stream, str) and stream in contents.streams:
        spec = contents.streams[stream]
        if signal in spec.fields and signal != "time_ns" and field_type(spec.dtype, signal)[0].kind in "iuf":
            plots[spec.name] = signal
            first = spec.name
    return plots if first is None else {first: plots[first], **plots}


def _group(parent: h5py.Group, name: str, nexus_class: str) -> h5py.Group:
    group = parent.create_group(name, track_order=True)
    group.attrs["NX_class"] = nexus_class
    return group


def _text(group: h5py.Group, name: str, text: str) -> None:
    import h5py

    data = text.encode()
    group.create_dataset(name, data=np.bytes_(data), dtype=h5py.string_dtype("utf-8", max(1, len(data))))


def _attach(group: h5py.Group, name: str, data: bytes) -> None:
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = "\0"
    if text and "\0" not in text:  # NUL is what fixed-length text is padded with
        _text(group, name, text)
    else:
        group.create_dataset(name, data=np.frombuffer(data, np.uint8), track_times=False)


def _json(data: Mapping[str, Any]) -> str:
    text = json.dumps(data, sort_keys=True, ensure_ascii=False)
    return text if is_unicode(text) else json.dumps(data, sort_keys=True)


def _damage(contents: JournalContents) -> str:
    if contents.damage is not None:
        return f"byte {contents.damage.offset}: {contents.damage.why}"
    return "" if contents.footer is not None else "the session did not end well"


def _fits_attribute(value: Any) -> bool:
    if isinstance(value, str):
        return fits_attribute(value)
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**63)

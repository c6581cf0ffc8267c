"""HDF5 files written so that a full disk is an error like any other, and read so that no damage is more than an error.

HDF5 that cannot write what it holds may crash the process when it closes the file. So its bytes go through a file object that
never fails: it keeps the first failure, which is raised when HDF5 is done.

What is read is what lies in the file itself: links out of it, data kept in other files and filters from elsewhere
are refused, not followed.
"""

from __future__ import annotations

import io
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.ends import undisturbed
from haptics.errors import HapticsError, InputError

_FILTERS = {1: "gzip", 2: "shuffle", 3: "fletcher32"}
DAMAGE = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, SystemError, TypeError, ValueError)
"""What h5py raises where a file is damaged; which of them depends on what it meets first."""
_CUT = re.compile(r"truncated file: eof = (\d+),.* stored_eof = (\d+)")
_LARGEST_RATIO = 1100
"""gzip packs 1032 bytes into one, at the very best."""


class DamagedFile(InputError):
    """A file that is not as it was written.

    :param path: the file.
    :param max_listed: how many places the message lists.
    :ivar places: where: datasets by name, or words.
    """

    def __init__(self, path: Path, places: tuple[str, ...], max_listed: int = 8):
        more = f" and {len(places) - max_listed} more" if len(places) > max_listed else ""
        super().__init__(f"{path} is damaged, or was changed since it was written: {', '.join(places[:max_listed])}{more}")
        self.places = places


class _Sink(io.RawIOBase):
    """A file that does not fail: after its first failure, kept in ``error``, what is written to it is lost."""

    def __init__(self, file: io.FileIO):
        self._file = file
        self.error: OSError | None = None

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        return self._tried(self._file.readinto, buffer) or 0

    def write(self, data: Any) -> int:
        left = memoryview(data).cast("B")
        while left and self.error is None:
            left = left[self._tried(self._file.write, left) or 0 :]
        return memoryview(data).nbytes

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def truncate(self, size: int | None = None) -> int:
        self._tried(self._file.truncate, size)
        return size or 0

    def _tried(self, call: Any, argument: Any) -> Any:
        try:
            return call(argument)
        except OSError as error:
            self.error = self.error or error
            return None


@contextmanager
def writing(path: Path) -> Iterator[Any]:
    """A new HDF5 file. Signals wait: HDF5 calls :class:`_Sink`, and crashes where that is broken off.

    :param path: where to write; what is there is replaced.
    :return: the open ``h5py.File``, as a context.
    :raises OSError: it cannot be written.
    """
    import h5py

    with undisturbed(), path.open("w+b", buffering=0) as raw:
        sink = _Sink(raw)
        try:
            with h5py.File(sink, "w") as file:
                yield file
        except Exception as error:
            raise sink.error or error from None
        if sink.error is not None:
            raise sink.error


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """An HDF5 file that is there.

    :param path: the file.
    :return: the open ``h5py.File``, as a context.
    :raises InputError: no such file, a folder, or whatever else goes wrong while it is read.
    :raises DamagedFile: it is cut short.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            yield file
    except HapticsError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except DAMAGE as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> InputError:
    cut = _CUT.search(str(error))
    if cut is not None:
        return DamagedFile(path, (f"cut short, {cut[1]} bytes are left of {cut[2]} and more",))
    if "file signature not found" in str(error):
        return InputError(f"{path} is not an HDF5 file: it does not begin as one does")
    if isinstance(error, OSError) and error.errno is not None:  # HDF5's own text has descriptors and addresses in it
        why = os.strerror(error.errno)
    else:
        why = str(error) or type(error).__name__
    return InputError(f"{path} cannot be read as HDF5: {why}")


def group_at(parent: Any, name: str) -> Any:
    """A group in a group.

    :param parent: an ``h5py`` file or group.
    :param name: of the group wanted.
    :return: the ``h5py.Group``.
    :raises InputError: there is none that lies in this file.
    """

    import h5py

    found = _own(parent, name)
    if not isinstance(found, h5py.Group):
        raise InputError(f"{parent.file.filename}: {found.name} is not a group")
    return found


def dataset_at(parent: Any, name: str) -> Any:
    """A dataset in a group, whose values lie in this file and are no more than it can hold.

    :param parent: an ``h5py`` file or group.
    :param name: of the dataset wanted.
    :return: the ``h5py.Dataset``.
    :raises InputError: there is none.
    """

    import h5py

    found = _own(parent, name)
    where = f"{parent.file.filename}: {parent.name.rstrip('/')}/{name}"
    if not isinstance(found, h5py.Dataset):
        raise InputError(f"{where} is not a dataset")
    if found.is_virtual or found.external:
        raise InputError(f"{where} keeps its values in another file, which is not read")
    made = found.id.get_create_plist()
    foreign = [code for code in (made.get_filter(k)[0] for k in range(made.get_nfilters())) if code not in _FILTERS]
    if foreign:
        raise InputError(f"{where} is packed by filter {foreign[0]}; only {', '.join(_FILTERS.values())} are read")
    if found.shape is None:
        raise InputError(f"{where} holds no values")
    claimed = int(np.prod([float(n) for n in found.shape]) * found.dtype.itemsize)
    if claimed > _LARGEST_RATIO * Path(parent.file.filename).stat().st_size:
        raise InputError(f"{where} claims to hold {claimed} bytes, more than the file can")
    if found.size and found.chunks and _chunks_missing(found):
        raise InputError(f"{where}: some of its values were never written")  # HDF5 would make them up
    if found.size and not found.chunks and found.id.get_storage_size() < claimed:
        raise InputError(f"{where}: its values were never written")
    return found


def _chunks_missing(dataset: Any) -> bool:
    due = math.prod(-(-size // chunk) for size, chunk in zip(dataset.shape, dataset.chunks, strict=True))
    return dataset.id.get_num_chunks() < due


def column_at(parent: Any, name: str) -> Any:
    """A dataset of numbers, text or bytes of a fixed length.

    :param parent: an ``h5py`` file or group.
    :param name: of the dataset wanted.
    :return: the ``h5py.Dataset``.
    :raises InputError: there is none.
    """
    dataset = dataset_at(parent, name)
    if dataset.dtype.names or dataset.dtype.hasobject:
        where = f"{parent.file.filename}: {dataset.name}"
        raise InputError(f"{where} has type {dataset.dtype}; expected numbers, text or bytes of a fixed length")
    return dataset


def values_at(parent: Any, name: str) -> NDArray[Any]:
    """The values of a dataset.

    :param parent: an ``h5py`` file or group.
    :param name: of the dataset wanted.
    :return: all of them, in the dataset's own shape and type.
    :raises InputError: there is none, or it cannot be read.
    """
    dataset = column_at(parent, name)
    with _placed(dataset):
        return np.asarray(dataset[()])


def text_at(parent: Any, name: str) -> str:
    """The text of a dataset that holds one.

    :param parent: an ``h5py`` file or group.
    :param name: of the dataset wanted.
    :return: the text.
    :raises InputError: there is none, or it is no text.
    """
    dataset = dataset_at(parent, name)
    with _placed(dataset):
        value = dataset[()]
        if not isinstance(value, bytes):
            raise InputError(f"{parent.file.filename}: {dataset.name} is not text")
        return value.decode()


def attribute_of(part: Any, name: str, kind: type | tuple[type, ...]) -> Any:
    """An attribute.

    :param part: an ``h5py`` file, group or dataset.
    :param name: of the attribute wanted.
    :param kind: type that it must be of, or several.
    :return: its value.
    :raises InputError: there is none, or it is of another type.
    """
    where = f"{part.file.filename}: {part.name}"
    try:
        value = part.attrs[name]
    except KeyError:
        raise InputError(f"{where} has no attribute {name}") from None
    except DAMAGE as error:
        raise InputError(f"{where}: attribute {name} cannot be read: {error}") from error
    if not isinstance(value, kind):
        raise InputError(f"{where}: attribute {name} = {value!r} is of the wrong type")
    return value


def _own(parent: Any, name: str) -> Any:
    import h5py

    where = f"{parent.file.filename}: {parent.name.rstrip('/')}/{name}"
    try:
        link = parent.get(name, getlink=True)
        if isinstance(link, h5py.HardLink):
            return parent[name]
    except DAMAGE as error:
        raise InputError(f"{where} cannot be read: {error}") from error
    if link is None:
        raise InputError(f"{where} is missing")
    raise InputError(f"{where} is a link to {getattr(link, 'filename', '')} {link.path}; links are not followed")


@contextmanager
def _placed(dataset: Any) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except DAMAGE as error:
        raise InputError(f"{dataset.file.filename}: {dataset.name} cannot be read: {error}") from error

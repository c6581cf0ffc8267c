"""Writing a file so that it is either whole or not there, and never over another one unasked."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from haptics.errors import HapticsError, InputError


def refuse_existing(path: Path, force: bool) -> None:
    """Refuse a path where no file can or may be written.

    :param path: the file to write.
    :param force: it may exist already.
    :raises InputError: it exists and ``force`` is not given, it is a folder or a device, or it cannot be a file at all.
    """
    try:
        in_folder, there = path.parent.is_dir(), path.exists()
        folder, file = path.is_dir(), path.is_file()
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from error
    if not in_folder:
        raise InputError(f"{path}: there is no folder {path.parent}; make it, or choose another place")
    if folder:
        raise InputError(f"{path} is a folder; expected a file name")
    if there and not file:
        raise InputError(f"{path} is a device or a pipe; expected a file name")
    if there and not force:
        raise InputError(f"{path} exists and is not overwritten; choose another name or overwrite it (--force)")


def check_folder(option: str, path: Path) -> None:
    """Refuse a file in a folder that is not there: a folder mistyped is not to become one.

    :param option: what names the file.
    :param path: the file to write.
    :raises InputError: there is no such folder.
    """
    if not os.path.isdir(path.parent):
        raise InputError(f"{option} = {path}: there is no folder {path.parent}; make it, or choose another place")


def with_suffix(path: Path, suffix: str) -> Path:
    """The file beside ``path`` with another ending.

    :param path: a file.
    :param suffix: with its dot.
    :return: the other file.
    :raises InputError: ``path`` has no name: it is empty, ``.`` or ``/``.
    """
    if not path.name:
        raise InputError(f"{path} is a folder; expected a file name")
    return path.with_suffix(suffix)


def check_outputs(outputs: Mapping[str, Path | None], force: bool, inputs: Mapping[str, Path] | None = None) -> None:
    """Look, before anything takes time or is energised, whether all outputs can be written.

    :param outputs: paths by the option that names each; None is not written.
    :param force: files may exist already.
    :param inputs: files that are read, likewise; no output may take the place of one.
    :raises InputError: as :func:`refuse_existing`; two options name one file, by whatever path; or nothing can be written there.
    """
    named = {option: path for option, path in outputs.items() if path is not None}
    for (one, first), (other, second) in itertools.combinations(named.items(), 2):
        if same_file(first, second):
            raise InputError(f"{one} = {first} and {other} = {second} are the same file; give each its own name")
    for option, path in named.items():
        for what, read in (inputs or {}).items():
            if same_file(path, read):
                raise InputError(f"{option} = {path} is the file read as {what}; choose another name")
    for option, path in named.items():
        check_folder(option, path)
        refuse_existing(path, force)
    for path in named.values():
        try:
            _begun(path).unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"{path} cannot be written: {error.strerror or error}; choose another place") from error


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file, which need not exist: by links, or spelled in another form.

    :param one: a path.
    :param other: a path.
    :return: whether they do.
    """
    if os.path.realpath(one) == os.path.realpath(other):
        return True
    try:
        return one.samefile(other)
    except OSError:  # one of them does not exist
        return False


@contextmanager
def replacing(path: Path, force: bool) -> Iterator[Path]:
    """A temporary name to write to; on success it takes the place of ``path``, on failure it goes.

    :param path: the file to write.
    :param force: overwrite it if it exists.
    :return: a path in the same folder, as a context; the file there is empty at first.
    :raises InputError: as :func:`refuse_existing`.
    :raises HapticsError: the system cannot write it: the disk is full, read-only, or gone.
    """
    refuse_existing(path, force)
    partial = None
    try:
        partial = _begun(path)
        yield partial
        with partial.open("r+b") as file:
            os.fsync(file.fileno())
        refuse_existing(path, force)  # it may have come up while we wrote
        partial.replace(path)
    except OSError as error:
        raise HapticsError(f"{path} cannot be written: {error.strerror or error}") from error
    finally:
        if partial is not None:
            _forget(partial)


def make_folder(path: Path) -> None:
    """Make a folder unless it is there; the one it lies in must be.

    :param path: the folder.
    :raises InputError: none can be made.
    """
    check_folder("out", path)
    try:
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: no folder can be made there ({error.strerror or error})") from error


def _begun(path: Path) -> Path:
    """The temporary file, empty: that it can be made shows that there is a place to write."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    partial.open("wb").close()
    return partial


def _forget(partial: Path) -> None:
    with suppress(OSError):  # the disk went, and the file with it
        partial.unlink(missing_ok=True)

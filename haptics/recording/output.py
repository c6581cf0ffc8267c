"""Writing a file so that it is either whole or not there, and never over another one unasked."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from haptics.errors import InputError


def refuse_existing(path: Path, force: bool) -> None:
    """:raises InputError: ``path`` exists and ``force`` is not given, is a folder, or its folder is missing."""
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}")
    if path.is_dir():
        raise InputError(f"{path} is a folder; a file name is wanted")
    if path.exists() and not force:
        raise InputError(f"{path} exists and is not overwritten; choose another name or force it (--force)")


@contextmanager
def replacing(path: Path, force: bool) -> Iterator[Path]:
    """A temporary name beside ``path`` to write to; on success it takes the place of ``path``, on failure it goes.

    :raises InputError: as :func:`refuse_existing`.
    """
    refuse_existing(path, force)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        yield partial
        with partial.open("r+b") as file:
            os.fsync(file.fileno())
        refuse_existing(path, force)  # it may have come up while we wrote
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)

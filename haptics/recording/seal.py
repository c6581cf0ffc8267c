"""The seal at the end of an HDF5 file: a checksum over all its bytes, and where in it what lies.

::

    the HDF5 file        as its superblock bounds it; HDF5 itself does not look beyond
    the directory        JSON: for each dataset its place in bytes, [[from, length], ...], and the CRC-32 of what is there
    the last line        ``haptics seal 1`` and three numbers: bytes of HDF5, bytes of the directory, SHA-256 of both

A file is held against its seal before HDF5 looks at it, so that damage meets no library that may stumble over it. The directory
names the part that is damaged, if it is one.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from haptics.errors import InputError
from haptics.recording.hdf5_file import reading

_LINE = "\nhaptics seal 1 {:016d} {:016d} {}\n"
_PATTERN = re.compile(rb"\nhaptics seal 1 ([0-9]{16}) ([0-9]{16}) ([0-9a-f]{64})\n")
_LINE_BYTES = len(_LINE.format(0, 0, "0" * 64))
_PIECE_BYTES = 1 << 20


@dataclass(frozen=True)
class Seal:
    """What a file's seal states about it.

    :ivar whole: every byte is as it was written.
    :ivar damage: where it is not: datasets by name, or words; empty if all is well.
    """

    whole: bool
    damage: tuple[str, ...] = ()


def seal(path: Path) -> None:
    """Put a seal at the end of a closed HDF5 file that has none.

    :param path: the file.
    :raises OSError: it cannot be written.
    """
    parts = _places(path)
    with path.open("r+b") as file:
        for part in parts:
            part["crc32"] = _crc(file, part["bytes"])
        size = file.seek(0, os.SEEK_END)
        directory = json.dumps(parts, separators=(",", ":")).encode()
        file.write(directory)
        line = _LINE.format(size, len(directory), _digest(file, size + len(directory)))
        file.seek(0, os.SEEK_END)
        file.write(line.encode())


def check_seal(path: Path) -> Seal | None:
    """Hold a file against its seal.

    :param path: the file.
    :return: what the seal states; None if the file has none.
    :raises InputError: there is no such file, it is a folder, or it cannot be read.
    """
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            if size < _LINE_BYTES:
                return None
            file.seek(size - _LINE_BYTES)
            found = _PATTERN.fullmatch(file.read())
            if found is None:
                return None
            hdf5, directory = int(found[1]), int(found[2])
            if hdf5 + directory + _LINE_BYTES != size:
                return Seal(False, (f"it has {size} bytes, and had {hdf5 + directory + _LINE_BYTES} when it was written",))
            if _digest(file, hdf5 + directory) == found[3].decode():
                return Seal(True)
            return Seal(False, _damaged(file, hdf5, directory))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        if os.path.isdir(path):
            raise InputError(f"{path} is a folder; expected a recording (.h5)") from error
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error


def _places(path: Path) -> list[dict[str, Any]]:
    """Each dataset and the bytes of the file that hold its values."""
    import h5py

    found: list[dict[str, Any]] = []

    def take(name: str, part: object) -> None:
        if isinstance(part, h5py.Dataset):
            places: list[list[int]] = []
            if part.chunks is None:
                if part.id.get_offset() is not None:
                    places.append([part.id.get_offset(), part.id.get_storage_size()])
            else:
                part.id.chunk_iter(lambda chunk: places.append([chunk.byte_offset, chunk.size]))
            found.append({"name": name, "bytes": sorted(places)})

    with reading(path) as file:
        file.visititems(take)
    return found


def _damaged(file: BinaryIO, hdf5: int, directory: int) -> tuple[str, ...]:
    file.seek(hdf5)
    try:
        parts = [(str(part["name"]), part["bytes"], part["crc32"]) for part in json.loads(file.read(directory))]
        wrong = tuple(name for name, places, crc in parts if _crc(file, places) != crc)
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError):
        return ("the seal itself",)
    return wrong or ("names, sizes or attributes",)


def _crc(file: BinaryIO, places: list[list[int]]) -> int:
    crc = 0
    for start, length in places:
        for piece in _pieces(file, start, length):
            crc = zlib.crc32(piece, crc)
    return crc


def _digest(file: BinaryIO, size: int) -> str:
    digest = hashlib.sha256()
    for piece in _pieces(file, 0, size):
        digest.update(piece)
    return digest.hexdigest()


def _pieces(file: BinaryIO, start: int, length: int) -> Iterator[bytes]:
    file.seek(start)
    while length > 0 and (piece := file.read(min(length, _PIECE_BYTES))):
        yield piece
        length -= len(piece)

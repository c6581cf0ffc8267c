"""Triangles of a mesh file: positions and faces only, in the file's own units and axes."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.meshes.obj import read_obj
from haptics.meshes.ply import read_ply
from haptics.meshes.stl import read_stl

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORMATS = (".obj", ".stl", ".ply")
LARGEST_TRIANGLES = 200_000
"""A scan has more; no computation here gains by them."""
_OTHERS = {b"ply": ".ply", b"solid": ".stl", b"glTF": ".glb"}
"""How files of other formats begin."""


def read_triangles(path: Path) -> tuple[Floats, Ints]:
    """Read an OBJ, PLY or STL file (text or binary).

    Polygons are cut into fans. Corners that an STL file repeats in each triangle become one vertex each.

    :param path: its suffix decides how it is read.
    :return: vertices, ``(v, 3)``, in the file's unit and axes, and triangles, ``(t, 3)``.
    :raises InputError: no such file, another format, unreadable, or as ``check_arrays``. Messages give the line of an OBJ file.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(f"mesh {path} is of type {path.suffix or '(none)'}; export it as one of: {', '.join(FORMATS)}")
    try:
        if not path.exists():
            raise InputError(f"mesh {path} is not a file: it does not exist")
        if not path.is_file():
            raise InputError(f"mesh {path} is not a file; expected a mesh as {', '.join(FORMATS)}")
        if path.stat().st_size == 0:
            raise InputError(f"mesh {path} is empty; expected a mesh as {', '.join(FORMATS)}")
        vertices, triangles = _read(path)
    except OSError as error:
        raise InputError(f"mesh {path} cannot be read: {error.strerror or error}") from error
    if not len(triangles) and len(vertices):
        raise InputError(f"mesh {path} has no triangles, only {len(vertices)} points; export its surface with faces")
    if not len(triangles):
        raise InputError(f"mesh {path} has no triangles{_what_it_is(path)}; expected a whole file of its kind")
    check_arrays(f"mesh {path}", vertices, triangles)
    return vertices, triangles


def check_arrays(name: str, vertices: Floats, triangles: Ints) -> None:
    """Check that arrays are a mesh.

    :param name: what messages call the mesh.
    :param vertices: ``(v, 3)``, finite.
    :param triangles: ``(t, 3)``, indices of vertices, 1 to ``LARGEST_TRIANGLES`` of them.
    :raises InputError: wrong shapes, no triangle or too many, a coordinate that is not finite, a vertex that is not there.
    """
    shapes = vertices.shape, triangles.shape
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or triangles.ndim != 2 or triangles.shape[1:] != (3,) or not shapes[1][0]:
        raise InputError(
            f"{name} has no triangles: vertices {shapes[0]}, faces {shapes[1]}; expected (v, 3) and (f, 3), f at least 1"
        )
    _check_number(name, len(triangles))
    broken = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if broken.size:
        raise InputError(f"{name}: vertex {broken[0]} is {vertices[broken[0]].tolist()}; expected finite coordinates")
    outside = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))
    if outside.size:
        raise InputError(
            f"{name}: triangle {outside[0]} names vertices {triangles[outside[0]].tolist()}; there are 0 to {len(vertices) - 1}"
        )


def _read(path: Path) -> tuple[Floats, Ints]:
    kind = path.suffix.lower()
    if kind == ".obj":
        vertices, triangles, count = read_obj(path, LARGEST_TRIANGLES)
        _check_number(f"mesh {path}", count)
        return vertices, triangles
    try:
        if kind == ".ply":
            vertices, faces, count = read_ply(path.read_bytes(), LARGEST_TRIANGLES)
            _check_number(f"mesh {path}", count)
            fans = [(corners[0], *pair) for corners in faces for pair in pairwise(corners[1:])]
            return vertices, np.array(fans, np.int64).reshape(-1, 3)
        corners, count = read_stl(path.read_bytes(), LARGEST_TRIANGLES)
        _check_number(f"mesh {path}", count)
        # It repeats each vertex in every triangle.
        vertices, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        return vertices, number.reshape(-1, 3).astype(np.int64)
    except (ValueError, OverflowError) as error:
        raise InputError(f"mesh {path} cannot be read as {kind[1:].upper()}: {error}{_commas(path)}") from error


def _check_number(name: str, triangles: int) -> None:
    if triangles > LARGEST_TRIANGLES:
        raise InputError(
            f"{name} has {triangles} triangles; at most {LARGEST_TRIANGLES} are read; reduce (decimate) it where it was made"
        )


def _commas(path: Path) -> str:
    with path.open("rb") as file:
        return "; it has decimal commas, export it with points" if re.search(rb"\s-?\d+,\d+\s", file.read(4096)) else ""


def _what_it_is(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(60)
    for mark, kind in _OTHERS.items():
        if start.startswith(mark) and kind != path.suffix.lower():
            return f"; it begins like a {kind} file, and is named {path.suffix}"
    return f"; it begins {(start.splitlines() or [b''])[0].decode('ascii', errors='replace')!r}"

"""Triangles out of a mesh file: positions and faces only, in the file's own units and axes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORMATS = (".obj", ".stl", ".ply")
LARGEST_TRIANGLES = 200_000
"""A scan has more; no computation here gains by them."""
_OTHERS = {b"ply": ".ply", b"solid": ".stl", b"glTF": ".glb"}
"""How files of other formats begin."""


def read_triangles(path: Path, extra: str) -> tuple[Floats, Ints]:
    """Vertices, ``(v, 3)``, and triangles, ``(t, 3)``, of an OBJ, PLY or STL file (text or binary).

    Polygons are cut into fans. Corners that an STL file repeats in each triangle are one vertex each.

    :param extra: which of the package's extras brings trimesh, which reads STL and PLY.
    :raises InputError: no such file, another format, unreadable, trimesh not installed, or as ``check_arrays``. Messages give the
        line of an OBJ file.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(
            f"mesh {path} is of type {path.suffix or '(none)'}; allowed: {', '.join(FORMATS)}; export it as one of them"
        )
    try:
        if not path.exists():
            raise InputError(f"mesh {path} is not a file: it does not exist")
        if not path.is_file():
            raise InputError(f"mesh {path} is not a file; allowed: a mesh as {', '.join(FORMATS)}")
        if path.stat().st_size == 0:
            raise InputError(f"mesh {path} is empty; allowed: a mesh as {', '.join(FORMATS)}")
        vertices, triangles = _read_obj(path) if kind == ".obj" else _read_by_trimesh(path, extra)
    except OSError as error:
        raise InputError(f"mesh {path} cannot be read: {error.strerror or error}") from error
    if not len(triangles) and len(vertices):
        raise InputError(f"mesh {path} has no triangles, only {len(vertices)} points; allowed: a surface of faces")
    if not len(triangles):
        raise InputError(f"mesh {path} has no triangles{_what_it_is(path)}; allowed: a whole file of its kind")
    check_arrays(f"mesh {path}", vertices, triangles)
    return vertices, triangles


def check_arrays(name: str, vertices: Floats, triangles: Ints) -> None:
    """:raises InputError: wrong shapes, no triangle or too many, a coordinate that is not finite, a vertex that is not there."""
    shapes = vertices.shape, triangles.shape
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or triangles.ndim != 2 or triangles.shape[1:] != (3,) or not shapes[1][0]:
        raise InputError(
            f"{name} has no triangles: vertices {shapes[0]}, faces {shapes[1]}; allowed: (v, 3) and (f, 3), f at least 1"
        )
    if len(triangles) > LARGEST_TRIANGLES:
        raise InputError(
            f"{name} has {len(triangles)} triangles; allowed: at most {LARGEST_TRIANGLES}; reduce (decimate) it where it was made"
        )
    broken = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if broken.size:
        raise InputError(f"{name}: vertex {broken[0]} is {vertices[broken[0]].tolist()}; allowed: finite coordinates")
    outside = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))
    if outside.size:
        raise InputError(
            f"{name}: triangle {outside[0]} names vertices {triangles[outside[0]].tolist()}; allowed: 0 to {len(vertices) - 1}"
        )


def _read_by_trimesh(path: Path, extra: str) -> tuple[Floats, Ints]:
    try:
        import trimesh
    except ImportError as error:
        raise InputError(
            f"mesh {path} needs trimesh to be read; install it with: pip install 'wearable-haptics[{extra}]'"
        ) from error
    try:
        with path.open("rb") as file:
            found: Any = trimesh.load(file, file_type=path.suffix[1:].lower(), process=False)
        # A cloud of points has no faces, and what is not understood comes as an empty scene.
        vertices = np.asarray(getattr(found, "vertices", ()), float).reshape(-1, 3)
        triangles = np.asarray(getattr(found, "faces", ()), np.int64).reshape(-1, 3)
    except Exception as error:  # the reader has no error type of its own: whatever it raises, the file is broken
        raise InputError(f"mesh {path} cannot be read as {path.suffix[1:].upper()}: {error}{_commas(path)}") from error
    if path.suffix.lower() == ".ply":
        _refuse_cut_short(path)
    if path.suffix.lower() == ".stl" and len(vertices):
        vertices, number = np.unique(vertices, axis=0, return_inverse=True)
        triangles = number.ravel()[triangles]
    return vertices, triangles


def _read_obj(path: Path) -> tuple[Floats, Ints]:
    """General readers part the mesh where groups, materials or textures meet; here they do not matter."""
    vertices: list[list[float]] = []
    faces: list[tuple[int, str, list[int]]] = []
    for number, line in _lines(path):
        words = line.split("#")[0].split()
        try:
            if words[:1] == ["v"]:
                vertices.append([float(word) for word in words[1:4]])
                if len(vertices[-1]) != 3 or not np.isfinite(vertices[-1]).all():
                    raise ValueError
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                # Negative numbers count back from the last vertex so far.
                faces.append((number, line, [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]))
                if len(corners) < 3 or 0 in corners:
                    raise ValueError
        except ValueError as error:
            raise InputError(f"{path}, line {number}: {line.strip()!r}; allowed: {_allowed(words)}") from error
    for number, line, corners in faces:
        if not all(0 <= corner < len(vertices) for corner in corners):
            raise InputError(f"{path}, line {number}: {line.strip()!r}; allowed: vertices 1 to {len(vertices)}")
    fans = [(corners[0], *pair) for _, _, corners in faces for pair in pairwise(corners[1:])]
    return np.array(vertices).reshape(-1, 3), np.array(fans, np.int64).reshape(-1, 3)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Each statement with the number of its last line: a backslash at a line's end joins the next one to it."""
    joined = ""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            joined += line.rstrip("\r\n")
            if joined.endswith("\\"):
                joined = joined[:-1] + " "
                continue
            yield number, joined
            joined = ""


def _allowed(words: list[str]) -> str:
    if words[0] == "f":
        return "f and at least three vertex numbers, from 1"
    if any("," in word for word in words):
        return "v and three finite coordinates with decimal points; these have decimal commas, export it with points"
    return "v and three finite coordinates"


def _refuse_cut_short(path: Path) -> None:
    """A PLY file of text has a line for each element that its header counts, and a face begins with its number of corners."""
    header, _, body = path.read_bytes().partition(b"end_header")
    if not re.search(rb"^format\s+ascii", header, re.MULTILINE):
        return
    elements = re.findall(rb"^element\s+(\w+)\s+(\d+)", header, re.MULTILINE)
    rows = [row for row in body.splitlines() if row.strip()]
    named = sum(int(count) for _, count in elements)
    whole = len(rows) >= named
    if whole and elements and elements[-1][0] == b"face" and named:
        last = rows[named - 1].split()
        whole = last[0].isdigit() and len(last) > int(last[0])
    if not whole:
        raise InputError(
            f"mesh {path} is cut short: {len(rows)} lines after its header; allowed: the {named} that it names, whole"
        )


def _commas(path: Path) -> str:
    with path.open("rb") as file:
        return "; it has decimal commas, export it with points" if re.search(rb"\s-?\d+,\d+\s", file.read(4096)) else ""


def _what_it_is(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(8)
    for mark, kind in _OTHERS.items():
        if start.startswith(mark) and kind != path.suffix.lower():
            return f"; it begins like a {kind} file, and is named {path.suffix}"
    return ""

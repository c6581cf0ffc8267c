"""Polygons of a PLY file, text or binary, with faces of any number of corners."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"},
    **{
        "int8": "i1",
        "uint8": "u1",
        "int16": "i2",
        "uint16": "u2",
        "int32": "i4",
        "uint32": "u4",
        "float32": "f4",
        "float64": "f8",
    },
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    length: str | None = None
    """Type of the number before a list; None: no list."""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def read_ply(content: bytes, max_faces: int) -> tuple[NDArray[np.float64], list[list[int]], int]:
    """Read a PLY file's vertices and faces.

    :param content: the whole file.
    :param max_faces: of a file with more faces than this nothing is read.
    :return: vertices, ``(v, 3)``, the corners of each face (vertex indices), and how many faces the file has.
    :raises ValueError: not a PLY file, cut short, or without coordinates; the message names what is wrong.
    """
    if not content.startswith(b"ply"):
        return np.empty((0, 3)), [], 0
    head, mark, body = content.partition(b"end_header")
    order, elements = _header(head.decode("ascii", errors="replace"))
    if not mark:
        raise ValueError("it is cut short: its header has no end")
    body = body[body.find(b"\n") + 1 :]
    min_bytes = sum(element.count for element in elements)  # nothing is smaller than one byte
    if min_bytes > len(body):
        raise ValueError(f"it is cut short: {len(body)} bytes after its header, which names {min_bytes} elements")
    faces = sum(element.count for element in elements if element.name == "face")
    if faces > max_faces:
        return np.empty((0, 3)), [], faces
    try:
        found = _text(elements, body) if not order else _binary(elements, body, order)
    except (struct.error, IndexError) as error:
        raise ValueError("it is cut short: its header names more") from error
    vertex, face = found.get("vertex", {}), found.get("face", {})
    if not all(axis in vertex for axis in "xyz"):
        raise ValueError("its vertices have no x, y, z")
    if found.get("tristrips"):
        raise ValueError("its surface is in strips; export it as faces")
    corners = next((face[name] for name in _CORNERS if name in face), [])
    if face and not any(name in face for name in _CORNERS):
        raise ValueError(f"its faces have no {' or '.join(_CORNERS)}, only {', '.join(face)}")
    return np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], axis=1), corners, faces


def _header(text: str) -> tuple[str, list[_Element]]:
    order, elements = None, []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = _ORDERS[words[1]]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2])))
                if elements[-1].count < 0:
                    raise ValueError
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append(_Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append(_Property(words[2], _TYPES[words[1]]))
        except (KeyError, IndexError, ValueError) as error:
            raise ValueError(f"line {number}: {line.strip()[:80]!r} does not belong in a header") from error
    if order is None:
        raise ValueError("its header names no format")
    return order, elements


def _text(elements: list[_Element], body: bytes) -> dict[str, dict[str, Any]]:
    words, at, found = body.split(), 0, {}
    for element in elements:
        columns: dict[str, list[Any]] = {one.name: [] for one in element.properties}
        for _ in range(element.count):
            for one in element.properties:
                if one.length is None:
                    columns[one.name].append(float(words[at]))
                    at += 1
                    continue
                last = at + 1 + int(words[at])
                if last > len(words) or last <= at:
                    raise IndexError
                read = float if one.kind[0] == "f" else int
                columns[one.name].append([read(word) for word in words[at + 1 : last]])
                at = last
        found[element.name] = columns
    return found


def _binary(elements: list[_Element], body: bytes, order: str) -> dict[str, dict[str, Any]]:
    at, found = 0, {}
    for element in elements:
        if any(one.length for one in element.properties):
            found[element.name], at = _rows(element, body, at, order)
            continue
        row = np.dtype([(f"{number}", order + one.kind) for number, one in enumerate(element.properties)])
        if at + row.itemsize * element.count > len(body):
            raise IndexError
        table = np.frombuffer(body, row, element.count, at) if row.itemsize else np.zeros(element.count, row)
        found[element.name] = {one.name: table[f"{number}"] for number, one in enumerate(element.properties)}
        at += row.itemsize * element.count
    return found


def _rows(element: _Element, body: bytes, at: int, order: str) -> tuple[dict[str, list[Any]], int]:
    columns: dict[str, list[Any]] = {one.name: [] for one in element.properties}
    plan = [
        (columns[one.name], np.dtype(one.kind), None if one.length is None else np.dtype(one.length))
        for one in element.properties
    ]
    for _ in range(element.count):
        for column, kind, length in plan:
            if length is None:
                column.append(struct.unpack_from(order + kind.char, body, at)[0])
                at += kind.itemsize
                continue
            count = int(struct.unpack_from(order + length.char, body, at)[0])
            at += length.itemsize
            if count < 0 or at + count * kind.itemsize > len(body):
                raise IndexError
            column.append(list(struct.unpack_from(f"{order}{count}{kind.char}", body, at)))
            at += count * kind.itemsize
    return columns, at

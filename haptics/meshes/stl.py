"""Corners of an STL file, text (of one solid or several) or binary."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEAD = 84
_CORNER = re.compile(rb"^\s*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)\s", re.IGNORECASE | re.MULTILINE)


def read_stl(content: bytes, max_triangles: int) -> tuple[NDArray[np.float64], int]:
    """Read an STL file's triangles.

    A binary file may begin as a text does, so that its length decides; it may end a few bytes after the last triangle.

    :param content: the whole file.
    :param max_triangles: of a file with more triangles than this none is read.
    :return: the corners of each triangle, ``(t, 3, 3)``, and how many triangles the file has.
    :raises ValueError: neither kind, cut short, or a corner that is not three numbers; the message names what is wrong.
    """
    if len(content) >= _HEAD:
        counted = int.from_bytes(content[_HEAD - 4 : _HEAD], "little")
        held = (len(content) - _HEAD) // _FACET.itemsize
        if counted == held:
            facets = np.frombuffer(content, _FACET, counted if counted <= max_triangles else 0, _HEAD)
            return facets["corners"].astype(np.float64), counted
        if b"\0" in content[:_HEAD]:
            raise ValueError(f"it is cut short, or not STL: it counts {counted} triangles and has room for {held}")
    if not re.match(rb"\s*solid\b", content, re.IGNORECASE):
        return np.empty((0, 3, 3)), 0
    begun, ended, named = (
        len(re.findall(rb"^\s*" + word, content, re.IGNORECASE | re.MULTILINE))
        for word in (rb"facet\b", rb"endfacet\b", rb"vertex\b")
    )
    if begun != ended or named != 3 * begun or not re.search(rb"\bendsolid\b[^\n]*\s*$", content, re.IGNORECASE):
        raise ValueError(f"it is cut short: {begun} facets begin, {ended} end, {named} corners")
    if begun > max_triangles:
        return np.empty((0, 3, 3)), begun
    corners = _CORNER.findall(content)
    if len(corners) != named:
        raise ValueError("a corner is not three numbers")
    return np.array(corners, dtype=bytes).reshape(-1).astype(np.float64).reshape(-1, 3, 3), begun

"""Triangles of an OBJ file. Groups, materials and textures are ignored: they do not divide the mesh."""

from __future__ import annotations

import codecs
from array import array
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def read_obj(path: Path, max_triangles: int) -> tuple[Floats, Ints, int]:
    """Read an OBJ file's vertices and faces; polygons are cut into fans.

    :param path: the file.
    :param max_triangles: triangles above this number are only counted.
    :return: vertices, ``(v, 3)``, triangles, ``(t, 3)``, and how many triangles the file has.
    :raises InputError: a line that is not understood, or a face with a vertex that is not there; with the line.
    """
    vertices, fans, lines, count = array("d"), array("q"), array("q"), 0
    for number, line in _lines(path):
        words = line.split("#")[0].split()
        try:
            if words[:1] == ["v"]:
                place = [_number(word) for word in words[1:4]]
                if len(place) != 3 or not np.isfinite(place).all():
                    raise ValueError
                vertices.extend(place)
            elif words[:1] == ["f"]:
                count += len(words) - 3
                if count > max_triangles:
                    continue
                corners = [int(word.split("/")[0]) for word in words[1:]]
                if len(corners) < 3 or 0 in corners:
                    raise ValueError
                # Negative numbers count back from the last vertex so far.
                known = len(vertices) // 3
                first, *rest = [corner - 1 if corner > 0 else known + corner for corner in corners]
                for second, third in pairwise(rest):
                    fans.extend((first, second, third))
                    lines.append(number)
        except (ValueError, OverflowError) as error:
            raise InputError(f"{path}, line {number}: {line.strip()[:200]!r}; expected {_expected(words)}") from error
    found = np.array(vertices).reshape(-1, 3), np.array(fans, np.int64).reshape(-1, 3)
    outside = np.flatnonzero(((found[1] < 0) | (found[1] >= len(found[0]))).any(axis=1))
    if outside.size:
        line = next(line for number, line in _lines(path) if number == lines[outside[0]])
        raise InputError(f"{path}, line {lines[outside[0]]}: {line.strip()[:200]!r}; allowed: vertices 1 to {len(found[0])}")
    return *found, count


def _number(word: str) -> float:
    if "_" in word:  # Python reads 0_5, no other program does
        raise ValueError
    return float(word)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Each statement with the number of its last line: a backslash at a line's end joins the next one to it."""
    with path.open("rb") as file:
        start = file.read(2)
    encoding = "utf-16" if start in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"
    joined = ""
    with path.open(encoding=encoding, errors="replace") as file:
        for number, line in enumerate(file, start=1):
            joined += line.rstrip("\r\n")
            if joined.endswith("\\"):
                joined = joined[:-1] + " "
                continue
            yield number, joined
            joined = ""


def _expected(words: list[str]) -> str:
    if words[0] == "f":
        return "f and at least three vertex numbers, from 1"
    if any("," in word for word in words):
        return "v and three finite coordinates with decimal points; these have decimal commas, export it with points"
    return "v and three finite coordinates"

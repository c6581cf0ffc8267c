"""Remove triangles without area from a surface without opening it."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from haptics.meshes.edges import half_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def unfolded(vertices: Floats, triangles: Ints, flat: NDArray[np.bool_]) -> Ints:
    """The triangles without the flat ones.

    A flat triangle whose middle corner lies on its longest side joins the triangle beyond that side to two others; with it
    gone, they would part. So the triangle beyond is cut in two at the middle corner. Where the longest side has two triangles
    without it, or another side has none, nothing parts.

    :param vertices: ``(v, 3)``.
    :param triangles: ``(t, 3)``, vertex indices.
    :param flat: ``(t,)``, which triangles have no area.
    :return: ``(k, 3)``, the others, some of them cut in two.
    """
    faces = dict(enumerate(triangles.tolist()))
    wanted = {_key(a, b) for a, b in half_edges(triangles[flat]).tolist() if a != b}
    near = np.isin(triangles, triangles[flat]).sum(axis=1) >= 2
    on_edge: dict[tuple[int, int], set[int]] = defaultdict(set)
    for number in np.flatnonzero(near).tolist():
        for key in _keys(faces[number]):
            if key in wanted and len(set(faces[number])) == 3:
                on_edge[key].add(number)
    longest_first = sorted(np.flatnonzero(flat).tolist(), key=lambda number: -_longest(vertices, faces[number]))
    for number in longest_first:
        corners = faces.pop(number)
        if len(set(corners)) < 3:
            continue
        for key in _keys(corners):
            on_edge[key].discard(number)
        a, middle, b = _with_middle(vertices, corners)
        beyond = on_edge[_key(a, b)]
        if len(beyond) != 1 or any(len(on_edge[key]) != 1 for key in (_key(a, middle), _key(middle, b))):
            continue
        (other,) = beyond
        old = faces[other]
        if middle in old:
            continue
        added = max(len(triangles), max(faces) + 1)
        for key in _keys(old):
            on_edge[key].discard(other)
        faces[other] = [middle if corner == b else corner for corner in old]
        faces[added] = [middle if corner == a else corner for corner in old]
        for one in (other, added):
            for key in _keys(faces[one]):
                on_edge[key].add(one)
    return np.array(list(faces.values()), dtype=np.int64).reshape(-1, 3)


def _key(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


def _keys(corners: list[int]) -> list[tuple[int, int]]:
    a, b, c = corners
    return [_key(a, b), _key(b, c), _key(c, a)]


def _longest(vertices: Floats, corners: list[int]) -> float:
    points = vertices[corners]
    return float(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1).max())


def _with_middle(vertices: Floats, corners: list[int]) -> tuple[int, int, int]:
    """The ends of the longest side, with the third corner between."""
    points = vertices[corners]
    k = int(np.argmax(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)))
    return corners[k], corners[(k + 2) % 3], corners[(k + 1) % 3]

"""Triangles turned to face the same side, and outward where a surface is closed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptics.meshes.edges import neighbours
from haptics.meshes.winding import winding_number

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAX_PIECES = 10_000
"""Of more, it takes minutes to find which lies within which; a mesh of so many is a heap of loose triangles."""


def consistent(triangles: Ints) -> tuple[Ints, int]:
    """The triangles with neighbours facing the same side; in each piece the fewer are turned.

    Each triangle has two states, as it is and turned; an edge joins the states that agree across it, so that a piece falls into
    two halves, one the other's reverse. A one-sided piece (a Möbius band) does not, and is left as it is.

    :param triangles: ``(t, 3)``, vertex indices.
    :return: the triangles, ``(t, 3)``, and how many were turned.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count, pairs = len(triangles), neighbours(triangles)
    if pairs.alike.all():
        return triangles, 0
    across = np.where(pairs.alike, 0, count)
    rows = np.concatenate([pairs.one, pairs.one + count])
    columns = np.concatenate([pairs.other + across, pairs.other + count - across])
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * count, 2 * count))
    _, label = connected_components(graph, directed=False)
    kept, turned = label[:count], label[count:]
    half, piece = np.minimum(kept, turned), kept < turned
    in_half = np.bincount(half, piece, minlength=2 * count)
    in_other = np.bincount(half, ~piece, minlength=2 * count)
    turn = np.where(in_half[half] >= in_other[half], ~piece, piece) & (kept != turned)
    return np.where(turn[:, None], triangles[:, ::-1], triangles), int(turn.sum())


def outward(vertices: Floats, triangles: Ints) -> tuple[Ints, int]:
    """Turn a closed surface to face outward.

    A piece that is inside out is turned with all that lies within it; what lies within others is otherwise left as it is, since
    a cavity faces its middle.

    :param vertices: ``(v, 3)``.
    :param triangles: ``(t, 3)``, vertex indices, of a closed surface with neighbours that agree.
    :return: the triangles, ``(t, 3)``, and how many were turned.
    """
    corners = vertices[triangles]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    pieces, piece = pieces_of(triangles)
    inside_out = np.bincount(piece, volume, minlength=pieces) < 0.0
    if not inside_out.any():
        return triangles, 0
    order = np.argsort(piece, kind="stable")
    by_piece = np.split(corners[order], np.cumsum(np.bincount(piece))[:-1])
    turn = inside_out[_outermost(by_piece)][piece]
    return np.where(turn[:, None], triangles[:, ::-1], triangles), int(turn.sum())


def pieces_of(triangles: Ints) -> tuple[int, Ints]:
    """Separate a surface into pieces that hang together by edges.

    :param triangles: ``(t, 3)``, vertex indices.
    :return: how many pieces there are, and the piece of each triangle, ``(t,)``, from 0.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs, count = neighbours(triangles), len(triangles)
    graph = coo_array((np.ones(len(pairs.one)), (pairs.one, pairs.other)), shape=(count, count))
    pieces, piece = connected_components(graph, directed=False)
    return int(pieces), piece


def _outermost(pieces: list[Floats]) -> Ints:
    """The number of the largest piece that each lies within, or its own."""
    low, high = (np.array([edge(piece, axis=(0, 1)) for piece in pieces]) for edge in (np.min, np.max))
    size = (high - low).prod(axis=1)
    found = np.arange(len(pieces))
    for one, corners in enumerate(pieces):
        around = np.flatnonzero((low <= low[one]).all(axis=1) & (high >= high[one]).all(axis=1) & (size > size[one]))
        for other in around[np.argsort(-size[around], kind="stable")]:
            if abs(winding_number(corners[0, :1], pieces[other])[0]) > 0.5:
                found[one] = other
                break
    return found

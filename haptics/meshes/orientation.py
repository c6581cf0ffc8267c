"""Triangles turned to face one way, and outward where a surface is closed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptics.meshes.edges import neighbours
from haptics.meshes.winding import winding_number

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def consistent(triangles: Ints) -> tuple[Ints, int]:
    """The triangles with neighbours facing the same way, and how many were turned: in each piece the fewer.

    Each triangle has two states, as it is and turned; an edge joins the states that agree across it, so that a piece falls into
    two halves, one the other's reverse. A one-sided piece (a Möbius band) does not, and is left as it is.
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
    return _turned(triangles, turn), int(turn.sum())


def outward(vertices: Floats, triangles: Ints) -> tuple[Ints, int]:
    """A closed surface facing outward, and how many triangles were turned.

    Turned are the whole where its volume is negative, and then each piece that is inside out by itself, unless it lies within
    others: that is a cavity.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corners = vertices[triangles]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    turn = np.full(len(triangles), volume.sum() < 0.0)
    volume = np.where(turn, -volume, volume)
    pairs = neighbours(triangles)
    graph = coo_array((np.ones(len(pairs.one)), (pairs.one, pairs.other)), shape=(len(triangles), len(triangles)))
    pieces, piece = connected_components(graph, directed=False)
    inside_out = np.flatnonzero(np.bincount(piece, volume, minlength=pieces) < 0.0)
    others = ~np.isin(piece, inside_out)
    facing = np.where(turn[:, None, None], corners[:, ::-1], corners)
    for one in inside_out:
        point = corners[piece == one][0, 0][None]
        if winding_number(point, facing[others])[0] < 0.5:
            turn ^= piece == one
    return _turned(triangles, turn), int(turn.sum())


def _turned(triangles: Ints, turn: NDArray[np.bool_]) -> Ints:
    return np.where(turn[:, None], triangles[:, ::-1], triangles) if turn.any() else triangles

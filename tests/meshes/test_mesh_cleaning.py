"""Mending: each fault alone and together, against the surface that was spoilt; and a sound surface is not touched."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from haptics.meshes import capped, cleaned, holes, holes_in_words, outward
from haptics.meshes.edges import open_edges
from haptics.meshes.orientation import consistent

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * (0.06, 0.1, 0.03)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])
VOLUME = 0.06 * 0.1 * 0.03


def volume(vertices, triangles) -> float:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def mended(vertices, triangles, min_area=1e-12):
    return cleaned(np.asarray(vertices, float), np.asarray(triangles), min_area)


def is_the_box(vertices, triangles) -> bool:
    """Judged by another library: closed, wound alike, the box's volume."""
    trimesh = pytest.importorskip("trimesh")
    found = trimesh.Trimesh(vertices, triangles, process=False)
    return found.is_watertight and found.is_winding_consistent and abs(abs(found.volume) - VOLUME) < 1e-6 * VOLUME


def test_a_sound_surface_comes_back_as_it_is_without_a_word():
    vertices, triangles, notes = mended(CORNERS, BOX)
    assert notes == []
    assert np.array_equal(vertices, CORNERS)
    assert np.array_equal(triangles, BOX)


def test_fine_detail_of_a_whole_surface_is_not_welded():
    """Two corners 1 um apart, but no open edge between them."""
    vertices = np.vstack([CORNERS, CORNERS[7] - [1e-6, 1e-6, 0]])
    triangles = np.vstack([BOX[:-2], [[1, 5, 7], [1, 7, 8], [1, 8, 3], [7, 3, 8]]])
    assert len(open_edges(triangles)) == 0
    found, _, notes = mended(vertices, triangles, 1e-16)
    assert (len(found), notes) == (9, [])


@pytest.mark.parametrize("noise_m", [0.0, 1e-9, 5e-7, 2e-6])
def test_a_seam_of_copied_vertices_is_welded(noise_m):
    rng = np.random.default_rng(3)
    soup = CORNERS[BOX].reshape(-1, 3) + rng.uniform(-noise_m, noise_m, (36, 3))
    vertices, triangles, notes = mended(soup, np.arange(36).reshape(-1, 3))
    assert len(vertices) == 8
    assert is_the_box(vertices, triangles) or noise_m > 1e-7
    assert volume(vertices, triangles) == pytest.approx(VOLUME, rel=1e-3)
    assert notes == ["28 vertices along open edges welded to others within 1e-05 m"]


def test_many_copies_of_one_place_are_welded_without_pairs_of_all():
    """Pairs of 30,000 copies of one corner would be 450 million."""
    copies = np.vstack([CORNERS, np.repeat(CORNERS[:1], 30_000, axis=0)])
    spikes = np.column_stack([np.arange(8, 30_008), np.full(30_000, 1), np.full(30_000, 2)])
    vertices, triangles, notes = mended(copies, np.vstack([BOX, spikes]))
    assert "29999 vertices along open edges welded" in notes[0]
    assert (len(vertices), len(triangles)) == (9, 13)


def test_unused_degenerate_and_double_triangles_are_left_out_and_counted():
    vertices, triangles, notes = mended([*CORNERS, [9, 9, 9]], [*BOX, BOX[3], BOX[5][::-1], [1, 1, 2]])
    assert notes == [
        "1 vertex of no triangle left out",
        "1 triangle without area left out",
        "2 triangles given twice left out",
    ]
    assert np.array_equal(vertices, CORNERS)
    assert np.array_equal(triangles, BOX)


def test_a_flat_triangle_that_joins_three_others_leaves_no_slit():
    """The middle of an edge is a corner on one side of it and not on the other: the flat triangle between closes the box."""
    middle = 0.5 * (CORNERS[0] + CORNERS[1])
    a, b, c = BOX[0]
    assert {a, b} == {0, 1}
    triangles = np.vstack([[[a, 8, c], [8, b, c], [a, b, 8]], BOX[1:]])
    assert len(open_edges(triangles)) == 0
    vertices, found, notes = mended(np.vstack([CORNERS, middle]), triangles)
    assert notes == ["1 triangle without area left out"]
    assert is_the_box(vertices, found)
    assert len(found) == 14


def test_a_chain_of_flat_triangles_leaves_no_slit():
    along = np.linspace(0, 1, 5)[1:-1, None]
    a, b, c = BOX[0]
    between = CORNERS[a] + along * (CORNERS[b] - CORNERS[a])
    line = [a, 8, 9, 10, b]
    triangles = np.vstack([[[s, e, c] for s, e in pairwise(line)], [[a, b, 9], [a, 9, 8], [9, b, 10]], BOX[1:]])
    assert len(open_edges(triangles)) == 0
    vertices, found, notes = mended(np.vstack([CORNERS, between]), triangles)
    assert notes == ["3 triangles without area left out"]
    assert is_the_box(vertices, found)


def test_a_needle_shrinks_to_an_edge():
    vertices = np.vstack([CORNERS, CORNERS[7] - [1e-9, 0, 0]])
    triangles = np.vstack([BOX[:-2], [[1, 5, 7], [1, 7, 8], [1, 8, 3], [7, 3, 8]]])
    found, faces, notes = mended(vertices, triangles)
    assert notes == ["2 triangles without area left out"]
    assert is_the_box(found, faces)
    assert len(found) == 8


def test_triangles_turned_against_the_rest_are_turned_back():
    spoilt = BOX.copy()
    spoilt[[2, 7, 8]] = spoilt[[2, 7, 8], ::-1]
    vertices, triangles, notes = mended(CORNERS, spoilt)
    assert notes == ["3 triangles turned to face as the rest of 12 do"]
    assert np.array_equal(triangles, BOX)
    assert volume(vertices, triangles) == pytest.approx(VOLUME)


def test_pieces_are_turned_each_by_its_own_majority():
    spoilt = np.vstack([BOX, BOX[:, ::-1] + 8])
    spoilt[[0, 15]] = spoilt[[0, 15], ::-1]
    triangles, turned = consistent(spoilt)
    assert turned == 2
    assert np.array_equal(triangles, np.vstack([BOX, BOX[:, ::-1] + 8]))


def test_a_moebius_band_is_left_as_it_is():
    band = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4], [4, 5, 1], [5, 0, 1]])
    triangles, turned = consistent(band)
    assert turned == 0
    assert np.array_equal(triangles, band)


@pytest.mark.parametrize("whole_turned", [False, True])
def test_outward_turns_what_is_inside_out_and_keeps_cavities(whole_turned):
    """A hollow box beside an inside-out one."""
    vertices = np.vstack([CORNERS, 0.5 * CORNERS, CORNERS + np.array([1.0, 0, 0])])
    right = np.vstack([BOX, BOX[:, ::-1] + 8, BOX + 16])
    spoilt = np.vstack([right[:24], right[24:, ::-1]])
    triangles, turned = outward(vertices, spoilt[:, ::-1] if whole_turned else spoilt)
    assert np.array_equal(triangles, right)
    assert turned == (24 if whole_turned else 12)


def test_pieces_that_overlap_are_each_turned_outward():
    vertices = np.vstack([CORNERS, CORNERS + np.array([0.02, 0, 0])])
    triangles, turned = outward(vertices, np.vstack([BOX, BOX[:, ::-1] + 8]))
    assert (turned, volume(vertices, triangles)) == (12, pytest.approx(2 * VOLUME))


def test_holes_are_all_counted_and_capped():
    open_box = BOX[4:-2]  # without the sides at x = -0.03, x = 0.03 and one at z
    found = holes(open_box)
    assert [len(rim) for rim in found] == [len(open_edges(open_box))]
    two = np.delete(BOX, [0, 1, 2], axis=0)
    assert [len(rim) for rim in holes(two)] == [4, 3]
    assert holes_in_words(CORNERS, holes(two)).startswith("2 holes (4 edges about (-0.03, 0, 0); 3 edges about (0.03, ")
    assert is_the_box(*capped(CORNERS, two, holes(two)))
    assert holes(BOX) == []


def test_more_holes_than_can_be_named_are_counted():
    apart = np.vstack([np.delete(BOX, 0, axis=0) + 8 * k for k in range(5)])
    vertices = np.vstack([CORNERS + np.array([k, 0, 0]) for k in range(5)])
    words = holes_in_words(vertices, holes(apart))
    assert words.startswith("5 holes (3 edges about ")
    assert words.endswith(" and 2 more)")


def ball(rings: int) -> tuple[np.ndarray, np.ndarray]:
    polar, turn = np.meshgrid(np.pi * np.arange(1, rings) / rings, np.pi * np.arange(2 * rings) / rings, indexing="ij")
    body = np.stack([np.sin(polar) * np.cos(turn), np.cos(polar), np.sin(polar) * np.sin(turn)], axis=-1).reshape(-1, 3)
    at = 2 + np.arange(len(body)).reshape(rings - 1, -1)
    following = np.roll(at, -1, axis=1)
    sides = [[at[:-1], following[:-1], following[1:]], [at[:-1], following[1:], at[1:]]]
    ends = [[np.zeros_like(at[0]), following[0], at[0]], [np.ones_like(at[0]), at[-1], following[-1]]]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in (*sides, *ends)])
    return 0.04 * np.vstack([[0, 1, 0], [0, -1, 0], body]), faces


def spoilt(rng: np.random.Generator, v: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Any mixture of what programs do to a surface without changing it."""
    of = rng.random(7) < 0.5
    if of[0]:  # a corner on the edge of a neighbour, with a flat triangle between
        for _ in range(rng.integers(1, 6)):
            k = rng.integers(len(f))
            a, b, c = f[k]
            v = np.vstack([v, v[a] + rng.uniform(0.1, 0.9) * (v[b] - v[a])])
            n = len(v) - 1
            f = np.vstack([np.delete(f, k, axis=0), [[a, n, c], [n, b, c], [a, b, n]]])
    if of[1]:  # every triangle with its own corners, not quite in the same places
        v = v[f].reshape(-1, 3) + rng.uniform(-1, 1, (3 * len(f), 3)) * 10 ** rng.uniform(-10, -6.3)
        f = np.arange(len(v)).reshape(-1, 3)
    if of[2]:
        f = np.vstack([f, f[rng.integers(0, len(f), 5)]])
    if of[3]:
        f = np.where(rng.random(len(f))[:, None] < 0.2, f[:, ::-1], f)
    if of[4]:
        v = np.vstack([v, rng.uniform(-1, 1, (4, 3))])
    if of[5]:
        f = np.vstack([f, [[a, a, b] for a, b in rng.integers(0, len(v) - 4, (3, 2))]])
    return v, rng.permutation(f) if of[6] else f


@pytest.mark.parametrize("seeds", [range(30), pytest.param(range(30, 2000), marks=pytest.mark.soak)], ids=["few", "many"])
def test_a_ball_spoilt_in_any_way_is_the_closed_ball_again(seeds):
    for seed in seeds:
        rng = np.random.default_rng(seed)
        right = ball(int(rng.integers(3, 9)))
        v, f = spoilt(rng, *right)
        extent = float(np.ptp(v[np.unique(f)], axis=0).max())
        vertices, triangles, _ = mended(v, f, 0.5e-12 * extent**2)
        triangles, _ = outward(vertices, triangles)
        assert len(open_edges(triangles)) == 0, seed
        half = np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        assert (np.unique(half, axis=0, return_counts=True)[1] == 2).all(), seed
        assert volume(vertices, triangles) == pytest.approx(volume(*right), rel=2e-3), seed  # corners moved by up to 0.5 um

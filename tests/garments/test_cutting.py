import numpy as np
import pytest

from haptics.errors import InputError
from haptics.garments.cut.coarsening import anchored, coarsened
from haptics.garments.cut.cutting import cut_out, openings, trimmed
from haptics.garments.cut.fairing import spanned, spread
from haptics.garments.mesh import SurfaceMesh, checked_mesh


def tube(around, rings, radius=0.05, length=0.3):
    """An open tube along z with its normals outward; ``around`` vertices a ring."""
    turn, ring = np.meshgrid(np.arange(around), np.arange(rings))
    angle = 2 * np.pi * (turn + 0.5 * (ring % 2)) / around
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), length * ring / (rings - 1)], axis=-1).reshape(-1, 3)
    triangles = []
    for r in range(rings - 1):
        for t in range(around):
            a, b = r * around + t, r * around + (t + 1) % around
            c, d = a + around, b + around
            triangles += [(a, b, c), (b, d, c)] if r % 2 == 0 else [(a, b, d), (a, d, c)]
    return vertices, np.array(triangles, dtype=np.int64)


@pytest.mark.parametrize("height", [0.1, 0.1234, 0.21, 0.287])
def test_the_rim_lies_on_the_zero_line(height):
    vertices, triangles = tube(24, 20)
    weights, cut = cut_out(vertices, triangles, height - vertices[:, 2])
    points = weights @ vertices
    mesh = checked_mesh(points, cut, "cut tube")
    rim = points[np.unique(mesh.boundary_edges)]
    assert rim[rim[:, 2] > 0.5 * height][:, 2] == pytest.approx(height, abs=1e-12)
    assert openings(cut) == 2


def test_no_sliver_is_made_wherever_the_line_runs():
    vertices, triangles = tube(24, 20)
    for height in np.linspace(0.1, 0.14, 23):
        slope = 0.2 * vertices[:, 0]
        weights, cut = cut_out(vertices, triangles, height + slope - vertices[:, 2])
        corners = (weights @ vertices)[cut]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        quality = 4 * np.sqrt(3) * SurfaceMesh(weights @ vertices, cut).areas_m2 / np.sum(sides**2, axis=1)
        assert quality.min() > 0.3


def test_only_the_largest_piece_is_kept():
    vertices, triangles = tube(24, 30)
    field = np.maximum(0.05 - vertices[:, 2], vertices[:, 2] - 0.12)
    weights, cut = cut_out(vertices, triangles, field)
    assert (weights @ vertices)[:, 2].min() == pytest.approx(0.12)
    assert openings(cut) == 2


def test_a_field_that_is_positive_nowhere_leaves_nothing():
    vertices, triangles = tube(12, 5)
    with pytest.raises(InputError, match="nothing is left of the garment"):
        cut_out(vertices, triangles, -np.ones(len(vertices)))


def test_ears_and_triangles_that_hang_by_a_corner_are_trimmed():
    vertices, triangles = tube(12, 6)
    rim = [edge for edge in SurfaceMesh(vertices, triangles).boundary_edges if vertices[edge[0], 2] == 0]
    a, b = rim[0]
    ear = [[b, a, len(vertices)]]
    hanging = [[a, len(vertices) + 1, len(vertices) + 2]]
    assert np.array_equal(trimmed(np.concatenate([triangles, ear, hanging])), triangles)


def test_a_coarser_tube_has_about_the_number_asked_and_stays_on_the_finer_one():
    vertices, triangles = tube(60, 60)
    tied, fewer = coarsened(vertices, triangles, 500)
    points = tied @ vertices
    mesh = checked_mesh(points, fewer, "coarser tube")
    assert len(points) == pytest.approx(500, rel=0.03)
    assert openings(fewer) == 2
    assert tied.data.min() >= 0
    assert tied.sum(axis=1) == pytest.approx(np.ones(len(points)), abs=1e-12)
    _, away = anchored(points, vertices, triangles)
    assert away.max() < 1e-12
    rim = points[np.unique(mesh.boundary_edges)]
    assert np.minimum(rim[:, 2], 0.3 - rim[:, 2]) == pytest.approx(0.0, abs=1e-12)
    assert mesh.areas_m2.sum() == pytest.approx(2 * np.pi * 0.05 * 0.3, rel=0.02)


def test_points_are_tied_to_the_nearest_of_a_triangle_and_of_an_edge():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points = np.array([[0.25, 0.25, 0.5], [2.0, 0, 0], [0.5, -1.0, 0]])
    tied, distance = anchored(points, vertices, np.array([[0, 1, 2]]))
    assert tied.toarray() == pytest.approx(np.array([[0.5, 0.25, 0.25], [0, 1, 0], [0.5, 0.5, 0]]))
    assert distance == pytest.approx([0.5, 1.0, 1.0])
    tied, distance = anchored(points, vertices, np.array([[0, 1]]))
    assert tied.toarray() == pytest.approx(np.array([[0.75, 0.25, 0], [0, 1, 0], [0.5, 0.5, 0]]))
    assert distance == pytest.approx([np.hypot(0.25, 0.5), 1.0, 1.0])


def test_a_cleft_is_spanned_and_all_else_stays():
    vertices, triangles = tube(48, 48, radius=0.1)
    dented = vertices.copy()
    near = np.exp(-((vertices[:, 2] - 0.15) ** 2 + vertices[:, 1] ** 2) / 0.006**2) * (vertices[:, 0] > 0)
    dented[:, 0] -= 0.03 * near
    faired = spanned(dented, triangles, np.ones(len(vertices), dtype=bool))
    assert np.linalg.norm(faired - vertices, axis=1).max() < 0.004
    far = (np.abs(vertices[:, 2] - 0.15) > 0.05) | (vertices[:, 0] < 0)
    assert np.array_equal(faired[far], dented[far])


def test_a_skin_without_folds_is_left_alone():
    vertices, triangles = tube(48, 48)
    assert np.array_equal(spanned(vertices, triangles, np.ones(len(vertices), dtype=bool)), vertices)


def test_spreading_keeps_what_is_constant_and_what_is_far():
    vertices, triangles = tube(24, 60)
    assert spread(np.ones(len(vertices)), triangles, 10) == pytest.approx(np.ones(len(vertices)), abs=1e-15)
    step = np.where(vertices[:, 2] > 0.15, 1.0, 0.0)
    soft = spread(step, triangles, 5)
    ring = 0.3 / 59
    assert np.array_equal(soft[np.abs(vertices[:, 2] - 0.15) > 6 * ring], step[np.abs(vertices[:, 2] - 0.15) > 6 * ring])
    assert ((soft > 0) & (soft < 1)).sum() == 10 * 24

import numpy as np
import pytest

from haptics.garments.bodies.capsule import CapsuleBody
from haptics.garments.cut.cutting import cut_out, openings
from haptics.garments.cut.subdivision import loop
from haptics.garments.mesh import SurfaceMesh


def sheet(columns, rows):
    """A flat sheet of equilateral triangles of side 1."""
    i, j = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
    vertices = np.stack([i + 0.5 * j, j * np.sqrt(3) / 2, np.zeros(i.shape)], axis=-1).reshape(-1, 3)
    corner = (j[:-1, :-1] * (columns + 1) + i[:-1, :-1]).ravel()
    up = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    down = np.stack([corner + 1, corner + columns + 2, corner + columns + 1], axis=1)
    return vertices, np.concatenate([up, down]).astype(np.int64)


def test_closed_surfaces_get_the_positions_of_another_implementation():
    igl = pytest.importorskip("igl")
    body = CapsuleBody()
    vertices, triangles = body.straight_m, body.triangles
    matrix, finer = loop(triangles, len(vertices))
    valence = np.bincount(SurfaceMesh(vertices, triangles).edges.ravel())
    theirs, _ = igl.loop(vertices, triangles, 1)
    ours = matrix @ vertices
    new = slice(len(vertices), None)
    ours_new, theirs_new = (points[new][np.lexsort(points[new].round(9).T)] for points in (ours, theirs))
    assert ours_new == pytest.approx(theirs_new, abs=1e-9)
    regular = np.flatnonzero(valence == 6)  # elsewhere Warren's weights differ from Loop's own
    assert len(regular) > 2000
    assert ours[regular] == pytest.approx(theirs[regular], abs=1e-12)
    assert finer.shape == (4 * len(triangles), 3)


def test_rows_sum_to_one_and_nothing_is_negative():
    vertices, triangles = sheet(5, 4)
    matrix, _ = loop(triangles, len(vertices))
    assert matrix.sum(axis=1) == pytest.approx(np.ones(matrix.shape[0]), abs=1e-15)
    assert matrix.data.min() > 0


def test_a_flat_regular_sheet_keeps_its_positions_and_its_straight_rim():
    vertices, triangles = sheet(6, 6)
    matrix, finer = loop(triangles, len(vertices))
    points = matrix @ vertices
    inner = ~np.isin(np.arange(len(vertices)), SurfaceMesh(vertices, triangles).boundary_edges)
    assert points[: len(vertices)][inner] == pytest.approx(vertices[inner], abs=1e-15)
    areas = SurfaceMesh(points, finer).areas_m2
    assert len(areas) == 4 * len(triangles)
    assert np.median(areas) == pytest.approx(np.sqrt(3) / 4 / 4)
    assert (SurfaceMesh(points, finer).cross_m2[:, 2] > 0).all()
    bottom = points[np.abs(points[:, 1]) < 1e-12]
    assert len(bottom) > 9


def test_again_and_again_it_nears_a_smooth_surface():
    body = CapsuleBody()
    weights, triangles = cut_out(body.straight_m, body.triangles, body.part_weights["lower_arm_l"] - 0.5)
    points = weights @ body.straight_m
    sharpest = []
    for _ in range(3):
        normals = SurfaceMesh(points, triangles).vertex_normals
        edges = SurfaceMesh(points, triangles).edges
        sharpest.append(np.linalg.norm(normals[edges[:, 0]] - normals[edges[:, 1]], axis=1).max())
        matrix, triangles = loop(triangles, len(points))
        points = matrix @ points
    assert sharpest[1] < 0.7 * sharpest[0]
    assert sharpest[2] < 0.7 * sharpest[1]
    assert openings(triangles) == 2

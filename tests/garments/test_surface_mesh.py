"""Faulty meshes are refused, and the refusal names the place."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.garments.mesh import SurfaceMesh, checked_mesh

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
CORNERS = 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def refused(vertices, triangles, closed=False) -> str:
    with pytest.raises(InputError) as error:
        checked_mesh(np.asarray(vertices, dtype=float), np.asarray(triangles), "sleeve.obj", closed)
    return str(error.value)


def test_a_sound_closed_mesh_passes_and_knows_its_measures():
    mesh = checked_mesh(CORNERS, TETRAHEDRON, "tetrahedron", closed=True)
    assert mesh.areas_m2.sum() == pytest.approx(0.005 * 3 + 0.005 * np.sqrt(3))
    assert mesh.vertex_areas_m2.sum() == pytest.approx(mesh.areas_m2.sum())
    assert len(mesh.edges) == 6
    assert len(mesh.boundary_edges) == 0
    assert (np.einsum("ij,ij->i", mesh.vertex_normals, CORNERS - CORNERS.mean(axis=0)) > 0).all()


def test_not_a_number_names_the_vertex():
    bad = CORNERS.copy()
    bad[2, 1] = np.nan
    assert "vertex 2" in refused(bad, TETRAHEDRON)


def test_millimetres_are_noticed():
    message = refused(CORNERS * 1000 * 10, TETRAHEDRON)
    assert "1000 m across" in message
    assert "millimetres" in message


def test_a_mesh_of_a_tenth_of_a_millimetre_is_refused():
    assert "across" in refused(CORNERS * 1e-3, TETRAHEDRON)


def test_open_where_it_must_be_closed_names_the_edge():
    assert "open at edge" in refused(CORNERS, TETRAHEDRON[:3], closed=True)
    checked_mesh(CORNERS, TETRAHEDRON[:3], "cap", closed=False)


def test_inside_out_is_refused_for_a_body():
    assert "inside out" in refused(CORNERS, TETRAHEDRON[:, ::-1], closed=True)


def test_three_triangles_at_an_edge_name_it():
    vertices = np.vstack([CORNERS, [[0.05, 0.05, -0.1]]])
    triangles = np.vstack([TETRAHEDRON, [[0, 1, 4]]])
    message = refused(vertices, triangles)
    assert "edge 0-1" in message
    assert "3 triangles" in message


def test_a_flipped_triangle_names_the_edge_it_shares():
    triangles = TETRAHEDRON.copy()
    triangles[3] = triangles[3][::-1]
    assert "turned against each other" in refused(CORNERS, triangles)


def test_zero_area_names_the_triangle_and_the_place():
    vertices = np.vstack([CORNERS, [[0.05, 0.0, 0.0]]])
    message = refused(vertices, np.vstack([TETRAHEDRON[1:], [[0, 1, 4]]]))
    assert "triangle 3 at (0.0000, 0.0000, 0.0000) m" in message


def test_sheets_that_touch_in_a_point_name_the_vertex():
    vertices = np.vstack([CORNERS, CORNERS[1:] * -1])
    other = np.where(TETRAHEDRON == 0, 0, TETRAHEDRON + 3)[:, ::-1]
    assert "vertex 0" in refused(vertices, np.vstack([TETRAHEDRON, other]))


def test_a_vertex_of_no_triangle_is_named():
    assert "vertex 4" in refused(np.vstack([CORNERS, [[0.02, 0.02, 0.02]]]), TETRAHEDRON)


def test_vertex_numbers_out_of_range_name_the_triangle():
    assert "triangle 1" in refused(CORNERS, [[0, 2, 1], [0, 1, 7]])


def test_shapes_and_kinds_are_refused():
    assert "shape (4, 2)" in refused(CORNERS[:, :2], TETRAHEDRON)
    assert "whole numbers" in refused(CORNERS, TETRAHEDRON.astype(float))
    assert "triangles have shape" in refused(CORNERS, TETRAHEDRON[:, :2])


def test_at_keeps_the_triangles():
    mesh = SurfaceMesh(CORNERS, TETRAHEDRON)
    assert mesh.at(2 * CORNERS).areas_m2 == pytest.approx(4 * mesh.areas_m2)

"""Distances in compiled code are those of the shapes themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from haptics.scene.geometry.mesh import TriangleMesh
from haptics.scene.geometry.packed import MESH, mesh_distance_m, packable, packed, solid_distance_m, to_local
from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Box, Capsule, Cylinder, Placed, Plane, Sphere

TURNED = Pose((0.1, -0.2, 0.3), (0.5, 0.5, -0.5, 0.5))
FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
FACES += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
CUBE = TriangleMesh(np.array([[x, y, z] for x in (-0.03, 0.05) for y in (-0.04, 0.02) for z in (-0.05, 0.06)]), np.array(FACES))
BODIES = [
    Placed(shape, pose)
    for shape in (Sphere(0.04), Box((0.1, 0.02, 0.3)), Capsule(0.02, 0.1), Cylinder(0.05, 0.08), Plane(), CUBE)
    for pose in (Pose(), TURNED)
]
coordinates = st.tuples(*[st.floats(-0.6, 0.6)] * 3)


def compiled_m(bodies, row, points_m):
    """Of points in the world, by the compiled functions."""
    all_of = packed(bodies)
    local_m = np.empty_like(points_m)
    to_local(all_of.rotation, all_of.origin_m, row, points_m, True, local_m)
    if all_of.kind[row] == MESH:
        first, end = all_of.triangles[row]
        return [mesh_distance_m(first, end, all_of.corners_m, all_of.sphere_m, all_of.box_m, row, *point) for point in local_m]
    return [solid_distance_m(all_of.kind[row], *all_of.size_m[row], *point) for point in local_m]


@settings(max_examples=60, deadline=None)
@given(st.lists(coordinates, min_size=1, max_size=8))
def test_every_shape_is_as_far_as_it_is(points):
    points_m = np.array(points)
    for row, body in enumerate(BODIES):
        assert compiled_m(BODIES, row, points_m) == pytest.approx(body.distance(points_m), abs=1e-12)


def test_corners_edges_and_the_middle_of_a_mesh_are_as_far_as_they_are():
    points_m = np.concatenate([CUBE.vertices_m, CUBE.vertices_m * 1.5, CUBE.vertices_m * 0.999, np.zeros((1, 3))])
    assert compiled_m([BODIES[0], Placed(CUBE)], 1, points_m) == pytest.approx(CUBE.distance(points_m), abs=1e-12)


def test_a_point_that_is_nowhere_has_no_distance():
    for row in range(len(BODIES)):
        assert np.isnan(compiled_m(BODIES, row, np.array([[np.nan, 0.0, 0.0], [0.0, 0.0, np.inf]]))).all()


def test_a_body_that_moves_is_as_far_as_where_it_is():
    all_of = packed(BODIES)
    all_of.put(0, TURNED)
    assert (all_of.origin_m[0], all_of.rotation[0].tolist()) == (pytest.approx(TURNED.position_m), TURNED.rotation.tolist())


def test_a_shape_of_somebodys_own_is_not_known_here():
    class Own(Sphere):
        pass

    assert packable(Sphere(0.1))
    assert not packable(Own(0.1))

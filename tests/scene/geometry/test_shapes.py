"""Signed distances are exact: closed forms, brute-force sampling of the surface, and a gradient of length one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.scene.geometry.pose import Pose, multiply_xyzw, shortest_turn_xyzw
from haptics.scene.geometry.shapes import Box, Capsule, Cylinder, Placed, Plane, Sphere, distances, segment_meets

SHAPES = [Sphere(0.04), Box((0.06, 0.1, 0.03)), Capsule(0.02, 0.08), Cylinder(0.03, 0.05), Plane()]
IDS = [shape.kind for shape in SHAPES]

coordinate = st.floats(-0.2, 0.2)
point = st.tuples(coordinate, coordinate, coordinate)
unit_quaternion = (
    st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1).map(lambda q: tuple(x / math.hypot(*q) for x in q))
)
poses = st.builds(Pose, point, unit_quaternion)


def cloud(count: int = 400, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.12, 0.12, (count, 3))


@pytest.mark.parametrize(
    ("shape", "at", "expected_m"),
    [
        (Sphere(0.04), (0.0, 0.0, 0.0), -0.04),
        (Sphere(0.04), (0.0, 0.1, 0.0), 0.06),
        (Box((0.06, 0.1, 0.03)), (0.0, 0.0, 0.0), -0.015),
        (Box((0.06, 0.1, 0.03)), (0.06, 0.05 + 0.04, 0.0), 0.05),
        (Capsule(0.02, 0.08), (0.05, 0.01, 0.0), 0.03),
        (Capsule(0.02, 0.08), (0.0, 0.09, 0.0), 0.03),
        (Cylinder(0.03, 0.05), (0.06, 0.065, 0.0), 0.05),
        (Cylinder(0.03, 0.05), (0.0, 0.02, 0.0), -0.005),
        (Plane(), (3.0, -0.2, 5.0), -0.2),
    ],
)
def test_distance_agrees_with_hand_arithmetic(shape, at, expected_m):
    assert shape.distance(np.array([at]))[0] == pytest.approx(expected_m, abs=1e-15)


@pytest.mark.parametrize("shape", SHAPES, ids=IDS)
@settings(max_examples=60, deadline=None)
@given(a=point, b=point)
def test_distance_never_changes_faster_than_one_metre_a_metre(shape, a, b):
    da, db = shape.distance(np.array([a, b]))
    assert abs(da - db) <= math.dist(a, b) + 1e-12


@pytest.mark.parametrize("shape", SHAPES, ids=IDS)
def test_gradient_is_the_derivative_of_distance_and_has_length_one(shape):
    points, step = cloud(), 1e-7
    gradient = shape.gradient(points)
    assert np.linalg.norm(gradient, axis=1) == pytest.approx(1.0, abs=1e-12)
    central = np.stack(
        [(shape.distance(points + step * axis) - shape.distance(points - step * axis)) / (2 * step) for axis in np.eye(3)], axis=1
    )
    smooth = np.abs(np.linalg.norm(central, axis=1) - 1.0) < 1e-4  # off the medial axis, where there is no derivative
    assert smooth.mean() > 0.98
    assert gradient[smooth] == pytest.approx(central[smooth], abs=2e-5)  # truncation of the difference at a curvature of 1/step


@pytest.mark.parametrize("shape", SHAPES, ids=IDS)
def test_walking_back_along_the_gradient_lands_on_the_surface(shape):
    points = cloud(seed=2)
    landed = points - shape.distance(points)[:, None] * shape.gradient(points)
    assert shape.distance(landed) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("shape", SHAPES, ids=IDS)
def test_gradient_points_somewhere_even_where_it_is_not_unique(shape):
    gradient = shape.gradient(np.zeros((1, 3)))
    assert np.linalg.norm(gradient) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    "shape", [Box((0.06, 0.1, 0.03)), Cylinder(0.03, 0.05), Capsule(0.02, 0.08)], ids=["box", "cylinder", "capsule"]
)
def test_distance_is_that_of_the_nearest_point_of_a_densely_sampled_surface(shape):
    surface = cloud(60_000, seed=3)
    surface = surface - shape.distance(surface)[:, None] * shape.gradient(surface)
    points = cloud(60, seed=4)
    nearest = np.array([np.sqrt(((surface - p) ** 2).sum(axis=1).min()) for p in points])
    exact = np.abs(shape.distance(points))
    assert (nearest >= exact - 1e-12).all()
    assert nearest == pytest.approx(exact, abs=3e-3)  # samples are about 1 mm apart, more where few are projected


@settings(max_examples=50, deadline=None)
@given(pose=poses, p=point)
def test_a_placed_shape_is_the_shape_seen_from_its_own_frame(pose, p):
    shape = Box((0.06, 0.1, 0.03))
    world = pose.to_world(np.array([p]))
    placed = Placed(shape, pose)
    assert placed.distance(world)[0] == pytest.approx(shape.distance(np.array([p]))[0], abs=1e-12)
    assert placed.bounding_distance(world[0]) <= placed.distance(world)[0] + 1e-12
    ahead = world + 1e-3 * placed.gradient(world)
    assert placed.distance(ahead)[0] == pytest.approx(placed.distance(world)[0] + 1e-3, abs=2e-3)


@settings(max_examples=50, deadline=None)
@given(a=unit_quaternion, b=unit_quaternion)
def test_quaternion_product_is_the_product_of_rotations(a, b):
    product = Pose((0.0, 0.0, 0.0), multiply_xyzw(a, b)).rotation
    assert product == pytest.approx(Pose((0, 0, 0), a).rotation @ Pose((0, 0, 0), b).rotation, abs=1e-9)


@settings(max_examples=80, deadline=None)
@given(u=point.filter(lambda v: math.hypot(*v) > 1e-3), v=point.filter(lambda v: math.hypot(*v) > 1e-3))
def test_shortest_turn_takes_one_direction_to_the_other(u, v):
    start, end = np.array(u), np.array(v)
    turned = Pose((0.0, 0.0, 0.0), shortest_turn_xyzw(start, end)).rotation @ (start / np.linalg.norm(start))
    assert turned == pytest.approx(end / np.linalg.norm(end), abs=1e-5)  # near opposite directions 1 + cos loses half its digits
    assert np.isfinite(shortest_turn_xyzw(start, -start)).all()


def test_far_bodies_are_given_by_a_lower_bound_and_near_ones_exactly():
    bodies = [Placed(Sphere(0.05)), Placed(Box((0.1, 0.1, 0.1)), Pose((1.0, 0.0, 0.0))), Placed(Plane(), Pose((0.0, -2.0, 0.0)))]
    points = cloud(20)
    exact = distances(bodies, points)
    culled = distances(bodies, points, within_m=0.2)
    assert (culled[0] == exact[0]).all()
    assert (culled[2] == exact[2]).all()
    assert (culled[1] <= exact[1]).all()
    assert (culled[1] > 0.2).all()


def test_a_segment_meets_what_lies_between_its_ends_and_nothing_beside_it():
    card = Placed(Box((0.1, 0.1, 0.0005)))
    assert segment_meets(card, np.array([0.0, 0.0, -0.05]), np.array([0.0, 0.0, 0.05]))
    assert not segment_meets(card, np.array([0.0, 0.0, 0.01]), np.array([0.0, 0.0, 0.05]))
    assert not segment_meets(card, np.array([0.06, 0.0, -0.05]), np.array([0.06, 0.0, 0.05]))


@pytest.mark.parametrize(
    "make", [lambda: Sphere(0.0), lambda: Sphere(math.nan), lambda: Box((0.1, -0.1, 0.1)), lambda: Capsule(0.1, math.inf)]
)
def test_sizes_that_no_object_has_are_refused(make):
    with pytest.raises(InputError, match=r"allowed|expected"):
        make()


def test_wrong_arrays_and_quaternions_are_refused_with_what_is_allowed():
    with pytest.raises(InputError, match=r"\(n, 3\)"):
        Placed(Sphere(0.1)).distance(np.zeros(3))
    with pytest.raises(InputError, match="unit quaternion"):
        Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0))
    with pytest.raises(InputError, match="3 finite numbers"):
        Pose((0.0, math.inf, 0.0))

"""The smooth body (eq. 5.1, 5.2): exact on a plane, near on a sphere, with exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from tube import RADIUS_M, tube

from haptics.errors import InputError
from haptics.garments.equilibrium.surface import ImplicitBody, nearest_vertices, neighbour_lists
from haptics.garments.mesh import SurfaceMesh


def body_of(vertices, triangles):
    mesh = SurfaceMesh(np.ascontiguousarray(vertices, dtype=float), triangles, "body")
    return ImplicitBody(mesh, neighbour_lists(mesh))


@pytest.fixture(scope="module")
def round_body():
    vertices, triangles, _ = tube(40)
    return body_of(vertices, triangles)


def near_the_skin(count: int, seed: int, spread_m: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle, z = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.05, 0.05, count)
    r = RADIUS_M + rng.uniform(-spread_m, spread_m, count)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def test_a_plane_is_reproduced_exactly():
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, 15), np.linspace(-0.1, 0.1, 15))
    vertices = np.stack([x.ravel(), y.ravel(), 0.3 * x.ravel()], axis=1)
    corner = np.arange(14)[:, None] * 15 + np.arange(14)
    triangles = np.concatenate(
        [np.stack([corner, corner + 1, corner + 15], 2), np.stack([corner + 1, corner + 16, corner + 15], 2)]
    ).reshape(-1, 3)
    body = body_of(vertices, triangles)
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.04, 0.04, (50, 2)), np.zeros(50)])
    points[:, 2] = 0.3 * points[:, 0] + rng.uniform(-0.01, 0.01, 50)
    normal = np.array([-0.3, 0, 1]) / np.hypot(0.3, 1)
    phi, gradient, hessian = body.distance_and_curvature(points, nearest_vertices(points, vertices))
    assert phi == pytest.approx(points @ normal, abs=1e-12)
    assert np.abs(gradient - normal).max() < 1e-9
    assert np.abs(hessian).max() < 1e-6


def test_the_distance_to_a_round_body_is_right_to_a_thirtieth_of_the_sagitta(round_body):
    """The mesh's edges of 7 mm stand 140 um off the circle in their middles; the smooth surface stays within 5 um of a circle."""
    points = near_the_skin(400, 2, 0.002)
    phi = round_body.distance_m(points, nearest_vertices(points, round_body.vertices_m))
    off = phi - (np.hypot(points[:, 0], points[:, 1]) - RADIUS_M)
    assert np.ptp(off) < 60e-6
    assert abs(off.mean()) < 200e-6


def test_derivatives_agree_with_differences(round_body):
    points = near_the_skin(60, 3, 0.003)
    homes = nearest_vertices(points, round_body.vertices_m)
    _, gradient, hessian = round_body.distance_and_curvature(points, homes)
    h = 1e-6
    for axis in range(3):
        step = h * np.eye(3)[axis]
        up, up_slope = round_body.distance_and_slope(points + step, homes)
        down, down_slope = round_body.distance_and_slope(points - step, homes)
        assert (up - down) / (2 * h) == pytest.approx(gradient[:, axis], abs=2e-7)
        assert np.abs((up_slope - down_slope) / (2 * h) - hessian[:, axis]).max() < 1e-6 * np.abs(hessian).max() + 1e-4


def leaving(body, count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Points on straight ways from a place inside, near its home, to beyond all that the home feels; step by step."""
    rng = np.random.default_rng(6)
    start = near_the_skin(count, 5, 0.002)
    homes = nearest_vertices(start, body.vertices_m)
    way = rng.normal(size=(count, 3))
    steps = np.linspace(0, 0.06, 6001)[:, None, None]
    return start + steps * way / np.linalg.norm(way, axis=1, keepdims=True), homes


def test_contact_ends_without_a_step_where_the_skin_is_out_of_reach(round_body):
    """What cloth feels is min(phi, 0): a jump of it would be a cliff in the energy, which no step gets down."""
    ways, homes = leaving(round_body)
    depth = np.array([np.minimum(round_body.distance_m(points, homes), 0.0) for points in ways])
    assert (depth[-1] == 0).all()
    assert depth.min() < -1e-3
    coarse, fine = (np.abs(np.diff(depth[::every], axis=0)).max() for every in (4, 1))
    assert fine < 0.3 * coarse  # four times shorter steps, four times smaller differences


def test_derivatives_agree_with_differences_where_contact_ends(round_body):
    ways, homes = leaving(round_body)
    h = 1e-7
    for points in ways[::25]:
        phi, gradient, hessian = round_body.distance_and_curvature(points, homes)
        there = np.isfinite(phi)
        for axis in range(3):
            step = h * np.eye(3)[axis]
            up, up_slope = round_body.distance_and_slope(points + step, homes)
            down, down_slope = round_body.distance_and_slope(points - step, homes)
            both = there & np.isfinite(up) & np.isfinite(down)
            assert (up[both] - down[both]) / (2 * h) == pytest.approx(gradient[both, axis], abs=1e-5)
            difference = np.abs((up_slope[both] - down_slope[both]) / (2 * h) - hessian[both, axis])
            assert difference.max(initial=0.0) < 1e-6 * np.abs(hessian).max() + 0.5


def test_orders_agree_with_each_other(round_body):
    points = near_the_skin(100, 4, 0.003)
    homes = nearest_vertices(points, round_body.vertices_m)
    phi, gradient, _ = round_body.distance_and_curvature(points, homes)
    assert np.array_equal(round_body.distance_m(points, homes), phi)
    assert np.array_equal(round_body.distance_and_slope(points, homes)[1], gradient)


def test_walking_home_finds_the_nearest_vertex(round_body):
    points = near_the_skin(300, 5, 0.002)
    near = nearest_vertices(points, round_body.vertices_m)
    lists = round_body.lists[near]
    start = np.where(lists[:, 30] >= 0, lists[:, 30], near)  # somewhere else nearby
    assert np.array_equal(round_body.walk_home(points, start), near)


def test_another_home_nearby_feels_the_same_skin(round_body):
    points = near_the_skin(200, 6, 0.001)
    near = nearest_vertices(points, round_body.vertices_m)
    neighbour = round_body.lists[near, 1]
    assert round_body.distance_m(points, neighbour) == pytest.approx(round_body.distance_m(points, near), abs=1e-9)


def test_projection_lands_on_the_surface(round_body):
    points = near_the_skin(200, 7, 0.004)
    landed, homes = round_body.project(points, nearest_vertices(points, round_body.vertices_m))
    assert np.abs(round_body.distance_m(landed, homes)).max() < 1e-11
    assert np.linalg.norm(landed - points, axis=1).max() < 0.005


def test_far_away_nothing_is_felt_and_projection_names_the_point(round_body):
    far = np.array([[0.5, 0.0, 0.0]])
    phi, gradient, hessian = round_body.distance_and_curvature(far, np.array([0]))
    assert phi[0] == np.inf
    assert not gradient.any()
    assert not hessian.any()
    with pytest.raises(InputError, match=r"vertex 0 at \(0.5000, 0.0000, 0.0000\) m"):
        round_body.project(far, np.array([0]))


def test_lists_follow_the_skin_not_the_air():
    """Two sheets 2 mm apart that meet only far away: each sees its own side."""
    vertices, triangles, rings = tube(40)
    flat = vertices.copy()
    flat[:, 1] *= 0.02  # pressed flat: opposite sides 2 mm apart in space, but far along the skin
    lists = neighbour_lists(SurfaceMesh(vertices, triangles))
    home = 40 * (rings // 2) + 10
    seen = lists[home][lists[home] >= 0]
    assert (vertices[seen, 1] > 0).all()
    assert lists[home, 0] == home


def test_lists_of_another_body_are_refused(round_body):
    vertices, triangles, _ = tube(30)
    with pytest.raises(InputError, match="neighbour lists"):
        ImplicitBody(SurfaceMesh(vertices, triangles), round_body.lists)

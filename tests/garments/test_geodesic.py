"""Paths over a surface against those of the plane that a cylinder unrolls to, and against exact distances by libigl."""

from __future__ import annotations

import numpy as np
import pytest
from bar_panel import flat_sheet, tube

from haptics.garments.design.geodesic import SurfaceGraph, boundary_loops
from haptics.garments.mesh import SurfaceMesh


def _unrolled_m(mesh: SurfaceMesh, sides: int, radius_m: float) -> np.ndarray:
    """Exact distance on the tube's flat facets from vertex 0, at angle 0 and height 0."""
    turns = np.abs(np.arctan2(mesh.vertices_m[:, 1], mesh.vertices_m[:, 0])) / (2 * np.pi)
    return np.hypot(turns * sides * 2 * radius_m * np.sin(np.pi / sides), mesh.vertices_m[:, 2])


def test_lengths_are_those_of_the_unrolled_tube_within_two_percent() -> None:
    mesh = tube(24, 40, 0.04, 0.3)
    lengths = SurfaceGraph(mesh).paths_from(np.array([0])).lengths_m[: len(mesh.vertices_m)]
    exact = _unrolled_m(mesh, 24, 0.04)
    ratio = lengths[1:] / exact[1:]
    assert ratio.min() > 1 - 1e-12  # a way on the surface is never shorter than the shortest
    assert ratio.max() < 1.02
    assert ratio.mean() < 1.01


def test_lengths_agree_with_exact_distances_on_a_bumpy_surface() -> None:
    igl = pytest.importorskip("igl")
    sheet = flat_sheet(20, 20, 0.2, 0.2)
    x, y, _ = sheet.vertices_m.T
    bumpy = sheet.at(np.stack([x, y, 0.02 * np.sin(40 * x) * np.cos(31 * y)], axis=1))
    none, targets = np.zeros(0, np.int64), np.arange(len(x))
    exact = np.ravel(igl.exact_geodesic(bumpy.vertices_m, bumpy.triangles, np.array([213]), none, targets, none))
    lengths = SurfaceGraph(bumpy).paths_from(np.array([213])).lengths_m[: len(x)]
    assert np.all(lengths >= exact - 1e-12)
    assert np.max(lengths[exact > 0] / exact[exact > 0]) < 1.02


def test_a_path_is_connected_and_as_long_as_its_length() -> None:
    mesh = tube(24, 40)
    graph = SurfaceGraph(mesh)
    paths = graph.paths_from(boundary_loops(mesh)[1])
    path = paths.to(5)
    assert path[-1] == 5
    assert path[0] in boundary_loops(mesh)[1]
    assert np.linalg.norm(np.diff(graph.points_m[path], axis=0), axis=1).sum() == pytest.approx(paths.lengths_m[5], rel=1e-12)
    assert paths.lengths_m[5] == pytest.approx(0.3, rel=1e-9)  # straight along the tube


def test_distance_to_triangle_centres() -> None:
    mesh = flat_sheet(30, 30, 0.3, 0.3)
    graph = SurfaceGraph(mesh)
    away = graph.to_centres(graph.paths_from(np.array([0])).lengths_m)
    exact = np.linalg.norm(mesh.centres_m, axis=1)
    assert np.all(away >= exact - 1e-12)
    assert np.max(away / exact) < 1.03


def test_values_between_vertices_are_interpolated() -> None:
    graph = SurfaceGraph(flat_sheet(4, 3))
    assert graph.at_nodes(graph.mesh.vertices_m[:, 0]) == pytest.approx(graph.points_m[:, 0], abs=1e-15)


def test_openings_of_a_tube() -> None:
    mesh = tube(12, 5)
    low, high = boundary_loops(mesh)
    assert sorted(low) == list(range(12))
    assert sorted(high) == list(range(60, 72))
    turns = np.diff(np.unwrap(np.arctan2(*mesh.vertices_m[low, 1::-1].T)))
    assert turns == pytest.approx(2 * np.pi / 12)  # in order, the tube to the left

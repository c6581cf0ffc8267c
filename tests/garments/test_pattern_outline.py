"""Outlines of the reinforcement: smooth, at kept area, with their holes, inside the cloth, meeting across seams."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from analytic_garments import nothing, three_openings, tube

from haptics.garments.pattern import PatternOptions, make_pattern
from haptics.garments.pattern.outline import too_narrow


def ring_and_cross(garment):
    """A band round the tube, across the seam as well, with two struts, and a ring by itself."""
    centres = garment.centres_m
    band = np.abs(centres[:, 2] - 0.2) < 0.03
    strut = np.abs(centres[:, 0] - 0.2 * centres[:, 2]) < 0.012
    from_middle = np.hypot(centres[:, 0], centres[:, 2] - 0.34)
    island = (from_middle > 0.012) & (from_middle < 0.035) & (centres[:, 1] < 0)
    return band | (strut & (centres[:, 2] < 0.3)) | island


def rough_edges(panel):
    """Half-edges between reinforced triangles and the rest, from the mesh alone."""
    triangles = panel.flat.panel.mesh.triangles[panel.reinforced]
    half = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    _, at, count = np.unique(np.sort(half, axis=1), axis=0, return_index=True, return_counts=True)
    return half[at[count == 1]]


def turning(points):
    """Total turning of a closed ring, rad: 2 pi if it is convex."""
    steps = np.diff(np.vstack([points, points[:2]]), axis=0)
    angles = np.arctan2(steps[:, 1], steps[:, 0])
    return float(np.abs((np.diff(angles) + np.pi) % (2 * np.pi) - np.pi).sum())


@pytest.fixture(scope="module")
def pattern():
    garment = tube(around=48, along=52)
    return make_pattern(garment, ring_and_cross(garment), "tube")


def test_area_is_kept_and_rings_are_valid(pattern):
    for panel in pattern.panels:
        flat = panel.flat.flat_m[panel.flat.panel.mesh.triangles[panel.reinforced]]
        mesh_area = shapely.area(shapely.polygons(flat)).sum()
        assert panel.cut.smoothing_m > 0
        assert panel.cut.area_m2 == pytest.approx(mesh_area, rel=1e-3)
        assert panel.cut.mesh_area_m2 == pytest.approx(mesh_area, rel=1e-9)
        assert all(polygon.is_valid for polygon in panel.cut.polygons)
        assert shapely.union_all(panel.cut.polygons).area == pytest.approx(panel.cut.area_m2, rel=1e-9)
        assert all(polygon.exterior.is_ccw for polygon in panel.cut.polygons)
        assert not any(hole.is_ccw for polygon in panel.cut.polygons for hole in polygon.interiors)


def test_islands_stay_islands_and_holes_stay_holes(pattern):
    (panel,) = pattern.panels
    # Euler number of the reinforced part of the mesh: pieces less holes.
    mesh = panel.flat.panel.mesh
    triangles = mesh.triangles[panel.reinforced]
    half = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    euler = len(np.unique(triangles)) - len(np.unique(np.sort(half, axis=1), axis=0)) + len(triangles)
    holes = sum(len(polygon.interiors) for polygon in panel.cut.polygons)
    assert len(panel.cut.polygons) - holes == euler
    assert holes == 1
    assert len(panel.cut.polygons) == 2


def test_the_zigzag_goes_and_the_shape_stays(pattern):
    (panel,) = pattern.panels
    island = min(panel.cut.polygons, key=lambda polygon: polygon.area)
    rough = min(shapely.get_parts(rough_polygons(panel)), key=lambda polygon: polygon.area)
    assert turning(np.asarray(rough.exterior.coords)[:-1]) > 6 * np.pi
    # A circle turns by 2 pi. What remains are waves longer than the mesh.
    assert turning(np.asarray(island.exterior.coords)[:-1]) < 3 * np.pi
    # Nowhere a corner, not even where the ring starts.
    ring = np.asarray(island.exterior.coords)
    steps = np.diff(np.vstack([ring, ring[1:2]]), axis=0)
    angles = np.arctan2(steps[:, 1], steps[:, 0])
    assert np.abs((np.diff(angles) + np.pi) % (2 * np.pi) - np.pi).max() < np.deg2rad(25)
    edges = panel.flat.panel.mesh.vertices_m[panel.flat.panel.mesh.edges]
    edge = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).max()
    assert island.hausdorff_distance(rough) < edge


def rough_polygons(panel):
    return shapely.union_all(shapely.polygons(panel.flat.flat_m[panel.flat.panel.mesh.triangles[panel.reinforced]]))


def test_reinforcement_stays_on_the_cloth(pattern):
    for panel in pattern.panels:
        cloth = shapely.Polygon(panel.outline_m)
        assert shapely.union_all(panel.cut.polygons).difference(cloth).area < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("garment", [tube(around=48, along=52), three_openings()], ids=["tube", "shorts"])
def test_reinforcement_meets_across_seams(garment):
    design = np.abs(garment.centres_m[:, 2] - garment.centres_m[:, 2].mean()) < 0.04
    pattern = make_pattern(garment, design, "banded")
    crossings = 0
    for seam in pattern.seams:
        on_side = []
        for side in seam.sides:
            panel = pattern.panels[side.panel]
            edge = shapely.union_all([polygon.exterior for polygon in panel.cut.polygons])
            middles = shapely.points(0.5 * (side.points_m[1:] + side.points_m[:-1]))
            on_side.append(shapely.distance(middles, edge) < 1e-7)
        # The seam's steps along which reinforcement reaches it are the same on both sides, unless the mesh itself differs there.
        differing = np.flatnonzero(on_side[0] != on_side[1])
        assert len(differing) <= 2
        crossings += on_side[0].any()
    assert crossings


@pytest.mark.slow
def test_no_smoothing_gives_the_edges_of_the_mesh():
    garment = tube()
    pattern = make_pattern(garment, ring_and_cross(garment), "tube", options=PatternOptions(smoothing_m=0.0))
    (panel,) = pattern.panels
    edges = {tuple(sorted(map(tuple, panel.flat.flat_m[[a, b]].tolist()))) for a, b in rough_edges(panel)}
    drawn = {
        tuple(sorted(step))
        for polygon in panel.cut.polygons
        for ring in (polygon.exterior, *polygon.interiors)
        for step in pairwise(ring.coords)
    }
    assert drawn == edges


def test_all_or_nothing_reinforced():
    garment = tube()
    (bare,) = make_pattern(garment, nothing(garment), "bare").panels
    assert bare.cut.polygons == ()
    (full,) = make_pattern(garment, ~nothing(garment), "full").panels
    assert full.cut.area_m2 == pytest.approx(garment.areas_m2.sum(), rel=1e-6)
    assert (
        shapely.Polygon(full.outline_m).equals_exact(full.cut.polygons[0].normalize(), 1e-9)
        or shapely.Polygon(full.outline_m).symmetric_difference(full.cut.polygons[0]).area < 1e-9
    )


def test_narrow_places_are_found_where_they_are():
    neck = shapely.union_all(
        [shapely.box(0, 0, 0.02, 0.02), shapely.box(0.02, 0.0095, 0.03, 0.0105), shapely.box(0.03, 0, 0.05, 0.02)]
    )
    ((x, y),) = too_narrow((neck,), 0.002)
    assert (x, y) == (pytest.approx(0.025, abs=0.005), pytest.approx(0.01, abs=5e-4))
    assert too_narrow((neck,), 0.0005) == []
    assert too_narrow((shapely.box(0, 0, 0.02, 0.02),), 0.002) == []


def test_the_seam_allowance_goes_all_round():
    garment = tube()
    (panel,) = make_pattern(garment, nothing(garment), "tube", options=PatternOptions(seam_allowance_m=0.01)).panels
    cut, sewn = shapely.Polygon(panel.outline_m), shapely.Polygon(panel.flat.flat_m[panel.flat.panel.loops[0]])
    assert cut.exterior.distance(sewn.exterior) == pytest.approx(0.01, abs=1e-6)
    # Perimeter times the allowance and four mitred corners.
    assert cut.area == pytest.approx(sewn.area + 0.01 * sewn.length + 4 * 0.01**2, rel=1e-3)

"""Seams: every panel a disc, both sides of a seam alike, the surface untouched."""

import numpy as np
import pytest
from analytic_garments import nothing, three_openings, tube

from haptics.errors import InputError
from haptics.garments.bodies import open_body
from haptics.garments.garment import GARMENTS, cut_garment
from haptics.garments.mesh import SurfaceMesh, checked_mesh
from haptics.garments.pattern import PatternOptions, make_pattern
from haptics.garments.pattern.cloth import Cloth
from haptics.garments.pattern.seams import cut_to_fit

FRONT, BACK = np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0])


def cut(garment, design=None, max_distortion=0.03, max_panels=8, side=BACK):
    design = nothing(garment) if design is None else design
    return cut_to_fit(garment, design, FRONT, side, max_distortion, max_panels)


def test_a_tube_gets_one_straight_seam_on_the_side_that_is_asked_for():
    garment = tube()
    cloth, panels = cut(garment)
    assert len(panels) == 1
    assert panels[0].panel.is_disc
    ends = cloth.mesh.vertices_m[cloth.seams]
    # The seam is a generator of the cylinder: as long as the tube, but for where it is led through
    # vertices (up to a tenth of an edge away).
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(0.4, rel=2e-3)
    assert ends[..., 1].min() > 0.048


def test_the_seam_goes_round_the_reinforcement():
    garment = tube()
    centres = garment.centres_m
    design = (centres[:, 1] > 0.02) & (np.abs(centres[:, 2] - 0.2) < 0.1)
    cloth, _ = cut(garment, design)
    one, two = cloth.panels[0].mesh.boundary_edges.T
    on_boundary = np.isin(cloth.panels[0].mesh.triangles, np.union1d(one, two)).sum(axis=1) >= 2
    assert not (design[cloth.parents[cloth.panels[0].faces]] & on_boundary).any()
    cloth, _ = cut(garment)
    touched = np.isin(cloth.mesh.triangles, cloth.seams).sum(axis=1) >= 2
    assert (design[cloth.parents] & touched).any()


@pytest.mark.slow
def test_cutting_keeps_the_surface_and_its_orientation():
    garment = tube(24, 26, bulge=0.02)
    cloth, _ = cut(garment)
    checked_mesh(cloth.mesh.vertices_m, cloth.mesh.triangles, "cut")
    kept = np.bincount(cloth.parents, cloth.mesh.areas_m2)
    np.testing.assert_allclose(kept, garment.areas_m2, rtol=1e-12)
    normals = cloth.mesh.cross_m2 / np.linalg.norm(cloth.mesh.cross_m2, axis=1, keepdims=True)
    before = garment.cross_m2 / np.linalg.norm(garment.cross_m2, axis=1, keepdims=True)
    np.testing.assert_allclose(np.einsum("ij,ij->i", normals, before[cloth.parents]), 1.0, atol=1e-9)


def test_lines_that_meet_an_old_seam_from_both_sides_part_both():
    square = SurfaceMesh(
        np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.1, 0.1, 0]]), np.array([[1, 2, 0], [1, 3, 2]]), "square"
    )
    halves = Cloth.uncut(square).cut_along(np.array([[1, 2]]))
    assert len(halves.panels) == 2
    # Corner 0 of the one and corner 2 of the other are cut off; the second line splits an edge that the first does not cross.
    quarters, before = halves.cut(np.array([[1.0, 1.0, -1.0], [1.0, 1.0, -1.0]]))
    areas = sorted(panel.mesh.areas_m2.sum() for panel in quarters.panels)
    np.testing.assert_allclose(areas, [0.125 * 0.01, 0.125 * 0.01, 0.375 * 0.01, 0.375 * 0.01])
    np.testing.assert_allclose(np.bincount(before, quarters.mesh.areas_m2), square.areas_m2)


def test_three_openings_are_parted_into_front_and_back():
    garment = three_openings()
    cloth, panels = cut(garment, max_distortion=1.0)
    assert len(panels) == 2
    assert all(flat.panel.is_disc for flat in panels)
    facing = [np.average(flat.panel.mesh.centres_m[:, 1], weights=flat.panel.mesh.areas_m2) for flat in panels]
    assert min(facing) < -0.01 < 0.01 < max(facing)
    # Sewn back together it is the garment: each triangle of the cloth once.
    assert sorted(np.concatenate([flat.panel.faces for flat in panels]).tolist()) == list(range(len(cloth.mesh.triangles)))


@pytest.mark.slow
def test_openings_are_joined_one_by_one_where_front_and_back_cannot_be_told():
    garment = three_openings()
    cloth, panels = cut_to_fit(garment, nothing(garment), np.array([0.0, 0.0, 1.0]), BACK, 1.0, 1)
    assert len(panels) == 1
    assert panels[0].panel.is_disc
    assert len(cloth.seams)


@pytest.mark.slow
def test_panels_above_the_bound_are_halved_until_below_or_as_many_as_allowed():
    garment = tube(around=24, along=24, bulge=0.05)
    errors = {count: [flat.error for flat in cut(garment, max_distortion=0.02, max_panels=count)[1]] for count in (1, 2, 8)}
    assert len(errors[1]) == 1
    assert len(errors[2]) == 2
    assert max(errors[1]) > max(errors[2]) > max(errors[8])
    assert max(errors[8]) <= 0.02
    assert 2 < len(errors[8]) <= 8


@pytest.mark.slow
@pytest.mark.parametrize("garment", [tube(), tube(24, 24, bulge=0.05), three_openings()], ids=["tube", "bulge", "three"])
def test_both_sides_of_a_seam_run_over_the_same_points_and_lengths(garment):
    pattern = make_pattern(garment, nothing(garment), "garment")
    boundary = sum(len(panel.flat.panel.mesh.boundary_edges) for panel in pattern.panels)
    on_seams = sum(len(side.points_m) - 1 for seam in pattern.seams for side in seam.sides)
    openings = len(Cloth.uncut(garment).mesh.boundary_edges)
    assert boundary - on_seams >= openings  # a seam that ends in an opening parts one of its edges
    for seam in pattern.seams:
        for side in seam.sides:
            panel = pattern.panels[side.panel].flat
            assert len(side.points_m) == len(seam.along_m)
            # Flat lengths differ from those on the body by no more than the distortion that is reported.
            ratio = np.linalg.norm(np.diff(side.points_m, axis=0), axis=1) / np.diff(seam.along_m)
            assert panel.distortion.smallest_stretch - 1e-9 <= ratio.min()
            assert ratio.max() <= panel.distortion.largest_stretch + 1e-9
        assert len(seam.notches(seam.sides[0])) == len(seam.notches(seam.sides[1])) == len(seam.notches_m)


@pytest.mark.slow
@pytest.mark.parametrize("name", GARMENTS)
def test_every_garment_of_the_mannequin_can_be_cut(name):
    body = open_body("capsule")
    garment = cut_garment(body, name, "coarse")
    mesh = SurfaceMesh(garment.on(body.straight_m), garment.triangles, name)
    design = np.abs(mesh.centres_m[:, 0] - mesh.centres_m[:, 0].mean()) < 0.03
    pattern = make_pattern(mesh, design, name)
    assert all(panel.flat.panel.is_disc for panel in pattern.panels)
    assert all(np.isfinite(panel.flat.error) for panel in pattern.panels)
    assert len(pattern.panels) == PatternOptions().max_panels or max(p.flat.error for p in pattern.panels) < 0.05
    assert pattern.cut_area_m2 == pytest.approx(mesh.areas_m2[design].sum(), rel=0.05)
    assert sum(p.flat.panel.mesh.areas_m2.sum() for p in pattern.panels) == pytest.approx(mesh.areas_m2.sum(), rel=1e-9)


def test_a_panel_lies_to_the_left_of_a_seam_and_another_to_its_right():
    garment = tube()
    pattern = make_pattern(garment, nothing(garment), "tube")
    (seam,) = pattern.seams
    middle = pattern.panels[0].flat.flat_m.mean(axis=0)
    for side, way in zip(seam.sides, (1, -1), strict=True):
        along, inwards = side.points_m[-1] - side.points_m[0], middle - side.points_m[0]
        assert way * (along[0] * inwards[1] - along[1] * inwards[0]) > 0


@pytest.mark.slow
def test_the_same_garment_is_cut_the_same_way_twice():
    one, other = (cut(three_openings(), max_distortion=1.0)[0] for _ in range(2))
    assert np.array_equal(one.mesh.vertices_m, other.mesh.vertices_m)
    assert np.array_equal(one.mesh.triangles, other.mesh.triangles)
    assert np.array_equal(one.seams, other.seams)


def test_a_garment_that_cannot_be_cut_into_discs_is_refused():
    first = tube()
    two = SurfaceMesh(
        np.vstack([first.vertices_m, first.vertices_m + np.array([1.0, 0, 0])]),
        np.vstack([first.triangles, first.triangles + len(first.vertices_m)]),
        "pair",
    )
    with pytest.raises(InputError, match="pair: it is in 2 pieces; expected one"):
        cut(two)
    import igl

    vertices, triangles = igl.icosahedron()
    with pytest.raises(InputError, match="0 openings"):
        cut(SurfaceMesh(vertices, np.asarray(triangles, np.int64), "ball"))

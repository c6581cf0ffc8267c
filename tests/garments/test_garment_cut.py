from functools import cache

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.garments.bodies import MOTIONS
from haptics.garments.bodies.capsule import CapsuleBody
from haptics.garments.cut.cutting import openings
from haptics.garments.garment import BAND_M, GARMENTS, LEVELS, OPENINGS, cut_garment, garment_from_mesh
from haptics.garments.mesh import SurfaceMesh, checked_mesh

BODY = CapsuleBody()
CUTS = [(name, level) for name in GARMENTS for level in ("coarse", "draft", "standard")]


@cache
def cut(name, level):
    return cut_garment(BODY, name, level)


def on_body(garment):
    return SurfaceMesh(garment.on(BODY.straight_m), garment.triangles)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "level"), CUTS)
def test_a_garment_is_one_sheet_with_its_openings_and_no_hole(name, level):
    mesh = on_body(cut(name, level))
    checked_mesh(mesh.vertices_m, mesh.triangles, name)
    assert openings(mesh.triangles) == OPENINGS[name]
    # a sphere with so many holes, in one piece: vertices - edges + triangles = 2 - holes
    assert len(mesh.vertices_m) - len(mesh.edges) + len(mesh.triangles) == 2 - OPENINGS[name]


def test_the_openings_are_those_of_the_clothes():
    assert OPENINGS == {"sleeve": 2, "knee_sleeve": 2, "shirt": 4, "long_shirt": 4, "shorts": 3}


@pytest.mark.parametrize(("name", "level"), CUTS)
def test_a_level_has_about_its_number_of_vertices(name, level):
    assert 0.83 <= cut(name, level).weights.shape[0] / LEVELS[level] <= 1.1


@pytest.mark.slow
def test_the_reference_level_has_28_thousand():
    garment = cut_garment(BODY, "sleeve", "reference")
    assert 0.83 <= garment.weights.shape[0] / 28000 <= 1.1
    assert openings(garment.triangles) == 2


@pytest.mark.parametrize(("name", "level"), CUTS)
def test_its_triangles_are_fit_for_simulation(name, level):
    mesh = on_body(cut(name, level))
    corners = mesh.vertices_m[mesh.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    quality = 4 * np.sqrt(3) * mesh.areas_m2 / np.sum(sides**2, axis=1)  # 1 for equal sides
    assert quality.min() > 0.2
    assert np.percentile(quality, 1) > 0.7


@pytest.mark.parametrize(("name", "level"), CUTS)
def test_each_vertex_is_a_mixture_of_the_bodys(name, level):
    weights = cut(name, level).weights
    assert weights.data.min() >= 0
    assert weights.sum(axis=1) == pytest.approx(np.ones(weights.shape[0]), abs=1e-12)


@pytest.mark.parametrize("name", GARMENTS)
def test_it_lies_on_the_skin_and_outside_points_outward(name):
    from haptics.garments.bodies.mannequin import distance_m, gradient

    mesh = on_body(cut(name, "standard"))
    assert np.abs(distance_m(mesh.vertices_m)).max() < 0.004  # flat triangles of 2 cm cut corners in an armpit
    slope = gradient(mesh.vertices_m)
    assert np.sum(mesh.vertex_normals * slope / np.linalg.norm(slope, axis=1, keepdims=True), axis=1).min() > 0.8


@pytest.mark.parametrize("name", GARMENTS)
def test_levels_agree_in_area_and_in_the_bands_area(name):
    area = {level: on_body(cut(name, level)).areas_m2 for level in ("coarse", "draft", "standard")}
    total = {level: areas.sum() for level, areas in area.items()}
    band = {level: areas[cut(name, level).attached].sum() for level, areas in area.items()}
    assert total["draft"] == pytest.approx(total["standard"], rel=0.01)
    assert total["coarse"] == pytest.approx(total["standard"], rel=0.025)
    # whole triangles of 2 or 4 cm approximate a band of 1.75 cm
    assert band["draft"] == pytest.approx(band["standard"], rel=0.2)
    assert band["coarse"] == pytest.approx(band["standard"], rel=0.2)


@pytest.mark.parametrize("name", GARMENTS)
def test_bands_are_as_wide_as_stated_along_every_opening(name):
    garment = cut(name, "standard")
    mesh = on_body(garment)
    rim = mesh.vertices_m[mesh.boundary_edges]
    perimeter = np.linalg.norm(rim[:, 1] - rim[:, 0], axis=1).sum()
    assert mesh.areas_m2[garment.attached].sum() / perimeter == pytest.approx(BAND_M, rel=0.1)
    at_rim = np.isin(garment.triangles, mesh.boundary_edges).sum(axis=1) == 2
    assert garment.attached[at_rim].all()


def test_all_of_a_garment_may_be_reinforced():
    assert all(garment.designable.all() for garment in (cut(*one) for one in CUTS))


def test_a_sleeve_runs_from_shoulder_to_wrist_of_the_left_arm():
    at = cut("sleeve", "standard").on(BODY.straight_m)
    arm = BODY.joints_m["elbow_l"] - BODY.joints_m["shoulder_l"]
    along = (at - BODY.joints_m["shoulder_l"]) @ arm / np.linalg.norm(arm)
    assert at[:, 0].min() > 0.1
    assert along.max() == pytest.approx(0.285 + 0.25, abs=0.002)


def test_a_knee_sleeve_reaches_18_cm_each_way():
    at = cut("knee_sleeve", "standard").on(BODY.straight_m)
    leg = BODY.joints_m["knee_l"] - BODY.joints_m["hip_l"]
    along = (at - BODY.joints_m["knee_l"]) @ leg / np.linalg.norm(leg)
    assert [along.min(), along.max()] == pytest.approx([-0.18, 0.18], abs=0.001)


def test_it_moves_with_the_body():
    garment = cut("sleeve", "draft")
    posed = BODY.posed_m(MOTIONS["elbow_flexion"].pose(90))
    moved = garment.on(posed) - garment.on(BODY.straight_m)
    wrist = garment.on(BODY.straight_m)[:, 0] > 0.5
    assert np.linalg.norm(moved[wrist], axis=1).min() > 0.2
    shift = np.array([0.1, 0.0, 0.0])
    assert garment.on(posed + shift) == pytest.approx(garment.on(posed) + shift, abs=1e-12)


def test_the_same_cut_gives_the_same_bytes():
    again = cut_garment(CapsuleBody(), "shorts", "draft")
    assert again.weights.data.tobytes() == cut("shorts", "draft").weights.data.tobytes()
    assert again.triangles.tobytes() == cut("shorts", "draft").triangles.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("size", [{"girth": 0.8}, {"girth": 1.25}, {"height_m": 1.4, "girth": 1.25}, {"height_m": 2.1}], ids=str)
def test_every_garment_fits_every_size(size):
    for name in GARMENTS:
        assert openings(cut_garment(CapsuleBody(size), name, "draft").triangles) == OPENINGS[name]


@pytest.mark.parametrize(
    ("name", "level", "message"), [("hat", "draft", "garment = 'hat'"), ("sleeve", "fine", "level = 'fine'")]
)
def test_unknown_names_are_refused_with_what_is_allowed(name, level, message):
    with pytest.raises(InputError, match=message):
        cut_garment(BODY, name, level)


def test_a_body_without_the_part_is_refused():
    class Armless(CapsuleBody):
        def __init__(self):
            super().__init__()
            for part in ("upper_arm_l", "lower_arm_l"):
                self.part_weights = {**self.part_weights, part: np.zeros(len(self.straight_m))}

    with pytest.raises(InputError, match="nothing is left of the garment"):
        cut_garment(Armless(), "sleeve")


def test_a_body_with_a_hole_under_the_garment_is_refused():
    body = CapsuleBody()
    middle = body.straight_m[body.triangles].mean(axis=1) - body.joints_m["elbow_l"]
    body.triangles = np.delete(body.triangles, np.linalg.norm(middle, axis=1).argmin(), axis=0)
    with pytest.raises(InputError, match="sleeve cut out of body capsule has 3 openings; expected 2"):
        cut_garment(body, "sleeve")


def swollen(by_m):
    mesh = on_body(cut("knee_sleeve", "draft"))
    return SurfaceMesh(mesh.vertices_m + by_m * mesh.vertex_normals, mesh.triangles, "mine.obj")


def test_a_garment_drawn_elsewhere_is_laid_onto_the_skin():
    garment = garment_from_mesh(BODY, swollen(0.01))
    mesh, given = on_body(garment), on_body(cut("knee_sleeve", "draft"))
    assert np.linalg.norm(mesh.vertices_m - given.vertices_m, axis=1).max() < 0.004
    assert (garment.attached == cut("knee_sleeve", "draft").attached).mean() > 0.98


def test_a_garment_far_from_the_body_is_refused_with_the_place():
    with pytest.raises(
        InputError, match=r"mine.obj: vertex \d+ at \(.*\) m is 0.\d+ m from body capsule; allowed: at most 0.03 m"
    ):
        garment_from_mesh(BODY, swollen(0.04))


def test_a_garment_that_is_inside_out_is_refused_with_a_place():
    mesh = swollen(0.01)
    with pytest.raises(InputError, match=r"mine.obj: it is inside out, triangle \d+ at \(.*\) m faces the body"):
        garment_from_mesh(BODY, SurfaceMesh(mesh.vertices_m, mesh.triangles[:, ::-1], "mine.obj"))


def test_a_garment_in_two_pieces_is_refused_with_a_place():
    mesh = swollen(0.01)
    triangles = mesh.triangles[np.abs(mesh.centres_m[:, 2] - BODY.joints_m["knee_l"][2] - 0.05) > 0.03]
    used, numbers = np.unique(triangles, return_inverse=True)
    with pytest.raises(InputError, match=r"mine.obj: vertex \d+ at \(.*\) m is not joined to the rest"):
        garment_from_mesh(BODY, SurfaceMesh(mesh.vertices_m[used], numbers.reshape(-1, 3), "mine.obj"))


def test_a_closed_garment_needs_an_attachment():
    closed = SurfaceMesh(BODY.straight_m, BODY.triangles, "suit.obj")
    with pytest.raises(InputError, match=r"suit.obj: it has no opening"):
        garment_from_mesh(BODY, closed)
    held = np.zeros(len(BODY.triangles), dtype=bool)
    held[0] = True
    assert garment_from_mesh(BODY, closed, held).attached.sum() == 1


def test_an_attachment_of_another_size_is_refused():
    with pytest.raises(InputError, match=r"mine.obj: attached has shape \(3,\)"):
        garment_from_mesh(BODY, swollen(0.01), np.ones(3, dtype=bool))


def test_a_faulty_mesh_is_refused():
    mesh = swollen(0.01)
    mesh.vertices_m[7] = np.nan
    with pytest.raises(InputError, match=r"mine.obj: vertex 7 is"):
        garment_from_mesh(BODY, mesh)

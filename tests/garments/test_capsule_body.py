import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skins import folds_deg, rotation_between, triangles_within, volume_m3

from haptics.errors import InputError
from haptics.garments.bodies import MOTIONS, PARTS, open_body
from haptics.garments.bodies.capsule import CapsuleBody
from haptics.garments.bodies.mannequin import BONES, distance_m
from haptics.garments.bodies.posing import Flesh
from haptics.garments.mesh import SurfaceMesh, checked_mesh

BODY = CapsuleBody()
SIZES = [{}, {"girth": 0.8}, {"girth": 1.25}, {"height_m": 1.4, "girth": 1.25}, {"height_m": 2.1, "girth": 0.8}]


def followers(body, part, least=1 - 1e-12):
    return body.part_weights[part] >= least


def limb(body, side, parts):
    return np.sum([body.part_weights[f"{part}_{side}"] for part in parts], axis=0) > 0.5


ARM, LEG = ("upper_arm", "lower_arm", "hand"), ("upper_leg", "lower_leg", "foot")


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_it_is_a_closed_surface_with_its_normals_outward(size):
    body = CapsuleBody(size)
    checked_mesh(body.straight_m, body.triangles, "capsule", closed=True)


def test_the_shipped_mesh_lies_on_the_mannequin():
    assert np.abs(distance_m(BODY.straight_m)).max() < 1e-6  # kept in single precision: 1e-7


def test_its_triangles_are_well_shaped():
    corners = BODY.straight_m[BODY.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    areas = SurfaceMesh(BODY.straight_m, BODY.triangles).areas_m2
    quality = 4 * np.sqrt(3) * areas / np.sum(sides**2, axis=1)  # 1 for equal sides
    assert quality.min() > 0.5
    assert np.median(quality) > 0.97


def test_parts_share_every_vertex_and_each_has_its_own():
    weights = np.stack([BODY.part_weights[part] for part in PARTS])
    assert weights.min() >= 0
    assert weights.sum(axis=0) == pytest.approx(np.ones(len(BODY.straight_m)), abs=1e-12)
    assert all(followers(BODY, part).sum() > 10 for part in PARTS if part != "pelvis")
    assert (BODY.part_weights["pelvis"] > 0.5).sum() > 100


def test_left_is_at_positive_x_and_feet_point_forward():
    assert BODY.straight_m[followers(BODY, "hand_l")][:, 0].min() > 0.4
    assert BODY.straight_m[followers(BODY, "foot_l")][:, 1].min() < -0.15
    assert BODY.straight_m[followers(BODY, "head")][:, 2].max() == pytest.approx(1.75, abs=0.02)


def test_without_a_turn_it_is_the_straight_body_to_the_bit():
    assert np.array_equal(BODY.posed_m({}), BODY.straight_m)
    assert np.array_equal(BODY.posed_m({"elbow_l": np.zeros(3)}), BODY.straight_m)


def test_the_same_pose_gives_the_same_bytes():
    pose = MOTIONS["slouch"].pose(33.0)
    assert CapsuleBody().posed_m(pose).tobytes() == BODY.posed_m(pose).tobytes()


@pytest.mark.parametrize(
    ("joint", "part"),
    [
        ("elbow_l", "hand_l"),
        ("elbow_r", "hand_r"),
        ("knee_l", "foot_l"),
        ("knee_r", "foot_r"),
        ("shoulder_l", "hand_l"),
        ("hip_r", "foot_r"),
    ],
)
def test_what_lies_far_beyond_a_joint_turns_about_it_exactly(joint, part):
    vector = np.array([0.4, -0.7, 0.5])
    far = followers(BODY, part)
    centre = BODY.joints_m[joint]
    exact = centre + Rotation.from_rotvec(vector).apply(BODY.straight_m[far] - centre)
    assert BODY.posed_m({joint: vector})[far] == pytest.approx(exact, abs=1e-12)


def test_joints_add_up_along_the_chain_from_the_pelvis():
    pose = {"spine_1": [0.2, 0.1, 0], "spine_4": [0.3, 0, 0.1], "shoulder_l": [-0.5, 0.2, 0], "elbow_l": [-0.9, 0, -0.6]}
    hand = followers(BODY, "hand_l")
    points = BODY.straight_m[hand]
    for joint in ("elbow_l", "shoulder_l", "spine_4", "spine_1"):
        points = BODY.joints_m[joint] + Rotation.from_rotvec(pose[joint]).apply(points - BODY.joints_m[joint])
    assert BODY.posed_m({joint: np.array(turn) for joint, turn in pose.items()})[hand] == pytest.approx(points, abs=1e-12)


@pytest.mark.parametrize(("name", "part"), [("elbow_flexion", "hand_l"), ("knee_flexion", "foot_l")])
@pytest.mark.parametrize("angle", [10, 60, 120])
def test_the_limb_bends_by_the_angle_asked(name, part, angle):
    own = followers(BODY, part)
    turn = rotation_between(BODY.straight_m[own], BODY.posed_m(MOTIONS[name].pose(angle))[own])
    assert np.degrees(np.linalg.norm(turn)) == pytest.approx(angle, abs=1e-9)


def test_only_the_limb_moves():
    moved = np.abs(BODY.posed_m(MOTIONS["elbow_flexion"].pose(90)) - BODY.straight_m).max(axis=1) > 0
    assert limb(BODY, "l", ARM)[moved].all()
    moved = np.abs(BODY.posed_m(MOTIONS["knee_flexion"].pose(90)) - BODY.straight_m).max(axis=1) > 0
    assert limb(BODY, "l", LEG)[moved].all()


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize(("name", "parts"), [("elbow_flexion", ARM), ("knee_flexion", LEG)])
def test_the_skin_of_a_bent_limb_neither_turns_over_nor_degenerates(size, name, parts):
    body = CapsuleBody(size)
    own = triangles_within(limb(body, "l", parts), body.triangles)
    straight = SurfaceMesh(body.straight_m, own).areas_m2
    for angle in (45, 90, 120):
        posed = body.posed_m(MOTIONS[name].pose(angle))
        assert folds_deg(posed, own).max() < 95
        assert (SurfaceMesh(posed, own).areas_m2 / straight).min() > 0.1


@pytest.mark.parametrize("name", ["slouch", "crouch", "lunge", "arms_forward", "arms_raise", "bend_forward"])
def test_the_skin_never_turns_over_in_whole_body_motions(name):
    posed = BODY.posed_m(MOTIONS[name].pose(MOTIONS[name].default_deg))
    assert folds_deg(posed, BODY.triangles).max() < 110


@pytest.mark.parametrize(("name", "parts", "joint"), [("elbow_flexion", ARM, "shoulder_l"), ("knee_flexion", LEG, "hip_l")])
@pytest.mark.parametrize(("bulge", "least", "most"), [(0.0, -0.03, 0.0), (None, -0.025, 0.01)])
def test_a_bent_limb_keeps_its_volume_within_three_per_cent(name, parts, joint, bulge, least, most):
    body = BODY if bulge is None else CapsuleBody(flesh=Flesh(arm_bulge_m=0.0, thigh_bulge_m=0.0))
    own = triangles_within(limb(body, "l", parts), body.triangles)
    whole = volume_m3(body.straight_m - body.joints_m[joint], own)
    for angle in (60, 90, 120):
        posed = body.posed_m(MOTIONS[name].pose(angle))
        change = (volume_m3(posed, body.triangles) - volume_m3(body.straight_m, body.triangles)) / whole
        assert least < change < most


def test_muscle_grows_with_the_angle_up_to_its_bulge():
    slack, strong = CapsuleBody(flesh=Flesh(arm_bulge_m=0.0)), CapsuleBody(flesh=Flesh(arm_bulge_m=0.02))
    swollen = []
    for angle in (30, 60, 90, 120):
        pose = MOTIONS["elbow_flexion"].pose(angle)
        swollen.append(np.linalg.norm(strong.posed_m(pose) - slack.posed_m(pose), axis=1).max())
    expected = 0.01 * (1 - np.cos(np.radians([30, 60, 90, 120])))
    assert swollen == pytest.approx(expected, rel=0.1)  # no vertex stands just where it is thickest


def test_height_scales_all_of_it():
    assert CapsuleBody({"height_m": 2.0}).straight_m == pytest.approx(BODY.straight_m * 2.0 / 1.75, abs=1e-15)


def test_girth_scales_the_distance_of_the_skin_from_the_bone():
    thick = CapsuleBody({"girth": 1.2})
    own = followers(BODY, "lower_arm_l")
    a, b = BONES["lower_arm_l"]
    along = (b - a) / np.linalg.norm(b - a)

    def distance(body):
        return np.linalg.norm(np.cross(body.straight_m[own] - a, along), axis=1)

    assert own.sum() > 30
    assert distance(thick) == pytest.approx(1.2 * distance(BODY), rel=1e-12)


@pytest.mark.parametrize(
    ("phenotype", "message"),
    [
        ({"height_m": 3.0}, "height_m = 3 m; allowed 1.4 to 2.1 m"),
        ({"girth": 0.5}, "girth = 0.5; allowed 0.8 to 1.25"),
        ({"weight": 0.5}, "'weight' is unknown to CapsulePhenotype; known: girth, height_m"),
    ],
)
def test_a_phenotype_that_it_has_not_is_refused(phenotype, message):
    with pytest.raises(InputError, match=message):
        open_body("capsule", phenotype)


def test_an_unknown_body_is_refused():
    with pytest.raises(InputError, match="body = 'smpl' is not allowed; allowed: capsule, anny"):
        open_body("smpl")


@pytest.mark.parametrize("turn", [np.zeros(2), np.array([0.0, np.nan, 0.0])])
def test_a_rotation_that_is_none_is_refused(turn):
    with pytest.raises(InputError, match=r"rotation of elbow_l is .*three finite numbers"):
        BODY.posed_m({"elbow_l": turn})


def test_a_joint_that_no_body_has_is_refused():
    with pytest.raises(InputError, match="joint 'wrist_l' is not known; allowed: spine_1"):
        BODY.posed_m({"wrist_l": np.zeros(3)})

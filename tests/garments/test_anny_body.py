import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("anny")

from scipy.spatial.transform import Rotation
from skins import folds_deg, rotation_between, triangles_within, volume_m3

from haptics.errors import InputError
from haptics.garments.bodies import MOTIONS, PARTS, anny_body, open_body
from haptics.garments.bodies.anny_body import ADULT, AnnyBody
from haptics.garments.bodies.anny_rig import ENDS, SEGMENTS, missing, moved, rest_shape, skinned, straight_rig, straightening
from haptics.garments.bodies.motions import ARM_DIRECTION, JOINTS, LEG_DIRECTION
from haptics.garments.cut.cutting import openings
from haptics.garments.garment import GARMENTS, OPENINGS, cut_garment
from haptics.garments.mesh import SurfaceMesh, checked_mesh

pytestmark = pytest.mark.slow

PEOPLE = [
    {},
    {"weight": 1.0, "gender": 0.0},
    {"weight": 0.0, "muscle": 1.0, "gender": 1.0},
    {"age": 0.4},
    {"height": 1.0, "age": 1.0},
]


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory):
    """Bodies are made here; the 0.8 GB that anny prepares stay where they are, for making them takes minutes."""
    from haptics.folders import cache_folder

    with pytest.MonkeyPatch.context() as patch:
        import os

        if "ANNY_CACHE_DIR" not in os.environ:
            patch.setenv("ANNY_CACHE_DIR", str(cache_folder() / "anny"))
        patch.setenv("HAPTICS_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def rest():
    return rest_shape(ADULT)


@pytest.fixture(scope="module")
def body():
    return open_body("anny")


@pytest.fixture(scope="module")
def person(own_cache):
    """Of a phenotype, made once."""
    made = {}

    def make(phenotype):
        key = str(phenotype)
        if key not in made:
            made[key] = AnnyBody(phenotype)
        return made[key]

    return make


def clothed(body):
    return (
        np.sum([body.part_weights[part] for part in PARTS if part.startswith(("torso", "pelvis", "upper", "lower"))], axis=0)
        > 0.5
    )


def test_its_phenotype_is_what_anny_takes():
    from anny.models.model_data import resolve_phenotypes

    assert sorted(ADULT) == sorted(resolve_phenotypes("default"))


def test_straightening_is_what_annys_own_skinning_makes_of_it(rest):
    """anny is asked for the same pose in its own terms: for each bone D = U^T R U, R about world axes, U its axes at rest."""
    import torch
    from anny import Anny

    from haptics.garments.bodies.anny_rig import _BONE, _outer_skin

    model = Anny(rig="anny", topology="anny", skinning_method="lbs", pose_parameterization="local-bone")
    moves = straightening(rest)
    with torch.no_grad():
        axes = model(phenotype_kwargs=dict(ADULT))["rest_bone_poses"][0, :, :3, :3].double().numpy()
        own = {}
        for joint in JOINTS:
            kind, side = joint.rsplit("_", 1)
            above = {"elbow": f"shoulder_{side}", "knee": f"hip_{side}"}.get(kind)
            turn = moves[joint][:3, :3] if above is None else moves[above][:3, :3].T @ moves[joint][:3, :3]
            bone = axes[model.bone_labels.index(_BONE[joint])]
            delta = np.eye(4)
            delta[:3, :3] = bone.T @ turn @ bone
            own[_BONE[joint]] = torch.as_tensor(delta, dtype=model.dtype)[None]
        theirs = model(pose_parameters=own, phenotype_kwargs=dict(ADULT))["vertices"][0].double().numpy()
    skin, _ = _outer_skin(model)
    ours, theirs = skinned(rest, moves), theirs[skin]
    assert ours - ours.mean(axis=0) == pytest.approx(theirs - theirs.mean(axis=0), abs=1e-9)  # anny's root stands elsewhere


def test_elbows_and_knees_are_straight_and_stand_where_the_pose_says(rest):
    rig = straight_rig(rest)
    for side in "lr":
        for joints, direction in ((("shoulder", "elbow", "wrist"), ARM_DIRECTION), (("hip", "knee", "ankle"), LEG_DIRECTION)):
            a, b, c = (rig.at_m[f"{joint}_{side}"] for joint in joints)
            for bone in (b - a, c - b):
                assert bone / np.linalg.norm(bone) == pytest.approx(direction[side], abs=1e-12)
    bent = rest.at_m["wrist_l"] - rest.at_m["elbow_l"], rest.at_m["elbow_l"] - rest.at_m["shoulder_l"]
    cosine = bent[0] @ bent[1] / np.linalg.norm(bent[0]) / np.linalg.norm(bent[1])
    assert np.degrees(np.arccos(cosine)) == pytest.approx(42, abs=3)  # at anny's own rest


@pytest.mark.parametrize(("name", "moving"), [("elbow_flexion", "hand_l"), ("knee_flexion", "foot_l")])
@pytest.mark.parametrize("angle", [20, 90, 120])
def test_the_limb_bends_by_the_angle_asked(body, name, moving, angle):
    own = body.part_weights[moving] > 1 - 1e-9
    assert own.sum() > 50
    turn = rotation_between(body.straight_m[own], body.posed_m(MOTIONS[name].pose(angle))[own])
    assert np.degrees(np.linalg.norm(turn)) == pytest.approx(angle, abs=0.01)


def test_joints_add_up_along_the_chain(body):
    pose = {"spine_2": [0.3, 0, 0.1], "shoulder_l": [-0.5, 0.2, 0], "elbow_l": [-0.9, 0, -0.6]}
    hand = body.part_weights["hand_l"] > 1 - 1e-9
    points = body.straight_m[hand]
    for joint in ("elbow_l", "shoulder_l", "spine_2"):
        points = body.joints_m[joint] + Rotation.from_rotvec(pose[joint]).apply(points - body.joints_m[joint])
    assert body.posed_m({joint: np.array(turn) for joint, turn in pose.items()})[hand] == pytest.approx(points, abs=1e-9)


def test_its_skin_is_one_sheet_open_at_eyes_and_mouth_only(body):
    mesh = checked_mesh(body.straight_m, body.triangles, "anny")
    assert body.straight_m.dtype == np.float64
    assert openings(body.triangles) == 3
    assert body.part_weights["head"][np.unique(mesh.boundary_edges)].min() == 1.0
    assert mesh.areas_m2.sum() == pytest.approx(1.8, abs=0.25)  # a person's skin
    assert volume_m3(body.straight_m - mesh.vertices_m[mesh.boundary_edges[0, 0]], body.triangles) == pytest.approx(
        0.07, abs=0.02
    )


def test_its_soles_are_on_the_ground_it_faces_minus_y_and_its_left_is_plus_x(body):
    assert body.straight_m[:, 2].min() == pytest.approx(0.0, abs=0.005)
    assert body.straight_m[:, 2].max() == pytest.approx(1.8, abs=0.1)
    foot, hand = (body.straight_m[body.part_weights[part] > 0.9] for part in ("foot_l", "hand_l"))
    assert foot[:, 1].min() < body.joints_m["knee_l"][1] - 0.1
    assert hand[:, 0].min() > 0.3


def test_parts_share_every_vertex_and_each_has_its_own(body):
    weights = np.stack([body.part_weights[part] for part in PARTS])
    assert weights.min() >= 0
    assert weights.sum(axis=0) == pytest.approx(np.ones(len(body.straight_m)), abs=1e-12)
    assert ((weights > 0.5).sum(axis=1) > 100).all()


def test_clefts_are_spanned_where_cloth_lies(rest, body):
    own = triangles_within(clothed(body), body.triangles)
    assert folds_deg(skinned(rest, straightening(rest)), own).max() > 140
    assert folds_deg(body.straight_m, own).max() < 60


@pytest.mark.parametrize("phenotype", PEOPLE, ids=str)
def test_cloth_regions_neither_turn_over_nor_degenerate(phenotype, person):
    body = person(phenotype)
    own = triangles_within(clothed(body), body.triangles)
    straight = SurfaceMesh(body.straight_m, own).areas_m2
    for motion in MOTIONS.values():
        posed = body.posed_m(motion.pose(motion.default_deg))
        assert folds_deg(posed, own).max() < 120, motion.name  # a triangle turned over makes more
        assert (SurfaceMesh(posed, own).areas_m2 / straight).min() > 0.05, motion.name


def test_bent_limbs_keep_their_volume(body):
    for name, share in (("elbow_flexion", 0.0006), ("knee_flexion", 0.004)):  # 2 % of an arm, 3 % of a leg, of the body's
        posed = body.posed_m(MOTIONS[name].pose(90))
        origin = body.straight_m[body.part_weights["head"] > 0.99].mean(axis=0)
        before, after = (volume_m3(points - origin, body.triangles) for points in (body.straight_m, posed))
        assert abs(after / before - 1) < share


@pytest.mark.parametrize("phenotype", PEOPLE, ids=str)
def test_every_garment_can_be_cut(phenotype, person):
    for name in GARMENTS:
        garment = cut_garment(person(phenotype), name, "draft")
        assert openings(garment.triangles) == OPENINGS[name]
        assert 0.83 <= garment.weights.shape[0] / 1800 <= 1.1


def test_a_phenotype_shapes_the_body(person):
    _, heavy, light, _, tall = map(person, PEOPLE)
    assert np.ptp(tall.straight_m[:, 2]) > 1.1 * np.ptp(heavy.straight_m[:, 2])
    waist = [np.ptp(body.straight_m[np.abs(body.straight_m[:, 2] - 1.1) < 0.02][:, 1]) for body in (heavy, light)]
    assert waist[0] > 1.1 * waist[1]


def test_once_made_it_opens_without_anny_to_the_same_bytes(body, monkeypatch):
    def unavailable(phenotype):
        raise AssertionError("made again")

    monkeypatch.setattr(anny_body, "rest_shape", unavailable)
    again = open_body("anny")
    pose = MOTIONS["crouch"].pose(50)
    assert again.posed_m(pose).tobytes() == body.posed_m(pose).tobytes()
    with pytest.raises(AssertionError, match="made again"):
        open_body("anny", {"weight": 0.123})


def test_making_it_twice_gives_the_same_bytes(rest):
    first, second = straight_rig(rest), straight_rig(rest_shape(ADULT))
    assert first.vertices_m.tobytes() == second.vertices_m.tobytes()
    assert first.shares.tobytes() == second.shares.tobytes()


def test_the_names_of_segments_and_ends_are_in_order(rest, body):
    assert rest.weights.shape[1] == len(SEGMENTS)
    assert set(rest.at_m) == {*JOINTS, *ENDS}
    moves = straightening(rest)
    assert body.joints_m["elbow_l"] == pytest.approx(moved(moves["elbow_l"], rest.at_m["elbow_l"]), abs=1e-12)


@pytest.mark.parametrize(
    ("phenotype", "message"),
    [
        ({"weight": 1.5}, "phenotype weight = 1.5; allowed 0 to 1"),
        ({"girth": 0.5}, "phenotype 'girth' is unknown to anny; allowed: gender, age, muscle, weight, height, proportions"),
    ],
)
def test_a_phenotype_that_it_has_not_is_refused(phenotype, message):
    with pytest.raises(InputError, match=message):
        open_body("anny", phenotype)


def test_a_missing_package_is_named_with_the_extra():
    assert "pip install '.[body]' in the checkout, or use body capsule" in str(missing("torch"))

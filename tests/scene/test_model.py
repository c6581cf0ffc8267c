"""Scene files: what ships, what it needs, where it puts things, and how broken files are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Box, Cylinder, Placed, Plane, Sphere, distances
from haptics.scene.hand_files.load import load_hand
from haptics.scene.library import load_scene, shipped_scenes
from haptics.scene.model import read_scene
from haptics.scene.objects import Motion, SceneObject
from haptics.scene.placement import place_in_hand
from haptics.scene.scene import Scene
from haptics.scene.sites import SITES, TIP_RADIUS_M, nominal_sites

SHIPPED = ("desk", "playground", "posture", "resistance", "tennis", "workplace")
BALL = """summary = "one ball"
[[objects]]
name = "ball"
shape = { kind = "sphere", radius_m = 0.03 }
effects = [{ kind = "contact" }]
"""


def read(text: str, folder: Path | None = None) -> Scene:
    return read_scene(text, "mine", "mine.toml", folder)


def test_six_scenes_ship_each_with_a_summary_and_its_source():
    assert tuple(name for name, _ in shipped_scenes()) == SHIPPED
    for name, summary in shipped_scenes():
        assert summary
        assert "thesis" in load_scene(name).source


def test_the_desk_has_the_objects_of_the_experience_test():
    desk = load_scene("desk")
    kinds = {item.name: [effect.kind for effect in item.effects] for item in desk.objects}
    assert sum(name.startswith("wood") for name in kinds) == sum(name.startswith("bamboo") for name in kinds) == 3
    assert kinds["fan"] == ["proximity"]
    assert kinds["cup"] == kinds["mouse"] == ["fixed_set"]
    for material in ("wood", "bamboo"):
        match, double, turned = (desk.object(f"{material}_{how}").effects[0] for how in ("match", "double", "turned"))
        assert (double.pattern, double.rate_scale) == (match.pattern, 2.0 * match.rate_scale)
        assert turned.pattern != match.pattern
        assert turned.rate_scale == match.rate_scale


def test_each_scene_needs_only_the_devices_it_uses():
    needs = {name: load_scene(name).needs for name in SHIPPED}
    desk = needs["desk"]
    assert desk.tactiles
    assert (desk.brakes, desk.piezos, desk.clutches) == ((), (), ())
    assert desk.pulses == SITES
    assert desk.refresh_hz == 10.0
    playground = needs["playground"]
    assert (playground.brakes, playground.piezos, playground.brake_v) == (("index", "thumb"), ("index", "thumb"), 1000.0)
    assert playground.pulses == ()
    assert needs["workplace"].sites == ("thumb_tip", "index_tip")
    assert not needs["workplace"].tactiles
    assert needs["workplace"].brakes == ()
    assert needs["workplace"].clutches == ("upper_back", "lower_left", "lower_right")
    assert needs["posture"].signals == ("spine_flexion",)
    assert needs["posture"].sites == ()
    assert needs["resistance"].clutches == ("upper", "lower")
    assert needs["tennis"].clutches == ("upper_back",)


def test_the_playground_has_one_object_in_the_hand_and_one_for_each_grasp():
    playground = load_scene("playground")
    assert [item.name for item in playground.objects if item.placement == "in_hand"] == ["ball"]
    assert {"ball", "cup", "frisbee", "book", "stick"} <= {item.name for item in playground.objects if item.grasp}


@pytest.mark.parametrize(
    "shape", [Sphere(0.01), Cylinder(0.01, 0.08), Box((0.02, 0.05, 0.05))], ids=["sphere", "cylinder", "box"]
)
def test_an_object_in_the_hand_is_touched_by_both_tips_at_the_span(shape):
    recording = load_hand("synthetic")
    found = place_in_hand(recording)
    scene = Scene("mine", (SceneObject("thing", Placed(shape), placement="in_hand", resolved=False),)).placed_for(recording)
    tips = np.stack([found.centre_m - 0.5 * found.span_m * found.axis, found.centre_m + 0.5 * found.span_m * found.axis])
    assert scene.object("thing").body.distance(tips) - TIP_RADIUS_M == pytest.approx(0.0, abs=1e-9)


def test_what_has_no_place_is_absent_and_said_so():
    scene = load_scene("playground")
    assert scene.unresolved == ("ball",)
    without = scene.placed(palm_m=None)
    assert "ball" not in without.names
    assert without.absent == (("ball", "the hand makes no closing stroke to place it by"),)
    assert load_scene("workplace").placed(None).rules  # a rule about an absent object just never fires
    assert {name for name, reason in load_scene("desk").placed(None).absent if reason == "no hand"} == set(
        load_scene("desk").names
    )


def test_palm_objects_stay_level_and_are_mirrored_for_a_left_hand():
    desk = load_scene("desk")
    right, left = desk.placed([0.1, 0.2, 0.3]), desk.placed([0.1, 0.2, 0.3], side="left")
    cup, there = desk.object("cup").body.pose, right.object("cup").body.pose
    assert there.origin_m == pytest.approx(np.add(cup.origin_m, (0.1, 0.2, 0.3)))
    assert left.object("cup").body.pose.origin_m[0] == pytest.approx(0.1 - cup.origin_m[0])
    assert right.object("table").body.gradient(np.array([[0.1, 0.5, 0.3]]))[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert right.unresolved == ()


@pytest.mark.parametrize("name", ["grab", "wave", "waiting", "flapping"])
def test_every_recorded_hand_meets_the_desk(recordings, name):
    recording = load_hand(recordings / f"{name}.leap.json.gz")
    scene, sites = load_scene("desk").placed_for(recording), nominal_sites()
    bodies = [item.body for item in scene.objects]
    nearest = np.full(len(bodies), np.inf)
    for frame in recording.frames(recording.side_with_most_frames):
        gaps = distances(bodies, sites.positions(frame.position_m, frame.orientation_xyzw)) - sites.radius_m
        nearest = np.minimum(nearest, gaps.min(axis=1))
    assert (nearest < -0.001).sum() >= 3  # at least 1 mm deep, as a counted touch is


def test_a_moving_object_follows_its_path_and_starts_over():
    motion = Motion((0.0, 1.0, 2.0), ((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, -1.0)), repeat=True)
    item = SceneObject("ball", Placed(Sphere(0.03), Pose((0.5, 0.0, 0.0))), motion=motion)
    assert item.body_at(0.5).pose.position_m == pytest.approx((0.5, 0.0, -0.5))
    assert item.body_at(1.5).pose.position_m == pytest.approx((0.5, 0.5, -1.0))
    assert item.body_at(4.5).pose.position_m == pytest.approx((0.5, 0.0, -0.5))


def test_moving_an_object_leaves_the_first_scene_as_it_was():
    scene = read(BALL)
    moved = scene.moved("ball", Pose((1.0, 0.0, 0.0)))
    assert scene.object("ball").body.pose == Pose()
    assert moved.object("ball").body.pose.position_m == (1.0, 0.0, 0.0)


def test_a_file_of_ones_own_is_read_with_its_mesh_beside_it(tmp_path: Path):
    pytest.importorskip("trimesh")
    (tmp_path / "wedge.obj").write_text("v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    mesh_scene = BALL.replace('{ kind = "sphere", radius_m = 0.03 }', '{ kind = "mesh", file = "wedge.obj", scale = 0.001 }')
    (tmp_path / "mine.toml").write_text(mesh_scene)
    scene = load_scene(tmp_path / "mine.toml")
    assert scene.name == "mine"
    assert scene.object("ball").body.distance(np.array([[0.001, 0.001, 0.001]]))[0] == pytest.approx(-0.001)


def test_an_unknown_scene_lists_what_ships_and_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(InputError, match="desk, playground, posture, resistance, tennis, workplace"):
        load_scene("kitchen")
    with pytest.raises(InputError, match="did you mean playground"):
        load_scene("playgroud")
    with pytest.raises(InputError, match=r"gone\.toml"):
        load_scene(tmp_path / "gone.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"bytes\.toml"):
        load_scene(tmp_path / "bytes.toml")


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("[[objects]]", "[[objects]", r"mine\.toml:2: .* is not TOML"),
        ("radius_m = 0.03", "radius_m = -0.03", r"mine\.toml:4: shape of \[\[objects\]\] 'ball': .*radius_m = -0\.03 m"),
        ("radius_m = 0.03", 'radius_m = "0.03"', r"mine\.toml:4: radius_m = '0\.03' in shape of .*; expected a number"),
        ("radius_m = 0.03", "radius_m = true", r"mine\.toml:4: .*radius_m"),
        ("radius_m = 0.03", "radius_m = nan", r"mine\.toml:4: .*radius_m"),
        ("radius_m = 0.03", "radius_m = inf", r"mine\.toml:4: .*radius_m"),
        ("radius_m = 0.03", "radius_m = 0.03, hight_m = 1.0", r":4: unknown key 'hight_m' in shape of .* keys: radius_m, kind"),
        (", radius_m = 0.03", "", r"mine\.toml:4: .*radius_m"),
        ('kind = "sphere"', 'kind = "donut"', r"mine\.toml:4: kind = 'donut' in shape of .*kinds: box, capsule"),
        ('kind = "contact"', 'kind = "contact", sites = ["elbow"]', r"mine\.toml:5: .*thumb_tip"),
        ('name = "ball"', 'name = "Ball 1"', r"mine\.toml:3: name = 'Ball 1' in .*; expected lower-case"),
        ('summary = "one ball"', "", r"mine\.toml:1: key 'summary' is missing"),
        ('summary = "one ball"', 'summary = "x"\nsummry = "y"', r":2: unknown key 'summry'; known keys: .*did you mean summary"),
        ('summary = "one ball"', "summary = 2020-01-01", "mine.toml: .*expected texts"),
        ("effects =", 'colour = "red"\neffects =', r"key 'colour' in \[\[objects\]\] 'ball'; known keys: name, shape"),
        ("effects =", 'placement = "ceiling"\neffects =', r":5: placement = 'ceiling' in .*; allowed: world, palm, in_hand"),
        ("effects =", "orientation_xyzw = [0, 0, 0, 2]\neffects =", r"mine\.toml:2: object 'ball': .*unit quaternion"),
        ("effects =", "position_m = [0, 0]\neffects =", r"mine\.toml:5: position_m = \[0, 0\] in .* has 2 values; expected 3"),
        ("effects =", "motion = { time_s = [0, 0], offset_m = [[0,0,0],[0,0,0]] }\neffects =", r"mine\.toml:5: .*increasing"),
        ("effects = [", 'effects = [{ kind = "grasp" }, { kind = "grasp" }, ', "2 grasp effects"),
    ],
)  # fmt: skip
def test_a_broken_file_is_refused_with_file_line_and_key(old, new, match):
    assert old in BALL
    with pytest.raises(InputError, match=match):
        read(BALL.replace(old, new))


@pytest.mark.parametrize(
    ("more", "match"),
    [
        (BALL.split("\n", 1)[1], "'ball' appears more than once"),
        ('[[rules]]\nkind = "by_grasp"\nobject = "box"\nclutches = ["a"]\n', "object 'box' is not in the scene; it has: ball"),
        ('[[rules]]\nkind = "on_contact"\nobject = "ball"\nclutches = ["a"]\n', "clutch 'a' is not in the scene; it has: none"),
        (
            '[[clutches]]\nname = "a"\nwhere = "back"\n[[rules]]\nkind = "by_grasp"\nobject = "ball"\nclutches = ["a"]\n',
            "no grasp effect",
        ),
        (
            '[[clutches]]\nname = "a"\nwhere = "back"\n[[rules]]\nkind = "held_posture"\nsignal = "bend"\nclutches = ["a"]\n'
            "upright_rad = 0.1\nhold_s = 1\nrelease_s = 1\n",
            "signal 'bend' is not in the scene",
        ),
    ],
)
def test_names_must_lead_somewhere(more, match):
    with pytest.raises(InputError, match=match):
        read(BALL + more)


def test_every_fault_of_a_file_is_reported_at_once():
    with pytest.raises(InputError) as caught:
        read(BALL.replace("0.03", '"a"').replace('"ball"', "3"))
    assert len(str(caught.value).splitlines()) == 2


def test_size_and_place_of_an_object_in_the_hand_are_the_hands():
    in_hand = BALL.replace("effects =", 'placement = "in_hand"\nposition_m = [0, 0, 1]\neffects =')
    with pytest.raises(InputError) as caught:
        read(in_hand)
    radius, position = str(caught.value).splitlines()
    assert radius.startswith("mine.toml:4: radius_m = 0.03 m of [[objects]] 'ball' would not count: placed in_hand, ")
    assert position.startswith("mine.toml:6: position_m = [0, 0, 1] m of [[objects]] 'ball' would not count")
    assert radius.endswith("leave radius_m out, or choose placement world or palm")
    free = in_hand.replace(", radius_m = 0.03", "").replace("position_m = [0, 0, 1]\n", "")
    recording = load_hand("synthetic")
    found = place_in_hand(recording)
    assert found is not None
    assert read(free).placed_for(recording).object("ball").body.shape == Sphere(found.radius_m)
    assert read(free.replace('"sphere"', '"cylinder", height_m = 0.1')).unresolved == ("ball",)


@pytest.mark.parametrize(
    "table", ["objects = 3", '[[objects]]\nplacement = "in_hand"', '[[objects]]\nplacement = "in_hand"\nshape = 1']
)
def test_a_file_with_no_tables_for_the_hand_to_size_is_refused_by_key(table):
    with pytest.raises(InputError, match=r"mine\.toml:\d+: (key 'name' is missing|objects = 3)"):
        read('summary = "x"\n' + table)


def test_a_plane_cannot_be_held_in_the_hand():
    with pytest.raises(InputError, match="sphere, cylinder, box"):
        Scene("mine", (SceneObject("floor", Placed(Plane()), placement="in_hand", resolved=False),))

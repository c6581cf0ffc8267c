"""Joints as JSON: each engine's basis, names and forms give the poses they were made from; what is missing is named."""

from __future__ import annotations

import gzip
import json
import re

import numpy as np
import pytest
from engine_hands import ENGINES, UNITY, WEBXR, as_engine, assert_same, json_lines, poses_of, shipped

from haptics.errors import InputError
from haptics.scene.hand_files import pose_rows
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.joints import JOINTS
from haptics.scene.hands.motion import judge_motion

TRACK = shipped()
HEADER = {"basis": "openxr", "unit": "m", "time": "s"}


@pytest.fixture
def load(tmp_path):
    def from_text(text, **told):
        path = tmp_path / "hand.dump"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_hand(path, **told)

    return from_text


# A right hand lies flat with its back up, as Unity has it, in centimetres: +Z is forward, and no joint is turned.
FLAT_CM = """
    Wrist 0 100 30     Palm 0 100 35      ThumbMetacarpal -3 100 33    ThumbProximal -5 100 36    ThumbDistal -6 100 39
    ThumbTip -7 100 42        IndexMetacarpal -2 100 33    IndexProximal -2 100 39    IndexIntermediate -2 100 43
    IndexDistal -2 100 45     IndexTip -2 100 47           MiddleMetacarpal 0 100 33  MiddleProximal 0 100 39
    MiddleIntermediate 0 100 43    MiddleDistal 0 100 46   MiddleTip 0 100 48         RingMetacarpal 2 100 33
    RingProximal 2 100 39     RingIntermediate 2 100 43    RingDistal 2 100 45        RingTip 2 100 47
    LittleMetacarpal 4 100 33 LittleProximal 4 100 38      LittleIntermediate 4 100 41    LittleDistal 4 100 43
    LittleTip 4 100 45
"""


def test_a_file_written_by_hand(load):
    joints = {name: {"position": [float(x), float(y), float(z)], "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}}
              for name, x, y, z in re.findall(r"(\w+) (-?\d+) (\d+) (\d+)", FLAT_CM)}  # fmt: skip
    assert len(joints) == 26
    lines = [{"basis": "unity", "unit": "cm", "time": "ms"}, {"time": 1000.0, "side": "Right", "joints": joints}]
    found = load(json_lines(None, [*lines, {**lines[1], "time": 1012.5}]))
    (track,) = found.tracks
    assert (track.side, track.time_ns.tolist(), found.duration_s) == ("right", [0, 12_500_000], 0.0125)
    np.testing.assert_allclose(track.joint_m("wrist")[0], [0.0, 1.0, -0.30], atol=1e-12)
    np.testing.assert_allclose(track.joint_m("index_tip")[0], [-0.02, 1.0, -0.47], atol=1e-12)
    np.testing.assert_allclose(track.joint_m("little_intermediate")[1], [0.04, 1.0, -0.41], atol=1e-12)
    np.testing.assert_allclose(np.abs(track.orientation_xyzw), np.tile([0.0, 0.0, 0.0, 1.0], (2, 26, 1)), atol=1e-12)
    assert found.notes == found.refused == ()
    assert judge_motion(found).notes == ()  # neither the side nor the poses are doubted


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
@pytest.mark.parametrize("engine", ENGINES)
def test_every_basis_and_unit_gives_the_poses_back(load, engine, unit):
    unit_m = {"m": 1.0, "cm": 0.01, "mm": 0.001}[unit]
    found = load(json_lines({"basis": engine, "unit": unit, "time": "s"}, poses_of(TRACK, engine, unit_m)))
    assert_same(found.tracks[0], TRACK)
    assert found.notes == ()
    assert found.origin is not None
    assert (found.origin.basis, found.origin.unit, found.origin.made, found.origin.turned) == (engine, unit, (), False)
    assert 0.0 <= found.origin.off_m < 1e-12


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
@pytest.mark.parametrize("engine", ["openxr", "unity", "unreal"])
def test_what_a_file_does_not_say_is_inferred_where_it_is_certain_and_said(load, engine, unit):
    unit_m = {"m": 1.0, "cm": 0.01, "mm": 0.001}[unit]
    found = load(json_lines(None, poses_of(TRACK, engine, unit_m)))
    assert_same(found.tracks[0], TRACK)
    assert [note.split(" was inferred")[0] for note in found.notes] == ["time: s", f"unit: {unit}", f"basis: {engine}"]


@pytest.mark.parametrize(
    ("name", "per_s"), [("time_ns", 1e9), ("timestampUs", 1e6), ("time_ms", 1e3), ("t", 1.0), ("timestamp", 1e3)]
)
def test_times_by_their_names_or_by_their_pace(load, name, per_s):
    poses = poses_of(TRACK, "openxr")
    for pose in poses:
        pose[name] = 1e6 + pose.pop("time") * per_s
    found = load(json_lines({"basis": "openxr", "unit": "m"}, poses))
    np.testing.assert_allclose(found.tracks[0].time_ns, TRACK.time_ns, atol=300)  # what a float of this size resolves
    assert bool(found.notes) == (name in ("t", "timestamp"))


def test_webxr_lacks_the_palm_which_is_made_as_the_middle_of_the_middle_metacarpal(load):
    found = load(json_lines({"basis": "webxr", "unit": "m", "time": "s"}, poses_of(TRACK, "webxr", names=WEBXR)))
    assert_same(found.tracks[0], TRACK, list(JOINTS[1:]))
    middle = 0.5 * (TRACK.joint_m("middle_metacarpal") + TRACK.joint_m("middle_proximal"))
    np.testing.assert_allclose(found.tracks[0].joint_m("palm"), middle, atol=1e-12)
    assert found.notes == ("1 of 26 joints was made rather than read: palm",)
    assert found.origin is not None
    assert found.origin.read == JOINTS[1:]


POSES = poses_of(TRACK, "unity", names=UNITY)
POSITION, TURN = as_engine(TRACK, "unity")


def joints(form):
    """The same poses with the joints in another form."""
    found = []
    for pose, *both in zip(POSES, POSITION.tolist(), TURN.tolist(), strict=True):
        forms = {name: form(place, turn) for name, place, turn in zip(JOINTS, *both, strict=True)}
        found.append({"time": pose["time"], "side": "right", "joints": forms})
    return found


def xyzw(numbers):
    return dict(zip("xyzw", numbers, strict=False))


UNITY_HEADER = {"basis": "unity", "unit": "m", "time": "s"}
FORMS = {
    "Unity's names": POSES,
    "objects of x, y, z, w": joints(lambda place, turn: {"pos": xyzw(place), "rot": xyzw(turn)}),
    "within a pose": joints(lambda place, turn: {"radius": 0.01, "pose": {"position": place, "orientation": turn}}),
    "within a transform": joints(
        lambda place, turn: {"transform": {"position": {**xyzw(place), "w": 1}, "orientation": xyzw(turn)}}
    ),
    "a list of seven": joints(lambda place, turn: [*place, *turn]),
    "two lists": joints(lambda place, turn: [place, turn]),
    "seven members": joints(lambda place, turn: {**xyzw(place), **{f"q{axis}": part for axis, part in xyzw(turn).items()}}),
    "Unity's members": joints(lambda place, turn: {f"{kind}{axis.upper()}": part for kind, one in (("pos", place), ("rot", turn))
                                                   for axis, part in xyzw(one).items()}),
    "a list of joints with names": [
        {**pose, "joints": [{"id": name, **value} for name, value in pose["joints"].items()]} for pose in POSES
    ],
    "joints as members of the line": [{"timestamp": pose["time"], "hand": "R", **pose["joints"]} for pose in POSES],
    "hands in a list": [{"time": pose["time"], "hands": [{"handedness": "right", "joints": pose["joints"]}]} for pose in POSES],
    "hands by side": [{"time": pose["time"], "hands": {"left": None, "right": {"joints": pose["joints"]}}} for pose in POSES],
    "a member for each side": [{"time": pose["time"], "right": pose["joints"], "left": None} for pose in POSES],
    "input sources": [
        {"time": pose["time"], "inputSources": [{"handedness": "right", "hand": pose["joints"]}]} for pose in POSES
    ],
    "more joints than a hand has": [{**pose, "joints": {**pose["joints"], "Elbow": {"position": [0, 0, 0]}}} for pose in POSES],
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_forms_that_programs_write(load, form):
    found = load(json_lines(UNITY_HEADER, FORMS[form]))
    assert_same(found.tracks[0], TRACK)
    assert found.refused == found.notes == ()


def test_25_joints_without_names_are_in_webxrs_order(load):
    poses = poses_of(TRACK, "webxr")
    for pose in poses:
        pose["joints"] = list(pose["joints"].values())[1:]
    assert_same(load(json_lines({**HEADER, "basis": "webxr"}, poses)).tracks[0], TRACK, list(JOINTS[1:]))
    for pose in poses:
        pose["joints"].append(pose["joints"][0])
    with pytest.raises(InputError, match=r"objects\[1\]\.joints is a list of 26 without names; expected a name with each"):
        load(json_lines(HEADER, poses))


@pytest.mark.parametrize(
    "wrap",
    [
        lambda poses: json.dumps(poses),
        lambda poses: json.dumps({**HEADER, "frames": poses}),
        lambda poses: json.dumps({"frames": poses, **HEADER}),
        lambda poses: gzip.compress(json_lines(HEADER, poses).encode(), mtime=0),
        lambda poses: json_lines(HEADER, poses).encode("utf-16"),
        lambda poses: json_lines({"basis": "OpenXR", "units": "metres", "time_unit": "seconds"}, poses),
    ],
    ids=["a list", "header and frames", "frames and header", "gzip", "UTF-16", "other words"],
)
def test_wrappers(load, wrap):
    assert_same(load(wrap(poses_of(TRACK, "openxr"))).tracks[0], TRACK)


def test_both_hands_and_a_gap_make_tracks(load):
    right, left = poses_of(TRACK, "openxr"), poses_of(TRACK, "openxr", side="left")
    late = [{**pose, "time": pose["time"] + 0.2} for pose in right[20:]]
    found = load(json_lines(HEADER, [*right[:20], *left, *late, {"time": 9.0, "hands": []}]))
    assert [(track.side, len(track)) for track in found.tracks] == [("right", 20), ("left", 40), ("right", 20)]
    assert found.dropped == {"frames without a hand": 1}
    assert judge_motion(found, "left").notes[-1].startswith("the hand labelled left looks like a right one")


def test_a_track_number_of_the_file_parts_tracks(load):
    poses = [{**pose, "track": int(index >= 30)} for index, pose in enumerate(poses_of(TRACK, "openxr"))]
    assert [len(track) for track in load(json_lines(HEADER, poses)).tracks] == [30, 10]


def test_points_alone_have_orientations_made_and_need_their_basis(load):
    poses = poses_of(TRACK, "unity")
    for pose in poses:
        pose["joints"] = {name: value["position"] for name, value in pose["joints"].items()}
    found = load(json_lines(UNITY_HEADER, poses))
    np.testing.assert_allclose(found.tracks[0].position_m, TRACK.position_m, atol=1e-12)
    assert found.notes == ("orientations were made from where the joints are",)
    assert judge_motion(found).refused == ()
    with pytest.raises(InputError, match=r"basis is not declared, .* `haptics hand convert FILE OUT --basis`"):
        load(json_lines(None, poses))


# -- one bad pose ----------------------------------------------------------------------------------------------------------------

NAN = float("nan")
BAD = [
    (lambda pose: pose["joints"].pop("ring_tip"), r"objects\[6\]: no position of ring_tip; missing, called otherwise, or lost"),
    (lambda pose: pose["joints"].update(ring_tip=None), "no position of ring_tip"),
    (lambda pose: pose["joints"]["ring_tip"].update(position=[NAN, 0, 0]), "no position of ring_tip"),
    (lambda pose: pose["joints"]["ring_tip"].update(position=[0, float("inf"), 0]), "no position of ring_tip"),
    (lambda pose: pose["joints"]["ring_tip"].update(position=None), "no position of ring_tip"),
    (lambda pose: pose["joints"]["ring_tip"].update(tracked=False), "no position of ring_tip"),
    (lambda pose: pose["joints"]["ring_tip"].pop("orientation"), "no orientation of ring_tip"),
    (
        lambda pose: pose["joints"]["ring_tip"].update(orientation=[0, 0, 0]),
        r"joints\.ring_tip\.orientation is a list of 3; expected 4 numbers",
    ),
    (lambda pose: pose["joints"]["ring_tip"].update(position=[0, 0]), r"joints\.ring_tip\.position is a list of 2; expected 3"),
    (lambda pose: pose["joints"]["ring_tip"].update(position=[0, "1", 0]), r"ring_tip\.position\.y = '1'; expected a number"),
    (lambda pose: pose["joints"]["ring_tip"].update(position=[0, True, 0]), r"ring_tip\.position\.y = True; expected"),
    (lambda pose: pose["joints"]["ring_tip"].update(position=[10**400, 0, 0]), r"position\.x = an integer of 1329 bits"),
    (
        lambda pose: pose["joints"]["ring_tip"].update(position=[1e7, 0, 0]),
        r"position\.x = 10000000\.0; expected a number within 1000000",
    ),
    (lambda pose: pose["joints"].update(ring_tip=7), r"joints\.ring_tip is 7; expected a position"),
    (lambda pose: pose["joints"].update(ring_tip={"where": 7}), r"joints\.ring_tip has where; expected a position"),
    (lambda pose: pose["joints"].update(RingTip=pose["joints"]["palm"]), r"joints\.ring_tip is given twice"),
    (lambda pose: pose["joints"].pop("palm"), "no position of palm"),
    (lambda pose: pose.update(joints={}), r"objects\[6\] has no joints"),
    (lambda pose: pose.update(side="both"), r"objects\[6\]\.side = 'both' is not allowed; allowed: left, right"),
    (lambda pose: pose.update(side=["left"]), r"objects\[6\] does not say of which hand it is"),
    (lambda pose: pose.update(track=-1), r"objects\[6\]\.track = -1; must be a whole number"),
    (lambda pose: pose.update(time=None), r"objects\[6\]\.time = null; expected a number"),
    (lambda pose: pose.update(time=NAN), r"objects\[6\]\.time = nan"),
    (lambda pose: pose.update(time=10**400), r"objects\[6\]\.time = an integer of 1329 bits"),
    (lambda pose: pose.update(time=900.0), r"objects\[6\]: its time 900 s lies ahead of the next frame's"),
    (lambda pose: pose.update(time=0.01), r"objects\[6\]: its time 0\.01 s goes back"),
]


@pytest.mark.parametrize(("spoil", "reason"), BAD)
def test_one_bad_pose_is_refused_and_the_rest_is_as_before(load, spoil, reason):
    poses = poses_of(TRACK, "openxr")
    spoil(poses[5])
    found = load(json_lines(HEADER, poses))
    (refused,) = found.refused
    assert re.search(reason, refused.reason), refused.reason
    rest = np.arange(40) != 5
    np.testing.assert_array_equal(found.tracks[0].position_m, TRACK.position_m[rest])


def test_a_hand_that_is_not_tracked_is_left_out_however_often(load):
    poses = poses_of(TRACK, "openxr")
    lost = [{**pose, "side": "left", "joints": dict.fromkeys(JOINTS)} for pose in poses]
    found = load(json_lines(HEADER, poses + lost))
    assert found.dropped == {"poses without a hand: no joint has a place of its own": 40}
    assert found.refused == ()
    nowhere = [{**pose, "side": "left", "joints": {name: [0, 0, 0, 0, 0, 0, 1] for name in JOINTS}} for pose in poses]
    assert load(json_lines(HEADER, poses + nowhere)).dropped == found.dropped
    unsure = [{**pose, "side": "left", "isTracked": False} for pose in poses]
    assert load(json_lines(HEADER, poses + unsure)).dropped == {"poses that their tracker marks as not valid": 40}


@pytest.mark.parametrize(
    ("spoil", "told", "message"),
    [
        (lambda poses: [pose["joints"].pop("ring_tip") for pose in poses], {}, r"no position of ring_tip; .*40 of 40 poses"),
        (lambda poses: [pose.pop("side") for pose in poses], {}, r"objects\[1\] does not say of which hand .* --side`"),
        (lambda poses: [pose.pop("time") for pose in poses], {}, r"objects\[1\] has no time; expected a member `time`"),
        (lambda poses: [pose.update(time=7.0) for pose in poses], {}, r"39 of 40 poses repeat a time of their hand"),
        (lambda poses: None, {"unit": "cm"}, r"unit = 'cm', but the hand is 0\.17.* long .*, which is a hand's length in m only"),
        (lambda poses: None, {"basis": "unity"}, r"basis = 'unity' does not fit the joints: .*; openxr fits"),
        (lambda poses: None, {"basis": "maya"}, r"basis = 'maya' is not allowed; allowed: openxr, webxr, godot, unity, unreal"),
        (lambda poses: None, {"mirrored": True}, r"mirrored = True: what hand\.dump is settles that; leave it out"),
        (lambda poses: None, {"side": "left"}, r"there is no pose of the left hand in it"),
    ],
)
def test_a_file_that_cannot_be_used_says_why_and_what_to_do(load, spoil, told, message):
    poses = poses_of(TRACK, "openxr")
    spoil(poses)
    with pytest.raises(InputError, match=message):
        load(json_lines(HEADER, poses), **told)


def test_no_unit_is_guessed_of_what_is_no_hands_size(load):
    poses = poses_of(TRACK, "openxr", unit_m=1 / 40)  # 7 m, 7 cm or 7 mm
    with pytest.raises(
        InputError, match=r"unit of its lengths is not declared, and the hand is 6\.977 long .* in none of m, cm, mm; .*--unit`"
    ):
        load(json_lines({"basis": "openxr", "time": "s"}, poses))
    with pytest.raises(InputError, match=r"unit of its times is not declared, and its poses are 0 apart"):
        load(json_lines({"basis": "openxr", "unit": "m"}, poses_of(TRACK, "openxr")[:1]))


def test_times_that_look_like_another_unit_are_noted(load):
    assert (
        "too fast for a tracker; are the times in s?"
        in load(json_lines({**HEADER, "time": "us"}, poses_of(TRACK, "openxr"))).notes[0]
    )


def test_a_header_that_contradicts_another_is_refused(load):
    with pytest.raises(InputError, match=r"basis = 'openxr', but before it was 'unity'"):
        load(json_lines(UNITY_HEADER, [HEADER, *poses_of(TRACK, "openxr")]))
    with pytest.raises(InputError, match=r"objects\[0\]: unit = 'feet' is not allowed; allowed: m, cm, mm"):
        load(json_lines({**HEADER, "unit": "feet"}, poses_of(TRACK, "openxr")))


def test_what_is_told_counts_before_what_the_file_says(load):
    poses = poses_of(TRACK, "unity")
    assert_same(load(json_lines(HEADER, poses), basis="unity").tracks[0], TRACK)
    for pose in poses:
        del pose["side"]
    assert load(json_lines(HEADER, poses), basis="unity", side="right").tracks[0].side == "right"


def test_of_two_hands_one_can_be_read_alone(load):
    both = [*poses_of(TRACK, "openxr"), *poses_of(TRACK, "openxr", side="left")]
    assert [track.side for track in load(json_lines(HEADER, both), side="left").tracks] == ["left"]


def test_a_file_of_too_many_poses_is_refused(load, monkeypatch):
    monkeypatch.setattr(pose_rows, "MOST_POSES", 39)
    with pytest.raises(InputError, match=r"the file goes on beyond the allowed 39 poses"):
        load(json_lines(HEADER, poses_of(TRACK, "openxr")))


def test_a_file_of_nothing_but_bad_lines_is_not_read_to_its_end(load):
    text = json_lines(HEADER, poses_of(TRACK, "openxr")[:1]) + '{"time": 1, "joints": {}}\n' * 3000
    with pytest.raises(InputError, match=r"has no joints; .* \(1000 of 1001 poses cannot be used\)"):
        load(text)

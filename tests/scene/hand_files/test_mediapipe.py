"""World landmarks of MediaPipe: a hand of known geometry before a camera, in the forms of its tasks and older solutions."""

from __future__ import annotations

import json

import numpy as np
import pytest
from engine_hands import shipped
from scipy.spatial.transform import Rotation

from haptics.errors import InputError
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.joints import JOINT, JOINTS
from haptics.scene.hands.motion import judge_motion

# Someone holds up a right hand before the camera, which sees its palm: fingers up, the thumb to the picture's right. Millimetres
# as the camera has them: +x to the picture's right, +y down, +z away; the fingertips bend toward the camera a little.
LANDMARKS_MM = [
    (0, 90, 0),
    *((20, 70, -5), (40, 45, -10), (52, 20, -14), (60, 0, -18)),
    *((25, 0, 0), (27, -40, -3), (28, -62, -12), (29, -80, -21)),
    *((0, -5, 0), (0, -50, -3), (0, -76, -12), (0, -95, -21)),
    *((-20, 0, 0), (-22, -40, -3), (-23, -64, -12), (-24, -82, -21)),
    *((-38, 10, 0), (-42, -20, -3), (-44, -38, -12), (-46, -54, -21)),
]
POINTS = [{"x": x / 1e3, "y": y / 1e3, "z": z / 1e3, "visibility": 0.0, "presence": 0.0} for x, y, z in LANDMARKS_MM]
PICTURE = [{"x": 0.5 + x / 500, "y": 0.5 + y / 500, "z": z / 500} for x, y, z in LANDMARKS_MM]
ORDER = [name for name in JOINTS if name != "palm" and (name.startswith("thumb") or not name.endswith("metacarpal"))]


def flipped(points):
    return [{**point, "x": -point["x"]} for point in points]


def python_task(label="Right", points=POINTS):
    return {
        "handedness": [[{"index": 0, "score": 0.97, "display_name": label, "category_name": label}]],
        "hand_landmarks": [PICTURE],
        "hand_world_landmarks": [points],
    }


def web_task(label="Right", points=POINTS):
    category = [[{"score": 0.97, "index": 0, "categoryName": label, "displayName": label}]]
    return {"landmarks": [PICTURE], "worldLandmarks": [points], "handednesses": category, "handedness": category}


def old_python(label="Right", points=POINTS):
    return {
        "multi_handedness": [{"classification": [{"index": 1, "score": 0.97, "label": label}]}],
        "multi_hand_landmarks": [{"landmark": PICTURE}],
        "multi_hand_world_landmarks": [{"landmark": points}],
    }


def old_web(label="Right", points=POINTS):
    return {"multiHandedness": [{"index": 0, "score": 0.97, "label": label}], "multiHandWorldLandmarks": [points]}


def alone(label="Right", points=POINTS):
    return {"handedness": label, "worldLandmarks": [[point["x"], point["y"], point["z"]] for point in points]}


@pytest.fixture
def load(tmp_path):
    def from_results(results, header=None, **told):
        lines = [header] if header else []
        lines += [{"timestamp_ms": 33 * index, **result} for index, result in enumerate(results)]
        path = tmp_path / "landmarks.jsonl"
        path.write_text("\n".join(json.dumps(line) for line in lines))
        return load_hand(path, **told)

    return from_results


def assert_the_hand(found):
    (track,) = found.tracks
    assert (track.side, track.time_ns.tolist()) == ("right", [0, 33_000_000, 66_000_000])
    for name, (x, y, z) in zip(ORDER, LANDMARKS_MM, strict=True):
        np.testing.assert_allclose(track.joint_m(name)[0], [x / 1e3, -y / 1e3, -z / 1e3], atol=1e-12, err_msg=name)


def test_axes_are_turned_and_missing_joints_made(load):
    found = load([python_task()] * 3)
    assert_the_hand(found)
    (track,) = found.tracks
    # The middle metacarpal begins 72 % of the way from the knuckle, 5 mm above the origin, to the wrist, 90 mm below it.
    np.testing.assert_allclose(track.joint_m("middle_metacarpal")[0], [0.0, 0.005 - 0.72 * 0.095, 0.0], atol=1e-12)
    np.testing.assert_allclose(track.joint_m("palm")[0], [0.0, 0.005 - 0.36 * 0.095, 0.0], atol=1e-12)
    palm = Rotation.from_quat(track.orientation_xyzw[0, JOINT["palm"]])
    np.testing.assert_allclose(palm.apply([0, 0, -1]), [0, 1, 0], atol=1e-9)  # forward is up
    np.testing.assert_allclose(palm.apply([0, 1, 0]), [0, 0, -1], atol=0.02)  # the back faces away from the camera
    tip = Rotation.from_quat(track.orientation_xyzw[0, JOINT["middle_tip"]])
    bone = np.array([0.0, 0.019, 0.009])
    np.testing.assert_allclose(tip.apply([0, 0, -1]), bone / np.linalg.norm(bone), atol=1e-9)
    assert found.notes == (
        "world landmarks have their origin in the hand, so the hand turns and bends but does not travel",
        "the picture was taken for one that was not mirrored; the file does not say",
        "5 of 26 joints were made rather than read: "
        "palm, index_metacarpal, middle_metacarpal, ring_metacarpal, little_metacarpal",
        "orientations were made from where the joints are",
    )
    assert judge_motion(found).notes == found.notes  # nothing is doubted


@pytest.mark.parametrize("form", [python_task, web_task, alone])
def test_results_of_the_tasks_name_the_hand_as_it_is_in_the_picture(load, form):
    assert_the_hand(load([form()] * 3))
    assert_the_hand(load([form()] * 3, {"mirrored": False}))
    mirrored = [form("Left", flipped(POINTS))] * 3
    assert_the_hand(load(mirrored, {"mirrored": True}))
    assert_the_hand(load(mirrored, mirrored=True))
    assert_the_hand(load([{**one, "selfieMode": True} for one in mirrored]))


@pytest.mark.parametrize("form", [old_python, old_web])
def test_the_older_solutions_name_the_hand_as_if_mirrored_so_that_has_to_be_said(load, form):
    assert_the_hand(load([form("Right", flipped(POINTS))] * 3, {"mirrored": True}))
    assert_the_hand(load([form("Left")] * 3, mirrored=False))
    with pytest.raises(InputError, match=r'older solutions .*; begin the file with \{"mirrored": true\} or .* --not-mirrored'):
        load([form()] * 3)


def test_a_hand_of_the_wrong_side_is_told_by_how_its_fingers_bend(load):
    (note,) = load([python_task("Left")] * 3).notes[4:]
    assert note == "the left hand's fingers bend out of its back: it may be the other hand, or a mirrored one"


def test_the_shipped_motion_as_landmarks_keeps_its_shape(load):
    track = shipped()
    at = [JOINT[name] for name in ORDER]
    middle_m = track.position_m[:, at].mean(axis=1, keepdims=True)
    local = track.position_m - middle_m
    results = [
        {**python_task(), "hand_world_landmarks": [[dict(zip("xyz", (x, -y, -z), strict=True)) for x, y, z in pose]]}
        for pose in local[:, at].tolist()
    ]
    found = load(results, {"mirrored": False}).tracks[0].position_m
    np.testing.assert_allclose(found[:, at], local[:, at], atol=1e-12)
    off_m = np.linalg.norm(found - local, axis=2).max(axis=0)
    assert off_m.max() < 0.0075  # what docs/reference/hands.md says of the joints that are made
    assert JOINTS[int(off_m.argmax())] == "little_metacarpal"


def test_two_hands_and_frames_without_one(load):
    both = {key: value * 2 for key, value in python_task().items()}
    both["handedness"] = [both["handedness"][0], [{"category_name": "Left"}]]
    empty = {"handedness": [], "hand_landmarks": [], "hand_world_landmarks": []}
    found = load([both, empty, both])
    assert [(track.side, len(track)) for track in found.tracks] == [("right", 2), ("left", 2)]
    assert found.dropped == {"frames without a hand": 1}


@pytest.mark.parametrize(
    ("result", "message"),
    [
        ({"hand_landmarks": [PICTURE], "handedness": []}, r"0 to 1\), which have no scale; expected its world landmarks"),
        ({"landmarks": [PICTURE]}, r"which have no scale; .* worldLandmarks \(web\)"),
        ({"multiHandLandmarks": [PICTURE]}, "which have no scale"),
        (python_task(points=PICTURE), r"has no x or y below 0, as world landmarks have, .* which have no scale"),
        (python_task(points=POINTS[:20]), r"hand_world_landmarks\[0\] is a list of 20; expected 21 landmarks"),
        (python_task(points=[7] * 21), r"hand_world_landmarks\[0\] is a list of 1; expected 21 landmarks"),
        (python_task(points=[{"x": 0.1}] * 21), r"hand_world_landmarks\[0\]\[0\] has x; expected a position"),
        ({**python_task(), "hand_world_landmarks": "none"}, r"hand_world_landmarks is 'none'; expected a list of hands"),
        ({**python_task(), "handedness": [[{"category_name": "Both"}]]}, r"handedness = 'Both' is not allowed"),
        ({**python_task(), "handedness": []}, r"does not say of which hand it is, left or right; .*--side`"),
        (7, r"is 7; expected an object with world landmarks"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(load, tmp_path, result, message):
    results = [result] * 3
    if isinstance(result, dict):
        with pytest.raises(InputError, match=message):
            load(results)
        return
    path = tmp_path / "some.json"
    path.write_text(json.dumps([{"timestamp_ms": 0, **python_task()}, 7]))
    with pytest.raises(InputError, match=message):
        load_hand(path)


@pytest.mark.parametrize(("name", "value"), [("basis", "openxr"), ("unit", "m")])
def test_what_landmarks_settle_cannot_be_told_otherwise(load, name, value):
    with pytest.raises(InputError, match=rf"{name} = '{value}': what landmarks\.jsonl is settles that; leave it out"):
        load([python_task()] * 3, **{name: value})


def test_axes_that_the_file_declares_are_refused_as_landmarks_have_their_own(load):
    with pytest.raises(InputError, match=r"basis = 'unity': what landmarks\.jsonl is settles that; leave it out"):
        load([python_task()] * 3, {"basis": "unity"})


def test_a_side_that_no_label_gives_can_be_told(load):
    assert_the_hand(load([{**python_task(), "handedness": []}] * 3, side="right"))


def test_mirrored_said_too_late_or_both_ways_is_refused(load):
    with pytest.raises(InputError, match=r"mirrored is said after the first pose; say it before"):
        load([python_task(), {**python_task(), "mirrored": True}])
    with pytest.raises(InputError, match=r"mirrored = False, but before it was True"):
        load([{**python_task(), "mirrored": False}], {"mirrored": True})


def test_a_lost_landmark_costs_its_own_pose_only(load):
    lost = [*POINTS[:8], {"x": float("nan"), "y": 0.0, "z": 0.0}, *POINTS[9:]]
    found = load([python_task()] * 5 + [python_task(points=lost)] + [python_task()] * 4)
    (refused,) = found.refused
    assert refused.reason == "objects[5].hand_world_landmarks[0]: no position of index_tip; missing, called otherwise, or lost"
    assert len(found.tracks[0]) == 9

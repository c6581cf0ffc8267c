"""Joints, frames, their checks, and the engines' bases."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from haptics.errors import InputError
from haptics.scene.hands.basis import BASES, basis
from haptics.scene.hands.bones import orientations, quaternions
from haptics.scene.hands.check import check_frame
from haptics.scene.hands.frame import HandFrame, mirrored, with_palm
from haptics.scene.hands.joints import JOINT, JOINTS, joint_index
from haptics.scene.hands.recording import HandRecording, HandTrack

# Copied from the enumeration XrHandJointEXT of the OpenXR registry.
OPENXR = [
    "PALM", "WRIST", "THUMB_METACARPAL", "THUMB_PROXIMAL", "THUMB_DISTAL", "THUMB_TIP",
    "INDEX_METACARPAL", "INDEX_PROXIMAL", "INDEX_INTERMEDIATE", "INDEX_DISTAL", "INDEX_TIP",
    "MIDDLE_METACARPAL", "MIDDLE_PROXIMAL", "MIDDLE_INTERMEDIATE", "MIDDLE_DISTAL", "MIDDLE_TIP",
    "RING_METACARPAL", "RING_PROXIMAL", "RING_INTERMEDIATE", "RING_DISTAL", "RING_TIP",
    "LITTLE_METACARPAL", "LITTLE_PROXIMAL", "LITTLE_INTERMEDIATE", "LITTLE_DISTAL", "LITTLE_TIP",
]  # fmt: skip

# Copied from the enumeration XRHandJoint of the WebXR Hand Input module, which has no palm.
WEBXR = [
    "wrist", "thumb-metacarpal", "thumb-phalanx-proximal", "thumb-phalanx-distal", "thumb-tip",
    "index-finger-metacarpal", "index-finger-phalanx-proximal", "index-finger-phalanx-intermediate",
    "index-finger-phalanx-distal", "index-finger-tip",
    "middle-finger-metacarpal", "middle-finger-phalanx-proximal", "middle-finger-phalanx-intermediate",
    "middle-finger-phalanx-distal", "middle-finger-tip",
    "ring-finger-metacarpal", "ring-finger-phalanx-proximal", "ring-finger-phalanx-intermediate",
    "ring-finger-phalanx-distal", "ring-finger-tip",
    "pinky-finger-metacarpal", "pinky-finger-phalanx-proximal", "pinky-finger-phalanx-intermediate",
    "pinky-finger-phalanx-distal", "pinky-finger-tip",
]  # fmt: skip


def a_frame(time_ns: int = 0, shift_m: float = 0.0, track_id: int = 0) -> HandFrame:
    position = np.linspace(0.0, 0.2, 78).reshape(26, 3) + np.array([shift_m, 0.0, 0.0])
    return HandFrame(time_ns, "right", track_id, position, np.tile([0.0, 0.0, 0.0, 1.0], (26, 1)))


def test_joints_are_those_of_openxr_in_its_order():
    assert [name.upper() for name in JOINTS] == OPENXR
    assert [joint_index(f"XR_HAND_JOINT_{name}_EXT") for name in OPENXR] == list(range(26))


def test_webxr_names_are_the_same_joints_without_the_palm():
    names = [name.replace("pinky-finger", "little-finger") for name in WEBXR]
    assert [joint_index(name) for name in names] == list(range(1, 26))


def test_names_of_unity_unreal_and_godot_are_the_same_joints():
    camel = ["".join(part.capitalize() for part in name.split("_")) for name in JOINTS]
    assert camel[:3] == ["Palm", "Wrist", "ThumbMetacarpal"]
    assert [joint_index(name) for name in camel] == list(range(26))
    godot = ["HAND_JOINT_PALM", "HAND_JOINT_THUMB_TIP", "HAND_JOINT_INDEX_FINGER_PHALANX_PROXIMAL", "HAND_JOINT_PINKY_FINGER_TIP"]
    assert [JOINTS[joint_index(name)] for name in godot] == ["palm", "thumb_tip", "index_proximal", "little_tip"]


def test_pinky_is_little():
    assert [joint_index(name) for name in WEBXR] == list(range(1, 26))
    assert joint_index("pinky_tip") == JOINT["little_tip"]


@pytest.mark.parametrize("name", ["", "palm_tip", "thumb_intermediate", "sixth_tip", "tip", "INDEX"])
def test_an_unknown_joint_is_refused_by_name(name):
    with pytest.raises(InputError, match=r"joint = .*known joints: palm"):
        joint_index(name)


def test_a_missing_palm_is_the_middle_of_the_middle_metacarpal():
    whole = a_frame()
    joints = {name: (whole.position_m[index], whole.orientation_xyzw[index]) for name, index in JOINT.items()}
    joints["middle_metacarpal"] = ([0.0, 0.0, 0.0], [0.6, 0.0, 0.0, 0.8])
    joints["middle_proximal"] = ([0.02, 0.04, -0.06], [0.0, 0.0, 0.0, 1.0])
    del joints["palm"]
    frame = HandFrame.from_joints(5, "left", joints, valid=False)  # no hand's joints, which their basis would contradict
    np.testing.assert_allclose(frame.position_m[0], [0.01, 0.02, -0.03], atol=1e-15)
    np.testing.assert_array_equal(frame.orientation_xyzw[0], [0.6, 0.0, 0.0, 0.8])
    many = with_palm(np.stack([frame.position_m[1:]] * 3), np.stack([frame.orientation_xyzw[1:]] * 3))
    assert many[0].shape == (3, 26, 3)
    assert many[1].shape == (3, 26, 4)
    np.testing.assert_array_equal(many[0][2], frame.position_m)


def test_joints_by_name_must_be_whole():
    joints = {name: (np.zeros(3), np.array([0, 0, 0, 1.0])) for name in JOINTS}
    with pytest.raises(InputError, match="ring_tip"):
        HandFrame.from_joints(0, "left", {name: pose for name, pose in joints.items() if name != "ring_tip"})
    with pytest.raises(InputError, match="twice"):
        HandFrame.from_joints(0, "left", {**joints, "pinky-finger-tip": joints["little_tip"]})
    with pytest.raises(InputError, match="3 and 4 numbers"):
        HandFrame.from_joints(0, "left", {**joints, "wrist": (np.zeros(4), np.zeros(4))})
    with pytest.raises(InputError, match="side"):
        HandFrame.from_joints(0, "both", joints)


def test_a_good_pose_passes():
    assert check_frame(a_frame(), None) is None
    assert check_frame(a_frame(10_000_000, 0.049), a_frame()) is None


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (replace(a_frame(1), valid=False), "marks the pose as not valid"),
        (replace(a_frame(1), position_m=np.zeros((25, 3))), "shapes"),
        (replace(a_frame(1), position_m=a_frame().position_m * np.nan), "finite"),
        (replace(a_frame(1), orientation_xyzw=np.full((26, 4), np.inf)), "finite"),
        (a_frame(10**12, 9.9), "palm lies|tip lies|10 m"),
        (a_frame(10**12, -10.5), "palm lies at -10.5 m along x"),
        (replace(a_frame(1), orientation_xyzw=np.full((26, 4), 0.6)), "norm 1.2"),
        (replace(a_frame(1), orientation_xyzw=np.zeros((26, 4))), "norm 0"),
        (a_frame(0), "does not follow"),
        (a_frame(-5), "does not follow"),
        (a_frame(10_000_000, 0.051), "jumped at 5.1 m/s"),
    ],
)
def test_a_pose_that_must_move_nothing_is_refused_with_its_reason(frame, reason):
    found = check_frame(frame, a_frame())
    assert found is not None
    assert re.search(reason, found)


def test_one_joint_that_jumps_is_enough():
    later = a_frame(10_000_000)
    later.position_m[JOINT["ring_tip"], 1] += 0.06
    assert "ring_tip jumped" in str(check_frame(later, a_frame()))


def test_another_hand_may_appear_anywhere_but_not_back_in_time():
    assert check_frame(a_frame(1, 2.0, track_id=1), a_frame()) is None
    assert check_frame(a_frame(0, 2.0, track_id=1), a_frame()) is not None


@given(st.floats(allow_nan=True, allow_infinity=True), st.integers(0, 25), st.integers(0, 2))
def test_no_number_in_a_pose_raises(number, joint, axis):
    frame = a_frame(1)
    frame.position_m[joint, axis] = number
    reason = check_frame(frame, a_frame())
    moved = abs(number - a_frame().position_m[joint, axis])
    assert (reason is None) == bool(moved <= 5e-9)  # 5 m/s for a nanosecond


def test_mirroring_is_the_other_hand_and_twice_is_none():
    rng = np.random.default_rng(1)
    frame = HandFrame(0, "right", 0, rng.normal(size=(26, 3)), Rotation.random(26, rng=rng).as_quat())
    other = mirrored(frame)
    reflect = np.diag([-1.0, 1.0, 1.0])
    expected = reflect @ Rotation.from_quat(frame.orientation_xyzw).as_matrix() @ reflect
    np.testing.assert_allclose(Rotation.from_quat(other.orientation_xyzw).as_matrix(), expected, atol=1e-14)
    np.testing.assert_array_equal(other.position_m, frame.position_m @ reflect)
    again = mirrored(other)
    assert (other.side, again.side) == ("left", "right")
    np.testing.assert_array_equal(again.orientation_xyzw, frame.orientation_xyzw)


# -- bases ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "ahead_right_above"),
    [  # one metre forward, two to the right, three up, as each engine writes it
        ("openxr", (2.0, 3.0, -1.0)),
        ("godot", (2.0, 3.0, -1.0)),
        ("unity", (2.0, 3.0, 1.0)),
        ("unreal", (100.0, 200.0, 300.0)),
    ],
)
def test_one_place_in_every_engine(name, ahead_right_above):
    position, _ = basis(name).to_openxr(ahead_right_above, (0.0, 0.0, 0.0, 1.0))
    np.testing.assert_allclose(position, [2.0, 3.0, -1.0], atol=1e-14)


@pytest.mark.parametrize(
    ("name", "turn"),
    [  # a quarter turn of the head to the left, written by hand; engines with left-handed axes turn the other way about up
        ("openxr", (0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4))),
        ("godot", (0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4))),
        ("unity", (0.0, -np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4))),
        ("unreal", (0.0, 0.0, -np.sin(np.pi / 4), np.cos(np.pi / 4))),
    ],
)
def test_one_turn_in_every_engine(name, turn):
    _, orientation = basis(name).to_openxr((0.0, 0.0, 0.0), turn)
    forward = Rotation.from_quat(orientation).apply([0.0, 0.0, -1.0])
    np.testing.assert_allclose(forward, [-1.0, 0.0, 0.0], atol=1e-14)


@pytest.mark.parametrize(
    ("name", "turn", "up"),
    [  # nodding up by 90 degrees: what was forward is up, and what was up is back
        ("openxr", (np.sin(np.pi / 4), 0.0, 0.0, np.cos(np.pi / 4)), [0.0, 0.0, 1.0]),
        ("unity", (-np.sin(np.pi / 4), 0.0, 0.0, np.cos(np.pi / 4)), [0.0, 0.0, 1.0]),
        ("unreal", (0.0, -np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)), [0.0, 0.0, 1.0]),
    ],
)
def test_one_nod_in_every_engine(name, turn, up):
    _, orientation = basis(name).to_openxr((0.0, 0.0, 0.0), turn)
    rotation = Rotation.from_quat(orientation)
    np.testing.assert_allclose(rotation.apply([0.0, 0.0, -1.0]), [0.0, 1.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(rotation.apply([0.0, 1.0, 0.0]), up, atol=1e-14)


@pytest.mark.parametrize("name", BASES)
def test_there_and_back_is_nowhere(name):
    rng = np.random.default_rng(3)
    position, orientation = rng.normal(size=(5, 26, 3)), Rotation.random(130, rng=rng).as_quat().reshape(5, 26, 4)
    for there, back in ((basis(name).to_openxr, basis(name).from_openxr), (basis(name).from_openxr, basis(name).to_openxr)):
        again = back(*there(position, orientation))
        np.testing.assert_allclose(again[0], position, atol=1e-14)
        np.testing.assert_array_equal(again[1], orientation)


@pytest.mark.parametrize("name", BASES)
def test_a_turned_point_stays_turned(name):
    """M (R p) = (M R M') (M p): converting a rotated point, or rotating a converted one."""
    rng = np.random.default_rng(4)
    point, quaternion = rng.normal(size=3), Rotation.random(rng=rng).as_quat()
    # scipy's formula for q p q* has no handedness, so it also serves a left-handed engine.
    turned, _ = basis(name).to_openxr(Rotation.from_quat(quaternion).apply(point), quaternion)
    converted, orientation = basis(name).to_openxr(point, quaternion)
    np.testing.assert_allclose(Rotation.from_quat(orientation).apply(converted), turned, atol=1e-13)


def test_handedness_and_unknown_engines():
    assert {name for name, its in BASES.items() if its.right_handed} == {"openxr", "webxr", "godot"}
    with pytest.raises(InputError, match="blender"):
        basis("blender")


# -- orientations from bones ---------------------------------------------------------------------------------------------------


def test_quaternions_of_matrices_agree_with_scipy_even_near_half_turns():
    rng = np.random.default_rng(5)
    rotation = Rotation.concatenate(
        [
            Rotation.random(500, rng=rng),
            Rotation.from_rotvec((np.pi - 1e-9) * Rotation.random(500, rng=rng).apply([0, 0, 1])),
            Rotation.from_rotvec(np.pi * np.eye(3)),
            Rotation.identity(1),
        ]
    )
    ours = quaternions(rotation.as_matrix())
    np.testing.assert_allclose(np.abs(np.sum(ours * rotation.as_quat(), axis=1)), 1.0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(ours, axis=1), 1.0, atol=1e-15)


def straight_hand() -> np.ndarray:
    """Every finger straight ahead along -Z, palm down."""
    position = np.zeros((26, 3))
    for index, name in enumerate(JOINTS[2:], start=2):
        finger = ("thumb", "index", "middle", "ring", "little").index(name.split("_")[0])
        position[index] = (0.02 * finger, 0.0, -0.02 * index)
    return position


FORWARD, UP = np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 1.0, 0.0]])


def test_straight_fingers_have_the_worlds_axes_and_the_thumb_faces_them():
    for side, sign in (("right", 1.0), ("left", -1.0)):
        q = orientations(straight_hand()[None], FORWARD, UP, side)[0]
        flat = [index for index, name in enumerate(JOINTS) if not name.startswith("thumb")]
        np.testing.assert_allclose(q[flat], np.tile([0, 0, 0, 1.0], (22, 1)), atol=1e-15)
        nail = Rotation.from_quat(q[JOINT["thumb_distal"]]).apply([0.0, 1.0, 0.0])
        np.testing.assert_allclose(nail, [-sign * np.sin(np.pi / 3), 0.5, 0.0], atol=1e-15)


def test_a_bent_finger_keeps_its_back_outward():
    position = straight_hand()
    tip = JOINT["index_tip"]
    for bend_deg in (30.0, 90.0, 150.0):
        turn = Rotation.from_euler("x", -bend_deg, degrees=True)
        position[tip] = position[tip - 1] + turn.apply([0.0, 0.0, -0.02])
        q = orientations(position[None], FORWARD, UP, "right")[0]
        np.testing.assert_allclose(np.abs(q[[tip, tip - 1]] @ turn.as_quat()), 1.0, atol=1e-12)


def test_a_bone_of_no_length_or_across_the_palm_still_has_an_orientation():
    position = straight_hand()
    position[JOINT["ring_tip"]] = position[JOINT["ring_distal"]]
    position[JOINT["index_tip"]] = position[JOINT["index_distal"]] + (0.02, 0.0, 0.0)
    q = orientations(position[None], FORWARD, UP, "right")[0]
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-14)


def test_orientations_do_not_flip_sign_from_frame_to_frame():
    angle = np.linspace(0.0, 4 * np.pi, 200)
    turn = Rotation.from_rotvec(np.outer(angle, [0.0, 1.0, 0.0]))
    position = np.stack([turn.apply(point) for point in straight_hand()], axis=1)
    q = orientations(position, turn.apply(FORWARD[0]), turn.apply(UP[0]), "right")
    assert np.abs(np.diff(q, axis=0)).max() < 0.05  # half of 4 pi / 200, and a little


# -- tracks and recordings -----------------------------------------------------------------------------------------------------


def a_track(side: str, track_id: int, times: list[int]) -> HandTrack:
    n = len(times)
    return HandTrack(side, track_id, np.array(times), np.full((n, 26, 3), track_id), np.tile([0, 0, 0, 1.0], (n, 26, 1)))


def test_frames_of_a_side_come_in_order_and_the_older_track_speaks_first():
    recording = HandRecording(
        "made up",
        (a_track("right", 0, [0, 10, 20]), a_track("left", 1, [0, 10]), a_track("right", 2, [20, 30]), a_track("right", 3, [15])),
        4,
        30e-9,
    )
    assert [(frame.time_ns, frame.track_id) for frame in recording.frames("right")] == [
        (0, 0), (10, 0), (15, 3), (20, 0), (30, 2)
    ]  # fmt: skip
    assert [(frame.time_ns, frame.side) for frame in recording.frames("left")] == [(0, "left"), (10, "left")]
    assert all(type(frame.time_ns) is int for frame in recording.frames("right"))
    assert recording.side_with_most_frames == "right"
    assert HandRecording("", recording.tracks[1:2], 2, 0.0).side_with_most_frames == "left"
    assert HandRecording("", (), 0, 0.0).side_with_most_frames == "right"
    assert list(HandRecording("", (), 0, 0.0).frames("right")) == []

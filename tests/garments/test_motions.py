import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haptics.errors import InputError
from haptics.garments.bodies.motions import (
    ARM_DIRECTION,
    ELBOW_AXIS,
    JOINTS,
    KNEE_AXIS,
    LEG_DIRECTION,
    MOTIONS,
)

MIRROR = np.array([1.0, -1.0, -1.0])
"""What a rotation vector becomes in a mirror at x = 0."""


def test_there_are_the_ten_motions():
    assert list(MOTIONS) == [
        *("elbow_flexion", "elbow_extension", "knee_flexion", "knee_extension", "slouch", "crouch", "lunge"),
        *("arms_forward", "arms_raise", "bend_forward"),
    ]


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=str)
def test_every_joint_turns_in_proportion_to_the_angle(motion):
    half, whole = motion.pose(motion.default_deg / 2), motion.pose(motion.default_deg)
    assert set(whole) <= set(JOINTS)
    assert all(np.allclose(2 * half[joint], whole[joint], atol=1e-15) for joint in whole)
    assert motion.pose(0.0) == {}


@pytest.mark.parametrize("name", ["elbow_extension", "knee_extension"])
def test_extensions_run_from_bent_to_straight(name):
    motion = MOTIONS[name]
    assert motion.path(40, 4) == [40.0, 30.0, 20.0, 10.0, 0.0]
    assert (motion.rest_deg(40), motion.end_deg(40)) == (40.0, 0.0)


@pytest.mark.parametrize("name", [name for name in MOTIONS if "extension" not in name])
def test_other_motions_run_from_straight_to_bent(name):
    assert MOTIONS[name].path(40, 2) == [0.0, 20.0, 40.0]
    assert (MOTIONS[name].rest_deg(40), MOTIONS[name].end_deg(40)) == (0.0, 40.0)


@pytest.mark.parametrize("side", "lr")
def test_a_right_angle_at_the_elbow_points_the_forearm_forward_and_at_the_knee_the_shin_back(side):
    forearm = Rotation.from_rotvec(np.pi / 2 * ELBOW_AXIS[side]).apply(ARM_DIRECTION[side])
    shin = Rotation.from_rotvec(np.pi / 2 * KNEE_AXIS[side]).apply(LEG_DIRECTION[side])
    assert forearm == pytest.approx([0, -1, 0], abs=1e-15)
    assert shin == pytest.approx([0, 1, 0], abs=1e-15)


def test_arms_raised_by_the_angle_end_so_far_above_where_they_hung():
    turn = MOTIONS["arms_raise"].pose(80)
    for side in "lr":
        raised = Rotation.from_rotvec(turn[f"shoulder_{side}"]).apply(ARM_DIRECTION[side])
        assert np.degrees(np.arccos(-raised[2])) == pytest.approx(40 + 80)


def test_arms_forward_by_a_right_angle_point_forward():
    turn = MOTIONS["arms_forward"].pose(90)
    for side in "lr":
        assert Rotation.from_rotvec(turn[f"shoulder_{side}"]).apply(ARM_DIRECTION[side]) == pytest.approx([0, -1, 0], abs=1e-15)


def test_slouch_bends_the_spine_forward_by_its_angle_in_all():
    spine = sum(turn for joint, turn in MOTIONS["slouch"].pose(40).items() if joint.startswith("spine"))
    assert np.degrees(spine) == pytest.approx([40, 0, 0])
    assert Rotation.from_rotvec(spine).apply([0, 0, 1])[1] < 0


def test_bending_forward_brings_trunk_and_thighs_together_by_its_angle():
    pose = MOTIONS["bend_forward"].pose(80)
    spine = sum(turn for joint, turn in pose.items() if joint.startswith("spine"))
    assert np.degrees(spine - pose["hip_l"]) == pytest.approx([80, 0, 0])


@pytest.mark.parametrize("name", ["slouch", "crouch", "arms_forward", "arms_raise", "bend_forward"])
def test_motions_of_both_sides_mirror_each_other(name):
    pose = MOTIONS[name].pose(30)
    for joint, turn in pose.items():
        other = {"l": "r", "r": "l"}.get(joint[-1])
        twin = pose[joint[:-1] + other] if other else turn
        assert MIRROR * turn == pytest.approx(twin, abs=1e-15)


def test_in_a_lunge_the_left_thigh_comes_forward_and_the_right_goes_back():
    pose = MOTIONS["lunge"].pose(80)
    left, right = (Rotation.from_rotvec(pose[f"hip_{side}"]).apply(LEG_DIRECTION[side]) for side in "lr")
    assert left[1] < -0.9
    assert right[1] > 0.3


@pytest.mark.parametrize("angle", [0.5, 121.0, -3.0, float("nan")])
def test_an_angle_out_of_range_is_refused_with_what_is_allowed(angle):
    with pytest.raises(InputError, match=r"angle of elbow_flexion = .* 1 to 120 deg"):
        MOTIONS["elbow_flexion"].path(angle, 10)


def test_a_pose_may_be_straight_but_not_beyond():
    with pytest.raises(InputError, match="angle of lunge = -1 deg"):
        MOTIONS["lunge"].pose(-1.0)


def test_no_steps_are_refused():
    with pytest.raises(InputError, match="steps = 0"):
        MOTIONS["slouch"].path(30, 0)

"""Joints and orientations that a tracker lacks, made of a hand whose geometry is known."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.scene.hands.completion import MAKEABLE, METACARPALS, REQUIRED, bent_back, completed, palm_axes
from haptics.scene.hands.frame import mirrored
from haptics.scene.hands.joints import JOINT, JOINTS
from haptics.scene.hands.synthetic import synthetic_hand

TRACK = synthetic_hand(noise_m=0.0).tracks[0]
IDENTITY = np.tile([0.0, 0.0, 0.0, 1.0], (1, 26, 1))


def flat() -> np.ndarray:
    """A right hand on a table, back up, fingers along -Z: wrist at the origin, knuckles 100 mm ahead, 20 mm apart."""
    position = np.zeros((1, 26, 3))
    for at, finger in enumerate(("thumb", "index", "middle", "ring", "little")):
        tip = JOINT[f"{finger}_tip"]
        for back, z in enumerate((-0.18, -0.16, -0.14, -0.10)):
            position[0, tip - back] = (0.02 * (at - 2), 0.0, z)
    return position


def test_every_joint_is_either_required_or_can_be_made():
    assert sorted((*MAKEABLE, *REQUIRED)) == sorted(JOINTS)
    assert len(REQUIRED) == 21


def test_metacarpals_and_palm_lie_where_they_are_said_to():
    position, turn = completed(flat(), IDENTITY, "right", MAKEABLE, turned=False)
    np.testing.assert_allclose(position[0, JOINT["index_metacarpal"]], [-0.02 * 0.28, 0.0, -0.10 * 0.28], atol=1e-15)
    np.testing.assert_allclose(position[0, JOINT["palm"]], [0.0, 0.0, -0.10 * 0.64], atol=1e-15)
    np.testing.assert_allclose(turn[0, JOINT["palm"]], [0.0, 0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_flat_hand_gets_level_orientations_on_either_side(side):
    position = flat() * ([-1.0, 1.0, 1.0] if side == "left" else [1.0, 1.0, 1.0])
    forward, dorsal = palm_axes(position, side)
    np.testing.assert_allclose((forward[0], dorsal[0]), ([0, 0, -1], [0, 1, 0]), atol=1e-12)
    turn = completed(position, IDENTITY * np.nan, side, MAKEABLE, turned=True)[1]
    fingers = [JOINT[f"{finger}_{part}"] for finger in ("index", "ring") for part in ("proximal", "distal", "tip")]
    np.testing.assert_allclose(np.abs(turn[0, fingers]), np.tile([0, 0, 0, 1], (6, 1)), atol=1e-12)


def test_what_was_read_stays_as_it_was():
    position, turn = completed(TRACK.position_m, TRACK.orientation_xyzw, "right", METACARPALS, turned=False)
    read = [index for index, name in enumerate(JOINTS) if name not in METACARPALS]
    np.testing.assert_array_equal(position[:, read], TRACK.position_m[:, read])
    np.testing.assert_array_equal(turn[:, read], TRACK.orientation_xyzw[:, read])


def test_joints_in_one_point_get_some_orientation_and_no_warning():
    turn = completed(np.zeros((2, 26, 3)), np.full((2, 26, 4), np.nan), "left", MAKEABLE, turned=True)[1]
    np.testing.assert_allclose(np.linalg.norm(turn, axis=-1), 1.0)


def test_a_hand_bends_to_its_palm_and_its_mirror_image_does_too():
    bent = [frame for frame in TRACK.frames() if 1.5e9 < frame.time_ns < 1.9e9]
    right = np.array([frame.position_m for frame in bent])
    left = np.array([mirrored(frame).position_m for frame in bent])
    for position, side, other in ((right, "right", "left"), (left, "left", "right")):
        assert not bent_back(position, side)
        assert bent_back(position, other)
    assert not bent_back(flat(), "right")
    assert not bent_back(flat(), "left")  # of a flat hand it cannot be told

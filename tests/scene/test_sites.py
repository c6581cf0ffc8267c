"""The fifteen actuators on the hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haptics.errors import InputError
from haptics.scene.hands.joints import JOINT
from haptics.scene.hands.synthetic import synthetic_hand
from haptics.scene.sites import SITE, SITES, SiteMap, nominal_sites


@pytest.fixture
def hand() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return rng.normal(size=(26, 3)), Rotation.random(26, rng=rng).as_quat()


def test_sites_are_the_thesis_fifteen_in_channel_order():
    assert SITES == (
        "thumb_tip", "index_tip", "middle_tip", "ring_tip", "little_tip",
        "thumb_phalanx", "index_phalanx", "middle_phalanx", "ring_phalanx",
        "palm_thumb", "palm_index", "palm_middle", "palm_ring", "palm_little", "palm_outer",
    )  # fmt: skip


def test_positions_are_the_blend_and_a_rotated_offset(hand):
    position, orientation = hand
    sites = nominal_sites().moved({"palm_outer": (0.01, -0.02, 0.003), "index_tip": (0.0, 0.001, 0.0)})
    turned = Rotation.from_quat(orientation[sites.offset_joint]).apply(sites.offset_m)
    expected = sites.weights @ position + turned
    np.testing.assert_allclose(sites.positions(position, orientation), expected, atol=1e-15)


def test_many_frames_at_once_are_the_same_as_one_by_one():
    track = synthetic_hand().tracks[0]
    sites = nominal_sites()
    together = sites.positions(track.position_m, track.orientation_xyzw)
    assert together.shape == (len(track), 15, 3)
    one_by_one = [sites.positions(frame.position_m, frame.orientation_xyzw) for frame in track.frames()]
    np.testing.assert_allclose(together, one_by_one, atol=1e-15)


def test_a_hand_that_moves_stiffly_takes_its_sites_along(hand):
    position, orientation = hand
    turn, shift = Rotation.from_rotvec([0.3, -1.2, 0.7]), np.array([0.1, 0.2, -0.3])
    moved = turn.apply(position) + shift
    turned = (turn * Rotation.from_quat(orientation)).as_quat()
    sites = nominal_sites()
    np.testing.assert_allclose(
        sites.positions(moved, turned), turn.apply(sites.positions(position, orientation)) + shift, atol=1e-14
    )


def test_fingertips_are_the_tip_joints_with_seven_millimetres(hand):
    sites = nominal_sites()
    tips = [JOINT[f"{finger}_tip"] for finger in ("thumb", "index", "middle", "ring", "little")]
    np.testing.assert_array_equal(sites.positions(*hand)[:5], hand[0][tips])
    np.testing.assert_array_equal(sites.radius_m[:5], 0.007)
    np.testing.assert_allclose(sites.weights.sum(axis=1), 1.0, atol=1e-15)


def test_pads_lie_on_the_palmar_side():
    track = synthetic_hand().tracks[0]
    palm = Rotation.from_quat(track.orientation_xyzw[0, JOINT["palm"]])
    at = palm.inv().apply(nominal_sites().positions(track.position_m[0], track.orientation_xyzw[0]) - track.position_m[0, 0])
    bone = palm.inv().apply(nominal_sites().weights @ track.position_m[0] - track.position_m[0, 0])
    below = at[:, 1] < bone[:, 1]
    assert below[[SITE[name] for name in SITES if name.startswith("palm") or name.endswith("phalanx")]].all()
    assert at[SITE["palm_thumb"], 0] < at[SITE["palm_index"], 0] < at[SITE["palm_little"], 0]  # a right hand, palm down


def test_a_calibration_names_its_site_and_stays_on_the_hand():
    sites = nominal_sites()
    moved = sites.moved({"ring_tip": (0.001, 0.0, -0.002)})
    np.testing.assert_allclose(moved.offset_m - sites.offset_m, np.eye(15)[:, [3]] * (0.001, 0.0, -0.002))
    with pytest.raises(InputError, match="little_phalanx"):
        sites.moved({"little_phalanx": (0.0, 0.0, 0.0)})
    with pytest.raises(InputError, match=r"ring_tip along y = 0\.2 m"):
        sites.moved({"ring_tip": (0.0, 0.2, 0.0)})
    with pytest.raises(InputError, match="along z"):
        sites.moved({"ring_tip": (0.0, 0.0, float("nan"))})
    with pytest.raises(InputError, match="shape"):
        sites.moved({"ring_tip": (0.0, 0.2)})


def test_without_offsets_sites_are_plain_blends(hand):
    sites = nominal_sites()
    bare = SiteMap.of(sites.weights, sites.offset_joint, np.zeros((15, 3)), sites.radius_m)
    np.testing.assert_array_equal(bare.positions(*hand), sites.weights @ hand[0])

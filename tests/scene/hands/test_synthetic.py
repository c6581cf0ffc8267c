"""The motion that ships."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haptics.errors import InputError
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.check import check_frame
from haptics.scene.hands.joints import JOINT, JOINTS
from haptics.scene.hands.synthetic import minimum_jerk, synthetic_hand
from haptics.scene.placement import closing_strokes


def test_the_same_arguments_give_the_same_motion_and_another_seed_another():
    first, again, other = synthetic_hand(seed=3).tracks[0], synthetic_hand(seed=3).tracks[0], synthetic_hand(seed=4).tracks[0]
    np.testing.assert_array_equal(first.time_ns, again.time_ns)
    np.testing.assert_array_equal(first.position_m, again.position_m)
    np.testing.assert_array_equal(first.orientation_xyzw, again.orientation_xyzw)
    assert not np.array_equal(first.time_ns[:100], other.time_ns[:100])


def test_it_has_its_name():
    assert load_hand("synthetic").source == "synthetic"
    np.testing.assert_array_equal(load_hand("synthetic").tracks[0].position_m, synthetic_hand().tracks[0].position_m)


def test_every_pose_would_be_accepted():
    for recording in (synthetic_hand(), synthetic_hand(seed=1, jitter_s=0.01), synthetic_hand(duration_s=2.0, rate_hz=240.0)):
        frames = list(recording.frames("right"))
        assert [check_frame(frame, before) for frame, before in zip(frames, [None, *frames], strict=False)] == [None] * len(
            frames
        )
        assert len(frames) == recording.frame_count


def test_frames_come_near_the_rate_and_unevenly():
    recording = synthetic_hand(rate_hz=110.0, jitter_s=0.2e-3)
    interval_s = np.diff(recording.tracks[0].time_ns) * 1e-9
    # 440 intervals: their mean is known to 0.2 ms / sqrt(440) = 0.01 ms, their deviation to 0.2 ms / sqrt(880) = 0.007 ms.
    assert interval_s.mean() == pytest.approx(1 / 110.0, abs=4e-5)
    assert interval_s.std() == pytest.approx(0.2e-3, abs=3e-5)
    assert recording.duration_s == pytest.approx(4.0, abs=0.02)
    even = np.diff(synthetic_hand(rate_hz=100.0, jitter_s=0.0).tracks[0].time_ns)
    assert set(even.tolist()) <= {9_999_999, 10_000_000, 10_000_001}


def test_thumb_and_index_close_once_from_about_100_to_30_mm():
    recording = synthetic_hand()
    (stroke,) = closing_strokes(recording.tracks[0])
    assert stroke.d_max_m == pytest.approx(0.100, abs=0.003)
    assert stroke.d_min_m == pytest.approx(0.030, abs=0.003)
    # The hand rests before and after the stroke (1.1 to 1.6 s), so noise decides when it is widest: anywhere from 1.0 s on.
    assert 0.9e9 <= stroke.start_ns <= 1.25e9
    assert 1.5e9 <= stroke.end_ns <= 1.97e9


def test_bones_keep_their_lengths():
    track = synthetic_hand(noise_m=0.0).tracks[0]
    for finger in ("thumb", "index", "middle", "ring", "little"):
        names = [name for name in JOINTS if name.startswith(finger)]
        for near, far in pairwise(names):
            length = np.linalg.norm(track.joint_m(far) - track.joint_m(near), axis=1)
            assert np.ptp(length) < 1e-12, (near, far)
            assert 0.015 < length[0] < 0.075


def test_fingers_never_bend_backward_or_cross():
    track = synthetic_hand(noise_m=0.0).tracks[0]
    palm = Rotation.from_quat(track.orientation_xyzw[:, JOINT["palm"]])
    knuckle_x = []
    for finger in ("index", "middle", "ring", "little"):
        bend = [np.zeros(len(track))]
        for near, far in (("proximal", "intermediate"), ("intermediate", "distal"), ("distal", "tip")):
            bone = palm.inv().apply(track.joint_m(f"{finger}_{far}") - track.joint_m(f"{finger}_{near}"))
            bend.append(np.arctan2(-bone[:, 1], -bone[:, 2]))
        # up to 95 degrees for the knuckle and 115 for the next joint (an adult's range)
        steps = np.rad2deg(np.diff(np.unwrap(bend, axis=0), axis=0))
        assert steps.min() >= 0.0
        assert steps[0].max() < 95
        assert steps[1:].max() < 115
        knuckle_x.append(palm.inv().apply(track.joint_m(f"{finger}_tip") - track.joint_m("palm"))[:, 0])
    assert (np.diff(knuckle_x, axis=0) > 0.008).all()


def test_each_fingertip_taps_once_at_the_end():
    track = synthetic_hand(noise_m=0.0).tracks[0]
    late = track.time_ns > 2.8e9
    for finger in ("index", "middle", "ring", "little"):
        drop = track.joint_m(f"{finger}_tip")[late, 1]
        assert np.ptp(drop) > 0.02
        falls = np.flatnonzero(np.diff(np.sign(np.diff(drop))) > 0)
        assert len([fall for fall in falls if drop[fall + 1] < drop.max() - 0.01]) == 1


def test_minimum_jerk_is_flat_at_both_ends_and_symmetric():
    u = np.linspace(0.0, 1.0, 1001)
    s = minimum_jerk(u)
    np.testing.assert_allclose(s + s[::-1], 1.0, atol=1e-14)
    assert s[0] == 0.0
    assert s[-1] == 1.0
    assert np.gradient(s, u).max() == pytest.approx(1.875, abs=1e-4)  # Flash and Hogan's peak speed over mean
    np.testing.assert_array_equal(minimum_jerk(np.array([-3.0, 7.0])), [0.0, 1.0])


@pytest.mark.parametrize("argument", [{"duration_s": 0.0}, {"rate_hz": 1e9}, {"jitter_s": -1.0}, {"noise_m": float("nan")}])
def test_arguments_out_of_range_are_refused(argument):
    with pytest.raises(InputError, match=next(iter(argument))):
        synthetic_hand(**argument)

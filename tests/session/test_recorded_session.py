"""The hand of a session that was recorded with its glove can be played again, begun or not, with refused poses in it or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from engine_hands import assert_same, shipped

import haptics
from haptics.scene.hand_files.written import convert

TACTILES = "sim://tactiles?spread=0"


@pytest.fixture
def record(tmp_path):
    """Record a session that is given these frames, each at its time."""

    def session(frames, begin: bool) -> haptics.HandRecording:
        out = tmp_path / "live.h5"
        with haptics.open(tactiles=TACTILES, clock="virtual", record=out) as glove:
            played = haptics.Session(haptics.load_scene("desk").placed_for(haptics.load_hand("synthetic")), glove)
            if begin:
                glove.advance(0.05)
                played.begin()
            start_ns = glove.now_ns()
            for frame in frames:
                glove.advance(max(0.0, (frame.time_ns - (glove.now_ns() - start_ns)) / 1e9))
                played.submit(replace(frame, time_ns=start_ns + frame.time_ns))
            played.end()
        return haptics.load_hand(out)

    return session


@pytest.mark.parametrize("begin", [True, False])
def test_the_poses_come_back_as_they_were_given(record, begin):
    track = shipped(20)
    found = record(track.frames(), begin)
    assert_same(found.tracks[0], track)
    assert found.tracks[0].time_ns[0] == 0
    np.testing.assert_array_equal(found.tracks[0].position_m, track.position_m)
    assert found.origin is not None
    assert found.origin.format == "a recording of a session"
    assert (found.frame_count, found.dropped) == (20, {})


def test_poses_that_the_session_refused_are_left_out_and_counted(record):
    frames = [*shipped(20).frames()]
    repeated = [one for frame in frames for one in (frame, frame)]  # as engines do that run faster than their tracker
    found = record(repeated, begin=True)
    assert_same(found.tracks[0], shipped(20))
    assert found.dropped == {"poses that the session refused": 20}


def test_a_pose_with_a_joint_nowhere_is_recorded_and_refused_when_played_and_not_written(record, tmp_path):
    right = [*shipped(20).frames()]
    nowhere = right[7].position_m.copy()
    nowhere[3] = np.nan
    lost = replace(right[7], side="left", track_id=1, position_m=nowhere)
    found = record([*right[:8], lost, *right[8:]], begin=False)
    assert [len(track) for track in found.tracks] == [20, 1]
    written = convert(found, tmp_path / "plain.csv")
    assert (written.poses, written.off_mm) == (20, 0.0)
    assert "left out: 1 poses" in written.losses[-1]


def test_the_other_hand_which_drives_nothing_is_kept(record):
    right = [*shipped(20).frames()]
    both = [one for frame in right for one in (frame, replace(frame, side="left", track_id=1))]
    found = record(both, begin=False)
    assert [(track.side, len(track)) for track in found.tracks] == [("right", 20), ("left", 20)]

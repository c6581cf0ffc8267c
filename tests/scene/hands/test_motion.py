"""One hand of a recording, judged."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from leap_hands import a_hand, a_tap

from haptics.errors import InputError
from haptics.scene.hand_files.leap import load_leap
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.frame import mirrored
from haptics.scene.hands.handedness import apparent_side
from haptics.scene.hands.motion import accepted, judge_motion, refusals
from haptics.scene.hands.recording import HandRecording, HandTrack, RefusedPose

SYNTHETIC = load_hand("synthetic")


def moved(*shifts: tuple[int, float]) -> HandRecording:
    """The synthetic hand with some poses elsewhere, by index and metres."""
    (track,) = SYNTHETIC.tracks
    position_m = track.position_m.copy()
    for index, shift_m in shifts:
        position_m[index] += shift_m
    return replace(SYNTHETIC, tracks=(replace(track, position_m=position_m),))


def of(tmp_path, content: dict) -> HandRecording:
    path = tmp_path / "hand.json"
    path.write_text(json.dumps(content))
    return load_leap(path)


def test_a_good_recording_is_played_whole_and_as_it_is():
    motion = judge_motion(SYNTHETIC)
    assert motion.recording is SYNTHETIC
    assert (motion.side, motion.refused, motion.notes) == ("right", (), ())
    assert len(motion.frames) == len(SYNTHETIC.tracks[0])


def test_one_pose_out_of_place_is_left_out_everywhere_and_told_of_once():
    motion = judge_motion(moved((50, 0.3)))
    time_ns = int(SYNTHETIC.tracks[0].time_ns[50])
    assert [pose.time_ns for pose in motion.refused] == [time_ns]
    assert len(motion.frames) == len(SYNTHETIC.tracks[0]) - 1
    assert time_ns not in {frame.time_ns for frame in motion.frames}
    assert time_ns not in motion.recording.tracks[0].time_ns
    (note,) = motion.notes
    assert note.startswith(f"1 pose of the right hand was refused at {time_ns / 1e9:.3f} s: ")
    assert " jumped at " in note


def test_a_bad_first_pose_is_the_one_that_is_left_out():
    assert list(refusals(tuple(moved((0, 2.0)).frames("right")))) == [0]


@pytest.mark.parametrize("bad", [(3, 4), (3, 4, 5), (20, 40, 60, 80)])
def test_the_bad_poses_and_no_others_are_left_out(bad):
    found = refusals(tuple(moved(*((index, 0.4 * (-1) ** n) for n, index in enumerate(bad))).frames("right")))
    assert list(found) == list(bad)


def test_a_time_from_the_future_leaves_out_that_pose_only():
    (track,) = SYNTHETIC.tracks
    time_ns = track.time_ns.copy()
    time_ns[30] += 10**12
    found = refusals(tuple(replace(SYNTHETIC, tracks=(replace(track, time_ns=time_ns),)).frames("right")))
    assert list(found) == [30]
    assert "ahead" in found[30]


def test_a_large_share_of_bad_poses_is_refused_with_the_first_of_them():
    shifts = [(index, 0.3) for index in range(0, len(SYNTHETIC.tracks[0]), 4)]
    with pytest.raises(
        InputError, match=r"hand mine: pose 0 at 0\.000 s is refused: .* jumped .* poses of the right hand cannot"
    ):
        judge_motion(moved(*shifts), source="mine")


def test_poses_that_could_not_be_read_count_with_those_that_must_not_move():
    unread = tuple(RefusedPose(None, side, "unreadable") for side in ("left", "right", None) for _ in range(40))
    motion = judge_motion(replace(moved((50, 0.3)), refused=unread))
    assert len(motion.refused) == 81  # not those of the left hand
    many = tuple(RefusedPose(None, "right", "unreadable") for _ in range(200))
    with pytest.raises(InputError, match=r"hand synthetic: unreadable \(200 of \d+ poses"):
        judge_motion(replace(SYNTHETIC, refused=many))


def test_a_hand_that_is_not_there_is_said_with_what_is(tmp_path):
    recording = of(tmp_path, a_tap(6))
    with pytest.raises(InputError, match=r"no pose of the left hand; the recording has right: 6 poses; --side right plays"):
        judge_motion(recording, "left")


def test_where_no_hand_is_whole_what_was_left_out_is_said(tmp_path):
    content = a_tap(6)
    for frame in content["frames"]:
        del frame["pointables"][4]
    with pytest.raises(InputError, match=r"no pose of either hand; .*no whole hand in its 6 frames; .*6 hands without all five"):
        judge_motion(of(tmp_path, content))
    content["frames"] = [{**frame, "hands": [], "pointables": []} for frame in content["frames"]]
    with pytest.raises(InputError, match="no pose of the left hand; the recording has no whole hand in its 6 frames"):
        judge_motion(of(tmp_path, content), "left")


def test_the_hand_that_was_left_out_is_named_and_how_to_choose_it(tmp_path):
    recording = of(tmp_path, a_tap(6, hands=lambda _: [a_hand(7), a_hand(8, "left", 300.0)]))
    (note,) = judge_motion(recording).notes
    assert note.startswith("the left hand (6 poses) was left out, the right one was played; `--side left`, or `side` in")
    chosen = judge_motion(recording, "left")
    assert chosen.side == "left"
    assert chosen.notes == ("the right hand (6 poses) was left out, the left one was played",)


def test_another_side_is_refused():
    with pytest.raises(InputError, match="side = 'both' is not allowed; allowed: auto, left, right"):
        judge_motion(SYNTHETIC, "both")


def test_a_hand_with_the_wrong_label_is_noticed(tmp_path):
    content = a_tap(6)
    for frame in content["frames"]:
        frame["hands"][0]["type"] = "left"
    motion = judge_motion(of(tmp_path, content))
    assert motion.side == "left"
    assert "the hand labelled left looks like a right one" in motion.notes[0]


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0, 1.0), (0.5, 0.5, 0.5, 0.5), (0.0, 0.6, 0.0, 0.8)])
def test_a_side_is_told_however_the_hand_is_turned(turn):
    from scipy.spatial.transform import Rotation

    hand = next(SYNTHETIC.frames("right"))
    for frame in (hand, mirrored(hand)):
        position = Rotation.from_quat(turn).apply(frame.position_m)
        orientation = (Rotation.from_quat(turn) * Rotation.from_quat(frame.orientation_xyzw)).as_quat()
        assert apparent_side(position, orientation) == frame.side


def test_a_side_that_is_not_clear_is_not_told():
    position_m = np.zeros((26, 3))
    assert apparent_side(position_m, np.tile([0.0, 0.0, 0.0, 1.0], (26, 1))) is None


def test_recorded_people_have_the_hands_that_they_are_said_to_have(recordings):
    for path in sorted(recordings.iterdir()):
        if path.suffix in (".gz", ".lz"):
            recording = load_hand(path)
            for track in recording.tracks:
                assert apparent_side(track.position_m, track.orientation_xyzw) == track.side
            assert judge_motion(recording).refused == ()


def test_a_tracks_bad_poses_are_thinned_out():
    (track,) = moved((7, 0.5)).tracks
    kept = accepted(track)
    assert kept is not None
    assert len(kept) == len(track) - 1
    (whole,) = SYNTHETIC.tracks
    assert accepted(whole) is whole
    lost = HandTrack("left", 0, np.arange(3), np.zeros((3, 26, 3)), whole.orientation_xyzw[:3])
    assert accepted(lost) is None

"""Objects placed to be met by a hand."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.joints import JOINT
from haptics.scene.hands.recording import HandRecording, HandTrack
from haptics.scene.hands.synthetic import synthetic_hand
from haptics.scene.placement import closing_strokes, expected_grasps, place_at_palm, place_in_hand


def pinching(distance_m, side: str = "right", track_id: int = 0, interval_ns: int = 10_000_000) -> HandTrack:
    """Thumb at the origin side of x, index tip ``distance_m`` along x from it; both move evenly about x = 0.3."""
    distance_m = np.asarray(distance_m, float)
    position = np.zeros((len(distance_m), 26, 3))
    position[:, JOINT["thumb_tip"], 0] = 0.3 - 0.5 * distance_m
    position[:, JOINT["index_tip"], 0] = 0.3 + 0.5 * distance_m
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(distance_m), 26, 1))
    return HandTrack(side, track_id, np.arange(len(distance_m)) * interval_ns, position, turn)


def recording_of(*tracks: HandTrack) -> HandRecording:
    return HandRecording("made up", tracks, max(map(len, tracks), default=0), 1.0)


def ramp(*turns_m: float, frames: int = 50) -> np.ndarray:
    return np.interp(np.arange((len(turns_m) - 1) * frames + 1) / frames, np.arange(len(turns_m)), turns_m)


def test_the_object_is_half_way_and_met_when_the_span_is_crossed():
    placed = place_in_hand(recording_of(pinching(ramp(0.05, 0.100, 0.020, 0.06))))
    assert placed is not None
    assert (placed.stroke.d_max_m, placed.stroke.d_min_m) == pytest.approx((0.100, 0.020), abs=1e-15)
    assert placed.span_m == pytest.approx(0.060, abs=1e-15)
    assert placed.radius_m == pytest.approx(0.023, abs=1e-15)
    # 100 to 20 mm over 50 frames of 10 ms from 0.5 s on: 60 mm at half way, 0.75 s
    assert placed.time_ns == pytest.approx(750_000_000, abs=1)
    np.testing.assert_allclose(placed.centre_m, [0.3, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(placed.axis, [1.0, 0.0, 0.0], atol=1e-15)


def test_the_crossing_is_found_between_frames():
    placed = place_in_hand(recording_of(pinching([0.100, 0.090, 0.030, 0.020])))
    assert placed is not None
    assert placed.time_ns == 15_000_000  # span 60 mm, half way between the second and third frame


@pytest.mark.parametrize(
    ("turns_m", "qualifying"),
    [
        ((0.100, 0.051), 0),  # 49 mm
        ((0.0845, 0.0335), 1),  # 51 mm, to 0.396
        ((0.0845, 0.0345), 0),  # to 0.408, though 50 mm
        ((0.200, 0.081), 0),
        ((0.200, 0.079), 1),
        ((0.020, 0.120), 0),  # opening is no closing
        ((0.120, 0.020, 0.120, 0.020), 2),
        ((0.120, 0.065, 0.070, 0.025), 1),  # a hesitation of 5 mm is within one stroke; neither half would qualify
        ((0.120, 0.070, 0.100, 0.050), 0),  # two strokes of 50 mm, neither under 0.4
        ((0.120, 0.020, 0.028, 0.019, 0.120), 1),  # trembling at the bottom is one grasp
    ],
)
def test_which_strokes_qualify(turns_m, qualifying):
    track = pinching(ramp(*turns_m))
    assert len(closing_strokes(track)) == qualifying
    assert (place_in_hand(recording_of(track)) is not None) == bool(qualifying)


def test_a_hand_that_never_closes_gets_no_object():
    assert place_in_hand(recording_of(pinching(np.full(100, 0.08)))) is None
    assert place_in_hand(recording_of(pinching([0.1]))) is None
    assert place_in_hand(recording_of()) is None


def test_noise_neither_adds_nor_loses_strokes():
    clean = ramp(0.130, 0.017, 0.146, 0.012, 0.12, frames=100)
    for seed in range(20):
        noisy = clean + 0.5e-3 * np.random.default_rng(seed).standard_normal(len(clean))  # ten times a tracker's
        assert len(closing_strokes(pinching(noisy))) == 2


def test_the_side_with_most_frames_is_meant_unless_said():
    closing = ramp(0.12, 0.02)
    recording = recording_of(pinching(closing, "left"), pinching(np.full(200, 0.1), "right", 1), pinching(closing, "left", 2))
    assert expected_grasps(recording) == 0
    assert expected_grasps(recording, "left") == 2
    placed = place_in_hand(recording, "left")
    assert placed is not None
    assert placed.track_id == 0
    with pytest.raises(InputError, match="side"):
        place_in_hand(recording, "both")


def test_strokes_do_not_join_across_tracks():
    recording = recording_of(pinching(ramp(0.12, 0.08)), pinching(ramp(0.08, 0.02), track_id=1))
    assert expected_grasps(recording) == 1  # 80 to 20 mm is one by itself
    assert place_in_hand(recording).stroke.d_max_m == pytest.approx(0.08)  # type: ignore[union-attr]


def test_a_place_at_the_palm_turns_with_it():
    track = pinching(ramp(0.1, 0.1))
    quarter_left = [0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)]  # about +Y: forward becomes -X
    track.orientation_xyzw[:, JOINT["palm"]] = quarter_left
    track.position_m[:, JOINT["palm"]] = [1.0, 2.0, 3.0]
    placed = place_at_palm(recording_of(track), (0.0, -0.05, -0.10))
    np.testing.assert_allclose(placed.centre_m, [0.9, 1.95, 3.0], atol=1e-14)
    np.testing.assert_allclose(placed.orientation_xyzw, quarter_left, atol=1e-14)


def test_the_median_pose_does_not_mind_outliers_or_signs():
    track = pinching(np.full(101, 0.1))
    track.position_m[:, JOINT["palm"]] = [0.1, 0.2, 0.3]
    track.position_m[:20, JOINT["palm"]] = [5.0, 5.0, 5.0]
    track.orientation_xyzw[::2] *= -1.0
    placed = place_at_palm(recording_of(track), at="median")
    np.testing.assert_allclose(placed.centre_m, [0.1, 0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(placed.orientation_xyzw, [0.0, 0.0, 0.0, 1.0], atol=1e-14)


def test_what_cannot_be_placed_is_refused():
    recording = synthetic_hand()
    with pytest.raises(InputError, match="no left hand"):
        place_at_palm(recording, side="left")
    with pytest.raises(InputError, match="at ="):
        place_at_palm(recording, at="mode")
    for offset in ((1.0, 2.0), (0.0, float("nan"), 0.0)):
        with pytest.raises(InputError, match="offset_m"):
            place_at_palm(recording, offset)


# Figures of the recordings' own description: thumb to index 130 to 17 mm at 0.6 s, 146 to 12 mm at 2.9 s; in the others none.


def test_recorded_grab_has_two_grasps(recordings):
    recording = load_hand(recordings / "grab.leap.json.gz")
    strokes = closing_strokes(recording.tracks[0])
    assert [(round(s.d_max_m * 1e3), round(s.d_min_m * 1e3), round(s.end_ns * 1e-9, 1)) for s in strokes] == [
        (130, 17, 0.6),
        (146, 12, 2.9),
    ]
    assert expected_grasps(recording) == 2
    placed = place_in_hand(recording)
    assert placed is not None
    assert placed.radius_m == pytest.approx(0.5 * (0.130 + 0.017) / 2 - 0.007, abs=5e-4)  # the figures are whole millimetres
    assert 0 < placed.time_ns < strokes[0].end_ns


@pytest.mark.parametrize("name", ["wave", "waiting", "flapping"])
def test_the_other_recordings_hold_no_grasp(recordings, name):
    recording = load_hand(recordings / f"{name}.leap.json.gz")
    assert [expected_grasps(recording, side) for side in ("left", "right")] == [0, 0]
    assert place_in_hand(recording) is None

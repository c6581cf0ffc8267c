"""The yardstick: touches and grasps on the cubic through all poses, against motions whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.judging.felt import track_truths
from haptics.judging.onset import touches_on
from haptics.scene import load_scene
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.frame import HandFrame
from haptics.scene.sites import SITE, nominal_sites
from haptics.time import NS_PER_MS

BALL = """
summary = "a ball"
[[objects]]
name = "ball"
placement = "world"
position_m = [0.0, 0.0, -0.5]
shape = { kind = "sphere", radius_m = 0.03 }
effects = [{ kind = "contact", sites = ["index_tip"] }]
"""


def _flying_hand(speed_m_s: float) -> list[HandFrame]:
    """A rigid hand whose index fingertip passes straight through the ball's centre, along -z."""
    first = next(load_hand("synthetic").frames("right"))
    tip = first.position_m[10]
    frames = []
    for i in range(80):
        time_ns = i * 9 * NS_PER_MS
        at = np.array([0.0, 0.0, -0.3 - speed_m_s * time_ns / 1e9])
        frames.append(HandFrame(time_ns, "right", 1, first.position_m - tip + at, first.orientation_xyzw))
    return frames


@pytest.mark.parametrize("speed_m_s", [0.1, 0.3, 1.0])
def test_a_straight_flight_touches_when_geometry_says(tmp_path, speed_m_s):
    (tmp_path / "ball.toml").write_text(BALL)
    scene = load_scene(tmp_path / "ball.toml")
    truth = track_truths(scene, nominal_sites(), _flying_hand(speed_m_s), ("ball",))[0]
    touched = touches_on(truth.time_ns, truth.distance_m["ball"], (SITE["index_tip"],), "ball")
    expected_s = (0.2 - 0.03 - 0.007) / speed_m_s  # centre less ball's and tip's radius
    if expected_s < 0.7:
        assert touched[0].time_ns / 1e9 == pytest.approx(expected_s, abs=1e-5)  # interpolation within a millisecond
        assert touched[0].approach_m_s == pytest.approx(speed_m_s, rel=1e-3)
    else:
        assert touched == []


def test_two_tracks_are_two_truths_and_short_ones_none(tmp_path):
    (tmp_path / "ball.toml").write_text(BALL)
    scene = load_scene(tmp_path / "ball.toml")
    frames = _flying_hand(0.3)
    from dataclasses import replace

    second = [replace(f, track_id=2) for f in frames[40:]]
    third = [replace(f, track_id=3, time_ns=f.time_ns + 10**9) for f in frames[:3]]
    truths = track_truths(scene, nominal_sites(), [*frames[:40], *second, *third], ("ball",))
    assert [int(t.frame_ns[0]) for t in truths] == [frames[0].time_ns, frames[40].time_ns]

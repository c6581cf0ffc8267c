"""Two hands in one scene: each glove feels its own; what one hand carries the other meets; one without a glove drives nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from live_hand import Live, mirrored, told

import haptics

TACTILES, BRAKE = "sim://tactiles?spread=0&level=event", "sim://brake?spread=0"


@pytest.fixture
def two(tmp_path) -> Iterator[tuple[haptics.BothHands, haptics.Glove, haptics.Glove]]:
    recording = haptics.load_hand("synthetic")
    placed = haptics.load_scene("playground").placed_for(recording).object("ball").body
    x, y, z = placed.pose.position_m
    radius_m = placed.shape.radius_m
    text = f"""
summary = "a ball that the left hand takes"
[[objects]]
name = "ball"
shape = {{ kind = "sphere", radius_m = {radius_m} }}
position_m = {[-float(x) - 1.0, float(y), float(z)]}
effects = [{{ kind = "grasp" }}, {{ kind = "contact", sites = ["index_tip", "thumb_tip"] }}]
"""
    path = tmp_path / "ball.toml"
    path.write_text(text)
    with (
        haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as left,
        haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as right,
    ):
        for glove in (left, right):
            glove.arm()
        both = haptics.BothHands(haptics.load_scene(path), left, right)
        both.begin()
        yield both, left, right


def left_frames() -> list[haptics.HandFrame]:
    """The shipped motion as a left hand, a metre to the left."""
    found = []
    for frame in haptics.load_hand("synthetic").frames("right"):
        other = mirrored(frame)
        found.append(replace(other, position_m=other.position_m - (1.0, 0.0, 0.0)))
    return found


def show_both(both: haptics.BothHands, left: haptics.HandFrame | None, right: haptics.HandFrame | None) -> None:
    """A pose of each hand, as interleaved, and 8 ms."""
    now_ns = both.sessions["left"].devices.now_ns()
    for frame in (left, right):
        if frame is not None:
            assert both.submit(replace(frame, time_ns=now_ns)) is None
    for step in range(1, 9):
        both.tick(now_ns + step * 1_000_000)


def test_what_the_left_hand_carries_the_right_one_meets_where_it_is(two):
    both, left, right = two
    frames = left_frames()
    rests = next(iter(haptics.load_hand("synthetic").frames("right")))
    taken = [frame for frame in frames if frame.time_ns < 1_700_000_000]
    for frame in taken[:: max(1, len(taken) // 190)]:
        show_both(both, frame, rests)
    mine, other = both.sessions["left"], both.sessions["right"]
    assert told(mine, "grasp_begin") == [("grasp_begin", "", "ball")]
    assert max(map(abs, left.truth().volts.values())) > 300
    assert max(map(abs, right.truth().volts.values())) < 60
    assert right.truth().pins_out == ()
    sites = other.loop.sites
    tip_m = sites.positions(rests.position_m, rests.orientation_xyzw)[1]
    ball_m = np.array(mine.loop.world.body("ball").pose.position_m)
    way_m = np.add(tip_m, (0.0, -0.02, 0.0)) - ball_m
    for step in range(1, 251):
        show_both(both, replace(taken[-1], position_m=taken[-1].position_m + way_m * step / 250), rests)
    assert ("touch", "index_tip", "ball") in told(other, "touch")
    assert "index_tip" in right.truth().pins_out
    assert told(other, "grasp_begin") == []
    assert max(map(abs, right.truth().volts.values())) < 60

    for _ in range(40):  # the left hand is gone: its glove lets go, the ball stays, and the right one goes on feeling it
        show_both(both, None, rests)
    assert "watchdog" in [kind for kind, *_ in told(mine, "watchdog")]
    assert left.truth().pins_out == ()
    assert max(map(abs, left.truth().volts.values())) < 60
    assert "index_tip" in right.truth().pins_out
    both.hand_gone("right")
    for _ in range(20):
        show_both(both, None, None)
    assert right.truth().pins_out == ()
    both.end()
    with pytest.raises(haptics.InputError, match="side = None"):
        both.submit(None)
    with pytest.raises(haptics.InputError, match="same glove"):
        haptics.BothHands(haptics.load_scene("posture"), left, left)


def test_a_hand_without_a_glove_grasps_and_carries_and_drives_nothing(tmp_path):
    placed = haptics.load_scene("playground").placed_for(haptics.load_hand("synthetic")).object("ball").body
    x, y, z = map(float, placed.pose.position_m)
    path = tmp_path / "ball.toml"
    path.write_text(
        f'summary = "a ball"\n[[objects]]\nname = "ball"\nshape = {{ kind = "sphere", radius_m = {placed.shape.radius_m} }}\n'
        f'position_m = [{-x - 1.0}, {y}, {z}]\neffects = [{{ kind = "grasp" }}]\n'
    )
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as glove:
        glove.arm()
        configuration = glove.configuration.model_copy(update={"side": "right"})
        hand = Live(haptics.Session(haptics.load_scene(path), glove, configuration, kept=None))
        hand.session.begin()
        begin_m = np.array(hand.session.loop.world.body("ball").pose.position_m)
        hand.play([frame for frame in left_frames() if frame.time_ns < 1_700_000_000])
        assert told(hand.session, "grasp_begin", "wanted", "touch") == [("grasp_begin", "left", "ball")]
        last = [frame for frame in left_frames() if frame.time_ns < 1_700_000_000][-1]
        for step in range(1, 51):
            hand.wait(0.008)
            assert hand.show(replace(last, position_m=np.add(last.position_m, (0.004 * step, 0.0, 0.0)))) is None
        carried_m = np.array(hand.session.loop.world.body("ball").pose.position_m) - begin_m
        assert carried_m[0] == pytest.approx(0.2, abs=0.03)
        assert max(map(abs, glove.truth().volts.values())) < 60
        hand.session.hand_gone(side="left")
        hand.wait(0.05)
        assert told(hand.session, "grasp_end") == [("grasp_end", "left", "ball")]

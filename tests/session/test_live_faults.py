"""What must not happen on a glove that engines come to and leave: each test is of one thing that once did."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from live_hand import Live, mirrored, told

import haptics
from firmware_models import world as worlds
from haptics.scene.hands.joints import JOINT

TACTILES, BRAKE = "sim://tactiles?spread=0&level=event", "sim://brake?spread=0"
_names = itertools.count()
GRASPED_NS = 1_700_000_000
"""The shipped hand holds the ball by then."""
SAFE_V = 60.0


@pytest.fixture
def glove() -> Iterator[haptics.Glove]:
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as opened:
        opened.arm()
        yield opened


def motion() -> list[haptics.HandFrame]:
    return list(haptics.load_hand("synthetic").frames("right"))


def to_grasp() -> list[haptics.HandFrame]:
    return [frame for frame in motion() if frame.time_ns < GRASPED_NS]


def playing(glove: haptics.Glove, **how) -> Live:
    scene = haptics.load_scene("playground").placed_for(haptics.load_hand("synthetic"))
    session = haptics.Session(scene, glove, kept=None, **how)
    session.begin()
    return Live(session)


def volts(glove: haptics.Glove) -> float:
    return max(map(abs, glove.truth().volts.values()))


def test_a_pin_that_a_killed_host_left_out_is_withdrawn_by_the_next_arming():
    name = f"left-out-{next(_names)}"
    entered = worlds.enter(name, "virtual")
    url = f"{TACTILES}&world={name}"
    try:
        killed = haptics.open(tactiles=url, clock="virtual")
        killed.arm()
        killed.contact("index_tip")
        killed.advance(0.1)
        for link in killed.devices.links.values():
            link.close()
        entered.advance(entered.now_ns + 300_000_000)
        with haptics.open(tactiles=url, clock="virtual") as following:
            following.advance(0.1)
            assert following.devices.plant("tactiles").truth()["latched"][1] == "on"
            following.clear()
            following.arm()
            assert set(following.devices.plant("tactiles").truth()["latched"]) == {"off"}
            assert following.state().pins_out == ()
    finally:
        worlds.leave(name, entered)


def test_off_withdraws_pins_though_the_other_board_has_a_fault(glove):
    glove.contact("index_tip")
    glove.advance(0.1)
    glove.devices.plant("brake").set_load(0, lid_open=1)
    glove.advance(0.1)
    assert "brake" not in glove.state().armed
    glove.off()
    assert glove.truth().pins_out == ()


def test_a_brake_with_a_long_time_to_live_stays_off_after_off_and_arm(glove):
    glove.brake("index", volts=800.0, ttl_s=60.0)
    glove.advance(0.1)
    assert volts(glove) > 300
    glove.off()
    glove.arm()
    for _ in range(50):
        glove.advance(0.01)
        assert volts(glove) < SAFE_V


def test_what_a_scene_lets_go_of_a_program_goes_on_holding(glove):
    hand = playing(glove)
    hand.play(to_grasp())
    assert {"index_tip", "thumb_tip"} <= set(glove.truth().pins_out)
    glove.contact("index_tip")
    glove.brake("index", volts=400.0, ttl_s=30.0)
    hand.session.hand_gone()
    hand.wait(0.3)
    assert glove.truth().pins_out == ("index_tip",)
    seen = []
    for _ in range(40):
        hand.wait(0.005)
        seen.append(glove.truth().volts)
    assert max(abs(one["index"]) for one in seen) > 300
    assert max(abs(one["thumb"]) for one in seen) < SAFE_V
    glove.release("index_tip")
    glove.release_brake()
    hand.wait(0.3)
    assert glove.truth().pins_out == ()
    assert volts(glove) < SAFE_V


def test_poses_of_both_hands_in_turn_give_the_touches_of_one(glove):
    found = []
    for both in (False, True):
        hand = playing(glove)
        start_ns = hand.now_ns
        for frame in to_grasp():
            hand.wait(max(0.0, (start_ns + frame.time_ns + 5_000_000 - hand.now_ns) * 1e-9))
            assert hand.session.submit(replace(frame, time_ns=start_ns + frame.time_ns)) is None
            if both:
                other = mirrored(frame)
                away = replace(other, position_m=other.position_m - (0.6, 0.0, 0.0), time_ns=start_ns + frame.time_ns)
                assert hand.session.submit(away) is None
        found.append(told(hand.session, "touch", "release", "grasp_begin", "watchdog"))
        hand.session.end()
        glove.advance(0.3)
    assert 1 < len(found[0]) < 10
    assert found[0] == found[1]


def test_a_scene_that_is_placed_in_the_hand_is_placed_live_and_grasped(glove):
    """The hand is held open and still; then it closes by 5 cm and more, where it is, about the ball that was put there."""
    session = haptics.Session(haptics.load_scene("playground"), glove, kept=None)
    session.begin()
    hand = Live(session)
    assert "open, and still for half a second" in session.waits_for
    assert "ball" not in session.scene.names
    closing = [frame for frame in to_grasp() if frame.time_ns > 1_200_000_000]
    for _ in range(75):
        hand.wait(0.008)
        assert hand.show(closing[0]) is None
    assert session.waits_for == ""
    assert told(session, "placed") == [("placed", "", "")]
    between = [frame.position_m[[JOINT["thumb_tip"], JOINT["index_tip"]]].mean(axis=0) for frame in closing]
    ball = session.loop.body("ball").pose.origin_m
    shares = np.minimum(np.arange(len(closing)) / 20, 1.0)  # it is where fingers meet as a rule; this hand is brought there
    there = [between[0] + share * (ball - between[0]) for share in shares]
    hand.play([replace(f, position_m=f.position_m - at + to) for f, at, to in zip(closing, between, there, strict=True)])
    assert told(session, "grasp_begin") == [("grasp_begin", "", "ball")]
    assert volts(glove) > 300


def test_what_was_wanted_and_not_armed_is_told_as_denied_once_with_its_reason():
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as glove:
        hand = playing(glove)
        hand.play(to_grasp())
        events = hand.session.events
        denied = [(event.subject, event.detail, event.reason) for event in events if event.kind == "denied"]
        assert ("index_tip", "contact", "unarmed") in denied
        assert ("index", "brake", "unarmed") in denied
        assert len(denied) == len(set(denied))
        assert not any(event.kind == "acted" for event in events)
        begun = [event for event in events if event.kind == "grasp_begin"]
        assert [event.detail.endswith("brakes are not armed") for event in begun] == [True]
        glove.arm()
        hand.play([frame for frame in motion() if GRASPED_NS <= frame.time_ns < GRASPED_NS + 300_000_000])
        assert any(event.kind == "acted" for event in hand.session.events)


def test_a_denial_for_heat_says_from_when_on_it_may_be_tried_again(glove):
    hand = playing(glove)
    array = glove.devices.tactiles
    for _ in range(120):
        for _ in range(4):
            array.burst("index_tip", 10, glove.devices.now_ns())
        hand.wait(0.05)
    glove.results()
    hand.play(to_grasp())
    heat = [event for event in hand.session.events if event.kind == "denied" and event.reason == "heat"]
    assert heat, {(e.kind, e.reason) for e in hand.session.events}
    assert all(event.retry_ns is not None and event.retry_ns > event.time_ns for event in heat)


@pytest.mark.parametrize("resume", ["apart", "gentle"])
def test_after_poses_stopped_in_a_grasp_it_waits_or_goes_on_gently(glove, resume):
    hand = playing(glove, resume=resume)
    frames = to_grasp()
    hand.play(frames)
    assert volts(glove) > 300
    hand.wait(0.3)
    assert volts(glove) < SAFE_V
    begun_ns, peaks = hand.now_ns, []
    for _ in range(20):
        peak_v = 0.0
        for _ in range(10):  # a tenth of a second, longer than the square wave's turn
            hand.wait(0.01)
            assert hand.show(frames[-1]) is None
            peak_v = max(peak_v, volts(glove))
        peaks.append(peak_v)
    assert told(hand.session, "watchdog") == [("watchdog", "", "")]
    if resume == "apart":
        assert max(peaks) < SAFE_V
        assert told(hand.session, "waiting")
        assert not told(hand.session, "resumed")
    else:
        assert peaks[0] < SAFE_V  # poses have to be steady first
        (resumed,) = [event for event in hand.session.events if event.kind == "resumed"]
        assert resumed.time_ns - begun_ns >= 250_000_000
        rising = [v for v in peaks if v > SAFE_V]
        assert len(rising) > 10
        assert rising[1] < 0.6 * rising[-1]
        assert all(later >= 0.95 * earlier for earlier, later in itertools.pairwise(rising))

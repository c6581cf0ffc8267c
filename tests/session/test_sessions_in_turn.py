"""Sessions come and go on one glove: each drives it only while it is the one that is there."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

import haptics

HAND = haptics.load_hand("synthetic")
FRAMES = list(HAND.frames("right"))
HOLDING = 150
"""So many frames of the synthetic hand, and it holds the ball of the playground."""


@pytest.fixture
def glove():
    with haptics.open(tactiles="sim://tactiles?spread=0", brake="sim://brake?spread=0", clock="virtual") as opened:
        yield opened


@pytest.fixture
def scene():
    return haptics.load_scene("playground").placed_for(HAND)


def begun(scene: haptics.Scene, glove: haptics.Glove, **more) -> haptics.Session:
    session = haptics.Session(scene, glove, **more)
    session.begin()
    return session


def play(session: haptics.Session, glove: haptics.Glove, first: int, last: int) -> None:
    begun_ns = glove.now_ns() - FRAMES[first].time_ns
    for frame in FRAMES[first:last]:
        glove.advance(max(0.0, (begun_ns + frame.time_ns - glove.now_ns()) / 1e9))
        session.submit(replace(frame, time_ns=glove.now_ns()))


def highest_v(glove: haptics.Glove) -> float:
    truth = glove.truth()
    assert truth is not None
    return max(map(abs, truth.volts.values()))


def test_poses_that_still_go_to_a_session_whose_place_was_taken_drive_nothing(glove, scene):
    old = begun(scene, glove)
    glove.arm()
    play(old, glove, 0, 60)
    begun(scene, glove)
    with pytest.raises(haptics.GloveEnded, match="another one took its place"):
        play(old, glove, 60, HOLDING)
    glove.advance(0.3)  # a brake that only the old one's watchdog would have ended is on for ever
    assert highest_v(glove) < 60.0


@pytest.mark.parametrize("how", ["ends", "another takes its place"])
def test_a_session_that_is_over_takes_no_call_more(glove, scene, how):
    old = begun(scene, glove)
    if how == "ends":
        old.end()
        old.end()  # which does nothing
    else:
        begun(scene, glove)
    calls = (
        lambda: old.submit(replace(FRAMES[0], time_ns=glove.now_ns())),
        old.tick,
        old.begin,
        old.hand_gone,
        old.place,
        lambda: old.move_object("cup", (0.0, 1.0, 0.0)),
        lambda: old.remove_object("cup"),
        lambda: old.change_scene(scene),
    )
    for call in calls:
        with pytest.raises(haptics.GloveEnded, match="this session has ended"):
            call()


def test_a_pose_that_waits_for_its_turn_while_another_session_comes_drives_nothing(glove, scene):
    old = begun(scene, glove)
    outcome: list[BaseException] = []

    def submit() -> None:
        try:
            old.submit(FRAMES[0])
        except haptics.GloveEnded as error:
            outcome.append(error)

    with glove.turn():
        engine = threading.Thread(target=submit)
        engine.start()
        begun(scene, glove)
    engine.join(10.0)
    assert len(outcome) == 1


def test_the_end_of_a_session_whose_place_was_taken_leaves_the_new_ones_grasp_alone(glove, scene):
    old = begun(scene, glove)
    glove.arm()
    new = begun(scene, glove)
    play(new, glove, 0, HOLDING)
    old.end()
    play(new, glove, HOLDING, HOLDING + 2)
    assert highest_v(glove) > 900.0  # of 1000 V
    assert {"thumb_tip", "index_tip"} <= set(glove.truth().pins_out)


def test_a_session_that_comes_arms_what_it_needs_and_not_what_the_last_one_needed(glove, scene):
    begun(haptics.load_scene("desk"), glove, follows_needs=True)
    begun(scene, glove)
    glove.arm()
    assert glove.state().armed == ("tactiles", "brake")


def test_needs_of_a_session_outlive_the_one_before(glove, scene):
    begun(scene, glove, follows_needs=True)
    begun(haptics.load_scene("desk"), glove, follows_needs=True)
    glove.arm()
    assert glove.state().armed == haptics.load_scene("desk").needs.boards


def test_a_session_that_is_not_made_hears_nothing(glove, scene):
    before = list(glove.devices._result_sinks)
    with pytest.raises(haptics.InputError, match="follows_needs"):
        haptics.Session(scene, glove, follows_needs="yes")  # type: ignore[arg-type]
    assert glove.devices._result_sinks == before


def test_a_pose_from_the_future_is_refused_in_real_time_as_the_watchdog_would_wait_for_it_too(scene):
    with haptics.live(scene, tactiles="sim://tactiles?spread=0", brake="sim://brake?spread=0", armed=False) as session:
        ahead_ns = session.glove.now_ns() + 10_000_000_000
        for call in (
            lambda: session.submit(replace(FRAMES[0], time_ns=ahead_ns), ahead_ns),
            lambda: session.hand_gone(ahead_ns),
            lambda: session.move_object("cup", (0.0, 1.0, 0.0), now_ns=ahead_ns),
        ):
            with pytest.raises(haptics.InputError, match="ahead of the glove's clock"):
                call()

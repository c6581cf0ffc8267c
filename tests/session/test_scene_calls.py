"""Objects that come and go while a scene waits for a hand to place it, calls that are refused, and calls for both hands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import haptics

OPEN = next(iter(haptics.load_hand("synthetic").frames("right")))
"""A hand that is open."""
TACTILES, BRAKE = "sim://tactiles?spread=0", "sim://brake?spread=0"


def opened() -> haptics.Glove:
    return haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual")


@pytest.fixture
def session():
    """Of a scene whose ball waits for a place."""
    with opened() as glove:
        made = haptics.Session(haptics.load_scene("playground"), glove)
        made.begin()
        yield made


@pytest.fixture
def both():
    with opened() as left, opened() as right:
        made = haptics.BothHands(haptics.load_scene("playground"), left, right)
        made.begin()
        yield made


def extra() -> haptics.SceneObject:
    return replace(haptics.load_scene("playground").object("cup"), name="extra")


def hold_still(session: haptics.Session) -> None:
    """For 0.6 s, of which half a second is asked for."""
    for _ in range(60):
        session.glove.advance(0.01)
        session.submit(replace(OPEN, time_ns=session.glove.now_ns()))


def test_an_object_that_was_added_while_the_scene_waited_for_a_place_is_still_there_afterwards(session):
    session.add_object(extra())
    assert session.waits_for
    hold_still(session)
    assert not session.waits_for
    assert {"ball", "extra"} <= set(session.scene.names)


def test_an_object_that_was_removed_while_it_waited_for_a_place_does_not_come(session):
    session.remove_object("ball")
    assert not session.waits_for
    hold_still(session)
    assert "ball" not in session.scene.names


@pytest.mark.parametrize("now_ns", [-1, 1.5, "now"])
def test_a_call_that_is_refused_changes_nothing(session, now_ns):
    names = session.scene.names
    for call in (
        lambda: session.add_object(extra(), now_ns),
        lambda: session.remove_object("ball", now_ns),
        lambda: session.change_scene(haptics.load_scene("desk"), now_ns),
    ):
        with pytest.raises(haptics.InputError, match="now_ns"):
            call()
    hold_still(session)
    assert session.scene.name == "playground"
    assert set(session.scene.names) == {"ball", *names}


def test_objects_are_added_to_and_removed_from_the_scene_of_both_hands(both):
    both.add_object(extra())
    both.remove_object("book")
    for session in both.sessions.values():
        assert "extra" in session.scene.names
        assert "book" not in session.scene.names
        session.glove.advance(0.01)
        assert both.submit(replace(OPEN, time_ns=both.sessions["right"].glove.now_ns())) is None


def test_the_engine_gives_a_waiting_object_its_place_for_both_hands(both):
    both.move_object("ball", (0.1, 1.0, -0.3))
    for session in both.sessions.values():
        assert not session.waits_for
        assert session.scene.object("ball").body.pose.position_m == (0.1, 1.0, -0.3)


def test_what_the_engine_moved_stays_there_for_both_hands_when_objects_come(both):
    both.move_object("cup", (0.2, 1.0, -0.3))
    both.add_object(extra())
    for session in both.sessions.values():
        assert session.loop.body("cup").pose.position_m == (0.2, 1.0, -0.3)


@pytest.mark.parametrize("side", [None, 3, ["left"], np.array(["left", "right"]), "x" * 10**7])
def test_a_hand_of_no_side_is_refused_in_few_words(both, side):
    for call in (lambda: both.submit(replace(OPEN, side=side)), lambda: both.hand_gone(side)):
        with pytest.raises(haptics.InputError, match="side = ") as caught:
            call()
        assert len(str(caught.value)) < 200


def test_what_is_no_object_or_place_is_refused_in_few_words(session):
    for call in (lambda: session.remove_object("x" * 10**7), lambda: session.move_object("cup", [0.0] * 10**6)):
        with pytest.raises(haptics.InputError) as caught:
            call()
        assert len(str(caught.value)) < 400


def test_boards_that_another_scene_has_no_use_for_go_off(session):
    glove = session.glove
    follower = haptics.Session(haptics.load_scene("playground"), glove, follows_needs=True)
    follower.begin()
    glove.arm()
    assert glove.state().armed == ("tactiles", "brake")
    follower.change_scene(haptics.load_scene("desk"))
    glove.advance(0.5)
    assert glove.state().armed == ("tactiles",)

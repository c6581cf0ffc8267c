"""Two gloves on one scene: what changes for one hand changes for the other."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

import haptics
from haptics.errors import InputError
from haptics.session.glove import Glove

ROOM = """
summary = "a ball, and a door that the engine swings"
[[objects]]
name = "ball"
shape = { kind = "sphere" }
placement = "in_hand"
effects = [{ kind = "contact" }]

[[objects]]
name = "door"
shape = { kind = "box", size_m = [0.8, 2.0, 0.04] }
position_m = [0.0, 1.0, -0.5]
effects = [{ kind = "contact" }]
owner = "engine"
"""


@pytest.fixture
def room(tmp_path):
    file = tmp_path / "room.toml"
    file.write_text(ROOM)
    return haptics.load_scene(file)


@pytest.fixture
def gloves():
    with haptics.open(clock="virtual", seed=1) as left, haptics.open(clock="virtual", seed=2) as right:
        yield left, right


def seen(both: haptics.BothHands) -> list[tuple[str, ...]]:
    """The objects of the left hand and of the right."""
    return [session.scene.names for session in both.sessions.values()]


def cup():
    return haptics.load_scene("playground").object("cup")


def test_objects_come_move_and_go_for_both_hands(room, gloves):
    both = haptics.BothHands(room, *gloves)
    both.begin()
    both.add_object(cup())
    assert seen(both) == [("door", "cup")] * 2
    both.move_object("door", (0.0, 1.0, -0.3))
    both.move_object("ball", (0.1, 1.2, -0.1))  # it waited for a hand to place it
    assert seen(both) == [("door", "cup", "ball")] * 2
    assert [session.waits_for for session in both.sessions.values()] == ["", ""]
    both.remove_object("cup")
    assert seen(both) == [("door", "ball")] * 2
    for session in both.sessions.values():
        world = session.loop.world
        assert world.body("door").pose.position_m == (0.0, 1.0, -0.3)
        assert world.body("ball").pose.position_m == (0.1, 1.2, -0.1)
    both.change_scene(haptics.load_scene("desk").placed((0.0, 1.0, 0.0)))
    assert seen(both) == [haptics.load_scene("desk").names] * 2


def test_an_object_of_a_name_that_is_there_is_refused_for_both(room, gloves):
    both = haptics.BothHands(room, *gloves)
    both.add_object(cup())
    with pytest.raises(InputError, match="'cup' appears more than once"):
        both.add_object(cup())
    assert seen(both) == [("door", "cup")] * 2


def test_an_added_object_is_felt_by_either_hand(room, gloves):
    both = haptics.BothHands(room, *gloves)
    both.begin()
    frame = next(iter(haptics.load_hand("synthetic").frames("right")))
    both.add_object(replace(cup(), effects=room.object("door").effects))
    tip_m = frame.position_m[haptics.JOINTS.index("index_tip")]
    both.move_object("cup", tuple(map(float, tip_m)))
    for glove, side, turned in zip(gloves, ("left", "right"), ((1, -1, -1, 1), (1, 1, 1, 1)), strict=True):
        glove.arm()
        there_m = (frame.position_m - tip_m) * ((-1, 1, 1) if side == "left" else (1, 1, 1)) + tip_m
        hand = replace(frame, side=side, position_m=there_m, orientation_xyzw=frame.orientation_xyzw * turned)
        for _ in range(20):
            glove.advance(0.01)
            assert both.submit(replace(hand, time_ns=glove.now_ns())) is None
        assert "cup" in {event.object for event in both.sessions[side].events if event.kind == "touch"}


def test_a_pose_that_comes_while_a_scene_is_changed_meets_all_of_it_or_none(room, gloves):
    """Engines may track in one thread and build rooms in another; neither hand looks for what is gone for the other."""
    both = haptics.BothHands(haptics.load_scene("playground").placed_for(haptics.load_hand("synthetic")), *gloves)
    both.begin()
    frame = next(iter(haptics.load_hand("synthetic").frames("right")))
    said: list[str | None] = []
    tracking = threading.Thread(target=lambda: said.append(both.submit(replace(frame, time_ns=gloves[1].now_ns()))))

    def half_way(side, event):
        if (side, event.kind) == ("left", "scene"):
            tracking.start()
            tracking.join(0.2)  # what would fail has failed by then

    both.subscribe(half_way)
    both.change_scene(room)
    tracking.join()
    assert said == [None]


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_glove_that_is_configured_for_the_other_hand_is_refused(room, gloves, side, tmp_path):
    file = tmp_path / "glove.toml"
    file.write_text(f'side = "{side}"\n')
    other = "left" if side == "right" else "right"
    with haptics.open(file, clock="virtual") as glove:
        pair: dict[str, Glove] = {other: glove, side: gloves[0]}
        with pytest.raises(InputError, match=f"{other}: this glove is configured with side = '{side}'"):
            haptics.BothHands(room, pair["left"], pair["right"])
        haptics.BothHands(room, **{side: glove, other: gloves[0]})


def test_a_name_that_is_not_there_is_told_with_all_that_there_are_also_those_without_a_place_yet(room, gloves):
    session = haptics.Session(room, gloves[0])
    for call in (lambda: session.move_object("bal", (0.0, 1.0, 0.0)), lambda: session.remove_object("bal")):
        with pytest.raises(InputError, match="'bal' is not in scene 'room'; its objects: ball, door; did you mean ball"):
            call()


def test_either_hand_places_the_scene_for_both_and_anew(room, gloves):
    both = haptics.BothHands(room, *gloves)
    both.begin()
    both.add_object(cup())
    with pytest.raises(InputError, match="there is no right hand to place the scene by"):
        both.place("right")
    open_hand = next(haptics.load_hand("synthetic").frames("right"))
    along_m = []
    for shift_m in (0.0, 0.3):
        now_ns = max(session.devices.now_ns() for session in both.sessions.values()) + 200_000_000
        both.tick(now_ns)
        frame = replace(open_hand, time_ns=now_ns, position_m=open_hand.position_m + np.array((shift_m, 0.0, 0.0)))
        assert both.submit(frame) is None
        both.place("right")
        assert seen(both) == [("ball", "door", "cup")] * 2
        balls = [session.loop.body("ball").pose.position_m for session in both.sessions.values()]
        assert balls[0] == balls[1]
        along_m.append(balls[0][0])
    assert along_m[1] - along_m[0] == pytest.approx(0.3)
    assert [session.waits_for for session in both.sessions.values()] == ["", ""]

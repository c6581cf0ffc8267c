"""A session while it runs: objects that come, go and are moved, other scenes, real time, and its replay."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_hand import Live, told

import haptics
from haptics.session.replay import replay_recording

TACTILES, BRAKE = "sim://tactiles?spread=0&level=event", "sim://brake?spread=0"
RADIUS_M = 0.02


def ball(name: str, at_m: Sequence[float], sites: str = "index_tip", more: str = "") -> str:
    """An object of a scene file, felt at one site."""
    return f"""
[[objects]]
name = "{name}"
shape = {{ kind = "sphere", radius_m = {RADIUS_M} }}
position_m = {[float(x) for x in at_m]}
effects = [{{ kind = "contact", sites = ["{sites}"] }}]
{more}
"""


def scene_of(folder: Path, *objects: str, name: str = "balls") -> haptics.Scene:
    path = folder / f"{name}.toml"
    path.write_text("\n".join(['summary = "balls to touch"', *objects]))
    return haptics.load_scene(path)


@pytest.fixture
def glove() -> Iterator[haptics.Glove]:
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as opened:
        opened.arm()
        yield opened


def live_on(glove: haptics.Glove, scene: haptics.Scene, **how) -> Live:
    session = haptics.Session(scene, glove, kept=None, **how)
    session.begin()
    return Live(session)


def under(tip_m: np.ndarray, depth_m: float = 0.005) -> np.ndarray:
    """Where a ball's centre is, so that a fingertip 3 cm lower is so deep in it."""
    return np.add(tip_m, (0.0, -0.03 - RADIUS_M - 0.005 + depth_m, 0.0))


@pytest.fixture
def tip_m() -> np.ndarray:
    """The index fingertip of the hand where it begins."""
    with haptics.open(tactiles=TACTILES, clock="virtual") as opened:
        return Live(haptics.Session(haptics.load_scene("posture"), opened)).tip_m()


DOWN = (0.0, -0.03, 0.0)


def strokes(glove: haptics.Glove) -> list[int]:
    return list(glove.devices.plant("tactiles").truth()["switches"])


def test_in_another_scene_what_is_alike_goes_on_being_felt_without_a_stroke_and_what_is_gone_is_released(glove, tmp_path, tip_m):
    pad, other = ball("pad", under(tip_m)), ball("other", np.add(under(tip_m), (0.2, 0.0, 0.0)))
    hand = live_on(glove, scene_of(tmp_path, pad))
    hand.move(DOWN, 0.3)
    hand.stay(0.1)
    assert glove.truth().pins_out == ("index_tip",)
    before = strokes(glove)
    hand.session.change_scene(scene_of(tmp_path, pad, other, name="more"))
    hand.stay(0.2)
    assert glove.truth().pins_out == ("index_tip",)
    assert strokes(glove) == before
    hand.session.change_scene(scene_of(tmp_path, other, name="other"))
    hand.stay(0.2)
    assert glove.truth().pins_out == ()
    assert told(hand.session, "touch", "release") == [("touch", "index_tip", "pad"), ("release", "index_tip", "pad")]


def test_objects_come_and_go_while_a_pin_is_out(glove, tmp_path, tip_m):
    hand = live_on(glove, scene_of(tmp_path, ball("pad", under(tip_m))))
    hand.move(DOWN, 0.3)
    hand.stay(0.1)
    before = strokes(glove)
    more = scene_of(tmp_path, ball("thumbs", hand.tip_m("thumb_tip") + DOWN, "thumb_tip"), name="thumbs").object("thumbs")
    hand.session.add_object(more)
    hand.stay(0.2)
    assert set(glove.truth().pins_out) == {"index_tip", "thumb_tip"}
    assert strokes(glove)[1] == before[1]
    with pytest.raises(haptics.InputError, match="thumbs"):
        hand.session.add_object(more)
    hand.session.remove_object("thumbs")
    hand.stay(0.2)
    assert glove.truth().pins_out == ("index_tip",)
    hand.session.remove_object("pad")
    hand.stay(0.2)
    assert glove.truth().pins_out == ()
    assert hand.session.scene.names == ()
    with pytest.raises(haptics.InputError, match="pad"):
        hand.session.remove_object("pad")


def test_an_object_of_the_engine_is_foreseen_to_come_to_a_hand_that_rests(glove, tmp_path, tip_m):
    """It comes straight at 0.1 m/s; the pin is at the skin when the surfaces meet."""
    centre_m = np.add(tip_m, (0.0, -0.1, 0.0))
    hand = live_on(glove, scene_of(tmp_path, ball("drone", centre_m, more='owner = "engine"')))
    hand.stay(0.3)
    radii_m = RADIUS_M + float(hand.session.loop.sites.radius_m[1])
    begun_ns, speed_m_s = hand.now_ns, 0.1
    for _ in range(100):
        hand.wait(0.008)
        moved_m = speed_m_s * (hand.now_ns - begun_ns) * 1e-9
        hand.session.move_object("drone", np.add(centre_m, (0.0, moved_m, 0.0)))
        hand.seen()
    (reached_ns,) = [
        ns for ns, channel, kind in hand.session.truth.pins if (channel, kind) == (1, "reached_skin") and ns > begun_ns
    ]
    meets_ns = begun_ns + round((0.1 - radii_m) / speed_m_s * 1e9)
    assert abs(reached_ns - meets_ns) < 5_000_000


def test_an_object_with_a_place_of_the_hand_waits_for_it_and_is_placed_anew_on_request(glove):
    scene = haptics.load_scene("desk")
    hand = live_on(glove, scene)
    assert "still for half a second" in hand.session.waits_for
    assert hand.session.scene.names == ()
    hand.move((0.0, 0.06, 0.0), 0.3)
    assert hand.session.scene.names == ()
    hand.stay(0.7)
    assert hand.session.waits_for == ""
    assert hand.session.scene.names == scene.names
    first_m = np.array(hand.session.scene.object("table").body.pose.position_m)
    hand.move((0.1, 0.06, 0.0), 0.5)
    hand.session.place()
    np.testing.assert_allclose(
        hand.session.scene.object("table").body.pose.position_m, np.add(first_m, (0.1, 0.0, 0.0)), atol=1e-9
    )
    assert [event.kind for event in hand.session.events].count("placed") == 2
    hand.session.hand_gone()
    with pytest.raises(haptics.InputError, match="no hand"):
        hand.session.place()


def test_boards_of_no_more_use_go_off_and_the_others_go_on(glove, tmp_path, tip_m):
    frames = list(haptics.load_hand("synthetic").frames("right"))
    hand = live_on(glove, haptics.load_scene("playground").placed_for(haptics.load_hand("synthetic")), follows_needs=True)
    hand.play([frame for frame in frames if frame.time_ns < 1_700_000_000])
    assert max(map(abs, glove.truth().volts.values())) > 300
    held = [frame for frame in frames if frame.time_ns < 1_700_000_000][-1]
    hand.session.change_scene(scene_of(tmp_path, ball("pad", under(tip_m))))
    for _ in range(30):
        hand.wait(0.008)
        hand.show(held)
    assert glove.state().armed == ("tactiles",)
    assert max(map(abs, glove.truth().volts.values())) < 60
    assert glove.state().faults == ()
    hand.session.end()
    glove.arm()
    assert set(glove.state().armed) == {"tactiles", "brake"}


# Replayed, and in real time -------------------------------------------------------------------------------------------


def test_a_recorded_session_replays_with_the_same_decisions_or_names_the_first_that_differs(tmp_path, tip_m):
    out = tmp_path / "live.h5"
    scene = scene_of(tmp_path, ball("pad", under(tip_m)), ball("drone", np.add(tip_m, (0.0, 0.2, 0.0)), more='owner = "engine"'))
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual", record=out) as glove:
        glove.arm()
        hand = live_on(glove, scene)
        hand.move(DOWN, 0.3)
        hand.session.move_object("drone", np.add(tip_m, (0.0, 0.3, 0.0)))
        hand.stay(0.2)
        hand.move((0.0, 0.0, 0.0), 0.3)
        hand.wait(0.2)
        hand.session.remove_object("drone")
        hand.session.end()
    from haptics.session.replay_live import replay_live

    recording = haptics.load_recording(out)
    same = replay_live(out, recording)
    assert same.identical, same.first_difference
    assert same.decisions == same.replayed_decisions > 3
    assert replay_recording(out).identical
    poses = recording.stream("poses").copy()
    poses["position_m"][20:] += np.float32(0.05)  # from a moment on the way down the hand stays above
    recording._rows["poses"] = poses
    differs = replay_live(out, recording)
    assert not differs.identical
    assert differs.first_difference.startswith("recorded touch index_tip pad at 0.")


@pytest.mark.slow
def test_live_renders_a_scene_on_simulated_boards_in_real_time_and_goes_off(tmp_path):
    """Only what needs no particular speed of this machine: it is armed, hears poses, tells, records, and is off afterwards."""
    placed = threading.Event()
    frame = next(iter(haptics.load_hand("synthetic").frames("right")))
    out = tmp_path / "live.h5"
    with haptics.live("desk", tactiles=TACTILES, record=out) as session:
        session.subscribe(lambda one: placed.set() if getattr(one, "kind", "") == "placed" else None)
        assert session.glove.state().armed == ("tactiles",)  # the desk has no use for brakes
        assert session.devices.brakes is None
        for _ in range(3000):
            session.submit(replace(frame, time_ns=session.glove.now_ns()))
            if placed.wait(0.01):
                break
        assert session.waits_for == ""
        glove = session.glove
    with pytest.raises(haptics.GloveEnded):
        session.submit(frame)
    with pytest.raises(haptics.GloveEnded):
        glove.state()
    assert haptics.load_recording(out).complete

"""Grasps: the literal rule and its stutter, the re-arming rule, the object on the ray, and penetration in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Box, Placed, Sphere
from haptics.scene.grasp import GraspRule, GraspTracker, grasp_rule
from haptics.scene.hand_files.load import load_hand
from haptics.scene.library import load_scene
from haptics.scene.placement import expected_grasps
from haptics.scene.sites import TIP_RADIUS_M

RADIUS_M = 0.03
BEGIN_M = 2 * (RADIUS_M + TIP_RADIUS_M + 0.005)  # distance of the tip joints at which both are 5 mm off the ball
STEP_NS = 9_000_000


def ball() -> dict[str, Placed]:
    return {"ball": Placed(Sphere(RADIUS_M))}


def tips(distance_m: float, turn_rad: float = 0.0, middle=(0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    half = 0.5 * distance_m * np.array([math.cos(turn_rad), math.sin(turn_rad), 0.0])
    return np.array(middle) - half, np.array(middle) + half


def play(tracker: GraspTracker, distances_m, start_ns: int = 0):
    return [event for n, d in enumerate(distances_m) for event in tracker.update(start_ns + n * STEP_NS, *tips(d))]


def close_and_open(noise_m: float, seed: int = 0, hold: int = 60) -> np.ndarray:
    """Closing onto the ball, hovering where the grasp began, opening slowly."""
    steady = np.concatenate(
        [np.linspace(0.12, BEGIN_M - 0.0002, 40), np.full(hold, BEGIN_M - 0.0002), np.linspace(BEGIN_M, 0.14, 80)]
    )
    return steady + np.random.default_rng(seed).normal(0.0, noise_m, len(steady))


def test_a_grasp_begins_when_both_tip_spheres_are_within_five_millimetres():
    tracker = GraspTracker(ball())
    assert tracker.update(0, *tips(BEGIN_M + 1e-6)) == []
    (begin,) = tracker.update(1, *tips(BEGIN_M - 1e-6))
    assert (begin.kind, begin.object, begin.penetration) == ("begin", "ball", 0.0)
    assert begin.start_ray_m == pytest.approx(BEGIN_M - 1e-6, abs=1e-12)


def test_one_finger_alone_or_both_on_one_side_grasps_nothing():
    tracker = GraspTracker(ball())
    near = np.array([RADIUS_M + TIP_RADIUS_M, 0.0, 0.0])
    assert tracker.update(0, near, np.array([-0.1, 0.0, 0.0])) == []
    table = GraspTracker({"table": Placed(Box((1.0, 0.1, 1.0)), Pose((0.0, -0.05, 0.0)))})
    assert table.update(0, np.array([0.0, 0.008, 0.0]), np.array([0.05, 0.008, 0.0])) == []


def test_the_literal_rule_ends_as_soon_as_the_ray_is_longer_than_at_the_start():
    tracker = GraspTracker(ball(), grasp_rule("thesis"))
    events = play(tracker, [0.1, 0.08, 0.07, 0.0799, 0.0801, 0.12])
    assert [(event.kind, event.time_ns // STEP_NS) for event in events] == [("begin", 1), ("end", 4)]


def test_the_literal_rule_stutters_on_opening_and_the_rearming_one_does_not():
    literal = [e for e in play(GraspTracker(ball(), grasp_rule("thesis")), close_and_open(2e-4)) if e.kind == "begin"]
    rearming = [e for e in play(GraspTracker(ball()), close_and_open(2e-4)) if e.kind == "begin"]
    assert len(literal) > 2
    assert len(rearming) == 1


@pytest.mark.parametrize("seed", range(10))
def test_the_default_rule_grasps_once_however_the_tracker_trembles(seed):
    events = play(GraspTracker(ball()), close_and_open(5e-4, seed))
    assert [event.kind for event in events] == ["begin", "end"]


def test_the_beginning_is_never_held_back():
    frames = close_and_open(0.0)
    begun = [play(GraspTracker(ball(), grasp_rule(name)), frames)[0].time_ns for name in ("thesis", "rearming")]
    assert begun[0] == begun[1]


def test_the_end_must_last_fifty_milliseconds():
    tracker = GraspTracker(ball())
    tracker.update(0, *tips(0.08))
    assert tracker.update(10_000_000, *tips(0.081)) == []
    assert tracker.update(40_000_000, *tips(0.079)) == []  # shorter again: the wait starts over
    assert tracker.update(50_000_000, *tips(0.081)) == []
    assert tracker.update(99_000_000, *tips(0.081)) == []
    assert [event.kind for event in tracker.update(100_000_000, *tips(0.081))] == ["end"]


def test_a_tip_must_leave_the_band_by_two_millimetres_before_the_next_grasp():
    tracker = GraspTracker(ball(), GraspRule(end_hold_s=0.0))
    assert [e.kind for e in play(tracker, [0.07, 0.071])] == ["begin", "end"]
    assert play(tracker, [BEGIN_M + 2 * 0.0019, 0.07], 10 * STEP_NS) == []
    assert [e.kind for e in play(tracker, [BEGIN_M + 2 * 0.0021, 0.07], 20 * STEP_NS)] == ["begin"]


def test_the_object_moves_and_turns_with_the_ray():
    tracker = GraspTracker({"box": Placed(Box((0.06, 0.02, 0.02)), Pose((0.005, 0.0, 0.0)))})
    assert tracker.update(0, *tips(0.07))
    tracker.update(1, *tips(0.06, math.pi / 2, (0.1, 0.2, 0.3)))
    pose = tracker.body("box").pose
    assert pose.position_m == pytest.approx((0.1, 0.205, 0.3), abs=1e-12)
    assert pose.rotation @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


def test_where_the_object_is_does_not_depend_on_the_frame_rate():
    def carried(frames: int) -> Pose:
        tracker = GraspTracker(ball())
        for n in range(frames + 1):
            share = n / frames
            tracker.update(round(share * 1e9), *tips(0.07, 2.0 * share, (0.3 * share, 0.0, 0.1 * share)))
        return tracker.body("ball").pose

    assert carried(2).position_m == pytest.approx(carried(200).position_m, abs=1e-12)
    assert carried(2).rotation == pytest.approx(carried(200).rotation, abs=1e-9)


def test_a_released_object_stays_where_it_was_let_go():
    tracker = GraspTracker(ball(), GraspRule(end_hold_s=0.0))
    tracker.update(0, *tips(0.07))
    tracker.update(1, *tips(0.071, 0.0, (0.1, 0.0, 0.0)))
    tracker.update(2, *tips(0.15, 0.0, (0.5, 0.0, 0.0)))
    assert tracker.held is None
    assert tracker.body("ball").pose.position_m == pytest.approx((0.1, 0.0, 0.0), abs=1e-12)


def test_penetration_is_the_mean_share_the_ray_has_shortened():
    tracker = GraspTracker(ball(), GraspRule(end_hold_s=0.0))
    lengths = np.concatenate([np.linspace(0.08, 0.04, 101), np.linspace(0.04, 0.08, 101)[1:], [0.0801]])
    end = play(tracker, lengths)[-1]
    assert end.kind == "end"
    assert end.penetration == pytest.approx(0.25 * 200 / 201, rel=1e-6)  # a triangle of height 1/2, and one frame of none
    assert end.depth_m == pytest.approx(RADIUS_M + TIP_RADIUS_M - 0.02, abs=1e-12)


def test_of_two_objects_the_nearer_is_grasped_and_held_alone():
    tracker = GraspTracker({"far": Placed(Sphere(0.028)), "near": Placed(Sphere(0.031))})
    events = play(tracker, [0.075, 0.07, 0.06])
    assert [(event.kind, event.object) for event in events] == [("begin", "near")]
    assert tracker.held == "near"


def test_a_lost_hand_lets_go():
    tracker = GraspTracker(ball())
    tracker.update(0, *tips(0.07))
    (end,) = tracker.let_go(5)
    assert (end.kind, end.ray_m) == ("end", pytest.approx(0.07))
    assert tracker.held is None
    assert tracker.let_go(6) == []


def test_wrong_tips_times_objects_and_rules_are_refused():
    tracker = GraspTracker(ball())
    tracker.update(10, *tips(0.2))
    with pytest.raises(InputError, match="forward"):
        tracker.update(9, *tips(0.2))
    with pytest.raises(InputError, match="three finite"):
        tracker.update(11, np.array([math.nan, 0.0, 0.0]), np.zeros(3))
    with pytest.raises(InputError, match="ball"):
        tracker.body("cup")
    with pytest.raises(InputError, match="rearming, thesis"):
        grasp_rule("magnetic")
    with pytest.raises(InputError, match="band_m"):
        GraspRule(band_m=1.0)


def test_an_object_can_be_put_elsewhere_unless_it_is_held():
    tracker, here = GraspTracker(ball()), ball()["ball"]
    away = here.at(Pose((1.0, 0.0, 0.0)))
    tracker.put("ball", away)
    assert tracker.update(0, *tips(0.07)) == []
    tracker.put("ball", here)
    assert tracker.update(1, *tips(0.07))
    tracker.put("ball", away)
    assert tracker.body("ball").pose == Pose()


def test_an_object_that_somebody_else_moves_is_where_they_put_it_held_or_not():
    tracker, there = GraspTracker(ball(), others=["ball"]), ball()["ball"].at(Pose((0.001, 0.0, 0.0)))
    assert tracker.update(0, *tips(0.07))
    tracker.put("ball", there)
    tracker.update(10**7, *tips(0.07, middle=(0.0, 0.02, 0.0)))
    assert tracker.held == "ball"
    assert tracker.body("ball").pose == there.pose


@pytest.mark.parametrize("name", ["playground", "workplace"])
def test_the_recorded_grab_makes_two_grasps(recordings, name):
    recording = load_hand(recordings / "grab.leap.json.gz")
    tracker = load_scene(name).placed_for(recording).grasp_tracker()
    (track,) = recording.tracks
    thumb, index = track.joint_m("thumb_tip"), track.joint_m("index_tip")
    events = [e for n, t in enumerate(track.time_ns.tolist()) for e in tracker.update(t, thumb[n], index[n])]
    assert [event.kind for event in events] == ["begin", "end"] * expected_grasps(recording)
    assert len(events) == 4


def test_the_shipped_motion_makes_one_grasp():
    recording = load_hand("synthetic")
    tracker = load_scene("playground").placed_for(recording).grasp_tracker()
    (track,) = recording.tracks
    thumb, index = track.joint_m("thumb_tip"), track.joint_m("index_tip")
    events = [e for n, t in enumerate(track.time_ns.tolist()) for e in tracker.update(t, thumb[n], index[n])]
    assert [event.kind for event in events] == ["begin", "end"]

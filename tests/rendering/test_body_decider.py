"""The compiled path from a pose to its decisions decides what the plain one does: the same touches for the same moments."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from posed import loop_of, play

from haptics.rendering.body_decider import BodyDecider
from haptics.rendering.decision import TouchDecider
from haptics.rendering.grasp_ahead import GraspAhead
from haptics.rendering.pose_kernel import ABSENT, FAR, FRAMES_KEPT, PRESENT
from haptics.rendering.prediction import PredictionParameters
from haptics.scene import load_scene
from haptics.scene.geometry.mesh import TriangleMesh
from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Box, Capsule, Cylinder, Placed, Plane, Sphere
from haptics.scene.grasp import GraspTracker
from haptics.scene.hand_files.load import load_hand
from haptics.time import NS_PER_MS, NS_PER_S

FRAME_NS = 9 * NS_PER_MS
LEAD_NS = 6 * NS_PER_MS
RADIUS_M = np.array([0.007, 0.007, 0.005])
TETRAHEDRON = TriangleMesh(
    0.05 * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]), np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
)
BODIES = [
    Placed(Sphere(0.04), Pose((0.05, 0.0, 0.0))),
    Placed(Box((0.2, 0.02, 0.2)), Pose((0.0, -0.08, 0.0), (0.0, 0.6, 0.0, 0.8))),
    Placed(Capsule(0.02, 0.1), Pose((-0.1, 0.0, 0.05), (0.8, 0.0, 0.6, 0.0))),
    Placed(Cylinder(0.03, 0.1), Pose((0.0, 0.05, -0.1))),
    Placed(Plane(), Pose((0.0, -0.12, 0.0))),
    Placed(TETRAHEDRON, Pose((-0.05, 0.1, 0.0))),
]


def decided(decider, frames):
    """All that a decider decides over (time, arrival, places): at which tick, and for when it is meant."""
    log, now_ns, waiting = [], frames[0][0], list(frames)
    while waiting:
        while waiting and waiting[0][1] <= now_ns:
            time_ns, _, position_m = waiting.pop(0)
            decider.observe(time_ns, position_m, now_ns)
        log += [(now_ns, one.site, one.object, one.begins, one.aimed_ns) for one in decider.due(now_ns)]
        now_ns += NS_PER_MS
    return log


def same(ours, theirs):
    """Equal but for a nanosecond in the aim, which is rounded from a float of seconds."""
    assert [one[:4] for one in ours] == [one[:4] for one in theirs]
    assert [one[4] for one in ours] == pytest.approx([one[4] for one in theirs], abs=1)


def both(frames, bodies=BODIES, radius_m=RADIUS_M):
    plain = TouchDecider([body.distance for body in bodies], radius_m, LEAD_NS, 8 * NS_PER_MS)
    return decided(BodyDecider(bodies, radius_m, LEAD_NS, 8 * NS_PER_MS), frames), decided(plain, frames)


def wandering(seed: int, count: int, steps_ns: list[int], late_ns: int) -> list[tuple[int, int, np.ndarray]]:
    """Sites that swing through the bodies, with tremor; now and then one is not seen."""
    rng = np.random.default_rng(seed)
    rate_hz, phase = rng.uniform(0.3, 1.5, (3, 3)), rng.uniform(0, 6, (3, 3))
    frames, time_ns = [], 0
    for number in range(count):
        time_ns += steps_ns[number % len(steps_ns)]
        place_m = 0.15 * np.sin(2 * np.pi * rate_hz * time_ns / NS_PER_S + phase) + 1e-4 * rng.standard_normal((3, 3))
        if rng.random() < 0.03:
            place_m[rng.integers(3)] = np.nan
        frames.append((time_ns, time_ns + late_ns, place_m))
    return frames


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**16),
    st.lists(st.sampled_from([1, 2, 4, 9, 9, 9, 13, 28, 60, 130]), min_size=1, max_size=6),
    st.sampled_from([0, 10, 20, 48, 70]),
)
def test_any_motion_at_any_rate_is_decided_as_on_the_plain_path(seed, steps_ms, late_ms):
    same(*both(wandering(seed, 150, [step * NS_PER_MS for step in steps_ms], late_ms * NS_PER_MS)))


def test_a_second_of_it_has_touches_of_every_body():
    ours, theirs = both(wandering(3, 2000, [FRAME_NS], 0))
    same(ours, theirs)
    assert {one[2] for one in ours} == set(range(len(BODIES)))


def test_frames_that_come_faster_than_they_are_kept_still_decide():
    ours, _ = both(wandering(4, 4 * FRAMES_KEPT, [100_000], 0))
    assert all(one[1] < 3 for one in ours)


def test_a_body_that_is_away_or_out_of_reach_is_not_touched_and_one_that_was_touched_is_kept_or_left():
    inside = np.zeros((1, 3))
    for standing, kept in ((ABSENT, True), (FAR, False)):
        decider = BodyDecider([Placed(Sphere(0.05))], [0.007], LEAD_NS)
        decider.observe(0, inside, 0)
        assert [one.begins for one in decider.due(0)] == [True]
        decider.put(0, Placed(Sphere(0.05)), standing)
        decider.observe(2 * FRAME_NS, inside, 2 * FRAME_NS)
        assert [one.begins for one in decider.due(2 * FRAME_NS)] == ([] if kept else [False])
        decider.put(0, Placed(Sphere(0.05)), PRESENT)
        back_ns = NS_PER_S  # what is far is not looked at again before it could have come
        decider.observe(back_ns, inside, back_ns)
        assert [one.begins for one in decider.due(back_ns)] == ([] if kept else [True])


@pytest.mark.parametrize("scene", ["desk", "playground"])
def test_the_shipped_hand_is_rendered_as_on_the_plain_path(scene):
    hand = load_hand("synthetic")
    placed = load_scene(scene).placed_for(hand)
    ours, _ = play(loop_of(placed, plain=False), hand)
    assert ours == play(loop_of(placed, plain=True), hand)[0]
    assert any(event.kind in ("touch", "grasp_begin") for event in ours)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["desk", "playground"])
def test_every_recorded_hand_is_rendered_as_on_the_plain_path(scene, recordings):
    touches = 0
    for path in sorted(recordings.glob("*.l*z")):
        hand = load_hand(path)
        placed = load_scene(scene).placed_for(hand)
        ours, _ = play(loop_of(placed, plain=False), hand)
        assert ours == play(loop_of(placed, plain=True), hand)[0], path
        touches += sum(event.kind == "touch" for event in ours)
    assert touches > 20


WALL = Placed(Plane(), Pose(orientation_xyzw=(0.0, 0.0, -(0.5**0.5), 0.5**0.5)))
"""Solid at x < 0."""


def test_a_plan_dies_with_its_pose():
    touch_ns, exact = NS_PER_S // 2, PredictionParameters(damping_per_s=0.0, noise_m=0.0)
    for age_ms, met in ((49, True), (51, False)):
        decider = BodyDecider([WALL], [0.007], 0, prediction=exact)
        for number in range(12, -1, -1):
            time_ns = touch_ns - age_ms * NS_PER_MS - number * FRAME_NS
            decider.observe(time_ns, [[0.007 + (touch_ns - time_ns) / NS_PER_S, 0.0, 0.0]], time_ns)
        assert bool(decider.due(touch_ns + NS_PER_MS // 2)) is met


def test_a_plan_dies_so_long_after_its_pose_arrived_whatever_time_that_claims_to_be_of():
    """A pose of 40 ms ahead, of a site that touches 52 ms after that moment."""
    touch_ns, exact = NS_PER_S // 2, PredictionParameters(damping_per_s=0.0, noise_m=0.0)
    for make in (BodyDecider, plain_wall):
        decider = make([WALL], [0.007], 0, prediction=exact)
        for number in range(12, -1, -1):
            time_ns = touch_ns - 52 * NS_PER_MS - number * FRAME_NS
            now_ns = time_ns - 40 * NS_PER_MS
            decider.observe(time_ns, [[0.007 + (touch_ns - time_ns) / NS_PER_S, 0.0, 0.0]], now_ns)
        assert decider.due(now_ns + 55 * NS_PER_MS) == []
        assert decider.due(touch_ns + NS_PER_MS) == []


def plain_wall(bodies, *arguments, **more):
    return TouchDecider([body.distance for body in bodies], *arguments, **more)


def test_a_pose_that_comes_too_old_decides_nothing():
    for age_ms, met in ((49, True), (51, False)):
        decider = BodyDecider([WALL], [0.007], 0)
        decider.observe(0, [[-0.1, 0.0, 0.0]], 0)
        assert [one.begins for one in decider.due(0)] == [True]
        now_ns = FRAME_NS + age_ms * NS_PER_MS
        decider.observe(FRAME_NS, [[0.1, 0.0, 0.0]], now_ns)
        assert bool(decider.due(now_ns)) is met


def test_a_pin_does_not_turn_round_sooner_than_its_stroke():
    decider = BodyDecider([WALL], [0.007], 0)
    inside, outside = [[-0.1, 0.0, 0.0]], [[0.1, 0.0, 0.0]]
    turns = []
    for tick in range(60):
        decider.observe(tick * NS_PER_MS, outside if tick // 3 % 2 else inside, tick * NS_PER_MS)
        turns += [tick for _ in decider.due(tick * NS_PER_MS)]
    assert len(turns) >= 4
    assert min(np.diff(turns)) >= 10


def test_of_a_pair_both_points_must_be_near_and_one_that_is_not_seen_is_not():
    for other, near in (([0.0, 0.01, 0.0], True), ([0.3, 0.01, 0.0], False), ([np.nan] * 3, False)):
        decider = BodyDecider([WALL], [0.012], 0, points=2)
        decider.observe(0, [[0.0, 0.0, 0.0, *other]], 0)
        assert bool(decider.due(0)) is near


def test_a_pair_that_touches_goes_on_while_one_of_it_is_not_seen():
    decider = BodyDecider([WALL], [0.012], 0, points=2)
    decider.observe(0, [[0.0, 0.0, 0.0, 0.0, 0.01, 0.0]], 0)
    assert [one.begins for one in decider.due(0)] == [True]
    for time_ns in range(FRAME_NS, 10 * FRAME_NS, FRAME_NS):
        decider.observe(time_ns, [[0.2, 0.0, 0.0, np.nan, np.nan, np.nan]], time_ns)
        assert decider.due(time_ns) == []


def test_an_object_that_was_let_go_is_not_closed_for_before_a_tip_has_left_it():
    ball = Placed(Sphere(0.03))
    tracker = GraspTracker({"ball": ball})
    ahead = GraspAhead(tracker, ["ball"], 20 * NS_PER_MS, 50 * NS_PER_MS)
    thumb, index = np.array([-0.036, 0.0, 0.0]), np.array([0.036, 0.0, 0.0])
    tracker.update(0, thumb, index)
    tracker.let_go(FRAME_NS)
    assert not tracker.armed("ball")
    for time_ns in range(FRAME_NS, NS_PER_S, FRAME_NS):
        tracker.update(time_ns, thumb, index)
        ahead.observe(time_ns, thumb, index, time_ns)
        assert ahead.due(time_ns) is None

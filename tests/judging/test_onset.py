from __future__ import annotations

import numpy as np
import pytest

from haptics.judging.onset import Onsets, Touched, held_acts, match, onset_statistics, statistics_of, touches_on
from haptics.judging.onset_experiment import SitePath, onset_experiment
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.synthetic import synthetic_hand
from haptics.time import NS_PER_MS, NS_PER_S

MS = NS_PER_MS


def touched(*at_ms, **more):
    return [Touched(round(at * MS), **more) for at in at_ms]


def grid(seconds=1.0):
    return np.arange(0, round(seconds * NS_PER_S), MS // 2)


def test_touched_is_where_the_distance_falls_through_zero():
    time_ns = grid()
    distance = np.stack([0.1003 - 0.2 * time_ns / NS_PER_S, np.full(len(time_ns), 0.1)], axis=1)
    (touch,) = touches_on(time_ns, distance, name="ball")
    assert touch.time_ns == pytest.approx(501.5 * MS, abs=1000)
    assert touch.approach_m_s == pytest.approx(0.2, rel=1e-6)
    assert (touch.site, touch.object, touch.counted) == (0, "ball", True)


@pytest.mark.parametrize(("depth_mm", "counted"), [(0.9, False), (1.1, True)])
def test_a_touch_counts_from_one_millimetre(depth_mm, counted):
    time_ns = grid()
    dip = 0.01 - (0.01 + depth_mm * 1e-3) * np.sin(np.pi * time_ns / NS_PER_S)
    (touch,) = touches_on(time_ns, dip[:, None])
    assert touch.counted is counted
    assert touch.depth_m == pytest.approx(depth_mm * 1e-3, abs=1e-6)


@pytest.mark.parametrize(("at_ms", "counted"), [(119, False), (121, True), (938, True), (942, False)])
def test_touches_at_the_edge_of_a_track_do_not_count(at_ms, counted):
    time_ns = grid()
    (touch,) = touches_on(time_ns, (at_ms * MS - time_ns)[:, None] / NS_PER_S)
    assert touch.counted is counted


def test_being_inside_at_the_start_is_no_touch_and_each_return_is_one():
    time_ns = grid()
    distance = -1e-6 - 0.01 * np.sin(2 * np.pi * 3 * time_ns / NS_PER_S)
    found = touches_on(time_ns, distance[:, None])
    assert [touch.time_ns / MS for touch in found] == pytest.approx([1e3 / 3, 2e3 / 3], abs=0.1)
    assert touches_on(time_ns, distance[:, None], sites=()) == []


def test_matching_is_one_to_one_nearest_first():
    assert match([100, 108], [105], within_ns=10) == [1]
    assert match([100], [95, 104], within_ns=10) == [None, 0]
    assert match([0], [11], within_ns=10) == [None]
    assert match([], [1]) == [None]


def test_missed_counts_as_infinite_and_false_has_no_touch_within_50_ms():
    onsets = Onsets()
    onsets.add(touched(500, 1000, 1500), [502 * MS, 1060 * MS, 3000 * MS])
    result = statistics_of(onsets)
    assert onsets.error_ms == [2.0, 60.0, np.inf]
    assert (result.n, result.missed, result.false, result.shallow) == (3, 1, 2, 0)
    assert result.signed_median == pytest.approx(31.0)
    assert result.median == 60.0
    assert result.p95 is None
    assert result.in_window == pytest.approx(1 / 3)


def test_the_window_includes_its_edges():
    onsets = Onsets()
    onsets.add(touched(500, 1000, 1500, 2000), [485 * MS, 984 * MS, 1550 * MS, 2051 * MS])
    assert statistics_of(onsets).in_window == 0.5


def test_acting_for_a_graze_is_shallow_not_false_and_edges_are_not_judged():
    onsets = Onsets()
    onsets.add(touched(500, depth_m=0.5e-3, counted=False), [510 * MS, 30 * MS, 990 * MS], (120 * MS, 940 * MS))
    assert (onsets.false, onsets.shallow, onsets.error_ms) == (0, 1, [])


def test_speeds_are_told_apart_and_slow_touches_also_in_millimetres():
    onsets = Onsets()
    onsets.add(touched(500, approach_m_s=0.05), [520 * MS])
    onsets.add(touched(500, approach_m_s=0.3), [504 * MS])
    onsets.hold.add(touched(500, approach_m_s=0.3), [521 * MS])
    told = onset_statistics(onsets)
    assert (told["n"], told["fast"]["n"], told["fast"]["hold"]["median"]) == (2, 1, 21.0)
    slow = told["by_speed"][0]
    assert (slow["median"], slow["median_mm"]) == (20.0, pytest.approx(1.0))
    assert told["by_speed"][1]["n"] == 0
    assert told["by_speed"][1]["median"] is None


def test_hold_acts_at_the_tick_after_the_first_pose_inside():
    frames = np.array([0, 9, 18, 27, 36]) * MS + 100
    distance = np.array([[1.0, -1.0], [-1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    acts = held_acts(frames, distance, latency_ns=10 * MS, tick_ns=MS, lead_ns=6 * MS)
    assert [[a / MS for a in site] for site in acts] == [[26.0, 53.0], [17.0, 44.0]]


def test_merging_is_adding():
    first, second = Onsets(), Onsets()
    first.add(touched(500), [501 * MS])
    second.add(touched(500), [900 * MS])
    second.hold.add(touched(500), [512 * MS])
    first.merge(second)
    assert (len(first.error_ms), first.false, first.hold.error_ms) == (2, 1, [12.0])


def test_the_experiment_repeats_itself_and_beats_hold_on_a_motion_it_was_not_made_with():
    path = SitePath.of(synthetic_hand(3, duration_s=2.0).tracks[0])
    once, again = (onset_experiment([path], (10 * MS,), objects=60, seed=2)[10 * MS] for _ in range(2))
    assert once == again
    ours, hold = statistics_of(once, 0.1), statistics_of(once.hold, 0.1)
    assert ours.n >= 30
    assert ours.median < 0.5 * hold.median


@pytest.mark.slow
def test_recorded_hands_are_met_when_they_touch(recordings):
    """A smaller sample than the published table (docs/explanation/onset.md); thresholds with its room for chance."""
    paths = [SitePath.of(track) for file in sorted(recordings.glob("*.leap.json.gz")) for track in load_hand(file).tracks]
    found = onset_experiment(paths, objects=12, seed=5)
    for (latency_ns, onsets), median_ms, window in zip(found.items(), (2.0, 4.5, 7.5), (0.995, 0.99, 0.98), strict=True):
        fast, hold = statistics_of(onsets, 0.1), statistics_of(onsets.hold, 0.1)
        assert fast.n >= 250
        assert fast.median <= median_ms, latency_ns
        assert fast.in_window >= window - 0.005, latency_ns
        assert fast.median < 0.3 * hold.median
        assert fast.missed <= 0.01 * fast.n
        assert fast.false <= {0: 0.03, 10: 0.05, 20: 0.07}[latency_ns // MS] * fast.n

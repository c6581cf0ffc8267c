from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.rendering.decision import Decided, DecisionParameters, TouchDecider, touch_ahead
from haptics.rendering.prediction import PredictionParameters, Predictor
from haptics.time import NS_PER_MS, NS_PER_S

FRAME_NS = 9 * NS_PER_MS
LEAD_NS = 6 * NS_PER_MS
RADIUS_M = 0.007


def forecast_of(path, frames=12, interval_ns=FRAME_NS, parameters=None):
    predictor = Predictor(parameters)
    forecast = None
    for i in range(frames):
        forecast = predictor.observe(i * interval_ns, path(i * interval_ns / NS_PER_S))
    assert forecast is not None
    return forecast, (frames - 1) * interval_ns / NS_PER_S


def play(decider, times_ns, place, until_ns, latency_ns=0):
    """Frames at ``times_ns`` into the decider and a tick a millisecond; what it decided, and when."""
    pending, log = list(times_ns), []
    for now_ns in range(0, until_ns, NS_PER_MS):
        while pending and pending[0] + latency_ns <= now_ns:
            time_ns = pending.pop(0)
            decider.observe(time_ns, place(time_ns / NS_PER_S), now_ns)
        log += [(now_ns, decided) for decided in decider.due(now_ns)]
    return log


def wall(points):
    """The half space x <= 0."""
    return points[:, 0].copy()


def moving_along_x(x_of_s):
    return lambda at_s: np.array([[x_of_s(at_s), 0.1, 0.2]])


# Prediction -------------------------------------------------------------------------------------------------------------


def test_constant_velocity_is_foreseen_exactly_but_for_the_damping_and_without_doubt_beyond_noise():
    velocity = np.array([0.4, -0.3, 0.1])
    parameters = PredictionParameters(damping_per_s=0.0)
    forecast, at_s = forecast_of(lambda s: (velocity * s)[None], parameters=parameters)
    ahead = np.array([0.0, 0.01, 0.03])
    assert forecast.path(ahead)[0] == pytest.approx((at_s + ahead)[:, None] * velocity, abs=1e-12)
    assert forecast.deviation(ahead)[0] == pytest.approx(parameters.noise_m * (1 + ahead / 0.009), rel=1e-6)


def test_a_common_acceleration_believed_in_full_is_foreseen_exactly():
    bend = np.array([3.0, -2.0, 1.0])
    start = np.arange(12.0).reshape(4, 3)
    parameters = PredictionParameters(damping_per_s=0.0, common_gain=1.0, own_gain=1.0)
    forecast, at_s = forecast_of(lambda s: start + 0.5 * bend * s**2, parameters=parameters)
    ahead = np.array([0.005, 0.04])
    true = start[:, None] + 0.5 * bend * ((at_s + ahead) ** 2)[:, None]
    assert forecast.path(ahead) == pytest.approx(true, abs=1e-10)


def test_what_all_points_do_is_believed_more_than_what_one_does():
    def one_of_four(at_s):
        place = np.zeros((4, 1))
        place[0] = at_s**2
        return place

    together, _ = forecast_of(lambda s: np.full((4, 1), s**2))
    alone, _ = forecast_of(one_of_four)
    p = PredictionParameters()
    assert together.acceleration_m_s2 == pytest.approx(2 * p.common_gain, rel=1e-9)
    assert alone.acceleration_m_s2[0, 0] == pytest.approx(2 * (0.75 * p.own_gain + 0.25 * p.common_gain), rel=1e-9)


def test_doubt_grows_with_the_horizon_and_with_unsteady_motion():
    steady, _ = forecast_of(lambda s: np.array([[0.5 * s, 0.0, 0.0]]))
    shaken, _ = forecast_of(lambda s: np.array([[0.5 * s + 0.005 * np.sin(60 * s), 0.0, 0.0]]))
    ahead = np.array([0.01, 0.02, 0.04])
    assert (np.diff(shaken.deviation(ahead)) > 0).all()
    assert (shaken.deviation(ahead) > 2 * steady.deviation(ahead)).all()


def test_reach_bounds_the_path():
    forecast, _ = forecast_of(lambda s: np.array([[np.sin(9 * s), np.cos(7 * s), s]]))
    ahead = np.linspace(0, 0.055, 30)
    moved = np.linalg.norm(forecast.path(ahead)[0] - forecast.position_m[0], axis=1)
    assert moved.max() <= forecast.reach_m(0.055)[0] + 1e-12


def test_few_frames_and_frames_after_a_gap_predict_nothing():
    predictor = Predictor()
    for i in range(3):
        forecast = predictor.observe(i * FRAME_NS, [[0.5 * i, 0.0, 0.0]])
        assert forecast.velocity_m_s == pytest.approx(0.0)
    for i in range(3, 12):
        forecast = predictor.observe(i * FRAME_NS, [[0.5 * i, 0.0, 0.0]])
    assert forecast.velocity_m_s[0, 0] > 1.0
    assert predictor.observe(12 * FRAME_NS + 60 * NS_PER_MS, [[0.0, 0.0, 0.0]]).velocity_m_s == pytest.approx(0.0)


def test_frames_half_a_millisecond_apart_do_not_blow_the_velocity_up():
    predictor, jitter = Predictor(), 0.1e-3
    times = [i * FRAME_NS for i in range(12)]
    times.append(times[-1] + NS_PER_MS // 2)
    for number, time_ns in enumerate(times):
        forecast = predictor.observe(time_ns, [[0.3 * time_ns / NS_PER_S + jitter * (number % 2)]])
    assert forecast.velocity_m_s[0, 0] == pytest.approx(0.3, abs=2 * jitter / 0.008)


def test_a_frame_that_is_not_later_changes_nothing_and_another_shape_is_refused():
    predictor = Predictor()
    assert predictor.observe(10, np.zeros((2, 3))) is not None
    assert predictor.observe(10, np.zeros((2, 3))) is None
    assert predictor.observe(9, np.zeros((2, 3))) is None
    with pytest.raises(InputError, match="shape"):
        predictor.observe(20, np.zeros((3, 3)))


def test_a_point_not_seen_does_not_spoil_the_others():
    with_hole, _ = forecast_of(lambda s: np.array([[s**2, 0.0], [np.nan, np.nan]]))
    alone, _ = forecast_of(lambda s: np.array([[s**2, 0.0]]))
    assert with_hole.acceleration_m_s2[0] == pytest.approx(alone.acceleration_m_s2[0])
    assert not np.isfinite(with_hole.velocity_m_s[1]).any()


@given(st.lists(st.integers(1, 60 * NS_PER_MS), min_size=1, max_size=60), st.integers(1, 4))
def test_any_spacing_of_frames_gives_a_finite_forecast(steps, points):
    predictor, time_ns = Predictor(), 0
    for step in steps:
        time_ns += step
        place = np.full((points, 3), time_ns / NS_PER_S)
        forecast = predictor.observe(time_ns, place)
        assert np.isfinite(forecast.path(np.array([0.0, 0.05]))).all()
        assert (forecast.deviation(np.array([0.0, 0.05])) > 0).all()


# Decision ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("latency_ms", [0, 10, 20])
@pytest.mark.parametrize("speed_m_s", [0.3, 1.0])
def test_a_steady_approach_acts_within_a_tick_and_the_doubt_of_the_touch(latency_ms, speed_m_s):
    decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
    place = moving_along_x(lambda s: 0.15 + RADIUS_M - speed_m_s * s)
    touch_ns = round(0.15 / speed_m_s * NS_PER_S)
    log = play(decider, range(0, NS_PER_S, FRAME_NS), place, touch_ns + 100 * NS_PER_MS, latency_ms * NS_PER_MS)
    assert [decided.begins for _, decided in log] == [True]
    error_ms = (log[0][0] + LEAD_NS - touch_ns) / NS_PER_MS
    # late by the tick, by q noise (1 + h/T) over speed, and by the damped k h^2 of velocity, h <= latency + lead + frame
    ahead_s = (latency_ms + 6 + 9) * 1e-3
    slack_ms = 1e3 * (0.4 * 0.12e-3 * (1 + ahead_s / 9e-3) / speed_m_s + 1.5 * ahead_s**2)
    assert -0.01 <= error_ms <= 1.0 + slack_ms


def test_a_tick_acts_at_the_first_tick_after_the_planned_time_and_names_the_aim():
    decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
    log = play(decider, range(0, NS_PER_S, FRAME_NS), moving_along_x(lambda s: 0.2 - s), 300 * NS_PER_MS)
    now_ns, decided = log[0]
    assert decided == Decided(0, 0, True, decided.aimed_ns)
    assert 0 <= now_ns + LEAD_NS - decided.aimed_ns < NS_PER_MS
    assert decider.touching.tolist() == [[True]]


def test_coming_to_rest_a_millimetre_short_is_no_touch():
    """Minimum-jerk reach of 200 mm in 0.4 s that ends 1 mm before the wall."""

    def reach(at_s):
        u = min(at_s / 0.4, 1.0)
        return RADIUS_M + 0.001 + 0.2 * (1 - u**3 * (10 - 15 * u + 6 * u * u))

    for latency_ms in (0, 10, 20):
        decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
        assert not play(decider, range(0, NS_PER_S, FRAME_NS), moving_along_x(reach), NS_PER_S, latency_ms * NS_PER_MS)


def test_hovering_in_noise_above_the_surface_does_not_chatter():
    rng = np.random.default_rng(0)
    decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
    place = moving_along_x(lambda s: RADIUS_M + 0.5e-3 * np.sin(8 * s) + 0.02e-3 * rng.standard_normal())
    log = play(decider, range(0, 4 * NS_PER_S, FRAME_NS), place, 4 * NS_PER_S, 10 * NS_PER_MS)
    begins = sum(decided.begins for _, decided in log)
    assert begins <= 6  # the sine goes in five times


def test_a_pin_never_turns_round_sooner_than_its_stroke():
    rng = np.random.default_rng(1)
    decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
    place = moving_along_x(lambda s: RADIUS_M + 2e-3 * rng.standard_normal())
    log = play(decider, range(0, 3 * NS_PER_S, FRAME_NS), place, 3 * NS_PER_S)
    assert len(log) > 4
    assert [decided.begins for _, decided in log] == [i % 2 == 0 for i in range(len(log))]
    assert np.diff([now for now, _ in log]).min() >= DecisionParameters().dwell_ns


def test_a_touch_ends_once_the_site_is_off():
    decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
    log = play(decider, range(0, NS_PER_S, FRAME_NS), moving_along_x(lambda s: RADIUS_M + 0.02 * np.cos(2 * np.pi * s)), NS_PER_S)
    (_, begun), (ended_ns, ended) = log
    assert (begun.begins, ended.begins) == (True, False)
    assert 750 <= ended_ns / NS_PER_MS <= 780  # off at 750 ms; a frame, 0.3 mm at 126 mm/s


def test_a_gap_in_the_frames_is_bridged_up_to_the_age_a_pose_may_have():
    touch_ns = 500 * NS_PER_MS
    for missing_ms, met in ((30, True), (120, False)):
        times = [t for t in range(0, NS_PER_S, FRAME_NS) if not touch_ns - missing_ms * NS_PER_MS < t <= touch_ns + 5 * NS_PER_MS]
        decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
        log = play(decider, times, moving_along_x(lambda s: RADIUS_M + 0.5 - s), touch_ns + 3 * NS_PER_MS)
        assert bool(log) is met


def test_sites_not_seen_and_poses_too_old_decide_nothing():
    decider = TouchDecider([wall], [RADIUS_M, RADIUS_M], LEAD_NS)
    lost = [[-0.1, 0.0, 0.0], [np.nan] * 3]
    decider.observe(0, lost, 60 * NS_PER_MS)
    assert decider.due(60 * NS_PER_MS) == []
    decider.observe(FRAME_NS, lost, FRAME_NS)
    assert [decided.site for decided in decider.due(FRAME_NS)] == [0]


def test_a_plan_dies_with_its_pose():
    touch_ns, exact = 500 * NS_PER_MS, PredictionParameters(damping_per_s=0.0, noise_m=0.0)
    for age_ms, met in ((49, True), (51, False)):
        times = [touch_ns - age_ms * NS_PER_MS - i * FRAME_NS for i in range(12, -1, -1)]
        decider = TouchDecider([wall], [RADIUS_M], lead_ns=0, prediction=exact)
        log = play(decider, times, moving_along_x(lambda s: RADIUS_M + 0.5 - s), touch_ns + 30 * NS_PER_MS)
        assert bool(log) is met


def test_a_pose_that_comes_too_old_decides_nothing():
    for age_ms, met in ((49, True), (51, False)):
        decider = TouchDecider([wall], [RADIUS_M], lead_ns=0)
        decider.observe(0, [[-0.1, 0.0, 0.0]], 0)
        assert [decided.begins for decided in decider.due(0)] == [True]
        later_ns = FRAME_NS + age_ms * NS_PER_MS
        decider.observe(FRAME_NS, [[0.1, 0.0, 0.0]], later_ns)
        assert bool(decider.due(later_ns)) is met


def test_forgetting_takes_back_every_touch_and_plan():
    decider = TouchDecider([wall], [RADIUS_M], LEAD_NS)
    decider.observe(0, [[-0.1, 0.0, 0.0]], 0)
    assert len(decider.due(0)) == 1
    decider.observe(FRAME_NS, [[-0.1, 0.0, 0.0]], FRAME_NS)
    decider.forget()
    assert not decider.touching.any()
    assert decider.due(NS_PER_S) == []


def test_far_objects_are_asked_again_in_time_to_be_touched():
    asked = []

    def far_wall(points):
        asked.append(len(points))
        return wall(points)

    decider = TouchDecider([far_wall], [RADIUS_M], LEAD_NS)
    log = play(decider, range(0, NS_PER_S, FRAME_NS), moving_along_x(lambda s: 2.0 + RADIUS_M - 4.0 * s), 600 * NS_PER_MS)
    assert len(asked) < 45  # of the 67 frames
    assert abs(log[0][0] + LEAD_NS - 500 * NS_PER_MS) <= 2 * NS_PER_MS


def test_a_scalar_condition_is_foreseen_like_a_touch():
    decider = TouchDecider([lambda signal: signal[:, 0] - 0.005], [0.0], LEAD_NS)
    log = play(decider, range(0, NS_PER_S, FRAME_NS), lambda s: np.array([[0.1 - 0.25 * s]]), 500 * NS_PER_MS)
    assert log[0][0] + LEAD_NS == pytest.approx(380 * NS_PER_MS, abs=2 * NS_PER_MS)


def test_the_rule_waits_while_the_touch_is_not_sure():
    ahead = np.arange(0.006, 0.055, 2.5e-3)
    distance = 0.004 - 0.3 * ahead[None]
    sure = touch_ahead(ahead, distance, np.full_like(distance, 0.1e-3), np.array([0.004]), DecisionParameters())
    assert sure[0] == pytest.approx((0.004 + 0.4 * 0.1e-3) / 0.3, abs=1e-9)
    unsure = touch_ahead(ahead, distance, np.full_like(distance, 20e-3), np.array([0.004]), DecisionParameters())
    assert np.isnan(unsure[0])
    inside = touch_ahead(ahead, distance - 0.01, np.full_like(distance, 20e-3), np.array([-0.006]), DecisionParameters())
    assert inside[0] == ahead[0]


@pytest.mark.parametrize("bad", [dict(radius_m=[-1.0], lead_ns=0), dict(radius_m=[0.0], lead_ns=-1)])
def test_impossible_arguments_are_refused(bad):
    with pytest.raises(InputError, match=r"must be|allowed|expected"):
        TouchDecider([wall], **bad)

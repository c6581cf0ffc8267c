"""Objects that move: a carried ball is touched in its own frame, and handing it over loses no touch."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.rendering.touch_ahead import TouchAhead
from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Placed, Sphere
from haptics.time import NS_PER_MS, NS_PER_S

FRAME_NS = 9 * NS_PER_MS
RADIUS_M = np.array([0.007])
REST_M = np.array([0.036, 0.0, 0.0])
"""Where a finger rests on the ball, 1 mm inside."""


def leaving_m(frame: int) -> np.ndarray:
    """How far a finger has got after so many frames at 0.2 m/s."""
    return np.array([0.2 * frame * FRAME_NS / NS_PER_S, 0.0, 0.0])


class Ball:
    """A ball of 30 mm radius, a fingertip, and what was decided."""

    def __init__(self, flying: bool = False):
        self.at = np.zeros(3)
        self.ahead = TouchAhead(self.body, ["ball"], ["ball"] if flying else [], RADIUS_M, 6_000_000, 6_000_000, 50_000_000)
        self.now_ns = 0
        self.decided: list[tuple[float, bool]] = []

    def body(self, _: str) -> Placed:
        return Placed(Sphere(0.03), Pose(tuple(self.at.tolist()), (0.0, 0.0, 0.0, 1.0)))

    def pose(self, tip: np.ndarray, held: bool = False) -> None:
        self.ahead.observe(self.now_ns, tip[None], self.now_ns, "ball" if held else None)
        for tick_ns in range(self.now_ns, self.now_ns + FRAME_NS, NS_PER_MS):
            self.decided += [(d.aimed_ns / NS_PER_S, d.begins) for _, d in self.ahead.due(tick_ns)]
        self.now_ns += FRAME_NS


def test_a_finger_that_carries_a_ball_keeps_touching_it_however_the_hand_moves():
    ball = Ball()
    for i in range(20):  # comes at 0.2 m/s and rests 1 mm inside
        ball.pose(np.array([max(0.036, 0.07 - 0.2 * i * FRAME_NS / NS_PER_S), 0.0, 0.0]))
    for i in range(60):  # swings ball and finger together at up to 1.5 m/s
        ball.at = np.array([0.0, 0.15 * np.sin(10 * i * FRAME_NS / NS_PER_S), 0.0])
        ball.pose(ball.at + REST_M, held=True)
    for _ in range(10):  # let go, and rests on
        ball.pose(ball.at + REST_M)
    assert [begins for _, begins in ball.decided] == [True]


def test_a_finger_that_leaves_a_carried_ball_is_seen_to_leave_it_also_after_it_was_let_go():
    ball = Ball()
    for i in range(20):
        ball.pose(np.array([max(0.036, 0.07 - 0.2 * i * FRAME_NS / NS_PER_S), 0.0, 0.0]))
    for i in range(20):
        ball.at = np.array([0.0, 0.3 * i * FRAME_NS / NS_PER_S, 0.0])
        ball.pose(ball.at + REST_M, held=True)
    for i in range(20):
        ball.pose(ball.at + REST_M + leaving_m(i))
    assert [begins for _, begins in ball.decided] == [True, False]


def test_a_finger_that_leaves_while_another_hand_keeps_the_ball_leaves_once():
    ball = Ball()
    for i in range(20):
        ball.pose(np.array([max(0.036, 0.07 - 0.2 * i * FRAME_NS / NS_PER_S), 0.0, 0.0]))
    for i in range(20):
        ball.at = np.array([0.0, 0.3 * i * FRAME_NS / NS_PER_S, 0.0])
        ball.pose(ball.at + REST_M + leaving_m(max(0, i - 5)), held=True)
    for _ in range(10):
        ball.pose(ball.at + REST_M + leaving_m(14))
    assert [begins for _, begins in ball.decided] == [True, False]


@pytest.mark.parametrize("speed_m_s", [0.5, 2.0])
def test_a_ball_that_flies_at_a_resting_finger_is_foreseen(speed_m_s):
    ball = Ball(flying=True)
    while ball.now_ns < 0.5 * NS_PER_S:
        ball.at = np.array([0.5 * speed_m_s * 0.8 - speed_m_s * ball.now_ns / NS_PER_S, 0.0, 0.0])
        ball.pose(np.zeros(3))
    meets_s = (0.5 * 0.8 * speed_m_s - 0.037) / speed_m_s
    begins = [at_s for at_s, begins in ball.decided if begins]
    assert begins[0] == pytest.approx(meets_s, abs=2e-3)  # constant speed: exact but for the doubt of a still tracker's noise

"""The shipped hand goes through the poses that calibrate a hand: flat, a fist, the thumb on each fingertip.

It is the hand of ``haptics.scene.hands.synthetic``, moved by the same minimum-jerk steps. Where two tips touch, their joints are
14 mm apart: two spheres of the nominal 7 mm.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from haptics.scene.hands.bones import orientations
from haptics.scene.hands.joints import FINGERS
from haptics.scene.hands.recording import HandRecording, HandTrack
from haptics.scene.hands.synthetic import minimum_jerk, skeleton
from haptics.time import NS_PER_S, seconds_to_ns

NAME = "routine"
MOVE_S, HOLD_S = 0.6, 1.2
RATE_HZ = 110.0
NOISE_M = 0.02e-3
"""A recorded fingertip at rest has as much."""
_PALM_M = (0.0, 0.2, -0.1)

# Headings as in ``haptics.scene.hands.synthetic``: degrees to the little finger's side, and degrees of bend.
_THUMB_REST = ((-40, 28), (-32, 28), (-26, 26))
_FLAT = {
    "thumb": _THUMB_REST,
    "index": ((-3, 4), (-3, 12), (-3, 18)),
    "middle": ((0, 4), (0, 12), (0, 18)),
    "ring": ((3, 5), (3, 13), (3, 19)),
    "little": ((7, 6), (7, 14), (7, 20)),
}
_FIST = {
    "thumb": ((-20, 45), (15, 50), (35, 50)),
    "index": ((-3, 75), (-3, 165), (-3, 215)),
    "middle": ((0, 75), (0, 165), (0, 215)),
    "ring": ((3, 75), (3, 165), (3, 215)),
    "little": ((7, 75), (7, 165), (7, 215)),
}
_TOUCHES = (
    {"thumb": ((-17.4, 36.4), (-6.3, 41.8), (2.2, 45.0)), "index": ((-2.7, 48.0), (-2.7, 98.4), (-2.7, 128.6))},
    {"thumb": ((-1.3, 36.7), (7.3, 41.8), (12.3, 43.8)), "middle": ((-3.8, 51.8), (-3.8, 103.5), (-3.8, 134.5))},
    {"thumb": ((15.3, 33.1), (19.6, 40.3), (22.8, 41.2)), "ring": ((-5.7, 45.5), (-5.7, 97.8), (-5.7, 129.2))},
    {"thumb": ((28.6, 23.6), (33.8, 34.4), (28.7, 41.9)), "little": ((-9.2, 28.9), (-9.2, 80.8), (-9.2, 111.9))},
)
"""Found by least squares, so that the tips come to 14 mm (within 0.1 mm) and the other fingers stay away."""


def synthetic_routine(seed: int = 0) -> HandRecording:
    """The poses of the routine, one after another, each held for 1.2 s.

    :param seed: of the noise; 0 or more.
    :return: one track of a right hand, 11 s; time zero is its first frame.
    """
    poses = [_headings(pose) for pose in (_FLAT, _FIST, *({**_FLAT, **touch} for touch in _TOUCHES))]
    time_s = np.arange(0.0, len(poses) * (MOVE_S + HOLD_S), 1.0 / RATE_HZ)
    heading_deg = np.broadcast_to(poses[0], (len(time_s), 5, 3, 2)).copy()
    for step, pose in enumerate(poses):
        done = minimum_jerk((time_s - step * (MOVE_S + HOLD_S)) / MOVE_S)
        heading_deg += done[:, None, None, None] * (pose - heading_deg)
    position_m, forward, dorsal = skeleton(heading_deg, np.broadcast_to(_PALM_M, (len(time_s), 3)))
    position_m = position_m + NOISE_M * np.random.default_rng(seed).standard_normal(position_m.shape)
    time_ns = np.array([seconds_to_ns(time) for time in time_s], np.int64)
    track = HandTrack("right", 0, time_ns, position_m, orientations(position_m, forward, dorsal, "right"))
    return HandRecording(NAME, (track,), len(time_ns), float(time_ns[-1]) / NS_PER_S)


def _headings(pose: Mapping[str, tuple[tuple[float, float], ...]]) -> np.ndarray:
    return np.array([pose[finger] for finger in FINGERS], float)

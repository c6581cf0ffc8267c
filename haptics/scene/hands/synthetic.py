"""A right hand that reaches, grasps, lets go and taps: the motion that ships, computed.

A skeleton of fixed bone lengths is moved from pose to pose by minimum-jerk steps, ``s(u) = 10 u^3 - 15 u^4 + 6 u^5``, as
hands do between two points (Flash and Hogan 1985). Thumb and index close from about 100 to 30 mm around the place reached
for, which is a closing stroke (``haptics.scene.placement``); later the four fingertips tap, one after the other. The frames
come as a tracker's do: unevenly, and with a little noise.

Bone lengths are means of adults (after Buryanov and Kotiuk 2010); where the bones begin, and the angles, are assumed.
"""

from __future__ import annotations

import numpy as np

from haptics.scene.hands.bones import orientations
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import FINGERS, JOINT
from haptics.scene.hands.recording import HandRecording, HandTrack
from haptics.time import NS_PER_S, seconds_to_ns
from haptics.units import in_range

NAME = "synthetic"
NATURAL_DURATION_S = 4.0
MIN_INTERVAL_SHARE = 0.05
"""However it jitters, a frame follows the one before by at least this share of the nominal interval."""

# In the palm's axes, millimetres, right hand: +x to the little finger, +y out of the back, +z to the wrist.
_WRIST_MM = (0.0, 0.0, 50.0)
_METACARPAL_MM = ((-22, -6, 32), (-12, 0, 30), (-2, 2, 29), (8, 1, 29), (17, -1, 30))
_KNUCKLE_MM = ((-24, 2, -34), (-2, 4, -36), (18, 2, -30), (36, -3, -22))
_BONE_MM = np.array([[46.2, 31.6, 21.7], [39.8, 22.4, 15.8], [44.6, 26.3, 17.4], [41.4, 25.7, 17.3], [32.7, 18.1, 16.0]])

# A pose gives each bone's heading: degrees to the little finger's side, and degrees of bend, both from the palm's axes.
# Thumb: metacarpal, proximal, distal; fingers: one spread, then the bends of the three bones.
_THUMB_OPEN, _THUMB_CLOSED, _THUMB_REST = (
    ((-51, 20), (-49, 18), (-45, 16)),
    ((-26, 40), (-12, 42), (0, 40)),
    ((-40, 28), (-32, 28), (-26, 26)),
)
_POSES = {
    "rest": (_THUMB_REST, (-3, 18, 34, 44), (0, 20, 38, 48), (3, 22, 40, 50), (7, 24, 42, 52)),
    "open": (_THUMB_OPEN, (-5, 8, 22, 30), (0, 8, 20, 28), (6, 10, 22, 30), (14, 12, 24, 32)),
    "flat": (_THUMB_REST, (-3, 4, 12, 18), (0, 4, 12, 18), (3, 5, 13, 19), (7, 6, 14, 20)),
    "closed": (_THUMB_CLOSED, (-5, 43, 80, 98), (0, 46, 84, 104), (3, 50, 90, 112), (7, 52, 94, 116)),
}
_TAP_BEND_DEG = 22.0

# From when to when (seconds of the natural duration), to which pose, with the palm where (metres).
_START_M = (0.05, 0.14, 0.12)
_STEPS = (
    (0.20, 1.00, "open", (0.0, 0.20, -0.10)),  # reach
    (1.10, 1.60, "closed", (0.0, 0.20, -0.10)),  # grasp
    (1.95, 2.35, "open", (0.0, 0.20, -0.10)),  # let go
    (2.35, 2.75, "flat", (0.0, 0.24, -0.04)),  # draw back
)
_TAPS = ((2.85, "index"), (3.09, "middle"), (3.33, "ring"), (3.57, "little"))
_TAP_S = 0.24
_PALM_DOWN_DEG = 15.0


def synthetic_hand(
    seed: int = 0,
    duration_s: float = NATURAL_DURATION_S,
    rate_hz: float = 110.0,
    jitter_s: float = 0.2e-3,
    noise_m: float = 0.02e-3,
) -> HandRecording:
    """The motion of one right hand, the same for the same arguments.

    :param seed: of jitter and noise; 0 or more.
    :param duration_s: 1 to 60 s; the motion is stretched to it.
    :param rate_hz: mean frame rate, 10 to 1000 Hz.
    :param jitter_s: standard deviation of the interval between frames, 0 to 10 ms.
    :param noise_m: standard deviation of each joint along each axis, 0 to 10 mm; a recorded fingertip at rest has 0.02 mm.
    :return: one track; time zero is its first frame.
    :raises InputError: an argument out of range.
    """
    in_range("duration_s", duration_s, 1.0, 60.0, "s")
    in_range("rate_hz", rate_hz, 10.0, 1000.0, "Hz")
    in_range("jitter_s", jitter_s, 0.0, 0.01, "s")
    in_range("noise_m", noise_m, 0.0, 0.01, "m")
    rng = np.random.default_rng(seed)
    interval_s = 1.0 / rate_hz
    steps_s = interval_s + jitter_s * rng.standard_normal(int(duration_s * rate_hz))
    time_s = np.concatenate([[0.0], np.cumsum(np.maximum(steps_s, MIN_INTERVAL_SHARE * interval_s))])
    time_s = time_s[time_s <= duration_s]
    time_ns = np.array([seconds_to_ns(time) for time in time_s], np.int64)

    position_m, forward, dorsal = _skeleton(time_s * (NATURAL_DURATION_S / duration_s))
    position_m = position_m + noise_m * rng.standard_normal(position_m.shape)
    track = HandTrack("right", 0, time_ns, position_m, orientations(position_m, forward, dorsal, "right"))
    return HandRecording(NAME, (track,), len(time_ns), float(time_ns[-1]) / NS_PER_S)


def minimum_jerk(share: Floats) -> Floats:
    """Progress of a movement, ``10 u³ − 15 u⁴ + 6 u⁵``; rests before and after.

    :param share: ``u``, of the time; below 0 and above 1 it is taken as 0 and 1.
    :return: of the same shape, 0 to 1.
    """
    u = np.clip(share, 0.0, 1.0)
    return u**3 * (10.0 + u * (6.0 * u - 15.0))


def _skeleton(time_s: Floats) -> tuple[Floats, Floats, Floats]:
    """Joints (n, 26, 3) in metres, and the palm's forward and dorsal directions (n, 3), at moments of the natural motion."""
    heading_deg = np.broadcast_to(_headings("rest"), (len(time_s), 5, 3, 2)).copy()
    palm_m = np.broadcast_to(_START_M, (len(time_s), 3)).copy()
    for start_s, end_s, pose, place_m in _STEPS:
        done = minimum_jerk((time_s - start_s) / (end_s - start_s))
        heading_deg += done[:, None, None, None] * (_headings(pose) - heading_deg)
        palm_m += done[:, None] * (place_m - palm_m)
    for start_s, finger in _TAPS:
        there = minimum_jerk((time_s - start_s) / (_TAP_S / 2)) - minimum_jerk((time_s - start_s) / (_TAP_S / 2) - 1.0)
        heading_deg[:, FINGERS.index(finger), :, 1] += _TAP_BEND_DEG * there[:, None]

    return skeleton(heading_deg, palm_m)


def skeleton(heading_deg: Floats, palm_m: Floats) -> tuple[Floats, Floats, Floats]:
    """The joints of the hand that ships, from the headings of its bones.

    :param heading_deg: (n, 5, 3, 2), of the three outer bones of each finger from the thumb on: degrees to the little finger's
        side, and degrees of bend, both from the palm's axes.
    :param palm_m: (n, 3), where the palm is, metres.
    :return: joints (n, 26, 3), metres, and the palm's forward and dorsal directions, (n, 3) each.
    """
    aside, bend = np.deg2rad(heading_deg[..., 0]), np.deg2rad(heading_deg[..., 1])
    heading = np.stack([np.sin(aside) * np.cos(bend), -np.sin(bend), -np.cos(aside) * np.cos(bend)], axis=-1)
    reach_mm = np.cumsum(heading * _BONE_MM[..., None], axis=2)

    local_mm = np.zeros((len(palm_m), 26, 3))
    local_mm[:, JOINT["wrist"]] = _WRIST_MM
    for finger, name in enumerate(FINGERS):
        tip, base_mm = JOINT[f"{name}_tip"], np.array(_METACARPAL_MM[finger], float)
        local_mm[:, JOINT[f"{name}_metacarpal"]] = base_mm
        if finger > 0:
            base_mm = np.array(_KNUCKLE_MM[finger - 1], float)
            local_mm[:, tip - 3] = base_mm
        local_mm[:, tip - 2 : tip + 1] = base_mm + reach_mm[:, finger]

    down = np.deg2rad(_PALM_DOWN_DEG)
    palm = np.array([[1, 0, 0], [0, np.cos(down), np.sin(down)], [0, -np.sin(down), np.cos(down)]])
    position_m = palm_m[:, None] + 1e-3 * local_mm @ palm.T
    shape = (len(palm_m), 3)
    return position_m, np.broadcast_to(-palm[:, 2], shape), np.broadcast_to(palm[:, 1], shape)


def _headings(pose: str) -> Floats:
    """A pose as (finger, bone, aside and bend), degrees."""
    thumb, *fingers = _POSES[pose]
    return np.array([thumb, *([(aside, bend) for bend in bends] for aside, *bends in fingers)], float)

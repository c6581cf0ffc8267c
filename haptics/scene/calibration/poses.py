"""The poses that calibrate a hand, and what is still wrong with one that is not there yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from haptics.scene.calibration.measures import stretch, thumb_to
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import FINGERS

FLAT_STRETCH = 0.92
"""All four fingers are stretched at least so far in a flat hand (assumed; flat hands: 0.96 to 0.99, those at ease: 0.94)."""
FIST_STRETCH = 0.65
"""And at most so far in a fist (assumed; around a ball: 0.75 to 0.81)."""
NEAREST_TOUCH_M, WIDEST_TOUCH_M = 0.006, 0.028
"""Two tips that touch are so far apart, joint to joint (assumed: two spheres of 3 to 14 mm)."""


@dataclass(frozen=True, slots=True)
class CalibrationPose:
    """A pose of the routine.

    :param name: such as ``fist``.
    :param instruction: what a person is asked to do, in a sentence.
    :param fault: from a pose's joints, (26, 3) in metres, to what is wrong with it, in words, or None.
    :param finger: that the thumb touches; None where it touches none.
    """

    name: str
    instruction: str
    fault: Callable[[Floats], str | None]
    finger: str | None = None


def _flat(position_m: Floats) -> str | None:
    return _stretched(position_m, lambda share: share >= FLAT_STRETCH, f"is not flat; expected {FLAT_STRETCH:.0%} or more")


def _fist(position_m: Floats) -> str | None:
    return _stretched(position_m, lambda share: share <= FIST_STRETCH, f"is not in a fist; expected {FIST_STRETCH:.0%} or less")


def _stretched(position_m: Floats, right: Callable[[float], bool], words: str) -> str | None:
    for finger in FINGERS[1:]:
        share = stretch(position_m, finger)
        if not right(share):
            return f"the {finger} finger is stretched to {share:.0%}: it {words}"
    return None


def _touch(finger: str, position_m: Floats) -> str | None:
    apart_m = {other: float(np.linalg.norm(thumb_to(position_m, other))) for other in FINGERS[1:]}
    nearest = min(apart_m, key=lambda other: apart_m[other])
    if nearest != finger:
        return f"the thumb is nearer to the {nearest} finger than to the {finger} finger"
    if apart_m[finger] > WIDEST_TOUCH_M:
        return (
            f"thumb and {finger} finger do not touch: their tips are {1e3 * apart_m[finger]:.0f} mm apart; "
            f"expected {1e3 * WIDEST_TOUCH_M:.0f} mm or less"
        )
    if apart_m[finger] < NEAREST_TOUCH_M:
        return (
            f"the tips of thumb and {finger} finger are {1e3 * apart_m[finger]:.1f} mm apart, less than fingertips are thick; "
            f"expected {1e3 * NEAREST_TOUCH_M:.0f} mm or more: press less, or turn the hand so that the tracker sees both"
        )
    return None


POSES: tuple[CalibrationPose, ...] = (
    CalibrationPose("flat", "Hold your hand out flat, all fingers stretched, and keep it still.", _flat),
    CalibrationPose("fist", "Make a fist, and keep it still.", _fist),
    *(
        CalibrationPose(
            f"thumb_to_{finger}",
            f"Touch the tip of your {finger} finger lightly with the tip of your thumb, and keep still.",
            partial(_touch, finger),
            finger,
        )
        for finger in FINGERS[1:]
    ),
)
"""In the order of the routine."""

"""What poses that were held still say of a hand: lengths of its bones, sizes of its fingertips."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from haptics.scene.calibration.measures import BONES, SHORTEST_BONE_M, bone_lengths
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import FINGERS
from haptics.scene.sites import TIP_RADIUS_M

HAND_SD_M, TIP_SD_M = 0.0015, 0.0015
"""How far people's fingertips are from the nominal radius, as standard deviations: all five of a hand together, as large hands
have large tips, and each by itself. A weak guess before any touch (assumed)."""
TOUCH_SD_M = 0.001
"""How far two tips that touch are from two spheres that do: pads give way, and are no spheres (assumed)."""
SAME_BONE = 0.10
"""A bone whose length differs by a larger share between poses is not one bone (assumed)."""
_NORMAL = 1.4826  # the standard deviation of a normal spread, in median deviations from its median


def bones(position_m: Floats) -> tuple[Floats, Floats]:
    """Lengths of the bones over frames of a still hand.

    :param position_m: (n, 26, 3), metres, one frame or more.
    :return: their medians, and the standard deviation of a single frame, which outliers do not move: (19,) each, metres.
    """
    length_m = bone_lengths(position_m)
    median_m = np.median(length_m, axis=0)
    return median_m, _NORMAL * np.median(np.abs(length_m - median_m), axis=0)


def contradictions(held_m: Mapping[str, Floats]) -> list[str]:
    """Poses that cannot be of one hand, as its bones change.

    :param held_m: frames of each pose, (n, 26, 3), metres, by the pose's name.
    :return: a sentence on the bone that changes most, if it changes by more than ``SAME_BONE``; else nothing.
    """
    names = list(held_m)
    length_m = np.array([np.median(bone_lengths(position_m), axis=0) for position_m in held_m.values()])
    middle_m = np.median(length_m, axis=0)
    share = np.where(middle_m > SHORTEST_BONE_M, np.ptp(length_m, axis=0) / np.maximum(middle_m, SHORTEST_BONE_M), 0.0)
    worst = int(share.argmax())
    if share[worst] <= SAME_BONE:
        return []
    low, high = int(length_m[:, worst].argmin()), int(length_m[:, worst].argmax())
    return [
        f"the poses contradict each other: the bone {BONES[worst]} is {1e3 * length_m[low, worst]:.1f} mm in {names[low]} and "
        f"{1e3 * length_m[high, worst]:.1f} mm in {names[high]}; {np.count_nonzero(share > SAME_BONE)} of {len(BONES)} bones "
        f"change by more than {SAME_BONE:.0%}"
    ]


def tip_radii(touch_m: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Radii of the fingertips from where the thumb's touches the others: ``|v_f| = r_thumb + r_f``.

    Four equations and five unknowns, so a weak guess joins in: radii are nominal but for what a hand as a whole (``HAND_SD_M``)
    and each tip (``TIP_SD_M``) deviate, with covariance ``P``. What fits both best, in least squares, is
    ``r = r_0 + C A' S⁻¹ (d - A r_0)`` with ``C = (A' S⁻¹ A + P⁻¹)⁻¹``, the covariance of the result; ``A`` adds thumb and finger,
    and ``S`` is the variance of a touch: ``TOUCH_SD_M`` and noise. What the thumb gains, all others lose.

    :param touch_m: from the thumb's tip joint to the finger's in each frame of their touch, (n, 3), metres, by finger; all four.
    :return: radii, and their standard deviations: (5,) each, metres, in the order of ``FINGERS``.
    """
    sums = np.array([[1.0, *(float(other == finger) for other in FINGERS[1:])] for finger in FINGERS[1:]])
    apart_m, variance_m2 = np.empty(4), np.empty(4)
    for row, finger in enumerate(FINGERS[1:]):
        vectors = touch_m[finger]  # averaged before their length is taken, which noise makes longer
        apart_m[row] = np.linalg.norm(vectors.mean(axis=0))
        variance_m2[row] = TOUCH_SD_M**2 + vectors.var(axis=0).mean() / len(vectors)
    guess_m, guess_m2 = np.full(5, TIP_RADIUS_M), np.full((5, 5), HAND_SD_M**2) + TIP_SD_M**2 * np.eye(5)
    weighted = sums.T / variance_m2
    covariance_m2 = np.linalg.inv(weighted @ sums + np.linalg.inv(guess_m2))
    return guess_m + covariance_m2 @ weighted @ (apart_m - sums @ guess_m), np.sqrt(np.diag(covariance_m2))

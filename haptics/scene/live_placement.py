"""Placing a scene by a hand that is there now, with no recording to look ahead in.

Objects at the palm are placed where it is. An object in the hand lies where thumb and index meet when they close: they have to be
open, and it is as wide as ``SPAN_SHARE`` of their distance. Where there is a recording, ``haptics.scene.placement`` places by the
stroke itself; here that is guessed from the open hand. In five recorded strokes of four hands the guess, made without the hand
that it is for, was off by 17 to 32 mm (the middle between the open tips by 25 to 50 mm).
"""

from __future__ import annotations

from collections import deque

import numpy as np

from haptics.errors import InputError
from haptics.scene.geometry.pose import Pose
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.joints import JOINT
from haptics.scene.placement import InHand, Stroke
from haptics.scene.scene import Scene
from haptics.scene.sites import TIP_RADIUS_M
from haptics.time import NS_PER_MS

STILL_NS = 500 * NS_PER_MS
STILL_M = 0.01
"""A palm that stays within this of its mean for half a second is still (assumed)."""
OPEN_M = 0.06
"""Thumb and index this far apart or farther are open (assumed): less leaves no room to close by 50 mm."""
SPAN_SHARE = 0.6
"""Of five recorded strokes the object is met at 0.54 to 0.67 of the widest distance."""
ALONG = 0.68
"""Where the tips meet an object, as a share of the way from thumb to index (fitted to the same strokes)."""
PALMAR_M = 0.025
"""And so far below it, out of the palm (likewise)."""
_PALM, _THUMB, _INDEX = JOINT["palm"], JOINT["thumb_tip"], JOINT["index_tip"]


class LivePlacement:
    """Waits for a hand that is still.

    :param scene: with objects that have no place yet.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        self._palms: deque[tuple[int, np.ndarray]] = deque()
        self._in_hand = any(not item.resolved and item.placement == "in_hand" for item in scene.objects)

    @property
    def waits_for(self) -> str:
        """What a person has to do, in words."""
        how = "open, and still for half a second" if self._in_hand else "still for half a second"
        return f"hold the hand {how}: the scene is placed by it"

    def observe(self, frame: HandFrame) -> Scene | None:
        """Look at a pose.

        :param frame: of the hand that wears the glove; times increase.
        :return: the placed scene, once the hand was still for half a second, and open where an object is to be in it.
        """
        palms = self._palms
        palms.append((frame.time_ns, frame.position_m[_PALM]))
        while len(palms) > 2 and frame.time_ns - palms[1][0] >= STILL_NS:
            palms.popleft()
        if frame.time_ns - palms[0][0] < STILL_NS:
            return None
        seen = np.array([palm for _, palm in palms])
        if np.linalg.norm(seen - seen.mean(axis=0), axis=1).max() > STILL_M:
            return None
        return None if self._in_hand and _opening_m(frame) < OPEN_M else self.place(frame)

    def forget(self) -> None:
        """The hand is gone."""
        self._palms.clear()

    def place(self, frame: HandFrame) -> Scene:
        """The scene by one pose, still or not.

        :param frame: of the hand that wears the glove.
        :return: the placed scene.
        :raises InputError: an object is to be in the hand, which is not open.
        """
        if self._in_hand and _opening_m(frame) < OPEN_M:
            raise InputError(
                f"thumb and index are {_opening_m(frame) * 1e3:.0f} mm apart; open them by {OPEN_M * 1e3:.0f} mm or more to place"
                " an object between them"
            )
        return self._scene.placed(frame.position_m[_PALM], _between(frame) if self._in_hand else None, frame.side)


def _opening_m(frame: HandFrame) -> float:
    return float(np.linalg.norm(frame.position_m[_INDEX] - frame.position_m[_THUMB]))


def _between(frame: HandFrame) -> InHand:
    thumb, index = frame.position_m[_THUMB], frame.position_m[_INDEX]
    wide_m = _opening_m(frame)
    span_m = SPAN_SHARE * wide_m
    closing = Stroke(frame.time_ns, frame.time_ns, wide_m, (2.0 * SPAN_SHARE - 1.0) * wide_m)
    axis = (index - thumb) / wide_m
    down = Pose((0.0, 0.0, 0.0), tuple(frame.orientation_xyzw[_PALM].tolist())).rotation @ (0.0, -1.0, 0.0)
    centre = thumb + ALONG * (index - thumb) + PALMAR_M * down
    return InHand(centre, axis, span_m / 2 - TIP_RADIUS_M, span_m, frame.time_ns, frame.track_id, closing)

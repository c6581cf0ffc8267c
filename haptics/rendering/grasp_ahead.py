"""Closing the brakes for a grasp before the tracked hand shows it.

A brake takes tens of milliseconds to hold, and a tracker reports late. The geometric condition of a grasp, both tips within
5 mm of an object, is one number that falls through zero; it is forecast and decided like a touch
(``haptics.rendering.decision``). Whether there was a grasp stays with the grasp rule: where it does not follow, the brakes
open again.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from haptics.rendering.body_decider import BodyDecider
from haptics.rendering.decision import Distance, TouchDecider
from haptics.rendering.pose_kernel import FAR, PRESENT
from haptics.scene.geometry.packed import packable
from haptics.scene.grasp import GraspTracker, between
from haptics.time import NS_PER_MS

WITHDRAW_NS = 60 * NS_PER_MS
"""A grasp that was acted for and has not begun this long after it should have is given up (assumed)."""
FAR_M = 1.0


class Due(NamedTuple):
    """A grasp that is to be acted for now.

    :param object: name of the object to close for.
    :param aimed_ns: when the grasp is expected, ns.
    """

    object: str
    aimed_ns: int


class GraspAhead:
    """Decides when to close for the graspable objects of one tracker.

    :param tracker: the grasp rule in play; asked where its objects are and whether they can be grasped now.
    :param names: of its objects.
    :param lead_ns: from sending the command until the brakes hold half of what they will.
    :param stale_ns: a pose older than this is not forecast from.
    """

    def __init__(self, tracker: GraspTracker, names: Sequence[str], lead_ns: int, stale_ns: int):
        self._tracker, self._names = tracker, tuple(names)
        bodies = [tracker.body(name) for name in self._names]
        self._decider: TouchDecider
        if all(packable(body.shape) for body in bodies):
            within_m = tracker.rule.tip_radius_m + tracker.rule.band_m
            self._decider = BodyDecider(bodies, [within_m], lead_ns, stale_ns=stale_ns, points=2)
        else:
            self._decider = TouchDecider([self._signal(name) for name in self._names], [0.0], lead_ns, stale_ns=stale_ns)
        self._tips = np.zeros((2, 3))
        self._closed_for: str | None = None
        self._give_up_ns = 0

    def observe(self, time_ns: int, thumb_m: np.ndarray, index_m: np.ndarray, now_ns: int) -> None:
        """Plan from a pose.

        :param time_ns: when it was sampled.
        :param thumb_m: centres of the two tips, (3,), metres.
        :param index_m: likewise, with ``thumb_m``.
        :param now_ns: when it arrived.
        """
        self._tips = np.stack([thumb_m, index_m])
        if isinstance(self._decider, BodyDecider):
            tracker = self._tracker
            for index, name in enumerate(self._names):
                free = tracker.held is None and tracker.armed(name)
                self._decider.put(index, tracker.body(name), PRESENT if free else FAR)
        self._decider.observe(time_ns, self._tips.reshape(1, 6), now_ns)

    def adopt(self, other: GraspAhead, names: Collection[str]) -> None:
        """Take over what brakes are closed for, of objects that are the same in both.

        :param other: stays as it is.
        :param names: objects of both.
        """
        if other._closed_for in names:
            self._closed_for, self._give_up_ns = other._closed_for, other._give_up_ns

    def due(self, now_ns: int) -> Due | None:
        """Decide whether to close now.

        :param now_ns: the tick's time.
        :return: the object to close for, and when the grasp is expected; or None.
        """
        for decided in self._decider.due(now_ns):
            name = self._names[decided.object]
            free = self._closed_for is None and self._tracker.held is None
            if decided.begins and free and between(self._tracker.body(name), *self._tips):
                self._closed_for, self._give_up_ns = name, decided.aimed_ns + WITHDRAW_NS
                return Due(name, decided.aimed_ns)
        return None

    def confirm(self, name: str) -> bool:
        """Take note that a grasp has begun.

        :param name: the grasped object.
        :return: whether the brakes are closed for it already.
        """
        ahead, self._closed_for = self._closed_for == name, None
        return ahead

    def withdraw(self, now_ns: int) -> bool:
        """Give up a grasp that was acted for and did not come.

        :param now_ns: the tick's time.
        :return: whether the brakes are to open now.
        """
        if self._closed_for is None or now_ns < self._give_up_ns:
            return False
        self._closed_for = None
        return True

    def forget(self) -> None:
        """Drop every plan and past pose."""
        self._decider.forget()
        self._closed_for = None

    def _signal(self, name: str) -> Distance:
        tracker = self._tracker

        def distance(tips_m: np.ndarray) -> np.ndarray:
            if tracker.held is not None or not tracker.armed(name):
                return np.full(len(tips_m), FAR_M)
            body, rule = tracker.body(name), tracker.rule
            gaps_m = np.maximum(body.distance(tips_m[:, :3]), body.distance(tips_m[:, 3:]))
            return gaps_m - rule.tip_radius_m - rule.band_m

        return distance

"""Grasping with thumb and index (thesis 4.6.0.2).

A grasp begins when both fingertips are within 5 mm of an object that lies between them. The object then follows the
ray from thumb to index, and is let go when the ray is longer than it was at the beginning. A fingertip is its tip
joint with a sphere of 7 mm, as it was drawn, and "within 5 mm" is measured from that sphere's surface; a tip inside
the object is within.

Taken literally the rule begins again at once after an end, over and over, until the fingers are 10 mm wider than the
object. So there are two rules: ``thesis``, the literal one, and ``rearming``, the default, in which a tip must leave
the band by 2 mm before the same object can be grasped again, and the end must persist for 50 ms. The beginning is
never filtered, as that would make it late.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from haptics.errors import InputError
from haptics.scene.geometry.pose import Array, Pose, shortest_turn_xyzw
from haptics.scene.geometry.shapes import Placed, segment_meets
from haptics.scene.sites import TIP_RADIUS_M
from haptics.time import seconds_to_ns
from haptics.units import in_range, one_of

RULES = ("rearming", "thesis")


@dataclass(frozen=True)
class GraspRule:
    """When a grasp begins and ends.

    :param band_m: both tips' surfaces this near to the object, or nearer (5 mm stated, thesis 4.6.0.2); 0 to 0.05 m.
    :param rearm_m: how far past the band a tip must come before the next grasp of the same object (2 mm assumed), 0 to 0.05 m;
        None: at once.
    :param end_hold_s: how long the ray must stay longer than at the start (50 ms assumed; 0 is the literal rule), 0 to 1 s.
    :param tip_radius_m: radius of a fingertip's sphere (7 mm assumed), 0 to 0.03 m.
    :raises InputError: a number out of its range.
    """

    band_m: float = 0.005
    rearm_m: float | None = 0.002
    end_hold_s: float = 0.05
    tip_radius_m: float = TIP_RADIUS_M

    def __post_init__(self) -> None:
        in_range("band_m", self.band_m, 0.0, 0.05, "m")
        if self.rearm_m is not None:
            in_range("rearm_m", self.rearm_m, 0.0, 0.05, "m")
        in_range("end_hold_s", self.end_hold_s, 0.0, 1.0, "s")
        in_range("tip_radius_m", self.tip_radius_m, 0.0, 0.03, "m")


def grasp_rule(name: str) -> GraspRule:
    """A rule by its name.

    :param name: ``rearming`` (default of scenes) or ``thesis`` (literal).
    :return: the rule's numbers.
    :raises InputError: another name.
    """
    one_of("grasp rule", name, RULES)
    return GraspRule() if name == "rearming" else GraspRule(rearm_m=None, end_hold_s=0.0)


def gap_m(body: Placed, thumb_tip_m: Array, index_tip_m: Array, tip_radius_m: float = TIP_RADIUS_M) -> float:
    """How far the farther fingertip's sphere is from the object.

    A grasp can begin where this is ``band_m`` or less and the object lies between the tips (:func:`between`).

    :param body: the object where it is.
    :param thumb_tip_m: the tips' joints, (3,), metres.
    :param index_tip_m: likewise, with ``thumb_tip_m``.
    :param tip_radius_m: radius of a fingertip's sphere, metres.
    :return: metres; negative when both tips reach into the object.
    """
    return max(body.distance(np.array([thumb_tip_m, index_tip_m])).tolist()) - tip_radius_m


def between(body: Placed, thumb_tip_m: Array, index_tip_m: Array) -> bool:
    """Whether the object lies between the fingertips.

    :param body: the object where it is.
    :param thumb_tip_m: the tips' joints, (3,), metres.
    :param index_tip_m: likewise, with ``thumb_tip_m``.
    :return: whether the segment from joint to joint enters it.
    """
    return segment_meets(body, thumb_tip_m, index_tip_m)


@dataclass(frozen=True)
class GraspEvent:
    """A grasp began or ended.

    :param kind: ``begin`` or ``end``.
    :param time_ns: sample time of the pose at which it did.
    :param object: the object's name.
    :param ray_m: distance of the tips' joints now, metres.
    :param start_ray_m: the same at the beginning of the grasp.
    :param penetration: mean over the grasp of ``max(0, L0 − L)/L0``; 0 at the beginning.
    :param depth_m: deepest a fingertip's sphere has been inside the object, metres; at the beginning, how deep it is then.
    """

    kind: Literal["begin", "end"]
    time_ns: int
    object: str
    ray_m: float
    start_ray_m: float
    penetration: float
    depth_m: float


@dataclass
class _Held:
    """A grasp that lasts: how it began, and the anchor from which the ray carries the object."""

    name: str
    began_ns: int
    start_ray_m: float
    pose: Pose
    ray: Array
    middle: Array
    seen_ns: int
    share: float  # of penetration, at the last update
    share_ns: float = 0.0  # its integral over the grasp
    depth_m: float = 0.0
    longer_since_ns: int | None = None


class GraspTracker:
    """Follows thumb and index among the graspable objects of a scene; one object is held at a time.

    :param bodies: the graspable objects, by name, where they are now.
    :param rule: when a grasp begins and ends; None: ``rearming``.
    :param others: objects that the ray does not carry: somebody else moves them, held or not.
    """

    def __init__(self, bodies: Mapping[str, Placed], rule: GraspRule | None = None, others: Collection[str] = ()):
        self.rule, self._others = rule or GraspRule(), frozenset(others)
        self._bodies = dict(bodies)
        self._armed = dict.fromkeys(self._bodies, True)
        self._held: _Held | None = None
        self._last_ns: int | None = None

    @property
    def held(self) -> str | None:
        """The grasped object."""
        return self._held.name if self._held else None

    def armed(self, name: str) -> bool:
        """Whether a grasp of an object may begin.

        :param name: the object's.
        :return: whether a tip has left the band since the last grasp, if the rule asks for that; False for an unknown object.
        """
        return self._armed.get(name, False)

    def rearm(self) -> None:
        """Let a grasp of any object begin, though no tip has left its band: a grasp that ended for want of poses goes on."""
        self._armed = dict.fromkeys(self._bodies, True)

    def body(self, name: str) -> Placed:
        """A graspable object where it is now, which for a grasped one is where the ray has carried it.

        :param name: the object's.
        :return: its shape at its present pose.
        :raises InputError: no such object.
        """
        if name not in self._bodies:
            raise InputError(f"object = {name!r} cannot be grasped; objects that can: {', '.join(self._bodies) or 'none'}")
        return self._bodies[name]

    def put(self, name: str, body: Placed) -> None:
        """Put an object elsewhere; one that is held, and carried, stays in the hand.

        :param name: the object's.
        :param body: its shape where it is now.
        :raises InputError: no such object.
        """
        self.body(name)
        if name != self.held or name in self._others:
            self._bodies[name] = body

    def adopt(self, other: GraspTracker, names: Collection[str]) -> None:
        """Take over from another tracker what it knows of some objects: which is held, and which may be grasped again.

        :param other: stays as it is.
        :param names: objects of both.
        """
        for name in names:
            self._armed[name] = other._armed[name]
        if other._held is not None and other._held.name in names:
            self._held = replace(other._held)
            self._bodies[other._held.name] = other._bodies[other._held.name]
        self._last_ns = other._last_ns

    def update(self, time_ns: int, thumb_tip_m: Array, index_tip_m: Array) -> list[GraspEvent]:
        """Follow the tips.

        :param time_ns: when they were sampled; not earlier than the last.
        :param thumb_tip_m: the tips' joints, (3,), metres.
        :param index_tip_m: likewise, with ``thumb_tip_m``.
        :return: what began or ended; usually nothing.
        :raises InputError: time went back, or a tip is not three finite numbers.
        """
        thumb, index = np.asarray(thumb_tip_m, float), np.asarray(index_tip_m, float)
        if thumb.shape != (3,) or index.shape != (3,) or not np.isfinite(tips := np.array([thumb, index])).all():
            raise InputError(f"thumb_tip_m = {thumb}, index_tip_m = {index}; expected three finite numbers each, metres")
        if self._last_ns is not None and time_ns < self._last_ns:
            raise InputError(f"time_ns = {time_ns} lies before the last one, {self._last_ns}; time only moves forward")
        self._last_ns = time_ns
        if self._held is None:
            return self._look_for_grasp(time_ns, tips)
        return self._follow(self._held, time_ns, tips)

    def let_go(self, time_ns: int) -> list[GraspEvent]:
        """End a grasp because the hand was lost; the object stays where it is.

        :param time_ns: when it was lost.
        :return: the grasp's end, or nothing where no object was held.
        """
        if self._held is None:
            return []
        return [self._end(self._held, time_ns, float(np.linalg.norm(self._held.ray)))]

    def _look_for_grasp(self, time_ns: int, tips: Array) -> list[GraspEvent]:
        found: tuple[float, str] | None = None
        thumb, index = tips.tolist()
        for name, body in self._bodies.items():
            gap = max(body.bounding_distance(thumb), body.bounding_distance(index)) - self.rule.tip_radius_m
            if gap <= self.rule.band_m + (self.rule.rearm_m or 0.0):  # else the lower bound is enough
                gap = gap_m(body, tips[0], tips[1], self.rule.tip_radius_m)
            if not self._armed[name]:
                self._armed[name] = self.rule.rearm_m is None or gap > self.rule.band_m + self.rule.rearm_m
            within = self._armed[name] and gap <= self.rule.band_m
            if within and (found is None or gap < found[0]) and between(body, tips[0], tips[1]):
                found = gap, name
        if found is None:
            return []
        name = found[1]
        ray = tips[1] - tips[0]
        length_m = math.dist(*tips)
        depth_m = self._depth_m(self._bodies[name], tips)
        self._held = _Held(name, time_ns, length_m, self._bodies[name].pose, ray, _middle(tips), time_ns, 0.0, depth_m=depth_m)
        return [GraspEvent("begin", time_ns, name, length_m, length_m, 0.0, depth_m)]

    def _follow(self, held: _Held, time_ns: int, tips: Array) -> list[GraspEvent]:
        ray = tips[1] - tips[0]
        length_m = math.dist(*tips)
        if length_m > 0.0 and held.start_ray_m > 0.0 and held.name not in self._others:
            turn = shortest_turn_xyzw(held.ray, ray)
            self._bodies[held.name] = self._bodies[held.name].at(held.pose.turned_about(held.middle, turn, _middle(tips)))
        share = max(0.0, held.start_ray_m - length_m) / held.start_ray_m if held.start_ray_m > 0.0 else 0.0
        held.share_ns += 0.5 * (held.share + share) * (time_ns - held.seen_ns)
        held.share, held.seen_ns = share, time_ns
        held.depth_m = max(held.depth_m, self._depth_m(self._bodies[held.name], tips))
        if length_m <= held.start_ray_m:
            held.longer_since_ns = None
            return []
        if held.longer_since_ns is None:
            held.longer_since_ns = time_ns
        if time_ns - held.longer_since_ns < seconds_to_ns(self.rule.end_hold_s):
            return []
        return [self._end(held, time_ns, length_m)]

    def _end(self, held: _Held, time_ns: int, ray_m: float) -> GraspEvent:
        self._held = None
        self._armed[held.name] = self.rule.rearm_m is None
        lasted_ns = held.seen_ns - held.began_ns
        mean_share = held.share_ns / lasted_ns if lasted_ns > 0 else held.share
        return GraspEvent("end", time_ns, held.name, ray_m, held.start_ray_m, mean_share, held.depth_m)

    def _depth_m(self, body: Placed, tips: Array) -> float:
        return max(0.0, self.rule.tip_radius_m - min(body.distance(tips).tolist()))


def _middle(tips: Array) -> Array:
    return 0.5 * (tips[0] + tips[1])

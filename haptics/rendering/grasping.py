"""Grasps of one hand, carried out by the brakes and piezos of its fingers.

The grasp rule decides when an object is held; the brakes close a little ahead of it (``haptics.rendering.grasp_ahead``), so that
they hold when it comes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
from numpy.typing import NDArray

from haptics.devices import BrakeShare
from haptics.rendering.events import EventKind, LoopEvent
from haptics.rendering.grasp_ahead import GraspAhead
from haptics.rendering.resuming import Ramp
from haptics.rendering.world import World
from haptics.scene.effects import GraspEffect
from haptics.scene.grasp import GraspEvent
from haptics.scene.sites import SITE


class Grasping:
    """Follows thumb and index among the graspable objects of a scene, and drives the brakes.

    :param world: where objects are; one that this hand carries is moved there.
    :param brake: the brakes, or None: grasps are followed all the same.
    :param amplitude_v: cap on a grasp's drive, V.
    :param lead_ns: from sending the drive until the brakes hold half of what they will.
    :param stale_ns: a pose older than this is not forecast from.
    :param report: takes each event as it happens.
    """

    def __init__(
        self,
        world: World,
        brake: BrakeShare | None,
        amplitude_v: float,
        lead_ns: int,
        stale_ns: int,
        report: Callable[[LoopEvent], None],
    ):
        scene = world.scene
        self._world, self._scene, self._brake, self._amplitude_v, self._report = world, scene, brake, amplitude_v, report
        self._ramp: Ramp | None = None
        self._resumes = False  # what the next pose holds is held gently
        self._fingers = scene.needs.brakes or scene.needs.piezos
        self.names = tuple(item.name for item in scene.objects if item.grasp is not None)
        """The objects that can be grasped."""
        self._tracker = scene.grasp_tracker()
        self._ahead: GraspAhead | None = None
        if self.names and brake is not None:
            self._ahead = GraspAhead(self._tracker, self.names, lead_ns, stale_ns)

    @property
    def held(self) -> str | None:
        """The grasped object."""
        return self._tracker.held

    def adopt(self, other: Grasping, names: Collection[str]) -> None:
        """Go on with what another one held and had closed for, of objects that are the same in both.

        :param other: not used any more.
        :param names: objects of both.
        """
        self._tracker.adopt(other._tracker, [name for name in self.names if name in names])
        if self._ahead is not None and other._ahead is not None:
            self._ahead.adopt(other._ahead, names)

    def observe(self, time_ns: int, position_m: NDArray[np.float64], now_ns: int, quiet: bool) -> None:
        """Take a pose.

        :param time_ns: when it was sampled.
        :param position_m: the sites' centres, (15, 3), metres.
        :param now_ns: when it arrived.
        :param quiet: grasps are followed, and no device is driven.
        """
        thumb, index = position_m[SITE["thumb_tip"]], position_m[SITE["index_tip"]]
        for name in self.names:
            self._tracker.put(name, self._world.body(name))
        for event in self._tracker.update(time_ns, thumb, index):
            self._changed(event, now_ns, quiet)
        self._resumes = False
        held = self._tracker.held
        if held is not None and held not in self._world.engines:
            self._world.put(held, self._tracker.body(held))
        if self._ahead is not None and not quiet and self._tracker.held is None:
            self._ahead.observe(time_ns, thumb, index, now_ns)

    def tick(self, now_ns: int) -> None:
        """Close ahead of a grasp that is about to begin, and open again where it did not come.

        :param now_ns: the tick's time.
        """
        if self._ramp is not None:
            self._climb(self._ramp, now_ns)
        if self._ahead is None:
            return
        due = self._ahead.due(now_ns)
        if due is not None:
            self._report(LoopEvent(now_ns, "grasp_ahead", "", due.object, aimed_ns=due.aimed_ns))
            self._close(due.object, now_ns, due.aimed_ns)
        if self._ahead.withdraw(now_ns) and self._tracker.held is None:
            self._open(now_ns)
            self._report(LoopEvent(now_ns, "grasp_withdrawn"))

    def resume(self, now_ns: int) -> None:
        """Hold what is in the hand at the pose that is taken next, rising slowly to what a grasp is held with.

        :param now_ns: from when on.
        """
        self._tracker.rearm()
        self._resumes = True
        if self.held is not None:
            self._rise(self.held, now_ns)

    def _rise(self, name: str, now_ns: int) -> None:
        if self._brake is not None and self._effect(name).brakes:
            self._want(name, "brake", now_ns, None)
            self._ramp = Ramp(name, now_ns)

    def _climb(self, ramp: Ramp, now_ns: int) -> None:
        """The next step of a slow rise, of the same object in the same grasp."""
        assert self._brake is not None
        if self.held != ramp.object:
            self._ramp = None
        elif (share := ramp.step(now_ns)) is not None:
            self._engage(self._effect(ramp.object), share, now_ns)
            self._ramp = None if share >= 1.0 else ramp

    def let_go(self, now_ns: int, quiet: bool) -> None:
        """End a grasp, and forget what was planned: the hand is gone.

        :param now_ns: when it went.
        :param quiet: no device is driven.
        """
        self._ramp = None
        if self._ahead is not None:
            self._ahead.forget()
        for event in self._tracker.let_go(now_ns):
            self._changed(event, now_ns, quiet)

    def _effect(self, name: str) -> GraspEffect:
        effect = self._scene.object(name).grasp
        assert effect is not None  # only objects with a grasp effect are tracked
        return effect

    def _changed(self, event: GraspEvent, now_ns: int, quiet: bool) -> None:
        effect = self._effect(event.object)
        kind: EventKind = "grasp_begin" if event.kind == "begin" else "grasp_end"
        detail = f"ray {event.ray_m * 1e3:.1f} mm, penetration {event.penetration:.3f}, depth {event.depth_m * 1e3:.1f} mm"
        if self._brake is not None and not self._brake.armed and effect.brakes:
            detail += "; brakes are not armed"
        self._report(LoopEvent(now_ns, kind, "", event.object, detail, event.time_ns))
        if self._brake is None or quiet:
            return
        if event.kind == "begin":
            if self._resumes:
                self._rise(event.object, now_ns)
            elif self._ahead is None or not self._ahead.confirm(event.object):
                self._close(event.object, now_ns, event.time_ns)
        elif effect.brakes:
            self._open(now_ns)

    def _close(self, name: str, now_ns: int, aimed_ns: int) -> None:
        assert self._brake is not None
        effect = self._effect(name)
        piezo = effect.piezo and effect.piezo_s > 0
        for kind in [kind for kind, wanted in (("brake", effect.brakes), ("piezo", piezo)) if wanted]:
            self._want(name, kind, now_ns, aimed_ns)
        if effect.brakes:
            self._engage(effect, 1.0, now_ns)
        if piezo:
            self._brake.piezo(self._fingers, effect.piezo_s, now_ns)

    def _want(self, name: str, kind: str, now_ns: int, aimed_ns: int | None) -> None:
        for finger in self._fingers:
            self._report(LoopEvent(now_ns, "wanted", finger, name, kind, aimed_ns))

    def _engage(self, effect: GraspEffect, share: float, now_ns: int) -> None:
        assert self._brake is not None
        volts = share * min(effect.amplitude_v, self._amplitude_v)
        frequency_hz = min(effect.frequency_hz, self._brake.max_frequency_hz)
        for finger in self._fingers:
            self._brake.engage(finger, volts, now_ns, frequency_hz=frequency_hz)

    def _open(self, now_ns: int) -> None:
        assert self._brake is not None
        for finger in self._fingers:
            self._brake.release(finger, now_ns)

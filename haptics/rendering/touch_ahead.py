"""Deciders for all objects of a scene, each in the frame in which its object stands still.

A site is forecast where it moves smoothly and the object does not move at all. For most objects that is the world, where one
decider serves them all. An object that the hand carries, or that flies by itself, gets a decider in its own frame: there a
fingertip resting on a carried ball is at rest, however the hand moves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from haptics.rendering.body_decider import BodyDecider
from haptics.rendering.decision import Decided, Distance, TouchDecider
from haptics.rendering.pose_kernel import ABSENT, PRESENT
from haptics.scene.geometry.packed import packable
from haptics.scene.geometry.shapes import Placed

Bodies = Callable[[str], Placed]
POSES_KEPT = 6
"""As many poses as a forecast looks back on."""


class TouchAhead:
    """When sites touch and leave objects, decided ahead.

    :param body: returns where an object is now, by its name; called when a pose comes.
    :param names: all objects that can be touched.
    :param flying: those of them that move by themselves.
    :param radius_m: of the sites' spheres, (n,), metres.
    :param lead_ns: from sending a command until the device has acted.
    :param release_lead_ns: the same for its return.
    :param stale_ns: a plan dies when its pose is older than this.
    """

    def __init__(
        self,
        body: Bodies,
        names: Sequence[str],
        flying: Sequence[str],
        radius_m: NDArray[np.float64],
        lead_ns: int,
        release_lead_ns: int,
        stale_ns: int,
    ):
        self._body = body
        self._names = tuple(name for name in names if name not in flying)

        def decider(bodies: list[Placed], distances: list[Distance] | None = None) -> TouchDecider:
            if all(packable(body.shape) for body in bodies):
                return BodyDecider(bodies, radius_m, lead_ns, release_lead_ns, stale_ns=stale_ns)
            return TouchDecider(
                distances or [body.distance for body in bodies], radius_m, lead_ns, release_lead_ns, stale_ns=stale_ns
            )

        self._world = decider([body(name) for name in self._names], [self._in_world(name) for name in self._names])
        self._flying = {name: decider([Placed(body(name).shape)]) for name in flying}
        self._carried: tuple[str, TouchDecider] | None = None
        self._decider = decider
        self._poses: deque[tuple[int, NDArray[np.float64], int]] = deque(maxlen=POSES_KEPT)

    def observe(self, time_ns: int, position_m: NDArray[np.float64], now_ns: int, held: str | None = None) -> None:
        """Plan from a pose.

        :param time_ns: when it was sampled.
        :param position_m: the sites' centres, (n, 3), metres.
        :param now_ns: when it arrived.
        :param held: name of the object that the hand carries; None: none.
        """
        self._carry(held if held in self._names else None)
        self._poses.append((time_ns, position_m, now_ns))
        if isinstance(self._world, BodyDecider):
            carried = None if self._carried is None else self._carried[0]
            for index, name in enumerate(self._names):
                self._world.put(index, self._body(name), ABSENT if name == carried else PRESENT)
        self._world.observe(time_ns, position_m, now_ns)
        for name, decider in self._own():
            decider.observe(time_ns, self._body(name).pose.to_local(position_m), now_ns)

    def due(self, now_ns: int) -> list[tuple[str, Decided]]:
        """What is to be done at this tick.

        :param now_ns: the tick's time.
        :return: each decision with its object's name.
        """
        found = [(self._names[decided.object], decided) for decided in self._world.due(now_ns)]
        for name, decider in self._own():
            found += [(name, decided) for decided in decider.due(now_ns)]
        return found

    def forget(self) -> None:
        """Drop every touch, plan and past pose."""
        for decider in (self._world, *self._flying.values()):
            decider.forget()
        self._carried = None
        self._poses.clear()

    def adopt(self, other: TouchAhead, names: Collection[str]) -> None:
        """Go on from another one with what touches some objects, and with the poses that it has seen.

        :param other: not used any more.
        :param names: objects of both, of the same shapes.
        """
        deciders = [self._world, *self._flying.values()]
        for time_ns, position_m, now_ns in other._poses:
            self.observe(time_ns, position_m, now_ns)
        for decider in deciders:
            decider.drop_plans()
        for name in names:
            its, its_index = other._decider_of(name)
            mine, index = self._decider_of(name)
            mine.adopt(index, its, its_index)

    def _decider_of(self, name: str) -> tuple[TouchDecider, int]:
        if self._carried is not None and self._carried[0] == name:
            return self._carried[1], 0
        return (self._flying[name], 0) if name in self._flying else (self._world, self._names.index(name))

    def _own(self) -> list[tuple[str, TouchDecider]]:
        carried = [] if self._carried is None else [self._carried]
        return [*self._flying.items(), *carried] if self._flying else carried

    def _in_world(self, name: str) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
        def distance(points_m: NDArray[np.float64]) -> NDArray[np.float64]:
            if self._carried is not None and self._carried[0] == name:
                return np.full(len(points_m), np.nan)  # decided in its own frame; here its state stays as it is
            return self._body(name).distance(points_m)

        return distance

    def _carry(self, held: str | None) -> None:
        """Hand an object over from the world's decider to its own, or back, with what it touches."""
        if self._carried is not None and self._carried[0] != held:
            name, decider = self._carried
            self._world.adopt(self._names.index(name), decider)
            self._carried = None
        if held is not None and self._carried is None:
            body = self._body(held)
            decider = self._decider([Placed(body.shape)])
            for time_ns, position_m, now_ns in self._poses:
                decider.observe(time_ns, body.pose.to_local(position_m), now_ns)
            decider.adopt(0, self._world, self._names.index(held))
            self._carried = (held, decider)

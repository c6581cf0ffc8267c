"""Deciders for all objects of a scene, each in the frame in which its object stands still.

A site is forecast where it moves smoothly and the object does not move at all. For most objects that is the world. An object
that a hand carries, or that flies by itself, gets a decider in its own frame: there a fingertip resting on a carried ball is at
rest, however the hand moves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from haptics.rendering.decision import FASTEST_M_S, Decided, TouchDecider
from haptics.scene.shapes import Placed
from haptics.time import NS_PER_S

Bodies = Callable[[str], Placed]
HAND_SPAN_M = 0.25
"""No site is farther than this from the first one (a hand is 190 mm long)."""


class TouchAhead:
    """When sites touch and leave objects, decided ahead.

    :param body: where an object is now, by its name; asked when a pose comes.
    :param still: objects that never move. :param movable: objects that may.
    :param radius_m: of the sites' spheres, (n,).
    :param lead_ns: from telling a device until it has acted. :param release_lead_ns: the same for its return.
    :param stale_ns: no plan outlives its pose by more.
    """

    def __init__(
        self,
        body: Bodies,
        still: Sequence[str],
        movable: Sequence[str],
        radius_m: NDArray[np.float64],
        lead_ns: int,
        release_lead_ns: int,
        stale_ns: int,
    ):
        self._body, self._still, self._movable = body, tuple(still), tuple(movable)
        self._reach_m = FASTEST_M_S * (stale_ns + lead_ns) / NS_PER_S + float(radius_m.max(initial=0.0))

        def decider(distances: list) -> TouchDecider:
            return TouchDecider(distances, radius_m, lead_ns, release_lead_ns, stale_ns=stale_ns)

        self._world = decider([body(name).distance for name in self._still])
        self._own = {name: decider([body(name).shape.distance]) for name in self._movable}
        self._near: set[str] = set()

    def observe(self, time_ns: int, position_m: NDArray[np.float64], now_ns: int) -> None:
        """A pose's sites (n, 3), sampled at ``time_ns``, in hand at ``now_ns``."""
        if self._still:
            self._world.observe(time_ns, position_m, now_ns)
        x, y, z = position_m[0].tolist()
        for name in self._movable:
            body = self._body(name)
            a, b, c = body.pose.position_m
            span_m = self._reach_m + HAND_SPAN_M + body.bounding_radius_m
            if (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2 > span_m * span_m:
                if name in self._near:
                    self._near.discard(name)
                    self._own[name].forget()
                continue
            self._near.add(name)
            self._own[name].observe(time_ns, body.pose.to_local(position_m), now_ns)

    def due(self, now_ns: int) -> list[tuple[str, Decided]]:
        """What is to be done at this tick, with the object's name."""
        found = [(self._still[decided.object], decided) for decided in self._world.due(now_ns)]
        for name in self._movable:
            if name in self._near:
                found += [(name, decided) for decided in self._own[name].due(now_ns)]
        return found

    def forget(self) -> None:
        """No touch, no plan, no past pose."""
        self._world.forget()
        for decider in self._own.values():
            decider.forget()
        self._near.clear()

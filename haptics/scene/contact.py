"""Which pins are out: touches counted per site and object.

A pin comes out when the first object touches its site and goes back when the last one leaves; a fixed set comes out
while any site touches its object. When a touch begins and ends is decided elsewhere (by prediction, or by
``TouchBand`` from plain distances).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from haptics.errors import InputError
from haptics.scene.effects import ContactEffect, Effect, FixedSetEffect
from haptics.scene.geometry.pose import Array
from haptics.scene.sites import SITE, SITES
from haptics.units import in_range, nearest

LEAVE_M = 0.002
"""How far a site must come off before it counts as released (assumed: over ten times the noise of a tracked fingertip)."""


@dataclass(frozen=True)
class Touch:
    """A site began or ended touching an object.

    :param kind: ``touch`` or ``release``.
    :param time_ns: when that was decided.
    :param object: the object's name.
    :param site: 0 to 14, the place in ``SITES``.
    :param first_or_last: whether it is the object's first touching site, or its last one leaving.
    """

    kind: Literal["touch", "release"]
    time_ns: int
    object: str
    site: int
    first_or_last: bool


@dataclass(frozen=True)
class PinChange:
    """A pin must come out or go back.

    :param time_ns: when that was decided.
    :param site: 0 to 14, the place in ``SITES``.
    :param out: whether it must come out.
    """

    time_ns: int
    site: int
    out: bool


class ContactTracker:
    """Counts touches and reports which pins must move.

    :param effects: the effects of each object, by its name.
    """

    def __init__(self, effects: dict[str, tuple[Effect, ...]]):
        self._effects = {
            name: tuple(e for e in of if isinstance(e, ContactEffect | FixedSetEffect)) for name, of in effects.items()
        }
        self._touching: dict[str, set[int]] = {name: set() for name in effects}
        self._holders: list[set[str]] = [set() for _ in SITES]

    @property
    def pins_out(self) -> tuple[int, ...]:
        """Sites whose pin should be out."""
        return tuple(site for site, holders in enumerate(self._holders) if holders)

    def touching(self, name: str) -> frozenset[int]:
        """The sites that touch an object.

        :param name: the object's.
        :return: indices in ``SITES``.
        :raises InputError: no such object.
        """
        return frozenset(self._of(name))

    @property
    def touched(self) -> frozenset[str]:
        """Objects touched by any site."""
        return frozenset(name for name, sites in self._touching.items() if sites)

    def adopt(self, other: ContactTracker, names: Collection[str]) -> None:
        """Take over from another tracker what touches some objects, whose effects are the same in both.

        :param other: stays as it is.
        :param names: objects of both.
        """
        for name in names:
            self._touching[name] = set(other._touching[name])
            self._settle(name, 0)

    def touch(self, site: int, name: str, time_ns: int) -> tuple[list[Touch], list[PinChange]]:
        """Take note that a site begins to touch an object; one that touches it already changes nothing.

        :param site: 0 to 14, the place in ``SITES``.
        :param name: the object's.
        :param time_ns: passed on to what is returned.
        :return: the touch, and the pins that must move.
        :raises InputError: no such object.
        """
        touching = self._of(name)
        if site in touching:
            return [], []
        touching.add(site)
        return [Touch("touch", time_ns, name, site, len(touching) == 1)], self._settle(name, time_ns)

    def leave(self, site: int, name: str, time_ns: int) -> tuple[list[Touch], list[PinChange]]:
        """Take note that a site stops touching an object; one that did not touch it changes nothing.

        :param site: 0 to 14, the place in ``SITES``.
        :param name: the object's.
        :param time_ns: passed on to what is returned.
        :return: the release, and the pins that must move.
        :raises InputError: no such object.
        """
        touching = self._of(name)
        if site not in touching:
            return [], []
        touching.remove(site)
        return [Touch("release", time_ns, name, site, not touching)], self._settle(name, time_ns)

    def release_all(self, time_ns: int) -> tuple[list[Touch], list[PinChange]]:
        """End every touch: the hand was lost, or the run ends.

        :param time_ns: passed on to what is returned.
        :return: the releases, and the pins that must go back.
        """
        touches: list[Touch] = []
        pins: list[PinChange] = []
        for name, sites in self._touching.items():
            for site in sorted(sites):
                touch, pin = self.leave(site, name, time_ns)
                touches += touch
                pins += pin
        return touches, pins

    def _of(self, name: str) -> set[int]:
        try:
            return self._touching[name]
        except KeyError:
            known = (", ".join(self._touching) or "none") + nearest(name, tuple(self._touching))
            raise InputError(f"object = {name!r} is not in the scene; its objects: {known}") from None

    def _settle(self, name: str, time_ns: int) -> list[PinChange]:
        touching, changes = self._touching[name], []
        wanted: set[int] = set()
        for effect in self._effects[name]:
            if isinstance(effect, ContactEffect):
                wanted |= touching if effect.sites is None else touching & {SITE[site] for site in effect.sites}
            elif touching:
                wanted |= {SITE[site] for site in effect.sites}
        for site, holders in enumerate(self._holders):
            was_out = bool(holders)
            (holders.add if site in wanted else holders.discard)(name)
            if bool(holders) != was_out:
                changes.append(PinChange(time_ns, site, bool(holders)))
        return changes


class TouchBand:
    """Touch and release from plain signed distances, with hysteresis: touched at 0 or below, released above ``leave_m``.

    :param objects: names, in the order of the distances' rows.
    :param leave_m: 0 to 0.05 m; default 2 mm.
    :raises InputError: ``leave_m`` out of range.
    """

    def __init__(self, objects: Sequence[str], leave_m: float = LEAVE_M):
        self._objects = tuple(objects)
        self._leave_m = in_range("leave_m", leave_m, 0.0, 0.05, "m")
        self._held = np.zeros((len(self._objects), len(SITES)), dtype=bool)

    def update(self, distance_m: Array) -> list[tuple[bool, int, str]]:
        """Compare distances with those before.

        A distance that is not a number leaves its site as it was.

        :param distance_m: (objects, 15), metres, signed; negative inside.
        :return: what changed, as (began, site, object).
        :raises InputError: another shape.
        """
        if distance_m.shape != self._held.shape:
            raise InputError(f"distance_m has shape {distance_m.shape}; expected {self._held.shape}, objects by sites")
        held = np.where(self._held, ~(distance_m > self._leave_m), distance_m <= 0.0)
        changed = np.argwhere(held != self._held)
        self._held = held
        return [(bool(held[row, site]), int(site), self._objects[row]) for row, site in changed.tolist()]

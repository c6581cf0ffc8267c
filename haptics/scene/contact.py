"""Which pins are out: touches counted per site and object.

A pin comes out when the first object touches its site and goes back when the last one leaves; a fixed set comes out
while any site touches its object. When a touch begins and ends is decided elsewhere (by prediction, or by
``TouchBand`` from plain distances).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from haptics.errors import InputError
from haptics.scene.effects import ContactEffect, Effect, FixedSetEffect
from haptics.scene.geometry.pose import Array
from haptics.scene.sites import SITE, SITES
from haptics.units import in_range

LEAVE_M = 0.002
"""How far a site must come off before it counts as released (assumed: over ten times the noise of a tracked fingertip)."""


@dataclass(frozen=True)
class Touch:
    """A site began or ended touching an object; between the two it holds it."""

    kind: Literal["touch", "release"]
    time_ns: int
    object: str
    site: int
    first_or_last: bool
    """The object's first touching site came, or its last one left."""


@dataclass(frozen=True)
class PinChange:
    """A pin must come out or go back."""

    time_ns: int
    site: int
    out: bool


class ContactTracker:
    """Counts touches and says which pins must move.

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
        """Sites that touch the object.

        :raises InputError: no such object.
        """
        return frozenset(self._of(name))

    @property
    def touched(self) -> frozenset[str]:
        """Objects touched by any site."""
        return frozenset(name for name, sites in self._touching.items() if sites)

    def touch(self, site: int, name: str, time_ns: int) -> tuple[list[Touch], list[PinChange]]:
        """A site begins to touch an object; one that touches it already changes nothing."""
        touching = self._of(name)
        if site in touching:
            return [], []
        touching.add(site)
        return [Touch("touch", time_ns, name, site, len(touching) == 1)], self._settle(name, time_ns)

    def leave(self, site: int, name: str, time_ns: int) -> tuple[list[Touch], list[PinChange]]:
        """A site stops touching an object; one that did not touch it changes nothing."""
        touching = self._of(name)
        if site not in touching:
            return [], []
        touching.remove(site)
        return [Touch("release", time_ns, name, site, not touching)], self._settle(name, time_ns)

    def release_all(self, time_ns: int) -> tuple[list[Touch], list[PinChange]]:
        """Everything is let go: the hand was lost, or the run ends."""
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
            raise InputError(f"object = {name!r} is not in the scene; allowed: {', '.join(self._touching) or 'none'}") from None

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
    :param leave_m: 0 to 0.05 m.
    """

    def __init__(self, objects: Sequence[str], leave_m: float = LEAVE_M):
        self._objects = tuple(objects)
        self._leave_m = in_range("leave_m", leave_m, 0.0, 0.05, "m")
        self._held = np.zeros((len(self._objects), len(SITES)), dtype=bool)

    def update(self, distance_m: Array) -> list[tuple[bool, int, str]]:
        """What changed, as (began, site, object), for distances of shape (objects, sites), metres.

        A distance that is not a number says nothing about the site, which therefore stays as it was.

        :raises InputError: another shape.
        """
        if distance_m.shape != self._held.shape:
            raise InputError(f"distance_m has shape {distance_m.shape}; allowed: {self._held.shape}, objects by sites")
        held = np.where(self._held, ~(distance_m > self._leave_m), distance_m <= 0.0)
        changed = np.argwhere(held != self._held)
        self._held = held
        return [(bool(held[row, site]), int(site), self._objects[row]) for row, site in changed.tolist()]

"""Several owners share the outputs of a glove: each wants something for a while, and letting go of it leaves the others alone.

An owner is a scene, a program, a client. What it wants held lasts as long as it said, or as long as it goes on renewing its
share: whoever stops asking, for whatever reason, is let go of. Owners are known by name; the same name gives the same share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from haptics.devices.brake import BrakeDriver
from haptics.devices.tactiles import TactilesDriver
from haptics.errors import InputError
from haptics.time import NS_PER_MS, seconds_to_ns
from haptics.units import in_range

LEASE_NS = 200 * NS_PER_MS
"""A share that is not renewed for so long is let go of: as long as a drive of the brakes lasts on its board."""
LONGEST_HOLD_S = 60.0
"""The longest that anything stays on without being asked for again, s."""
SCENE, PROGRAM = "scene", "program"
"""Owners that every glove has: the scene that is rendered on it, and the program that calls it."""
PRIORITIES = {SCENE: 0, PROGRAM: 1}
"""Of owners by name; any other has 0. On one brake the higher one decides, of equals the stronger."""


@dataclass(slots=True)
class _Lease:
    """An owner, and until when it keeps what it has no time of its own for."""

    owner: str
    until_ns: int = 0


class _Wish(NamedTuple):
    """What an owner wants of one output."""

    lease: _Lease
    until_ns: int | None
    priority: int = 0
    amplitude_v: float = 0.0
    frequency_hz: float | None = None

    def over(self, now_ns: int) -> bool:
        return now_ns >= (self.lease.until_ns if self.until_ns is None else self.until_ns)


def _until_ns(ttl_s: float | None, now_ns: int) -> int | None:
    return None if ttl_s is None else now_ns + seconds_to_ns(in_range("ttl_s", ttl_s, 0.001, LONGEST_HOLD_S, "s"))


class SharedTactiles:
    """An array in the hands of several owners: a pin is out while anybody wants it out.

    :param driver: of the array.
    """

    def __init__(self, driver: TactilesDriver):
        self.driver = driver
        self._wishes: dict[str, dict[str, _Wish]] = {site: {} for site in driver.sites}
        self._shares: dict[str, TactilesShare] = {}

    def share(self, owner: str) -> TactilesShare:
        """The array as one owner has it.

        :param owner: its name.
        :return: the same share for the same name.
        """
        return self._shares.setdefault(owner, TactilesShare(self, owner))

    def want(self, site: str, wish: _Wish) -> None:
        """Note what an owner wants; only while the array is armed.

        :param site: of the array.
        :param wish: of the owner.
        """
        if self.driver.armed:
            self._wishes[site][wish.lease.owner] = wish

    def drop(self, site: str, owner: str) -> bool:
        """An owner no longer wants a pin out.

        :param site: of the array.
        :param owner: its name.
        :return: nobody else wants it out.
        """
        wishes = self._wishes[site]
        wishes.pop(owner, None)
        return not wishes

    def wanted_by(self, owner: str) -> list[str]:
        """Sites whose pins an owner wants out.

        :param owner: its name.
        :return: in the order of channels.
        """
        return [site for site, wishes in self._wishes.items() if owner in wishes]

    def tick(self, now_ns: int) -> None:
        """End what is over, then tick the driver.

        :param now_ns: ns on the link's clock.
        """
        for site, wishes in self._wishes.items():
            if wishes:
                for owner in [owner for owner, wish in wishes.items() if wish.over(now_ns)]:
                    if self.drop(site, owner):
                        self.driver.release(site, now_ns, owner=owner)
        self.driver.tick(now_ns)

    def forget(self) -> None:
        """Nobody wants anything any more: the array was armed, or is no longer."""
        for wishes in self._wishes.values():
            wishes.clear()


class TactilesShare:
    """What one owner can ask of an array. Made by ``SharedTactiles.share``.

    :param shared: the array.
    :param owner: the owner's name.
    """

    def __init__(self, shared: SharedTactiles, owner: str):
        self._shared, self._driver, self._lease = shared, shared.driver, _Lease(owner)
        self.owner = owner

    @property
    def sites(self) -> tuple[str, ...]:
        """Of the array, in the order of channels."""
        return self._driver.sites

    @property
    def armed(self) -> bool:
        """Whether what is asked for can play."""
        return self._driver.armed

    @property
    def overdue(self) -> int:
        """See ``TactilesDriver``."""
        return self._driver.overdue

    def contact(self, site: str, now_ns: int, at_ns: int | None = None, ttl_s: float | None = None) -> bool:
        """Bring a pin out, or keep it out for longer.

        :param site: of the array.
        :param now_ns: ns on the link's clock.
        :param at_ns: see ``TactilesDriver.contact``.
        :param ttl_s: how long it stays, 1 ms to 60 s; as long as the share is renewed if None.
        :return: see ``TactilesDriver.contact``.
        :raises InputError: no tactor sits at this site, or ``ttl_s`` out of range.
        """
        until_ns = _until_ns(ttl_s, now_ns)
        asked = self._driver.contact(site, now_ns, at_ns, owner=self.owner)
        if until_ns is None:
            self.tick(now_ns)
        self._shared.want(site, _Wish(self._lease, until_ns))
        return asked

    def release(self, site: str, now_ns: int, at_ns: int | None = None) -> bool:
        """Let go of a pin: it goes back if no other owner wants it out.

        :param site: of the array.
        :param now_ns: ns on the link's clock.
        :param at_ns: see ``TactilesDriver.release``.
        :return: whether it was asked to go back.
        :raises InputError: no tactor sits at this site.
        """
        self._driver.check_site(site)
        return self._shared.drop(site, self.owner) and self._driver.release(site, now_ns, at_ns, owner=self.owner)

    def release_all(self, now_ns: int) -> None:
        """Let go of every pin.

        :param now_ns: ns on the link's clock.
        """
        for site in self._shared.wanted_by(self.owner):
            self.release(site, now_ns)

    def pulse(self, site: str, now_ns: int, at_ns: int | None = None) -> None:
        """See ``TactilesDriver.pulse``.

        :param site: of the array.
        :param now_ns: ns on the link's clock.
        :param at_ns: wanted start, ns.
        :raises InputError: no tactor sits at this site.
        """
        self._driver.pulse(site, now_ns, at_ns, owner=self.owner)

    def miss(self, site: str, now_ns: int) -> None:
        """See ``TactilesDriver.miss``.

        :param site: of the array.
        :param now_ns: ns on the link's clock.
        :raises InputError: no tactor sits at this site.
        """
        self._driver.miss(site, now_ns, owner=self.owner)

    def train(self, site: str, count: int, period_ns: int, now_ns: int) -> None:
        """See ``TactilesDriver.train``.

        :param site: of the array.
        :param count: how many.
        :param period_ns: from start to start, ns.
        :param now_ns: ns on the link's clock.
        :raises InputError: no tactor sits at this site.
        """
        self._driver.train(site, count, period_ns, now_ns, owner=self.owner)

    def burst(self, site: str, cycles: int, now_ns: int) -> None:
        """See ``TactilesDriver.burst``.

        :param site: of the array.
        :param cycles: 1 to 10.
        :param now_ns: ns on the link's clock.
        :raises InputError: no tactor sits at this site, or too many cycles.
        """
        self._driver.burst(site, cycles, now_ns, owner=self.owner)

    def tick(self, now_ns: int) -> None:
        """Renew the share.

        :param now_ns: ns on the link's clock.
        """
        self._lease.until_ns = now_ns + LEASE_NS


class SharedBrakes:
    """Brakes in the hands of several owners.

    :param driver: of the brake controller.
    """

    def __init__(self, driver: BrakeDriver):
        self.driver = driver
        self._wishes: dict[str, dict[str, _Wish]] = {name: {} for name in driver.channels}
        self._given: dict[str, _Wish] = {}  # what the driver was asked for last
        self._shares: dict[str, BrakeShare] = {}

    def share(self, owner: str) -> BrakeShare:
        """The brakes as one owner has them.

        :param owner: its name.
        :return: the same share for the same name.
        """
        return self._shares.setdefault(owner, BrakeShare(self, owner))

    def want(self, name: str, wish: _Wish, now_ns: int) -> None:
        """An owner wants volts on an output, which it gets unless another one goes before it.

        :param name: of the output.
        :param wish: of the owner.
        :param now_ns: ns on the link's clock.
        """
        owner = wish.lease.owner
        if not self.driver.armed:
            self.driver.engage(name, wish.amplitude_v, now_ns, wish.frequency_hz, owner=owner)  # for the refusal
            return
        self._wishes[name][owner] = wish
        first = self._first(name)
        if first is wish:
            self._give(name, wish, now_ns)
        else:
            self.driver.refuse(name, "outranked", now_ns, owner=owner)
            self._give_what_is_left(name, now_ns)

    def drop(self, name: str, owner: str, now_ns: int, late: bool = False) -> None:
        """An owner no longer wants an output.

        :param name: of the output.
        :param owner: its name.
        :param now_ns: ns on the link's clock.
        :param late: its time is over.
        """
        if self._wishes[name].pop(owner, None) is not None:
            self._give_what_is_left(name, now_ns, late)

    def wanted_by(self, owner: str) -> dict[str, float]:
        """What an owner wants.

        :param owner: its name.
        :return: volts by output.
        """
        return {name: wishes[owner].amplitude_v for name, wishes in self._wishes.items() if owner in wishes}

    def tick(self, now_ns: int) -> None:
        """End what is over, then tick the driver.

        :param now_ns: ns on the link's clock.
        """
        for name, wishes in self._wishes.items():
            if wishes:
                for owner in [owner for owner, wish in wishes.items() if wish.over(now_ns)]:
                    self.drop(name, owner, now_ns, late=True)
        self.driver.tick(now_ns)

    def forget(self) -> None:
        """Nobody wants anything any more: the board was armed, or is no longer."""
        self._given.clear()
        for wishes in self._wishes.values():
            wishes.clear()

    def _first(self, name: str) -> _Wish | None:
        wishes = self._wishes[name].values()
        return max(wishes, key=lambda wish: (wish.priority, wish.amplitude_v), default=None)

    def _give_what_is_left(self, name: str, now_ns: int, late: bool = False) -> None:
        first = self._first(name)
        if first is None:
            self._given.pop(name, None)
            self.driver.release(name, now_ns, "late" if late else "superseded")
        elif first is not self._given.get(name):
            self._give(name, first, now_ns)

    def _give(self, name: str, wish: _Wish, now_ns: int) -> None:
        self._given[name] = wish
        self.driver.engage(name, wish.amplitude_v, now_ns, wish.frequency_hz, owner=wish.lease.owner)


class BrakeShare:
    """What one owner can ask of the brakes. Made by ``SharedBrakes.share``.

    :param shared: the brakes.
    :param owner: the owner's name.
    """

    def __init__(self, shared: SharedBrakes, owner: str):
        self._shared, self._driver, self._lease = shared, shared.driver, _Lease(owner)
        self.owner, self._priority = owner, PRIORITIES.get(owner, 0)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the outputs, in channel order."""
        return self._driver.channels

    @property
    def armed(self) -> bool:
        """Whether what is asked for can play."""
        return self._driver.armed

    @property
    def max_amplitude_v(self) -> float:
        """The driver's limit, V."""
        return self._driver.max_amplitude_v

    @property
    def max_frequency_hz(self) -> float:
        """The driver's limit, Hz."""
        return self._driver.max_frequency_hz

    def engage(
        self, name: str, amplitude_v: float, now_ns: int, ttl_s: float | None = None, frequency_hz: float | None = None
    ) -> None:
        """Volts on one output, or its hold renewed.

        :param name: of the output.
        :param amplitude_v: see ``BrakeDriver.engage``.
        :param now_ns: ns on the link's clock.
        :param ttl_s: how long it is held, 1 ms to 60 s; as long as the share is renewed if None.
        :param frequency_hz: see ``BrakeDriver.engage``.
        :raises InputError: see ``BrakeDriver.engage``; or ``ttl_s`` out of range.
        """
        self._driver.check(name, amplitude_v, frequency_hz)
        wish = _Wish(self._lease, _until_ns(ttl_s, now_ns), self._priority, amplitude_v, frequency_hz)
        if ttl_s is None:
            self.tick(now_ns)
        self._shared.want(name, wish, now_ns)

    def release(self, name: str, now_ns: int) -> None:
        """Let go of one output, which goes to zero if no other owner wants it.

        :param name: of the output.
        :param now_ns: ns on the link's clock.
        :raises InputError: unknown output.
        """
        if name not in self._driver.channels:
            raise InputError(f"brake = {name!r} is unknown; this glove has: {', '.join(self._driver.channels)}")
        self._shared.drop(name, self.owner, now_ns)

    def release_all(self, now_ns: int) -> None:
        """Let go of every output.

        :param now_ns: ns on the link's clock.
        """
        for name in self.engaged():
            self._shared.drop(name, self.owner, now_ns)

    def engaged(self) -> dict[str, float]:
        """What this owner wants.

        :return: volts by output.
        """
        return self._shared.wanted_by(self.owner)

    def piezo(self, names: Sequence[str], duration_s: float, now_ns: int) -> None:
        """See ``BrakeDriver.piezo``.

        :param names: of the outputs.
        :param duration_s: 1 ms to 1 s.
        :param now_ns: ns on the link's clock.
        :raises InputError: unknown output, or a duration out of range.
        """
        self._driver.piezo(names, duration_s, now_ns, owner=self.owner)

    def tick(self, now_ns: int) -> None:
        """Renew the share.

        :param now_ns: ns on the link's clock.
        """
        self._lease.until_ns = now_ns + LEASE_NS

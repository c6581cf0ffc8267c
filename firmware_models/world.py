"""Simulated worlds: a clock and what stands in it.

A world on a virtual clock moves when somebody advances one of its ports; a world on the real clock catches up with the
machine's monotonic clock whenever somebody looks. Ports that name the same world share it; the last one to close takes
it away.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol

from firmware_models.line.uart import NEVER_NS
from haptics.errors import InputError

CLOCKS = ("real", "virtual")


class Member(Protocol):
    """Something that lives in a world."""

    def next_event(self) -> int:
        """When something happens next by itself, strictly after the last ``advance``.

        :return: world time, ns; ``NEVER_NS`` if nothing will.
        """
        ...

    def advance(self, to_ns: int) -> None:
        """Carry this member to ``to_ns``.

        :param to_ns: world time, ns; not before the last one given.
        """
        ...


class World:
    """Members under one clock, advanced in the order of their events.

    :param clock: "virtual" starts at 0 ns; "real" is the machine's monotonic clock itself.
    """

    def __init__(self, clock: str):
        self.clock = clock
        self.virtual = clock == "virtual"
        self.members: dict[str, Member] = {}
        self.open_ports = 0
        self.lock = threading.RLock()
        self.changed = threading.Condition(self.lock)
        self.now_ns = 0 if self.virtual else time.monotonic_ns()
        self.next_ns = NEVER_NS
        """When the next thing happens here by itself, or ``NEVER_NS``."""

    def replan(self) -> None:
        """Look again for the next event; to be called when a member was handed something from outside."""
        self.next_ns = min([member.next_event() for member in self.members.values()], default=NEVER_NS)

    def advance(self, to_ns: int) -> None:
        """Carry every member to ``to_ns``.

        :param to_ns: world time, ns.
        :raises InputError: ``to_ns`` lies in the past.
        """
        if to_ns < self.now_ns:
            raise InputError(f"to_ns = {to_ns} lies before this world's {self.now_ns}; time only moves forward")
        while self.next_ns <= to_ns:
            self._step()
        self.now_ns = to_ns

    def pass_by(self, one: Member, to_ns: int, waits: Callable[[int], bool]) -> int | None:
        """Carry everybody through what others than ``one`` do, to ``to_ns`` at most; ends ahead of what ``one`` does itself.

        :param one: a member.
        :param to_ns: world time, ns.
        :param waits: asked with the time after each event; True ends it.
        :return: world time at which it was ended so, ns; None if it was not.
        """
        while (at_ns := self.next_ns) <= to_ns and one.next_event() > at_ns:
            self._step()
            if waits(at_ns):
                self.advance(at_ns)
                return at_ns
        return None

    def _step(self) -> None:
        """The next event."""
        at_ns = self.next_ns
        for member in self.members.values():
            member.advance(at_ns)
        self.now_ns = at_ns
        self.replan()

    def catch_up(self) -> int:
        """Bring a world on the real clock to now.

        :return: the world's time, ns.
        """
        if not self.virtual:
            self.advance(max(time.monotonic_ns(), self.now_ns))
        return self.now_ns

    def wait(self, until_ns: int) -> None:
        """Let time pass until ``until_ns``, or on the real clock until something was changed from outside.

        :param until_ns: world time, ns.
        """
        if self.virtual:
            self.advance(until_ns)
        else:
            self.changed.wait(max(until_ns - time.monotonic_ns(), 0) / 1e9)
            self.catch_up()


_named: dict[str, World] = {}
_named_lock = threading.Lock()


def enter(name: str | None, clock: str) -> World:
    """The world of that name, made if need be. Pair with ``leave``.

    :param name: of a world that ports share; None: a world of one's own.
    :param clock: "real" or "virtual".
    :return: the world, with one more open port.
    :raises InputError: the world exists and runs on the other clock.
    """
    with _named_lock:
        world = _named.get(name) if name else None
        if world is None:
            world = World(clock)
            if name:
                _named[name] = world
        if world.clock != clock:
            raise InputError(
                f"clock = {clock}: world = {name} runs already, on clock = {world.clock}; give every port in it the same clock"
            )
        world.open_ports += 1
        return world


def leave(name: str | None, world: World) -> None:
    """Give the world back; the last port to leave takes it away.

    :param name: as it was entered.
    :param world: what ``enter`` returned.
    """
    with _named_lock:
        world.open_ports -= 1
        if name and world.open_ports == 0:
            _named.pop(name, None)

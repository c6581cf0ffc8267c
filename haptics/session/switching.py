"""Arming, going off and clearing faults, as procedures: whoever serves the devices takes their steps, and no tick waits for them.

A procedure is a generator that yields what it waits for. ``Devices`` goes on with it after each look at the links.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator
from typing import Any, Literal, NamedTuple, Protocol

from haptics.devices import BrakeDriver, TactilesDriver
from haptics.errors import CommandRefused, HapticsError, LimitError
from haptics.link.commands import Pending
from haptics.link.connection import Link
from haptics.link.messages import State, Status
from haptics.link.readings import fault_names
from haptics.time import seconds_to_ns

ARM_TIMEOUT_S = 2.0
OFF_TIMEOUT_S = 1.0
ARMED_STATES = (State.ARMED, State.DRIVING)
Kind = Literal["arm", "off", "clear", "retire"]


class Until(NamedTuple):
    """What a procedure waits for.

    :param holds: asked at each step.
    :param timeout_s: it waits no longer, s.
    """

    holds: Callable[[], bool]
    timeout_s: float


Steps = Generator[Until, bool, None]


class Switched(Protocol):
    """What is armed and goes off: ``haptics.session.devices.Devices``, where each of these is described."""

    links: dict[str, Link]
    telemetry: dict[str, Any]
    latched: dict[str, tuple[str, ...]]
    tactiles: TactilesDriver | None
    brakes: BrakeDriver | None

    def now_ns(self) -> int: ...

    def drop_wishes(self) -> None: ...

    def stop_all(self) -> list[Pending]: ...

    def permit(self, names: Collection[str]) -> None: ...

    def permits(self, name: str) -> bool: ...

    def obeys(self, name: str) -> bool: ...

    def state_of(self, name: str) -> int | None: ...

    def pins_settled(self) -> bool: ...

    def note_pins_out(self) -> None: ...

    def to_arm(self) -> dict[str, Link]: ...

    def retire(self, name: str) -> None: ...


class Procedure:
    """Something that takes some ticks.

    :param kind: ``arm``, ``off``, ``clear`` or ``retire``.
    :param steps: what it does; told at each yield whether what it waited for holds, or time ran out.

    :ivar done: it has ended.
    :ivar error: why it failed; None if it did not, or has not ended.
    """

    def __init__(self, kind: Kind, steps: Steps):
        self.kind: Kind = kind
        self._steps = steps
        self._until: Until | None = None
        self._end_ns = 0
        self.done = False
        self.error: Exception | None = None

    def go_on(self, now_ns: int) -> None:
        """Do what can be done now.

        :param now_ns: ns on the devices' clock.
        """
        while not self.done:
            held = self._until is None or self._until.holds()
            if not held and now_ns < self._end_ns:
                return
            try:
                self._until = next(self._steps) if self._until is None else self._steps.send(held)
                self._end_ns = now_ns + seconds_to_ns(self._until.timeout_s)
            except StopIteration:
                self.done = True
            except Exception as error:
                self.done, self.error = True, error

    def cancel(self, why: str) -> None:
        """End it where it stands: going off stops every board on the way out.

        :param why: its error, from now on.
        """
        if not self.done:
            self.done, self.error = True, HapticsError(why)
            self._steps.close()


def arming(devices: Switched) -> Steps:
    """Arm every board; the brake controller tests itself first. Then every pin that may be out is withdrawn.

    A board that is armed already is stopped first, so that it drops what it was asked for. Before that its pins are withdrawn:
    where the other board would not arm, it is not armed either, and could not do so any more.

    :param devices: of the glove.
    :return: its steps.
    :raises CommandRefused: a board would not arm; everything is off then.
    :raises LimitError: a board did not reach its armed state, or left it while another armed.
    """
    if devices.tactiles is not None:
        devices.tactiles.end("ended")
    yield from _withdraw_pins(devices)
    devices.drop_wishes()
    try:
        yield from _stop_what_is_armed(devices)
        devices.telemetry.clear()  # what a board reported before it was armed is no news of now
        links = devices.to_arm()
        pendings = [link.arm(devices.now_ns()) for link in links.values()]
        for link, pending in zip(links.values(), pendings, strict=True):
            yield Until(lambda pending=pending: pending.done, ARM_TIMEOUT_S)
            _check_armed(link, pending)
        for name in links:
            if not (yield Until(lambda name=name: devices.state_of(name) in ARMED_STATES, ARM_TIMEOUT_S)):
                state = devices.state_of(name)
                seen = "nothing" if state is None else State(state).name.lower()
                raise LimitError(f"{name}: did not reach the armed state within {ARM_TIMEOUT_S:g} s; it reports {seen}")
        needed = [name for name in links if name in devices.to_arm()]  # a change of scene may have come in between
        for name in links.keys() - needed:
            links[name].stop(devices.now_ns())
        _check_obey(devices, needed, "while the other board armed")
        devices.permit(needed)
        array = devices.tactiles
        if array is not None and devices.permits("tactiles"):
            array.withdraw_all(devices.now_ns())
            yield Until(devices.pins_settled, OFF_TIMEOUT_S)
            _check_obey(devices, needed, "while pins were withdrawn")
            devices.note_pins_out()
    except HapticsError:
        yield from going_off(devices)
        raise


def _check_obey(devices: Switched, names: Collection[str], when: str) -> None:
    for name in names:
        if not devices.obeys(name):
            raise LimitError(f"{name}: disarmed itself {when}")


def _stop_what_is_armed(devices: Switched) -> Steps:
    """Boards armed by this host, or still by another, are stopped; what they had been asked for is gone then."""
    names = [name for name, link in devices.links.items() if link.armed or devices.state_of(name) in ARMED_STATES]
    for name in names:
        devices.telemetry.pop(name, None)
        devices.links[name].stop(devices.now_ns())
    rests = (State.DISARMED, State.FAULT)
    yield Until(lambda: all(devices.state_of(name) in rests for name in names), ARM_TIMEOUT_S)


def _check_armed(link: Link, pending: Pending) -> None:
    try:
        pending.result(link.name)
    except CommandRefused as error:
        if pending.status == Status.HOT:
            seen = f"coils are beyond what the board allows (mask {pending.detail or 0:#06x})"
            advice = "a driver was stuck on: look at it, and let them cool for some seconds"
            raise CommandRefused(link.name, seen, "arm", error.status, advice) from error
        latched = ", ".join(fault_names(pending.detail or 0))
        if pending.status != Status.INTERLOCK or not latched:
            raise
        advice = f"find out why, then clear it: clear() of an open glove, or haptics off --port {link.name}"
        raise CommandRefused(link.name, f"a fault is latched: {latched}", "arm", error.status, advice) from error


def going_off(devices: Switched) -> Steps:
    """Pins withdrawn, then volts to zero and bridges shorted, then disarmed. Does not fail for a link that is gone.

    Each board that is armed now goes off in this order, whatever happened to the other one, or to itself before.

    :param devices: of the glove.
    :return: its steps.
    """
    try:
        if devices.tactiles is not None:
            devices.tactiles.end("ended")
        if devices.brakes is not None:
            devices.brakes.end("ended")
        yield from _withdraw_pins(devices)
        yield from _drop_volts(devices)
    finally:  # also when it is cut short
        pendings = devices.stop_all()
    yield Until(lambda: all(pending.done for pending in pendings), OFF_TIMEOUT_S)


def _withdraw_pins(devices: Switched) -> Steps:
    array = devices.tactiles
    if array is not None and devices.permits("tactiles") and devices.obeys("tactiles"):
        array.withdraw_all(devices.now_ns())
        yield Until(devices.pins_settled, OFF_TIMEOUT_S)


def _drop_volts(devices: Switched) -> Steps:
    brakes = devices.brakes
    if brakes is not None and devices.obeys("brake"):
        brakes.release_all(devices.now_ns())
        yield Until(lambda: brakes.idle, OFF_TIMEOUT_S)


def retiring(devices: Switched) -> Steps:
    """Boards that are armed and of no use any more go off, one by one; the others go on.

    :param devices: of the glove.
    :return: its steps.
    """
    needed = devices.to_arm()
    array, brakes = devices.tactiles, devices.brakes
    if array is not None and "tactiles" not in needed and devices.permits("tactiles"):
        array.end("ended")
        yield from _withdraw_pins(devices)
        devices.retire("tactiles")
    if brakes is not None and "brake" not in needed and devices.permits("brake"):
        brakes.end("ended")
        yield from _drop_volts(devices)
        devices.retire("brake")


def clearing(devices: Switched) -> Steps:
    """Boards that are off clear what has latched, where its cause is gone; what stays, ``latched`` of the devices names.

    :param devices: of the glove.
    :return: its steps.
    """
    at_rest = {name: link for name, link in devices.links.items() if link.ready and not link.armed}
    pendings = {name: link.send("disarm", now_ns=devices.now_ns()) for name, link in at_rest.items()}
    yield Until(lambda: all(pending.done for pending in pendings.values()), OFF_TIMEOUT_S)
    for name, pending in pendings.items():
        if pending.ok:
            devices.latched[name] = tuple(fault_names(pending.detail or 0))

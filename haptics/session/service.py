"""The thread that serves an open glove in real time, and what it reports when it could not."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from haptics.errors import DeadManMissed, GloveEnded
from haptics.session.devices import TICK_NS, Devices
from haptics.time import NS_PER_MS, NS_PER_S

JOIN_S = 2.0
"""Longest wait for the thread, or for a call of another thread, when the glove is closed; boards are safe long before."""


def awake_ns() -> int:
    """A clock that goes on while the machine is suspended, where the system has one.

    :return: ns; only differences mean anything.
    """
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic_ns() if clock is None else time.clock_gettime_ns(clock)


class Service:
    """Ticks a glove each millisecond, from now on.

    Whatever it raises ends it: the glove goes off, and ``check`` raises from then on. A gap between two ticks longer than the
    boards' dead-man (the process was stopped, the machine slept or was too busy) is reported as soon as it is over.

    :param devices: of the glove.
    :param lock: held at each tick, and by whoever else uses the devices.
    :param tick: called at each tick with the time on the glove's clock (ns), after links were served.

    :ivar faults: what went wrong here, in words.
    """

    def __init__(self, devices: Devices, lock: threading.RLock, tick: Callable[[int], None]):
        self._devices, self._lock, self._tick = devices, lock, tick
        self._stopping = threading.Event()
        self._error: BaseException | None = None
        self._missed: str | None = None
        self._missed_when = 0  # how often the boards had been armed by then
        self.faults: list[str] = []
        self._served_ns = awake_ns()
        self._thread = threading.Thread(target=self._run, name="glove", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raise unless the glove is served.

        :raises GloveEnded: the thread ended, and why.
        :raises DeadManMissed: see there; until the glove is armed again.
        """
        if self._error is not None:
            raise GloveEnded(f"{self.faults[0]}; close the glove, and open it again") from self._error
        if self._missed is not None and self._devices.times_armed == self._missed_when:
            raise DeadManMissed(f"{self._missed}; off() clears that, and nothing plays until the glove is armed again")

    @property
    def ended(self) -> bool:
        """The thread ended by an error."""
        return self._error is not None

    @property
    def error(self) -> BaseException | None:
        """What ended it, if anything did."""
        return self._error

    @property
    def serves(self) -> bool:
        """Its thread ticks the glove, and is not the one that asks."""
        return not self.ended and not self._stopping.is_set() and self._thread is not threading.current_thread()

    def wait(self) -> None:
        """Let about one tick pass."""
        self._stopping.wait(TICK_NS / NS_PER_S)

    def catch_up(self) -> None:
        """Serve what is due, for a call that holds the lock: calls of many threads leave the service's own too few turns."""
        if not self.ended and not self._stopping.is_set() and awake_ns() - self._served_ns > TICK_NS:
            try:
                self.serve()
            except Exception as error:
                self._end(error)

    def stop(self) -> None:
        """End the thread, and wait for it at most ``JOIN_S``."""
        self._stopping.set()
        if self._thread is not threading.current_thread():
            self._thread.join(JOIN_S)

    def _run(self) -> None:
        while not self._stopping.is_set():
            time.sleep(TICK_NS / NS_PER_S)  # half of what waiting for the event with a time-out costs
            with self._lock:
                if self._stopping.is_set() or self.ended:
                    return
                try:
                    self.serve()
                except BaseException as error:
                    self._end(error)
                    return

    def serve(self) -> None:
        """One tick. After too long a gap nothing is ticked any more, and the glove goes off."""
        gap_ns = awake_ns() - self._served_ns
        missed = self._missed_for(gap_ns) if gap_ns > 2 * TICK_NS else ()  # no dead-man is as short
        self._devices.follow(self._devices.now_ns())
        if missed:
            self._missed = (
                f"{', '.join(missed)}: dead-man, as the host did not serve the glove for {gap_ns / NS_PER_S:.2f} s "
                "(stopped, suspended or too busy)"
            )
            self._missed_when = self._devices.times_armed
            self.faults.append(self._missed)
            self._devices.begin("off")
        else:
            self._tick(self._devices.now_ns())
        self._served_ns = awake_ns()

    def _missed_for(self, gap_ns: int) -> list[str]:
        """Armed boards that wait less long than this for their host."""
        return [name for name, link in self._devices.links.items() if link.armed and gap_ns > _dead_man_ns(link.identity)]

    def _end(self, error: BaseException) -> None:
        self.faults.insert(0, f"the thread that serves the glove ended: {type(error).__name__}: {error}")
        self._error = error
        try:
            go_off(self._devices)
        except BaseException as again:  # the boards were stopped; what else is wrong is for people
            self.faults.append(f"going off in good order failed: {type(again).__name__}: {again}")


def go_off(devices: Devices) -> None:
    """Off, in good order; where that fails, a stop to every board.

    :param devices: of the glove.
    :raises BaseException: what failed.
    """
    try:
        devices.off()
    except BaseException:
        for link in devices.links.values():
            link.stop(devices.now_ns())
        raise


def _dead_man_ns(identity: object) -> int:
    return getattr(identity, "dead_man", 100) * NS_PER_MS

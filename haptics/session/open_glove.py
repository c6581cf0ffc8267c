"""A glove for scripts: ``haptics.open``, plain calls, and off again however the script ends."""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from os import PathLike
from types import TracebackType
from typing import Any

from haptics.devices import Result, TactilesDriver
from haptics.ends import orderly, unbroken
from haptics.errors import GloveEnded, HapticsError, InputError
from haptics.link.events import Event, Telemetry
from haptics.link.ports import check_port
from haptics.session.configuration import BrakeConfiguration, load_configuration
from haptics.session.glove import LONGEST_STEP_S, Glove
from haptics.session.glove_state import GloveState, glove_state
from haptics.session.service import JOIN_S, Service, go_off
from haptics.time import seconds_to_ns
from haptics.units import number, one_of, whole_number


class OpenGlove:
    """A glove for scripts: plain calls, in the background's real time or in stepped virtual time.

    It is served from its opening on. Use it as a context manager, or call ``close``: both go off, by whatever way they are left.
    Inside ``with``, in the main thread, SIGTERM and SIGHUP leave it like Ctrl-C (``haptics.ends.orderly``).
    Calls may come from several threads; each waits for the one before. Once it is closed, or the thread that serves it has ended,
    every call raises ``GloveEnded`` (after the latter, ``state``, ``off`` and ``close`` still answer).
    """

    def __init__(self, glove: Glove, brake: BrakeConfiguration):
        self._glove, self._brake = glove, brake
        self._lock = threading.RLock()
        self._closing = threading.RLock()
        self._ending = self._closed = False
        self._ends = ExitStack()
        self._telemetry: dict[str, Telemetry] = {}
        self._process = os.getpid()
        glove.on_event(self._note)
        try:
            self._service = Service(glove, self._lock) if glove.realtime else None
        except BaseException:  # no thread to be had
            glove.close()
            raise
        if glove.realtime:
            atexit.register(self.close)

    def __enter__(self) -> OpenGlove:
        with self._use():
            self._ends.enter_context(orderly())
            return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            with unbroken:
                self.close()
        finally:
            self._ends.__exit__(kind, error, trace)

    def arm(self) -> None:
        """Arm every board.

        :raises HapticsError: a board would not.
        """
        with self._use(missed_allowed=True) as glove:
            glove.arm()
            if self._service is not None:
                self._service.served(armed=True)

    def contact(self, site: str) -> None:
        """The pin of a site comes out and stays.

        :raises InputError: no such site, or this glove has no array.
        """
        with self._use() as glove:
            array = self._array()
            array.contact(one_of("site", site, array.sites), glove.now_ns())

    def release(self, site: str) -> None:
        """The pin of a site goes back.

        :raises InputError: no such site, or this glove has no array.
        """
        with self._use() as glove:
            array = self._array()
            array.release(one_of("site", site, array.sites), glove.now_ns())

    def pulse(self, site: str, count: int = 1, rate_hz: float = 50.0) -> None:
        """``count`` pulses at ``rate_hz`` (1 to 100 Hz); each may be denied by heat or current, and :meth:`results` says so.

        :raises InputError: no such site, a count that is no integer from 1 to 1000, or a rate outside its range.
        """
        with self._use() as glove:
            array = self._array()
            one_of("site", site, array.sites)
            count = whole_number("count", count, 1, 1000)
            period_ns = seconds_to_ns(1.0 / number("rate_hz", rate_hz, 1.0, 100.0, "Hz"))
            array.train(site, count, period_ns, glove.now_ns())

    def brake(self, name: str, force_n: float | None = None, volts: float | None = None, ttl_s: float = 0.2) -> float:
        """Hold a brake for ``ttl_s`` (1 ms to 60 s), by force (volts from the fitted law) or by volts; returns the volts.

        :raises InputError: neither or both given, out of range, unknown brake, or this glove has no brakes.
        """
        with self._use() as glove:
            brakes = glove.brakes
            if brakes is None:
                raise InputError("this glove has no brake controller; allowed: open it with brake=…")
            one_of("name", name, brakes.channels)
            ttl_s = number("ttl_s", ttl_s, 0.001, 60.0, "s")
            volts = self._volts(name, force_n, volts, brakes.max_amplitude_v)
            brakes.engage(name, volts, glove.now_ns(), ttl_s=ttl_s)
            return volts

    def results(self) -> list[Result]:
        """What became of what was asked for, since the last call: of each contact, release, pulse and brake.

        A brake gives another result, not played, where a board did not go on holding it.
        """
        with self._use(missed_allowed=True) as glove:
            return [one for driver in (glove.tactiles, glove.brakes) if driver is not None for one in driver.take_results()]

    def state(self) -> GloveState:
        """Temperatures, pins, volts, faults, and how old what boards said is."""
        with self._use(missed_allowed=True, ended_allowed=True) as glove:
            return glove_state(glove, self._telemetry, () if self._service is None else self._service.faults)

    def advance(self, seconds: float) -> None:
        """Let virtual time pass.

        :raises InputError: not 0 to a million seconds, or the glove runs in real time.
        """
        seconds = number("seconds", seconds, 0.0, LONGEST_STEP_S, "s")
        with self._use() as glove:
            glove.step_to(glove.now_ns() + seconds_to_ns(seconds))

    def off(self) -> None:
        """Pins withdrawn, volts zero, disarmed; then faults that have latched are cleared, as ``haptics off`` does.

        Those whose cause is still there stay, and ``arm`` names them. ``close``, and the end of a ``with``, clear none.
        """
        with self._use(missed_allowed=True, ended_allowed=True) as glove:
            self._all_off(glove.clear_faults)
            if self._service is not None:
                self._service.served()

    def close(self) -> None:
        """Go off and close the ports, whatever goes wrong meanwhile. A second call does nothing.

        :raises HapticsError: a call of another thread does not end, so that boards were left to their dead-man.
        """
        with self._closing:
            if self._closed or os.getpid() != self._process:  # the ports are another process's, and its boards go on
                return
            self._ending = True
            try:
                self._go_off()
            finally:
                self._closed = True
                atexit.unregister(self.close)
                try:
                    self._glove.close()
                except BaseException:  # interrupted between two ports
                    self._glove.close()
                    raise

    def _go_off(self) -> None:
        if self._service is not None:
            self._service.stop()
        if not self._lock.acquire(timeout=JOIN_S):
            raise HapticsError(
                f"the glove was closed without going off: a call of another thread has not ended for {JOIN_S:g} s; boards that "
                "hear nothing more make themselves safe by their dead-man, pins stay as they are"
            )
        try:
            self._all_off()
        finally:
            self._lock.release()

    def _all_off(self, then: Callable[[], None] = lambda: None) -> None:
        try:
            go_off(self._glove)
            then()
        except Exception:
            if self._service is None or not self._service.ended:  # else it was reported already, and boards were told to stop
                raise

    @contextmanager
    def _use(self, missed_allowed: bool = False, ended_allowed: bool = False) -> Iterator[Glove]:
        """The glove, for one call alone.

        :raises GloveEnded: it is closed, no longer served, or another process's.
        :raises DeadManMissed: boards made themselves safe meanwhile.
        """
        if os.getpid() != self._process:  # before the lock, which a thread that is not here may hold
            raise GloveEnded(f"this glove is served by process {self._process}, which forked this one; allowed: to use it there")
        with self._lock:
            if self._ending:
                raise GloveEnded("this glove is closed; allowed: haptics.open another")
            service = self._service
            if service is not None:
                service.catch_up()
            if service is not None and not (ended_allowed if service.ended else missed_allowed):
                service.check()
            yield self._glove

    def _note(self, board: str, event: Event) -> None:
        if isinstance(event, Telemetry):
            self._telemetry[board] = event

    def _volts(self, name: str, force_n: object, volts: object, max_v: float) -> float:
        """Volts for a brake, given by exactly one of its force and its volts."""
        if (force_n is None) == (volts is None):
            raise InputError(f"force_n = {force_n}, volts = {volts}; allowed: exactly one of them")
        if force_n is None:
            return number("volts", volts, 0.0, max_v, "V")
        law, overlap_m2 = self._brake.law(name)
        # The thumb's law is fitted to 800 V; a brake may be driven to the setpoint's limit all the same.
        held_n = law.force_n(max_v, overlap_m2, extrapolate=True)
        asked_n = number("force_n", force_n, 0.0, 1e6, "N")
        if asked_n > held_n:
            needed_v = law.volts_for(asked_n, overlap_m2, extrapolate=True)
            raise InputError(
                f"force_n = {asked_n:g} N needs {needed_v:.0f} V; allowed: 0 to {held_n:.3g} N, "
                f"what the {name} brake holds at {max_v:g} V"
            )
        return min(law.volts_for(asked_n, overlap_m2, extrapolate=True), max_v)

    def _array(self) -> TactilesDriver:
        if self._glove.tactiles is None:
            raise InputError("this glove has no tactor array; allowed: open it with tactiles=…")
        return self._glove.tactiles


def open(
    config: str | PathLike[str] | None = None,
    *,
    tactiles: str | None = None,
    brake: str | None = None,
    clock: str = "real",
    seed: int = 1,
) -> OpenGlove:
    """Open a glove: by configuration file, or by naming ports; what is named by neither is left out.

    :param clock: ``real``, or ``virtual`` to step simulated boards with ``advance``.
    :raises HapticsError: a file, port or board that cannot be used.
    """
    one_of("clock", clock, ("real", "virtual"))
    seed = whole_number("seed", seed, 0, 2**32 - 1)
    for name, url in (("tactiles", tactiles), ("brake", brake)):
        if url is not None:
            check_port(url, name)
    configuration = load_configuration(config)
    parts: dict[str, Any] = {"tactiles": configuration.tactiles, "brake": configuration.brake}
    for name, url in (("tactiles", tactiles), ("brake", brake)):
        if url is not None:
            parts[name] = parts[name].model_copy(update={"port": url})
        elif config is None and (tactiles or brake):
            parts[name] = None
    return OpenGlove(Glove(parts["tactiles"], parts["brake"], realtime=clock == "real", seed=seed), configuration.brake)

"""A glove for programs: ``haptics.open``, plain calls, and off again however the program ends."""

from __future__ import annotations

import atexit
import os
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from os import PathLike
from types import TracebackType
from typing import Literal, Protocol

from haptics.devices import Refusal, Result
from haptics.devices.sharing import PROGRAM
from haptics.ends import orderly, unbroken
from haptics.errors import GloveEnded, HapticsError, InputError
from haptics.link.events import Event, Telemetry
from haptics.link.ports import check_board_port
from haptics.session.composition import with_ports
from haptics.session.configuration import Configuration, load_configuration
from haptics.session.devices import LONGEST_STEP_S, TICK_NS, Devices
from haptics.session.glove_calls import GloveCalls
from haptics.session.glove_recording import GloveRecording
from haptics.session.glove_state import (
    GloveIdentity,
    GloveState,
    GloveTelemetry,
    glove_identity,
    glove_state,
    glove_telemetry,
)
from haptics.session.plant_truth import PlantTruth
from haptics.session.recorder import Recorder
from haptics.session.sampler import Sampler
from haptics.session.service import JOIN_S, Service, go_off
from haptics.session.switching import Procedure
from haptics.time import seconds_to_ns
from haptics.units import file_path, known_arguments, number, one_of, truth, whole_number

RESULTS_KEPT = 10_000
"""Results that nobody has asked for yet; a program that never asks costs no more memory than that."""


class Rendered(Protocol):
    """A session on a glove: what ticks the devices in the glove's place."""

    @property
    def begun(self) -> bool:
        """Whether it is to be ticked."""
        ...

    def serve(self, now_ns: int) -> None:
        """Tick.

        :param now_ns: ns on the glove's clock.
        """
        ...

    def settle(self) -> None:
        """Collect what came out last."""
        ...

    def leave(self) -> None:
        """Another session takes its place."""
        ...

    def plants(self) -> PlantTruth | None:
        """What the simulated plants are now.

        :return: the truth, or None on hardware.
        """
        ...


class Glove(GloveCalls):
    """A glove: plain calls, in the background's real time or in stepped virtual time. ``haptics.open`` makes one.

    It is served from its opening on. Use it as a context manager, or call ``close``: both go off, however they are left. Inside
    ``with``, in the main thread, SIGTERM and SIGHUP leave it like Ctrl-C (``haptics.ends.orderly``). Calls may come from several
    threads; each waits for the one before. Once it is closed, or the thread that serves it has ended, every call raises
    ``GloveEnded`` (after the latter, ``state``, ``off`` and ``close`` still answer).

    :param devices: open; the glove closes them.
    :param configuration: they were opened with.
    :param recording: begun here, or None.
    :param seed: of simulated boards, for the recording's header.

    :ivar devices: ports, links and drivers, for who needs more than the calls here; take :meth:`turn` around their use.
    :ivar configuration: what the glove was opened with.
    :ivar recorder: takes rows of the recording, or None.
    """

    def __init__(self, devices: Devices, configuration: Configuration, recording: GloveRecording | None = None, seed: int = 1):
        self.devices, self.configuration, self._recording = devices, configuration, recording
        self.recorder: Recorder | None = None
        self._lock = threading.RLock()
        self._closing = threading.RLock()
        self._ending = self._closed = False
        self._ends = ExitStack()
        self._telemetry: dict[str, Telemetry] = {}
        self._results: deque[Result] = deque(maxlen=RESULTS_KEPT)  # not asked for yet
        self._session: Rendered | None = None
        self._process = os.getpid()
        devices.on_event(self._note)
        devices.on_result(self._take_result)
        try:
            if recording is not None:
                self.recorder = recording.begin(devices, configuration, seed)
            self._sampler = Sampler(devices, self.recorder)
            self._service = Service(devices, self._lock, self._tick) if devices.realtime else None
        except BaseException as error:  # no disk, or no thread to be had
            devices.close()
            if recording is not None:
                recording.end(error)
            raise
        if devices.realtime:
            atexit.register(self.close)

    def __enter__(self) -> Glove:
        with self.turn():
            self._ends.enter_context(orderly())
            return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            with unbroken:
                self.close()
        finally:
            self._ends.__exit__(kind, error, trace)

    # Calls ----------------------------------------------------------------------------------------------------------

    def arm(self) -> None:
        """Arm every board, and withdraw every pin that may be out; nothing is energised before.

        What was asked for until now is forgotten. In real time calls of other threads, and a session, go on meanwhile.

        :raises HapticsError: a board would not, as a fault is latched for instance; everything is off then.
        """
        with self.turn(missed_allowed=True) as devices:
            procedure = devices.begin("arm")
        try:
            self._finish(procedure)
        except BaseException:
            with self.turn(missed_allowed=True, ended_allowed=True) as devices:
                going_off = devices.begin("off")
            self._finish(going_off)
            raise

    def begin_arming(self) -> Procedure:
        """Begin to arm, and do not wait: ``done`` and ``error`` of what is returned tell how it went, as :meth:`arm` does.

        :return: the procedure; the glove's thread, or ``advance`` in virtual time, goes on with it.
        """
        with self.turn(missed_allowed=True) as devices:
            return devices.begin("arm")

    def clear(self) -> Mapping[str, tuple[str, ...]]:
        """Clear faults that have latched, where their cause is gone. For a person to ask for, of a glove that is off.

        :return: by board, what stays latched; arming is refused until that is gone.
        :raises HapticsError: a board is armed; go off first.
        """
        with self.turn(missed_allowed=True) as devices:
            if devices.doing == "arm":
                raise HapticsError("the glove is arming; faults are cleared of boards that are off, so call off() first")
            if armed := [name for name, link in devices.links.items() if link.armed]:
                raise HapticsError(
                    f"{' and '.join(armed)}: armed; faults are cleared of boards that are off, so call off() first"
                )
            procedure = devices.begin("clear")
        self._finish(procedure)
        return {name: faults for name, faults in self.devices.latched.items() if faults}

    def _finish(self, procedure: Procedure) -> None:
        """Wait until it has ended; the thread that serves the glove goes on with it meanwhile."""
        while self._service is not None and self._service.serves and not procedure.done:
            with self.turn(missed_allowed=True, ended_allowed=True):
                pass
            self._service.wait()
        if procedure.done:
            if procedure.error is not None:
                raise procedure.error
            return
        with self.turn(missed_allowed=True, ended_allowed=True) as devices:
            devices.finish(procedure)

    @known_arguments
    def advance(self, seconds: float) -> None:
        """Let virtual time pass.

        :param seconds: 0 to a million.
        :raises InputError: out of range, or the glove runs in real time.
        """
        seconds = number("seconds", seconds, 0.0, LONGEST_STEP_S, "s")
        with self.turn() as devices:
            if devices.realtime:
                raise InputError("time of this glove passes by itself; only one opened with clock='virtual' can be advanced")
            end_ns = devices.now_ns() + seconds_to_ns(seconds)
            while (now_ns := devices.now_ns()) < end_ns:
                devices.follow(min(now_ns + TICK_NS, end_ns))
                self._tick(devices.now_ns())

    def off(self) -> None:
        """Pins withdrawn, volts zero, disarmed; then latched faults are cleared, as ``haptics off`` does.

        Those whose cause is still there stay, and ``arm`` names them. ``close``, and the end of a ``with``, clear none.
        """
        with self.turn(missed_allowed=True, ended_allowed=True) as devices:
            going_off = devices.begin("off")
            clearing = devices.begin("clear")
        try:
            self._finish(going_off)
            self._finish(clearing)
        except Exception:
            if self._service is None or not self._service.ended:  # else it was reported already, and boards were stopped
                raise
        except BaseException:
            going_off.cancel("going off was cut short; every board was stopped")
            raise

    def close(self) -> None:
        """Go off and close the ports, whatever goes wrong meanwhile; a recording is made whole. A second call does nothing.

        :raises HapticsError: a call of another thread does not end, so that boards were left to their dead-man; or no recording
            could be made.
        """
        with self._closing:
            if self._closed or os.getpid() != self._process:  # the ports are another process's, and its boards go on
                return
            self._ending = True
            trouble: BaseException | None = None
            try:
                self._go_off()
            except BaseException as error:
                trouble = error
                raise
            finally:
                self._closed = True
                atexit.unregister(self.close)
                try:
                    self.devices.close()
                except BaseException:  # interrupted between two ports
                    self.devices.close()
                    raise
                finally:
                    if self._recording is not None:
                        self._recording.end(trouble if self._service is None else trouble or self._service.error)

    # What is known --------------------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """The glove's clock, on which poses, results and state have their times.

        :return: ns; of the machine's monotonic clock in real time, from 0 in virtual time.
        """
        return self.devices.now_ns()

    def results(self) -> list[Result]:
        """What became of what was asked for: of each contact, release, pulse, burst, brake and piezo.

        A brake gives another result, not played, where a board did not go on holding it. What a session on the glove asked for is
        in its own ``results`` and ``brake_results``.

        :return: results since the last call, of the last ten thousand.
        """
        with self.turn(missed_allowed=True) as devices:
            devices.hand_on_results()
            results = list(self._results)
            self._results.clear()
            return results

    def state(self) -> GloveState:
        """What the host knows of the glove.

        :return: temperatures, pins, volts, forces, faults, and how old what boards reported is.
        """
        with self.turn(missed_allowed=True, ended_allowed=True) as devices:
            faults = () if self._service is None else self._service.faults
            return glove_state(devices, self.configuration.brake, self._telemetry, faults)

    def telemetry(self) -> GloveTelemetry:
        """What boards reported last.

        :return: by board, in SI units.
        """
        with self.turn(missed_allowed=True, ended_allowed=True):
            return glove_telemetry(self._telemetry)

    def identity(self) -> GloveIdentity:
        """Who the boards are, and the limits that they enforce.

        :return: by board.
        """
        with self.turn(missed_allowed=True, ended_allowed=True) as devices:
            return glove_identity(devices)

    def truth(self) -> PlantTruth | None:
        """What the simulated plants are now, whatever boards report of them.

        :return: the truth, or None on hardware.
        """
        with self.turn(missed_allowed=True, ended_allowed=True):
            return self._sampler.look() if self._session is None else self._session.plants()

    # Sessions -------------------------------------------------------------------------------------------------------

    @contextmanager
    def turn(self, missed_allowed: bool = False, ended_allowed: bool = False) -> Iterator[Devices]:
        """The glove's devices, for one call alone; the thread that serves them waits meanwhile, so be quick.

        :param missed_allowed: also while the boards have made themselves safe for want of their host.
        :param ended_allowed: also after the thread that served the glove has ended.
        :return: the devices.
        :raises GloveEnded: it is closed, no longer served, or another process's.
        :raises DeadManMissed: boards made themselves safe meanwhile.
        """
        if os.getpid() != self._process:  # before the lock, which a thread that is not here may hold
            raise GloveEnded(f"this glove is served by process {self._process}, which forked this one; use it there")
        with self._lock:
            if self._ending:
                raise GloveEnded("this glove is closed; open another with haptics.open")
            service = self._service
            if service is not None:
                service.catch_up()
            if service is not None and not (ended_allowed if service.ended else missed_allowed):
                service.check()
            yield self.devices

    def take_on(self, session: Rendered) -> None:
        """From when it has begun, a session is ticked in the drivers' place; one that was there before is no longer.

        :param session: on this glove.
        """
        with self.turn(missed_allowed=True):
            if self._session is not None and self._session is not session:
                self._session.leave()
            self._session = session

    def let_go_of(self, session: Rendered) -> None:
        """A session has ended.

        :param session: nothing happens if another one has taken its place.
        """
        with self.turn(missed_allowed=True, ended_allowed=True):
            if self._session is session:
                self._session = None

    # ------------------------------------------------------------------------------------------------------------------

    def _tick(self, now_ns: int) -> None:
        if self._session is not None and self._session.begun:
            self._session.serve(now_ns)
            return
        self.devices.tick(now_ns)
        if self.recorder is not None:
            self._sampler.due(now_ns)
            self.recorder.acknowledge(now_ns)

    def _take_result(self, now_ns: int, one: Result | Refusal) -> None:
        if isinstance(one, Result) and one.owner == PROGRAM:
            self._results.append(one)

    def _go_off(self) -> None:
        if self._service is not None:
            self._service.stop()
        if not self._lock.acquire(timeout=JOIN_S):
            raise HapticsError(
                f"the glove was closed without going off: a call of another thread has not ended for {JOIN_S:g} s; boards that "
                "hear nothing more make themselves safe by their dead-man, pins stay as they are"
            )
        try:
            if self._recording is not None:
                self._recording.hold_errors()
            self._off_at_last()
            self._settle()
        finally:
            self._lock.release()

    def _settle(self) -> None:
        """What came out while the glove went off."""
        if self._session is not None and self._session.begun:
            self._session.settle()
        elif self.recorder is not None:
            self.devices.hand_on_results()
            self._sampler.sample(self.devices.now_ns())

    def _off_at_last(self) -> None:
        try:
            go_off(self.devices)
        except Exception:
            if self._service is None or not self._service.ended:  # else it was reported already, and boards were stopped
                raise

    def _note(self, board: str, event: Event) -> None:
        if isinstance(event, Telemetry):
            self._telemetry[board] = event


@known_arguments
def open(
    config: str | PathLike[str] | Configuration | None = None,
    *,
    tactiles: str | None = None,
    brake: str | None = None,
    clock: Literal["real", "virtual"] = "real",
    seed: int = 1,
    record: str | PathLike[str] | None = None,
    force: bool = False,
) -> Glove:
    """Open a glove: by configuration, or by naming ports; a board that is named by neither is left out.

    :param config: a file (``glove.toml``), what ``load_configuration`` made of one, or None: the defaults, on simulated boards.
    :param tactiles: port URL of the tactor array, instead of the configuration's.
    :param brake: port URL of the brake controller, likewise. Without ``config``, naming one port leaves out the other board.
    :param clock: ``real``, in which a thread serves the glove; ``virtual`` to step simulated boards with ``advance``.
    :param seed: of simulated boards, 0 to 2**32 - 1.
    :param record: HDF5 file to record all of it in, finished by ``close``; None records nothing.
    :param force: overwrite a recording that exists.
    :return: the glove, open and not armed.
    :raises HapticsError: a file, port or board that cannot be used.
    """
    one_of("clock", clock, ("real", "virtual"))
    seed = whole_number("seed", seed, 0, 2**32 - 1)
    for name, url in (("tactiles", tactiles), ("brake", brake)):
        if url is not None:
            check_board_port(url, name, name)
    recording = None if record is None else GloveRecording(file_path("record", record), truth("force", force))
    configuration = config if isinstance(config, Configuration) else load_configuration(config)
    configuration = with_ports(configuration, tactiles, brake)
    some = config is None and (tactiles is not None or brake is not None)
    devices = Devices(
        None if some and tactiles is None else configuration.tactiles,
        None if some and brake is None else configuration.brake,
        realtime=clock == "real",
        seed=seed,
        wire_tap=None if recording is None else recording.wire,
    )
    return Glove(devices, configuration, recording, seed)

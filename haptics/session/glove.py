"""One glove: ports opened, links up, drivers ready, and off again on every exit.

``Glove`` is the composition that runs, scripts and the render session share. In virtual time its owner steps it
(``step_to``); in real time its owner's loop serves links and drivers (``haptics.open`` starts a thread that does).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

from haptics.devices import BrakeDriver, TactilesDriver
from haptics.errors import InputError, LimitError
from haptics.link.connection import Link
from haptics.link.events import Disarmed, Event, FaultReported, Lost, Rebooted, Telemetry
from haptics.link.messages import Board, Fault, State
from haptics.link.polling import PollingRunner
from haptics.link.ports import open_port
from haptics.link.runner import VirtualRunner, connect, finish
from haptics.link.session import LinkSession
from haptics.link.simulated import SimulatedPort, simulated
from haptics.physics.brake_force import default_law
from haptics.physics.thermal import ThermalParameters
from haptics.scheduling import CoilLimits, ThermalBudget
from haptics.session.configuration import BrakeConfiguration, TactilesConfiguration, load_configuration
from haptics.time import NS_PER_MS, NS_PER_S, MonotonicClock, VirtualClock, seconds_to_ns
from haptics.units import in_range

TICK_NS = NS_PER_MS
ARM_TIMEOUT_S = 2.0
OFF_TIMEOUT_S = 1.0
HANDOVER_S = 100e-6
"""Pause between two pulses that share a coil or its share of the current: more than a clock estimate moves between them."""
WireTap = Callable[[str, int, bool, bytes], None]


@dataclass(frozen=True, slots=True)
class GloveState:
    """What the host knows of the glove now."""

    time_ns: int
    rise_k: dict[str, float]
    headroom_k: dict[str, float]
    pins_out: tuple[str, ...]
    volts: dict[str, float]
    capacitance_pf: dict[str, int]
    armed: tuple[str, ...]
    faults: tuple[str, ...]


def with_defaults(url: str, **defaults: object) -> str:
    """A ``sim://`` URL with query keys it does not name filled in; any other URL unchanged."""
    if not url.startswith("sim://"):
        return url
    parts = urlsplit(url)
    query = dict(parse_qsl(parts.query, keep_blank_values=True))
    for key, value in defaults.items():
        query.setdefault(key, str(value))
    return f"sim://{parts.netloc}?{urlencode(query)}" if query else url


class Glove:
    """The devices of one glove.

    :param tactiles: configuration of the array, or None to leave it out.
    :param brake: configuration of the brake controller, or None to leave it out.
    :param realtime: on the machine's clock (needed for hardware) rather than in virtual time.
    :param seed: of the simulated boards. :param levels: model level of each simulated board, by name.
    :param wire_tap: called with port name, time, direction (True: to the board) and bytes.
    :raises InputError: a real port in virtual time.
    :raises LinkError: a port or board that cannot be used; what was opened is closed again.
    """

    def __init__(
        self,
        tactiles: TactilesConfiguration | None,
        brake: BrakeConfiguration | None,
        *,
        realtime: bool,
        seed: int = 1,
        levels: dict[str, str] | None = None,
        wire_tap: WireTap | None = None,
    ):
        self.realtime = realtime
        self.clock: VirtualClock | MonotonicClock = MonotonicClock() if realtime else VirtualClock()
        self.links: dict[str, Link] = {}
        self.faults: list[str] = []
        self.telemetry: dict[str, Any] = {}
        self._event_sinks: list[Callable[[str, Event], None]] = []
        self._opened = False
        self._wanted_armed = False
        asked = {"tactiles": tactiles, "brake": brake}
        try:
            for name, part in asked.items():
                if part is not None:
                    self.links[name] = self._open(name, part, seed, (levels or {}).get(name), wire_tap)
            links = list(self.links.values())
            self._runner: VirtualRunner | PollingRunner = (
                PollingRunner(links, self.clock) if realtime else VirtualRunner(links, self._virtual_clock)
            )
        except BaseException:
            for link in self.links.values():
                link.close()
            raise
        self._opened = True
        self.tactiles = None if tactiles is None else self._tactiles_driver(tactiles)
        self.brakes = None if brake is None else self._brake_driver(brake)
        try:
            connect(self._runner)
        except BaseException:
            self.close()
            raise

    # Opening --------------------------------------------------------------------------------------------------------

    @property
    def _virtual_clock(self) -> VirtualClock:
        assert isinstance(self.clock, VirtualClock)
        return self.clock

    def _open(
        self, name: str, part: TactilesConfiguration | BrakeConfiguration, seed: int, level: str | None, wire_tap: WireTap | None
    ) -> Link:
        defaults: dict[str, object] = {"clock": "real" if self.realtime else "virtual", "seed": seed}
        if level is not None and part.port.startswith(f"sim://{name}"):
            defaults["level"] = level
        url = with_defaults(part.port, **defaults)
        if not self.realtime and not url.startswith("sim://"):
            raise InputError(f"port = {part.port!r} lives in real time; allowed without --realtime: sim://… ports")
        port = open_port(url, part.baud)
        if not self.realtime and dict(parse_qsl(urlsplit(url).query)).get("clock") != "virtual":
            port.close()
            raise InputError(f"port = {part.port!r} asks for the real clock; allowed without --realtime: clock=virtual")

        def tap(time_ns: int, direction: str, data: bytes) -> None:
            if wire_tap is not None:
                wire_tap(name, time_ns, direction == "out", data)

        return Link(port, LinkSession(Board[name.upper()], part.port, tap=tap))

    def _tactiles_driver(self, part: TactilesConfiguration) -> TactilesDriver:
        budgets, powers = [], []
        for site in part.sites:
            own = part.calibration.get(site)
            parameters = ThermalParameters() if own is None else ThermalParameters(tau_s=own.tau_s, c_k_per_w=own.c_k_per_w)
            budgets.append(ThermalBudget(parameters, part.rise_limit_k))
            powers.append(18.0 if own is None else own.power_w)
        limits = CoilLimits(part.current_limit_a, part.coil_current_a, tuple(powers), HANDOVER_S)
        return TactilesDriver(self.links["tactiles"], part.sites, limits, budgets, part.contact_pulse_s)

    def _brake_driver(self, part: BrakeConfiguration) -> BrakeDriver:
        return BrakeDriver(self.links["brake"], part.channels, part.frequency_hz, part.ttl_s)

    # Time -----------------------------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """The glove's time."""
        return self.clock.now_ns()

    def on_event(self, sink: Callable[[str, Event], None]) -> None:
        """Call ``sink(board, event)`` for what links report."""
        self._event_sinks.append(sink)

    def follow(self, to_ns: int) -> None:
        """Bring links (and in virtual time boards) to ``to_ns`` and take in what they report; drivers are not ticked."""
        if isinstance(self._runner, VirtualRunner):
            self._runner.run_until(to_ns)
        else:
            self._runner.poll()
        for name, link in self.links.items():
            for event in link.events():
                self._take(name, event)

    def tick(self, now_ns: int) -> None:
        """Tick the drivers."""
        if self.tactiles is not None:
            self.tactiles.tick(now_ns)
        if self.brakes is not None:
            self.brakes.tick(now_ns)

    def step_to(self, to_ns: int) -> None:
        """Tick every millisecond until ``to_ns``; in virtual time only.

        :raises InputError: the glove runs in real time, which cannot be stepped.
        """
        if self.realtime:
            raise InputError("a glove in real time cannot be stepped; allowed: clock='virtual'")
        while self.now_ns() < to_ns:
            self.follow(min(self.now_ns() + TICK_NS, to_ns))
            self.tick(self.now_ns())

    def _take(self, name: str, event: Event) -> None:
        if isinstance(event, Telemetry):
            self.telemetry[name] = event.message
            self._read_faults(name, event.message)
        elif isinstance(event, FaultReported):
            label = event.fault.name.lower() if isinstance(event.fault, Fault) else f"fault {event.fault}"
            self._fault(f"{name}: {label}, channel {event.channel}, value {event.value}")
        elif isinstance(event, Rebooted):
            self._fault(f"{name}: the board rebooted; it stays disarmed until armed by hand")
            self._forbid(name)
        elif isinstance(event, Disarmed):
            if self._wanted_armed:
                self._fault(f"{name}: disarmed by itself ({event.reason})")
            self._forbid(name)
        elif isinstance(event, Lost):
            self._fault(f"{name}: {event.error}")
            self._forbid(name)
        for sink in self._event_sinks:
            sink(name, event)

    def _read_faults(self, name: str, message: Any) -> None:
        if message.faults and self._wanted_armed:
            names = [fault.name.lower() for fault in Fault if message.faults >> fault & 1]
            self._fault(f"{name}: {', '.join(names)}")

    def _fault(self, text: str) -> None:
        if text not in self.faults:
            self.faults.append(text)

    def _forbid(self, name: str) -> None:
        if name == "tactiles" and self.tactiles is not None:
            self.tactiles.set_armed(False)

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass with drivers ticking until ``condition`` holds."""
        end_ns = self.now_ns() + seconds_to_ns(timeout_s)
        while not condition():
            now_ns = self.now_ns()
            if now_ns >= end_ns:
                return False
            if self.realtime:
                self._runner.wait_for(condition, TICK_NS / NS_PER_S)
                self.follow(self.now_ns())
            else:
                self.follow(now_ns + TICK_NS)
            self.tick(self.now_ns())
        return True

    # Arming and going off -------------------------------------------------------------------------------------------

    def arm(self) -> None:
        """Arm every board, explicitly; the brake controller tests itself first.

        :raises CommandRefused: a board would not arm; everything is off then.
        :raises LimitError: a board did not reach its armed state.
        """
        try:
            pendings = [link.arm(self.now_ns()) for link in self.links.values()]
            for link, pending in zip(self.links.values(), pendings, strict=True):
                finish(self._runner, pending, ARM_TIMEOUT_S, link.name)
            self.follow(self.now_ns())
            for name in self.links:
                if not self._wait(lambda name=name: self._state_of(name) in (State.ARMED, State.DRIVING), ARM_TIMEOUT_S):
                    state = self._state_of(name)
                    seen = "nothing" if state is None else State(state).name.lower()
                    raise LimitError(f"{name}: did not reach the armed state within {ARM_TIMEOUT_S:g} s; it says {seen}")
        except BaseException:
            self.off()
            raise
        self._wanted_armed = True
        if self.tactiles is not None:
            self.tactiles.set_armed(True)

    def _state_of(self, name: str) -> int | None:
        message = self.telemetry.get(name)
        return None if message is None else message.state

    def off(self) -> None:
        """Pins withdrawn, then volts to zero and bridges shorted, then disarmed. Never raises for a link that is gone."""
        if self._wanted_armed and not self.faults and self.tactiles is not None:
            self.tactiles.end("ended")
            self.tactiles.withdraw_all(self.now_ns())
            if self.brakes is not None:
                self.brakes.release_all(self.now_ns())
            self._wait(self._pins_settled, OFF_TIMEOUT_S)
        self._wanted_armed = False
        pendings = [link.stop(self.now_ns()) for link in self.links.values() if link.error is None]
        self._wait(lambda: all(pending.done for pending in pendings), OFF_TIMEOUT_S)
        if self.tactiles is not None:
            self.tactiles.set_armed(False)

    def _pins_settled(self) -> bool:
        return self.tactiles is None or (self.tactiles.idle and self.now_ns() > self.tactiles.busy_until_ns)

    def close(self) -> None:
        """Close the ports; call :meth:`off` first."""
        for link in self.links.values():
            link.close()

    # What a simulated glove knows besides ---------------------------------------------------------------------------

    def plant(self, name: str) -> SimulatedPort | None:
        """The simulated plant behind a board, or None for hardware."""
        link = self.links.get(name)
        return None if link is None else simulated(link.port)


class OpenGlove:
    """A glove for scripts: plain calls, in the background's real time or in stepped virtual time.

    Use as a context manager; leaving it by any way goes off.
    """

    def __init__(self, glove: Glove, brake: BrakeConfiguration):
        self._glove, self._brake = glove, brake
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="glove", daemon=True) if glove.realtime else None

    def __enter__(self) -> OpenGlove:
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _serve(self) -> None:
        while not self._closing.wait(TICK_NS / NS_PER_S):
            with self._lock:
                self._glove.follow(self._glove.now_ns())
                self._glove.tick(self._glove.now_ns())

    def arm(self) -> None:
        """Arm every board.

        :raises HapticsError: a board would not.
        """
        with self._lock:
            self._glove.arm()

    def contact(self, site: str) -> None:
        """The pin of a site comes out and stays.

        :raises InputError: no such site, or this glove has no array.
        """
        with self._lock:
            self._array().contact(site, self._glove.now_ns())

    def release(self, site: str) -> None:
        """The pin of a site goes back.

        :raises InputError: no such site, or this glove has no array.
        """
        with self._lock:
            self._array().release(site, self._glove.now_ns())

    def pulse(self, site: str, count: int = 1, rate_hz: float = 50.0) -> None:
        """``count`` pulses at ``rate_hz`` (1 to 100 Hz); each may be denied by heat or current, and :meth:`results` says so.

        :raises InputError: no such site, a count outside 1 to 1000, or a rate outside its range.
        """
        in_range("rate_hz", rate_hz, 1.0, 100.0, "Hz")
        in_range("count", count, 1, 1000)
        with self._lock:
            now_ns = self._glove.now_ns()
            self._array().train(site, count, seconds_to_ns(1.0 / rate_hz), now_ns)

    def brake(self, name: str, force_n: float | None = None, volts: float | None = None, ttl_s: float = 0.2) -> float:
        """Hold a brake for ``ttl_s``, by force (volts from the fitted law) or by volts; returns the volts.

        :raises InputError: neither or both given, out of range, unknown brake, or this glove has no brakes.
        """
        if (force_n is None) == (volts is None):
            raise InputError(f"force_n = {force_n}, volts = {volts}; allowed: exactly one of them")
        if self._glove.brakes is None:
            raise InputError("this glove has no brake controller; allowed: open it with brake=…")
        if force_n is not None:
            volts = default_law("thumb" if name == "thumb" else "index").volts_for(force_n, self._brake.overlap_m2)
        assert volts is not None
        with self._lock:
            self._glove.brakes.engage(name, volts, self._glove.now_ns(), ttl_s=ttl_s)
        return volts

    def results(self) -> list[Any]:
        """What became of the pulses asked for, since the last call."""
        with self._lock:
            return [] if self._glove.tactiles is None else self._glove.tactiles.take_results()

    def state(self) -> GloveState:
        """Temperatures, pins, volts, faults."""
        with self._lock:
            return glove_state(self._glove)

    def advance(self, seconds: float) -> None:
        """Let virtual time pass.

        :raises InputError: the glove runs in real time.
        """
        self._glove.step_to(self._glove.now_ns() + seconds_to_ns(seconds))

    def off(self) -> None:
        """Pins withdrawn, volts zero, disarmed."""
        with self._lock:
            self._glove.off()

    def close(self) -> None:
        """Go off and close the ports."""
        self._closing.set()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join()
        try:
            self._glove.off()
        finally:
            self._glove.close()

    def _array(self) -> TactilesDriver:
        if self._glove.tactiles is None:
            raise InputError("this glove has no tactor array; allowed: open it with tactiles=…")
        return self._glove.tactiles


def glove_state(glove: Glove) -> GloveState:
    """A snapshot of what the host knows."""
    now_ns = glove.now_ns()
    array, brake = glove.tactiles, glove.brakes
    brake_says = glove.telemetry.get("brake")
    names: Sequence[str] = () if brake is None else brake.channels
    return GloveState(
        time_ns=now_ns,
        rise_k={} if array is None else dict(zip(array.sites, array.rises_k(now_ns), strict=True)),
        headroom_k={} if array is None else dict(zip(array.sites, array.headrooms_k(now_ns), strict=True)),
        pins_out=() if array is None else tuple(s for s, out in zip(array.sites, array.pins_out(), strict=True) if out),
        volts={} if brake_says is None else dict(zip(names, brake_says.output, strict=False)),
        capacitance_pf={} if brake_says is None else dict(zip(names, brake_says.capacitance, strict=False)),
        armed=tuple(name for name, link in glove.links.items() if link.armed),
        faults=tuple(glove.faults),
    )


def open(
    config: str | None = None,
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
    configuration = load_configuration(config)
    parts: dict[str, Any] = {"tactiles": configuration.tactiles, "brake": configuration.brake}
    for name, url in (("tactiles", tactiles), ("brake", brake)):
        if url is not None:
            parts[name] = parts[name].model_copy(update={"port": url})
        elif config is None and (tactiles or brake):
            parts[name] = None
    if clock not in ("real", "virtual"):
        raise InputError(f"clock = {clock!r} is not allowed; allowed: real, virtual")
    return OpenGlove(Glove(parts["tactiles"], parts["brake"], realtime=clock == "real", seed=seed), configuration.brake)

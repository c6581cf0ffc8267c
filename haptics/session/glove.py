"""One glove: ports opened, links up, drivers ready, and off again on every exit.

``Glove`` is the composition that runs, scripts and the render session share. In virtual time its owner steps it
(``step_to``); in real time its owner's loop serves links and drivers (``haptics.session.open_glove`` starts a thread that does).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

from haptics.devices import BrakeDriver, TactilesDriver
from haptics.errors import CommandRefused, InputError, LimitError
from haptics.link.commands import Pending
from haptics.link.connection import Link
from haptics.link.events import Disarmed, Event, FaultReported, Lost, Rebooted, Telemetry
from haptics.link.messages import Board, Fault, State, Status
from haptics.link.polling import PollingRunner
from haptics.link.ports import check_port, open_port
from haptics.link.runner import VirtualRunner, connect, finish
from haptics.link.session import LinkSession
from haptics.link.simulated import SimulatedPort, simulated
from haptics.physics.thermal import ThermalParameters
from haptics.scheduling import CoilLimits, ThermalBudget
from haptics.session.configuration import BrakeConfiguration, TactilesConfiguration
from haptics.session.faults import fault_names
from haptics.time import NS_PER_MS, NS_PER_S, MonotonicClock, VirtualClock, seconds_to_ns
from haptics.units import an_instance, whole_number

TICK_NS = NS_PER_MS
_PARTS: dict[str, type] = {"tactiles": TactilesConfiguration, "brake": BrakeConfiguration}
ARM_TIMEOUT_S = 2.0
OFF_TIMEOUT_S = 1.0
HANDOVER_S = 100e-6
"""Pause between two pulses that share a coil or its share of the current: more than a clock estimate moves between them."""
WireTap = Callable[[str, int, bool, bytes], None]


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
    :param seed: of the simulated boards. :param simulate: query keys for the simulated boards, by name; a URL's own keys win.
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
        simulate: Mapping[str, Mapping[str, object]] | None = None,
        wire_tap: WireTap | None = None,
    ):
        seed = whole_number("seed", seed, 0, 2**32 - 1)
        self.realtime = realtime
        self.clock: VirtualClock | MonotonicClock = MonotonicClock() if realtime else VirtualClock()
        self.links: dict[str, Link] = {}
        self.faults: list[str] = []
        self.telemetry: dict[str, Any] = {}
        self._event_sinks: list[Callable[[str, Event], None]] = []
        self._opened = False
        self._wanted_armed = False
        asked = {"tactiles": tactiles, "brake": brake}
        for name, part in asked.items():  # all of them before the first is opened, which may reset a board
            if part is not None:
                an_instance(name, part, _PARTS[name], "a part of haptics.load_configuration's answer, or None")
                check_port(part.port, f"{name} port")
        try:
            for name, part in asked.items():
                if part is not None:
                    self.links[name] = self._open(name, part, seed, (simulate or {}).get(name, {}), wire_tap)
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
        self,
        name: str,
        part: TactilesConfiguration | BrakeConfiguration,
        seed: int,
        simulate: Mapping[str, object],
        wire_tap: WireTap | None,
    ) -> Link:
        defaults: dict[str, object] = {"clock": "real" if self.realtime else "virtual", "seed": seed}
        if part.port.startswith(f"sim://{name}"):
            defaults |= simulate
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

        return Link(port, LinkSession(Board[name.upper()], part.port, baud=part.baud, tap=tap))

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
            self._fault(f"{name}: {fault_names(message.faults)}")

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
        self.telemetry.clear()  # what a board said before it was armed says nothing about now
        try:
            pendings = [link.arm(self.now_ns()) for link in self.links.values()]
            for link, pending in zip(self.links.values(), pendings, strict=True):
                self._finish_arming(link, pending)
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

    def _finish_arming(self, link: Link, pending: Pending) -> None:
        try:
            finish(self._runner, pending, ARM_TIMEOUT_S, link.name)
        except CommandRefused as error:
            latched = fault_names(pending.detail or 0)
            if pending.status != Status.INTERLOCK or not latched:
                raise
            advice = f"find out why, then clear it: haptics off --port {link.name}"
            raise CommandRefused(link.name, f"a fault is latched: {latched}", "arm", error.status, advice) from error

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
        return self.tactiles is None or (self.tactiles.idle and self.now_ns() > self._last_pulse_ends_ns())

    def _last_pulse_ends_ns(self) -> int:
        """On the board: what was sent over a coarse line plays later than asked for, by twice the shift at most."""
        return 0 if self.tactiles is None else self.tactiles.busy_until_ns + 2 * self.links["tactiles"].shift_ns

    def close(self) -> None:
        """Close the ports; call :meth:`off` first."""
        for link in self.links.values():
            link.close()

    # What a simulated glove knows besides ---------------------------------------------------------------------------

    def plant(self, name: str) -> SimulatedPort | None:
        """The simulated plant behind a board, or None for hardware."""
        link = self.links.get(name)
        return None if link is None else simulated(link.port)

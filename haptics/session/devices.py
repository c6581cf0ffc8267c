"""The devices of one glove: ports opened, links up, drivers ready, and off again on every exit.

``Devices`` is what runs, benches and every ``haptics.Glove`` stand on. In virtual time its owner steps it (``step_to``); in real
time its owner's loop serves links and drivers (a ``haptics.Glove`` has a thread that does).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping

from haptics.devices import (
    BrakeDriver,
    BrakeShare,
    Refusal,
    Result,
    SharedBrakes,
    SharedTactiles,
    TactilesDriver,
    TactilesShare,
)
from haptics.devices.tactiles import TELLING_NS
from haptics.errors import InputError
from haptics.link.commands import Pending
from haptics.link.connection import Link
from haptics.link.events import Disarmed, Event
from haptics.link.polling import PollingRunner
from haptics.link.ports import BytePort
from haptics.link.runner import VirtualRunner, connect
from haptics.link.simulated import SimulatedPort, simulated
from haptics.session import heat
from haptics.session.board_news import BoardNews
from haptics.session.configuration import BrakeConfiguration, TactilesConfiguration
from haptics.session.opening import PARTS, Opening, WireTap
from haptics.session.reopening import Reopening
from haptics.session.switching import Kind, Procedure, Steps, Switched, arming, clearing, going_off, retiring
from haptics.time import LATEST_NS, NS_PER_MS, NS_PER_S, MonotonicClock, VirtualClock, seconds_to_ns
from haptics.units import a_callable, one_of, truth, whole_number

TICK_NS = NS_PER_MS
LONGEST_STEP_S = 1e6
_STEPS: dict[Kind, Callable[[Switched], Steps]] = {"arm": arming, "off": going_off, "clear": clearing, "retire": retiring}


class Devices:
    """The devices of one glove, served by whoever made this.

    :param tactiles: configuration of the array, or None to leave it out.
    :param brake: configuration of the brake controller, or None to leave it out.
    :param realtime: on the machine's clock (needed for hardware) rather than in virtual time.
    :param seed: of the simulated boards, 0 to 2**32 - 1.
    :param simulate: query keys for the simulated boards, by name; a URL's own keys win.
    :param wire_tap: called with port name, time (ns), direction (True: to the board) and bytes.
    :param limit_pulses: boards are configured with the configuration's limits on pulse length and heat, too. A bench that warms
        coils on purpose, and watches them, leaves these two as the board has them.
    :param withdraw_pins: arming withdraws every pin that may be out. A bench whose coils are to start cold does without, and
        takes its pins for in.
    :raises InputError: a real port in virtual time.
    :raises LinkError: a port or board that cannot be used; what was opened is closed again.

    :ivar links: by board, ``tactiles`` and ``brake``.
    :ivar faults: what went wrong since opening, in words, each once; a history, not what holds now.
    :ivar notes: what a person should know besides: limits that a board holds tighter than configured, coils that start warm.
    :ivar needed: boards that arming arms; all of them, unless :meth:`need` was called.
    :ivar latched: by board, the faults that are latched, as it reported last.
    :ivar telemetry: each board's last message since it was armed.
    :ivar tactiles: driver of the array, or None without one.
    :ivar brakes: driver of the brake controller, or None without one.
    :ivar times_armed: how often :meth:`arm` succeeded: whoever remembers what a device does forgets it when this changes.
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
        limit_pulses: bool = True,
        withdraw_pins: bool = True,
    ):
        seed = whole_number("seed", seed, 0, 2**32 - 1)
        self.realtime = realtime = truth("realtime", realtime)
        self.clock: VirtualClock | MonotonicClock = MonotonicClock() if realtime else VirtualClock()
        self.links: dict[str, Link] = {}
        self._reopening: list[Reopening] = []
        self._news = BoardNews()
        withdraw_pins = truth("withdraw_pins", withdraw_pins)
        self.faults, self.notes = self._news.faults, self._news.notes
        self.latched, self.telemetry = self._news.latched, self._news.telemetry
        self._result_sinks: list[Callable[[int, Result | Refusal], None]] = []
        self._permitted: set[str] = set()  # boards whose drivers may ask for energy
        self._procedures: list[Procedure] = []
        self.needed: frozenset[str] = frozenset(PARTS)
        self.times_armed = 0
        opening = Opening(tactiles, brake, realtime, seed, simulate, wire_tap, truth("limit_pulses", limit_pulses))
        openers: dict[str, Callable[[], BytePort]] = {}
        try:
            for name in opening.parts:
                self.links[name], openers[name] = opening.link(name)
            links = list(self.links.values())
            if not realtime:  # a world that was there before has gone on without this glove
                starts_ns = [link.simulated.truth()["time_ns"] for link in self.links.values() if link.simulated is not None]
                self._virtual_clock.advance_to(max(starts_ns, default=0))
            self._runner: VirtualRunner | PollingRunner = (
                PollingRunner(links, self.clock) if realtime else VirtualRunner(links, self._virtual_clock)
            )
        except BaseException:
            for link in self.links.values():
                link.close()
            raise
        self.tactiles: TactilesDriver | None = None
        self.brakes: BrakeDriver | None = None
        self.shared_tactiles: SharedTactiles | None = None
        self.shared_brakes: SharedBrakes | None = None
        try:
            connect(self._runner)
            for name, link in self.links.items():
                self.notes += opening.notes(name, link)
            if tactiles is not None:
                self.tactiles, self._coils, notes = opening.tactiles(self.links["tactiles"])
                self.notes += notes
                if not withdraw_pins:
                    self.tactiles.take_pins_for_in()
                self.shared_tactiles = SharedTactiles(self.tactiles)
            if brake is not None:
                self.brakes = opening.brakes(self.links["brake"])
                self.shared_brakes = SharedBrakes(self.brakes)
        except BaseException:
            self.close()
            raise
        self._reopening = [Reopening(link, openers[name], realtime) for name, link in self.links.items()]

    @property
    def _virtual_clock(self) -> VirtualClock:
        assert isinstance(self.clock, VirtualClock)
        return self.clock

    # Time -----------------------------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """The devices' clock.

        :return: ns; of the machine's monotonic clock in real time, from 0 in virtual time.
        """
        return self.clock.now_ns()

    def on_event(self, sink: Callable[[str, Event], None]) -> None:
        """Call a function for what links report, in order, while :meth:`follow` runs.

        :param sink: called with a board's name and an event of ``haptics.link.events``.
        :raises InputError: it cannot be called.
        """
        a_callable("sink", sink, "a board's name and an event")
        self._news.on_event(sink)

    def follow(self, to_ns: int) -> None:
        """Bring links (and in virtual time boards) to ``to_ns`` and take in what they report; drivers are not ticked.

        :param to_ns: ns on this glove's clock; in real time links are served up to now, whatever it is.
        :raises InputError: no time, or in virtual time one that has passed.
        """
        if type(to_ns) is not int or not 0 <= to_ns <= LATEST_NS:  # so as not to cost a tick more than that
            to_ns = whole_number("to_ns", to_ns, 0, LATEST_NS)
        for name, link in self.links.items():
            if link.armed:
                self._notice_silence(name, link)
        if isinstance(self._runner, VirtualRunner):
            self._runner.run_until(to_ns)
        else:
            self._runner.poll()
        for name, link in self.links.items():
            for event in link.events():
                self._news.take(name, event)
            if name in self._permitted and not self.obeys(name):
                self._forbid(name)
        now_ns = self.now_ns()
        for reopening in self._reopening:
            reopening.step(now_ns)
        if self._procedures:
            self._go_on()

    def _notice_silence(self, name: str, link: Link) -> None:
        """The host was away for longer than a board waits: that board has made itself safe, and is stopped in any case."""
        now_ns = self.now_ns()
        silent_ns = now_ns - link.session.last_sent_ns
        if silent_ns <= link.identity.dead_man * NS_PER_MS:
            return
        silent = f"host silent for {silent_ns / NS_PER_MS:.0f} ms; board made itself safe; arm again"
        self._news.fault(f"{name}: {silent}")
        link.stop(now_ns)
        self._forbid(name)
        self._news.hand_on(name, Disarmed(now_ns, silent))

    def tick(self, now_ns: int) -> None:
        """Tick the drivers.

        :param now_ns: ns on this glove's clock.
        :raises InputError: no time.
        """
        if type(now_ns) is not int or not 0 <= now_ns <= LATEST_NS:
            now_ns = whole_number("now_ns", now_ns, 0, LATEST_NS)
        if self.shared_tactiles is not None:
            self.shared_tactiles.tick(now_ns)
        if self.shared_brakes is not None:
            self.shared_brakes.tick(now_ns)
        self.hand_on_results()

    def on_result(self, sink: Callable[[int, Result | Refusal], None]) -> None:
        """Call a function for all that becomes of what was asked of the drivers, at the end of each tick.

        Once there is one, drivers' ``take_results`` and ``take_answers`` find nothing.

        :param sink: called with the time, ns on this glove's clock, and a ``Result``, or a ``Refusal`` of the brake controller.
        :raises InputError: it cannot be called.
        """
        a_callable("sink", sink, "a time and a result")
        self._result_sinks.append(sink)

    def no_more_results(self, sink: Callable[[int, Result | Refusal], None]) -> None:
        """Call a function no more that was given to :meth:`on_result`.

        :param sink: nothing happens if it is not called.
        """
        self._result_sinks = [one for one in self._result_sinks if one != sink]

    def hand_on_results(self) -> None:
        """Hand on what is known already, before the next tick does."""
        if not self._result_sinks:
            return
        found: list[Result | Refusal] = [] if self.tactiles is None else [*self.tactiles.take_results()]
        if self.brakes is not None:
            refusals, results = self.brakes.take_answers()
            found += [*results, *refusals]
        now_ns = self.now_ns() if found else 0
        for one in found:
            for sink in self._result_sinks:
                sink(now_ns, one)

    def share_tactiles(self, owner: str) -> TactilesShare | None:
        """The array as one owner has it.

        :param owner: its name.
        :return: its share; None without an array.
        """
        return None if self.shared_tactiles is None else self.shared_tactiles.share(owner)

    def share_brakes(self, owner: str) -> BrakeShare | None:
        """The brakes, likewise.

        :param owner: its name.
        :return: its share; None without a brake controller.
        """
        return None if self.shared_brakes is None else self.shared_brakes.share(owner)

    def step_to(self, to_ns: int) -> None:
        """Tick every millisecond until a time; in virtual time only.

        :param to_ns: ns on this glove's clock, at most ``LONGEST_STEP_S`` from now.
        :raises InputError: the glove runs in real time, which cannot be stepped; or no time within ``LONGEST_STEP_S`` from now.
        """
        if self.realtime:
            raise InputError("time of this glove passes by itself; only one in virtual time can be stepped")
        to_ns = whole_number("to_ns", to_ns, 0, self.now_ns() + seconds_to_ns(LONGEST_STEP_S))
        while self.now_ns() < to_ns:
            self.follow(min(self.now_ns() + TICK_NS, to_ns))
            self.tick(self.now_ns())

    def _forbid(self, name: str) -> None:
        """A board is no longer armed: what was asked of it is forgotten."""
        self._permitted.discard(name)
        if name == "tactiles":
            self._set_tactiles(False, sure_until_ns=self.now_ns() - TELLING_NS - self._shift_ns())
        elif name == "brake":
            self._set_brakes(False)

    def _set_tactiles(self, armed: bool, sure_until_ns: int | None = None) -> None:
        if self.tactiles is not None and self.shared_tactiles is not None:
            self.shared_tactiles.forget()
            self.tactiles.set_armed(armed, sure_until_ns=sure_until_ns)

    def _set_brakes(self, armed: bool) -> None:
        if self.brakes is not None and self.shared_brakes is not None:
            self.shared_brakes.forget()
            self.brakes.set_armed(armed)

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass with drivers ticking until ``condition`` holds."""
        end_ns = LATEST_NS if timeout_s == math.inf else self.now_ns() + seconds_to_ns(timeout_s)
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

    def begin(self, kind: Kind) -> Procedure:
        """Begin to arm, go off or clear faults; :meth:`follow` goes on with it. What was begun before is finished first.

        Going off waits for nothing: what was begun and not finished is given up, but for clearing, which goes on afterwards.

        :param kind: ``arm``, ``off``, ``clear`` or ``retire``.
        :return: the procedure: the one under way, where that is of this kind.
        """
        under_way = self._procedures[-1] if self._procedures else None
        if under_way is not None and under_way.kind == kind:
            return under_way
        if kind == "off":
            off = self._procedures[0] if self.doing == "off" else None
            for procedure in [one for one in self._procedures if one.kind == "arm" or (off is None and one.kind != "clear")]:
                procedure.cancel(f"{procedure.kind} was given up, as the glove was to go off")
                self._procedures.remove(procedure)
            if off is not None:
                return off
        steps = _STEPS[kind](self)
        procedure = Procedure(kind, steps)
        self._procedures.insert(0 if kind == "off" else len(self._procedures), procedure)
        if self._procedures[0] is procedure:
            self._go_on()
        return procedure

    def finish(self, procedure: Procedure) -> None:
        """Let time pass, with drivers ticking, until a procedure has ended; for whoever serves the devices alone.

        :param procedure: from :meth:`begin`.
        :raises HapticsError: what it failed with.
        """
        self._wait(lambda: procedure.done, math.inf)
        if procedure.error is not None:
            raise procedure.error

    @property
    def doing(self) -> Kind | None:
        """The procedure under way: ``arm``, ``off`` or ``clear``."""
        return self._procedures[0].kind if self._procedures else None

    def _go_on(self) -> None:
        while self._procedures:
            procedure = self._procedures[0]
            procedure.go_on(self.now_ns())
            if not procedure.done:
                return
            if self._procedures and self._procedures[0] is procedure:
                self._procedures.pop(0)

    def arm(self) -> None:
        """Arm every board, explicitly; the brake controller tests itself first, and pins that may be out are withdrawn.

        Nothing is wanted of an armed board yet. A board that is armed already is stopped first, so that it drops what it was
        asked for.

        :raises CommandRefused: a board would not arm; everything is off then.
        :raises LimitError: a board did not reach its armed state, or left it while another armed.
        """
        try:
            self.finish(self.begin("arm"))
        except BaseException:
            self.off()
            raise

    def off(self) -> None:
        """Pins withdrawn, then volts to zero and bridges shorted, then disarmed. Never raises for a link that is gone.

        Each board that is armed now goes off in this order, whatever happened to the other one, or to itself before.
        """
        procedure = self.begin("off")
        try:
            self.finish(procedure)
        except BaseException:  # the one who waits is interrupted
            procedure.cancel("going off was cut short; every board was stopped")
            raise

    def need(self, names: Collection[str]) -> None:
        """Say which boards are of use from now on: arming arms no others, and one that is armed and of no use any more goes off.

        :param names: ``tactiles``, ``brake``.
        :raises InputError: another name.
        """
        for name in names:
            one_of("name", name, tuple(PARTS))
        self.needed = frozenset(names)
        if self._permitted - self.needed:
            self.begin("retire")

    # What the procedures are made of

    def drop_wishes(self) -> None:
        """Whatever was asked for is forgotten, and nothing more is taken until the next arming."""
        self._permitted.clear()
        if self.tactiles is not None:
            self._set_tactiles(False, sure_until_ns=self.now_ns() - self._shift_ns())
        self._set_brakes(False)

    def stop_all(self) -> list[Pending]:
        """A stop to every board that is there; nothing is wanted any more.

        :return: the stops to watch.
        """
        self._news.wanted_armed = False
        pendings = [link.stop(self.now_ns()) for link in self.links.values() if link.error is None]
        self.drop_wishes()
        return pendings

    def permit(self, names: Collection[str]) -> None:
        """Every board that is needed is armed: their drivers may ask for energy.

        :param names: of these boards.
        """
        self._news.wanted_armed = True
        self.times_armed += 1
        self._permitted.update(names)
        if self.tactiles is not None and "tactiles" in self._permitted:
            self._take_over_heat(self.tactiles)
            self._set_tactiles(True)
        if "brake" in self._permitted:
            self._set_brakes(True)

    def to_arm(self) -> dict[str, Link]:
        """What arming arms.

        :return: links by board's name.
        """
        return {name: link for name, link in self.links.items() if name in self.needed}

    def retire(self, name: str) -> None:
        """A board is of no use any more, and is stopped.

        :param name: of the board; what it held was let go of.
        """
        self.links[name].stop(self.now_ns())
        self._forbid(name)

    def permits(self, name: str) -> bool:
        """Whether a board's driver may ask for energy.

        :param name: of the board.
        :return: False from its disarming on, whoever disarmed it.
        """
        return name in self._permitted

    def obeys(self, name: str) -> bool:
        """Whether a board is there and armed now, whatever happened before.

        :param name: of the board.
        :return: False also for a board that this glove lacks.
        """
        link = self.links.get(name)
        return link is not None and link.armed and link.error is None

    def state_of(self, name: str) -> int | None:
        """What a board reported to be in, since it was armed last.

        :param name: of the board.
        :return: of ``haptics.link.messages.State``; None if nothing came.
        """
        message = self.telemetry.get(name)
        return None if message is None else message.state

    def pins_settled(self) -> bool:
        """Whether every pin is where it was asked to be, by what boards answered.

        :return: True also without an array.
        """
        return self.tactiles is None or (self.tactiles.idle and self.now_ns() > self._last_pulse_ends_ns())

    def note_pins_out(self) -> None:
        """Say which pins arming could not withdraw; that goes on being tried where the coil was only too hot."""
        array = self.tactiles
        if array is not None and (sites := array.pins_left_out()):
            who = "it" if len(sites) == 1 else "they"
            self._news.note(f"tactiles: arming could not withdraw {', '.join(sites)} yet; {who} may be out")

    def _take_over_heat(self, array: TactilesDriver) -> None:
        note = heat.take_over(array.budgets, self._coils, self.telemetry["tactiles"].heat, self.now_ns(), self._news.heat_booked)
        self._news.heat_booked = True
        if note is not None:
            self._news.note(note)

    def _last_pulse_ends_ns(self) -> int:
        """On the board."""
        return 0 if self.tactiles is None else self.tactiles.busy_until_ns + self._shift_ns()

    def _shift_ns(self) -> int:
        """What was sent over a coarse line plays later than asked for, by at most this."""
        return 2 * self.links["tactiles"].shift_ns

    def close(self) -> None:
        """Close the ports; call :meth:`off` first."""
        for reopening in self._reopening:
            reopening.close()
        for link in self.links.values():
            link.close()

    # What a simulated glove knows besides ---------------------------------------------------------------------------

    def plant(self, name: str) -> SimulatedPort | None:
        """The simulated plant behind a board.

        :param name: ``tactiles`` or ``brake``.
        :return: the plant, or None for hardware and for a board that this glove lacks.
        :raises InputError: a board that no glove has.
        """
        link = self.links.get(one_of("name", name, tuple(PARTS)))
        return None if link is None else simulated(link.port)

"""One bench: a board, the instruments on it, time, and a record of everything; off on every exit.

The same rig runs on ``sim://`` ports, in virtual time, and on hardware, in real time. Simulated instruments stand in the world
of the simulated board; real ones are serial ports.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from haptics.devices import BrakeDriver
from haptics.devices.brake import COMMAND_LEAD_NS
from haptics.ends import orderly, unbroken
from haptics.errors import HapticsError, InputError
from haptics.link.commands import NEVER_NS, Pending
from haptics.link.events import Event, Telemetry
from haptics.link.messages import COIL_CHANNELS, DURATION_UNIT_US, Status
from haptics.link.port_url import is_simulated, query_of, with_defaults
from haptics.link.ports import check_port
from haptics.recording import StreamSpec
from haptics.recording.ending import finish, keep
from haptics.recording.leftovers import journal_of, refuse_leftover
from haptics.recording.output import check_folder, check_outputs
from haptics.session.configuration import Configuration
from haptics.session.devices import Devices
from haptics.session.recorder import LinkRecorder, provenance
from haptics.time import NS_PER_MS, NS_PER_S, seconds_to_ns
from haptics.units import in_range
from rigs.instruments import InstrumentSilent, Samples, SampleStream, Stage
from rigs.result import Fault

STEP_NS = 10 * NS_PER_MS
"""How often a bench in virtual time looks at its instruments; in real time it is a millisecond."""
PULSE_LEAD_NS = 20 * NS_PER_MS
WITHDRAW_S = 10e-3
_ANSWER_S = 3.0
_worlds = itertools.count(1)


def _silent(what: str) -> None:
    """No progress; a function with a name, so that options can be handed to another process."""


@dataclass(frozen=True)
class BenchOptions:
    """Where and how a rig runs.

    :param port: URL of the board's port; None uses the configuration's.
    :param level: level of a simulated board's models, such as ``dynamic``; None leaves the board's default.
    :param seed: of simulated boards and instruments, 0 to 2^32 - 1.
    :param channel: channel of the board that the instruments are attached to, from 0.
    :param instruments: port URLs by kind (``thermocouple``, ``stage`` ...); on hardware every instrument that the rig needs must
        be given.
    :param surface: what the pin lands on, for the pendulum: ``bare``, ``silicone`` or ``foam``; None measures all three on a
        simulated board.
    :param configuration: glove configuration; its ports serve where ``port`` is None.
    :param record: HDF5 file to write; None records nothing.
    :param force: overwrite a recording that exists.
    :param progress: called with a line of text at each stage of the run.
    """

    port: str | None = None
    level: str | None = None
    seed: int = 1
    channel: int = 0
    instruments: Mapping[str, str] = field(default_factory=dict)
    surface: str | None = None
    configuration: Configuration = field(default_factory=Configuration)
    record: Path | None = None
    force: bool = False
    progress: Callable[[str], None] = _silent

    def part(self, name: str) -> BenchOptions:
        """The same, recording under another name: ``thermal.h5`` becomes ``thermal-NAME.h5``.

        :param name: appended to the recording's name, after a hyphen.
        :return: options for that part of the run; unchanged where nothing is recorded.
        """
        if self.record is None:
            return self
        return replace(self, record=self.record.with_stem(f"{self.record.stem}-{name}"))

    def board_url(self, board: str) -> str:
        """The board's port.

        :param board: ``tactiles`` or ``brake``.
        :return: URL of the board's port.
        """
        if self.port is not None:
            return self.port
        return self.configuration.tactiles.port if board == "tactiles" else self.configuration.brake.port


def check_record(options: BenchOptions) -> None:
    """Look, before a board is opened, whether the recording can be written.

    :param options: their ``record`` and ``force`` are checked.
    :raises InputError: it cannot; or a journal of an earlier session is in the way.
    """
    if options.record is not None:
        journal = journal_of(options.record)
        check_folder("record", options.record)
        refuse_leftover(journal, options.force)
        check_outputs({"recording": options.record, "its journal": journal}, options.force)


class Bench:
    """A board and its instruments while a rig runs; use as a context manager.

    :param board: ``tactiles`` or ``brake``.
    :param instruments: what is read, and the stage where one moves the brake's hand, opened by the drivers' own classes.
    :param simulate: query keys for a simulated board that its URL does not name.
    :param plot: stream and signal that a viewer of the recording shows first.
    :param options: where and how the rig runs.
    :param rig: name of the rig, for the recording's header.
    :raises InputError: on hardware, an instrument without a port.
    :raises LinkError: a port or board that cannot be used.
    """

    def __init__(
        self,
        board: str,
        instruments: Sequence[type[SampleStream] | type[Stage]],
        options: BenchOptions,
        *,
        rig: str,
        simulate: Mapping[str, object] | None = None,
        plot: tuple[str, str] | None = None,
    ):
        self.board, self.options = board, options
        self.instruments: dict[str, SampleStream] = {}
        self._stage: Stage | None = None
        self.telemetry: list[tuple[int, Any]] = []
        self.watch: Callable[[], None] | None = None
        """Called at each look at the instruments; may raise to end the run."""
        self.pulsed_ns: list[int] = []
        """Commanded start of each pulse so far, ns."""
        self.recorder: LinkRecorder | None = None
        self._pending: list[tuple[str, Pending]] = []
        self._brake_refusals: list[str] = []
        self._back_ns: dict[int, int] = {}
        """Channels whose pin was sent out, and when it will be back, as far as that was commanded."""
        url = options.board_url(board)
        self.simulated = is_simulated(url)
        self._check_instruments(instruments, url)
        check_record(options)
        self._early: list[tuple[int, str, bool, bytes]] = []
        world = f"bench-{os.getpid()}-{next(_worlds)}"
        defaults: dict[str, object] = {"world": world, **(simulate or {})}
        if options.level is not None:
            defaults["level"] = options.level
        url = with_defaults(url, **defaults)
        part = getattr(options.configuration, board).model_copy(update={"port": url})
        self._exits = contextlib.ExitStack()
        self._exits.enter_context(orderly())
        try:
            self.glove = Devices(
                part if board == "tactiles" else None,
                part if board == "brake" else None,
                realtime=not self.simulated,
                seed=options.seed,
                wire_tap=self._tap,
                limit_pulses=False,
            )
            self._exits.push(self._close)
            self.glove.on_event(self._take)
            self.link = self.glove.links[board]
            shared = {**query_of(url), "channel": options.channel}
            for kind in instruments:
                self._open(kind, {key: shared[key] for key in ("world", "channel") if key in shared})
            self._start_recording(rig, instruments, plot)
            self._meet_instruments()
        except BaseException as error:
            self._exits.__exit__(type(error), error, error.__traceback__)
            raise

    # Time.

    @property
    def now_ns(self) -> int:
        """The bench's clock."""
        return self.glove.now_ns()

    def wait(self, seconds: float) -> None:
        """Let time pass, with links served and instruments read.

        :param seconds: how long, s; 0 or less returns at once.
        :raises LinkError: a port went away.
        :raises HapticsError: what the rig's ``watch`` raises.
        """
        self.wait_until(self.now_ns + seconds_to_ns(seconds))

    def wait_until(self, to_ns: int) -> None:
        """As ``wait``, until a time of the bench's clock; at once if it has passed.

        :param to_ns: time on the bench's clock, ns.
        :raises LinkError: a port went away.
        :raises HapticsError: what the rig's ``watch`` raises.
        """
        step_ns = STEP_NS if self.simulated else NS_PER_MS
        while (now_ns := self.now_ns) < to_ns:
            until_ns = min(now_ns + step_ns, to_ns)
            if not self.simulated:
                time.sleep((until_ns - now_ns) / NS_PER_S)
            self.glove.follow(until_ns if self.simulated else self.now_ns)
            self.glove.tick(self.now_ns)
            self._look()

    # The board.

    def arm(self) -> None:
        """Arm the board.

        :raises HapticsError: it would not.
        """
        self.glove.arm()
        self._note("armed")

    def disarm(self) -> None:
        """Stage stopped, outputs off, board disarmed; it may be armed again."""
        self._stop_stage()
        self._let_go()
        self._withdraw()
        self.glove.off()
        self._note("disarmed")

    def pulse(self, channels: Sequence[int], at_ns: int, duration_s: float, toward_skin: bool) -> None:
        """One coil pulse on each of ``channels`` at a time of the bench's clock, which has to lie 20 ms ahead at least.

        :param channels: coil channels, each 0 to 14.
        :param at_ns: start on the bench's clock, ns, at least 20 ms ahead.
        :param duration_s: length of the pulse, 50 us to 10 ms, in steps of 50 us.
        :param toward_skin: polarity: True drives the pin toward the skin, False back.
        :raises InputError: a channel or duration out of range, or too little time ahead.
        """
        if at_ns < self.now_ns + PULSE_LEAD_NS:
            raise InputError(f"at_ns = {at_ns} is {(at_ns - self.now_ns) / 1e6:g} ms ahead; pulses need at least 20 ms")
        mask, durations = 0, [0] * COIL_CHANNELS
        for channel in channels:
            at = int(in_range("channel", channel, 0, COIL_CHANNELS - 1))
            mask |= 1 << at
            durations[at] = round(in_range("duration_s", duration_s, 50e-6, 10e-3, "s") * 1e6 / DURATION_UNIT_US)
        toward = mask if toward_skin else 0
        pending = self.link.send("pulse", self.link.exact_ticks(at_ns), mask, toward, durations, now_ns=self.now_ns)
        self._pending.append(("pulse", pending))
        self.pulsed_ns.append(at_ns)
        back_ns = NEVER_NS if toward_skin else at_ns + seconds_to_ns(duration_s)
        self._back_ns.update(dict.fromkeys(channels, back_ns))

    def engage(self, channel: int, volts: float, frequency_hz: float) -> int:
        """Volts on one output until ``release``, kept up while ``wait`` lets time pass; returns when they begin.

        One supply: outputs that are on together have the highest volts and frequency asked for. Volts fall by themselves when
        nobody waits.

        :param channel: output, from 0.
        :param volts: amplitude, V, 0 to the brake's limit.
        :param frequency_hz: of the square wave, Hz.
        :return: when the volts begin, ns on the bench's clock.
        :raises InputError: no brake board, an output without a name in the configuration, volts or frequency out of range.
        """
        brakes, name = self._brake(channel)
        now_ns = self.now_ns
        brakes.engage(name, volts, now_ns, frequency_hz=frequency_hz)
        self.glove.tick(now_ns)
        self._note("engaged", name, detail=f"{volts:g} V {frequency_hz:g} Hz")
        return now_ns + COMMAND_LEAD_NS

    def release(self, channel: int) -> int:
        """No volts on one output any more; returns when it is shorted.

        :param channel: output, from 0.
        :return: when the output is shorted, ns on the bench's clock.
        :raises InputError: no brake board, or an output without a name in the configuration.
        """
        brakes, name = self._brake(channel)
        now_ns = self.now_ns
        brakes.release(name, now_ns)
        self.glove.tick(now_ns)
        self._note("released", name)
        return now_ns + COMMAND_LEAD_NS

    def refusals(self) -> list[str]:
        """Commands that the board refused or did not answer, so far, in words.

        :return: one line for each command, the command's name first.
        """
        said = [(name, one) for name, one in self._pending if one.done]
        lost = [f"{name}: {one.error}" for name, one in said if one.error is not None]
        refused = [f"{name}: {Status(one.status).name.lower()}" for name, one in said if one.error is None and one.status]
        return lost + refused + self._brake_refusals

    def faults(self) -> tuple[Fault, ...]:
        """What went wrong at the board or on the way to it.

        :return: board faults, and one for all refused commands together; empty if nothing went wrong.
        """
        board = tuple(Fault("board", text) for text in self.glove.faults)
        refused = self.refusals()
        if refused:
            kinds = ", ".join(sorted(set(refused)))
            board += (
                Fault("board", f"{len(refused)} commands were not carried out ({kinds}); is the board free, and the line good?"),
            )
        return board

    # Instruments.

    def samples(self, kind: str) -> Samples:
        """What an instrument has measured so far.

        :param kind: of the instrument, such as ``loadcell``.
        :return: all samples since the bench was opened.
        """
        return self.instruments[kind].samples()

    # The stage.

    @property
    def stage(self) -> Stage:
        """What moves the brake's hand.

        :raises InputError: this rig has none.
        """
        if self._stage is None:
            raise InputError("this rig has no stage among its instruments")
        return self._stage

    def move(self, relative_m: float, speed_m_s: float) -> None:
        """Begin to move the stage; ``settle`` waits for it.

        :param relative_m: distance and direction, -0.1 to 0.1 m.
        :param speed_m_s: speed, 10 um/s to 0.1 m/s.
        :raises InputError: no stage, or a distance or speed out of range.
        :raises LinkLost: its port went away.
        """
        self.stage.move(relative_m, speed_m_s)
        self._note("stage", "move", detail=f"{relative_m:g} m at {speed_m_s:g} m/s")

    def settle(self) -> None:
        """Wait until the stage stands; one that reports nothing is not waited for longer than its moves should take."""
        latest_ns = self.stage.due_ns(self.now_ns)
        while not self.stage.idle and self.now_ns < latest_ns:
            self.wait(0.02)

    # Coming and going.

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._exits.__exit__(kind, error, trace)

    def _check_instruments(self, instruments: Sequence[type[SampleStream] | type[Stage]], url: str) -> None:
        wanted = [kind.kind for kind in instruments]
        for kind in self.options.instruments:
            if kind not in wanted:
                raise InputError(f"{kind} is not an instrument of this rig; allowed: {', '.join(wanted) or 'none'}")
        for kind, port in self.options.instruments.items():
            check_port(port, kind)
        missing = [kind for kind in wanted if kind not in self.options.instruments]
        if missing and not self.simulated:
            raise InputError(f"port = {url!r} is hardware, and no port is given for: {', '.join(missing)}")

    def _open(self, kind: type[SampleStream] | type[Stage], shared: Mapping[str, str]) -> None:
        url = self.options.instruments.get(kind.kind, f"sim://{kind.kind}")
        if is_simulated(url) and not self.simulated:
            raise InputError(f"{kind.kind} = {url!r} is simulated and the board is hardware; give the {kind.kind}'s own port")
        if not is_simulated(url) and self.simulated:
            raise InputError(
                f"{kind.kind} = {url!r} is hardware and the board is simulated; give a sim:// URL, or the board's port"
            )
        url = with_defaults(url, clock="virtual", seed=self.options.seed, **shared)
        one = kind(url)
        if isinstance(one, Stage):
            self._stage = one
        else:
            self.instruments[kind.kind] = one

    def _start_recording(
        self, rig: str, instruments: Sequence[type[SampleStream] | type[Stage]], plot: tuple[str, str] | None
    ) -> None:
        if self.options.record is None:
            return
        header: dict[str, Any] = {
            **provenance(),
            "title": rig,
            "rig": rig,
            "port": self.options.board_url(self.board),  # as asked for: the name of a simulated world means nothing later
            "instruments": {kind.kind: self.options.instruments.get(kind.kind, f"sim://{kind.kind}") for kind in instruments},
            "level": self.options.level,
            "seed": self.options.seed,
            "channel": self.options.channel,
        }
        if plot is not None:
            header["default_plot"] = {"stream": plot[0], "signal": plot[1]}
        streams = [_stream_spec(kind) for kind in instruments if issubclass(kind, SampleStream)]
        self.recorder = LinkRecorder(journal_of(self.options.record), header, self.options.force, streams)
        for time_ns, name, to_board, data in self._early:
            self.recorder.wire(time_ns, name, to_board, data)
        self._early.clear()

    def _meet_instruments(self) -> None:
        """Wait until each instrument has identified itself and printed a sample."""
        end_ns = self.now_ns + seconds_to_ns(_ANSWER_S)
        for one in self.instruments.values():
            one.ask()
        while waiting := [one for one in self.instruments.values() if not one.count or not one.header]:
            if self.now_ns > end_ns:
                one = waiting[0]
                if one.faults:
                    return
                raise InstrumentSilent(one.url, f"the {one.kind} does not answer: {one.seen()}", "open")
            self.wait(0.05)
        while self._stage is not None and not self._stage.state:
            if self.now_ns > end_ns:
                seen = f"the stage sends no status: {self._stage.seen()}"
                raise InstrumentSilent(self._stage.url, seen, "open")
            self.wait(0.05)
        if self.recorder is not None:
            for kind, one in self.instruments.items():
                self._note("instrument", kind, detail=" ".join(f"{key}={value}" for key, value in one.header.items()))

    def _close(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Stage stopped, then off, whatever else goes wrong; then ports closed and the record made whole. Signals wait."""
        with unbroken:
            if self.recorder is not None:
                self.recorder.journal.raises = False
            try:
                self._stop_stage()
                self._let_go()
                self._withdraw()
            finally:
                try:
                    self.glove.off()
                finally:
                    self.glove.close()
                    for one in self.instruments.values():
                        one.close()
                    if self._stage is not None:
                        self._stage.close()
                    self._end_recording(error)

    def _stop_stage(self) -> None:
        """Nothing pulls any more; before volts drop, for strips that let go under a moving hand fly."""
        if self._stage is not None and not self._stage.idle:
            with contextlib.suppress(HapticsError):  # what ends the run goes on to end it, and volts have to drop in any case
                self._stage.stop()

    def _let_go(self) -> None:
        """Brakes released, as long as the board takes commands; the driver would drive again once it is armed anew."""
        brakes, watch = self.glove.brakes, self.watch
        if brakes is None or not brakes.engaged():
            return
        brakes.release_all(self.now_ns)
        if not self.link.armed or self.link.error is not None:
            return
        self.watch = None
        with contextlib.suppress(HapticsError):
            self.glove.tick(self.now_ns)
            self.wait(2 * COMMAND_LEAD_NS / NS_PER_S)
        self.watch = watch

    def _brake(self, channel: int) -> tuple[BrakeDriver, str]:
        brakes = self.glove.brakes
        if brakes is None:
            raise InputError(f"board = {self.board!r} has no brakes; this needs a rig on a brake board")
        return brakes, brakes.channels[int(in_range("channel", channel, 0, len(brakes.channels) - 1))]

    def _end_recording(self, error: BaseException | None) -> None:
        recorder, self.recorder = self.recorder, None
        if recorder is None or self.options.record is None:
            return
        journal, record, force = recorder.journal, self.options.record, self.options.force
        if error is not None:
            keep(journal, record, force, error)
            return
        try:
            if journal.error is not None:
                raise journal.error
            journal.raises = True
            finish(journal, record, force, {"ended": "off"})
        except BaseException as trouble:
            keep(journal, record, force, trouble)
            raise

    def _withdraw(self) -> None:
        """Pins that this bench sent out go back, three at a time, as long as the board takes commands."""
        now_ns = self.now_ns
        out = sorted(channel for channel, back_ns in self._back_ns.items() if back_ns > now_ns)
        self._back_ns.clear()
        if not out or not self.link.armed or self.link.error is not None:
            return
        try:
            for first in range(0, len(out), 3):
                at_ns = self.now_ns + 2 * PULSE_LEAD_NS
                self.pulse(out[first : first + 3], at_ns, WITHDRAW_S, toward_skin=False)
                self.watch = None
                self.wait_until(at_ns + seconds_to_ns(2 * WITHDRAW_S))
        except HapticsError:
            pass  # what ends the run is already on its way to the caller, and the pins stay latched without power

    # What comes in.

    def _look(self) -> None:
        """Read instruments, record what came, let the rig watch."""
        now_ns = self.now_ns
        for kind, one in self.instruments.items():
            if one.poll(now_ns) and self.recorder is not None:
                stream = self.recorder.streams[kind]
                for number, values in one.fresh():
                    stream.append((now_ns, number, *values))
        if self._stage is not None:
            self._stage.poll(now_ns)
        if self.glove.brakes is not None:
            refused = self.glove.brakes.take_refusals()
            self._brake_refusals += [f"{one.command}: {one.reason}" for one in refused]
        if self.recorder is not None:
            self.recorder.acknowledge(now_ns)
        if self.link.error is not None:
            raise self.link.error
        if self.watch is not None:
            self.watch()

    def _take(self, name: str, event: Event) -> None:
        if isinstance(event, Telemetry):
            self.telemetry.append((event.time_ns, event.message))
        if self.recorder is not None:
            self.recorder.link_event(name, event)

    def _note(self, kind: str, subject: str = "", detail: str = "") -> None:
        if self.recorder is not None:
            self.recorder.event(self.now_ns, kind, subject, detail=detail)

    def _tap(self, name: str, time_ns: int, to_board: bool, data: bytes) -> None:
        if self.recorder is None:
            self._early.append((time_ns, name, to_board, data))
        else:
            self.recorder.wire(time_ns, name, to_board, data)


def _stream_spec(kind: type[SampleStream]) -> StreamSpec:
    fields = [("time_ns", "i8"), ("number", "i8"), *((name, "f8") for name, _ in kind.columns)]
    return StreamSpec(
        kind.kind, np.dtype(fields), dict(kind.columns), f"Samples of the {kind.kind}: time read, its own count, values."
    )

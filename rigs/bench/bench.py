"""One bench: a board, the instruments on it, time, and a record of everything; off on every exit.

The same rig runs on ``sim://`` ports, in virtual time, and on hardware, in real time. Simulated instruments stand in the world
of the simulated board; real ones are serial ports.
"""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Mapping
from types import TracebackType
from typing import Self

from haptics.ends import orderly, unbroken
from haptics.errors import HapticsError, InputError
from haptics.link.events import Event, Telemetry
from haptics.link.port_url import is_simulated, query_of, with_defaults
from haptics.link.ports import check_port
from haptics.session.devices import Devices
from haptics.time import seconds_to_ns
from rigs.bench.board import BoardOnBench
from rigs.bench.options import BenchOptions
from rigs.bench.record import BenchRecord, Kinds
from rigs.instruments import InstrumentSilent, Samples, SampleStream, Stage

_ANSWER_S = 3.0
_worlds = itertools.count(1)


class Bench(BoardOnBench):
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
        instruments: Kinds,
        options: BenchOptions,
        *,
        rig: str,
        simulate: Mapping[str, object] | None = None,
        plot: tuple[str, str] | None = None,
    ):
        super().__init__(board, options)
        self.instruments: dict[str, SampleStream] = {}
        self._stage: Stage | None = None
        url = options.board_url(board)
        self._check_instruments(instruments, url)
        self._record = BenchRecord(options)
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
                wire_tap=self._record.wire,
                limit_pulses=False,
                withdraw_pins=False,
            )
            self._exits.push(self._close)
            self.glove.on_event(self._take)
            self.link = self.glove.links[board]
            shared = {**query_of(url), "channel": options.channel}
            for kind in instruments:
                self._open(kind, {key: shared[key] for key in ("world", "channel") if key in shared})
            self._record.begin(rig, board, instruments, plot)
            self._meet_instruments()
        except BaseException as error:
            self._exits.__exit__(type(error), error, error.__traceback__)
            raise

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

    def _check_instruments(self, instruments: Kinds, url: str) -> None:
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
        for kind, one in self.instruments.items():
            self._note("instrument", kind, detail=" ".join(f"{key}={value}" for key, value in one.header.items()))

    def _close(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Stage stopped, then off, whatever else goes wrong; then ports closed and the record made whole. Signals wait."""
        with unbroken:
            self._record.bear_errors()
            try:
                self._rest()
            finally:
                try:
                    self.glove.off()
                finally:
                    self.glove.close()
                    for one in self.instruments.values():
                        one.close()
                    if self._stage is not None:
                        self._stage.close()
                    self._record.end(error)

    def _stop_stage(self) -> None:
        """Nothing pulls any more; before volts drop, for strips that let go under a moving hand fly."""
        if self._stage is not None and not self._stage.idle:
            with contextlib.suppress(HapticsError):  # what ends the run goes on to end it, and volts have to drop in any case
                self._stage.stop()

    # What comes in.

    def _look(self) -> None:
        """Read instruments, record what came, let the rig watch."""
        now_ns = self.now_ns
        for one in self.instruments.values():
            if one.poll(now_ns):
                self._record.samples(now_ns, one)
        if self._stage is not None:
            self._stage.poll(now_ns)
        if self.glove.brakes is not None:
            refused = self.glove.brakes.take_refusals()
            self._brake_refusals += [f"{one.command}: {one.reason}" for one in refused]
        self._record.acknowledge(now_ns)
        if self.link.error is not None:
            raise self.link.error
        if self.watch is not None:
            self.watch()

    def _take(self, name: str, event: Event) -> None:
        if isinstance(event, Telemetry):
            self.telemetry.append((event.time_ns, event.message))
        self._record.link_event(name, event)

    def _note(self, kind: str, subject: str = "", detail: str = "") -> None:
        self._record.note(self.now_ns, kind, subject, detail)

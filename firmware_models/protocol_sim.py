"""``sim://BOARD?key=value``: a serial port whose other end is a simulated board or instrument, for pyserial's ``serial_for_url``.

pyserial finds this module by name once "firmware_models" is in ``serial.protocol_handler_packages``. Beyond a serial port
it offers ``haptics.link.simulated.SimulatedPort``. On the virtual clock a blocking read lets virtual time pass, up to its
timeout; on the real clock (the default, so that any serial program works) the board catches up whenever it is looked at.
"""

from __future__ import annotations

import errno
import importlib
import time
from collections.abc import Callable
from typing import Any

from serial import PortNotOpenError, SerialBase, SerialException, SerialTimeoutException

from firmware_models import world as worlds
from firmware_models.boards.board import FirmwareModel
from firmware_models.boards.boot import BOARD_OPTIONS
from firmware_models.boards.ticks import signed_difference
from firmware_models.instruments.instrument import INSTRUMENT_OPTIONS, Instrument
from firmware_models.line.cable import Cable, make_line
from firmware_models.line.uart import NEVER_NS, Line
from firmware_models.options import Option, parse_options, split_url
from haptics.errors import InputError, nearest
from haptics.link.line_faults import parse_faults
from haptics.link.messages import Board
from haptics.time import seconds_to_ns
from haptics.units import one_of

BOARDS = ("tactiles", "brake")
_INSTRUMENT_CLASSES = {
    "thermocouple": ("thermocouple", "Thermocouple"),
    "accelerometer": ("accelerometer", "Accelerometer"),
    "loadcell": ("loadcell", "LoadCell"),
    "stage": ("stage", "Stage"),
    "probe": ("probe", "Probe"),
}
INSTRUMENTS = tuple(_INSTRUMENT_CLASSES)
_CORES = ("py", "c", "avr")
PORT_OPTIONS: dict[str, Option] = {
    "world": Option(None, "name of a world that several ports share; default: one of its own"),
    "clock": Option("real", "who moves time", choices=worlds.CLOCKS),
    "core": Option("py", "which firmware runs: this package's model; the C core; the C core on a simulated AVR", choices=_CORES),
    "faults": Option(None, "what goes wrong on the line, such as corrupt=0.01,drop=0.01", reader=parse_faults),
}


def board_options(board: str) -> dict[str, Option]:
    """Every URL key of a board.

    :param board: "tactiles" or "brake".
    :return: default, unit, range and meaning by key.
    :raises InputError: no such board.
    """
    return {**PORT_OPTIONS, **BOARD_OPTIONS, **_model(board).options()}


def instrument_options(instrument: str) -> dict[str, Option]:
    """Every URL key of an instrument.

    :param instrument: one of ``INSTRUMENTS``.
    :return: default, unit, range and meaning by key.
    :raises InputError: no such instrument.
    """
    return {**PORT_OPTIONS, **INSTRUMENT_OPTIONS, **_instrument(instrument).options()}


def _model(board: str) -> type[FirmwareModel]:
    one_of("board", board, BOARDS)
    if board == "tactiles":  # imported late: the plants are not needed to list or to refuse
        from firmware_models.boards.tactiles_board import TactilesBoard

        return TactilesBoard
    from firmware_models.boards.brake_board import BrakeBoard

    return BrakeBoard


def _instrument(name: str) -> type[Instrument]:
    one_of("instrument", name, INSTRUMENTS)
    module, kind = _INSTRUMENT_CLASSES[name]
    return getattr(importlib.import_module(f"firmware_models.instruments.{module}"), kind)


def make_cable(board: str, options: dict[str, Any], now_ns: int) -> Cable:
    """A board of that name, powered on at ``now_ns``, at the end of its serial line.

    :param board: "tactiles" or "brake".
    :param options: values of ``board_options(board)``.
    :param now_ns: world time, ns.
    :return: the host's end.
    :raises InputError: an option that the chosen core cannot honour, or a core that cannot be built here.
    """
    to_host = make_line(options, "in")
    return Cable(_make_board(board, options, to_host, now_ns), to_host, options)


def _make_board(board: str, options: dict[str, Any], to_host: Line, now_ns: int) -> Any:
    core, kind = options["core"], Board[one_of("board", board, BOARDS).upper()]
    if core == "c":
        from firmware_models.cores.compiled_board import CompiledBoard

        return CompiledBoard(kind, options, to_host, now_ns)
    if core == "avr":
        from firmware_models.cores.avr_board import AvrBoard

        return AvrBoard(kind, options, to_host, now_ns)
    return _model(board)(options, to_host, now_ns)


def _make_instrument(name: str, options: dict[str, Any], world: worlds.World) -> Cable:
    to_host = make_line(options, "in")
    return Cable(_instrument(name)(options, to_host, world.now_ns, world), to_host, options, announce=False)


class Serial(SerialBase):
    """A simulated port, opened by URL. Behaves as a pyserial port and as a ``SimulatedPort``."""

    _world: worlds.World
    _cable: Cable

    def open(self) -> None:
        """Find or make the board.

        :raises InputError: a bad URL: board, key or value, or other settings than the board already there has.
        :raises SerialException: the board is open already (``errno`` EBUSY), or no port is set.
        """
        if self.port is None:
            raise SerialException("Port must be configured before it can be used.")
        if self.is_open:
            raise SerialException("Port is already open.")
        board, query = split_url(self.port)
        if board not in (known := (*BOARDS, *INSTRUMENTS)):
            there_are = ", ".join(f"sim://{name}" for name in known)
            raise InputError(f"sim://{board}: there is no such simulated board; there are {there_are}{nearest(board, known)}")
        name = query.pop("world", None)
        options = parse_options(query, instrument_options(board) if board in INSTRUMENTS else board_options(board))
        if board in INSTRUMENTS and options["core"] != "py":
            raise InputError(f"core = {options['core']} is not for a {board}: instruments run no firmware; leave core out")
        if board in INSTRUMENTS and options["faults"] is not None and options["faults"].dtr_reset:
            raise InputError(f"faults: dtr_reset = 1 is not for a {board}: instruments have no reset line; leave dtr_reset out")
        self._world = worlds.enter(name, options["clock"])
        self._world_name = name
        try:
            self._cable = self._attach(board, options)
        except BaseException:
            worlds.leave(name, self._world)
            raise
        self.is_open = True
        self._reconfigure_port()

    def _attach(self, board: str, options: dict[str, Any]) -> Cable:
        world = self._world
        with world.lock:
            now_ns = world.catch_up()
            cable = world.members.get(board)
            if cable is None:
                make = _make_instrument(board, options, world) if board in INSTRUMENTS else make_cable(board, options, now_ns)
                world.members[board] = cable = make
            if not isinstance(cable, Cable) or cable.attached:
                raise SerialException(errno.EBUSY, f"{self.port} is open already in this process; close it there first")
            if cable.options != options:
                raise InputError(f"port = {self.port!r} asks for other settings than the board in this world was made with")
            cable.attach(now_ns)
            world.replan()
            return cable

    def close(self) -> None:
        """Let go of the board. It lives on in a shared world, till its dead-man stops it or the last port closes."""
        if not self.is_open:
            return
        self.is_open = False
        with self._world.lock:
            self._cable.attached = False
            self._world.changed.notify_all()
        worlds.leave(self._world_name, self._world)

    def _reconfigure_port(self) -> None:
        if self.is_open:
            with self._world.lock:
                self._cable.set_host_baud(self.baudrate or self._cable.to_host.baud)

    # Bytes.

    def _live(self) -> worlds.World:
        if not self.is_open:
            raise PortNotOpenError()
        return self._world

    def _now(self) -> int:
        return self._live().catch_up()

    def _plugged(self, now_ns: int) -> None:
        """:raises SerialException: the line's faults have unplugged the board."""
        if now_ns >= self._cable.unplugged_ns:
            raise SerialException(errno.EIO, f"{self.port}: the board is unplugged")

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once.

        :raises SerialException: port closed, or the board unplugged by the line's faults.
        """
        with self._live().lock:
            now_ns = self._now()
            self._plugged(now_ns)
            return self._cable.to_host.waiting(now_ns)

    @property
    def out_waiting(self) -> int:
        """Bytes written that have not reached the board yet.

        :raises SerialException: port closed.
        """
        with self._live().lock:
            return self._cable.to_board.in_transit(self._now())

    def read(self, size: int = 1) -> bytes:
        """Read; waits for the bytes in the world's own time.

        :param size: how many bytes are waited for.
        :return: so many, or fewer if the port's timeout (None: for ever) ended first.
        :raises SerialException: port closed, the board unplugged by the line's faults, or a wait without end on a virtual clock.
        """
        world = self._live()
        with world.lock:
            line = self._cable.to_host
            now_ns = self._now()
            self._plugged(now_ns)
            deadline_ns = NEVER_NS if self.timeout is None else now_ns + seconds_to_ns(self.timeout)
            while line.waiting(now_ns) < size and now_ns < deadline_ns:
                until_ns = min(line.complete_ns(size), world.next_ns, deadline_ns)
                if until_ns == NEVER_NS and world.virtual:
                    raise SerialException(f"{self.port}: nothing will ever arrive, and virtual time has no end; set a timeout")
                world.wait(until_ns)
                now_ns = self._now()
            return line.take(size, now_ns)

    def write(self, data: Any, /) -> int:
        """Hand bytes to the line; they reach the board at the baud rate.

        :param data: bytes, or what ``bytes`` takes.
        :return: how many.
        :raises SerialException: the line's faults have unplugged the board.
        :raises SerialTimeoutException: they let the peer take no more bytes.
        """
        data = bytes(data)
        with self._live().lock:
            now_ns = self._now()
            self._plugged(now_ns)
            if now_ns >= self._cable.stalled_ns:
                raise SerialTimeoutException("Write timeout")
            self._cable.to_board.send(data, now_ns)
            self._world.replan()
            self._world.changed.notify_all()
        return len(data)

    def flush(self) -> None:
        """Wait until the last byte written has reached the board."""
        with self._live().lock:
            while self._cable.to_board.busy_until_ns > self._now():
                self._world.wait(self._cable.to_board.busy_until_ns)

    def reset_input_buffer(self) -> None:
        """Forget what has arrived."""
        with self._live().lock:
            self._cable.to_host.drop_arrived(self._now())

    def reset_output_buffer(self) -> None:
        """Forget what has not left."""
        with self._live().lock:
            self._cable.to_board.drop_unsent(self._now())
            self._world.replan()

    # Modem lines: there, and without effect.

    def _update_break_state(self) -> None: ...

    def _update_rts_state(self) -> None: ...

    def _update_dtr_state(self) -> None: ...

    cts = property(lambda self: True)
    dsr = property(lambda self: True)
    ri = property(lambda self: False)
    cd = property(lambda self: True)

    # What only a simulated port has.

    @property
    def board(self) -> Any:
        """The board or instrument itself, for tests that break its plant."""
        return self._cable.board

    @property
    def virtual(self) -> bool:
        """Whether this port's time moves only by ``advance`` and blocking reads."""
        return self._live().virtual

    @property
    def now_ns(self) -> int:
        """The world's time: from 0 on a virtual clock, the machine's monotonic time on the real one."""
        with self._live().lock:
            return self._now()

    def advance(self, to_ns: int) -> None:
        """Carry the whole world to ``to_ns``.

        :param to_ns: world time, ns.
        :raises InputError: ``to_ns`` lies in the past, or ahead of the real clock, which nobody moves.
        """
        world = self._live()
        with world.lock:
            if world.virtual:
                world.advance(to_ns)
            elif to_ns > time.monotonic_ns():
                raise InputError(f"to_ns = {to_ns} lies ahead of the real clock; open the port with clock=virtual to move time")
            else:
                world.catch_up()

    def pass_by(self, to_ns: int) -> int | None:
        """Let others in a world on a virtual clock act, while this port's own device does nothing.

        :param to_ns: world time at most, ns.
        :return: world time at which bytes wait to be read here, which ends it, ns; None if none do.
        """
        world = self._live()
        if not world.virtual or world.next_ns > to_ns or len(world.members) == 1:
            return None
        line = self._cable.to_host
        with world.lock:
            return world.pass_by(self._cable, to_ns, lambda now_ns: line.waiting(now_ns) > 0)

    def next_event(self) -> int | None:
        """When something happens next by itself.

        :return: world time, ns; None if nothing will.
        """
        next_ns = self._live().next_ns
        return None if next_ns == NEVER_NS else next_ns

    def truth(self) -> dict[str, Any]:
        """The plant as it is now; see the board's own ``truth``.

        :return: values by name.
        """
        with self._live().lock:
            self._cable.advance(self._now())
            return self._cable.board.truth()

    def set_load(self, channel: int, **load: float) -> None:
        """Act on the plant from outside; see the board's own ``set_load``.

        :param channel: coil or output, from 0.
        :param load: what the plant's ``load`` takes, and ``brown_out``, ``reset``.
        :raises InputError: see the board's own ``set_load``.
        """
        with self._live().lock:
            self._cable.advance(self._now())
            self._cable.board.set_load(channel, **load)
            self._world.replan()

    def watch(self, listener: Callable[[int, str, int, int], None]) -> None:
        """Call a listener at each switching of an output by the board's hardware.

        :param listener: called with time (world, ns), kind ("coil", "brake" or "piezo"), channel, and drive: 1, or -1 for a coil
            driven back, or 0: off.
        """
        self._cable.board.plant.switched.append(listener)

    def tick_ns(self, tick: int) -> int:
        """World time at which the board's own clock shows ``tick``, the one nearest to now.

        :param tick: count, 0 to 2**32 - 1.
        :return: world time, ns.
        """
        with self._live().lock:
            self._cable.advance(now_ns := self._now())
            ticks = self._cable.board.ticks
            count = ticks.count(now_ns)
            return ticks.time_ns(count + signed_difference(tick, count % (1 << 32)))

    def energised(self) -> list[int]:
        """Channels that carry current or dangerous volts now.

        :return: channel numbers, from 0, rising.
        """
        with self._live().lock:
            self._cable.advance(self._now())
            return self._cable.board.energised()

"""``core=c``: the C firmware core as a library, around the same hardware as the Python boards.

The core is asked how long it has nothing to do, and run at exactly that tick; so an edge at tick T acts on the plant at the first
nanosecond of T on the board's own crystal. ``firmware/host/host.h`` is what is spoken here.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from firmware_models.boards.boot import Boots
from firmware_models.cores.brake_pins import BrakePins
from firmware_models.cores.coil_pins import CoilPins
from firmware_models.cores.core_settings import core_settings
from firmware_models.cores.toolchain import host_library
from firmware_models.line.uart import NEVER_NS, Line
from haptics.errors import InputError
from haptics.link.messages import COIL_CHANNELS, LIMITS, Board, State

_U32 = ctypes.c_uint32
_TRANSMIT = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.POINTER(ctypes.c_uint8), _U32)
_OUTPUTS = ctypes.CFUNCTYPE(None, ctypes.c_void_p, _U32)
_ASK = ctypes.CFUNCTYPE(_U32, ctypes.c_void_p)
_CONVERT = ctypes.CFUNCTYPE(_U32, ctypes.c_void_p, _U32)


class _Settings(ctypes.Structure):
    _fields_ = (("limits", ctypes.c_uint16 * LIMITS), ("nominal_pf", ctypes.c_uint16))


class _CoilHeat(ctypes.Structure):
    _fields_ = (("on_time", ctypes.c_uint32), ("check", ctypes.c_uint16))


class _Memory(ctypes.Structure):
    """What outlives a boot; all zeros in a new board."""

    _fields_ = (("heat", _CoilHeat * COIL_CHANNELS), ("notes", ctypes.c_uint8))


class _Calls(ctypes.Structure):
    _fields_ = (
        ("transmit", _TRANSMIT),
        ("uplink_busy", _ASK),
        ("outputs", _OUTPUTS),
        ("convert", _CONVERT),
        ("interlock_closed", _ASK),
    )


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(host_library()))
    host = ctypes.c_void_p
    signatures = {
        "host_new": (
            host,
            [
                *(_U32, ctypes.POINTER(_Settings), _U32, _U32, _U32),
                *(ctypes.POINTER(_Memory), ctypes.POINTER(_Calls), ctypes.c_void_p),
            ],
        ),
        "host_free": (None, [host]),
        "host_receive": (None, [host, ctypes.c_char_p, _U32, _U32]),
        "host_run": (None, [host, _U32]),
        "host_next": (_U32, [host, _U32]),
        "host_state": (_U32, [host]),
        "host_faults": (_U32, [host]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


class CompiledBoard:
    """A board whose firmware is the C core. To a cable it is what a ``FirmwareModel`` is.

    :param kind: which board.
    :param options: values of ``BOARD_OPTIONS`` and the plant's own, and ``core``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :raises InputError: an option that the core cannot honour, or no tools to build the core with.
    """

    def __init__(self, kind: Board, options: Mapping[str, Any], transmitter: Line, start_ns: int):
        self.kind = kind
        settings = core_settings(kind, options)
        self.limits = settings.limits
        self._settings = _Settings((ctypes.c_uint16 * LIMITS)(*settings.limits), settings.nominal_pf)
        self._boots = Boots(options, kind)
        self.pins = (CoilPins if kind == Board.TACTILES else BrakePins)(options, self._boots.plant_rng, start_ns)
        self.start_ns = self.now_ns = start_ns
        self._line = transmitter
        self._library = _library()
        self._failure: BaseException | None = None
        self._calls = _Calls(
            _TRANSMIT(self._guarded(self._transmit)),
            _ASK(self._guarded(self._uplink_busy)),
            _OUTPUTS(self._guarded(self._outputs)),
            _CONVERT(self._guarded(self._convert)),
            _ASK(self._guarded(self._interlock_closed)),
        )
        self._memory = _Memory()
        self._next_ns = NEVER_NS
        self._free: Callable[[], object] = lambda: None
        self._boot(brown_out=False)

    @property
    def plant(self) -> Any:
        """The hardware itself, for instruments and for tests that break it."""
        return self.pins.plant

    @property
    def state(self) -> State:
        """The core's state."""
        return State(self._library.host_state(self._host))

    @property
    def faults(self) -> int:
        """Mask of the latched faults, bit 0 for fault 0."""
        return self._library.host_faults(self._host)

    def brown_out(self) -> None:
        """The CPU's supply breaks down for a moment: outputs off at once, memory lost, and a reboot."""
        ctypes.memset(self._memory.heat, 0, ctypes.sizeof(self._memory.heat))
        self._restart(brown_out=True)

    def reset(self) -> None:
        """The CPU's reset line is pulled, as opening a port does by DTR: outputs off at once, and a reboot."""
        self._restart(brown_out=False)

    def _restart(self, brown_out: bool) -> None:
        self.pins.off(self.now_ns)
        self._line.drop_unsent(self.now_ns)
        self._boot(brown_out)

    # Time and bytes.

    def next_event(self) -> int:
        """When this board does something by itself next.

        :return: world time, ns.
        """
        return self._next_ns

    def advance(self, to_ns: int) -> None:
        """Run everything due up to and including ``to_ns``.

        :param to_ns: world time, ns; not before ``now_ns``.
        """
        while self._next_ns <= to_ns:
            self.now_ns = self._next_ns
            self._library.host_run(self._host, self._tick())
            self.replan()
        self.now_ns = to_ns

    def handle(self, data: bytes) -> None:
        """Take bytes whose last bit has just come in.

        :param data: any bytes: whole frames, parts of them, noise.
        """
        self._library.host_receive(self._host, data, len(data), self._tick())
        self.replan()

    def replan(self) -> None:
        """Ask the core when it is needed next; raise what went wrong in the plant meanwhile."""
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure
        left = self._library.host_next(self._host, self._tick())
        self._next_ns = self.ticks.time_ns(self.ticks.count(self.now_ns) + max(left, 1))

    # Seen from outside.

    def truth(self) -> dict[str, Any]:
        """As of the Python board.

        :return: the plant's own values by name, and ``state``.
        """
        return {**self.pins.truth(self.now_ns), "state": self.state}

    def set_load(self, channel: int, **load: float) -> None:
        """Act on the hardware from outside.

        :param channel: coil or output, from 0.
        :param load: what the plant's ``load`` takes; ``brown_out`` and ``reset``, not 0, do what the methods of these names do.
        :raises InputError: no such channel, an unknown key, or a value out of range; see the plant's ``load``.
        """
        browned_out, resets = load.pop("brown_out", 0), load.pop("reset", 0)
        self.pins.set_load(channel, self.now_ns, **load)
        if browned_out:
            self.brown_out()
        if resets:
            self.reset()

    def energised(self) -> list[int]:
        """Channels that carry current or dangerous volts now.

        :return: channel numbers, from 0, rising.
        """
        return self.pins.energised(self.now_ns)

    # What the core asks.

    def _boot(self, brown_out: bool) -> None:
        self._free()
        self.ticks, self.boot_id = self._boots.power_on(self.now_ns)
        self._host = self._library.host_new(
            self.kind, self._settings, self.boot_id, brown_out, self._tick(), self._memory, ctypes.byref(self._calls), None
        )
        if not self._host:
            raise InputError(f"core = c has no board of kind {int(self.kind)}, or no memory for it; use core=py")
        self._free = weakref.finalize(self, self._library.host_free, self._host)
        self.replan()

    def _tick(self) -> int:
        return self.ticks.u32(self.now_ns)

    def _guarded(self, function: Callable[..., int | None]) -> Callable[..., int]:
        """An exception cannot pass through the core: it is kept, and raised once the core has returned."""

        def call(_user: int | None, *arguments: Any) -> int:
            try:
                return function(*arguments) or 0
            except BaseException as error:
                self._failure = self._failure or error
                return 0

        return call

    def _transmit(self, data: Any, count: int) -> None:
        self._line.send(bytes(data[:count]), self.now_ns)

    def _uplink_busy(self) -> int:
        return max(self.ticks.count(self._line.busy_until_ns) - self.ticks.count(self.now_ns), 0)

    def _outputs(self, word: int) -> None:
        self.pins.outputs(word, self.now_ns)

    def _convert(self, sense: int) -> int:
        return self.pins.counts(sense, self.now_ns)

    def _interlock_closed(self) -> int:
        return int(self.pins.interlock_closed)

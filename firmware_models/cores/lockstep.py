"""The lock-step simulator of the ATmega328P, from Python: ``firmware/simavr/lockstep.h``, with cycles in and cycles out."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from firmware_models.cores.toolchain import lockstep_library
from haptics.errors import HapticsError
from haptics.link.messages import Board

CPU_HZ = 16_000_000
EEPROM_SIZE = 1024
FLASH_SIZE = 32_768
RAM_SIZE = 2048

_VOID, _U32, _U64 = ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64
_U8_POINTER = ctypes.POINTER(ctypes.c_uint8)
_PAIR = ctypes.CFUNCTYPE(None, _VOID, _U32, _U64)
_CONVERT = ctypes.CFUNCTYPE(_U32, _VOID, _U32, _U64)
_WATCHDOG = ctypes.CFUNCTYPE(None, _VOID, _U64)


class Cause(IntEnum):
    """Why the CPU is reset: the bits of MCUSR."""

    POWER_ON = 1
    EXTERNAL = 2
    BROWN_OUT = 4


class Around(Protocol):
    """What is around the chip; called while it runs, in the order of the cycles."""

    def outputs(self, word: int, cycle: int) -> None:
        """The output word changes.

        :param word: 32 bits (docs/reference/boards.md).
        :param cycle: when, cycles since power-on.
        """
        ...

    def transmit(self, byte: int, ends: int) -> None:
        """A byte is on its way to the host.

        :param byte: 0 to 255.
        :param ends: when its stop bit ends, cycles since power-on.
        """
        ...

    def convert(self, sense: int, cycle: int) -> int:
        """An analogue input is converted.

        :param sense: number of the input.
        :param cycle: when, cycles since power-on.
        :return: counts, 0 to 1023.
        """
        ...

    def watchdog(self, cycle: int) -> None:
        """The watchdog resets the CPU.

        :param cycle: when, cycles since power-on.
        """
        ...


class _Calls(ctypes.Structure):
    _fields_ = (("outputs", _PAIR), ("transmit", _PAIR), ("convert", _CONVERT), ("watchdog", _WATCHDOG))


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(lockstep_library()))
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "lockstep_new": (_VOID, [_U32, ctypes.c_char_p, ctypes.POINTER(_Calls), _VOID]),
        "lockstep_free": (None, [_VOID]),
        "lockstep_reset": (None, [_VOID, _U32]),
        "lockstep_feed": (ctypes.c_int, [_VOID, ctypes.c_char_p, ctypes.POINTER(_U64), _U32]),
        "lockstep_lid": (None, [_VOID, ctypes.c_int]),
        "lockstep_run": (ctypes.c_int, [_VOID, _U64]),
        "lockstep_cycle": (_U64, [_VOID]),
        "lockstep_next": (_U64, [_VOID]),
        "lockstep_state": (_U32, [_VOID]),
        "lockstep_faults": (_U32, [_VOID]),
        "lockstep_lost": (_U32, [_VOID]),
        "lockstep_eeprom": (_U8_POINTER, [_VOID]),
        "lockstep_flash": (_U8_POINTER, [_VOID]),
        "lockstep_ram": (_U8_POINTER, [_VOID]),
        "lockstep_pc": (_U32, [_VOID]),
        "lockstep_clock_begun": (_U64, [_VOID]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


class Lockstep:
    """A chip with an image in its flash, in reset until ``reset``.

    :param kind: which board's wiring is around the chip.
    :param image: a .hex file.
    :param around: held weakly, for it usually holds this.
    :raises HapticsError: the image cannot be read.
    """

    def __init__(self, kind: Board, image: Path, around: Around):
        self._library = _library()
        self._around = weakref.ref(around)
        self._failure: BaseException | None = None
        self._calls = _Calls(
            _PAIR(self._guarded("outputs")),
            _PAIR(self._guarded("transmit")),
            _CONVERT(self._guarded("convert")),
            _WATCHDOG(self._guarded("watchdog")),
        )
        self._chip = self._library.lockstep_new(kind, str(image).encode(), ctypes.byref(self._calls), None)
        if not self._chip:
            raise HapticsError(f"the simulated ATmega328P could not load {image}")
        weakref.finalize(self, self._library.lockstep_free, self._chip)

    def reset(self, cause: Cause) -> None:
        """Reset the CPU now; flash and EEPROM stay.

        :param cause: what the firmware finds in MCUSR.
        """
        self._library.lockstep_reset(self._chip, cause)
        self._raise_failure()

    def feed(self, data: bytes, ends: Sequence[int]) -> None:
        """Bytes on the line to the board.

        :param data: the bytes.
        :param ends: of each byte, the cycle at which its stop bit ends; rising.
        :raises MemoryError: there is no memory to keep them.
        """
        if not self._library.lockstep_feed(self._chip, data, (_U64 * len(ends))(*ends), len(data)):
            raise MemoryError

    def lid(self, closed: bool) -> None:
        """The lid's contact, from now on.

        :param closed: whether the lid is.
        """
        self._library.lockstep_lid(self._chip, closed)

    def run(self, until: int) -> None:
        """Run until ``until``, or beyond it by less than one instruction.

        :param until: cycles since power-on.
        :raises HapticsError: the CPU has stopped for good, at an instruction that does not exist.
        """
        alive = self._library.lockstep_run(self._chip, until)
        self._raise_failure()
        if not alive:
            raise HapticsError(f"the simulated ATmega328P crashed at cycle {self.cycle}, instruction {self.pc:#06x}")

    @property
    def cycle(self) -> int:
        """Cycles since power-on."""
        return self._library.lockstep_cycle(self._chip)

    @property
    def next(self) -> int:
        """The next cycle at which something may happen; whatever is transmitted before it ends no earlier than it."""
        return self._library.lockstep_next(self._chip)

    @property
    def clock_begun(self) -> int:
        """The cycle at which timer 1 was started last; it has counted each eighth since."""
        return self._library.lockstep_clock_begun(self._chip)

    @property
    def state(self) -> int:
        """As the firmware shows it to a debugger."""
        return self._library.lockstep_state(self._chip)

    @property
    def faults(self) -> int:
        """As the firmware shows it to a debugger."""
        return self._library.lockstep_faults(self._chip)

    @property
    def lost(self) -> int:
        """Bytes lost because the CPU left too many in the UART."""
        return self._library.lockstep_lost(self._chip)

    @property
    def pc(self) -> int:
        """Where the next instruction lies in flash, in bytes."""
        return self._library.lockstep_pc(self._chip)

    @property
    def eeprom(self) -> memoryview:
        """The EEPROM itself."""
        return self._memory(self._library.lockstep_eeprom(self._chip), EEPROM_SIZE)

    @property
    def flash(self) -> memoryview:
        """The flash itself."""
        return self._memory(self._library.lockstep_flash(self._chip), FLASH_SIZE)

    @property
    def ram(self) -> memoryview:
        """The RAM itself; its top is the stack."""
        return self._memory(self._library.lockstep_ram(self._chip), RAM_SIZE)

    @staticmethod
    def _memory(start: Any, size: int) -> memoryview:
        return memoryview(ctypes.cast(start, ctypes.POINTER(ctypes.c_uint8 * size)).contents).cast("B")

    def _guarded(self, name: str) -> Callable[..., int]:
        """An exception cannot pass through C: it is kept, and raised once C has returned."""
        me = weakref.ref(self)

        def call(_user: int | None, *arguments: int) -> int:
            chip = me()
            around = chip and chip._around()
            if not chip or not around:
                return 0
            try:
                return getattr(around, name)(*arguments) or 0
            except BaseException as error:
                chip._failure = chip._failure or error
                return 0

        return call

    def _raise_failure(self) -> None:
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

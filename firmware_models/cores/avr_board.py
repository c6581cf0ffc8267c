"""``core=avr``: the image that a board is flashed with, on a simulated ATmega328P, around the same hardware as the Python boards.

World time is the chip's cycles on the board's own crystal. Bytes reach the UART one by one, each with its stop bit; pins act on
the plant at their cycle, and a conversion sees the plant at its own. Same seed and same bytes at the same times: same cycles.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

from fastcrc import crc16

from firmware_models.boards.boot import Boots
from firmware_models.boards.ticks import TickCounter
from firmware_models.cores import toolchain
from firmware_models.cores.brake_pins import BrakePins
from firmware_models.cores.coil_pins import CoilPins
from firmware_models.cores.core_settings import CoreSettings, core_settings
from firmware_models.cores.lockstep import CPU_HZ, Cause, Lockstep
from firmware_models.line.uart import Line
from haptics.errors import InputError
from haptics.link.framing import DELIMITER
from haptics.link.messages import TICK_HZ, Board, State

BAUD = 500_000
START_TICK = 0xFFFF - 305 << 16
"""The count with which the firmware's clock begins (``firmware/avr/clock.c``)."""
SETTINGS_AT, BOOTS_AT = 0, 14
"""Where the EEPROM holds the settings with their checksum, and the number of boots (``firmware/avr/store.c``)."""
_U32 = 1 << 32
_UART_CYCLES = 8
"""A byte is in the UART half a microsecond after its stop bit: more than one instruction, so that the chip is never past it."""


class AvrBoard:
    """A board whose firmware runs on a simulated chip. To a cable it is what a ``FirmwareModel`` is, but for ``bytewise``.

    :param kind: which board.
    :param options: values of ``BOARD_OPTIONS`` and the plant's own, and ``core``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :raises InputError: an option that the chip cannot honour, or no tools to build its image with.
    """

    bytewise = True

    def __init__(self, kind: Board, options: Mapping[str, Any], transmitter: Line, start_ns: int):
        _check(options)
        self.kind = kind
        settings = core_settings(kind, options)
        self.limits = settings.limits
        self._boots = Boots(options, kind)
        self.pins = (CoilPins if kind == Board.TACTILES else BrakePins)(options, self._boots.plant_rng, start_ns)
        self.start_ns = self.now_ns = start_ns
        self._line = transmitter
        self._frame = bytearray()
        earlier_boots = self._boots.power_on(start_ns).boot_id  # drawn, so that boards with other seeds have other ids
        self._cycles = TickCounter(start_ns, 0, self._boots.drift_ppb, CPU_HZ)
        self.chip = Lockstep(kind, toolchain.image(kind.name.lower()), self)
        image = eeprom(settings, earlier_boots)
        self.chip.eeprom[: len(image)] = image
        self.chip.reset(Cause.POWER_ON)

    @property
    def plant(self) -> Any:
        """The hardware itself, for instruments and for tests that break it."""
        return self.pins.plant

    @property
    def state(self) -> State:
        """As the firmware shows it to a debugger."""
        return State(self.chip.state)

    @property
    def faults(self) -> int:
        """Mask of the latched faults, bit 0 for fault 0, as the firmware shows it to a debugger."""
        return self.chip.faults

    @property
    def boot_id(self) -> int:
        """The id of the last boot."""
        return boot_id(int.from_bytes(self.chip.eeprom[BOOTS_AT : BOOTS_AT + 4], "little"))

    @property
    def ticks(self) -> TickCounter:
        """The firmware's clock, since the last reset."""
        begun_ns = self._cycles.time_ns(self.chip.clock_begun)
        return TickCounter(begun_ns, START_TICK, self._boots.drift_ppb, TICK_HZ)

    def brown_out(self) -> None:
        """The CPU's supply breaks down for a moment: outputs off at once, and a reboot."""
        self._reset(Cause.BROWN_OUT)

    def reset(self) -> None:
        """The CPU's reset line is pulled, as opening a port does by DTR: outputs off at once, and a reboot."""
        self._reset(Cause.EXTERNAL)

    # Time and bytes.

    def next_event(self) -> int:
        """When this board may do something by itself next: its next interrupt, or soon if it is at work.

        :return: world time, ns.
        """
        return self._cycles.time_ns(self.chip.next)

    def advance(self, to_ns: int) -> None:
        """Run everything due up to and including ``to_ns``.

        :param to_ns: world time, ns; not before ``now_ns``.
        :raises HapticsError: the simulated CPU has crashed.
        """
        self.now_ns = to_ns
        self.chip.lid(self.pins.interlock_closed)
        self.chip.run(self._cycles.count(to_ns) + 1)

    def feed(self, data: bytes, times_ns: Sequence[int]) -> None:
        """Bytes that come in until the next ``advance`` ends.

        :param data: the bytes.
        :param times_ns: of each byte, the world time at which its stop bit ends, ns.
        """
        if data:
            self.chip.feed(data, [self._cycles.count(time_ns) + _UART_CYCLES for time_ns in times_ns])

    def replan(self) -> None:
        """Something was changed from outside: the chip finds out by itself."""

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

    # What the chip does.

    def outputs(self, word: int, cycle: int) -> None:
        """See ``lockstep.Around``.

        :param word: the output word (docs/reference/boards.md).
        :param cycle: when it changes, cycles since power-on.
        """
        self.pins.outputs(word, self._time_ns(cycle))

    def convert(self, sense: int, cycle: int) -> int:
        """See ``lockstep.Around``.

        :param sense: number of the analogue input.
        :param cycle: when it is converted, cycles since power-on.
        :return: counts, 0 to 1023.
        """
        return self.pins.counts(sense, self._time_ns(cycle))

    def transmit(self, byte: int, ends: int) -> None:
        """See ``lockstep.Around``. The line is handed whole frames, each so that it ends when its last byte does.

        :param byte: 0 to 255.
        :param ends: when its stop bit ends, cycles since power-on.
        """
        self._frame.append(byte)
        if byte == DELIMITER[0]:
            self._line.send(bytes(self._frame), self._cycles.time_ns(ends) - self._line.duration_ns(len(self._frame)))
            self._frame.clear()

    def watchdog(self, cycle: int) -> None:
        """See ``lockstep.Around``.

        :param cycle: when it resets the CPU, cycles since power-on.
        """
        self._cut(self._time_ns(cycle))

    def _reset(self, cause: Cause) -> None:
        self._cut(self.now_ns)
        self.chip.reset(cause)

    def _cut(self, now_ns: int) -> None:
        """The line to the host goes quiet in the middle of what was sent."""
        self._frame.clear()
        self._line.drop_unsent(now_ns)

    def _time_ns(self, cycle: int) -> int:
        """World time of a cycle; of a reset's, which may lie an instruction beyond, the present."""
        return min(self._cycles.time_ns(cycle), self.now_ns)


def _check(options: Mapping[str, Any]) -> None:
    if options["tick_offset"] is not None:
        raise InputError(
            f"tick_offset = {options['tick_offset']} is not possible with core = avr: the firmware begins its count itself, "
            f"at {START_TICK}, 10 s before it wraps; leave tick_offset out, or use core=py or core=c"
        )
    if options["baud"] != BAUD:
        raise InputError(
            f"baud = {options['baud']} is not possible with core = avr: the firmware sets its UART to {BAUD}; leave baud out"
        )


def eeprom(settings: CoreSettings, boots: int) -> bytes:
    """What a lab would have written into the EEPROM: the settings, their checksum, and the boots so far.

    :param settings: limits and nominal capacitance.
    :param boots: boots so far, 0 to 2**32 - 1.
    :return: the first 18 bytes of the EEPROM.
    """
    packed = struct.pack("<6H", *settings.limits, settings.nominal_pf)
    return packed + struct.pack("<HI", crc16.ibm_sdlc(packed), boots)


def boot_id(boots: int) -> int:
    """The id that the firmware makes of the number of its boots (``firmware/avr/store.c``).

    :param boots: boots so far, this one included, 0 to 2**32 - 1.
    :return: 0 to 2**32 - 1, another one for each number.
    """
    for _ in range(2):
        boots = boots * 0x9E3779B1 % _U32
        boots ^= boots >> 15
    return boots

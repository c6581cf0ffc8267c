"""An image on the simulated chip, in cycles: frames in, frames and output words out, senses as a test likes them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from firmware_models.cores import toolchain
from firmware_models.cores.avr_board import START_TICK, eeprom
from firmware_models.cores.core_settings import CoreSettings
from firmware_models.cores.lockstep import Cause, Lockstep
from haptics.link.framing import Deframer, encode_frame
from haptics.link.messages import BY_NAME, BY_TYPE, COIL_CHANNELS, Board, Status, decode, encode

CYCLES_PER_US = 16
CYCLES_PER_TICK = 8
BYTE_CYCLES = 320  # ten bits at 500 kbaud
MS = 16_000  # cycles
MS_TICKS = 2000
WRAP = 1 << 32
FEED = 1 << 15
FIVE_VOLTS = 500  # counts of the coil supply's sense

missing = [tool for tool in ("make", "avr-gcc", os.environ.get("CC") or "cc") if shutil.which(tool) is None]
if not any(Path(folder, "simavr/sim_avr.h").exists() for folder in ("/usr/include", "/usr/local/include")):
    missing.append("libsimavr")
needs_avr = pytest.mark.skipif(bool(missing), reason=f"no simulated ATmega328P here: {', '.join(missing)} not found")


class Heard(NamedTuple):
    """A frame from the board, the cycle at which its first bit went out, and that at which its last was in."""

    begun: int
    ended: int
    name: str
    seq: int
    message: Any


class Edge(NamedTuple):
    """One coil's pin, at a cycle."""

    cycle: int
    channel: int
    on: bool


def frame(name: str, seq: int, *values: Any) -> bytes:
    return encode_frame(BY_NAME[name].type, seq, encode(name, *values))


class AvrBench:
    """A chip that was just powered on, unless ``on`` is false."""

    def __init__(self, kind: Board = Board.TACTILES, settings: CoreSettings | None = None, boots: int = 41, on: bool = True):
        self.kind = kind
        self.words: list[tuple[int, int]] = []
        self.converted: list[tuple[int, int]] = []
        self.resets: list[int] = []
        self.senses: dict[int, int] = {0: FIVE_VOLTS} if kind == Board.TACTILES else {5: 512}
        self.heard: list[Heard] = []
        self._sent = bytearray()
        self._deframer = Deframer()
        self.line_free = 0
        self.seq = 0
        self.chip = Lockstep(kind, toolchain.image(kind.name.lower()), self)
        if settings:
            image = eeprom(settings, boots)
            self.chip.eeprom[: len(image)] = image
        else:
            self.chip.eeprom[14:18] = boots.to_bytes(4, "little")
        if on:
            self.reset(Cause.POWER_ON)

    # Around the chip.

    def outputs(self, word: int, cycle: int) -> None:
        self.words.append((cycle, word))

    def convert(self, sense: int, cycle: int) -> int:
        self.converted.append((cycle, sense))
        return self.senses.get(sense, 0)

    def watchdog(self, cycle: int) -> None:
        self.resets.append(cycle)

    def transmit(self, byte: int, ends: int) -> None:
        self._sent.append(byte)
        for f in self._deframer.feed(bytes([byte])):
            name = BY_TYPE[f.type].name
            begun = ends - BYTE_CYCLES * len(self._sent)
            self.heard.append(Heard(begun, ends, name, f.seq, decode(name, f.payload)))
        if byte == 0:
            self._sent.clear()

    # What a test does.

    def reset(self, cause: Cause) -> None:
        """Reset, and the time that starting takes."""
        self._sent.clear()
        self.chip.reset(cause)
        self.run(5 * MS)

    def run(self, cycles: int) -> None:
        self.chip.run(self.chip.cycle + cycles)

    def send(self, data: bytes, at: int | None = None) -> int:
        """Bytes on the line one behind the other, from ``at`` or as soon as it is free; when the last one is in."""
        begins = max(at or self.chip.cycle + BYTE_CYCLES, self.line_free)
        ends = [begins + BYTE_CYCLES * (k + 1) for k in range(len(data))]
        self.chip.feed(data, ends)
        self.line_free = ends[-1]
        return self.line_free

    def command(self, name: str, *values: Any) -> int:
        """Put a command on the line; its number."""
        self.seq = self.seq % 255 + 1
        self.send(frame(name, self.seq, *values))
        return self.seq

    def ask(self, name: str, *values: Any) -> Any:
        """A command's reply, or the answer to a question."""
        known = len(self.heard)
        seq = 0
        if name in ("identify", "sync"):
            self.send(frame(name, 0, *values))
        else:
            seq = self.command(name, *values)
        for _ in range(200):
            self.run(MS // 10)
            for heard in self.heard[known:]:
                if heard.seq == seq and heard.name in ("reply", "identity", "sync_reply"):
                    return heard.message
        raise AssertionError(f"no answer to {name}")

    def armed(self) -> AvrBench:
        boot_id = self.ask("identify").boot_id
        assert self.ask("arm", boot_id).status == Status.OK
        return self

    def keep_alive(self, ms: float) -> None:
        """Let time pass, with a keepalive each 30 ms."""
        end = self.chip.cycle + round(ms * MS)
        while self.chip.cycle < end:
            self.send(frame("keepalive", 0))
            self.chip.run(min(self.chip.cycle + 30 * MS, end))

    # Ticks and pins.

    def tick(self, cycle: int | None = None) -> int:
        """The firmware's count, not wrapped."""
        at = self.chip.cycle if cycle is None else cycle
        return START_TICK + (at - self.chip.clock_begun) // CYCLES_PER_TICK

    def cycle_of(self, tick: int) -> int:
        """The cycle at which the count, not wrapped, becomes ``tick``."""
        return (tick - START_TICK) * CYCLES_PER_TICK + self.chip.clock_begun

    def edges(self, since: int = 0) -> list[Edge]:
        """What the coils' pins did from a cycle on."""
        found, before = [], 0
        for cycle, word in self.words:
            changed = (word ^ before) & ~FEED
            if cycle >= since:
                found += [Edge(cycle, c, bool(word >> c & 1)) for c in range(COIL_CHANNELS) if changed >> c & 1]
            before = word
        return found

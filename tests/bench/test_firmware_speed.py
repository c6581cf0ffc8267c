"""How fast the simulated chip is, and how exact the firmware on it: seconds of board a second of CPU, edges in microseconds."""

from __future__ import annotations

import random
import time
from typing import Any

import numpy as np
import pytest
import serial
from ledger import Ledger, compiled, cpu_s, side_by_side

from firmware_models.cores.toolchain import image, lockstep_library
from haptics.link.framing import Deframer, encode_frame
from haptics.link.messages import BY_NAME, BY_TYPE, COIL_CHANNELS, decode, encode

pytestmark = pytest.mark.bench

MS = 1_000_000
SPRING_STEPS = 16_000_000
"""A compiled loop beside the chip takes as many steps in a second as the chip has cycles."""


class RawHost:
    """Frames to a board on the virtual clock."""

    def __init__(self, url: str):
        if "firmware_models" not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append("firmware_models")
        self.port: Any = serial.serial_for_url(url, baudrate=500_000, timeout=0)
        self._deframer = Deframer()
        self.port.advance(3 * MS)

    def send(self, name: str, seq: int, *values: Any) -> None:
        self.port.write(encode_frame(BY_NAME[name].type, seq, encode(name, *values)))

    def pass_ms(self, ms: float) -> list[Any]:
        self.port.advance(self.port.now_ns + round(ms * MS))
        frames = self._deframer.feed(self.port.read(1 << 16))
        return [decode(BY_TYPE[f.type].name, f.payload) for f in frames if BY_TYPE[f.type].name in ("identity", "reply")]

    def arm(self) -> None:
        self.send("identify", 0)
        (identity,) = self.pass_ms(5)
        self.send("arm", 1, identity.boot_id)
        assert self.pass_ms(20)[0].status == 0

    def idle(self, seconds: float) -> None:
        for _ in range(round(seconds * 40)):
            self.send("keepalive", 0)
            self.pass_ms(25)


@pytest.fixture(scope="module", autouse=True)
def built() -> None:
    lockstep_library()
    for board in ("tactiles", "brake"):
        image(board)


def chip(board: str) -> RawHost:
    return RawHost(f"sim://{board}?core=avr&clock=virtual")


@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_what_an_armed_board_on_the_chip_costs(bench: Ledger, board: str) -> None:
    host, spring = chip(board), compiled()
    host.arm()
    armed_s, _, ratio = side_by_side(lambda: host.idle(2), lambda: spring(2 * SPRING_STEPS), 5)
    bench.note(f"{board} on the chip, armed and idle, simulated seconds a second of CPU", f"{2 / armed_s:.1f}")
    what = f"{board} on the chip, armed and idle, over {SPRING_STEPS / 1e6:g} million steps of a compiled loop a second"
    bench.ratio(f"chip.{board}", what, ratio, at_most=1)


def test_a_hundred_pulses_a_second_on_the_chip(bench: Ledger) -> None:
    host, idle = chip("tactiles"), chip("tactiles")
    host.arm()
    idle.arm()
    rng = random.Random(1)
    ticks = host.port.board.ticks
    starts: list[tuple[int, int]] = []
    words: list[tuple[int, int]] = []
    outputs = host.port.board.pins.outputs
    host.port.board.pins.outputs = lambda word, time_ns: (words.append((time_ns, word)), outputs(word, time_ns))
    begun = time.process_time()
    for k in range(400):
        start, channel = ticks.count(host.port.now_ns) + rng.randint(8000, 12_000), k % COIL_CHANNELS
        host.send("pulse", k % 250 + 2, start % 2**32, 1 << channel, 0, [rng.randint(20, 120)] * COIL_CHANNELS)
        starts.append((start, channel))
        assert [reply.status for reply in host.pass_ms(10)] == [0]
    busy_s, idle_s = time.process_time() - begun, cpu_s(lambda: idle.idle(4))
    before, on = 0, []
    for time_ns, word in words:
        on += [(time_ns, c) for c in range(COIL_CHANNELS) if (word & ~before) >> c & 1]
        before = word
    starts = starts[: len(on)]
    late_us = np.array(
        [(at - ticks.time_ns(start)) / 1e3 for (at, _), (start, _) in zip(sorted(on), sorted(starts), strict=True)]
    )
    p50, p99 = np.percentile(late_us, [50, 99])
    bench.note("coil board on the chip, telemetry and 100 pulses/s, simulated seconds a second of CPU", f"{4 / busy_s:.1f}")
    bench.note("its edges, late by: half of them, 99 %, the latest (us)", f"{p50:.1f} {p99:.1f} {late_us.max():.1f}")
    bench.ratio("chip.pulses", "coil board on the chip, 100 pulses/s, over armed and idle", busy_s / idle_s, at_most=4)
    assert late_us.min() >= 0
    assert late_us.max() < 10

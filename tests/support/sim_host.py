"""A host that speaks raw frames to a simulated board in virtual time, and steps from event to event."""

from __future__ import annotations

import ctypes.util
import shutil
from typing import Any, NamedTuple

import pytest
import serial

from haptics.link.framing import Deframer, encode_frame
from haptics.link.messages import BY_NAME, BY_TYPE, State, Status, decode, encode

MS = 1_000_000
TICKS_PER_MS = 2000
NEEDS_CC = pytest.mark.skipif(
    shutil.which("cc") is None or shutil.which("make") is None, reason="no cc or make here: the C core cannot be built"
)
NEEDS_AVR = pytest.mark.skipif(
    shutil.which("avr-gcc") is None or ctypes.util.find_library("simavr") is None,
    reason="no avr-gcc or libsimavr here: the image cannot be built and run",
)


class Heard(NamedTuple):
    """A frame from the board, and when its last bit came in."""

    time_ns: int
    name: str
    seq: int
    message: Any


class Host:
    def __init__(self, url: str, baudrate: int = 500_000):
        if "firmware_models" not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append("firmware_models")
        self.port: Any = serial.serial_for_url(url, baudrate=baudrate, timeout=0)
        self.seq = 0
        self.heard: list[Heard] = []
        self.raw = bytearray()
        self._deframer = Deframer()

    @property
    def now_ns(self) -> int:
        return self.port.now_ns

    def listen(self, to_ns: int) -> None:
        """Let virtual time pass up to ``to_ns``, reading at each event as a host's loop does."""
        while True:
            event_ns = self.port.next_event()
            at_ns = to_ns if event_ns is None else min(event_ns, to_ns)
            self.port.advance(at_ns)
            data = self.port.read(4096)
            self.raw += data
            for frame in self._deframer.feed(data):
                name = BY_TYPE[frame.type].name
                self.heard.append(Heard(at_ns, name, frame.seq, decode(name, frame.payload)))
            if at_ns >= to_ns:
                return

    def run(self, ms: float) -> None:
        self.listen(self.now_ns + round(ms * MS))

    def live(self, ms: float) -> None:
        """Run, keeping the board's dead-man fed."""
        end_ns = self.now_ns + round(ms * MS)
        while self.now_ns < end_ns:
            self.send("keepalive")
            self.listen(min(self.now_ns + 30 * MS, end_ns))

    def send(self, name: str, *values: Any, seq: int | None = None) -> int:
        if seq is None:
            seq, self.seq = self.seq, (self.seq + 1) % 256
        self.port.write(encode_frame(BY_NAME[name].type, seq, encode(name, *values)))
        return seq

    def ask(self, name: str, *values: Any, seq: int | None = None) -> Any:
        """Send, and the message that answers; fails if none comes within 20 ms."""
        seq = self.send(name, *values, seq=seq)
        before, end_ns = len(self.heard), self.now_ns + 20 * MS
        while self.now_ns < end_ns:
            self.listen(min(self.port.next_event() or end_ns, end_ns))
            for heard in self.heard[before:]:
                if heard.seq == seq and heard.name in ("identity", "sync_reply", "reply"):
                    return heard.message
        raise AssertionError(f"no answer to {name}")

    def status(self, name: str, *values: Any, seq: int | None = None) -> Status:
        return Status(self.ask(name, *values, seq=seq).status)

    def tick_in(self, ms: float) -> int:
        """The board's tick about ``ms`` from now (0.3 ms early at most)."""
        return (self.ask("sync", 1).sent + round(ms * TICKS_PER_MS)) % 2**32

    def arm(self) -> None:
        assert self.status("arm", self.ask("identify").boot_id) == Status.OK
        self.live(12)  # a brake controller tests itself
        assert self.port.truth()["state"] == State.ARMED

    def last(self, name: str) -> Any:
        return next(heard.message for heard in reversed(self.heard) if heard.name == name)

    def all(self, name: str) -> list[Heard]:
        return [heard for heard in self.heard if heard.name == name]

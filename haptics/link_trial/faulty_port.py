"""A port with faults played on it: wraps any open port, a real one too, so that a program can be tried on a bad line.

Late bytes are moved when the port is used next, as every runner does each few milliseconds. What is read comes frame by frame.
"""

from __future__ import annotations

import errno
import time
from collections import deque
from collections.abc import Callable

from serial import SerialException, SerialTimeoutException

from haptics.errors import InputError
from haptics.link.framing import DELIMITER
from haptics.link.line_faults import FrameCutter, FrameFaults, LineFaults
from haptics.link.ports import BytePort, read_waiting
from haptics.time import seconds_to_ns


class _Direction:
    """One direction: frames in, and bytes out when their time has come, in order."""

    def __init__(self, faults: FrameFaults):
        self.faults = faults
        self._coming: deque[tuple[int, bytes]] = deque()

    def put(self, frame: bytes, now_ns: int) -> None:
        """A frame sets out."""
        for delay_ns, data in self.faults.play(frame):
            self.add(data, now_ns + delay_ns)

    def add(self, data: bytes, due_ns: int) -> None:
        """Bytes that come at ``due_ns``, or behind what comes later than that."""
        self._coming.append((max(due_ns, self._coming[-1][0] if self._coming else due_ns), data))

    def take(self, now_ns: int) -> bytes:
        """What has come."""
        parts: list[bytes] = []
        while self._coming and self._coming[0][0] <= now_ns:
            parts.append(self._coming.popleft()[1])
        return b"".join(parts)


class FaultyPort:
    """A pyserial-like port around another.

    :param port: an open port; closed with this one.
    :param faults: what goes wrong, in either direction.
    :param seed: of the random numbers.
    :param clock_ns: the time now (ns); the times of ``faults`` count from when this port is made.
    :raises InputError: ``dtr_reset``: whether opening resets a board is up to the board.
    """

    def __init__(self, port: BytePort, faults: LineFaults, seed: int, clock_ns: Callable[[], int] = time.monotonic_ns):
        if faults.dtr_reset:
            raise InputError(
                "faults: dtr_reset = 1 acts when a port is opened, and this one is open; put it into the faults of a sim:// URL"
            )
        self._port, self._clock_ns = port, clock_ns
        self._cutter = FrameCutter()
        self._out, self._in = _Direction(FrameFaults(faults, seed, "out")), _Direction(FrameFaults(faults, seed, "in"))
        self._arrived = bytearray()
        opened_ns = clock_ns()
        self._unplugged_ns = opened_ns + seconds_to_ns(faults.unplug_s) if faults.unplug_s >= 0.0 else None
        self._stalled_ns = opened_ns + seconds_to_ns(faults.stall_s) if faults.stall_s >= 0.0 else None
        if faults.garbage:
            self._in.add(self._in.faults.noise(faults.garbage), opened_ns)

    @property
    def is_open(self) -> bool:
        """Whether the port within is open."""
        return self._port.is_open

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        self._check_plugged()
        came = read_waiting(self._port)
        if came:
            self._receive(came)
        self._move()
        return len(self._arrived)

    def read(self, size: int = 1, /) -> bytes:
        """Bytes that have arrived; waits at most as long as the port within does.

        :param size: how many at most.
        :return: 0 to ``size`` bytes.
        :raises SerialException: the faults have unplugged it.
        """
        if self.in_waiting < size:
            self._receive(self._port.read(1))
            self._move()
        data = bytes(self._arrived[:size])
        del self._arrived[:size]
        return data

    def write(self, data: bytes, /) -> int:
        """Hand bytes to the line.

        :param data: the bytes.
        :return: how many were taken: all of them.
        :raises SerialException: the faults have unplugged it, the first time in the middle of ``data``.
        :raises SerialTimeoutException: the faults let the peer take no more bytes.
        """
        now_ns = self._clock_ns()
        if self._unplugged_ns is not None and now_ns >= self._unplugged_ns and self._port.is_open:
            self._port.write(data[: len(data) // 2])
            self._port.close()
        self._check_plugged()
        if self._stalled_ns is not None and now_ns >= self._stalled_ns:
            raise SerialTimeoutException("Write timeout")
        *whole, rest = data.split(DELIMITER)
        for frame in [piece + DELIMITER for piece in whole] + [rest] * bool(rest):
            self._out.put(frame, now_ns)
        self._move()
        return len(data)

    def close(self) -> None:
        """Close the port within."""
        self._port.close()

    def _check_plugged(self) -> None:
        if self._unplugged_ns is not None and self._clock_ns() >= self._unplugged_ns:
            raise SerialException(errno.EIO, "unplugged by its faults (unplug_s)")

    def _receive(self, data: bytes) -> None:
        for frame in self._cutter.cut(data):
            self._in.put(frame, self._clock_ns())

    def _move(self) -> None:
        """Pass on what is due, in both directions."""
        now_ns = self._clock_ns()
        going = self._out.take(now_ns)
        if going:
            self._port.write(going)
        self._arrived += self._in.take(now_ns)

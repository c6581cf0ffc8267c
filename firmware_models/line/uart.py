"""One direction of a serial line: ten bits a byte at the configured baud, first in, first out, exact to the nanosecond.

A burst is kept as its start and its bytes, cut behind each frame delimiter: readers ask for what has arrived, and the
simulation wakes up once a frame instead of once a byte.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from haptics.link.framing import BITS_PER_BYTE, DELIMITER

NEVER_NS = 1 << 62
BAUD_TOLERANCE = 0.03  # a receiver that samples mid-bit still reads the tenth bit right
_BITS_NS = BITS_PER_BYTE * 1_000_000_000


@dataclass(slots=True)
class _Chunk:
    """Bytes ``first`` onwards of a burst which began at ``origin_ns``; ``taken`` of them are already read."""

    origin_ns: int
    first: int
    baud: int
    data: bytes
    end_ns: int
    taken: int = 0

    def arrived(self, now_ns: int) -> int:
        """Bytes of this chunk whose stop bit has passed, those taken included."""
        if now_ns >= self.end_ns:
            return len(self.data)
        # byte k of the burst (from 1) is there at origin + k * _BITS_NS // baud
        sent = ((now_ns - self.origin_ns + 1) * self.baud - 1) // _BITS_NS - self.first
        return min(max(sent, self.taken), len(self.data))

    def arrival_ns(self, count: int) -> int:
        """Time at which ``count`` bytes of this chunk are there."""
        return self.origin_ns + (self.first + count) * _BITS_NS // self.baud


class Line:
    """Bytes on their way from one end to the other.

    :param baud: bits a second of the sender.
    :param capacity: bytes that may wait unread; what comes on top is lost and counted in ``lost``, as in any driver.
    """

    def __init__(self, baud: int, capacity: int = 1 << 16):
        self.baud = baud
        self.garbled = False  # sender and receiver disagree about the baud
        self.busy_until_ns = -NEVER_NS
        self.lost = 0
        self._capacity = capacity
        self._pending = 0
        self._chunks: deque[_Chunk] = deque()

    def duration_ns(self, count: int) -> int:
        """Time that ``count`` bytes take.

        :param count: bytes.
        :return: ns.
        """
        return count * _BITS_NS // self.baud

    def send(self, data: bytes, earliest_ns: int) -> int:
        """Queue ``data`` behind what is under way.

        :param data: bytes to send.
        :param earliest_ns: world time before which they are not ready, ns.
        :return: world time at which the first bit goes out, ns.
        """
        start_ns = max(earliest_ns, self.busy_until_ns)
        self.busy_until_ns = start_ns + self.duration_ns(len(data))
        if self._pending + len(data) > self._capacity:
            self.lost += len(data)
            return start_ns
        if self.garbled:
            data = _misread(data)
        self._lay(data, start_ns)
        return start_ns

    def _lay(self, data: bytes, start_ns: int) -> None:
        """A burst whose first bit goes out at ``start_ns``, cut behind each delimiter."""
        self._pending += len(data)
        if data.find(DELIMITER, 0, -1) < 0:  # one piece, as nearly always
            if data:
                self._chunks.append(_Chunk(start_ns, 0, self.baud, data, start_ns + len(data) * _BITS_NS // self.baud))
            return
        first = 0
        while first < len(data):
            cut = data.find(DELIMITER, first) + 1 or len(data)
            end_ns = start_ns + cut * _BITS_NS // self.baud
            self._chunks.append(_Chunk(start_ns, first, self.baud, data[first:cut], end_ns))
            first = cut

    def first_end_ns(self) -> int:
        """When the first chunk is complete.

        :return: world time, ns; ``NEVER_NS`` if none is under way.
        """
        return self._chunks[0].end_ns if self._chunks else NEVER_NS

    def next_after(self, now_ns: int) -> int:
        """When the first chunk that is not complete at ``now_ns`` will be.

        :param now_ns: world time, ns.
        :return: world time, ns; ``NEVER_NS`` if none is under way.
        """
        for chunk in self._chunks:
            if chunk.end_ns > now_ns:
                return chunk.end_ns
        return NEVER_NS

    def complete_ns(self, count: int) -> int:
        """When ``count`` unread bytes will have arrived.

        :param count: bytes, from 1.
        :return: world time, ns; ``NEVER_NS`` if fewer are under way.
        """
        for chunk in self._chunks:
            here = len(chunk.data) - chunk.taken
            if count <= here:
                return chunk.arrival_ns(chunk.taken + count)
            count -= here
        return NEVER_NS

    def waiting(self, now_ns: int) -> int:
        """Bytes arrived and not yet read.

        :param now_ns: world time, ns.
        :return: how many.
        """
        total = 0
        for chunk in self._chunks:
            if chunk.end_ns > now_ns:
                return total + chunk.arrived(now_ns) - chunk.taken
            total += len(chunk.data) - chunk.taken
        return total

    def take(self, size: int, now_ns: int) -> bytes:
        """Read what has arrived.

        :param size: how many bytes at most.
        :param now_ns: world time, ns.
        :return: the bytes, oldest first.
        """
        parts: list[bytes] = []
        chunks = self._chunks
        while chunks:
            chunk = chunks[0]
            left = len(chunk.data) - chunk.taken
            if chunk.end_ns <= now_ns and left <= size:
                parts.append(chunk.data[chunk.taken :] if chunk.taken else chunk.data)
                size -= left
                self._pending -= left
                chunks.popleft()
                continue
            upto = min(chunk.arrived(now_ns), chunk.taken + size)
            parts.append(chunk.data[chunk.taken : upto])
            self._pending -= upto - chunk.taken
            chunk.taken = upto
            break
        return b"".join(parts)

    def take_stamped(self, now_ns: int) -> tuple[bytes, list[int]]:
        """All that has arrived; for a receiver that is a UART itself.

        :param now_ns: world time, ns.
        :return: the bytes, and of each the world time at which its stop bit ended, ns.
        """
        parts: list[bytes] = []
        times: list[int] = []
        while self._chunks:
            chunk = self._chunks[0]
            upto = chunk.arrived(now_ns)
            parts.append(chunk.data[chunk.taken : upto])
            times += [chunk.arrival_ns(count) for count in range(chunk.taken + 1, upto + 1)]
            self._pending -= upto - chunk.taken
            chunk.taken = upto
            if upto < len(chunk.data):
                break
            self._chunks.popleft()
        return b"".join(parts), times

    def take_chunk(self) -> bytes:
        """The whole first chunk; for a receiver that waited for ``first_end_ns``.

        :return: its bytes that are not read yet.
        """
        chunk = self._chunks.popleft()
        self._pending -= len(chunk.data) - chunk.taken
        return chunk.data[chunk.taken :]

    def in_transit(self, now_ns: int) -> int:
        """Bytes that have not arrived yet.

        :param now_ns: world time, ns.
        :return: how many.
        """
        return self._pending - self.waiting(now_ns)

    def drop_arrived(self, now_ns: int) -> None:
        """Forget what has arrived and was not read.

        :param now_ns: world time, ns.
        """
        self.take(self._pending, now_ns)

    def drop_unsent(self, now_ns: int) -> None:
        """Forget what has not left yet; a byte whose start bit is out goes through.

        :param now_ns: world time, ns.
        """
        kept: deque[_Chunk] = deque()
        for chunk in self._chunks:
            begun = min(chunk.arrived(now_ns - 1 + self.duration_ns(1)), len(chunk.data))
            if begun > chunk.taken:
                kept.append(replace(chunk, data=chunk.data[:begun], end_ns=chunk.arrival_ns(begun)))
        self._chunks = kept
        self._pending = sum(len(chunk.data) - chunk.taken for chunk in kept)
        self.busy_until_ns = kept[-1].end_ns if kept else now_ns


def bauds_agree(a: int, b: int) -> bool:
    """Whether a receiver at ``b`` reads a sender at ``a``.

    :param a: bits a second of the sender.
    :param b: bits a second of the receiver.
    :return: true if they differ by at most 3 %.
    """
    return abs(a - b) <= BAUD_TOLERANCE * b


def _misread(data: bytes) -> bytes:
    """What a receiver at another baud makes of ``data``: as many bytes here, and none of them right by design."""
    return bytes((byte * 197 + 91) & 0xFF for byte in data)

"""One direction of a serial line that loses, changes, repeats and delays frames, in virtual time (see ``LineFaults``)."""

from __future__ import annotations

from firmware_models.line.uart import NEVER_NS, Line
from haptics.link.framing import DELIMITER
from haptics.link.line_faults import FrameFaults


class FaultyLine(Line):
    """A ``Line`` whose faults lie beyond the sender: it sends in its own time, and never learns what became of it.

    ``from_ns``, ``until_ns``: bytes that would arrive before, or after, are lost.

    :param baud: bits a second of the sender.
    :param faults: what happens to each frame; a frame is what is sent at once up to a delimiter, or to the end.
    """

    def __init__(self, baud: int, faults: FrameFaults):
        super().__init__(baud)
        self._faults = faults
        self.from_ns, self.until_ns = -NEVER_NS, NEVER_NS

    def _lay(self, data: bytes, start_ns: int) -> None:
        first = 0
        while first < len(data):
            cut = data.find(DELIMITER, first) + 1 or len(data)
            sent_ns = start_ns + self.duration_ns(first)
            for delay_ns, piece in self._faults.play(data[first:cut]):
                self._arrive(piece, sent_ns + delay_ns)
            first = cut

    def make_noise(self, count: int, now_ns: int) -> None:
        """Random bytes out of the sender, as a pin that floats makes them.

        :param count: how many, not below 0.
        :param now_ns: world time of the first bit, ns; later if the sender is busy.
        """
        self._arrive(self._faults.noise(count), max(now_ns, self.busy_until_ns))

    def _arrive(self, data: bytes, start_ns: int) -> None:
        """Lay bytes behind all that is on its way, less those that come too early or too late."""
        if self._chunks:
            start_ns = max(start_ns, self._chunks[-1].end_ns)
        early = max(0, -(-(self.from_ns - start_ns) // self.duration_ns(1)))
        kept = max(0, (self.until_ns - start_ns) // self.duration_ns(1))
        if early < min(kept, len(data)):
            super()._lay(data[early:kept], start_ns + self.duration_ns(early))

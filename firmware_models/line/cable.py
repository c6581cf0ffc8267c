"""A device at the end of its two serial lines: the unit that lives in a world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from firmware_models.line.faulty_line import FaultyLine
from firmware_models.line.uart import NEVER_NS, Line, bauds_agree
from haptics.link.line_faults import FrameFaults, LineFaults
from haptics.time import NS_PER_S, seconds_to_ns

BOOT_LOADER_NS = NS_PER_S
"""A board of the Arduino kind is with its boot loader for so long after a reset."""


def make_line(options: Mapping[str, Any], direction: str) -> Line:
    """One direction of the line, with the faults that the options name.

    :param options: ``baud``, and with ``faults`` also ``seed``.
    :param direction: "in" to the host or "out" to the board; each has draws of its own.
    :return: the line.
    """
    faults: LineFaults | None = options.get("faults")
    if faults is None:
        return Line(options["baud"])
    return FaultyLine(options["baud"], FrameFaults(faults, options["seed"], direction))


class Cable:
    """Host end of a device. ``attached``: whether a host listens; without one the device's bytes are lost.

    :param board: a ``FirmwareModel`` or an ``Instrument``; fed from ``to_board``, sends into ``to_host``. One that is
        ``bytewise`` has a UART of its own, and is handed each byte with its time.
    :param to_host: the line into which the board sends.
    :param options: what the device was made with.
    :param announce: each frame's arrival at the host is an event of the world, as a host that acts on frames needs it; a host
        that looks at an instrument's lines now and then does not.
    """

    def __init__(self, board: Any, to_host: Line, options: dict[str, Any], announce: bool = True):
        self.board = board
        self._bytewise: bool = getattr(board, "bytewise", False)
        self._announce = announce
        self.options = options
        self.to_host = to_host
        self.to_board = make_line(options, "out")
        self.attached = False
        self._babbled = False
        self.unplugged_ns = self.stalled_ns = NEVER_NS

    def attach(self, now_ns: int) -> None:
        """A host listens from now on; what its opening of the port brings about, if the line has such faults.

        :param now_ns: world time, ns.
        """
        self.attached = True
        faults: LineFaults | None = self.options.get("faults")
        if faults is None or not isinstance(self.to_board, FaultyLine) or not isinstance(self.to_host, FaultyLine):
            return
        self.unplugged_ns = _after(now_ns, faults.unplug_s)
        self.stalled_ns = _after(now_ns, faults.stall_s)
        self.to_host.until_ns, self.to_board.until_ns = self.unplugged_ns, min(self.unplugged_ns, self.stalled_ns)
        if faults.dtr_reset:
            self.advance(now_ns)
            self.board.reset()
            self.to_board.from_ns = now_ns + BOOT_LOADER_NS
        if faults.dtr_reset or not self._babbled:
            self.to_host.make_noise(faults.garbage, now_ns)
            self._babbled = True

    def set_host_baud(self, baud: int) -> None:
        """The host sends and receives at ``baud`` from now on.

        :param baud: bits a second.
        """
        self.to_board.baud = baud
        self.to_board.garbled = self.to_host.garbled = not bauds_agree(baud, self.to_host.baud)

    def next_event(self) -> int:
        """Next whole chunk at either end, or the device's own next event.

        :return: world time, ns; ``NEVER_NS`` if nothing will happen.
        """
        heard_ns = self.to_host.next_after(self.board.now_ns) if self._announce else NEVER_NS
        return min(self.to_board.first_end_ns(), self.board.next_event(), heard_ns)

    def advance(self, to_ns: int) -> None:
        """Carry lines and device to ``to_ns``, each frame handled when its last bit is in.

        :param to_ns: world time, ns; not before the device's own.
        """
        if self._bytewise:
            self.board.feed(*self.to_board.take_stamped(to_ns))
        while (arrival_ns := self.to_board.first_end_ns()) <= to_ns:
            self.board.advance(arrival_ns)
            self.board.handle(self.to_board.take_chunk())
        self.board.advance(to_ns)
        if not self.attached:
            self.to_host.drop_arrived(to_ns)


def _after(now_ns: int, wait_s: float) -> int:
    """When something that begins ``wait_s`` from now does; below 0: never."""
    return now_ns + seconds_to_ns(wait_s) if wait_s >= 0.0 else NEVER_NS

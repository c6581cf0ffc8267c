"""A device at the end of its two serial lines: the unit that lives in a world."""

from __future__ import annotations

from typing import Any

from firmware_models.uart import NEVER_NS, Line, bauds_agree


class Cable:
    """Host end of a device. ``attached`` says whether a host listens; without one the device's bytes are lost.

    :param options: what the device was made with.
    :param board: a ``FirmwareModel`` or an ``Instrument``; fed from ``to_board``, sends into ``to_host``.
    :param announce: each frame's arrival at the host is an event of the world, as a host that acts on frames needs it; a host
        that looks at an instrument's lines now and then does not.
    """

    def __init__(self, board: Any, to_host: Line, options: dict[str, Any], announce: bool = True):
        self.board = board
        self._announce = announce
        self.options = options
        self.to_host = to_host
        self.to_board = Line(to_host.baud)
        self.attached = False

    def set_host_baud(self, baud: int) -> None:
        """The host talks and listens at ``baud`` from now on."""
        self.to_board.baud = baud
        self.to_board.garbled = self.to_host.garbled = not bauds_agree(baud, self.to_host.baud)

    def next_event(self) -> int:
        """Next whole chunk at either end, or the device's own next event."""
        heard_ns = self.to_host.next_after(self.board.now_ns) if self._announce else NEVER_NS
        return min(self.to_board.first_end_ns(), self.board.next_event(), heard_ns)

    def advance(self, to_ns: int) -> None:
        """Carry lines and device to ``to_ns``, each frame handled when its last bit is in."""
        while (arrival_ns := self.to_board.first_end_ns()) <= to_ns:
            self.board.advance(arrival_ns)
            self.board.handle(self.to_board.take_chunk())
        self.board.advance(to_ns)
        if not self.attached:
            self.to_host.drop_arrived(to_ns)

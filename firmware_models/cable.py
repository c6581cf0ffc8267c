"""A board at the end of its two serial lines: the unit that lives in a world."""

from __future__ import annotations

from typing import Any

from firmware_models.board import FirmwareModel
from firmware_models.uart import Line, bauds_agree


class Cable:
    """Host end of a board. ``attached`` says whether a host listens; without one the board's bytes are lost.

    :param options: what the board was made with.
    :param board: fed from ``to_board``; sends into ``to_host``.
    """

    def __init__(self, board: FirmwareModel, to_host: Line, options: dict[str, Any]):
        self.board = board
        self.options = options
        self.to_host = to_host
        self.to_board = Line(to_host.baud)
        self.attached = False

    def set_host_baud(self, baud: int) -> None:
        """The host talks and listens at ``baud`` from now on."""
        self.to_board.baud = baud
        self.to_board.garbled = self.to_host.garbled = not bauds_agree(baud, self.to_host.baud)

    def next_event(self) -> int:
        """Next whole chunk at either end, or the board's own next event."""
        return min(self.to_board.first_end_ns(), self.board.next_event(), self.to_host.next_after(self.board.now_ns))

    def advance(self, to_ns: int) -> None:
        """Carry lines and board to ``to_ns``, each frame handled when its last bit is in."""
        while (arrival_ns := self.to_board.first_end_ns()) <= to_ns:
            self.board.advance(arrival_ns)
            self.board.handle(self.to_board.take_chunk())
        self.board.advance(to_ns)
        if not self.attached:
            self.to_host.drop_arrived(to_ns)

"""What a session knows of its board, and what it does in trouble: suspect, fail, be lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Any

from haptics.errors import LinkError, LinkLost, NotABoard, WrongFirmware
from haptics.link import events as happened, handshake
from haptics.link.clock import ClockFit
from haptics.link.commands import NEVER_NS, CommandWindow, Pending
from haptics.link.framing import Deframer
from haptics.link.messages import Board
from haptics.link.settings import LinkCounters, LinkSettings
from haptics.link.sync import ClockExchanges

Tap = Callable[[int, str, bytes], None]
"""Called with host time (ns), "in" or "out", and bytes."""


class Phase(Enum):
    """How far a session has come."""

    IDLE = "idle"
    IDENTIFYING = "identifying"
    SYNCING = "syncing"
    CONFIGURING = "configuring"
    READY = "ready"
    FAILED = "failed"
    LOST = "lost"


OVER = (Phase.FAILED, Phase.LOST)
"""Phases in which nothing more happens until the next start."""


class SessionState:
    """Phase, board, clock, commands and events of one session; what ``Receiving`` and ``LinkSession`` build on.

    :param board: the board expected, or None to take whichever answers.
    :param port_name: how errors name the port.
    :param settings: times and counts.
    :param baud: of the line, 0 if unknown.
    """

    EVENTS_KEPT = 4096

    def __init__(self, board: Board | None, port_name: str, settings: LinkSettings, baud: int):
        self.expected, self.port_name, self.settings = board, port_name, settings
        self._baud = baud
        self._events: deque[happened.Event] = deque()
        self._now_ns = 0
        self._deadline_ns = NEVER_NS
        self._reset()

    def _reset(self) -> None:
        s = self.settings
        self.phase = Phase.IDLE
        self.error: LinkError | None = None
        self.identity: Any = None
        self.armed = False
        self.counters = LinkCounters()
        self.seen = b""  # the first bytes that came, for a diagnosis
        self._out: list[bytes] = []
        self._deframer = Deframer()
        self._window = CommandWindow(self.port_name, s.in_flight, s.reply_timeout_ns, s.tries)
        self._exchanges = ClockExchanges(s, self.counters, self._baud)
        self._inquiry = handshake.Inquiry(s.identify_every_ns, s.identify_tries)
        self._last_sent_ns = 0
        self._armed_ticks = 0
        self._configuring: Pending | None = None
        self._stopping: Pending | None = None
        self._stopped_first = False
        self._unlike = 0  # identities since the board took its limits that did not show them

    @property
    def ready(self) -> bool:
        """Commands are taken."""
        return self.phase is Phase.READY

    @property
    def board(self) -> Board | None:
        """The board that answered, or the one expected."""
        return Board(self.identity.board) if self.identity is not None else self.expected

    @property
    def clock(self) -> ClockFit | None:
        """The board's clock, or None before it was measured."""
        return self._exchanges.model.fit

    def events(self) -> list[happened.Event]:
        """What happened since the last call.

        :return: in the order they happened, each once; the oldest are dropped beyond 4096.
        """
        taken = list(self._events)
        self._events.clear()
        return taken

    def lost(self, error: LinkError, now_ns: int) -> None:
        """The port went away: every open command fails with that reason.

        :param error: why.
        :param now_ns: host time now (ns).
        """
        if self.phase is Phase.LOST:
            return
        self._end(Phase.LOST, error)
        self._window.fail_all(type(error) if type(error) in (LinkLost, NotABoard) else LinkLost, error.seen)
        self._tell(happened.Lost(now_ns, error))

    def _emit(self, frame: bytes) -> None:
        self._out.append(frame)
        self._last_sent_ns = self._now_ns

    def _tell(self, event: happened.Event) -> None:
        if len(self._events) >= self.EVENTS_KEPT:
            self._events.popleft()
            self.counters.events_dropped += 1
        self._events.append(event)

    def _disarmed(self, reason: str, now_ns: int) -> None:
        self.armed = False
        self._tell(happened.Disarmed(now_ns, reason))
        self._suspect(reason, now_ns)

    def _suspect(self, reason: str, now_ns: int) -> None:
        """Ask again who is there; meanwhile commands wait."""
        if self._inquiry.reason is None:
            self.seen = self._deframer.sample = b""
        self._inquiry.begin(reason, now_ns, self.counters)

    def _fail(self, error: LinkError, now_ns: int) -> None:
        self._end(Phase.FAILED, error)
        self._window.fail_all(type(error) if type(error) in (NotABoard, WrongFirmware) else LinkError, error.seen)
        self._tell(happened.Failed(now_ns, error))

    def _end(self, phase: Phase, error: LinkError) -> None:
        self.phase, self.error = phase, error
        self.armed = False
        self._inquiry.end()
        self._configuring = None
        self._out.clear()
        self._exchanges.due_ns = self._deadline_ns = NEVER_NS

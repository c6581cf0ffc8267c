"""Commands on their way: numbered, at most eight open, repeated with the same number until answered or given up.

See "Sequence numbers, retries, duplicates" in ``docs/reference/protocol.md``. No command is sent that is eight or more numbers
past the oldest open one, so that a repetition always meets the board's memory of its last replies.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from haptics.errors import CommandRefused, LinkError, ReplyTimeout
from haptics.link.framing import encode_frame
from haptics.link.messages import BY_NAME, Status
from haptics.time import NS_PER_MS

_NUMBERS = 255
NEVER_NS = 1 << 62


class Pending:
    """A command whose outcome comes later.

    ``done`` turns True once: with a ``status`` (and ``detail``, ``board_time_ns``) if the board answered, or with an ``error``.
    ``board_time_ns`` is the board's time of its answer on the host's clock, None before the clock is known.
    """

    __slots__ = ("board_time_ns", "detail", "done", "error", "name", "payload", "sent", "status")

    def __init__(self, name: str, payload: bytes = b""):
        self.name, self.payload = name, payload
        self.sent = False  # handed to the port at least once
        self.done = False
        self.status: Status | int | None = None
        self.detail: int | None = None
        self.board_time_ns: int | None = None
        self.error: LinkError | None = None

    @property
    def ok(self) -> bool:
        """Done, and the board said ok."""
        return self.status == Status.OK

    def result(self, port: str = "") -> Pending:
        """Itself if the board said ok.

        :raises LinkError: why it failed, or that it is still open.
        :raises CommandRefused: the board answered with another status.
        """
        if self.error is not None:
            raise self.error
        if not self.done:
            raise LinkError(port, "no outcome yet", self.name)
        if not self.ok:
            status = status_name(self.status)
            raise CommandRefused(port, f"answered {status}, detail {self.detail}", self.name, status)
        return self

    def answer(self, status: int, detail: int, board_time_ns: int | None) -> None:
        """Resolve with the board's answer."""
        self.status = _STATUSES.get(status, status)
        self.detail, self.board_time_ns, self.done = detail, board_time_ns, True

    def fail(self, error: LinkError) -> None:
        """Resolve with an error."""
        self.error, self.done = error, True

    def __repr__(self) -> str:
        outcome = self.error or (status_name(self.status) if self.done else "open")
        return f"Pending({self.name}: {outcome})"


_STATUSES = {int(status): status for status in Status}


def status_name(status: int | None) -> str:
    """A status as the protocol page writes it."""
    return _STATUSES[status].name.lower() if status in _STATUSES else f"status {status}"


@dataclass(slots=True)
class _Open:
    """A command that was sent and not answered. ``index`` counts on where its number wraps."""

    pending: Pending
    index: int
    frame: bytes
    tries_allowed: int
    tries: int
    due_ns: int


class CommandWindow:
    """Waiting and open commands.

    :param port: name for error messages.
    :param size: commands open at a time, 1 to 8.
    :param timeout_ns: time from sending to repeating.
    :param tries: times a command is sent before it is given up.

    ``timeout_ns`` may be changed for a line that turns out to be slow.
    """

    def __init__(self, port: str, size: int, timeout_ns: int, tries: int):
        self._port, self._size, self.timeout_ns, self._tries = port, size, timeout_ns, tries
        self._waiting: deque[tuple[Pending, int, int]] = deque()  # with its number of tries, and when it comes too late
        self._open: dict[int, _Open] = {}  # by number, oldest first
        self._alone: Pending | None = None
        self._next_index = 0
        self.retries = 0
        self.given_up = 0
        self.next_due_ns = NEVER_NS

    def __len__(self) -> int:
        return len(self._waiting) + len(self._open)

    @property
    def alone(self) -> Pending | None:
        """The command that must be answered before anything else is sent, if one is under way."""
        if self._alone is not None and self._alone.done:
            self._alone = None
        return self._alone

    def submit(self, pending: Pending, latest_ns: int = NEVER_NS) -> None:
        """Queue a command behind those that wait.

        :param latest_ns: a command that still waits then is not sent, and ends as ``late``: a queue that has once grown
            longer than the line is fast would else make everything late for ever.
        """
        self._waiting.append((pending, self._tries, latest_ns))

    def submit_alone(self, pending: Pending, tries: int, reason: str) -> Pending:
        """Pass every queue: all that waits or is open fails with ``reason`` and is not repeated; what comes later waits.

        Returns the command to watch: the one under way already, if there is one.
        """
        under_way = self.alone
        if under_way is not None:
            later = [waiting for waiting, *_ in self._waiting]
            self._waiting.clear()
            self._fail(later, LinkError, reason)
            return under_way
        self.fail_all(LinkError, reason)
        self._waiting.append((pending, tries, NEVER_NS))
        self._alone = pending
        return pending

    def pump(self, now_ns: int, emit: Callable[[bytes], None], hold: bool = False) -> None:
        """Repeat what is overdue, then send what there is room for; with ``hold``, send nothing but let time-outs run."""
        if now_ns >= self.next_due_ns:
            self._repeat(now_ns, emit, hold)
        while self._waiting and not hold and self._room():
            pending, tries_allowed, latest_ns = self._waiting.popleft()
            if latest_ns < now_ns:
                pending.answer(Status.LATE, 0, None)
            else:
                self._send(pending, tries_allowed, now_ns, emit)

    def _room(self) -> bool:
        if not self._open:
            return True
        oldest = next(iter(self._open.values()))
        return self.alone is None and self._next_index - oldest.index < self._size

    def _send(self, pending: Pending, tries_allowed: int, now_ns: int, emit: Callable[[bytes], None]) -> None:
        number = 1 + self._next_index % _NUMBERS
        frame = encode_frame(BY_NAME[pending.name].type, number, pending.payload)
        due_ns = now_ns + self.timeout_ns
        self._open[number] = _Open(pending, self._next_index, frame, tries_allowed, 1, due_ns)
        self._next_index += 1
        self.next_due_ns = min(self.next_due_ns, due_ns)
        pending.sent = True
        emit(frame)

    def _repeat(self, now_ns: int, emit: Callable[[bytes], None], hold: bool) -> None:
        for number, command in list(self._open.items()):
            if now_ns < command.due_ns:
                continue
            if command.tries >= command.tries_allowed:
                del self._open[number]
                self.given_up += 1
                waited_ms = command.tries * self.timeout_ns / NS_PER_MS
                seen = f"no reply to {command.tries} tries in {waited_ms:g} ms; whether it was carried out is unknown"
                advice = "check cable and power; telemetry shows what the board did"
                command.pending.fail(ReplyTimeout(self._port, seen, command.pending.name, advice))
                continue
            command.tries += 1
            command.due_ns = now_ns + self.timeout_ns
            if not hold:
                self.retries += 1
                emit(command.frame)
        self._replan()

    def repeat_no_more(self) -> None:
        """What is open is not sent again, because the board was made to forget its replies; answers still count."""
        for command in self._open.values():
            command.tries_allowed = command.tries

    def resolve(self, number: int, status: int, detail: int, board_time_ns: int | None) -> Pending | None:
        """The open command with this number, resolved; None if there is none (an answer that came twice, or too late)."""
        command = self._open.pop(number, None)
        if command is None:
            return None
        if command.due_ns <= self.next_due_ns:
            self._replan()
        command.pending.answer(status, detail, board_time_ns)
        return command.pending

    def _replan(self) -> None:
        self.next_due_ns = min((command.due_ns for command in self._open.values()), default=NEVER_NS)

    def fail_all(self, kind: type[LinkError], reason: str) -> None:
        """Fail what waits and what is open; numbers go on counting, so that no late answer meets a new command."""
        failed = [command.pending for command in self._open.values()] + [pending for pending, *_ in self._waiting]
        self._open.clear()
        self._waiting.clear()
        self.next_due_ns = NEVER_NS
        self._fail(failed, kind, reason)

    def _fail(self, failed: list[Pending], kind: type[LinkError], reason: str) -> None:
        for pending in failed:
            unknown = "; whether it was carried out is unknown" if pending.sent else ""
            pending.fail(kind(self._port, reason + unknown, pending.name))

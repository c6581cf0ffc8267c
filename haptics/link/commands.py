"""Commands in flight: numbered, at most eight open, repeated with the same number until answered or given up.

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
    ``board_time_ns`` is the board's time of its answer on the host's clock, None before the clock is known. ``sent`` is True once
    the command was handed to the port, however it ended.

    :param name: the command's name in the message table.
    :param payload: its encoded fields.
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
        """Done, and the board answered ok."""
        return self.status == Status.OK

    def result(self, port: str = "") -> Pending:
        """Itself if the board answered ok.

        :param port: name of the port, for the error of a command that is still open.
        :return: this command.
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
        """Resolve with the board's answer.

        :param status: the number in the reply; one that is not in ``Status`` is kept as a number.
        :param detail: the reply's detail, 0 to 65535; its meaning depends on the status.
        :param board_time_ns: when the board dealt with the command, on the host's clock (ns); None while that clock is unknown.
        """
        self.status = _STATUSES.get(status, status)
        self.detail, self.board_time_ns, self.done = detail, board_time_ns, True

    def fail(self, error: LinkError) -> None:
        """Resolve with an error.

        :param error: what to raise from ``result``.
        """
        self.error, self.done = error, True

    def __repr__(self) -> str:
        outcome = self.error or (status_name(self.status) if self.done else "open")
        return f"Pending({self.name}: {outcome})"


_STATUSES = {int(status): status for status in Status}


def status_name(status: int | None) -> str:
    """A status as the protocol page writes it.

    :param status: the number in a reply, or None.
    :return: such as ``bad_value``; ``status 42`` where the table has no such number.
    """
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

        :param pending: the command.
        :param latest_ns: host time (ns) up to which it is worth sending. One that still waits then is not sent and ends as
            ``late``: a queue that has once grown longer than the line is fast would otherwise make all that follows late.
        """
        self._waiting.append((pending, self._tries, latest_ns))

    def submit_alone(self, pending: Pending, tries: int, reason: str) -> Pending:
        """Pass every queue: all that waits or is open fails and is not repeated; what comes later waits for this one.

        :param pending: the command.
        :param tries: how often it is sent before it is given up, at least 1.
        :param reason: why the others fail, in words.
        :return: the command to watch: the one already under way alone if there is one, else ``pending``.
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
        """Repeat what is overdue, then send what there is room for.

        :param now_ns: host time now (ns).
        :param emit: takes the bytes of each frame to be written.
        :param hold: send nothing, but let the time-outs run.
        """
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
        """Send nothing open again, because the board was made to forget its replies; answers still count."""
        for command in self._open.values():
            command.tries_allowed = command.tries

    def resolve(self, number: int, status: int, detail: int, board_time_ns: int | None) -> Pending | None:
        """Resolve the open command with this number.

        :param number: sequence number of the reply, 1 to 255.
        :param status: see ``Pending.answer``; so are ``detail`` and ``board_time_ns``.
        :param detail: the reply's detail, 0 to 65535.
        :param board_time_ns: host time (ns) of the answer, or None.
        :return: the command, or None if no such command is open (an answer that came twice, or too late).
        """
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
        """Fail what waits and what is open. Numbers go on counting, so that no late answer meets a new command.

        :param kind: class of the errors.
        :param reason: why, in words; "whether it was carried out is unknown" is added for commands that had been sent.
        """
        failed = [command.pending for command in self._open.values()] + [pending for pending, *_ in self._waiting]
        self._open.clear()
        self._waiting.clear()
        self.next_due_ns = NEVER_NS
        self._fail(failed, kind, reason)

    def _fail(self, failed: list[Pending], kind: type[LinkError], reason: str) -> None:
        for pending in failed:
            unknown = "; whether it was carried out is unknown" if pending.sent else ""
            pending.fail(kind(self._port, reason + unknown, pending.name))

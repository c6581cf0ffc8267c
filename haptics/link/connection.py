"""A port and a session tied together: moves bytes, and turns what ports raise into the session's loss."""

from __future__ import annotations

import threading
from typing import Any

from haptics.errors import LinkError, LinkLost
from haptics.link.clock import ClockFit
from haptics.link.commands import NEVER_NS, Pending
from haptics.link.events import Event
from haptics.link.messages import Board
from haptics.link.ports import BytePort, PortErrors, read_waiting
from haptics.link.session import LinkSession
from haptics.link.simulated import SharedWorldPort, simulated


class Link:
    """One board on one port. Every method may be called from any thread.

    ``send``, ``arm``, ``stop`` write to the port before they return, so a stop waits for nothing. ``simulated`` is the port as a
    simulated one, or None if it is real.

    :param port: an open port, from ``open_port``.
    :param session: its session; errors name the port as the session does.
    """

    def __init__(self, port: BytePort, session: LinkSession):
        self.port, self.session = port, session
        self.simulated = simulated(port)
        self._shared = port if isinstance(port, SharedWorldPort) else None
        self._reading, self._writing = PortErrors(self.name, "read"), PortErrors(self.name, "write")
        self._lock = threading.RLock()

    @property
    def name(self) -> str:
        """The port's name."""
        return self.session.port_name

    @property
    def board(self) -> Board | None:
        """The board that answered, or the one expected."""
        return self.session.board

    @property
    def identity(self) -> Any:
        """The board's identity message, or None."""
        return self.session.identity

    @property
    def ready(self) -> bool:
        """Commands are taken."""
        return self.session.ready

    @property
    def armed(self) -> bool:
        """The board answered ok to ``arm``, and nothing it sent since contradicts that."""
        return self.session.armed

    @property
    def error(self) -> LinkError | None:
        """Why the link ended, if it did."""
        return self.session.error

    @property
    def clock(self) -> ClockFit | None:
        """The board's clock, or None before it was measured."""
        return self.session.clock

    def to_ticks(self, host_ns: int) -> int:
        """See ``LinkSession.to_ticks``.

        :param host_ns: host time (ns).
        :return: board ticks, u32.
        :raises ClockUncertain: the board's clock is not known well enough at that time.
        """
        with self._lock:
            return self.session.to_ticks(host_ns)

    def exact_ticks(self, host_ns: int) -> int:
        """See ``LinkSession.exact_ticks``.

        :param host_ns: host time (ns).
        :return: board ticks, u32.
        :raises ClockUncertain: the board's clock is not known well enough at that time to measure by.
        """
        with self._lock:
            return self.session.exact_ticks(host_ns)

    @property
    def shift_ns(self) -> int:
        """See ``LinkSession.shift_ns``."""
        return self.session.shift_ns

    def to_host_ns(self, ticks: int) -> int:
        """See ``LinkSession.to_host_ns``.

        :param ticks: board ticks, u32.
        :return: host time (ns).
        :raises ClockUncertain: the board's clock was never measured.
        """
        with self._lock:
            return self.session.to_host_ns(ticks)

    def events(self) -> list[Event]:
        """What happened since the last call.

        :return: events in the order they happened; each is returned once.
        """
        with self._lock:
            return self.session.events()

    def start(self, now_ns: int) -> None:
        """Begin the handshake.

        :param now_ns: host time now (ns).
        """
        with self._lock:
            self.session.start(now_ns)
            self._write(now_ns)

    def send(self, name: str, *values: Any, now_ns: int) -> Pending:
        """See ``LinkSession.send``.

        :param name: a command of the message table, such as ``pulse``.
        :param values: its fields in the order of the table.
        :param now_ns: host time now (ns).
        :return: the command; its outcome comes later.
        :raises InputError: no such command for this board, or values that do not fit.
        """
        with self._lock:
            pending = self.session.send(name, *values, now_ns=now_ns)
            self._write(now_ns)
            return pending

    def arm(self, now_ns: int) -> Pending:
        """See ``LinkSession.arm``.

        :param now_ns: host time now (ns).
        :return: the command; its outcome comes later.
        """
        with self._lock:
            pending = self.session.arm(now_ns)
            self._write(now_ns)
            return pending

    def stop(self, now_ns: int) -> Pending:
        """See ``LinkSession.stop``.

        :param now_ns: host time now (ns).
        :return: the stop to watch.
        """
        with self._lock:
            pending = self.session.stop(now_ns)
            self._write(now_ns)
            return pending

    @property
    def next_event_ns(self) -> int:
        """When the session has something due, or a simulated port's board acts or is heard (ns); ``NEVER_NS`` if neither ever
        will.
        """
        deadline_ns = self.session.next_deadline_ns
        event_ns = self.simulated.next_event() if self.simulated is not None else None
        if event_ns is None:
            return NEVER_NS if deadline_ns is None else deadline_ns
        return event_ns if deadline_ns is None or event_ns < deadline_ns else deadline_ns

    def advance(self, to_ns: int) -> None:
        """Carry a simulated port to ``to_ns``; a real one, or a closed one, is left alone.

        :param to_ns: time of the port's world (ns), not before where it is.
        """
        if self.simulated is not None and self.port.is_open:
            self.simulated.advance(to_ns)

    def pass_by(self, to_ns: int) -> int | None:
        """Let others in a simulated port's world act, as long as neither its board nor the session has anything to do.

        :param to_ns: time of the world at most (ns).
        :return: when bytes wait to be read, which ends it (ns); None if none do.
        """
        if self._shared is None or not self.port.is_open:
            return None
        deadline_ns = self.session.next_deadline_ns
        return self._shared.pass_by(to_ns if deadline_ns is None else min(to_ns, deadline_ns - 1))

    def service(self, now_ns: int) -> None:
        """Hand what has come to the session, let it work, and write what it sends; nothing once the link ended. Waits for
        nothing.

        :param now_ns: host time now (ns).
        """
        if self.session.error is not None:
            return
        try:
            with self._reading:
                data = read_waiting(self.port)
        except LinkLost as error:
            self.lose(error, now_ns)
            return
        self.take(data, now_ns)

    def wait_for_bytes(self) -> bytes:
        """What comes within the port's read time-out.

        :return: the bytes read; empty if none came.
        :raises LinkLost: the port went away.
        """
        with self._reading:
            data = self.port.read(1)
            return data + read_waiting(self.port) if data else data

    def take(self, data: bytes, now_ns: int) -> None:
        """Hand bytes to the session and write what it sends.

        :param data: bytes read from the port; may be empty.
        :param now_ns: host time (ns) at which they were read.
        """
        with self._lock:
            if data:
                self.session.receive(data, now_ns)
            self.session.poll(now_ns)
            self._write(now_ns)

    def lose(self, error: LinkError, now_ns: int) -> None:
        """End the link because the port went away.

        :param error: why.
        :param now_ns: host time now (ns).
        """
        with self._lock:
            self.session.lost(error, now_ns)

    def reopen(self, port: BytePort, now_ns: int) -> None:
        """Go on with another open port, from the handshake on. Never arms.

        :param port: an open port to the same board.
        :param now_ns: host time now (ns).
        """
        with self._lock:
            self.port, self.simulated = port, simulated(port)
            self._shared = port if isinstance(port, SharedWorldPort) else None
            self.start(now_ns)

    def close(self) -> None:
        """Close the port."""
        try:
            with PortErrors(self.name, "close"):
                self.port.close()
        except LinkLost:
            pass  # it is closed all the same

    def _write(self, now_ns: int) -> None:
        data = self.session.outgoing()
        if not data:
            return
        try:
            with self._writing:
                self.port.write(data)
        except LinkLost as error:
            self.session.lost(error, now_ns)

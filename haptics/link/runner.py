"""What drives links: a stepper through virtual time, and threads on real ports. Also ``connect``, for tools."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from haptics.errors import InputError, LinkError, LinkLost, ReplyTimeout
from haptics.link.commands import NEVER_NS, Pending
from haptics.link.connection import Link
from haptics.link.ports import open_port
from haptics.link.state import Phase
from haptics.time import NS_PER_MS, NS_PER_S, Clock, MonotonicClock, VirtualClock, seconds_to_ns

_BACKOFF_NS = (250 * NS_PER_MS, 500 * NS_PER_MS, NS_PER_S, 2 * NS_PER_S, 4 * NS_PER_S)


class Runner(Protocol):
    """Drives some links and lets time pass."""

    @property
    def links(self) -> Sequence[Link]:
        """The links it drives."""
        ...

    def now_ns(self) -> int:
        """Time of the runner's clock.

        :return: nanoseconds.
        """
        ...

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass until a condition holds.

        :param condition: asked each time something happened.
        :param timeout_s: longest wait (s of the runner's clock).
        :return: whether the condition holds.
        """
        ...


class VirtualRunner:
    """Steps links and the simulated boards behind them from event to event. Never waits; the same calls give the same bytes.

    :param links: links on simulated ports with ``clock=virtual``; ports of one world move together, others each in their own.
    :param clock: the clock that everybody in the run reads; one of its own if None. Worlds must not be ahead of it.
    :raises InputError: a port is real, and would not follow.
    """

    def __init__(self, links: Sequence[Link], clock: VirtualClock | None = None):
        self.links = list(links)
        for link in self.links:
            if link.simulated is None:
                raise InputError(f"port = {link.name!r} cannot run in virtual time; expected a simulated port with clock=virtual")
        self.clock = clock if clock is not None else VirtualClock()

    def now_ns(self) -> int:
        """The virtual time.

        :return: nanoseconds.
        """
        return self.clock.now_ns()

    def run_until(self, t_ns: int) -> None:
        """Carry links and boards to ``t_ns``: each event in its turn, then ``t_ns`` itself.

        :param t_ns: virtual time (ns).
        :raises InputError: ``t_ns`` lies in the past.
        """
        only = self.links[0] if len(self.links) == 1 else None
        while True:
            # What others in the world do reaches one link only as bytes, or by its board.
            if only is not None and (waits_ns := only.pass_by(t_ns)) is not None:
                self.clock.advance_to(waits_ns)
                only.service(waits_ns)
                continue
            if (event_ns := min(due_ns := self._due_ns(), default=NEVER_NS)) > t_ns:
                break
            self.clock.advance_to(event_ns)
            for link, link_ns in zip(self.links, due_ns, strict=True):
                if link_ns == event_ns:
                    link.advance(event_ns)
                    link.service(event_ns)
        self.clock.advance_to(t_ns)
        for link in self.links:
            link.advance(t_ns)

    def _due_ns(self) -> list[int]:
        """For each link, when a byte arrives, its board acts or its session wants to be asked next; later than now."""
        soonest_ns = self.clock.now_ns() + 1
        return [max(link.next_event_ns, soonest_ns) for link in self.links]

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Run from event to event until a condition holds or virtual time is up.

        :param condition: asked after each event.
        :param timeout_s: longest wait (s of virtual time).
        :return: whether the condition holds.
        """
        end_ns = self.now_ns() + seconds_to_ns(timeout_s)
        while not condition():
            if self.now_ns() >= end_ns:
                return False
            self.run_until(min([*self._due_ns(), end_ns]))
        return True


class RealtimeRunner:
    """A thread for each link that reads with a short time-out and does what is due. Use as a context manager.

    :param links: links on open ports.
    :param clock: a clock that passes by itself; None: the machine's monotonic one.
    :param reopen: open a lost port again, after 0.25 s, then 0.5, 1, 2 and 4 s, and go through the handshake. Never arms.
    """

    def __init__(self, links: Sequence[Link], clock: Clock | None = None, reopen: bool = False):
        self.links = list(links)
        self.clock = clock if clock is not None else MonotonicClock()
        self._reopen = reopen
        self._closing = threading.Event()
        self._changed = threading.Condition()
        self._threads = [threading.Thread(target=self._serve, args=(link,), daemon=True) for link in self.links]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> RealtimeRunner:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def now_ns(self) -> int:
        """The machine's time.

        :return: nanoseconds.
        """
        return self.clock.now_ns()

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until a condition holds.

        :param condition: asked after each read of any link.
        :param timeout_s: longest wait (s).
        :return: whether the condition holds.
        """
        with self._changed:
            return self._changed.wait_for(condition, timeout_s)

    def close(self) -> None:
        """End the threads, then close the ports. A board that was armed makes itself safe when it hears nothing more."""
        self._closing.set()
        for link, thread in zip(self.links, self._threads, strict=True):
            if thread is not threading.current_thread():
                thread.join()
            link.close()

    def _serve(self, link: Link) -> None:
        while not self._closing.is_set():
            try:
                data = link.wait_for_bytes()
                link.take(data, self.now_ns())
            except LinkLost as error:
                link.lose(error, self.now_ns())
            except Exception as error:  # from a tap, for example: report it as the link's end, then let the thread fail
                link.lose(LinkLost(link.name, f"its reader stopped: {error!r}"), self.now_ns())
                raise
            with self._changed:
                self._changed.notify_all()
            if link.session.phase is Phase.LOST and not self._recover(link):
                return

    def _recover(self, link: Link) -> bool:
        """Open a lost port again; False if that is not wanted, or the runner closes."""
        if not self._reopen or not isinstance(link.error, LinkLost):
            return False
        link.close()
        for attempt in range(1 << 30):
            if self._closing.wait(_BACKOFF_NS[min(attempt, len(_BACKOFF_NS) - 1)] / NS_PER_S):
                return False
            try:
                link.reopen(open_port(link.name), self.now_ns())
            except LinkError:
                continue
            return True
        return False


def connect(runner: Runner, links: Sequence[Link] | None = None, timeout_s: float = 10.0) -> list[Any]:
    """Start links and run until all are ready. Arms nothing.

    :param runner: what drives the links.
    :param links: those to start; None: all of the runner's.
    :param timeout_s: longest wait (s of the runner's clock).
    :return: their identities, in the order of the links.
    :raises NotABoard: no board answered; the message names what came instead, and what that suggests.
    :raises WrongFirmware: another protocol, message table or kind of board.
    :raises LinkError: the port went away, or configuring was refused.
    """
    chosen = list(runner.links if links is None else links)
    for link in chosen:
        link.start(runner.now_ns())
    runner.wait_for(lambda: all(link.ready for link in chosen) or any(link.error is not None for link in chosen), timeout_s)
    for link in chosen:
        if link.error is not None:
            raise link.error
        if link.identity is None:
            raise link.session.diagnosis()
        if not link.ready:
            count = link.session.counters
            seen = (
                f"still {link.session.phase.value} after {timeout_s:g} s; {count.bytes_in} bytes came: {count.frames_in} valid "
            )
            seen += f"frames and {count.bad_frames} damaged ones; {count.syncs_missed} clock exchanges went unanswered"
            raise ReplyTimeout(link.name, seen, "connect", "is the line slower than its baud rate?")
    return [link.identity for link in chosen]


def finish(runner: Runner, pending: Pending, timeout_s: float = 1.0, port: str = "") -> Pending:
    """Run until a command has an outcome.

    :param runner: what drives its link.
    :param pending: the command.
    :param timeout_s: longest wait (s of the runner's clock).
    :param port: name of the port, for the error of a command that is still open.
    :return: the command, if the board answered ok.
    :raises LinkError: see ``Pending.result``.
    """
    runner.wait_for(lambda: pending.done, timeout_s)
    return pending.result(port)

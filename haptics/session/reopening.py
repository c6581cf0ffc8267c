"""A board whose port went away is looked for, and found again when it comes back: disarmed, until a person arms it."""

from __future__ import annotations

import threading
from collections.abc import Callable

from haptics.errors import LinkError, WrongFirmware
from haptics.link.connection import Link
from haptics.link.ports import BytePort
from haptics.time import NS_PER_MS

BACKOFF_NS = tuple(ms * NS_PER_MS for ms in (250, 500, 1000, 2000))
"""Pauses between attempts; the last one from then on."""


class Reopening:
    """Opens the port of one link again, as often as it takes. Never waits for it: in real time a thread does.

    :param link: with the board.
    :param open_port: opens its port.
    :param realtime: with a thread; else an attempt takes no time.
    """

    def __init__(self, link: Link, open_port: Callable[[], BytePort], realtime: bool):
        self._link, self._open_port, self._realtime = link, open_port, realtime
        self._due_ns: int | None = None
        self._attempts = 0
        self._thread: threading.Thread | None = None
        self._found: BytePort | None = None

    def step(self, now_ns: int) -> None:
        """Look whether it is time for another attempt, or one has come to its end.

        :param now_ns: ns on the link's clock.
        """
        if self._link.error is None or isinstance(self._link.error, WrongFirmware):
            self._due_ns = None
            return
        if self._thread is not None:
            if not self._thread.is_alive():
                self._thread = None
                self._go_on(now_ns)
            return
        if self._due_ns is None:
            self._attempts, self._due_ns = 0, now_ns + BACKOFF_NS[0]
        if now_ns < self._due_ns:
            return
        self._link.close()
        self._attempts += 1
        if self._realtime:
            self._thread = threading.Thread(target=self._try, name="port", daemon=True)
            self._thread.start()
        else:
            self._try()
            self._go_on(now_ns)

    def _try(self) -> None:
        try:
            self._found = self._open_port()
        except LinkError:
            self._found = None

    def _go_on(self, now_ns: int) -> None:
        port, self._found = self._found, None
        self._due_ns = now_ns + BACKOFF_NS[min(self._attempts, len(BACKOFF_NS) - 1)]
        if port is not None:
            self._link.reopen(port, now_ns)

    def close(self) -> None:
        """Give up; a port that was found meanwhile is closed."""
        if self._thread is not None:
            self._thread.join()
        if self._found is not None:
            self._found.close()

"""How a process is asked to end: Ctrl-C, SIGTERM and SIGHUP as one exception that unwinds, so that gloves go off on the way.

By itself Python raises on Ctrl-C only; the other two end a process where it stands, and a board is left to its dead-man.
``orderly`` makes all of them raise :class:`Ended`. ``unbroken`` is for what must not be broken off half way, such as going off:
what asks meanwhile is heard when it is done.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from haptics.errors import HapticsError

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))
"""What asks a process to end; Windows has no SIGHUP, and SIGBREAK instead."""
AGAIN_S = 1.0
"""A signal that follows another this soon asks for the same end: pressing Ctrl-C three times does not break off going off."""
_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


class Ended(KeyboardInterrupt):
    """The process was asked to end.

    :param number: of the signal.

    :ivar signal_name: ``SIGINT`` (Ctrl-C), ``SIGTERM``, ``SIGHUP``.
    :ivar exit_code: 128 and the signal's number.
    """

    def __init__(self, number: int):
        self.number = signal.Signals(number)
        self.signal_name, self.exit_code = self.number.name, 128 + number
        super().__init__(f"interrupted by {self.signal_name}")


class _Unbroken:
    """See ``unbroken``."""

    def __init__(self) -> None:
        self.depth = 0
        self.waiting: int | None = None

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():  # no other is ever interrupted by a signal
            self.depth += 1

    def __exit__(self, *_: object) -> None:
        if threading.current_thread() is threading.main_thread():
            self.depth -= 1
            if not self.depth and self.waiting is not None:
                number, self.waiting = self.waiting, None
                if not isinstance(sys.exc_info()[1], Ended):  # else it asks for the end that is under way
                    raise Ended(number)


unbroken = _Unbroken()
"""Context, may be nested: inside ``orderly``, a signal that comes in it is raised when it is left."""


@contextmanager
def undisturbed() -> Iterator[None]:
    """Whatever asks to end meanwhile is heard when this is left, in a program or a script: for what a library in C calls back,
    where an exception brings the process down instead of unwinding it.

    :return: a context manager.
    """
    with orderly(), unbroken:
        yield


@contextmanager
def orderly() -> Iterator[None]:
    """While this is open, Ctrl-C, SIGTERM and SIGHUP raise :class:`Ended` in the main thread.

    A signal that the program handles itself, or ignores (``nohup``), stays as it is; nested in another ``orderly``, or in
    another thread, this does nothing. Who leaves by ``Ended`` is handed the same signal once more, as it would have come
    without this: a script that was ended by SIGTERM still ends by SIGTERM, only after its glove went off. What the exception
    reports goes to standard error before that.

    :return: a context manager.
    """
    raised_s: float | None = None
    over, late = False, None

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal raised_s, late
        if over:
            late = number
            return
        if unbroken.depth:
            unbroken.waiting = number
            return
        now_s = time.monotonic()
        if raised_s is None or now_s - raised_s > AGAIN_S:
            raised_s = now_s
            raise Ended(number)

    taken = {}
    if threading.current_thread() is threading.main_thread():
        taken = {number: before for number in SIGNALS if (before := signal.getsignal(number)) in _DEFAULTS}
    for number in taken:
        signal.signal(number, end)
    try:
        yield
    except Ended as error:
        over = True
        _restore(taken)
        if error.number in taken:
            say(error)  # the exception goes no further
            signal.raise_signal(error.number)
        raise
    finally:
        over = True  # between one handler and the next there is nobody left to unwind
        _restore(taken)
        if late is not None:
            signal.raise_signal(late)


def say(error: BaseException) -> None:
    """A line on standard error for what ended a program and for each note that it carries; then for what a signal ended in its
    turn, as one may come while a lost link is dealt with.

    :param error: what ended it.
    """
    with suppress(OSError, ValueError):  # nobody may be listening any more
        for line in (str(error) or type(error).__name__, *getattr(error, "__notes__", ())):
            print(f"haptics: {line}", file=sys.stderr)
        sys.stderr.flush()
    if isinstance(error, KeyboardInterrupt) and isinstance(error.__context__, (HapticsError, KeyboardInterrupt)):
        say(error.__context__)


def shield_tracker() -> None:
    """Before a pool of processes: the one with which ``multiprocessing`` keeps account of them sits out Ctrl-C and SIGTERM,
    but not the SIGHUP of a terminal that closes; begun by this, it sits out that one too."""
    if not {"SIGHUP", "pthread_sigmask"} <= set(dir(signal)):  # Windows
        return
    from multiprocessing import resource_tracker

    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_workers() -> None:
    """Ask the processes that this one has started to end, and do not wait: what they were to compute nobody waits for."""
    from multiprocessing import active_children

    for process in active_children():
        process.terminate()


def _restore(handlers: dict) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)

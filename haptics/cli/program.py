"""How a program ends: whatever ends it becomes lines on standard error and an exit code, never a traceback for a full disk."""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from haptics.ends import Ended, orderly, say
from haptics.errors import HapticsError, LimitError

ENDINGS = (HapticsError, KeyboardInterrupt, OSError)
"""What ends a program without being a fault in it."""


def run_program(body: Callable[[], Any]) -> NoReturn:
    """Run a program, and exit.

    Exit codes: 0 fine, 1 a limit or a validation failed, 2 set-up or usage; ended by a signal, 128 and its number (130 Ctrl-C,
    143 SIGTERM, 129 SIGHUP).
    """
    _open_standard_streams()
    with orderly():
        code: Any = 0
        try:
            body()
        except SystemExit as stop:
            code = stop.code
        except ENDINGS as error:
            code = ended_by(error)
        atexit.register(_end_quietly)
        sys.exit(_flushed(code))


def _end_quietly() -> None:
    """While the interpreter takes itself down, Ctrl-C has nothing left to unwind, and no traceback to show."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def ended_by(error: BaseException) -> int:
    """Say what ended the program; returns the exit code."""
    say(error)
    if isinstance(error, Ended):
        return error.exit_code
    if isinstance(error, KeyboardInterrupt):
        return 130
    return 1 if isinstance(error, LimitError) else 2


def _flushed(code: Any) -> Any:
    """The exit code, once all output is out; that nobody can read it is an error too, and must not become a traceback later."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as error:
        if not code:
            why = "it was closed" if isinstance(error, (BrokenPipeError, ValueError)) else error.strerror or error
            say(OSError(f"standard output cannot be written: {why}"))
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - for the interpreter's own flush at its end
        return code or 2
    return code


def _open_standard_streams() -> None:
    """A stream that was closed before we began (``>&-``) takes what is printed and keeps it to itself."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115

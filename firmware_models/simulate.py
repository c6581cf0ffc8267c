"""``haptics link simulate``: a simulated board in its own process, behind a pseudo-terminal, in real time.

It outlives its host, as a board does: kill the host, and the board's own dead-man makes it safe. Ending this process is
pulling the plug.
"""

from __future__ import annotations

import json
import os
import select
import signal
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer

from firmware_models.line.cable import Cable
from firmware_models.options import parse_options, split_url
from firmware_models.protocol_sim import board_options, make_cable
from haptics.errors import InputError
from haptics.time import seconds_to_ns
from haptics.units import in_range

_READ_SIZE = 4096
_LONGEST_WAIT_S = 0.1


class Trace:
    """JSON lines, one whenever what is energised, the state or the faults change.

    ``time_ns`` is monotonic time; ``host_byte_ns`` is when the host's last byte so far was in, or null before the first. Of an
    array, ``pins_out`` are the channels whose pin is out then.
    """

    def __init__(self, file: TextIO):
        self._file = file
        self._last: dict[str, Any] = {}

    def note(self, cable: Cable) -> None:
        """Write a line if anything changed."""
        board = cable.board
        seen = {"state": board.state.name, "faults": board.faults, "energised": board.energised()}
        if seen != self._last:
            heard_ns = cable.to_board.busy_until_ns
            times = {"time_ns": board.now_ns, "host_byte_ns": heard_ns if heard_ns > 0 else None}
            self._file.write(json.dumps({**times, **seen, **_pins_out(board.truth())}) + "\n")
            self._file.flush()
            self._last = seen


def _pins_out(truth: dict[str, Any]) -> dict[str, list[int]]:
    """Nothing for a board without pins."""
    return {"pins_out": [i for i, pin in enumerate(truth["latched"]) if pin == "on"]} if "latched" in truth else {}


class PseudoTerminal:
    """A cable whose host end is a pseudo-terminal.

    :param master: the file descriptor behind it, not blocking. A host that does not read loses bytes.
    """

    def __init__(self, cable: Cable, master: int, trace: Trace | None = None):
        self._cable, self._master, self._trace = cable, master, trace

    def serve(self, until_ns: int | None = None) -> None:
        """Run the board on the machine's monotonic clock, till ``until_ns`` or an interrupt."""
        while until_ns is None or time.monotonic_ns() < until_ns:
            now_ns = self._catch_up()
            wait_s = min((self._cable.next_event() - now_ns) / 1e9, _LONGEST_WAIT_S)
            if until_ns is not None:
                wait_s = min(wait_s, (until_ns - now_ns) / 1e9)
            if select.select([self._master], [], [], max(wait_s, 0.0))[0]:
                data = os.read(self._master, _READ_SIZE)
                self._catch_up()
                self._cable.to_board.send(data, time.monotonic_ns())

    def _catch_up(self) -> int:
        """Run what is due, one event at a time so that the trace misses nothing, and hand over what the board sent."""
        now_ns = time.monotonic_ns()
        while (next_ns := self._cable.next_event()) <= now_ns:
            self._cable.advance(next_ns)
            if self._trace:
                self._trace.note(self._cable)
        self._cable.advance(now_ns)
        data = self._cable.to_host.take(_READ_SIZE, now_ns)
        if data:
            with suppress(BlockingIOError):  # nobody reads
                os.write(self._master, data)
        return now_ns


def simulate(
    board: Annotated[str, typer.Argument(help="tactiles or brake")],
    query: Annotated[str, typer.Option("--query", help="settings as in a sim:// URL: 'seed=2&level=event'")] = "",
    link: Annotated[Path | None, typer.Option("--link", help="symbolic link to make to the pseudo-terminal")] = None,
    for_s: Annotated[float | None, typer.Option("--for-s", help="end after so many seconds [default: when interrupted]")] = None,
    trace: Annotated[Path | None, typer.Option("--trace", help="write changes of what is energised here, as JSON lines")] = None,
    force: Annotated[bool, typer.Option("--force", help="overwrite the trace, and a symbolic link that exists")] = False,
) -> None:
    """Serve a simulated board behind a pseudo-terminal, in real time, for any serial program. Prints the port's path."""
    try:
        import pty
        import tty
    except ImportError as error:
        raise InputError(f"pseudo-terminals exist on POSIX systems only; elsewhere, open sim://{board} in the program") from error
    name, raw = split_url(f"sim://{board}?{query}")
    options = parse_options(raw, board_options(name))
    if options["clock"] != "real":
        raise InputError(f"clock = {options['clock']}: a board behind a pseudo-terminal runs on the real clock; leave clock out")
    if for_s is not None:
        in_range("--for-s", for_s, 0.0, float("inf"), "s")
    for option, file in (("--trace", trace), ("--link", link)):
        if file is not None and not file.parent.is_dir():
            raise InputError(f"{option} = {file}: there is no folder {file.parent}; make it, or choose another place")
    with ExitStack() as stack:
        note = None
        if trace is not None:
            try:
                note = Trace(stack.enter_context(trace.open("w" if force else "x", encoding="utf-8")))
            except FileExistsError as error:
                raise InputError(f"--trace = {trace} exists; choose another name or overwrite it (--force)") from error
            except OSError as error:
                raise InputError(f"--trace = {trace} cannot be written: {error.strerror}; choose another place") from error
        master, slave = pty.openpty()
        stack.callback(os.close, master)
        stack.callback(os.close, slave)  # held open: a host that closes must not hang up the line
        tty.setraw(slave)
        os.set_blocking(master, False)
        path = os.ttyname(slave)
        if link is not None:
            if link.is_symlink() and not force:  # as one that was killed leaves it
                raise InputError(f"--link = {link} exists; choose another path or overwrite it (--force)")
            if link.exists() and not link.is_symlink():
                raise InputError(f"--link = {link} exists; choose another path, as it is no symbolic link")
            try:
                link.unlink(missing_ok=True)
                link.symlink_to(path)
            except OSError as error:
                raise InputError(f"--link = {link} cannot be made: {error.strerror}; choose another place") from error
            stack.callback(link.unlink, missing_ok=True)
        previous = signal.signal(signal.SIGTERM, signal.default_int_handler)  # leave by the same door as ctrl-c
        stack.callback(signal.signal, signal.SIGTERM, previous)
        now_ns = time.monotonic_ns()
        cable = make_cable(name, options, now_ns)
        cable.attach(now_ns)
        print(path, flush=True)
        with suppress(KeyboardInterrupt):
            PseudoTerminal(cable, master, note).serve(None if for_s is None else now_ns + seconds_to_ns(for_s))

"""A simulated board in its own process behind a pseudo-terminal, and the trace of what it did by its own clock."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

COMMAND = [sys.executable, "-m", "haptics.cli.main"]
PATIENCE_S = 60.0


def wait_until(condition: Callable[[], Any]) -> None:
    """For what another process does; a machine that is busy makes it longer, and never wrong."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "nothing happened for a minute"
        time.sleep(0.002)


class PtyBoard:
    """``haptics link simulate``, with a port of its own name."""

    def __init__(self, folder: Path, kind: str):
        self.folder, self.kind = folder, kind
        self.port, self.trace = folder / f"{kind}-port", folder / f"{kind}.jsonl"
        self.start()

    def start(self) -> None:
        """Plug it in."""
        settings = ["--link", str(self.port), "--trace", str(self.trace), "--for-s", "1700", "--force"]
        self.process = subprocess.Popen([*COMMAND, "link", "simulate", self.kind, *settings], stdout=subprocess.DEVNULL)
        wait_until(lambda: self.port.is_symlink() or self.process.poll() is not None)

    def pull(self) -> None:
        """Pull its plug: its port is gone, with all that the board knew."""
        self.process.kill()
        self.process.wait()
        self.port.unlink()

    def lines(self, since: int = 0) -> list[dict[str, Any]]:
        """The trace's whole lines from number ``since`` on."""
        text = self.trace.read_text().splitlines(keepends=True) if self.trace.exists() else []
        return [json.loads(line) for line in text if line.endswith("\n")][since:]

    @property
    def last(self) -> dict[str, Any]:
        """What it is now."""
        return (self.lines() or [{"energised": [], "state": "", "faults": 0, "pins_out": []}])[-1]

    def end(self) -> None:
        """Ask the process to end."""
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(30)

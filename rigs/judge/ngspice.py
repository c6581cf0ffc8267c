"""Run a netlist in ngspice, and read what it saved. ngspice is a program of its own (Debian package ``ngspice``)."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptics.errors import HapticsError

Saved = dict[str, NDArray[np.float64]]
"""What a run saved, by name in small letters (``time``, ``v(bus)``, ``i(vmeter)``), at the simulator's own times."""

LONGEST_RUN_S = 120.0
"""No circuit here takes more than a few seconds; one that hangs must not hang its caller."""


def ngspice_version() -> str:
    """The version of the ngspice that is installed, such as ``39``.

    :return: as ngspice prints it.
    :raises HapticsError: it is not installed, or does not report one.
    """
    printed = subprocess.run([_program(), "--version"], capture_output=True, text=True, timeout=LONGEST_RUN_S).stdout
    found = re.search(r"ngspice-(\S+)", printed)
    if not found:
        raise HapticsError(f"ngspice --version prints {printed[:80]!r}; expected: a line with ngspice-NUMBER")
    return found[1]


def simulate(netlist: str) -> Saved:
    """Run ``netlist`` in batch mode in a folder that is gone afterwards, and read what its ``.save`` lines ask for.

    :param netlist: text, ASCII.
    :return: saved curves by name.
    :raises HapticsError: ngspice is not installed, refuses the netlist, gives up on the way, or saves nothing; the message has
        the first error of its log.
    """
    program = _program()
    with tempfile.TemporaryDirectory(prefix="ngspice-") as folder:
        (Path(folder) / "circuit.cir").write_text(netlist, encoding="ascii")
        # Without a person's own start file, and with every digit as text.
        command = [program, "-n", "-b", "-o", "log.txt", "-r", "saved.raw", "circuit.cir"]
        surroundings = os.environ | {"SPICE_ASCIIRAWFILE": "1"}
        try:
            done = subprocess.run(command, cwd=folder, env=surroundings, capture_output=True, text=True, timeout=LONGEST_RUN_S)
        except subprocess.TimeoutExpired as error:
            raise HapticsError(f"ngspice did not end within {LONGEST_RUN_S:g} s") from error
        log_at, saved_at = Path(folder) / "log.txt", Path(folder) / "saved.raw"
        log = log_at.read_text(errors="replace") if log_at.exists() else done.stderr
        wrong = _first_error(log)
        if done.returncode or wrong or not saved_at.exists():
            raise HapticsError(f"ngspice failed with exit status {done.returncode}: {wrong or 'its log names no error'}")
        return read_raw(saved_at.read_text(encoding="ascii"))


def read_raw(text: str) -> Saved:
    """What an ASCII raw file of ngspice holds.

    :param text: of the file.
    :return: saved curves by name in small letters, each (points,).
    :raises HapticsError: it is not one, or broken off.
    """
    head, _, body = text.partition("Values:\n")
    names = re.findall(r"^\s+\d+\s+(\S+)\s+\S+", head, re.MULTILINE)
    points = re.search(r"No\. Points:\s*(\d+)", head)
    numbers = body.split()
    # Each point begins with its index.
    if not names or not points or len(numbers) != int(points[1]) * (len(names) + 1):
        raise HapticsError(f"ngspice saved {len(numbers)} numbers for {len(names)} names; expected: an ASCII raw file, whole")
    table = np.array(numbers, dtype=np.float64).reshape(-1, len(names) + 1)
    return {name.lower(): table[:, column + 1] for column, name in enumerate(names)}


def _program() -> str:
    found = shutil.which("ngspice")
    if found is None:
        raise HapticsError("ngspice is not installed or not on the PATH; it is the package ngspice of Debian and Ubuntu")
    return found


def _first_error(log: str) -> str:
    """The first line of a log that reports a failure, with the line after it, which names the cause."""
    lines = [line.strip() for line in log.splitlines()]
    for at, line in enumerate(lines):
        if re.search(r"\berror\b|timestep too small|simulation\(s\) aborted", line, re.IGNORECASE):
            return " ".join(lines[at : at + 2]).strip()
    return ""

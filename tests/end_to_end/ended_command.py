"""A command that says what it does, to be asked to end at that moment; run by the tests of ends as a child process.

``python ended_command.py BARE_WORDS... -- MOMENT``: the words are the command line. ``MOMENT`` is ``armed`` or ``off``; when the
command is there, a line with that word goes to standard output, and it waits for a line on standard input before it goes on.
Python hears a signal between two steps of a program, so whoever sends one before that line knows what it will interrupt.
"""

from __future__ import annotations

import os
import sys
from typing import Any

from haptics.cli.main import main
from haptics.session.devices import Devices


def say(word: str) -> None:
    os.write(1, word.encode() + b"\n")


def watched(name: str, before: str | None, after: str | None) -> None:
    """Say when a method of the glove begins, and wait; say when it has ended."""
    original = getattr(Devices, name)

    def method(self: Devices, *args: Any) -> Any:
        if before is not None:
            say(before)
            sys.stdin.readline()
        result = original(self, *args)
        if after is not None:
            safe(self)
            say(after)
        return result

    setattr(Devices, name, method)


def safe(glove: Devices) -> None:
    """Say what is still energised after going off; nothing, one hopes."""
    plants = {name: plant.truth() for name in glove.links if (plant := glove.plant(name)) is not None}
    if any(state != "off" for state in plants.get("tactiles", {}).get("latched", ())):
        say("PINS ARE OUT")
    if any(abs(volts) > 60.0 for volts in plants.get("brake", {}).get("volts", ())):
        say("VOLTS ARE UP")
    if any(link.armed for link in glove.links.values()):
        say("IT IS ARMED")


def ticking(at: int) -> None:
    """Say when the glove was ticked so often after arming, and wait."""
    original, ticks = Devices.follow, [0]

    def follow(self: Devices, to_ns: int) -> None:
        ticks[0] += self._news.wanted_armed
        if ticks[0] == at:
            ticks[0] += 1
            say("armed")
            sys.stdin.readline()
        original(self, to_ns)

    Devices.follow = follow  # type: ignore[method-assign]


if __name__ == "__main__":
    split = sys.argv.index("--")
    moment, sys.argv = sys.argv[split + 1], ["haptics", *sys.argv[1:split]]
    ticking(int(os.environ.get("TICKS", "700")))
    watched("off", "going off" if moment == "off" else None, "is off")
    main()

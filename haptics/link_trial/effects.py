"""Whether outputs did what was commanded: each edge held against the commands, by the board's own clock.

A command may have its effect once, at its time, or not at all. What it may never do is judged here; whether it had to have an
effect depends on what the board answered.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from dataclasses import dataclass, field

from haptics.link_trial.workload import Command
from haptics.time import NS_PER_S, NS_PER_US

PUNCTUAL_NS = 100 * NS_PER_US
"""An output that goes on further than this from its time is early or late: an ATmega's edge that waits for others before it has
been seen 70 us behind (docs/reference/boards.md); one on its own keeps to 10.
"""
TOO_LONG_NS = 200 * NS_PER_US
"""One that goes off later than this after its time was on for too long, one that does earlier for too short: of edges in a row an
ATmega plays each up to 60 us behind the one before, and three coils may be on.
"""
KEPT_NS = 2 * NS_PER_S
"""How long after its time a command is compared with what happens."""


@dataclass(slots=True)
class Expected:
    """One output of one command.

    :param due_ns: when it goes on (world ns).
    :param off_ns: when it goes off (world ns).
    :param drive: 1, or -1 where a coil is driven back.
    :param plays: how often it went on.
    """

    due_ns: int
    off_ns: int
    drive: int
    plays: int = 0


@dataclass(slots=True)
class Effects:
    """Edges so far, sorted by what was wrong with them. Times are nanoseconds of the simulated world, on the board's own clock.

    :param duplicates: put on once more by a command that had been played.
    :param late: more than 100 us after their time.
    :param early: more than 100 us before it.
    :param uncommanded: by no command.
    :param reversed: with the wrong sign.
    :param too_long: off more than 200 us after their time.
    :param errors_ns: of each punctual start, edge less due time (ns).
    :param cut_ns: when a coil or piezo went off more than 200 us before its time, which a board does where it makes itself safe;
        a drive may be replaced.
    :param listening: whether a brake's edges count; those of its self test do not.
    """

    duplicates: int = 0
    late: int = 0
    early: int = 0
    uncommanded: int = 0
    reversed: int = 0
    too_long: int = 0
    errors_ns: list[int] = field(default_factory=list[int])
    cut_ns: list[int] = field(default_factory=list[int])
    listening: bool = False
    _expected: dict[tuple[str, int], list[Expected]] = field(default_factory=dict[tuple[str, int], list[Expected]])
    _on: dict[tuple[str, int], Expected] = field(default_factory=dict[tuple[str, int], Expected])

    def expect(self, command: Command, due_ns: int) -> list[Expected]:
        """Note a command that was sent.

        :param command: the command.
        :param due_ns: when its tick is, on the board's clock (world ns).
        :return: one entry for each output it puts on.
        """
        added: list[Expected] = []
        for one in command.outputs:
            entries = self._expected.setdefault((one.kind, one.channel), [])
            while entries and entries[0].due_ns < due_ns - KEPT_NS:
                del entries[0]
            entry = Expected(due_ns, due_ns + one.on_ns, one.drive)
            insort(entries, entry, key=_due)
            added.append(entry)
        return added

    def switched(self, time_ns: int, kind: str, channel: int, drive: int) -> None:
        """Note an output that went on or off.

        :param time_ns: when (world ns).
        :param kind: coil, brake or piezo.
        :param channel: from 0.
        :param drive: 1 on, -1 on with the other sign, 0 off.
        """
        if kind == "brake" and not self.listening:
            return
        was_on = self._on.pop((kind, channel), None)
        if was_on is not None:
            self.too_long += time_ns > was_on.off_ns + TOO_LONG_NS
            if kind != "brake" and time_ns < was_on.off_ns - TOO_LONG_NS:
                self.cut_ns.append(time_ns)
        if drive:
            entry = self._attribute(self._expected.get((kind, channel), []), time_ns)
            if entry is not None:
                entry.plays += 1
                self.reversed += drive != entry.drive
                self._on[kind, channel] = entry

    def _attribute(self, entries: list[Expected], time_ns: int) -> Expected | None:
        """The command that this start must be of; counts what is wrong with it."""
        behind = bisect_left(entries, time_ns, key=_due)
        near = [entry for entry in entries[max(behind - 1, 0) : behind + 1] if abs(time_ns - entry.due_ns) <= PUNCTUAL_NS]
        if near:
            entry = min(near, key=lambda one: abs(time_ns - one.due_ns))
            self.duplicates += entry.plays > 0
            self.errors_ns.append(time_ns - entry.due_ns)
            return entry
        missed = [entry for entry in entries[:behind] if entry.plays == 0]
        if missed:
            self.late += 1
            return missed[-1]
        if behind:
            self.duplicates += 1
            return entries[behind - 1]
        if entries:
            self.early += 1
            return entries[0]
        self.uncommanded += 1
        return None


def _due(entry: Expected) -> int:
    return entry.due_ns

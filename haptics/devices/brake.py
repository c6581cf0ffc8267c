"""Driver of the brake controller (protocol: ``drive``, ``piezo``, ``brake_telemetry`` in ``docs/reference/protocol.md``).

One supply, so one amplitude for all outputs that are on (``docs/decisions/0003-one-supply-one-amplitude.md``). Every drive
command has a time to live; the driver refreshes it while a brake is wanted, so that volts fall by themselves when it stops.
What is wanted is wanted while the board is armed: disarmed, the driver forgets it, and refuses what is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from haptics.devices.pace import COMMAND_LEAD_NS
from haptics.devices.result import Reason, Result, ResultKind
from haptics.errors import ClockUncertain, InputError
from haptics.link.commands import Pending, status_name
from haptics.link.connection import Link
from haptics.time import NS_PER_MS, seconds_to_ns
from haptics.units import in_range

LONGEST_PIEZO_S = 1.0
"""The longest time that a piezo is asked to vibrate at once, s."""
_KINDS: dict[str, ResultKind] = {"drive": "brake", "piezo": "piezo"}
"""A result's kind, by the command's name."""
PASSING = ("late", "full", "clock", "unknown")
"""What was denied for one of these may be asked for again at once."""


@dataclass(slots=True)
class _Hold:
    """One output that is wanted on: its volts, and who asked for it."""

    amplitude_v: float
    frequency_dhz: int
    owner: str


@dataclass(frozen=True, slots=True)
class _Command:
    """A command on its way. ``asked``: for each output it concerns, when that was asked for, None where it only goes on; and by
    whom."""

    name: str
    sent_ns: int
    start_ns: int
    asked: tuple[tuple[str, int | None, str], ...]


@dataclass(frozen=True, slots=True)
class Refusal:
    """A command that the board did not carry out, or did not get.

    :param command: ``drive`` or ``piezo``.
    :param reason: the board's status, ``unarmed``, ``clock``, or what is wrong with the link, in words.
    :param sent_ns: when it was to be sent, ns.
    """

    command: str
    reason: str
    sent_ns: int


class BrakeDriver:
    """Brakes, clutches and piezos by name.

    :param link: link with a brake board.
    :param channels: what each output drives, in channel order.
    :param frequency_hz: of the bipolar square wave, 0.1 Hz to ``max_frequency_hz``.
    :param ttl_s: life of one drive command, 0.01 to 60 s; refreshed at a third of it.
    :param max_amplitude_v: volts above this are refused, V.
    :param max_frequency_hz: likewise, Hz.

    :ivar commands: commands tried so far, refused or not.
    """

    def __init__(
        self,
        link: Link,
        channels: Sequence[str],
        frequency_hz: float = 20.0,
        ttl_s: float = 0.2,
        max_amplitude_v: float = 1500.0,
        max_frequency_hz: float = 1000.0,
    ):
        self.link = link
        self.channels = tuple(channels)
        self.max_amplitude_v, self.max_frequency_hz = max_amplitude_v, max_frequency_hz
        self._index = {name: i for i, name in enumerate(self.channels)}
        self._frequency_dhz = self._decihertz(frequency_hz)
        self._ttl_ns = seconds_to_ns(in_range("ttl_s", ttl_s, 0.01, 60.0, "s"))
        self._armed = False
        self._holds: dict[int, _Hold] = {}
        self._refresh_ns = 0
        self._changed = False
        self._ended: Reason | None = None  # going off: nothing is held any more
        self._unsent: dict[int, int] = {}  # when holds were asked for of which no command speaks yet, by output
        self._replies: list[tuple[_Command, Pending]] = []
        self._answers: list[tuple[Refusal | None, list[Result]]] = []
        self.commands = 0

    @property
    def armed(self) -> bool:
        """Whether what is asked for can play."""
        return self._armed

    def check(self, name: str, amplitude_v: float, frequency_hz: float | None) -> None:
        """Refuse what :meth:`engage` would refuse.

        :param name: of the output.
        :param amplitude_v: V.
        :param frequency_hz: Hz, or None.
        :raises InputError: see :meth:`engage`.
        """
        self._index_of(name)
        in_range("amplitude_v", amplitude_v, 0.0, self.max_amplitude_v, "V")
        if frequency_hz is not None:
            self._decihertz(frequency_hz)

    def engage(self, name: str, amplitude_v: float, now_ns: int, frequency_hz: float | None = None, owner: str = "") -> None:
        """Volts on one output, as soon as possible, until :meth:`release`; refused while ``unarmed``.

        :param name: of the output.
        :param amplitude_v: 0 to ``max_amplitude_v``. Outputs that are on together share the highest.
        :param now_ns: ns on the link's clock.
        :param frequency_hz: of the square wave; the driver's own if None. Outputs that are on together share the highest.
        :param owner: named in the results.
        :raises InputError: unknown output, volts outside 0 to the limit, or a frequency outside 0.1 Hz to the limit.
        """
        index = self._index_of(name)
        amplitude_v = in_range("amplitude_v", amplitude_v, 0.0, self.max_amplitude_v, "V")
        frequency_dhz = self._frequency_dhz if frequency_hz is None else self._decihertz(frequency_hz)
        if not self._armed:
            self.refuse(name, "unarmed", now_ns, owner)
            return
        if self._ended is not None:
            self.refuse(name, self._ended, now_ns, owner)
            return
        self._give_up(index, "superseded")
        self._unsent[index] = now_ns
        self._holds[index] = _Hold(amplitude_v, frequency_dhz, owner)
        self._changed = True

    def refuse(self, name: str, reason: Reason, now_ns: int, owner: str = "") -> None:
        """Answer a wish for an output that is not even asked of the board.

        :param name: of the output.
        :param reason: such as ``unarmed`` or ``outranked``.
        :param now_ns: ns on the link's clock.
        :param owner: named in the result.
        """
        if reason == "unarmed":
            self._answered(_Command("drive", now_ns, now_ns, ((name, now_ns, owner),)), reason)
        else:
            self._answers.append((None, [Result(name, "brake", False, reason, now_ns, None, owner)]))

    def release(self, name: str, now_ns: int, reason: Reason = "superseded") -> None:
        """Zero volts on one output.

        :param name: of the output.
        :param now_ns: ns on the link's clock.
        :param reason: of the result, where no command spoke of it yet.
        :raises InputError: unknown output.
        """
        index = self._index_of(name)
        if index in self._holds:
            self._give_up(index, reason)
            del self._holds[index]
            self._changed = True

    def release_all(self, now_ns: int) -> None:
        """Zero volts everywhere.

        :param now_ns: ns on the link's clock.
        """
        if self._holds:
            for index in list(self._unsent):
                self._give_up(index, "superseded")
            self._holds.clear()
            self._changed = True

    def piezo(self, names: Sequence[str], duration_s: float, now_ns: int, at_ns: int | None = None, owner: str = "") -> None:
        """Vibrate the fingertip piezos of these outputs' fingers (0.3 s when a grasp begins; thesis 4.6.1), unless ``unarmed``.

        :param names: of the outputs.
        :param duration_s: 1 ms to ``LONGEST_PIEZO_S``.
        :param now_ns: ns on the link's clock.
        :param at_ns: when it is to begin, ns; as soon as possible if None or too near.
        :param owner: named in the results.
        :raises InputError: unknown output, or a duration outside 1 ms to 1 s.
        """
        mask = sum(1 << self._index_of(name) for name in names)
        duration_ms = round(in_range("duration_s", duration_s, 0.001, LONGEST_PIEZO_S, "s") * 1000)
        soonest_ns = now_ns + COMMAND_LEAD_NS
        start_ns = soonest_ns if at_ns is None else max(soonest_ns, at_ns)
        command = _Command("piezo", now_ns, start_ns, tuple((name, now_ns, owner) for name in names))
        if not self._armed or self._ended is not None:
            self._answered(command, self._ended or "unarmed")
            return
        self._send(command, mask, duration_ms)

    def end(self, reason: Reason) -> None:
        """From now on, until it is armed again, nothing is taken; what is held goes on until it is released.

        :param reason: given in the results of what is refused.
        """
        self._ended = reason

    def set_armed(self, armed: bool) -> None:
        """The board was armed, or is no longer. Either way nothing is wanted, and no answer is waited for any more.

        :param armed: whether it is armed now.
        """
        self._read_replies()
        for command, _ in self._replies:
            self._answered(command, "unarmed")
        self._replies.clear()
        for index in list(self._unsent):
            self._give_up(index, "unarmed")
        self._holds.clear()
        self._changed = False
        self._armed, self._ended = armed, None

    def tick(self, now_ns: int) -> None:
        """Send changes and refreshes that are due, and note refusals.

        :param now_ns: ns on the link's clock.
        """
        if self._changed or (self._holds and now_ns >= self._refresh_ns):
            self._drive(now_ns)
        if self._replies:
            self._read_replies()

    def take_refusals(self) -> list[Refusal]:
        """As :meth:`take_answers`, where only refusals are of interest.

        :return: commands refused since any of these three was called last.
        """
        return self.take_answers()[0]

    def take_results(self) -> list[Result]:
        """As :meth:`take_answers`, where only results are of interest.

        :return: results since any of these three was called last.
        """
        return self.take_answers()[1]

    def take_answers(self) -> tuple[list[Refusal], list[Result]]:
        """What became of commands and of the calls that they served, each once.

        Every :meth:`engage` gives one result for its output, every :meth:`piezo` one for each, sooner or later; an output that
        was held gives another where it could not go on being held.

        :return: commands refused, by the board or as unarmed, or never answered; and results of calls.
        """
        answers, self._answers = self._answers, []
        refusals = [refusal for refusal, _ in answers if refusal is not None]
        return refusals, [result for _, results in answers for result in results]

    def engaged(self) -> dict[str, float]:
        """Outputs that are wanted on. The bus has the highest of their volts.

        :return: volts by output name.
        """
        return {self.channels[i]: hold.amplitude_v for i, hold in self._holds.items()}

    @property
    def idle(self) -> bool:
        """No command waits to be sent or answered."""
        return not self._changed and not self._replies

    def _index_of(self, name: str) -> int:
        if name not in self._index:
            raise InputError(f"brake = {name!r} is unknown; this glove has: {', '.join(self.channels)}")
        return self._index[name]

    def _decihertz(self, frequency_hz: float) -> int:
        return round(in_range("frequency_hz", frequency_hz, 0.1, self.max_frequency_hz, "Hz") * 10)

    def _drive(self, now_ns: int) -> None:
        mask = sum(1 << i for i, hold in self._holds.items() if hold.amplitude_v > 0)
        amplitude_v = round(max((hold.amplitude_v for hold in self._holds.values()), default=0.0))
        frequency_dhz = max((hold.frequency_dhz for hold in self._holds.values()), default=self._frequency_dhz)
        self._changed = False
        self._refresh_ns = now_ns + self._ttl_ns // 3
        ttl_ms = self._ttl_ns // NS_PER_MS
        asked = tuple((self.channels[i], self._unsent.get(i), hold.owner) for i, hold in self._holds.items()) or tuple(
            (name, None, "") for name in self.channels
        )
        self._unsent.clear()
        command = _Command("drive", now_ns, now_ns + COMMAND_LEAD_NS, asked)
        self._send(command, mask, amplitude_v, frequency_dhz, ttl_ms)

    def _send(self, command: _Command, *values: int) -> None:
        self.commands += 1
        try:
            ticks = self.link.to_ticks(command.start_ns)
        except ClockUncertain:
            self._answered(command, "clock")
            return
        self._replies.append((command, self.link.send(command.name, ticks, *values, now_ns=command.sent_ns)))

    def _read_replies(self) -> None:
        waiting: list[tuple[_Command, Pending]] = []
        for command, pending in self._replies:
            if not pending.done:
                waiting.append((command, pending))
            elif pending.error is not None:
                self._answered(command, "unknown", str(pending.error))
            else:
                self._answered(command, None if pending.ok else status_name(pending.status))
        self._replies = waiting

    def _answered(self, command: _Command, reason: str | None, in_words: str | None = None) -> None:
        """What a command came to: results of those who asked; where it was refused, of all that it was for."""
        played, kind, why = reason is None, _KINDS[command.name], cast(Reason | None, reason)
        results = [
            Result(
                name,
                kind,
                played,
                why,
                command.sent_ns if asked_ns is None else asked_ns,
                command.start_ns if played else None,
                owner,
                command.sent_ns if reason in PASSING else None,
            )
            for name, asked_ns, owner in command.asked
            if not played or asked_ns is not None
        ]
        if reason is not None:
            self._answers.append((Refusal(command.name, in_words or reason, command.sent_ns), results))
        elif results:
            self._answers.append((None, results))

    def _give_up(self, index: int, reason: Reason) -> None:
        """A hold of which no command spoke will not be."""
        asked_ns = self._unsent.pop(index, None)
        if asked_ns is not None:
            owner = self._holds[index].owner
            self._answers.append((None, [Result(self.channels[index], "brake", False, reason, asked_ns, None, owner)]))

"""Commands for a trial: random, within the board's limits, and such that the board has room for every one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from random import Random
from typing import Any, NamedTuple

from haptics.link.messages import COIL_CHANNELS, DURATION_UNIT_US, HEAT_UNIT_MS
from haptics.time import NS_PER_MS, NS_PER_S, NS_PER_US

_LEAD_NS = (20 * NS_PER_MS, 60 * NS_PER_MS)
_APART_NS = NS_PER_MS
"""Between two commands for one output, so that each has edges of its own."""
_COIL_WORST_MA = 3907
_TRIES = 8
_SHORTEST = 4
"""In 50 us: edges of one coil less than 150 us apart may be late on an ATmega (docs/reference/boards.md)."""


class Output(NamedTuple):
    """One output that a command puts on.

    :param kind: coil, brake or piezo.
    :param channel: from 0.
    :param drive: 1, or -1 where a coil is driven back.
    :param on_ns: for how long (ns).
    """

    kind: str
    channel: int
    drive: int
    on_ns: int


@dataclass(frozen=True, slots=True)
class Command:
    """A timed command and what it puts on.

    :param name: in the message table.
    :param start_ns: when it is to be played (ns).
    :param values: its fields behind ``time``.
    :param outputs: what it puts on.
    """

    name: str
    start_ns: int
    values: tuple[Any, ...]
    outputs: tuple[Output, ...]


class _Book:
    """What is planned on the outputs."""

    def __init__(self) -> None:
        self._spans: list[tuple[int, int, str, int]] = []

    def forget(self, now_ns: int) -> None:
        """What is over."""
        self._spans = [span for span in self._spans if span[1] > now_ns]

    def note(self, command: Command) -> None:
        for one in command.outputs:
            self._spans.append((command.start_ns, command.start_ns + one.on_ns, one.kind, one.channel))

    def meeting(self, start_ns: int, end_ns: int, kind: str, apart_ns: int = _APART_NS) -> list[int]:
        """Channels of this kind that are on within the time, or less than ``apart_ns`` from it; one entry a command."""
        first_ns, last_ns = start_ns - apart_ns, end_ns + apart_ns
        return [channel for begin, end, what, channel in self._spans if what == kind and begin < last_ns and first_ns < end]


class _OnTime:
    """What coils may still be on for, by the board's account of each (``docs/reference/protocol.md``, Heat of the coils).

    :param limit_ms: the board's.
    :param heat: accounts now, as telemetry has them.
    """

    _TAU_S = 102.0
    _SHARE = 0.98
    """Of the limit: board and host charge at other moments, by other clocks."""

    def __init__(self, limit_ms: int, heat: Sequence[int], now_ns: int):
        self._max_ms, self._at_ns = self._SHARE * limit_ms, now_ns
        self._accounts_ms = [float(HEAT_UNIT_MS * one) for one in heat]

    def room(self, now_ns: int) -> list[int]:
        """Of each coil, in 50 us."""
        kept = exp((self._at_ns - now_ns) / NS_PER_S / self._TAU_S)
        self._accounts_ms, self._at_ns = [kept * one for one in self._accounts_ms], now_ns
        return [max(int((self._max_ms - one) * NS_PER_MS / NS_PER_US / DURATION_UNIT_US), 0) for one in self._accounts_ms]

    def charge(self, channel: int, duration: int) -> None:
        """A pulse, in 50 us; after ``room``."""
        self._accounts_ms[channel] += duration * DURATION_UNIT_US * NS_PER_US / NS_PER_MS


class CoilCommands:
    """Pulses on one to three coils at once: never more coils on than the board's current limit allows, none for longer than its
    account of on-time has room for.

    :param limits: the board's, in the order of ``identity.limits``.
    :param random: where the random choices come from.
    :param heat: account of each coil as telemetry has it, in 20 ms; 15 values.
    :param now_ns: time at which ``heat`` holds (ns).
    """

    every_ns = (2 * NS_PER_MS, 5 * NS_PER_MS)
    """Least and longest time between two commands."""

    def __init__(self, limits: tuple[int, ...], random: Random, heat: Sequence[int] = (0,) * COIL_CHANNELS, now_ns: int = 0):
        self._longest, self._together, self._places = limits[0], limits[1] // _COIL_WORST_MA, limits[2]
        self._random, self._book = random, _Book()
        self._on_time = _OnTime(limits[4], heat, now_ns)

    def next(self, now_ns: int) -> Command | None:
        """A command to be sent now.

        :param now_ns: the time (ns), not before that of the last call.
        :return: the command; None if the coils are too busy for any.
        """
        random = self._random
        self._book.forget(now_ns)
        for _ in range(_TRIES):
            start_ns = now_ns + random.randint(*_LEAD_NS)
            durations = [
                max(min(_SHORTEST, self._longest), round(self._longest * random.random() ** 2))
                for _ in range(random.randint(1, 3))
            ]
            busy = self._book.meeting(start_ns, start_ns + max(durations) * DURATION_UNIT_US * NS_PER_US, "coil")
            room = self._on_time.room(now_ns)
            free = [channel for channel in range(COIL_CHANNELS) if channel not in busy and room[channel] >= _SHORTEST]
            if len(durations) <= min(self._together - len(busy), len(free)):
                channels = random.sample(free, len(durations))
                durations = [min(duration, room[channel]) for channel, duration in zip(channels, durations, strict=True)]
                command = self._pulse(start_ns, channels, durations)
                self._book.note(command)
                for channel, duration in zip(channels, durations, strict=True):
                    self._on_time.charge(channel, duration)
                return command
        return None

    def _pulse(self, start_ns: int, channels: list[int], durations: list[int]) -> Command:
        toward = {channel for channel in channels if self._random.random() < 0.5}
        table = [0] * COIL_CHANNELS
        for channel, duration in zip(channels, durations, strict=True):
            table[channel] = duration
        outputs = tuple(
            Output("coil", channel, 1 if channel in toward else -1, table[channel] * DURATION_UNIT_US * NS_PER_US)
            for channel in channels
        )
        return Command("pulse", start_ns, (mask(channels), mask(toward), tuple(table)), outputs)

    def lasting(self, now_ns: int) -> list[Command]:
        """Pulses that go on for as long as the queue has room, one after the other.

        :param now_ns: the time (ns).
        :return: commands, the first of which begins in 60 ms.
        """
        count = min(self._places, 60)
        duration = min(self._longest, 180)
        begin_ns = now_ns + _LEAD_NS[1]
        return [self._pulse(begin_ns + 10 * NS_PER_MS * index, [index % COIL_CHANNELS], [duration]) for index in range(count)]


class BrakeCommands:
    """Drives with a pause between them, so that each begins from empty outputs; and piezo bursts.

    :param limits: the board's, in the order of ``identity.limits``.
    :param fitted: outputs that have a brake.
    :param random: where the random choices come from.
    """

    every_ns = (8 * NS_PER_MS, 14 * NS_PER_MS)
    # Twice the 5 ms by which a session may err about the board's clock; a brake also discharges and rests in between.
    _APART_NS = 11 * NS_PER_MS
    _EMPTY_NS = 16 * NS_PER_MS
    _WAITING = 6  # of the board's 8 places in each queue

    def __init__(self, limits: tuple[int, ...], fitted: list[int], random: Random):
        self._volts, self._longest_ms = min(limits[0], 400), limits[3]
        self._fitted, self._random, self._book = fitted, random, _Book()

    def next(self, now_ns: int) -> Command | None:
        """A command to be sent now.

        :param now_ns: the time (ns), not before that of the last call.
        :return: the command; None if the outputs are too busy for any.
        """
        self._book.forget(now_ns)
        for _ in range(_TRIES):
            start_ns = now_ns + self._random.randint(*_LEAD_NS)
            command = self._drive(start_ns) if self._fitted and self._random.random() < 0.5 else self._burst(start_ns)
            if command is not None:
                self._book.note(command)
                return command
        return None

    def _drive(self, start_ns: int) -> Command | None:
        random = self._random
        ttl_ms = min(random.randint(3, 15), self._longest_ms)
        end_ns = start_ns + ttl_ms * NS_PER_MS
        if self._book.meeting(start_ns, end_ns, "brake", self._EMPTY_NS):
            return None
        channels = random.sample(self._fitted, random.randint(1, len(self._fitted)))
        volts = random.randint(min(100, self._volts), self._volts)
        return drive(start_ns, channels, volts, random.randint(100, 400), ttl_ms)

    def _burst(self, start_ns: int) -> Command | None:
        random = self._random
        duration_ms = min(random.randint(3, 15), self._longest_ms)
        busy = self._book.meeting(start_ns, start_ns + duration_ms * NS_PER_MS, "piezo", self._APART_NS)
        free = sorted(set(range(5)) - set(busy))
        waiting = len(self._book.meeting(0, start_ns + _LEAD_NS[1], "piezo"))
        if not free or waiting >= self._WAITING:
            return None
        channels = [random.choice(free)]
        outputs = tuple(Output("piezo", channel, 1, duration_ms * NS_PER_MS) for channel in channels)
        return Command("piezo", start_ns, (mask(channels), duration_ms), outputs)

    def lasting(self, now_ns: int) -> list[Command]:
        """A drive for as long as the board takes one.

        :param now_ns: the time (ns).
        :return: one command that begins in 60 ms; none if no brake is fitted.
        """
        return [drive(now_ns + _LEAD_NS[1], self._fitted, self._volts, 200, min(2000, self._longest_ms))] if self._fitted else []


def drive(start_ns: int, channels: list[int], volts: int, frequency_dhz: int, ttl_ms: int) -> Command:
    """A drive of some outputs.

    :param start_ns: when it begins (ns).
    :param channels: outputs, from 0.
    :param volts: amplitude (V).
    :param frequency_dhz: frequency in 0.1 Hz.
    :param ttl_ms: how long it lasts (ms).
    :return: the command.
    """
    outputs = tuple(Output("brake", channel, 1, ttl_ms * NS_PER_MS) for channel in channels)
    return Command("drive", start_ns, (mask(channels), volts, frequency_dhz, ttl_ms), outputs)


def mask(channels: list[int] | set[int]) -> int:
    """One bit a channel.

    :param channels: from 0.
    :return: the sum of ``1 << channel``.
    """
    return sum(1 << channel for channel in channels)

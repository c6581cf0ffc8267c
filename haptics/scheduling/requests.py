"""What may be requested of a coil, and what becomes of it: strokes, requests, outcomes, pulses."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

from haptics.errors import InputError
from haptics.physics.latch.pulse import PULSE_BACK_S, PULSE_TOWARD_S, TRAIN_BACK_S, TRAIN_TOWARD_S
from haptics.units import in_range

CHANNELS = 15
LONGEST_STROKE_S = 0.010  # thesis 3.4.3: at most 10 ms at 5 V
CONTACT_S = RELEASE_S = 0.010


class Priority(IntEnum):
    """Who goes first; smaller goes before larger, and within one class the one that was ready first."""

    RELEASE = 0
    CONTACT = 1
    PULSE = 2
    BURST = 3


@dataclass(frozen=True, slots=True)
class Stroke:
    """The coil driven in one direction.

    :param toward_skin: True toward the skin, False back.
    :param duration_s: 50 us to 10 ms (s; thesis 3.4.3).
    :raises InputError: a duration outside that range.
    """

    toward_skin: bool
    duration_s: float

    def __post_init__(self) -> None:
        in_range("duration_s", self.duration_s, 50e-6, LONGEST_STROKE_S, "s")


@dataclass(frozen=True, slots=True)
class Request:
    """One request for one coil.

    Its strokes follow each other without a pause. They are one unit that cannot be cut, except in a burst, where every back
    stroke ends a cycle and a cycle is the unit.

    :param channel: actuator index from 0.
    :param priority: its class, which also decides how it may end.
    :param strokes: a contact ends toward the skin, everything else ends back; a release is a single stroke.
    :param submitted_ns: when the caller made the request (ns).
    :param start_ns: earliest start (ns).
    :param latest_ns: latest start (ns), or None: whenever it becomes possible.
    :param token: the caller's own mark, handed back untouched.
    :raises InputError: strokes that do not suit the priority, a negative channel, or ``latest_ns < start_ns``.
    """

    channel: int
    priority: Priority
    strokes: tuple[Stroke, ...]
    submitted_ns: int
    start_ns: int
    latest_ns: int | None = None
    token: object = None

    def __post_init__(self) -> None:
        if self.channel < 0:
            raise InputError(f"channel = {self.channel}; expected at least 0")
        if not self.strokes:
            raise InputError(f"strokes of a {self.priority.name.lower()} are empty; expected at least one stroke")
        if self.strokes[-1].toward_skin != (self.priority is Priority.CONTACT):
            raise InputError(
                f"last stroke of a {self.priority.name.lower()} has toward_skin = {self.strokes[-1].toward_skin}; "
                "expected True for a contact, False for everything else"
            )
        if self.priority is Priority.RELEASE and len(self.strokes) > 1:
            raise InputError(f"a release has {len(self.strokes)} strokes; expected 1, the one whose heat is kept in reserve")
        if self.latest_ns is not None and self.latest_ns < self.start_ns:
            raise InputError(f"latest_ns = {self.latest_ns}; expected at least start_ns = {self.start_ns}")

    @property
    def units(self) -> tuple[tuple[Stroke, ...], ...]:
        """The pieces that play uncut: a burst's cycles, or all strokes together."""
        if self.priority is not Priority.BURST:
            return (self.strokes,)
        units: list[tuple[Stroke, ...]] = []
        begin = 0
        for index, stroke in enumerate(self.strokes, start=1):
            if not stroke.toward_skin:
                units.append(self.strokes[begin:index])
                begin = index
        return tuple(units)


@dataclass(frozen=True, slots=True)
class CoilPulse:
    """One coil energised once, at an exact time, as it is sent to a board.

    :param channel: actuator index from 0.
    :param start_ns: when (ns of the caller's clock).
    :param duration_s: for how long (s).
    :param toward_skin: True toward the skin, False back.
    :param token: its request's.
    """

    channel: int
    start_ns: int
    duration_s: float
    toward_skin: bool
    token: object = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one request; every request gets exactly one.

    :param request: the request.
    :param played: its pulses (for a cut burst: those of at least one cycle) were given out by ``Scheduler.step``.
    :param reason: why it was denied: ``superseded``, ``heat``, ``current``, ``late``, ``unarmed``, ``stopped`` or ``ended``;
        ``cut`` for a burst that was played in part; None for one played whole.
    :param start_ns: when its first stroke starts (ns); None if denied.
    :param cycles: units played: the cycles of a burst, 1 for any other that played, 0 if denied.
    :param held_by: what a start last waited for or a burst was cut by: ``channel`` (its own coil: a stroke under way, or a
        newer request), ``current`` (as many coils as allowed are on), ``heat``, or what ended the burst (``stopped``, ...).
    """

    request: Request
    played: bool
    reason: str | None
    start_ns: int | None
    cycles: int
    held_by: str | None = None

    @property
    def delay_ns(self) -> int | None:
        """Start after the earliest start asked for (ns); None if denied."""
        return None if self.start_ns is None else self.start_ns - self.request.start_ns


def contact(
    channel: int, start_ns: int, latest_ns: int | None = None, *, submitted_ns: int | None = None, token: object = None
) -> Request:
    """The pin out to the skin, where it stays (thesis 3.4.5): one 10 ms stroke.

    :param channel: actuator index from 0.
    :param start_ns: earliest start (ns).
    :param latest_ns: latest start (ns); None: whenever it becomes possible.
    :param submitted_ns: when the caller made the request (ns); None: at ``start_ns``.
    :param token: the caller's own mark, handed back untouched.
    :return: the request.
    :raises InputError: see ``Request``.
    """
    strokes = (Stroke(True, CONTACT_S),)
    return Request(channel, Priority.CONTACT, strokes, _or(submitted_ns, start_ns), start_ns, latest_ns, token)


def release(
    channel: int, start_ns: int, latest_ns: int | None = None, *, submitted_ns: int | None = None, token: object = None
) -> Request:
    """The pin back in: one 10 ms stroke. Arguments as in ``contact``.

    :param channel: actuator index from 0.
    :param start_ns: earliest start (ns).
    :param latest_ns: latest start (ns); None: whenever it becomes possible.
    :param submitted_ns: when the caller made the request (ns); None: at ``start_ns``.
    :param token: the caller's own mark, handed back untouched.
    :return: the request.
    :raises InputError: see ``Request``.
    """
    strokes = (Stroke(False, RELEASE_S),)
    return Request(channel, Priority.RELEASE, strokes, _or(submitted_ns, start_ns), start_ns, latest_ns, token)


def pulse(
    channel: int, start_ns: int, latest_ns: int | None = None, *, submitted_ns: int | None = None, token: object = None
) -> Request:
    """A tick that does not rest on the skin (thesis 3.4.5): 3 ms toward it, then back at once.

    :param channel: actuator index from 0.
    :param start_ns: earliest start (ns).
    :param latest_ns: latest start (ns); None: whenever it becomes possible.
    :param submitted_ns: when the caller made the request (ns); None: at ``start_ns``.
    :param token: the caller's own mark, handed back untouched.
    :return: the request.
    :raises InputError: see ``Request``.
    """
    strokes = (Stroke(True, PULSE_TOWARD_S), Stroke(False, PULSE_BACK_S))
    return Request(channel, Priority.PULSE, strokes, _or(submitted_ns, start_ns), start_ns, latest_ns, token)


def burst(
    channel: int,
    start_ns: int,
    latest_ns: int | None = None,
    *,
    cycles: int = 10,
    submitted_ns: int | None = None,
    token: object = None,
) -> Request:
    """A pulse train at 200 Hz (thesis 3.4.5): cycles of 2 ms toward the skin and 3 ms back; 10 cycles take 50 ms.

    :param channel: actuator index from 0.
    :param start_ns: earliest start (ns).
    :param latest_ns: latest start (ns); None: whenever it becomes possible.
    :param cycles: at least 1; each takes 5 ms.
    :param submitted_ns: when the caller made the request (ns); None: at ``start_ns``.
    :param token: the caller's own mark, handed back untouched.
    :return: the request.
    :raises InputError: no cycle; or see ``Request``.
    """
    if cycles < 1:
        raise InputError(f"cycles = {cycles}; expected at least 1")
    strokes = (Stroke(True, TRAIN_TOWARD_S), Stroke(False, TRAIN_BACK_S)) * cycles
    return Request(channel, Priority.BURST, strokes, _or(submitted_ns, start_ns), start_ns, latest_ns, token)


def _or(submitted_ns: int | None, start_ns: int) -> int:
    return start_ns if submitted_ns is None else submitted_ns

"""Body signals: named angles over time, such as the bend of an elbow, that clutch rules read.

A recorded hand has no elbow and no spine, so a scene ships a profile for each signal; an engine that knows better
supplies values. Between two keyframes a profile moves with minimum jerk, ``θ0 + (θ1 − θ0)(10 s³ − 15 s⁴ + 6 s⁵)``
(Flash and Hogan 1985).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from haptics.errors import InputError
from haptics.time import NS_PER_MS, NS_PER_S
from haptics.units import in_range

STALE_NS = 100 * NS_PER_MS
"""A supplied value older than this is unknown (the same limit as for a hand's pose)."""
LARGEST_ANGLE_RAD = 2.0 * math.pi


@dataclass(frozen=True)
class Signal:
    """A named angle with a profile through keyframes; constant before the first and after the last.

    :param name: unique in its scene.
    :param time_s: increasing, from 0 up, s.
    :param angle_rad: one for each time, within ±2π rad.
    :param repeat: start over after the last keyframe.
    :raises InputError: times not increasing, lengths that differ, or out of range.
    """

    __pydantic_config__: ClassVar[dict] = {"extra": "forbid", "allow_inf_nan": False}
    name: str
    time_s: tuple[float, ...]
    angle_rad: tuple[float, ...]
    repeat: bool = False

    def __post_init__(self) -> None:
        check_times(f"signal {self.name!r}", self.time_s, len(self.angle_rad), "angle_rad")
        for angle in self.angle_rad:
            in_range(f"signal {self.name!r} angle_rad", angle, -LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD, "rad")

    def at(self, time_s: float) -> tuple[float, float]:
        """The signal at a moment.

        :param time_s: from the start of the run, s.
        :return: the angle, rad, and its rate, rad/s.
        """
        index, along, span_s = locate(self.time_s, time_s, self.repeat)
        start, end = self.angle_rad[index], self.angle_rad[min(index + 1, len(self.angle_rad) - 1)]
        if span_s == 0.0:
            return start, 0.0
        angle = start + (end - start) * minimum_jerk(along)
        return angle, (end - start) * 30.0 * along**2 * (1.0 - along) ** 2 / span_s


class BodySignals:
    """The signals of a run: what the engine supplied while that is fresh, else the scene's profile.

    :param profiles: by name; a name without profile is unknown until supplied.
    """

    def __init__(self, profiles: dict[str, Signal] | None = None):
        self._profiles = dict(profiles or {})
        self._supplied: dict[str, tuple[int, float, float]] = {}

    def supply(self, name: str, time_ns: int, angle_rad: float) -> None:
        """Take a measured angle; its rate is the difference to the one before, when that is not stale.

        :param name: of the signal.
        :param time_ns: when it was measured; later than the last one of this name.
        :param angle_rad: within ±2π rad.
        :raises InputError: not finite, beyond ±2π, or not newer than the one before.
        """
        angle = in_range(f"signal {name!r} angle_rad", angle_rad, -LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD, "rad")
        rate = 0.0
        if name in self._supplied:
            before_ns, before, _ = self._supplied[name]
            if time_ns <= before_ns:
                raise InputError(f"signal {name!r} at time_ns = {time_ns} is not newer than the last, at {before_ns}")
            if time_ns - before_ns <= STALE_NS:
                rate = (angle - before) * NS_PER_S / (time_ns - before_ns)
        self._supplied[name] = (time_ns, angle, rate)

    def read(self, name: str, time_ns: int) -> tuple[float, float] | None:
        """The signal now. A signal once supplied has no profile any more.

        :param name: of the signal.
        :param time_ns: on the clock of ``supply``; 0 is the start of the run.
        :return: angle and rate (rad, rad/s), or None where nothing fresh is known.
        """
        if name in self._supplied:
            at_ns, angle, rate = self._supplied[name]
            return (angle, rate) if time_ns - at_ns <= STALE_NS else None
        profile = self._profiles.get(name)
        return None if profile is None else profile.at(time_ns / NS_PER_S)


def minimum_jerk(along: float) -> float:
    """``10 s³ − 15 s⁴ + 6 s⁵`` (Flash and Hogan 1985).

    :param along: ``s``, share of the time, 0 to 1.
    :return: share of the movement, 0 to 1.
    """
    return along**3 * (10.0 + along * (6.0 * along - 15.0))


def check_times(what: str, time_s: Sequence[float], count: int, other: str) -> None:
    """Check the times of keyframes.

    :param what: what messages call the thing with the keyframes.
    :param time_s: increasing, from 0 up, s; at least one.
    :param count: how many values go with them.
    :param other: the name of these values.
    :raises InputError: no time, not as many as ``count``, or not increasing from 0 or more.
    """
    if not time_s or len(time_s) != count:
        raise InputError(f"{what} has {len(time_s)} time_s and {count} {other}; expected as many of both, at least one")
    if time_s[0] < 0.0 or any(b <= a for a, b in pairwise(time_s)):
        raise InputError(f"{what} time_s = {list(time_s)}; expected increasing times, 0 s or more")


def locate(times_s: Sequence[float], time_s: float, repeat: bool) -> tuple[int, float, float]:
    """Find the keyframe interval that holds a moment.

    :param times_s: increasing, s; at least one.
    :param time_s: the moment, s.
    :param repeat: start over after the last keyframe.
    :return: the interval's index, the share of it that has passed, and its length, s (0 outside all).
    """
    if repeat and len(times_s) > 1 and time_s > times_s[-1]:
        time_s = times_s[0] + (time_s - times_s[0]) % (times_s[-1] - times_s[0])
    if time_s <= times_s[0]:
        return 0, 0.0, 0.0
    if time_s >= times_s[-1]:
        return len(times_s) - 1, 0.0, 0.0
    index = bisect_right(times_s, time_s) - 1
    span_s = times_s[index + 1] - times_s[index]
    return index, (time_s - times_s[index]) / span_s, span_s

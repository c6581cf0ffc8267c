"""Poses as a file has them, in its own axes and units, collected until all of it has been read."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from haptics.errors import InputError
from haptics.scene.hand_files.declared import NOTHING, Declared
from haptics.scene.hand_files.spelling import PARTS
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import JOINTS
from haptics.scene.hands.recording import too_many_refused

MOST_POSES = 100_000
"""A file of more poses, or of more moments without a hand, is refused; a quarter of an hour of one hand at a tracker's 110
frames a second, as much as the largest text holds with all digits, and 150 MB in memory."""
HOPELESS = 1000
"""So many refused poses, a large share so far, and no more of the file is read."""
LARGEST = 1e6
"""No number of a joint is larger: a kilometre in millimetres."""
LOST: tuple[float, ...] = (float("nan"),) * len(PARTS)
"""The numbers of a joint that the tracker has lost."""


@dataclass(slots=True)
class PoseRows:
    """What has been read of a file so far.

    :param declared: what the file, or whoever reads it, says of its numbers.
    :param place: of each pose in the file, for messages.
    :param time: of each pose, in the file's unit.
    :param side: of each pose; None where the file does not say.
    :param track: of each pose: another number where the tracker lost the hand in between.
    :param numbers: ``PARTS`` of each joint of ``JOINTS``, 182 numbers a pose, NaN where there is none.
    :param dropped: what was left out, and how often.
    :param refused: time, side and reason of poses that cannot be read; None for a time or side that is not known.
    """

    declared: Declared = NOTHING
    place: list[str] = field(default_factory=list)
    time: list[float] = field(default_factory=list)
    side: list[str | None] = field(default_factory=list)
    track: list[int] = field(default_factory=list)
    numbers: array[float] = field(default_factory=lambda: array("d"))
    dropped: Counter[str] = field(default_factory=Counter)
    refused: list[tuple[float | None, str | None, str]] = field(default_factory=list)

    def add(self, place: str, time: float, side: str | None, track: int, numbers: Sequence[float]) -> None:
        """A pose that was read.

        :param place: where it is in the file.
        :param time: in the file's unit, finite.
        :param side: ``left``, ``right``, or None where the file does not say.
        :param track: its track.
        :param numbers: 182 of them.
        :raises InputError: the file has more than ``MOST_POSES``.
        """
        self._check_count()
        self.place.append(place)
        self.time.append(time)
        self.side.append(side)
        self.track.append(track)
        self.numbers.extend(numbers)

    def refuse(self, time: float | None, side: str | None, reason: str) -> None:
        """A pose that cannot be read.

        :param time: in the file's unit, where it is known.
        :param side: where it is known.
        :param reason: why, with its place.
        :raises InputError: nearly all of the file is like that, so that no more needs to be read; or more than ``MOST_POSES``.
        """
        self._check_count()
        self.refused.append((time, side, reason))
        if len(self.refused) % HOPELESS == 0:
            self.check_share()

    def reject(self, index: int, reason: str) -> None:
        """A pose that was read and cannot be used.

        :param index: of the pose.
        :param reason: why, to go behind its place.
        """
        self.refused.append((self.time[index], self.side[index], f"{self.place[index]}{reason}"))

    def leave_out(self, what: str) -> None:
        """Something that is no fault of a pose.

        :param what: in words, in the plural.
        :raises InputError: there was more than ``MOST_POSES`` of it.
        """
        self.dropped[what] += 1
        if self.dropped[what] >= MOST_POSES:
            raise InputError(f"the file goes on beyond the allowed {MOST_POSES} {what}")

    def _check_count(self) -> None:
        if len(self.time) + len(self.refused) >= MOST_POSES:
            raise InputError(f"the file goes on beyond the allowed {MOST_POSES} poses")

    def check_share(self, good: int | None = None) -> None:
        """Hold the refused against all.

        :param good: how many of the poses that were read can be used; None: all, as none was rejected yet.
        :raises InputError: they are a large share; the message has the first reason.
        """
        total = len(self.refused) + (len(self.time) if good is None else good)
        if self.refused and too_many_refused(len(self.refused), total):
            many = f" ({len(self.refused)} of {total} poses cannot be used)" if len(self.refused) > 1 else ""
            raise InputError(f"{self.refused[0][2]}{many}")

    def table(self) -> Floats:
        """The poses' numbers.

        :return: (n, 26, 7), as collected.
        """
        return np.frombuffer(self.numbers, float).reshape(-1, len(JOINTS), len(PARTS))

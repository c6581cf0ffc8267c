"""Poses of a file in the order of time, and the tracks that they make."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.scene.hand_files.pose_rows import PoseRows
from haptics.scene.hands.joints import SIDES, Side
from haptics.scene.hands.time_order import in_order, why_not
from haptics.time import LATEST_NS, NS_PER_MS, NS_PER_S

TRACK_GAP_NS = 100 * NS_PER_MS
"""A hand unseen for longer than this comes back as a new track."""
_REPEATED = "poses that repeat a time stamp"


@dataclass(frozen=True, slots=True, eq=False)
class WholePoses:
    """Poses that have all their joints.

    :param index: (n,), of each in the rows that were read.
    :param side: of each.
    :param time_ns: (n,).
    """

    index: NDArray[np.int64]
    side: Sequence[Side]
    time_ns: NDArray[np.int64]

    def only(self, keep: NDArray[np.bool_]) -> WholePoses:
        """Some of them.

        :param keep: (n,), which.
        :return: those.
        """
        sides: list[Side] = [self.side[one] for one in np.flatnonzero(keep).tolist()]
        return WholePoses(self.index[keep], sides, self.time_ns[keep])


def whole_ns(time: Sequence[float], size_ns: int) -> NDArray[np.int64]:
    """Times in nanoseconds.

    :param time: (n,), in a file's unit.
    :param size_ns: the unit, ns.
    :return: (n,); what is beyond ``LATEST_NS`` is set to it, which no recording reaches.
    """
    return np.array([max(-LATEST_NS, min(LATEST_NS, round(value * size_ns))) for value in time], np.int64)


def forward(poses: WholePoses, rows: PoseRows) -> WholePoses:
    """The poses of each hand that go forward in time; of the others, those that repeat a time are counted, the rest refused.

    :param poses: in the order of the file.
    :param rows: where they were read; told of the others.
    :return: those to keep.
    :raises InputError: most of them repeat a time.
    """
    keep = np.ones(len(poses.index), bool)
    for side in SIDES:
        at = np.array([number for number, own in enumerate(poses.side) if own == side], int)
        time_ns = poses.time_ns[at]
        order = in_order(time_ns)
        kept = set(time_ns[order].tolist())
        for number in np.flatnonzero(~order).tolist():
            keep[at[number]] = False
            stamp = int(time_ns[number])
            if stamp in kept:
                rows.dropped[_REPEATED] += 1
                continue
            reason = f": its time {stamp / NS_PER_S:.16g} s {why_not(time_ns, order, number)}"
            rows.reject(int(poses.index[at[number]]), reason)
    if 2 * rows.dropped[_REPEATED] > len(keep):
        raise InputError(f"{rows.dropped[_REPEATED]} of {len(keep)} poses repeat a time of their hand; each needs its own")
    return poses.only(keep)


def runs(poses: WholePoses, track: Sequence[int]) -> Iterator[tuple[Side, list[int]]]:
    """The tracks that poses make: of one side and track of the file, without a gap beyond ``TRACK_GAP_NS``.

    :param poses: those of each hand forward in time.
    :param track: of each of them in the file.
    :return: side and members of each, in the order in which they begin.
    """
    open_runs: dict[tuple[Side, int], list[int]] = {}
    found: list[tuple[Side, list[int]]] = []
    for number in np.argsort(poses.time_ns, kind="stable").tolist():
        key = poses.side[number], track[number]
        run = open_runs.get(key)
        if run is None or poses.time_ns[number] - poses.time_ns[run[-1]] > TRACK_GAP_NS:
            run = open_runs[key] = []
            found.append((poses.side[number], run))
        run.append(number)
    yield from found

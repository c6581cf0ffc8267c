"""Time stamps as trackers write them, and the fewest to leave out so that the rest increases.

A stamp that jumps ahead and comes back must not shut out what follows it, and one that falls back must not move time. So the
fewest are left out: of all increasing sequences in the stamps the longest is kept, the earliest among equals. What is kept
lies within ``LONGEST_S``, and a single stamp at either end, ``ALONE_S`` from its only neighbour, is taken for a broken one.
"""

from __future__ import annotations

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from haptics.time import NS_PER_S, NS_PER_US

LONGEST_S = 3600.0
"""A recording is at most this long; a stamp farther off is a broken one."""
ALONE_S = 10.0
"""A first or last frame this far from all others does not belong to them (assumed)."""


def in_order(time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Choose which stamps to keep, so that they strictly increase; of equal ones the first.

    :param time_ns: (n,), as the tracker wrote them.
    :return: (n,), which to keep.
    """
    keep = np.ones(len(time_ns), bool)
    if len(time_ns) > 1 and not (np.diff(time_ns) > 0).all():
        keep[:] = False
        keep[_longest_sequence(time_ns)] = True
    at = np.flatnonzero(keep)
    kept_ns = time_ns[at]
    reach = np.searchsorted(kept_ns, kept_ns + round(LONGEST_S * NS_PER_S), side="right") - np.arange(len(at))
    first = int(reach.argmax()) if len(at) else 0
    at = at[first : first + int(reach[first])] if len(at) else at
    if len(at) > 2:
        gap_s = np.diff(time_ns[at]) / NS_PER_S
        at = at[int(gap_s[0] > ALONE_S) : len(at) - int(gap_s[-1] > ALONE_S)]
    keep[:] = False
    keep[at] = True
    return keep


def why_not(time_ns: NDArray[np.int64], keep: NDArray[np.bool_], index: int) -> str:
    """In words why a stamp was left out, to stand after "its time stamp".

    :param time_ns: (n,), as the tracker wrote them.
    :param keep: (n,), as ``in_order`` returns it; at least one kept.
    :param index: of the stamp.
    :return: the end of a sentence.
    """
    kept = np.flatnonzero(keep)
    before, after = kept[kept < index], kept[kept > index]
    off_s = (int(time_ns[index]) - int(time_ns[kept[0]])) / NS_PER_S
    if off_s > LONGEST_S:
        return f"is {off_s:.6g} s after the first; must be at most {LONGEST_S:g} s"
    if len(before) and time_ns[index] <= time_ns[before[-1]]:
        return f"goes back; the frame before has {int(time_ns[before[-1]]) / NS_PER_US:.16g} us"
    if len(after) and time_ns[index] >= time_ns[after[0]]:
        return f"lies ahead of the next frame's {int(time_ns[after[0]]) / NS_PER_US:.16g} us"
    return (
        f"is {abs(int(time_ns[index]) - int(time_ns[after[0] if len(after) else before[-1]])) / NS_PER_S:.6g} s from all others"
    )


def _longest_sequence(time_ns: NDArray[np.int64]) -> list[int]:
    """Indices of the longest strictly increasing subsequence; the first of all such in lexicographic order."""
    stamps = time_ns.tolist()
    length = [0] * len(stamps)  # of the longest sequence that begins here
    latest: list[int] = []  # of all sequences of length k + 1 seen so far, minus the latest beginning
    for index in range(len(stamps) - 1, -1, -1):
        at = bisect_left(latest, -stamps[index])
        length[index] = at + 1
        latest[at : at + 1] = [-stamps[index]]
    chosen: list[int] = []
    wanted, before = len(latest), None
    for index, stamp in enumerate(stamps):
        if length[index] == wanted and (before is None or stamp > before):
            chosen.append(index)
            wanted, before = wanted - 1, stamp
    return chosen

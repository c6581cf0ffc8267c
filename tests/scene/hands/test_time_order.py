"""Time stamps out of order: what is left out so that the rest goes on, against trying every choice."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from haptics.scene.hands.time_order import in_order, why_not

S = 10**9


def kept(*time_ns: int) -> list[int]:
    return np.flatnonzero(in_order(np.array(time_ns, np.int64))).tolist()


@pytest.mark.parametrize(
    ("time_ns", "indices"),
    [
        ((), []),
        ((5,), [0]),
        ((0, 9, 18), [0, 1, 2]),
        ((0, 9, 9, 9, 18), [0, 1, 4]),
        ((0, 9, 500 * S, 18, 27), [0, 1, 3, 4]),  # from the future, and back
        ((0, 9, 500 * S, 500 * S + 9, 18, 27, 36), [0, 1, 4, 5, 6]),
        ((0, 9, 3, 18), [0, 1, 3]),  # late
        ((0, 9, 8), [0, 1]),
        ((0, 20_000 * S, 20_000 * S + 9), [1, 2]),  # a first stamp that was never set
        ((0, 9, 5_000 * S), [0, 1]),  # beyond the longest recording
        ((0, 9, 18, 60 * S), [0, 1, 2]),  # alone at the end
        ((0, 60 * S, 60 * S + 9), [1, 2]),  # and at the beginning
        ((0, 9, 60 * S, 60 * S + 9), [0, 1, 2, 3]),  # a gap with frames on both sides is one
        ((100, 109, 118, 127, 0, 9, 18), [0, 1, 2, 3]),  # a clock that began anew: the longer part
    ],
)
def test_the_fewest_are_left_out(time_ns, indices):
    assert kept(*time_ns) == indices


@pytest.mark.slow
@given(st.lists(st.integers(0, 12), max_size=9))
def test_no_choice_keeps_more_and_none_as_many_begins_earlier(stamps):
    found = kept(*stamps)
    ways = [
        way
        for size in range(len(stamps) + 1)
        for way in combinations(range(len(stamps)), size)
        if all(stamps[a] < stamps[b] for a, b in pairwise(way))
    ]
    longest = max(map(len, ways))
    assert tuple(found) == min(way for way in ways if len(way) == longest)


@pytest.mark.parametrize(
    ("stamps", "index", "words"),
    [
        ((0, 9000, 8000), 2, "goes back; the frame before has 9 us"),
        ((0, 9000, 500 * S, 18_000, 27_000), 2, "lies ahead of the next frame's 18 us"),
        ((0, 9000, 5000 * S), 2, "is 5000 s after the first; must be at most 3600 s"),
        ((0, 60 * S, 60 * S + 9), 0, "is 60 s from all others"),
    ],
)
def test_the_reason_is_named(stamps, index, words):
    time_ns = np.array(stamps, np.int64)
    assert words in why_not(time_ns, in_order(time_ns), index)

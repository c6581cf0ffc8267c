"""Bytes on a line: ten bits each at the baud rate, to the nanosecond."""

from __future__ import annotations

import pytest
from hypothesis import given, strategies as st

from firmware_models.boards.ticks import TickCounter, signed_difference
from firmware_models.line.uart import NEVER_NS, Line


def test_each_byte_arrives_ten_bits_after_the_one_before() -> None:
    line = Line(500_000)
    line.send(b"abc", 1000)
    assert [line.waiting(1000 + 20_000 * k - 1) for k in (1, 2, 3)] == [0, 1, 2]
    assert [line.waiting(1000 + 20_000 * k) for k in (1, 2, 3)] == [1, 2, 3]


def test_a_second_burst_waits_for_the_first() -> None:
    line = Line(500_000)
    line.send(b"ab", 0)
    assert line.send(b"c", 5) == 40_000
    assert line.complete_ns(3) == 60_000


def test_wakes_up_at_each_delimiter_only() -> None:
    line = Line(500_000)
    line.send(b"ab\x00cd\x00", 0)
    assert line.next_after(0) == 60_000
    assert line.next_after(60_000) == 120_000
    assert line.next_after(120_000) == NEVER_NS


def test_a_full_receiver_loses_bytes_and_counts_them() -> None:
    line = Line(500_000, capacity=4)
    line.send(b"abcd", 0)
    line.send(b"ef", 0)
    assert line.take(10, 10**9) == b"abcd"
    assert line.lost == 2


def test_what_has_not_left_can_be_forgotten() -> None:
    line = Line(500_000)
    line.send(b"abcd", 0)
    line.drop_unsent(30_000)
    assert line.take(10, 10**9) == b"ab"
    assert line.busy_until_ns == 40_000


@given(
    bursts=st.lists(st.tuples(st.binary(min_size=1, max_size=40), st.integers(0, 10**6)), max_size=8),
    baud=st.sampled_from([9600, 115_200, 500_000]),
    looks=st.lists(st.integers(0, 10**7), max_size=20),
)
def test_reading_at_any_times_gives_each_byte_once_and_when_due(bursts, baud, looks) -> None:
    """Against a byte-by-byte model of the same line."""
    line = Line(baud)
    expected: list[tuple[int, int]] = []
    busy = 0
    for data, gap in bursts:
        start = max(busy, gap)
        assert line.send(data, gap) == start
        expected += [(start + (k + 1) * 10**10 // baud, byte) for k, byte in enumerate(data)]
        busy = start + len(data) * 10**10 // baud
    got = b""
    for now in sorted(looks):
        due = bytes(byte for time, byte in expected if time <= now)
        assert line.waiting(now) == len(due) - len(got)
        got += line.take(7, now)
        assert due.startswith(got)
        got += line.take(1000, now)
        assert got == due


@given(st.integers(0, 2**32 - 1), st.integers(-100_000, 100_000), st.integers(0, 10**13))
def test_a_tick_names_the_first_nanosecond_at_which_it_shows(offset, drift_ppb, elapsed) -> None:
    ticks = TickCounter(17, offset, drift_ppb)
    count = ticks.count(17 + elapsed)
    edge = ticks.time_ns(count)
    assert ticks.count(edge) == count
    assert ticks.count(edge - 1) < count
    assert edge <= 17 + elapsed


@pytest.mark.parametrize(("a", "b", "difference"), [(5, 3, 2), (3, 5, -2), (1, 2**32 - 1, 2), (2**32 - 1, 1, -2)])
def test_tick_differences_take_the_short_way_round(a, b, difference) -> None:
    assert signed_difference(a, b) == difference

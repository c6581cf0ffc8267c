"""What the C brake controller refuses, with which reason, and in which order it looks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest
from brake_bench import OK, BrakeBench, benches, max_dhz
from brake_circuit import ENABLED, NOMINAL_F, POSITIVE, Circuit
from core_bench import MS, in_ticks

from haptics.link.messages import State, Status


@pytest.fixture
def bench(library) -> Iterator[Callable[..., BrakeBench]]:
    yield from benches(library)


def test_refusals_come_in_order_and_say_what_is_wrong(bench) -> None:
    """Each line has a fault of its own and all those of the lines below it."""
    h = bench(Circuit([NOMINAL_F] * 4 + [0.0])).armed()
    late, far = in_ticks(h.now, -3), in_ticks(h.now, 1000.0005)
    rows = [
        ((late, 0x21, 1501, 10_001, 2001), (Status.BAD_VALUE, 1)),  # no such channel
        ((late, 0x10, 1501, 10_001, 2001), (Status.BAD_VALUE, 1)),  # no brake there
        ((late, 0x01, 1501, 10_001, 2001), (Status.BAD_VALUE, 2)),
        ((late, 0x01, 1500, 10_001, 2001), (Status.BAD_VALUE, 3)),
        ((late, 0x01, 10, 10_001, 2001), (Status.BAD_VALUE, 3)),
        ((late, 0x01, 1500, 4, 2001), (Status.BAD_VALUE, 3)),
        ((late, 0x01, 1500, 200, 2001), (Status.BAD_VALUE, 4)),
        ((late, 0x01, 1500, 200, 0), (Status.BAD_VALUE, 4)),
        ((late, 0x01, 1500, 200, 2000), (Status.LATE, 3 * MS // 32)),
        ((far, 0x01, 1500, 200, 2000), (Status.FAR, 0)),
        ((late, 0x21, 0, 0, 0), (Status.LATE, 3 * MS // 32)),  # discharges: only the time counts
        ((far, 0x00, 9999, 0, 0), (Status.FAR, 0)),
    ]
    for values, answer in rows:
        assert h.answer("drive", *values) == answer, values
    for values, answer in (
        ((late, 0, 0), (Status.BAD_VALUE, 1)),
        ((late, 0x20, 0), (Status.BAD_VALUE, 1)),
        ((late, 0x10, 0), (Status.BAD_VALUE, 2)),
        ((late, 0x10, 2001), (Status.BAD_VALUE, 2)),
        ((late, 0x10, 2000), (Status.LATE, 3 * MS // 32)),
        ((far, 0x10, 2000), (Status.FAR, 0)),
    ):
        assert h.answer("piezo", *values) == answer, values
    assert h.edges == []


@pytest.mark.parametrize("mask", [0b1, 0b11, 0b11111])
@pytest.mark.parametrize("volts", [20, 333, 1500])
def test_frequency_goes_up_to_what_the_current_can_charge(bench, mask, volts) -> None:
    h = bench().armed()
    h.ask("identify", seq=0)
    found = h.telemetry().capacitance
    most = max_dhz(sum(found[k] for k in range(5) if mask >> k & 1), volts)
    assert h.answer("drive", in_ticks(h.now, 5), mask, volts, most, 10) == OK
    assert h.answer("drive", in_ticks(h.now, 5), mask, volts, most + 1, 10) == (Status.BAD_VALUE, 3)


def test_charge_is_bounded_whatever_the_capacitance(library) -> None:
    """45 uC: five outputs of 6.1 nF at 1475 V, and no more."""
    h = BrakeBench(library, Circuit([6.1e-9] * 5), nominal_pf=6000).armed()
    h.ask("identify", seq=0)
    most = math.floor(45e6 / sum(h.telemetry().capacitance))
    assert most == pytest.approx(1475, rel=0.01)
    assert h.answer("drive", in_ticks(h.now, 5), 31, most + 1, 5, 10) == (Status.BAD_VALUE, 2)
    assert h.answer("drive", in_ticks(h.now, 5), 31, most, 5, 10) == OK
    h.close()


def test_limits_that_a_host_made_stricter_count(bench) -> None:
    h = bench()
    assert h.answer("configure", (900, 250, 1000, 100, 45_000)) == OK
    h.armed()
    assert h.answer("drive", in_ticks(h.now, 5), 1, 901, 200, 100) == (Status.BAD_VALUE, 2)
    assert h.answer("drive", in_ticks(h.now, 5), 1, 100, 1001, 100) == (Status.BAD_VALUE, 3)
    assert h.answer("drive", in_ticks(h.now, 5), 1, 900, max_dhz(2 * 2600, 900), 100) == OK
    assert h.answer("drive", in_ticks(h.now, 5), 1, 900, max_dhz(2 * 2500, 900), 101) == (Status.BAD_VALUE, 3)
    assert h.answer("drive", in_ticks(h.now, 5), 1, 900, 100, 101) == (Status.BAD_VALUE, 4)
    assert h.answer("piezo", in_ticks(h.now, 5), 1, 101) == (Status.BAD_VALUE, 2)


def test_eight_drives_wait_and_the_ninth_finds_no_place(bench) -> None:
    h = bench().armed()
    order = [5, 2, 7, 1, 8, 3, 6, 4]
    begun = h.now
    for k in order:
        h.drive(10 * k, 1, 100 * k, 200, 9)
    late = in_ticks(h.now, -1)
    assert h.answer("drive", in_ticks(h.now, 1), 1, 100, 200, 10) == (Status.FULL, 0)
    assert h.answer("drive", late, 1, 100, 200, 10)[0] == Status.LATE
    assert h.answer("drive", in_ticks(h.now, 1), 0, 0, 0, 0) == (Status.FULL, 0)
    h.live(100 * MS)
    on = [(tick, word >> 16) for (tick, word), (_, last) in zip(h.edges[1:], h.edges, strict=False) if word and not last]
    assert [(begun + 10 * MS, 100), *on] == [(begun + 10 * k * MS, 100 * k) for k in range(1, 9)]


def test_of_two_drives_for_one_tick_the_later_one_counts(bench) -> None:
    h = bench().armed()
    h.drive(10, 1, 100, 200, 50)
    at = h.drive(10, 1, 300, 200, 20)
    h.live(60 * MS)
    assert h.edges[0] == (at, 1 | ENABLED | POSITIVE | 300 << 16)
    assert h.edges[-1] == (at + 20 * MS, 0)


def test_nothing_is_taken_before_the_self_test_is_over_and_everything_while_discharging(bench) -> None:
    h = bench()
    for name, values in (("drive", (0, 1, 100, 200, 10)), ("piezo", (0, 1, 10))):
        assert h.answer(name, *values) == (Status.INTERLOCK, 0)
    h.arm()
    assert h.answer("drive", in_ticks(h.now, 5), 1, 100, 200, 10) == (Status.INTERLOCK, 0)
    assert h.answer("piezo", in_ticks(h.now, 5), 1, 10) == (Status.INTERLOCK, 0)
    h.run_until(State.ARMED, 50)
    start = h.drive(1, 1, 1500, 200, 20)
    h.run(start + 20 * MS + 20 - h.now)
    assert h.state == State.DISCHARGING
    assert h.answer("piezo", in_ticks(h.now, 1), 1, 10) == OK
    assert h.answer("drive", in_ticks(h.now, 1), 2, 1000, 200, 10) == OK

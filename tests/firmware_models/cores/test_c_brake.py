"""The C core's brake controller: a wave exact to the tick for ever, whatever comes between, and an end when it must end."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import pairwise

import pytest
from brake_bench import BRIDGE, NOMINAL_PF, OK, BrakeBench, benches, reversals
from brake_circuit import ALL, ENABLED, NEGATIVE, POSITIVE, Circuit
from core_bench import MS, WRAP, in_ticks

from haptics.link.messages import Fault, State, Status

PIEZOS = ALL << 5


@pytest.fixture
def bench(library) -> Iterator[Callable[..., BrakeBench]]:
    yield from benches(library)


# The wave.


WAVES = [(5, 1500), (73, 700), (200, 1500), (333, 300), (1237, 400), (9999, 20), (10_000, 20), (7001, 20)]
"""0.1 Hz and V: half periods that are whole numbers of ticks, and such that leave a remainder of many sizes."""


@pytest.mark.slow
@pytest.mark.parametrize(("dhz", "volts"), WAVES)
def test_reversals_are_exact_and_the_wave_is_symmetrical(bench, dhz, volts) -> None:
    """150 reversals or more: a remainder lost in each, of 0.03 ticks at least, would be beyond the 2 ticks allowed. Of the
    slowest wave, which has no remainder, 15 are enough.
    """
    check_reversals(bench(), dhz, volts, seconds=min(15.0, max(2.0, 750 / dhz)))


@pytest.mark.soak
@pytest.mark.parametrize(("dhz", "volts"), WAVES)
def test_reversals_are_exact_for_ever(bench, dhz, volts) -> None:
    check_reversals(bench(), dhz, volts, seconds=min(180.0, 36_000 / dhz))


def check_reversals(h: BrakeBench, dhz: int, volts: int, seconds: float) -> None:
    """Reversal k, which begins with the clamp, is due at (k + 1/2) half periods; a half period is rounded to a tick, as is the
    one that pays it back.
    """
    h.armed()
    start = h.now + MS
    h.hold(seconds * 1000, 1, volts, dhz, each_ms=90)
    assert h.state == State.DRIVING
    half = Fraction(10_000_000, dhz)
    turned = reversals(h.edges)
    clamp = min(int(half / 10), MS)
    assert turned[0] == (start, POSITIVE)
    assert len(turned) == math.ceil((h.now - start - half / 2 - clamp) / half) + 1
    for k, (tick, polarity) in enumerate(turned[1:]):
        assert abs(tick - clamp - (start + (k + Fraction(1, 2)) * half)) <= 2
        assert polarity == (POSITIVE if k % 2 else NEGATIVE)
    lengths = [b - a for (a, _), (b, _) in pairwise(turned)]
    assert all(negative == positive for negative, positive in zip(lengths[1::2], lengths[2::2], strict=False))
    words = [(tick, word & ~PIEZOS) for tick, word in h.edges]
    expected = [(start, POSITIVE)]
    for tick, polarity in turned[1:]:
        expected += [(tick - clamp, 0), (tick, polarity)]
    assert [(tick, word & BRIDGE) for tick, word in words][: len(expected)] == expected
    assert {word & ~BRIDGE for _, word in words} == {1 | ENABLED | volts << 16}


def test_a_renewed_drive_goes_on_in_its_phase_whatever_its_amplitude(bench) -> None:
    """A higher amplitude counts at once, a lower one by the next reversal; the edges are those of one long drive."""
    rng = random.Random(3)
    h = bench().armed()
    start = h.drive(5, 0b11, 600, 170, 2000)
    amplitudes = [(start, 600)]
    while h.now < start + 1500 * MS:
        h.run(rng.randrange(1, 30 * MS))
        volts = rng.choice((300, 500, 600, 700))
        amplitudes.append((h.drive(rng.uniform(0, 40), 0b11, volts, 170, 500), volts))
        if len(amplitudes) % 8 == 0:
            h.run(40 * MS)  # lets the queue run empty
    amplitudes.sort(key=lambda row: row[0])
    half = Fraction(10_000_000, 170)
    turned = reversals(h.edges)
    bridge = [tick for (tick, polarity), (_, before) in zip(turned[1:], turned, strict=False) if polarity != before]
    clamp = min(int(half / 10), MS)
    assert len(bridge) > 45  # 34 a second
    for k, tick in enumerate(bridge):
        assert abs(tick - clamp - (start + (k + Fraction(1, 2)) * half)) <= 2
    for tick, word in h.edges:
        wanted = [volts for at, volts in amplitudes if at <= tick]
        assert word & ALL == 0b11
        assert word >> 16 == wanted[-1]


def test_a_drive_ends_at_its_tick_unless_another_comes_by_then(bench) -> None:
    h = bench().armed()
    start = h.drive(3, 1, 800, 200, 30)
    h.drive(33, 1, 500, 200, 7)
    h.run(80 * MS)
    assert (start + 30 * MS, 1 | ENABLED | NEGATIVE | 500 << 16) in h.edges
    assert h.edges[-1] == (start + 37 * MS, 0)
    assert [word for _, word in h.edges if not word & ALL] == [0]


def test_a_drive_that_is_shorter_than_the_one_it_replaces_ends_at_its_own_tick(bench) -> None:
    h = bench().armed()
    start = h.drive(3, 1, 800, 200, 1000)
    h.drive(33, 1, 800, 200, 7)
    h.run(80 * MS)
    assert h.edges[-1] == (start + 37 * MS, 0)
    h.live(1000 * MS)
    assert h.edges[-1] == (start + 37 * MS, 0)


@pytest.mark.parametrize("other", [(0b10, 400, 200), (0b11, 400, 200), (1, 400, 210)])
def test_any_other_drive_shorts_all_first_and_begins_2_ms_after(bench, other) -> None:
    mask, volts, dhz = other
    h = bench().armed()
    h.drive(2, 1, 800, 200, 1000)
    at = h.drive(30, *other, 100)
    h.live(140 * MS)
    before = [edge for edge in h.edges if edge[0] < at]
    after = [edge for edge in h.edges if edge[0] >= at]
    assert before[-1][1] & ALL == 1
    assert after[0] == (at, 0)
    assert after[1] == (at + 2 * MS, mask | ENABLED | POSITIVE | volts << 16)
    half = 10_000_000 / dhz
    turned = reversals(after)
    assert turned[1][0] == pytest.approx(at + 2 * MS + half / 2 + MS, abs=2)
    assert h.edges[-1] == (at + 100 * MS, 0)


def test_a_drive_while_it_discharges_begins_2_ms_after_its_tick(bench) -> None:
    h = bench().armed()
    start = h.drive(2, 1, 1500, 200, 20)
    h.run(start + 20 * MS - h.now)
    h.run(20)
    assert h.state == State.DISCHARGING
    at = h.drive(0, 1, 1500, 200, 50)
    h.run(10 * MS)
    assert h.state == State.DRIVING
    assert h.edges[-1] == (at + 2 * MS, 1 | ENABLED | POSITIVE | 1500 << 16)


def test_a_drive_that_is_over_before_it_could_begin_energises_nothing(bench) -> None:
    h = bench().armed()
    h.drive(2, 1, 800, 200, 1000)
    at = h.drive(30, 2, 800, 200, 2)
    h.run(50 * MS)
    assert h.edges[-1] == (at, 0)
    assert h.state == State.ARMED


@pytest.mark.parametrize("nothing", [(0, 500), (1, 0), (0x80, 0)])
def test_no_outputs_or_no_volts_discharge(bench, nothing) -> None:
    mask, volts = nothing
    h = bench().armed()
    h.drive(1, 1, 1500, 200, 1000)
    h.run(30 * MS)
    at = h.drive(0, mask, volts, 200, 500)
    h.run(1)
    assert h.edges[-1] == (at, 0)
    assert h.state == State.DISCHARGING
    assert h.run_until(State.ARMED, 1) < MS
    h.circuit.advance(h.now)
    assert max(map(abs, h.circuit.volts)) < 60


def test_bursts_and_drives_cross_without_moving_each_other(bench) -> None:
    """Every edge of both at its tick, by brute force: bursts that overlap, on fingers of their own and the same."""
    rng = random.Random(7)
    h = bench().armed()
    start = h.drive(2, 0b10101, 120, 1111, 2000)
    bursts: list[tuple[int, int, int]] = []
    for _ in range(60):
        at = h.now + rng.randrange(0, 25 * MS)
        mask, ms = rng.randrange(1, 32), rng.randrange(1, 30)
        full = sum(end > h.now for _, end, _ in bursts) == 8
        answer = h.answer("piezo", at % WRAP, mask, ms)
        assert answer == ((Status.FULL, 0) if full else OK)
        if not full:
            bursts.append((at, at + ms * MS, mask))
        h.run(rng.randrange(0, 8 * MS))
    h.live(60 * MS)
    assert len(bursts) > 40
    word, shown = 0, []
    for tick in sorted({t for a, b, _ in bursts for t in (a, b)}):
        now = 0
        for a, b, mask in bursts:
            now |= mask << 5 if a <= tick < b else 0
        if now != word:
            shown.append((tick, now))
        word = now
    seen, word = [], 0
    for tick, now in dict(h.edges).items():
        if now & PIEZOS != word:
            seen.append((tick, now & PIEZOS))
        word = now & PIEZOS
    assert seen == shown
    half = Fraction(10_000_000, 1111)
    turned = [(tick, p) for (tick, p), (_, q) in zip(reversals(h.edges)[1:], reversals(h.edges), strict=False) if p != q]
    assert len(turned) > 50
    for k, (tick, _) in enumerate(turned):
        assert abs(tick - int(half / 10) - (start + (k + Fraction(1, 2)) * half)) <= 2


def test_bursts_that_begin_and_end_together_are_one_edge(bench) -> None:
    h = bench().armed()
    at = h.now + 10 * MS
    for start, mask, ms in ((at - 5 * MS, 0b10000, 5), (at, 0b00001, 5), (at, 0b00110, 9), (at + 5 * MS, 0b01001, 4)):
        assert h.answer("piezo", start % WRAP, mask, ms) == OK
        h.run(6 * MS if start < at else MS)  # the first has begun when the others come: its end is the next edge
    h.run(40 * MS)
    words = [(-5, 0b10000), (0, 0b00111), (5, 0b01111), (9, 0)]
    assert h.edges == [(at + ms * MS, mask << 5) for ms, mask in words]


def test_cutting_time_differently_changes_nothing(library) -> None:
    def play(cut: Callable[[BrakeBench, int], None]) -> tuple[list, list]:
        h = BrakeBench(library)
        h.ask("identify", seq=0)
        h.armed()
        rng = random.Random(11)
        for _ in range(25):
            h.send("drive", in_ticks(h.now, rng.uniform(0, 20)), 1, rng.randrange(100, 1500), rng.choice((200, 300)), 40)
            h.send("piezo", in_ticks(h.now, rng.uniform(0, 20)), rng.randrange(1, 32), rng.randrange(1, 20))
            cut(h, rng.randrange(1, 20 * MS))
        cut(h, 90 * MS)
        sent, edges = h.sent, h.edges
        h.close()
        return sent, edges

    def in_pieces(h: BrakeBench, ticks: int) -> None:
        rng = random.Random(ticks)
        while ticks:
            step = min(ticks, rng.choice((1, 7, 100, 1999)))
            h.run(step)
            ticks -= step

    sent, edges = play(lambda h, ticks: h.run(ticks))
    assert play(in_pieces) == (sent, edges)
    assert len(edges) > 50


# What ends everything.


@pytest.mark.parametrize("command", ["stop", "disarm"])
def test_stop_passes_the_queue_and_empties_it(bench, command) -> None:
    h = bench().armed()
    h.drive(1, 31, 1000, 50, 1000)
    h.drive(400, 1, 1500, 200, 1000)
    assert h.answer("piezo", in_ticks(h.now, 3), 31, 1000) == OK
    h.run(30 * MS)
    assert h.answer(command) == OK
    assert h.edges[-1] == (h.now, 0)
    assert h.state == State.DISCHARGING
    assert h.run_until(State.DISARMED, 2) <= 2 * MS
    h.circuit.advance(h.now)
    assert max(map(abs, h.circuit.volts)) < 60
    edges = len(h.edges)
    h.live(1200 * MS)
    assert (len(h.edges), h.state, h.faults) == (edges, State.DISARMED, 0)


@pytest.mark.parametrize("when", [State.SELF_TEST, State.ARMED, State.DRIVING, State.DISCHARGING])
def test_the_dead_man_makes_safe_from_every_state(bench, when) -> None:
    h = bench()
    if when != State.SELF_TEST:
        h.armed()
    else:
        h.arm()
    heard = h.now
    h.send("keepalive", seq=0)
    if when == State.DRIVING:
        h.drive(1, 1, 1500, 200, 2000)
    if when == State.DISCHARGING:
        h.drive(1, 1, 1500, 200, 80)
    h.run(99 * MS)
    assert h.faults == 0
    h.run(MS)
    assert h.fault() == (Fault.DEAD_MAN, 255, 100)
    assert all(tick <= heard + 100 * MS for tick, _ in h.edges)
    h.run(MS)
    h.circuit.advance(h.now)
    assert max(map(abs, h.circuit.volts)) < 60
    assert h.answer("disarm") == OK
    h.armed()


def test_a_discharge_that_does_not_come_in_5_ms_latches(bench) -> None:
    h = bench(Circuit(short_ohm=20e6)).armed()
    start = h.drive(1, 0b100, 1500, 200, 50)
    h.run(start + 50 * MS - h.now)
    h.run(4 * MS)
    assert h.state == State.DISCHARGING
    h.run(3 * MS // 2)
    fault, channel, value = h.fault()
    assert (fault, channel) == (Fault.BRIDGE_STUCK, 2)
    assert 1200 < value <= 1500
    assert h.answer("disarm") == (Status.OK, 1 << Fault.BRIDGE_STUCK)
    h.run(400 * MS)
    assert h.state == State.FAULT
    assert h.answer("disarm") == OK
    assert h.state == State.DISARMED


def test_an_output_that_is_charged_at_rest_latches(bench) -> None:
    h = bench().armed()
    h.circuit.short_ohm = 1e9
    h.circuit.volts[3] = 90.0
    h.run(6 * MS)
    assert h.fault() == (Fault.OVER_VOLTAGE, 3, 90)


# Telemetry.


def test_telemetry_shows_the_amplitude_reached_and_what_waits(bench) -> None:
    h = bench().armed()
    h.ask("identify", seq=0)
    for volts in (40, 350, 1500):
        h.hold(300, 0b10010, volts, 100)
        h.drive(1, 0b10010, volts, 100, 200)
        h.drive(500, 0b10010, volts, 100, 10)
        assert h.answer("piezo", in_ticks(h.now, 500), 1, 10) == OK
        for _ in range(3):  # wherever in a half period
            seen = h.telemetry()
            assert seen.state == State.DRIVING
            assert seen.output == (0, pytest.approx(volts, abs=2), 0, 0, pytest.approx(volts, abs=2))
        seen = h.telemetry()
        assert seen.capacitance == pytest.approx([NOMINAL_PF] * 5, rel=0.01)
        assert seen.bus == pytest.approx(volts, abs=2)
        assert seen.supply_current <= 500
        assert seen.queued == 2
        assert h.answer("stop") == OK
        h.run(5 * MS)
        h.armed()
    seen = h.telemetry()
    assert seen.output == (0, 0, 0, 0, 0)
    assert (seen.state, seen.bus, seen.supply_current, seen.queued) == (State.ARMED, 0, 0, 0)

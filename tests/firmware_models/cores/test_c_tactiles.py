"""The C core's coil board: every edge at its tick, every refusal with its reason, guards that trip on faults only."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest
from core_bench import BOOT_ID, BUILT, FEED, MS, SUPPLY, WRAP, Bench, frame, in_ticks

from haptics.link.messages import BY_NAME, Board, Fault, State, Status, encode

TEN_MS = [200] * 15
ALL = 0x7FFF
UNIT = 100  # ticks of a duration's 50 us
COIL_MA = 3623  # 5 V on 1.38 ohm


@pytest.fixture
def bench(library) -> Iterator[Callable[..., Bench]]:
    opened: list[Bench] = []

    def open_bench(*args, **kwargs) -> Bench:
        opened.append(Bench(library, *args, **kwargs))
        h = opened[-1]
        h.senses = lambda channel: 500 if channel == SUPPLY else coils_on(h.word) * COIL_MA // 64
        return h

    yield open_bench
    for one in opened:
        one.close()


def settled(edges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The outputs at the end of each tick that changed them: a command may come at the very tick of an edge and add one."""
    found: list[tuple[int, int]] = []
    for tick, word in dict(edges).items():
        if not found or word != found[-1][1]:
            found.append((tick, word))
    return found


def coils_on(word: int) -> int:
    return bin(word & ALL).count("1")


class Pulse(NamedTuple):
    channel: int
    start: int
    end: int
    toward_skin: bool


class Schedule:
    """What a coil board must answer and do, by brute force: every accepted pulse is kept for ever, every moment looked at."""

    def __init__(self, longest: int, max_on: int, places: int):
        self.pulses: list[Pulse] = []
        self._longest, self._max_on, self._places = longest, max_on, places

    def answer(self, now: int, start: int, channels: int, toward_skin: int, durations: list[int]) -> tuple[Status, int]:
        chosen = [k for k in range(16) if channels >> k & 1]
        if not chosen or chosen[-1] == 15:
            return Status.BAD_VALUE, 1
        if any(not 1 <= durations[k] <= self._longest for k in chosen):
            return Status.BAD_VALUE, 3
        if start < now:
            return Status.LATE, min((now - start) // 32, 65535)
        if start > now + 1000 * MS:
            return Status.FAR, 0
        if sum(p.start > now for p in self.pulses) + len(chosen) > self._places:
            return Status.FULL, 0
        new = [Pulse(k, start, start + UNIT * durations[k], bool(toward_skin >> k & 1)) for k in chosen]
        taken = {a.channel for a in new for b in self.pulses if a.channel == b.channel and a.start < b.end and b.start < a.end}
        if taken:
            return Status.FULL, sum(1 << k for k in taken)
        together = self.pulses + new
        moments = {start} | {p.start for p in self.pulses if p.start >= start}
        if any(
            sum(p.start <= m < p.end for p in together) > self._max_on for m in moments if any(p.start <= m < p.end for p in new)
        ):
            return Status.FULL, 0x8000
        self.pulses = together
        return Status.OK, 0

    def edges(self, armed: int) -> list[tuple[int, int]]:
        """Every change of the output word, from arming on."""
        found, word = [(armed, FEED)], FEED
        for tick in sorted({p.start for p in self.pulses} | {p.end for p in self.pulses}):
            on = [p for p in self.pulses if p.start <= tick < p.end]
            now = FEED | sum(1 << p.channel | p.toward_skin << (16 + p.channel) for p in on)
            if now != word:
                found.append((tick, now))
            word = now
        return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "max_on", "longest", "ahead_ms"),
    [
        (1, 3, 200, 40),
        (2, 3, 20, 12),
        (3, 3, 3, 3),
        (4, 2, 200, 60),
        (5, 1, 50, 20),
        (6, 3, 200, 1),
        (7, 3, 200, 400),
        (8, 0, 200, 20),
    ],
)
def test_replies_and_edges_are_those_of_a_brute_force_schedule(bench, seed, max_on, longest, ahead_ms) -> None:
    """Random and crowded, across the wrap of the clock: each reply, and every change of the outputs to the tick."""
    rng = random.Random(seed)
    limits = (longest, max_on * 3907 + 40, 64, 3000, 2500)
    h = bench(start=WRAP - 300 * MS, limits=limits)
    schedule = Schedule(longest, max_on, 64)
    h.arm()
    armed = h.now
    answers: dict[Status, int] = {}
    for _ in range(1500):
        start = h.now + rng.choice((0, 1, 100, 20_000, rng.randrange(-200, 200), round(rng.uniform(-0.02, 1) * ahead_ms * MS)))
        start += rng.choice((0, 0, 0, 0, 2_000_000))
        start -= start % rng.choice((1, 1, 100, 2000))
        channels = 1 << rng.randrange(15) | rng.choice((0, 0, 1 << rng.randrange(16), rng.randrange(1 << 16)))
        channels *= rng.random() > 0.01
        durations = [rng.choice((1, longest, rng.randrange(1, longest + 1))) for _ in range(15)]
        if rng.random() < 0.02:
            durations[rng.randrange(15)] = rng.choice((0, longest + 1, 255))
        toward_skin = rng.randrange(1 << 15)
        expected = schedule.answer(h.now, start, channels, toward_skin, durations)
        assert h.answer("pulse", start % WRAP, channels, toward_skin, durations) == expected
        answers[expected[0]] = answers.get(expected[0], 0) + 1
        h.run(rng.choice((0, 1, rng.randrange(100), rng.randrange(2000), rng.randrange(12_000))))
    h.live(1100 * MS)
    assert settled(h.edges) == schedule.edges(armed)
    assert max(coils_on(word) for _, word in h.edges) == max_on
    assert set(answers) == set(Status) - {
        Status.UNKNOWN,
        Status.BAD_LENGTH,
        Status.INTERLOCK,
        Status.HOT,
        *([Status.OK] if not max_on else []),
    }
    h.ask("identify", seq=0)
    telemetry = h.telemetry()
    assert telemetry.late == answers[Status.LATE]
    assert telemetry.queued == 0
    assert list(telemetry.played) == [sum(p.channel == k for p in schedule.pulses) for k in range(15)]
    assert h.faults == 0


def test_edges_of_one_tick_are_one_word(bench) -> None:
    h = bench()
    h.arm()
    start = h.now + 5 * MS
    assert h.answer("pulse", start, 0b011, 0b001, TEN_MS) == (Status.OK, 0)
    assert h.answer("pulse", start + 10 * MS, 0b110, 0b010, TEN_MS) == (Status.OK, 0)
    h.edges.clear()
    h.run(40 * MS)
    assert h.edges == [
        (start, FEED | 0b011 | 0b001 << 16),
        (start + 10 * MS, FEED | 0b110 | 0b010 << 16),
        (start + 20 * MS, FEED),
    ]


def test_an_earlier_pulse_that_comes_later_is_played_first(bench) -> None:
    h = bench()
    h.arm()
    now = h.now
    for ms in (30, 20, 10, 1):
        assert h.answer("pulse", now + ms * MS, 1, 0, [20] * 15) == (Status.OK, 0)
    h.edges.clear()
    h.run(50 * MS)
    assert [tick - now for tick, _ in h.edges] == [k * MS for k in (1, 2, 10, 11, 20, 21, 30, 31)]


def test_a_pulse_for_now_begins_now(bench) -> None:
    h = bench()
    h.arm()
    assert h.answer("pulse", h.now, 1, 1, [1] * 15) == (Status.OK, 0)
    assert h.edges[-1] == (h.now, FEED | 1 | 1 << 16)


@pytest.mark.parametrize(
    ("ahead", "answer"),
    [
        (0, (Status.OK, 0)),
        (2_000_000, (Status.OK, 0)),
        (2_000_001, (Status.FAR, 0)),
        (-1, (Status.LATE, 0)),
        (-32, (Status.LATE, 1)),
        (-128, (Status.LATE, 4)),
        (-32 * 65_535, (Status.LATE, 65_535)),
        (-(1 << 31), (Status.LATE, 65_535)),
        ((1 << 31) - 1, (Status.FAR, 0)),
    ],
)
@pytest.mark.parametrize("start", [1_000_000, WRAP - 10, 1 << 31])
def test_late_and_far_to_the_tick(bench, ahead, answer, start) -> None:
    h = bench(start=start)
    h.arm()
    assert h.answer("pulse", (h.now + ahead) % WRAP, 1, 1, TEN_MS) == answer


def test_the_first_thing_wrong_is_the_answer(bench) -> None:
    """Each row of the page's list is met with everything below it wrong as well."""
    h = bench()
    late, nothing, both = h.now - 1, 0, 0b11
    assert h.answer("pulse", late, nothing, 0, [0] * 15) == (Status.INTERLOCK, 0)
    h.arm()
    assert h.answer("pulse", late, nothing, 0, [0] * 15) == (Status.BAD_VALUE, 1)
    assert h.answer("pulse", late, 1 << 15 | 1, 0, [0] * 15) == (Status.BAD_VALUE, 1)
    assert h.answer("pulse", late, 1, 0, [0] * 15) == (Status.BAD_VALUE, 3)
    assert h.answer("pulse", late, 1, 0, [201] * 15) == (Status.BAD_VALUE, 3)
    start = h.now + 20 * MS
    for k in range(30):
        assert h.answer("pulse", start + k * 10 * MS, both, 0, TEN_MS) == (Status.OK, 0)
    assert h.answer("pulse", start, 0b111, 0, TEN_MS) == (Status.FULL, 0b011)
    assert h.answer("pulse", start + 700 * MS, both, 0, TEN_MS) == (Status.OK, 0)
    assert h.answer("pulse", start, 0b111, 0, TEN_MS) == (Status.FULL, 0)  # 62 and 3 are more than 64
    assert h.answer("pulse", late, 0b111, 0, TEN_MS) == (Status.LATE, 0)
    assert h.answer("cancel", 0b01) == (Status.OK, 31)
    assert h.answer("pulse", start, 0b1111, 0, TEN_MS) == (Status.FULL, 0b0010)
    assert h.answer("pulse", start, 0b11101, 0, TEN_MS) == (Status.FULL, 0x8000)
    assert h.answer("pulse", start, 0b01101, 0, TEN_MS) == (Status.FULL, 0x8000)
    assert h.answer("pulse", start, 0b00101, 0, TEN_MS) == (Status.OK, 0)


def test_a_latched_fault_is_the_detail_of_the_interlock(bench) -> None:
    h = bench()
    h.arm()
    h.run(101 * MS)
    assert h.answer("pulse", h.now, 1, 0, TEN_MS) == (Status.INTERLOCK, 1 << Fault.DEAD_MAN)


def test_the_queue_takes_as_many_as_its_limit_besides_those_that_are_on(bench) -> None:
    h = bench()
    h.arm()
    start = h.now
    assert h.answer("pulse", start, 0b111, 0, TEN_MS) == (Status.OK, 0)  # on at once
    for k in range(1, 22):
        assert h.answer("pulse", start + k * 20_000, 0b111, 0, TEN_MS) == (Status.OK, 0)
    assert h.answer("pulse", start + 900 * MS, 0b11, 0, TEN_MS) == (Status.FULL, 0)
    assert h.answer("pulse", start + 900 * MS, 0b01, 0, TEN_MS) == (Status.OK, 0)
    assert h.answer("pulse", start + 950 * MS, 0b01, 0, TEN_MS) == (Status.FULL, 0)
    h.ask("identify", seq=0)
    h.run(21 * MS)
    assert h.all("tactiles_telemetry")[0].message.queued == 58  # 64 less those of two times
    small = bench(limits=(200, 12_000, 4, 3000, 2500))
    small.arm()
    assert small.answer("pulse", small.now + MS, 0b111, 0, TEN_MS) == (Status.OK, 0)
    assert small.answer("pulse", small.now + 20 * MS, 0b11, 0, TEN_MS) == (Status.FULL, 0)
    assert small.answer("pulse", small.now + 20 * MS, 0b01, 0, TEN_MS) == (Status.OK, 0)


@pytest.mark.parametrize("seed", range(6))
def test_cancel_forgets_what_has_not_begun_and_nothing_else(bench, seed) -> None:
    rng = random.Random(seed)
    h = bench()
    schedule = Schedule(200, 3, 64)
    h.arm()
    armed = h.now
    for _ in range(300):
        start, channel = h.now + rng.randrange(100_000), rng.randrange(15)
        expected = schedule.answer(h.now, start, 1 << channel, 0, TEN_MS)
        assert h.answer("pulse", start, 1 << channel, 0, TEN_MS) == expected
        h.run(rng.randrange(4000))
        if rng.random() < 0.2:
            channels = rng.randrange(1 << 16)
            gone = [p for p in schedule.pulses if p.start > h.now and channels >> p.channel & 1]
            assert h.answer("cancel", channels) == (Status.OK, len(gone))
            schedule.pulses = [p for p in schedule.pulses if p not in gone]
    h.live(100 * MS)
    assert settled(h.edges) == schedule.edges(armed)


def test_cancel_needs_no_arming(bench) -> None:
    assert bench().answer("cancel", ALL) == (Status.OK, 0)


@pytest.mark.parametrize("how", ["stop", "disarm", "silence"])
def test_however_it_ends_nothing_is_on_and_nothing_comes_after(bench, how) -> None:
    h = bench()
    h.arm()
    for k in range(20):
        assert h.answer("pulse", h.now + (96 + 20 * k) * MS, 0b101, 0b001, TEN_MS) == (Status.OK, 0)
    h.run(98 * MS)
    assert coils_on(h.word) == 2
    if how == "silence":
        h.run(2 * MS)
        assert h.state == State.FAULT
    else:
        assert h.answer(how) == (Status.OK, 0)
    assert h.edges[-1] == (h.now, 0)
    h.live(1000 * MS)
    assert h.word == 0
    h.answer("disarm")
    h.arm()
    assert h.answer("pulse", h.now + MS, 0b111, 0, TEN_MS) == (Status.OK, 0)  # every place is free again
    h.ask("identify", seq=0)
    assert h.telemetry().played[:3] == (2, 1, 2)


def test_arming_needs_the_coil_supply(bench) -> None:
    h = bench()
    supply = 299
    h.senses = lambda channel: supply if channel == SUPPLY else 0
    assert h.answer("arm", BOOT_ID) == (Status.INTERLOCK, 1 << Fault.SUPPLY)
    assert (h.state, h.faults, h.edges) == (State.DISARMED, 0, [])
    supply = 300
    h.arm()


def test_a_supply_below_its_least_latches_within_a_look(bench) -> None:
    h = bench(limits=(200, 12_000, 64, 4500, 2500))
    supply = 450
    h.senses = lambda channel: supply if channel == SUPPLY else 0
    h.arm()
    h.run(50 * MS)
    assert h.faults == 0
    supply = 449
    h.run(MS)
    assert (h.state, h.faults, h.word) == (State.FAULT, 1 << Fault.SUPPLY, 0)
    assert h.all("fault")[-1].message[1:] == (Fault.SUPPLY, 255, 4490)
    assert h.answer("disarm") == (Status.OK, 1 << Fault.SUPPLY)  # its cause is there still
    assert h.state == State.FAULT
    supply = 450
    assert h.answer("disarm") == (Status.OK, 0)
    h.arm()


def test_current_beyond_what_the_coils_can_draw_latches_after_two_milliseconds(bench) -> None:
    """One coil draws 3.9 A at most, and the guard allows a quarter and 200 mA more: 5.08 A, the 79th count of 64 mA."""
    for counts, trips in ((79, False), (80, True)):
        h = bench()
        h.senses = lambda channel, h=h, counts=counts: 500 if channel == SUPPLY else counts * coils_on(h.word)
        h.arm()
        start = h.now + 5 * MS
        assert h.answer("pulse", start, 1, 1, TEN_MS) == (Status.OK, 0)
        h.run(20 * MS)
        assert h.faults == (1 << Fault.COIL_CURRENT if trips else 0)
        if trips:
            assert 2 * MS <= h.edges[-1][0] - start <= 4 * MS
            assert h.all("fault")[-1].message[1:] == (Fault.COIL_CURRENT, 255, 80 * 64)


def test_a_short_excess_of_current_is_let_pass(bench) -> None:
    h = bench()
    h.senses = lambda channel: 500 if channel == SUPPLY else 200 * coils_on(h.word)
    h.arm()
    for k in range(10):
        assert h.answer("pulse", h.now + (5 + 5 * k) * MS, 1, 1, [30] * 15) == (Status.OK, 0)  # 1.5 ms each
    h.run(90 * MS)
    assert h.faults == 0
    assert len(h.edges) == 21


def test_current_above_the_limit_latches_whatever_is_on(bench) -> None:
    h = bench(limits=(200, 4000, 64, 3000, 2500))
    h.senses = lambda channel: 500 if channel == SUPPLY else 63 * coils_on(h.word)  # 4032 mA
    h.arm()
    assert h.answer("pulse", h.now + MS, 1, 1, TEN_MS) == (Status.OK, 0)
    h.run(10 * MS)
    assert h.faults == 1 << Fault.COIL_CURRENT


@pytest.mark.parametrize("longest", [200, 60])
def test_a_driver_that_sticks_is_told_from_a_coil_that_is_on(bench, longest) -> None:
    h = bench(limits=(longest, 12_000, 64, 3000, 2500))
    stuck = False
    h.senses = lambda channel: 500 if channel == SUPPLY else COIL_MA // 64 * (coils_on(h.word) or stuck)
    h.arm()
    assert h.answer("pulse", h.now + 5 * MS, 1, 1, [longest] * 15) == (Status.OK, 0)
    h.run(6 * MS)
    stuck = True
    h.run(4 * MS + longest * UNIT - 5 * MS)
    off = h.edges[-1][0]
    assert h.word == FEED
    h.send("keepalive", seq=0)
    h.run(30 * MS)
    assert h.faults == 1 << Fault.COIL_ON_TIME
    assert longest * UNIT + 2 * MS <= h.edges[-1][0] - off <= longest * UNIT + 5 * MS
    assert h.all("fault")[-1].message[1:] == (Fault.COIL_ON_TIME, 255, COIL_MA // 64 * 64)
    assert h.word == 0


@pytest.mark.parametrize(("counts", "trips"), [(3, False), (4, True)])
def test_current_that_no_coil_draws_is_more_than_two_hundred_milliamperes(bench, counts, trips) -> None:
    h = bench()
    h.senses = lambda channel: 500 if channel == SUPPLY else counts
    h.arm()
    h.live(200 * MS)
    assert (h.faults == 1 << Fault.COIL_ON_TIME) is trips


@pytest.mark.slow
@pytest.mark.parametrize("period", [1999, 2000, 2001, 1000, 4000, 500])
def test_a_coil_that_has_just_gone_off_is_no_fault_however_often_a_look_falls_there(bench, period) -> None:
    """The sense sees each coil 30 us longer than the outputs show it, and pulses end in step with the looks at it."""
    h = bench()
    off: list[int] = []

    def senses(channel: int) -> int:
        fading = sum(h.now - tick < 60 for tick in off[-3:])
        return 500 if channel == SUPPLY else (coils_on(h.word) + fading) * COIL_MA // 64

    h.senses = senses
    h.arm()
    for phase in range(0, 2000, 37):
        origin = h.now - h.now % 2000 + 4000 + phase
        for k in range(60):
            h.send("pulse", origin + k * period - 200 * (k % 3), 1 << k % 15, 0, [1 + k % 2] * 15)
        end = h.now + 60 * period + 8000
        while h.now < end:
            before = coils_on(h.word)
            h.run(min(h.next, end - h.now))
            off += [h.now] * (before - coils_on(h.word))
            h.send("keepalive", seq=0)
        assert h.faults == 0


@pytest.mark.parametrize("spread", [0.93, 1.0, 1.08])
def test_sound_coils_never_trip_a_guard(bench, spread) -> None:
    """Coils of 1.28 to 1.48 ohm, with noise of a count, under crowded random pulses for ten seconds."""
    rng = random.Random(9)
    h = bench()
    h.senses = lambda channel: (
        rng.randrange(480, 501)
        if channel == SUPPLY
        else max(0, round(coils_on(h.word) * COIL_MA * spread / 64) + rng.randrange(-1, 2))
    )
    h.arm()
    end = h.now + 10_000 * MS
    while h.now < end:
        start = in_ticks(h.now, rng.uniform(0, 40))
        h.send("pulse", start, 1 << rng.randrange(15), rng.randrange(1 << 15), [rng.randrange(1, 201)] * 15)
        h.run(rng.randrange(8 * MS))
    assert (h.state, h.faults) == (State.ARMED, 0)
    assert len(h.edges) > 3000


def test_telemetry_tells_supply_current_and_counters(bench) -> None:
    h = bench()
    h.ask("identify", seq=0)
    h.arm()
    assert h.answer("pulse", h.now + 35 * MS, 0b11, 0, TEN_MS) == (Status.OK, 0)
    assert h.answer("pulse", h.now + 85 * MS, 0b100, 0, TEN_MS) == (Status.OK, 0)
    assert h.answer("pulse", h.now - 320, 1, 0, TEN_MS) == (Status.LATE, 10)
    first, second = h.telemetry(), h.telemetry()
    assert (first.state, first.faults, first.supply, first.current, first.queued) == (State.ARMED, 0, 5000, 0, 3)
    assert (second.current, second.queued, second.late) == (2 * COIL_MA // 64 * 64, 1, 1)
    assert second.played[:4] == (1, 1, 0, 0)


def test_counters_wrap_and_start_at_zero_with_a_boot(bench, monkeypatch) -> None:
    h = bench()
    h.ask("identify", seq=0)
    h.arm()
    late = frame(BY_NAME["pulse"].type, 0, encode("pulse", (h.now - 1) % WRAP, 1, 0, TEN_MS))
    with monkeypatch.context() as deaf:
        deaf.setattr(h, "_transmit", lambda data: None)  # that each reply is right is shown elsewhere
        for _ in range(65_536 + 3):
            h.feed(late)
    assert h.telemetry().late == 3
    assert bench(Board.TACTILES, limits=BUILT[Board.TACTILES]).ask("identify").limits == BUILT[Board.TACTILES]

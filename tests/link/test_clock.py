from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.link.clock import ClockModel, TickExtender, signed_ticks

MS = 1_000_000
WRAP = 2**32


class TrueClock:
    """A board's clock known exactly, in whole numbers: floor(ticks_0 + t * 2 MHz * rate)."""

    def __init__(self, ticks_0: int, ppb: int):
        self.ticks_0, self.ppb = ticks_0, ppb

    def exact(self, host_ns: float) -> float:
        return self.ticks_0 + host_ns * (1e9 + self.ppb) / 1e9 / 500

    def count(self, host_ns: int) -> int:
        return self.ticks_0 + host_ns * (10**9 + self.ppb) // (10**9 * 500)


def exchange(model: ClockModel, clock: TrueClock, at_ns: int, up_ns: int, turn_ns: int, down_ns: int) -> tuple[bool, int]:
    received, sent = at_ns + up_ns, at_ns + up_ns + turn_ns
    arrived = sent + down_ns
    return model.add(at_ns, clock.count(received) % WRAP, clock.count(sent) % WRAP, arrived), arrived


DELAY = st.integers(1_000, 20 * MS)


@settings(deadline=None)
@given(
    ticks_0=st.integers(0, WRAP - 1),
    ppb=st.integers(-5_000_000, 5_000_000),
    exchanges=st.lists(st.tuples(DELAY, st.integers(0, 3 * MS), DELAY, st.integers(0, 600 * MS)), min_size=1, max_size=25),
    ahead_ns=st.integers(-100 * MS, 2_000 * MS),
)
def test_bound_holds_whatever_the_delays_and_the_rate(ticks_0, ppb, exchanges, ahead_ns):
    """Any asymmetry of up to 20 ms, any rate within 0.5 %, any spacing: the true tick is never farther off than said."""
    model, clock, now = ClockModel(), TrueClock(ticks_0, ppb), 0
    for up, turn, down, pause in exchanges:
        consistent, now = exchange(model, clock, now, up, turn, down)
        assert consistent
        fit = model.fit
        for at in (fit.reference_ns, now, now + ahead_ns):
            error_ticks = (fit.ticks_at(at) - clock.exact(at) + WRAP / 2) % WRAP - WRAP / 2
            # one tick more than the bound: ticks_at rounds, and the true clock shows whole ticks
            assert abs(error_ticks) <= fit.error_bound_s(at) * 2e6 * 1.006 + 1
        now += pause


def wandering_counts(rates: list[float], times: list[int]) -> list[int]:
    """Ticks at each time of a clock whose rate changes every 100 ms."""
    counts = []
    for time_ns in times:
        whole, rest = divmod(time_ns, 100 * MS)
        ticks = sum(rates[i % len(rates)] * 100 * MS for i in range(whole)) + rates[whole % len(rates)] * rest
        counts.append(int(ticks / 500))
    return counts


@settings(deadline=None, max_examples=50)
@given(
    mean=st.floats(-5e-3, 5e-3),
    wander=st.lists(st.floats(-1, 1), min_size=5, max_size=20),
    delays=st.lists(st.tuples(DELAY, DELAY), min_size=20, max_size=20),
)
def test_bound_holds_while_the_rate_wanders_within_drift(mean, wander, delays):
    drift = 1e-4
    rates = [1 + mean + 0.99 * drift * w for w in wander]
    model = ClockModel(drift=drift)
    for index, (up, down) in enumerate(delays):
        at = index * 250 * MS
        received, _, probe = wandering_counts(rates, [at + up, 0, at + up + 900 * MS])
        assert model.add(at, received, received, at + up + down)
        error_s = (model.fit.ticks_at(at + up + 900 * MS) - probe) / 2e6
        assert abs(error_s) <= model.fit.error_bound_s(at + up + 900 * MS) * 1.006 + 1e-6


def test_one_exchange_gives_half_the_round_trip_less_turn_around():
    model = ClockModel(jitter_s=2e-6)
    exchange(model, TrueClock(0, 0), 0, 300_000, 100_000, 500_000)
    # (900 us - 100 us) / 2, and 2 us of jitter, and 0.6 % of half the turn-around, and 1 ns
    assert model.fit.error_s == pytest.approx(400e-6 + 2e-6 + 0.3e-6 + 1e-9, abs=1e-9)
    assert model.fit.drift == pytest.approx(6e-3 + 2e-5)


def test_bound_grows_with_age_by_the_uncertainty_of_the_rate():
    model = ClockModel()
    exchange(model, TrueClock(0, 0), 0, 300_000, 0, 300_000)
    fit = model.fit
    for age_ns in (0, 10 * MS, 1000 * MS):
        assert fit.error_bound_s(fit.reference_ns + age_ns) == pytest.approx(fit.error_s + fit.drift * age_ns * 1e-9)
        assert fit.age_s(fit.reference_ns + age_ns) == age_ns * 1e-9


def test_rate_is_learnt_within_the_exchanges_resolution():
    model, clock = ClockModel(), TrueClock(7, 3_000_000)
    for index in range(16):
        exchange(model, clock, index * 500 * MS, 300_000, 50_000, 300_000)
    # two intervals of +-302 us, 7.5 s apart
    assert abs(model.fit.skew - 3e-3) <= 2 * 302e-6 / 7.5 + 2e-5
    assert model.fit.drift <= 2 * 302e-6 / 7.5 + 3 * 2e-5


def test_bound_is_no_wider_than_the_best_recent_exchange():
    """A quick exchange among slow ones sets the bound, widened only by what the rate leaves open."""
    model, clock, now = ClockModel(), TrueClock(0, 1_000), 0
    for up in (5 * MS, 5 * MS, 100_000, 5 * MS, 5 * MS):
        _, now = exchange(model, clock, now, up, 0, up)
    assert model.fit.error_s < 100e-6 + 2e-6 + 6.1e-3 * 25e-3


@pytest.mark.parametrize("jump_ticks", [20_000, -20_000, 2**31])
def test_a_jump_is_a_contradiction_and_starts_afresh(jump_ticks):
    clock, model, now = TrueClock(10**6, 0), ClockModel(), 0
    for _ in range(5):
        _, now = exchange(model, clock, now, 300_000, 0, 300_000)
    clock.ticks_0 += jump_ticks
    consistent, now = exchange(model, clock, now, 300_000, 0, 300_000)
    assert not consistent
    assert exchange(model, clock, now, 300_000, 0, 300_000)[0]
    at = model.fit.reference_ns
    assert (model.fit.to_ticks(at) - clock.count(at)) % WRAP in {0, 1, WRAP - 1}


@pytest.mark.parametrize(("received", "sent"), [(1000, 900), (1000, 1000 + 2_000_000)])
def test_impossible_exchanges_are_not_believed(received, sent):
    model = ClockModel()
    assert not model.add(0, received, sent, 1 * MS)
    assert model.fit is None


@given(st.integers(0, WRAP - 1), st.lists(st.integers(-(2**31), 2**31 - 1), max_size=20))
def test_ticks_are_extended_across_the_wrap(first, steps):
    extender, latest = TickExtender(), first
    assert extender.extend(first) == first
    for step in steps:
        count = latest + step
        assert extender.extend(count % WRAP) == count
        latest = max(latest, count)


@given(st.integers(0, WRAP - 1), st.integers(-(2**31), 2**31 - 1))
def test_signed_difference(ticks, step):
    assert signed_ticks((ticks + step) % WRAP, ticks) == step


def test_times_convert_both_ways_through_the_wrap():
    """The counter wraps 100 ms after the start; times before and after it go there and back within a tick."""
    clock, model, now = TrueClock(WRAP - 200_000, 0), ClockModel(), 0
    for _ in range(8):
        _, now = exchange(model, clock, now, 300_000, 50_000, 300_000)
    fit = model.fit
    for at in range(0, 400 * MS, 7 * MS):
        ticks = fit.to_ticks(at)
        assert 0 <= ticks < WRAP
        assert abs(signed_ticks(ticks, clock.count(at) % WRAP)) <= fit.error_bound_s(at) * 2e6 + 1
        assert abs(fit.to_host_ns(ticks, near_ns=now) - at) <= 500


def test_two_hours_of_exchanges_stay_true():
    """Three wraps of the counter, one exchange in 0.5 s: no drift of the estimate."""
    clock, model = TrueClock(123, 2_000_000), ClockModel()
    delays = itertools.cycle([(300_000, 400_000), (900_000, 300_000), (350_000, 2 * MS)])
    for at, (up, down) in zip(range(0, 7200_000 * MS, 500 * MS), delays, strict=False):
        assert exchange(model, clock, at, up, 60_000, down)[0]
    at = 7200_000 * MS
    assert abs(model.fit.ticks_at(at) - clock.exact(at)) <= model.fit.error_bound_s(at) * 2e6
    assert model.fit.error_bound_s(at) < 1e-3


@pytest.mark.parametrize("bad", [{"tolerance": -1}, {"drift": 2}, {"jitter_s": 0}, {"window": 0}])
def test_settings_out_of_range_are_refused(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        ClockModel(**bad)

"""The latency bounds: reached by the worst cases, never passed by any."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.scheduling import (
    CoilLimits,
    CoilPulse,
    Outcome,
    Priority,
    Request,
    Scheduler,
    burst,
    contact,
    latency_bound_s,
    pulse,
    release,
    sustained_latency_bound_s,
)
from haptics.time import seconds_to_ns

MS = 1_000_000
MAKERS = {Priority.RELEASE: release, Priority.CONTACT: contact, Priority.PULSE: pulse, Priority.BURST: burst}
simultaneous_classes = st.sampled_from([Priority.RELEASE, Priority.CONTACT, Priority.PULSE])


def cold(coils_at_once: int) -> Scheduler:
    """A scheduler whose coils never warm: latency alone is looked at."""
    scheduler = Scheduler(limits=CoilLimits(current_limit_a=3.9 * coils_at_once, coil_power_w=0.0))
    scheduler.set_armed(True)
    return scheduler


def waits_ns(outcomes: list[Outcome], pulses: list[CoilPulse]) -> list[tuple[Request, int]]:
    """Wait of each played request, from when its earliest start had come and its own coil was free."""
    found: list[tuple[Request, int]] = []
    for outcome in outcomes:
        if outcome.start_ns is None:
            continue
        request = outcome.request
        own = (p.start_ns + seconds_to_ns(p.duration_s) for p in pulses if p.channel == request.channel)
        free_ns = max((end_ns for end_ns in own if end_ns <= outcome.start_ns), default=0)
        found.append((request, outcome.start_ns - max(request.start_ns, free_ns)))
    return found


def within(wait_ns: int, bound_s: float) -> bool:
    return wait_ns <= seconds_to_ns(bound_s)


def test_published_bound_is_45_ms():
    assert latency_bound_s(3, unit_s=0.010, blocker_s=0.005) == pytest.approx(0.045)


@pytest.mark.parametrize("coils_at_once", range(1, 16))
@pytest.mark.parametrize("priority", [Priority.RELEASE, Priority.CONTACT, Priority.PULSE])
def test_fifteen_at_once_behind_blockers_reach_the_bound(coils_at_once: int, priority: Priority):
    scheduler = cold(coils_at_once)
    for channel in range(coils_at_once):
        scheduler.submit(burst(channel, 0, cycles=10), 0)
    scheduler.step(0, 0)
    for channel in range(15):
        scheduler.submit(MAKERS[priority](channel, 0), 0)
    _, outcomes = scheduler.step(0, 500 * MS)
    worst_ns = max(o.start_ns for o in outcomes if o.start_ns is not None)
    unit_s = sum(stroke.duration_s for stroke in MAKERS[priority](0, 0).strokes)
    assert worst_ns == seconds_to_ns(latency_bound_s(coils_at_once, unit_s=unit_s, blocker_s=0.005))


def test_bursts_among_bursts_wait_for_whole_bursts():
    scheduler = cold(3)
    for channel in range(3):
        scheduler.submit(burst(channel, 0, cycles=10), 0)
    scheduler.step(0, 0)
    for channel in [*range(3, 15), 0, 1, 2]:
        scheduler.submit(burst(channel, 0, cycles=10), 0)
    _, outcomes = scheduler.step(0, 2000 * MS)
    worst_ns = max(o.start_ns for o in outcomes if o.start_ns is not None)
    # the first three gave way after a cycle to newer ones on their own channels
    assert worst_ns == seconds_to_ns(latency_bound_s(3, unit_s=0.050, blocker_s=0.005))


def test_releases_that_pass_a_contact_reach_its_longer_bound():
    """Fourteen older contacts and then their fourteen releases, held back so that no slot is ever left over."""
    scheduler, coils_at_once = cold(3), 3
    for channel in range(3):
        scheduler.submit(burst(channel, 0), 0)
    scheduler.step(0, 0)
    for channel in range(15):
        scheduler.submit(contact(channel, 0), 0)
    last: list[Outcome] = []
    for round_number in range(12):
        now_ns = (5 + 10 * round_number) * MS
        if round_number == 4:  # contacts 12 and 13 start, and one release beside them
            scheduler.submit(release(0, now_ns), now_ns)
        if round_number == 5:
            for channel in range(1, 13):
                scheduler.submit(release(channel, now_ns), now_ns)
        if round_number == 9:
            scheduler.submit(release(13, now_ns), now_ns)
        last += [o for o in scheduler.step(now_ns, now_ns + 9 * MS)[1] if o.request == contact(14, 0)]
    bound_s = latency_bound_s(coils_at_once, unit_s=0.010, blocker_s=0.005, overtakes=1)
    assert bound_s == pytest.approx(0.095)
    assert last[0].start_ns == seconds_to_ns(bound_s)


def test_releases_that_wait_and_the_contacts_behind_them_reach_the_longest_bound():
    """On each of fourteen channels a release, the contact after it and its release go before the fifteenth's contact."""
    scheduler = cold(3)
    for channel in range(3):
        scheduler.submit(burst(channel, 0), 0)
    scheduler.step(0, 0)
    for make in (release, contact):
        for channel in range(14):
            scheduler.submit(make(channel, 0), 0)
    last = contact(14, 0)
    scheduler.submit(last, 0)
    told: list[Outcome] = []
    for round_number in range(16):
        now_ns = (5 + 10 * round_number) * MS
        if round_number == 9:  # the fourteenth contact starts, and two releases beside it
            told += scheduler.submit(release(0, now_ns), now_ns) + scheduler.submit(release(1, now_ns), now_ns)
        if round_number == 10:
            for channel in range(2, 14):
                told += scheduler.submit(release(channel, now_ns), now_ns)
        told += scheduler.step(now_ns, now_ns + 9 * MS)[1]
    bound_s = latency_bound_s(3, unit_s=0.010, blocker_s=0.005, overtakes=2)
    assert bound_s == pytest.approx(0.145)
    assert [o.start_ns for o in told if o.request == last] == [seconds_to_ns(bound_s)]


def test_committing_ahead_adds_the_horizon():
    """A start given out ahead, and a release that comes right after: the horizon and the unit are its blocker."""
    scheduler = cold(1)
    scheduler.submit(contact(0, 4 * MS), 0)
    scheduler.step(0, 4 * MS)
    for channel in range(1, 15):
        scheduler.submit(release(channel, 0), 0)
    scheduler.submit(release(0, 0), 0)
    _, outcomes = scheduler.step(0, 500 * MS)
    assert max(o.start_ns or 0 for o in outcomes) == seconds_to_ns(latency_bound_s(1, blocker_s=0.004 + 0.010))


@settings(max_examples=300, deadline=None)
@given(
    st.integers(1, 15),
    st.lists(st.sampled_from([1, 2, 3, 10]), min_size=0, max_size=15),
    st.permutations(range(15)),
    st.lists(simultaneous_classes, min_size=15, max_size=15),
    st.integers(0, 4_999_999),
)
def test_simultaneous_requests_of_any_classes_keep_the_bound(
    coils_at_once: int, blockers: list[int], order: list[int], classes: list[Priority], at_ns: int
):
    scheduler = cold(coils_at_once)
    for channel, cycles in enumerate(blockers):
        scheduler.submit(burst(channel, 0, cycles=cycles), 0)
    scheduler.step(0, at_ns)
    for channel in order:
        scheduler.submit(MAKERS[classes[channel]](channel, at_ns), at_ns)
    _, outcomes = scheduler.step(at_ns, at_ns + 500 * MS)
    mine = [o for o in outcomes if o.request.priority is not Priority.BURST]
    assert len(mine) == 15
    bound_s = latency_bound_s(coils_at_once, unit_s=0.010, blocker_s=0.005)
    assert all(within((o.start_ns or 0) - at_ns, bound_s) for o in mine)


def run_load(
    seed: int,
    coils_at_once: int,
    horizon_ms: int,
    wish: dict[Priority, float],
    spacing_ms: int = 0,
    alternate: bool = False,
) -> tuple[list[Outcome], list[CoilPulse]]:
    """Random requests at a 1 ms tick for 0.4 s: ``wish`` is the chance of each class, a tick and a channel.

    ``alternate``: a channel's next contact or release is submitted only once the one before it was given out, in turns.
    """
    rng = np.random.default_rng(seed)
    scheduler = cold(coils_at_once)
    outcomes: list[Outcome] = []
    pulses: list[CoilPulse] = []
    out, busy, last_ms = [False] * 15, [False] * 15, [-(10**6)] * 15
    for tick in range(400):
        now_ns = tick * MS + int(rng.integers(0, 1000))
        told: list[Outcome] = []
        for channel in rng.permutation(15).tolist():
            for priority, chance in wish.items():
                if rng.random() >= chance or tick - last_ms[channel] < spacing_ms:
                    continue
                if alternate and priority in (Priority.RELEASE, Priority.CONTACT):
                    if busy[channel] or out[channel] != (priority is Priority.RELEASE):
                        continue
                    busy[channel] = True
                elif alternate and busy[channel]:
                    continue  # it would replace the contact or release that waits
                last_ms[channel] = tick
                told += scheduler.submit(MAKERS[priority](channel, now_ns), now_ns)
        more_pulses, more = scheduler.step(now_ns, (tick + 1 + horizon_ms) * MS)
        pulses += more_pulses
        told += more
        for outcome in told:
            if outcome.request.priority in (Priority.RELEASE, Priority.CONTACT):
                busy[outcome.request.channel] = False
                if outcome.played:
                    out[outcome.request.channel] = outcome.request.priority is Priority.CONTACT
        outcomes += told
    return outcomes, pulses


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(0, 5))
def test_a_release_keeps_its_bound_under_any_load(seed: int, coils_at_once: int, horizon_ms: int):
    wish = {Priority.RELEASE: 0.1, Priority.CONTACT: 0.1, Priority.PULSE: 0.1, Priority.BURST: 0.1}
    outcomes, pulses = run_load(seed, coils_at_once, horizon_ms, wish)
    bound_s = latency_bound_s(coils_at_once, blocker_s=0.010 + (horizon_ms + 1) * 1e-3)
    waits = [wait_ns for request, wait_ns in waits_ns(outcomes, pulses) if request.priority is Priority.RELEASE]
    assert waits
    assert all(within(wait_ns, bound_s) for wait_ns in waits)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(0, 5), st.sampled_from([0.02, 0.1, 0.5]))
def test_a_contact_keeps_its_bound_where_contacts_and_releases_alternate(
    seed: int, coils_at_once: int, horizon_ms: int, eagerness: float
):
    wish = {Priority.RELEASE: eagerness, Priority.CONTACT: eagerness, Priority.PULSE: 0.02, Priority.BURST: 0.02}
    outcomes, pulses = run_load(seed, coils_at_once, horizon_ms, wish, alternate=True)
    bound_s = latency_bound_s(coils_at_once, blocker_s=0.010 + (horizon_ms + 1) * 1e-3, overtakes=1)
    waits = [wait_ns for request, wait_ns in waits_ns(outcomes, pulses) if request.priority is Priority.CONTACT]
    assert waits
    assert all(within(wait_ns, bound_s) for wait_ns in waits)


def flickering(seed: int, scheduler: Scheduler, horizon_ms: int, eagerness: float) -> list[tuple[Request, int]]:
    """Contacts and releases as touches flicker, over each other, as a driver asks: no release of a pin that is in.

    Returns each contact or release that played, with its wait from when its coil was free and nothing of its channel went before.
    """
    rng = np.random.default_rng(seed)
    outcomes: list[Outcome] = []
    pulses: list[CoilPulse] = []
    out = [False] * 15  # by what was given out
    release_waits = [False] * 15
    for tick in range(300):
        now_ns = tick * MS
        told: list[Outcome] = []
        for channel in rng.permutation(15).tolist():
            if rng.random() >= eagerness:
                continue
            kind = rng.choice([contact, contact, release, release, pulse, burst], p=[0.25, 0.2, 0.25, 0.2, 0.05, 0.05])
            if kind is release:
                told += scheduler.withdraw_contact(channel, now_ns)
                if not out[channel] or release_waits[channel]:
                    continue
                release_waits[channel] = True
            told += scheduler.submit(kind(channel, now_ns), now_ns)
        more_pulses, more = scheduler.step(now_ns, (tick + 1 + horizon_ms) * MS)
        pulses += more_pulses
        told += more
        for outcome in sorted(told, key=lambda o: o.start_ns or 0):
            channel, priority = outcome.request.channel, outcome.request.priority
            release_waits[channel] &= priority is not Priority.RELEASE
            if outcome.played and priority in (Priority.CONTACT, Priority.RELEASE):
                out[channel] = priority is Priority.CONTACT
        outcomes += told
    return [(r, w) for r, w in waits_ns(outcomes, pulses) if r.priority in (Priority.CONTACT, Priority.RELEASE)]


currents = st.lists(st.sampled_from([2.0, 3.0, 3.9, 7.0]), min_size=15, max_size=15)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), currents, st.integers(0, 5), st.sampled_from([0.02, 0.1, 0.3]))
def test_mixed_touches_keep_their_bounds_also_with_unequal_coils(
    seed: int, currents: list[float], horizon_ms: int, eagerness: float
):
    limits = CoilLimits(current_limit_a=14.0, coil_current_a=tuple(currents), coil_power_w=0.0)
    scheduler = Scheduler(limits=limits)
    scheduler.set_armed(True)
    blocker_s = 0.010 + (horizon_ms + 1) * 1e-3
    bounds = {
        Priority.RELEASE: latency_bound_s(limits.coils_at_once, blocker_s=blocker_s),
        Priority.CONTACT: latency_bound_s(limits.coils_at_once, blocker_s=blocker_s, overtakes=2),
    }
    waits = flickering(seed, scheduler, horizon_ms, eagerness)
    assert waits
    assert all(within(wait_ns, bounds[request.priority]) for request, wait_ns in waits)


@settings(max_examples=60, deadline=None)
@given(currents, st.lists(st.sampled_from([1, 2, 3, 10]), max_size=15), st.permutations(range(15)), st.integers(0, 4_999_999))
def test_unequal_coils_asked_for_together_keep_the_bound_of_the_worst_one(
    currents: list[float], blockers: list[int], order: list[int], at_ns: int
):
    limits = CoilLimits(current_limit_a=14.0, coil_current_a=tuple(currents), coil_power_w=0.0)
    scheduler = Scheduler(limits=limits)
    scheduler.set_armed(True)
    for channel, cycles in enumerate(blockers):
        scheduler.submit(burst(channel, 0, cycles=cycles), 0)
    scheduler.step(0, at_ns)
    for channel in order:
        scheduler.submit(contact(channel, at_ns), at_ns)
    outcomes = [o for o in scheduler.step(at_ns, at_ns + 500 * MS)[1] if o.request.priority is Priority.CONTACT]
    assert len(outcomes) == 15
    bound_s = latency_bound_s(limits.coils_at_once, unit_s=0.010, blocker_s=0.005)
    assert all(within((o.start_ns or 0) - at_ns, bound_s) for o in outcomes)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 8), st.integers(0, 5), st.integers(30, 120))
def test_every_class_keeps_the_bound_of_a_steady_load(seed: int, coils_at_once: int, horizon_ms: int, spacing_ms: int):
    wish = {Priority.RELEASE: 0.3, Priority.CONTACT: 0.3, Priority.PULSE: 0.5}
    outcomes, pulses = run_load(seed, coils_at_once, horizon_ms, wish, spacing_ms=spacing_ms)
    spacing_s = (spacing_ms - 0.001) * 1e-3  # submissions jitter by up to 1 us
    bound_s = sustained_latency_bound_s(coils_at_once, spacing_s, blocker_s=0.010 + (horizon_ms + 1) * 1e-3)
    if math.isfinite(bound_s):
        assert all(within(wait_ns, bound_s) for _, wait_ns in waits_ns(outcomes, pulses))


def test_a_steady_load_bound_is_a_fixed_point_and_infinite_once_others_take_everything():
    assert sustained_latency_bound_s(3, 0.1, blocker_s=0.005) == pytest.approx(0.095)
    bound_s = sustained_latency_bound_s(3, 0.06, blocker_s=0.005)
    before = 14 * (2 + math.floor(bound_s / 0.06))
    assert bound_s == pytest.approx(0.005 + before // 3 * 0.010)
    assert sustained_latency_bound_s(3, 14 * 0.010 / 3) == math.inf
    assert sustained_latency_bound_s(15, 0.5) == latency_bound_s(15, overtakes=1)


def test_more_coils_at_once_never_make_it_longer_and_all_at_once_leave_only_the_blocker():
    bounds = [latency_bound_s(n) for n in range(1, 16)]
    assert bounds == sorted(bounds, reverse=True)
    assert bounds[-1] == 0.010


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"coils_at_once": 0}, "coils_at_once"),
        ({"coils_at_once": 3, "unit_s": -0.01}, "unit_s"),
        ({"coils_at_once": 3, "blocker_s": math.nan}, "blocker_s"),
        ({"coils_at_once": 3, "overtakes": -1}, "overtakes"),
        ({"coils_at_once": 3, "channels": 0}, "channels"),
    ],
)
def test_bad_arguments_are_refused_by_name(arguments: dict[str, float], says: str):
    with pytest.raises(InputError, match=says):
        latency_bound_s(**arguments)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="spacing_s"):
        sustained_latency_bound_s(3, 0.0)

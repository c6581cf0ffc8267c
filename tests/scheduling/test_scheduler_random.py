"""What must hold for any sequence of requests and steps, judged by pulses and outcomes alone."""

from __future__ import annotations

import math
import random
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

import pytest
from hypothesis import event, example, given, settings, strategies as st

from haptics.physics.thermal.one_node import ThermalParameters
from haptics.scheduling import (
    CoilLimits,
    CoilPulse,
    Outcome,
    Priority,
    Request,
    Scheduler,
    ThermalBudget,
    burst,
    contact,
    pulse,
    release,
)
from haptics.time import seconds_to_ns

MS = 1_000_000
CHANNELS = 5
PARAMETERS = ThermalParameters(tau_s=1.0, c_k_per_w=1.0)  # quick, so that heating and cooling both matter within a test
JUMP_K = 0.18 * 1.0 / 1.0
POWER_W = 18.0

MAKERS = {Priority.RELEASE: release, Priority.CONTACT: contact, Priority.PULSE: pulse}


@dataclass
class Story:
    """Everything that was asked and answered."""

    coils_at_once: int
    limit_k: float
    gap_s: float
    requests: list[Request] = field(default_factory=list)
    pulses: list[CoilPulse] = field(default_factory=list)
    outcomes: list[Outcome] = field(default_factory=list)
    spans: list[tuple[int, int, list[CoilPulse]]] = field(default_factory=list)
    given_before: dict[object, int] = field(default_factory=dict)  # pulses given out before each request came
    told_before: dict[object, int] = field(default_factory=dict)  # outcomes told before it


times_us = st.integers(0, 40_000)
soon_us = st.one_of(st.just(0), st.just(0), times_us)
submissions = st.tuples(
    st.just("submit"),
    st.integers(0, CHANNELS - 1),
    st.sampled_from(Priority),
    soon_us,  # start after now, us
    st.one_of(st.none(), times_us),  # latest after start, us
    st.integers(1, 6),  # cycles of a burst
)
steps = st.tuples(st.just("step"), st.integers(0, 15_000), st.integers(0, 6_000))  # time on, horizon, us
rare = st.sampled_from([("stop",), ("disarm",), ("arm",), ("arm",), ("arm",), ("miss", 30_000)])
short_scripts = st.lists(st.one_of(*[submissions] * 5, *[steps] * 4, rare), max_size=20)


def long_script(seed: int) -> list[tuple]:
    """A busy one, on few channels, so that heat, current and lateness all bite."""
    rng = random.Random(seed)
    channels, cadence, rest_us = rng.randint(1, CHANNELS), rng.random(), rng.choice([2_000, 10_000, 30_000])
    script: list[tuple] = []
    for _ in range(120):
        if rng.random() < 0.3 + 0.4 * cadence:
            start_us = rng.choice([0, 0, rng.randint(0, 20_000)])
            latest_us = rng.choice([None, None, rng.randint(0, 20_000)])
            script.append(("submit", rng.randrange(channels), rng.choice(list(Priority)), start_us, latest_us, rng.randint(1, 6)))
        elif rng.random() < 0.97:
            script.append(("step", rng.randint(0, rest_us), rng.choice([0, 1000, rng.randint(0, 6_000)])))
        else:
            script += rng.choice([[("stop",)], [("disarm",), script[-1] if script else ("stop",), ("arm",)], [("miss", 30_000)]])
    return script


operations = st.one_of(short_scripts, st.integers(0, 2**32 - 1).map(long_script))
settings_drawn = st.tuples(st.integers(1, 4), st.sampled_from([2.0, 2.1, 3.0, 5.0]), st.sampled_from([0.0, 0.0002]))


def play(drawn: tuple[int, float, float], script: list[tuple], split: int = 1, limits: CoilLimits | None = None) -> Story:
    """Run a script; each step's span may be cut into ``split`` touching spans. ``limits`` in place of equal coils."""
    coils_at_once, limit_jumps, gap_s = drawn
    story = Story(coils_at_once, limit_jumps * JUMP_K, gap_s)
    scheduler = Scheduler(
        CHANNELS,
        limits or CoilLimits(current_limit_a=3.9 * coils_at_once + 0.1, gap_s=gap_s),
        [ThermalBudget(PARAMETERS, story.limit_k) for _ in range(CHANNELS)],
    )
    scheduler.set_armed(True)
    now_ns = 0

    def step(until_ns: int) -> None:
        first_ns = now_ns
        for part in range(1, split + 1):
            last_ns = now_ns + (until_ns - now_ns) * part // split
            pulses, outcomes = scheduler.step(first_ns, last_ns)
            story.spans.append((first_ns, last_ns, pulses))
            story.pulses.extend(pulses)
            story.outcomes.extend(outcomes)
            first_ns = last_ns

    for token, (name, *values) in enumerate(script):
        if name == "submit":
            channel, priority, start_us, latest_us, cycles = values
            start_ns = now_ns + start_us * 1000
            latest_ns = None if latest_us is None else start_ns + latest_us * 1000
            if priority is Priority.BURST:
                request = burst(channel, start_ns, latest_ns, cycles=cycles, submitted_ns=now_ns, token=token)
            else:
                request = MAKERS[priority](channel, start_ns, latest_ns, submitted_ns=now_ns, token=token)
            story.requests.append(request)
            story.given_before[token], story.told_before[token] = len(story.pulses), len(story.outcomes)
            story.outcomes.extend(scheduler.submit(request, now_ns))
        elif name == "step":
            on_us, horizon_us = values
            step(now_ns + (on_us + horizon_us) * 1000)
            now_ns += on_us * 1000
        elif name == "miss":
            now_ns += values[0] * 1000
        elif name == "stop":
            story.outcomes.extend(scheduler.stop())
        else:
            story.outcomes.extend(scheduler.set_armed(name == "arm"))
    step(now_ns + 300 * MS)
    story.outcomes.extend(scheduler.stop("ended"))
    assert scheduler.pending == 0
    assert [budget.clock_faults for budget in scheduler.budgets] == [0] * CHANNELS
    return story


def end_ns(one: CoilPulse) -> int:
    return one.start_ns + seconds_to_ns(one.duration_s)


@settings(max_examples=150, deadline=None)
@given(settings_drawn, operations)
def test_every_request_gets_exactly_one_outcome(drawn: tuple[int, float, float], script: list[tuple]):
    story = play(drawn, script)
    told = Counter(outcome.request.token for outcome in story.outcomes)
    assert told == Counter(request.token for request in story.requests)
    for outcome in story.outcomes:
        event(str(outcome.reason))
        allowed = {None, "cut"} if outcome.played else {"superseded", "heat", "late", "unarmed", "stopped", "ended"}
        assert outcome.reason in allowed
        assert outcome.played == (outcome.cycles > 0) == (outcome.start_ns is not None)


@settings(max_examples=150, deadline=None)
@given(settings_drawn, operations)
def test_pulses_are_those_of_what_is_said_to_have_played(drawn: tuple[int, float, float], script: list[tuple]):
    story = play(drawn, script)
    for channel in range(CHANNELS):
        given_out = [p for p in story.pulses if p.channel == channel]
        played = sorted((o for o in story.outcomes if o.played and o.request.channel == channel), key=lambda o: o.start_ns or 0)
        for outcome in played:
            request = outcome.request
            assert outcome.start_ns is not None
            assert request.start_ns <= outcome.start_ns
            assert request.latest_ns is None or outcome.start_ns <= request.latest_ns
            assert outcome.cycles == len(request.units) or (outcome.reason == "cut" and 0 < outcome.cycles < len(request.units))
            at_ns = outcome.start_ns
            for unit in request.units[: outcome.cycles]:
                assert given_out[0].start_ns >= at_ns
                at_ns = given_out[0].start_ns
                for stroke in unit:
                    assert given_out.pop(0) == CoilPulse(channel, at_ns, stroke.duration_s, stroke.toward_skin)
                    at_ns += seconds_to_ns(stroke.duration_s)
        assert given_out == []


@settings(max_examples=150, deadline=None)
@given(settings_drawn, operations)
def test_starts_lie_in_the_span_of_their_step(drawn: tuple[int, float, float], script: list[tuple]):
    for first_ns, last_ns, pulses in play(drawn, script).spans:
        units = [p for p in pulses if not any(q.channel == p.channel and end_ns(q) == p.start_ns for q in pulses)]
        assert all(first_ns <= p.start_ns <= last_ns for p in units)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(settings_drawn, operations)
def test_never_more_coils_on_than_allowed_and_never_two_strokes_on_one(drawn: tuple[int, float, float], script: list[tuple]):
    story = play(drawn, script)
    edges = sorted(
        [(end_ns(p), 0, -1, p.channel) for p in story.pulses] + [(p.start_ns, 1, 1, p.channel) for p in story.pulses]
    )  # an end before a start at the same instant
    on: Counter[int] = Counter()
    for _, _, change, channel in edges:
        on[channel] += change
        assert on[channel] <= 1
        assert sum(on.values()) <= story.coils_at_once


@settings(max_examples=200, deadline=None)
@given(settings_drawn, operations)
def test_no_coil_passes_its_limit_by_an_independent_integration(drawn: tuple[int, float, float], script: list[tuple]):
    story = play(drawn, script)
    for channel in range(CHANNELS):
        rise_k, at_ns, peak_k = 0.0, 0, 0.0
        for one in sorted((p for p in story.pulses if p.channel == channel), key=lambda p: p.start_ns):
            rise_k *= math.exp(-(one.start_ns - at_ns) / 1e9 / PARAMETERS.tau_s)
            steady_k = PARAMETERS.c_k_per_w * POWER_W
            rise_k = steady_k + (rise_k - steady_k) * math.exp(-one.duration_s / PARAMETERS.tau_s)
            at_ns = end_ns(one)
            peak_k = max(peak_k, rise_k)
        event(f"peak at {math.floor(10 * peak_k / story.limit_k) / 10} of the limit")
        assert peak_k <= story.limit_k * (1 + 1e-9)  # rounding only


@settings(max_examples=200, deadline=None)
@given(settings_drawn, operations)
def test_a_release_is_never_denied_for_heat_nor_held_by_it_after_anything_else(
    drawn: tuple[int, float, float], script: list[tuple]
):
    story = play(drawn, script)
    for channel in range(CHANNELS):
        mine = [o for o in story.outcomes if o.request.channel == channel]
        releases = [o for o in mine if o.request.priority is Priority.RELEASE]
        assert all(o.reason != "heat" for o in releases)
        before: Priority | None = None
        for outcome in sorted((o for o in mine if o.played), key=lambda o: o.start_ns or 0):
            if outcome.request.priority is Priority.RELEASE and before not in (None, Priority.RELEASE):
                event("release that was paid for")
                assert outcome.held_by != "heat"
            before = outcome.request.priority


@settings(max_examples=150, deadline=None)
@given(settings_drawn, operations)
@example((1, 5.0, 0.0002), long_script(17949))
def test_the_newest_request_of_a_channel_wins(drawn: tuple[int, float, float], script: list[tuple]):
    """But a release that waits keeps its turn: see the next test."""
    story = play(drawn, script)
    for channel in range(CHANNELS):
        asked = [r for r in story.requests if r.channel == channel]
        priority = {r.token: r.priority for r in asked}
        outcome = {o.request.token: o for o in story.outcomes if o.request.channel == channel}
        starts = [outcome[r.token].start_ns for r in asked if outcome[r.token].played]
        assert starts == sorted(s for s in starts if s is not None)  # an older one never plays after a newer one
        newest = asked[-1] if asked else None
        assert newest is None or newest.priority is Priority.RELEASE or outcome[newest.token].reason != "superseded"
        for older, newer in pairwise(asked):
            told_first = outcome[older.token].played and older.priority is not Priority.BURST
            if older.priority is not Priority.RELEASE and (told_first or outcome[older.token].reason == "superseded"):
                # either it was given out before the newer one came, or it fell the moment that one came
                place = story.outcomes.index(outcome[older.token])
                assert (place < story.told_before[newer.token]) == told_first
            for later in story.pulses[story.given_before[newer.token] :]:
                if later.channel == channel and later.start_ns < (outcome[newer.token].start_ns or 0):
                    # a release that had its turn, or cycles of a burst that runs, also on past one that came too late to cut it
                    assert priority[later.token] in (Priority.BURST, Priority.RELEASE)
                    assert priority[later.token] is Priority.RELEASE or later.start_ns < newer.start_ns


@settings(max_examples=150, deadline=None)
@given(settings_drawn, operations)
def test_a_release_is_given_up_only_for_a_unit_that_plays_instead(drawn: tuple[int, float, float], script: list[tuple]):
    """Or for an older release, which had the earlier turn."""
    story = play(drawn, script)
    order = {request.token: place for place, request in enumerate(story.requests)}
    told = {outcome.request.token: place for place, outcome in enumerate(story.outcomes)}
    for outcome in story.outcomes:
        request = outcome.request
        if request.priority is not Priority.RELEASE or outcome.reason != "superseded":
            continue
        event("release given up")
        others = [r for r in story.requests if r.channel == request.channel and r is not request]
        older = [r for r in others if r.priority is Priority.RELEASE and order[r.token] < order[request.token]]
        played = {pulse.token for pulse in story.pulses if pulse.start_ns >= request.submitted_ns}
        newer = [r for r in others if order[r.token] > order[request.token] and r.token in played]
        assert newer or any(told[r.token] > told[request.token] or r.token in played for r in older)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.sampled_from([1.0, 2.5, 3.0, 3.9, 7.0]), min_size=CHANNELS, max_size=CHANNELS),
    st.sampled_from([7.0, 9.0, 12.0]),
    operations,
)
def test_unequal_coils_never_draw_more_than_the_supply_has(currents: list[float], limit_a: float, script: list[tuple]):
    story = play((1, 5.0, 0.0), script, limits=CoilLimits(current_limit_a=limit_a, coil_current_a=tuple(currents)))
    for one in story.pulses:
        together = [p for p in story.pulses if p.start_ns <= one.start_ns < end_ns(p)]
        assert sum(currents[p.channel] for p in together) <= limit_a + 1e-9


@settings(max_examples=100, deadline=None)
@given(settings_drawn, operations)
def test_the_same_script_gives_the_same_story(drawn: tuple[int, float, float], script: list[tuple]):
    first, second = play(drawn, script), play(drawn, script)
    assert first.pulses == second.pulses
    assert first.outcomes == second.outcomes


@settings(max_examples=150, deadline=None)
@given(settings_drawn, operations, st.integers(2, 7))
def test_how_a_span_is_cut_into_steps_changes_nothing(drawn: tuple[int, float, float], script: list[tuple], split: int):
    whole, parts = play(drawn, script), play(drawn, script, split)
    assert sorted(whole.pulses, key=lambda p: (p.start_ns, p.channel)) == sorted(
        parts.pulses, key=lambda p: (p.start_ns, p.channel)
    )
    by_token = [sorted(s.outcomes, key=lambda o: int(str(o.request.token))) for s in (whole, parts)]
    assert by_token[0] == by_token[1]

"""Spatial patterns: published refresh rates, shapes on the hand, and a playback that neither loses nor repeats a pulse."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.scene.effects import PatternBank, PatternEffect, ProximityEffect
from haptics.scene.patterns import DOTS, FLAT_HAND_M, PATTERNS, SWEEP_SHARE, PatternPlayer, refresh_pulses, stimulus
from haptics.scene.sites import SITE, SITES
from haptics.time import NS_PER_S


@pytest.mark.parametrize(("pattern", "refreshes"), [("line_forward", 5), ("line_sideways", 5), ("radial", 4)])
def test_every_site_pulses_once_a_refresh_at_the_published_rate(pattern, refreshes):
    counts = Counter(site for _, site in stimulus(pattern, 1.0))
    assert counts == dict.fromkeys(SITES, refreshes)


def test_the_particle_pattern_refreshes_ten_times_and_visits_every_site_twice():
    pulses = stimulus("particle", 1.0)
    assert len(pulses) == 10 * DOTS
    assert Counter(site for _, site in pulses) == dict.fromkeys(SITES, 2)


@pytest.mark.parametrize("pattern", ["line_forward", "line_sideways", "radial"])
def test_the_period_between_refreshes_is_that_of_the_rate_and_scales_with_it(pattern):
    for scale, expected_s in ((1.0, 1.0 / {"radial": 4}.get(pattern, 5)), (2.0, 0.5 / {"radial": 4}.get(pattern, 5))):
        times = [time for time, site in stimulus(pattern, 1.0, rate_scale=scale) if site == "index_tip"]
        assert np.diff(times) == pytest.approx(expected_s, abs=1e-9)  # one nanosecond of rounding


def test_a_line_runs_along_the_hand_and_a_ring_outward():
    across, along = FLAT_HAND_M.T

    def order(pattern):
        return [pulse.site for pulse in refresh_pulses(pattern)]

    assert np.all(np.diff(along[order("line_forward")]) <= 0)
    assert np.all(np.diff(across[order("line_sideways")]) <= 0)
    assert np.all(np.diff(np.hypot(across, along)[order("radial")]) >= 0)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_reverse_meets_the_sites_in_the_opposite_order(pattern):
    forward = {pulse.site: pulse.phase for pulse in refresh_pulses(pattern, 3)}
    reverse = {pulse.site: pulse.phase for pulse in refresh_pulses(pattern, 3, "reverse")}
    assert reverse == pytest.approx({site: SWEEP_SHARE - phase for site, phase in forward.items()}, abs=1e-12)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_passage_ends_before_the_next_begins(pattern):
    for refresh in range(10):
        phases = [pulse.phase for pulse in refresh_pulses(pattern, refresh)]
        assert phases == sorted(phases)
        assert phases[0] >= 0.0
        assert phases[-1] < 1.0


def test_the_flat_hand_has_its_actuators_no_closer_than_they_are_wide():
    gaps = np.linalg.norm(FLAT_HAND_M[:, None] - FLAT_HAND_M[None], axis=2)[~np.eye(15, dtype=bool)]
    assert gaps.min() >= 0.0095  # the longer side of an actuator, thesis 3.4.2
    assert FLAT_HAND_M[SITE["thumb_tip"], 0] < 0 < FLAT_HAND_M[SITE["little_tip"], 0]


cuts = st.lists(st.integers(0, 2 * NS_PER_S), max_size=30).map(lambda values: [0, *sorted(values), 2 * NS_PER_S])


@settings(max_examples=60, deadline=None)
@given(pattern=st.sampled_from(PATTERNS), windows=cuts)
def test_however_the_time_is_cut_the_same_pulses_come_out(pattern, windows):
    whole = PatternPlayer(pattern)
    whole.start(0)
    pieces = PatternPlayer(pattern)
    pieces.start(0)
    found = [pulse for a, b in pairwise(windows) for pulse in pieces.due(a, b)]
    assert found == whole.due(0, 2 * NS_PER_S)


@settings(max_examples=60, deadline=None)
@given(changes=st.lists(st.tuples(st.integers(1, 10**8), st.floats(0.1, 10.0)), max_size=12))
def test_a_changing_rate_neither_loses_nor_repeats_a_pulse(changes):
    player = PatternPlayer("line_forward")
    player.start(0)
    now, found, refreshes = 0, [], 0.0
    for step, scale in [*changes, (10**8, 1.0)]:
        found += player.due(now, now + step)
        refreshes += step * player.refresh_hz / NS_PER_S
        now += step
        player.set_rate_scale(scale, now)
    phases = [pulse.phase for pulse in refresh_pulses("line_forward")]
    expected = sum(n + phase < refreshes for n in range(int(refreshes) + 1) for phase in phases)
    assert len(found) == pytest.approx(
        expected, abs=2
    )  # a pulse on a boundary may round to either side, and two sites share a phase
    times = [time for time, _ in found]
    assert times == sorted(times)
    one_passage = [pulse.site for pulse in refresh_pulses("line_forward")]
    endless = one_passage * (len(found) // 15 + 1)
    assert [site for _, site in found] == endless[: len(found)]


def test_a_faster_rate_takes_effect_at_once_without_a_jump():
    player = PatternPlayer("radial")
    player.start(0)
    player.due(0, 100_000_000)  # 0.4 of the first refresh
    player.set_rate_scale(2.0, 100_000_000)
    later = player.due(100_000_000, NS_PER_S)
    second = [time for time, site in later if site == refresh_pulses("radial")[0].site]
    assert second[0] == pytest.approx(100_000_000 + 0.6 / 8 * NS_PER_S, abs=2)
    assert np.diff(second) == pytest.approx(NS_PER_S / 8, abs=2)


def test_a_stimulus_ends_by_itself_and_can_be_started_again():
    player = PatternPlayer("line_sideways", duration_s=1.0)
    player.start(5 * NS_PER_S)
    first = player.due(5 * NS_PER_S, 9 * NS_PER_S)
    assert len(first) == 75
    assert not player.playing
    player.start(20 * NS_PER_S)
    assert [time - 15 * NS_PER_S for time, _ in player.due(20 * NS_PER_S, 30 * NS_PER_S)] == [time for time, _ in first]


def test_pulses_nobody_asked_for_in_time_are_dropped():
    player = PatternPlayer("line_forward")
    player.start(0)
    late = player.due(NS_PER_S, 2 * NS_PER_S)
    assert min(time for time, _ in late) >= NS_PER_S
    assert len(late) == 75


def test_a_stopped_player_is_silent():
    player = PatternPlayer("radial")
    player.start(0)
    player.stop()
    assert player.due(0, NS_PER_S) == []


def test_the_fan_is_faster_the_nearer_and_silent_beyond_its_range():
    fan = ProximityEffect("radial", range_m=0.2, far_scale=1.0, near_scale=3.0)
    assert fan.rate_scale(0.2) == pytest.approx(1.0)
    assert fan.rate_scale(0.1) == pytest.approx(2.0)
    assert fan.rate_scale(-0.05) == pytest.approx(3.0)
    assert fan.rate_scale(0.205) is None
    assert fan.rate_scale(0.205, playing=True) == pytest.approx(1.0)
    assert fan.rate_scale(float("nan"), playing=True) is None


def test_the_bank_plays_touched_patterns_till_the_last_site_leaves_and_stimuli_to_their_end():
    bank = PatternBank(
        {
            "table": (PatternEffect("particle"),),
            "cube": (PatternEffect("line_forward", lasts="stimulus", duration_s=1.0),),
            "fan": (ProximityEffect("radial", range_m=0.2),),
        }
    )
    assert bank.watched == ("fan",)
    bank.touch("table", 0)
    bank.touch("cube", 0)
    bank.approach("fan", 0.5, 0)
    assert set(bank.playing) == {"table", "cube"}
    bank.leave("table")
    bank.leave("cube")
    first_half = bank.due(0, NS_PER_S // 2)
    bank.touch("cube", NS_PER_S // 2)  # touched again: the stimulus under way goes on
    pulses = first_half + bank.due(NS_PER_S // 2, 2 * NS_PER_S)
    assert [name for _, _, name in pulses] == ["cube"] * 75
    bank.approach("fan", 0.05, 2 * NS_PER_S)
    assert bank.playing == ("fan",)
    assert len(bank.due(2 * NS_PER_S, 3 * NS_PER_S)) > 60  # faster than the reference's 4 x 15
    bank.stop()
    assert bank.playing == ()


@pytest.mark.parametrize(
    "make",
    [
        lambda: PatternPlayer("spiral"),
        lambda: PatternPlayer("radial", direction="up"),
        lambda: PatternPlayer("radial", rate_scale=0.0),
        lambda: PatternPlayer("radial", sites=["elbow"]),
        lambda: PatternEffect("radial", duration_s=float("inf")),
        lambda: ProximityEffect("radial", range_m=-1.0),
        lambda: stimulus("radial", duration_s=-1.0),
        lambda: refresh_pulses("radial", -1),
    ],
)
def test_what_no_pattern_can_be_is_refused(make):
    with pytest.raises(InputError, match="allowed"):
        make()


def test_dropped_pulses_are_known_by_their_sites():
    player = PatternPlayer("line_forward", sites=SITES[:5])
    player.start(0)
    player.due(NS_PER_S, 2 * NS_PER_S)
    assert sorted(player.take_missed()) == sorted(list(range(5)) * 5)
    assert player.take_missed() == []

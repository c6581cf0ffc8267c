"""What the scheduler does, case by case. Times in the tests are milliseconds."""

from __future__ import annotations

import pytest

from haptics.errors import InputError
from haptics.scheduling import (
    CoilLimits,
    CoilPulse,
    Outcome,
    Priority,
    Request,
    Scheduler,
    Stroke,
    ThermalBudget,
    burst,
    contact,
    pulse,
    release,
)

MS = 1_000_000
JUMP_K = 0.18 * 69 / 102


def armed(coils_at_once: int = 3, limit_k: float = 25.0, **limits: float) -> Scheduler:
    scheduler = Scheduler(
        limits=CoilLimits(current_limit_a=3.9 * coils_at_once, **limits),
        budgets=[ThermalBudget(limit_k=limit_k) for _ in range(15)],
    )
    assert scheduler.set_armed(True) == []
    return scheduler


def starts_ms(pulses: list[CoilPulse]) -> list[tuple[int, float]]:
    return [(pulse.channel, pulse.start_ns / MS) for pulse in pulses]


def reasons(outcomes: list[Outcome]) -> list[tuple[int, str | None, str | None]]:
    return [(outcome.request.channel, outcome.reason, outcome.held_by) for outcome in outcomes]


def test_twelve_amperes_allow_three_coils_of_the_worst_current():
    assert CoilLimits().coils_at_once == 3
    assert CoilLimits(current_limit_a=11.7).coils_at_once == 3  # 3 * 3.9, met exactly
    assert CoilLimits(current_limit_a=14.4, coil_current_a=(3.6,) * 15).coils_at_once == 4
    assert CoilLimits(current_limit_a=14.4, coil_current_a=(3.6,) * 14 + (3.9,)).coils_at_once == 3


def test_a_contact_is_one_stroke_toward_the_skin_and_a_release_one_back():
    scheduler = armed()
    scheduler.submit(contact(4, 0), 0)
    pulses, outcomes = scheduler.step(0, 0)
    assert pulses == [CoilPulse(4, 0, 0.010, True)]
    assert outcomes == [Outcome(contact(4, 0), True, None, 0, 1)]
    scheduler.submit(release(4, 20 * MS), 0)
    assert scheduler.step(20 * MS, 20 * MS)[0] == [CoilPulse(4, 20 * MS, 0.010, False)]


def test_a_pulse_is_a_pair_of_strokes_without_a_pause():
    scheduler = armed()
    scheduler.submit(pulse(0, 0), 0)
    assert scheduler.step(0, 0)[0] == [CoilPulse(0, 0, 0.003, True), CoilPulse(0, 3 * MS, 0.003, False)]


def test_a_burst_is_given_out_cycle_by_cycle_and_told_of_once_at_its_end():
    scheduler = armed()
    scheduler.submit(burst(0, 0, cycles=3), 0)
    pulses, outcomes = scheduler.step(0, 9 * MS)
    assert [p.start_ns / MS for p in pulses] == [0, 2, 5, 7]
    assert outcomes == []
    pulses, outcomes = scheduler.step(9 * MS, 20 * MS)
    assert [p.start_ns / MS for p in pulses] == [10, 12]
    assert outcomes == [Outcome(burst(0, 0, cycles=3), True, None, 0, 3)]


def test_nothing_starts_before_its_earliest_start_and_starts_are_exact():
    scheduler = armed()
    scheduler.submit(contact(0, 7_300_001), 0)
    assert scheduler.step(0, 7 * MS) == ([], [])
    pulses, outcomes = scheduler.step(7 * MS, 8 * MS)
    assert pulses[0].start_ns == 7_300_001
    assert outcomes[0].delay_ns == 0


def test_the_fourth_coil_starts_the_moment_a_slot_falls_free_and_says_what_it_waited_for():
    scheduler = armed()
    for channel in range(4):
        scheduler.submit(contact(channel, 0), 0)
    assert starts_ms(scheduler.step(0, 5 * MS)[0]) == [(0, 0), (1, 0), (2, 0)]
    pulses, outcomes = scheduler.step(5 * MS, 10 * MS)
    assert starts_ms(pulses) == [(3, 10)]
    assert reasons(outcomes) == [(3, None, "current")]
    assert outcomes[0].delay_ns == 10 * MS


def test_urgent_classes_go_first_and_one_class_goes_in_order_of_arrival():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(burst(0, 0, cycles=1), 0)
    scheduler.submit(pulse(1, 0), 0)
    scheduler.submit(contact(2, 0), 0)
    scheduler.submit(contact(3, 0), 0)
    scheduler.submit(release(4, 0), 0)
    pulses, _ = scheduler.step(0, 100 * MS)
    assert [p.channel for p in pulses] == [4, 2, 3, 1, 1, 0, 0]


def test_order_of_arrival_is_by_the_time_each_may_start():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(contact(0, 0), 0)
    scheduler.submit(contact(1, 9 * MS), 0)
    scheduler.submit(contact(2, 3 * MS), 0)
    assert starts_ms(scheduler.step(0, 100 * MS)[0]) == [(0, 0), (2, 10), (1, 20)]


def test_the_newest_request_of_a_channel_replaces_the_one_that_waits():
    scheduler = armed()
    older, newer = contact(0, 5 * MS, token="older"), pulse(0, 5 * MS, token="newer")
    assert scheduler.submit(older, 0) == []
    assert scheduler.submit(newer, MS) == [Outcome(older, False, "superseded", None, 0)]
    pulses, outcomes = scheduler.step(MS, 50 * MS)
    assert len(pulses) == 2
    assert [o.request.token for o in outcomes] == ["newer"]


def test_a_release_that_waits_survives_a_newer_contact_and_goes_first():
    scheduler = armed()
    scheduler.submit(contact(0, 0), 0)
    scheduler.step(0, 0)
    back, out = release(0, 2 * MS, token="back"), contact(0, 3 * MS, token="out")
    assert scheduler.submit(back, 2 * MS) == []
    assert scheduler.submit(out, 3 * MS) == []
    pulses, outcomes = scheduler.step(3 * MS, 50 * MS)
    assert [(p.start_ns // MS, p.toward_skin) for p in pulses] == [(10, False), (20, True)]
    assert [o.request.token for o in outcomes] == ["back", "out"]


def test_a_contact_that_is_denied_does_not_take_the_release_before_it_along():
    scheduler = armed(limit_k=2.1 * JUMP_K)
    scheduler.submit(contact(0, 0), 0)
    scheduler.step(0, 0)
    scheduler.submit(release(0, MS), MS)
    scheduler.submit(contact(0, 2 * MS), 2 * MS)
    pulses, outcomes = scheduler.step(2 * MS, 50 * MS)
    assert [(p.start_ns // MS, p.toward_skin) for p in pulses] == [(10, False)]
    assert [(o.request.priority, o.reason) for o in outcomes] == [(Priority.RELEASE, None), (Priority.CONTACT, "heat")]


@pytest.mark.parametrize("latest_ms", [3, 12])
def test_a_contact_that_comes_too_late_leaves_the_release_where_it_is(latest_ms):
    scheduler = armed()
    scheduler.submit(contact(0, 0), 0)
    scheduler.step(0, 0)
    scheduler.submit(release(0, MS), MS)
    told = scheduler.submit(contact(0, 2 * MS, latest_ms * MS), 5 * MS)
    pulses, outcomes = scheduler.step(5 * MS, 50 * MS)
    assert [(p.start_ns // MS, p.toward_skin) for p in pulses] == [(10, False)]
    assert sorted(str(o.reason) for o in [*told, *outcomes]) == ["None", "late"]


def test_only_the_newest_of_those_after_a_release_stays():
    scheduler = armed()
    scheduler.submit(contact(0, 0), 0)
    scheduler.step(0, 0)
    scheduler.submit(release(0, MS), MS)
    assert scheduler.submit(contact(0, 2 * MS), 2 * MS) == []
    assert reasons(scheduler.submit(pulse(0, 3 * MS), 3 * MS)) == [(0, "superseded", "channel")]
    pulses, outcomes = scheduler.step(3 * MS, 50 * MS)
    assert [o.request.priority for o in outcomes] == [Priority.RELEASE, Priority.PULSE]
    assert [p.start_ns // MS for p in pulses] == [10, 20, 23]


def test_a_release_asked_for_after_a_release_is_played_by_it():
    scheduler = armed()
    scheduler.submit(contact(0, 0), 0)
    scheduler.step(0, 0)
    for at_ms, make in enumerate((release, contact, release), start=1):
        scheduler.submit(make(0, at_ms * MS, token=at_ms), at_ms * MS)
    pulses, outcomes = scheduler.step(3 * MS, 50 * MS)
    assert starts_ms(pulses) == [(0, 10)]
    assert [(o.request.token, o.reason) for o in outcomes] == [(3, "superseded"), (1, None)]


def test_a_release_for_later_is_void_once_what_was_asked_for_after_it_starts():
    scheduler = armed()
    scheduler.submit(release(0, 40 * MS), 0)
    scheduler.submit(contact(0, MS), MS)
    pulses, outcomes = scheduler.step(MS, 100 * MS)
    assert [(p.start_ns // MS, p.toward_skin) for p in pulses] == [(1, True)]
    assert [(o.request.priority, o.reason) for o in outcomes] == [(Priority.RELEASE, "superseded"), (Priority.CONTACT, None)]


def test_a_contact_that_waits_can_be_withdrawn_and_nothing_else():
    scheduler = armed()
    scheduler.submit(contact(0, 5 * MS), 0)
    assert reasons(scheduler.withdraw_contact(0, 0)) == [(0, "superseded", None)]
    scheduler.submit(release(0, 5 * MS), 0)
    scheduler.submit(pulse(1, 5 * MS), 0)
    assert [scheduler.withdraw_contact(channel, 0) for channel in range(3)] == [[], [], []]
    assert scheduler.pending == 2


def unequal() -> Scheduler:
    """One coil of 7 A and fourteen of 3 A at 12 A."""
    scheduler = Scheduler(limits=CoilLimits(current_limit_a=12.0, coil_current_a=(7.0,) + (3.0,) * 14))
    scheduler.set_armed(True)
    return scheduler


def test_a_coil_that_draws_more_goes_with_as_many_others_as_the_current_allows():
    scheduler = unequal()
    for channel in range(7):
        scheduler.submit(contact(channel, 0), 0)
    assert starts_ms(scheduler.step(0, 25 * MS)[0]) == [(0, 0), (1, 0), (2, 10), (3, 10), (4, 10), (5, 10), (6, 20)]


def test_small_coils_do_not_starve_a_large_one():
    """Four coils of 3 A always run, never two ending together; the 7 A coil is kept what falls free."""
    scheduler = unequal()
    starts: list[tuple[int, float]] = []
    for at_ms in range(60):
        channel = 1 + at_ms % 14
        scheduler.submit(contact(channel, at_ms * MS), at_ms * MS)
        if at_ms == 20:
            scheduler.submit(contact(0, 20 * MS), 20 * MS)
        starts += starts_ms(scheduler.step(at_ms * MS, (at_ms + 1) * MS)[0])
    large_ms = next(start for channel, start in starts if channel == 0)
    older = [start for channel, start in starts if 20 < start < large_ms]
    assert large_ms - 20 <= 10 * (1 + len(older)), "one round for each that went before it"


def test_who_waits_behind_a_large_coil_goes_on_when_that_becomes_late():
    scheduler = unequal()
    for channel in (1, 2, 3):
        scheduler.submit(contact(channel, 0), 0)
    scheduler.submit(contact(0, MS, 6 * MS), 0)
    scheduler.submit(contact(4, 2 * MS), 0)
    pulses, outcomes = scheduler.step(0, 50 * MS)
    assert starts_ms(pulses)[3:] == [(4, 6.000001)]
    assert (0, "late", "current") in reasons(outcomes)


def test_a_coil_that_draws_more_than_the_supply_has_is_denied():
    scheduler = Scheduler(2, CoilLimits(current_limit_a=5.0, coil_current_a=(7.0, 3.0)))
    scheduler.set_armed(True)
    assert reasons(scheduler.submit(contact(0, 0), 0)) == [(0, "current", None)]
    scheduler.submit(contact(1, 0), 0)
    assert starts_ms(scheduler.step(0, 0)[0]) == [(1, 0)]


def test_a_request_waits_for_the_stroke_on_its_own_channel():
    scheduler = armed()
    scheduler.submit(contact(0, 0), 0)
    scheduler.step(0, 0)
    scheduler.submit(release(0, 4 * MS), 4 * MS)
    pulses, outcomes = scheduler.step(4 * MS, 30 * MS)
    assert starts_ms(pulses) == [(0, 10)]
    assert reasons(outcomes) == [(0, None, "channel")]


def test_a_more_urgent_request_cuts_a_burst_at_the_end_of_its_cycle():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(burst(0, 0, cycles=10), 0)
    scheduler.step(0, 0)
    scheduler.submit(contact(1, 7 * MS), 5 * MS)
    pulses, outcomes = scheduler.step(5 * MS, 50 * MS)
    assert starts_ms(pulses) == [(0, 5), (0, 7), (1, 10)]
    assert reasons(outcomes) == [(1, None, "current"), (0, "cut", "current")]
    assert outcomes[1].played
    assert outcomes[1].cycles == 2


def test_a_burst_is_not_cut_by_its_own_class():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(burst(0, 0, cycles=3), 0)
    scheduler.step(0, 0)
    scheduler.submit(burst(1, 0, cycles=1), 0)
    pulses, outcomes = scheduler.step(0, 50 * MS)
    assert starts_ms(pulses)[::2] == [(0, 5), (0, 10), (1, 15)]
    assert [o.reason for o in outcomes] == [None, None]


def test_a_burst_gives_way_to_a_newer_request_on_its_own_channel_before_it_would_run_into_it():
    scheduler = armed()
    scheduler.submit(burst(0, 0, cycles=10), 0)
    scheduler.step(0, 0)
    scheduler.submit(contact(0, 17 * MS), MS)
    pulses, outcomes = scheduler.step(MS, 50 * MS)
    assert starts_ms(pulses) == [(0, 5), (0, 7), (0, 10), (0, 12), (0, 17)]  # a cycle from 15 would end at 20
    assert reasons(outcomes) == [(0, "cut", "channel"), (0, None, None)]
    assert outcomes[0].cycles == 3


def test_pulses_and_contacts_are_never_cut():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(pulse(0, 0), 0)
    scheduler.step(0, 0)
    scheduler.submit(release(1, 3 * MS), 0)
    assert starts_ms(scheduler.step(3 * MS, 20 * MS)[0]) == [(1, 6)]  # the pulse's 3 ms there and 3 ms back


def test_a_request_not_started_by_its_latest_start_is_denied_late_and_says_what_held_it():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(contact(0, 0), 0)
    scheduler.submit(contact(1, 0, 9 * MS), 0)
    assert reasons(scheduler.step(0, 8 * MS)[1]) == [(0, None, None)]
    assert scheduler.step(8 * MS, 20 * MS) == ([], [Outcome(contact(1, 0, 9 * MS), False, "late", None, 0, "current")])


def test_lateness_is_told_as_soon_as_it_is_certain():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(contact(0, 0), 0)
    scheduler.submit(contact(1, 0, 9 * MS), 0)
    assert reasons(scheduler.step(0, 9 * MS)[1]) == [(0, None, None), (1, "late", "current")]


def test_a_start_asked_for_in_the_past_does_not_jump_the_queue():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(contact(0, 0), 0)
    scheduler.step(0, 0)
    scheduler.submit(contact(1, MS), MS)
    scheduler.submit(contact(2, -50 * MS), 2 * MS)
    assert starts_ms(scheduler.step(2 * MS, 50 * MS)[0]) == [(1, 10), (2, 20)]


def test_a_request_may_start_at_its_very_latest_start():
    scheduler = armed(coils_at_once=1)
    scheduler.submit(contact(0, 0), 0)
    scheduler.submit(contact(1, 0, 10 * MS), 0)
    assert starts_ms(scheduler.step(0, 20 * MS)[0]) == [(0, 0), (1, 10)]


def test_a_request_that_comes_too_late_is_denied_at_once_and_still_replaces_the_older():
    scheduler = armed()
    scheduler.submit(contact(0, 30 * MS), 0)
    assert reasons(scheduler.submit(release(0, 0, 5 * MS), 10 * MS)) == [(0, "superseded", None), (0, "late", None)]


def test_a_missed_step_denies_what_was_due_meanwhile_rather_than_play_it_late():
    scheduler = armed()
    scheduler.submit(contact(0, 5 * MS, 6 * MS), 0)
    assert scheduler.step(7 * MS, 9 * MS) == ([], [Outcome(contact(0, 5 * MS, 6 * MS), False, "late", None, 0)])


def test_unarmed_denies_and_disarming_denies_what_is_pending():
    scheduler = Scheduler()
    assert reasons(scheduler.submit(contact(0, 0), 0)) == [(0, "unarmed", None)]
    scheduler.set_armed(True)
    assert scheduler.submit(contact(0, 0), 0) == []
    assert reasons(scheduler.set_armed(False)) == [(0, "unarmed", None)]
    assert scheduler.step(0, 100 * MS) == ([], [])


def test_stop_denies_everything_pending_with_its_reason_and_ends_bursts_after_what_was_given_out():
    scheduler = armed()
    scheduler.submit(burst(0, 0), 0)
    scheduler.submit(contact(1, 50 * MS), 0)
    scheduler.step(0, 5 * MS)
    assert reasons(scheduler.stop("ended")) == [(0, "cut", "ended"), (1, "ended", None)]
    assert scheduler.pending == 0
    assert scheduler.step(5 * MS, 100 * MS) == ([], [])
    assert scheduler.stop() == []


def test_stop_denies_a_release_that_goes_before_what_waits_as_well():
    scheduler = armed()
    scheduler.submit(release(0, 40 * MS), 0)
    scheduler.submit(contact(0, 50 * MS), 0)
    assert sorted(reasons(scheduler.stop("ended"))) == [(0, "ended", None), (0, "ended", None)]
    assert scheduler.pending == 0
    assert scheduler.step(MS, 200 * MS) == ([], [])


def test_a_limit_below_one_coil_denies_for_current():
    scheduler = armed(coils_at_once=0)
    assert reasons(scheduler.submit(release(0, 0), 0)) == [(0, "current", None)]


def test_a_contact_is_admitted_only_if_its_release_is_affordable_too():
    scheduler = armed(limit_k=2.5 * JUMP_K)
    scheduler.submit(contact(0, 0), 0)
    scheduler.submit(contact(1, 0), 0)
    assert [o.reason for o in scheduler.step(0, 0)[1]] == [None, None]
    scheduler.submit(contact(0, 20 * MS), 20 * MS)  # would fit, but not with its release
    assert reasons(scheduler.step(20 * MS, 20 * MS)[1]) == [(0, "heat", "heat")]
    scheduler.submit(release(0, 30 * MS), 30 * MS)
    assert [o.reason for o in scheduler.step(30 * MS, 30 * MS)[1]] == [None]


def test_a_burst_is_thinned_by_heat_to_the_cycles_that_fit():
    scheduler = armed(limit_k=(1 + 2.2) * JUMP_K)  # a reserved release, and 2.2 times 10 ms of burst
    scheduler.submit(burst(0, 0), 0)
    pulses, outcomes = scheduler.step(0, 100 * MS)
    assert len(pulses) == 2 * 4
    assert outcomes == [Outcome(burst(0, 0), True, "cut", 0, 4, "heat")]
    scheduler.submit(burst(0, 200 * MS), 200 * MS)
    assert reasons(scheduler.step(200 * MS, 200 * MS)[1]) == [(0, "heat", "heat")]


def test_a_release_nobody_paid_for_waits_until_the_coil_has_cooled():
    scheduler = armed(limit_k=1.5 * JUMP_K)
    scheduler.submit(release(0, 0), 0)
    scheduler.submit(release(1, 0), 0)
    scheduler.step(0, 0)
    scheduler.submit(release(0, 20 * MS), 20 * MS)
    pulses, outcomes = scheduler.step(20 * MS, 200_000 * MS)
    wait_s = 102 * 0.6931471805599453  # the first jump must fall to a half
    assert pulses[0].start_ns / 1e9 == pytest.approx(0.010 + wait_s, abs=1e-6)
    assert outcomes[0].reason is None
    assert outcomes[0].held_by == "heat"


@pytest.mark.parametrize("make", [contact, pulse, burst])
def test_a_limit_that_is_lowered_meanwhile_does_not_keep_a_pin_out(make):
    scheduler = armed()
    scheduler.submit(make(0, 0), 0)
    scheduler.step(0, 100 * MS)
    scheduler.budgets[0].limit_k = JUMP_K / 2
    scheduler.submit(release(0, 100 * MS), 100 * MS)
    pulses, outcomes = scheduler.step(100 * MS, 100 * MS)
    assert starts_ms(pulses) == [(0, 100)]
    assert reasons(outcomes) == [(0, None, None)]


def test_an_unpaid_release_that_can_never_be_afforded_waits_until_its_latest_start():
    scheduler = armed()
    scheduler.budgets[0].limit_k = JUMP_K / 2
    scheduler.submit(release(0, 0, 50 * MS), 0)
    assert scheduler.step(0, 49 * MS) == ([], [])
    assert reasons(scheduler.step(49 * MS, 50 * MS)[1]) == [(0, "late", "heat")]


def test_a_gap_keeps_the_coil_and_its_share_of_the_current_a_little_longer():
    scheduler = armed(coils_at_once=1, gap_s=0.0005)
    for channel in range(3):
        scheduler.submit(contact(channel, 0), 0)
    assert starts_ms(scheduler.step(0, 100 * MS)[0]) == [(0, 0), (1, 10.5), (2, 21)]


def test_a_start_given_out_ahead_does_not_take_the_slot_that_is_free_meanwhile():
    scheduler = armed(coils_at_once=2)
    scheduler.submit(burst(0, 0, cycles=1), 0)
    scheduler.step(0, 0)
    scheduler.submit(contact(1, 6 * MS), 0)
    scheduler.step(0, 6 * MS)
    scheduler.submit(release(2, MS), MS)
    assert starts_ms(scheduler.step(MS, 7 * MS)[0]) == [(2, 1)]


def test_power_of_each_coil_may_differ():
    powers = (36.0,) + (18.0,) * 14
    scheduler = Scheduler(limits=CoilLimits(coil_power_w=powers))
    scheduler.set_armed(True)
    scheduler.submit(contact(0, 0), 0)
    scheduler.submit(contact(1, 0), 0)
    scheduler.step(0, 0)
    assert scheduler.rise_k(0)[:3] == pytest.approx([2 * JUMP_K, JUMP_K, 0.0])
    assert scheduler.headroom_k(0)[2] == 25.0
    assert scheduler.budgets[0].clock_faults == 0  # heat is booked ahead; looking at it now is no fault of the clock


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: Scheduler(channels=0), "channels"),
        (lambda: Scheduler(budgets=[ThermalBudget()]), "budgets"),
        (lambda: Scheduler(channels=1, budgets=[ThermalBudget(limit_k=0.1)]), "limit_k"),
        (lambda: Scheduler(limits=CoilLimits(coil_power_w=(18.0, 18.0))), "coil_power_w"),
        (lambda: Scheduler(limits=CoilLimits(coil_current_a=(3.6, 3.6))), "coil_current_a"),
        (lambda: Scheduler(channels=1, limits=CoilLimits(coil_current_a=(3.6, 3.6))), "coil_current_a"),
        (lambda: CoilLimits(gap_s=-1e-3), "gap_s"),
        (lambda: CoilLimits(coil_current_a=0.0), "coil_current_a"),
        (lambda: Stroke(True, 0.011), "duration_s"),
        (lambda: contact(-1, 0), "channel"),
        (lambda: contact(0, 10, 9), "latest_ns"),
        (lambda: burst(0, 0, cycles=0), "cycles"),
        (lambda: Request(0, Priority.PULSE, (), 0, 0), "strokes"),
        (lambda: Request(0, Priority.PULSE, (Stroke(True, 0.003),), 0, 0), "toward_skin"),
        (lambda: Request(0, Priority.RELEASE, (Stroke(False, 0.003),) * 2, 0, 0), "release"),
        (lambda: armed().submit(contact(15, 0), 0), "channel"),
        (lambda: armed().step(5, 4), "until_ns"),
    ],
)
def test_bad_arguments_are_refused_by_name(build, says: str):
    with pytest.raises(InputError, match=says):
        build()

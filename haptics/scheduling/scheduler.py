"""Which coil when: a pure scheduler in virtual time.

``submit`` takes requests, ``step`` turns them into coil pulses with exact start times. As many units run at once as the supply
has current for, and nothing that has been given out is taken back. The most urgent that may start does, as soon as the current is
there, and nothing less urgent takes it first: that is what the latency bounds rest on (``latency.py``, and
``docs/explanation/schedule.md`` for the proofs).

A channel holds two requests at most: a release, and what was asked for after it. The release goes first, and lives until it has
played or what came after it has started; so a pin is not left out because its next contact is denied.

Heat is booked in full at the end of each unit, which is never less than the truth, and asked for at its start. Whatever is
admitted leaves room for one release on its coil, so that a pin can always be withdrawn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from haptics.errors import InputError
from haptics.physics.thermal.one_node import pulse_rise_k
from haptics.physics.thermal.trains import allowed_now, first_denied_index
from haptics.scheduling.limits import CoilLimits
from haptics.scheduling.requests import CHANNELS, LONGEST_STROKE_S, CoilPulse, Outcome, Priority, Request
from haptics.scheduling.supply_current import NA_PER_A, SupplyCurrent
from haptics.scheduling.thermal_budget import ThermalBudget
from haptics.scheduling.under_way import FOREVER_NS, UnderWay
from haptics.time import NS_PER_S, seconds_to_ns


class Scheduler:
    """Coils of one array under a current limit, each with its own heat account.

    Times are integer nanoseconds of the caller's clock. Starts unarmed.

    :param channels: number of coils.
    :param limits: current, power of a coil, gap.
    :param budgets: one heat account a coil; None: fresh ones with the default limit.
    :raises InputError: numbers that do not match, or a rise limit under which not even one release could ever play.
    """

    def __init__(
        self, channels: int = CHANNELS, limits: CoilLimits | None = None, budgets: Sequence[ThermalBudget] | None = None
    ):
        if channels < 1:
            raise InputError(f"channels = {channels}; expected at least 1")
        self.limits = limits if limits is not None else CoilLimits()
        self.budgets = [ThermalBudget() for _ in range(channels)] if budgets is None else list(budgets)
        if len(self.budgets) != channels:
            raise InputError(f"budgets has {len(self.budgets)} accounts; expected {channels}, one a channel")
        self._power_w = self.limits.power_w(channels)
        self._current_na = [round(current_a * NA_PER_A) for current_a in self.limits.current_a(channels)]
        self._supply = SupplyCurrent(self.limits.current_limit_a)
        self._reserve_j = [power_w * LONGEST_STROKE_S for power_w in self._power_w]  # any release
        for channel, (budget, reserve_j) in enumerate(zip(self.budgets, self._reserve_j, strict=True)):
            if reserve_j > 0 and budget.wait_s(1, budget.latest_ns, reserve_j) == math.inf:
                raise InputError(
                    f"limit_k = {budget.limit_k:g} K of channel {channel} is too low: one release warms the coil by more"
                )
        self._gap_ns = seconds_to_ns(self.limits.gap_s)
        self._channel_free_ns = [-FOREVER_NS] * channels
        self._release_paid = [False] * channels
        self._releases: dict[int, UnderWay] = {}  # those after which something else was asked for
        self._waiting: dict[int, UnderWay] = {}  # the newest of each channel
        self._bursting: dict[int, UnderWay] = {}
        self._next_ns = FOREVER_NS  # nothing can happen before this
        self._serial = 0
        self.armed = False

    @property
    def pending(self) -> int:
        """Requests without an outcome yet."""
        return len(self._releases) + len(self._waiting) + len(self._bursting)

    def set_armed(self, armed: bool) -> list[Outcome]:
        """Allow starts, or forbid them: everything pending is then denied, ``unarmed``.

        :param armed: whether starts are allowed.
        :return: outcomes of what was denied.
        """
        self.armed = armed
        return [] if armed else self.stop("unarmed")

    def stop(self, reason: str = "stopped") -> list[Outcome]:
        """Deny everything pending; a burst under way ends after the cycles already given out.

        What was given out stays booked (current, heat): only the link knows whether a board still played it. Arming is left as it
        is.

        :param reason: the outcomes' reason, or what a burst was ``held_by``.
        :return: one outcome for each request that was pending.
        """
        outcomes = [entry.cut(reason) for entry in self._bursting.values()]
        outcomes += [entry.denied(reason) for entry in self._all_waiting()]
        self._bursting.clear()
        self._releases.clear()
        self._waiting.clear()
        self._next_ns = FOREVER_NS
        return outcomes

    def submit(self, request: Request, now_ns: int) -> list[Outcome]:
        """Take a request. It replaces the one that waits on its channel, which is denied ``superseded``; but a release stays.

        That release goes first. It is ``superseded`` only if the new request starts before it, and supersedes a release that was
        asked for after it. A unit that plays on the channel is finished first; a burst there ends before the cycle that would run
        past the start of what waits. The new one may itself be refused at once: ``unarmed``; ``current`` if the supply has not
        enough for its coil; ``late``.

        :param request: what is asked for.
        :param now_ns: the time now (ns of the caller's clock).
        :return: outcomes that are known already, of this request or the one it replaced.
        :raises InputError: no such channel.
        """
        channel = request.channel
        if channel >= len(self.budgets):
            raise InputError(f"channel = {channel}; must be 0 to {len(self.budgets) - 1}")
        self._serial += 1
        entry = UnderWay(request, now_ns, self._serial)
        outcomes = self._make_way(channel, now_ns)
        if not self.armed:
            outcomes.append(entry.denied("unarmed"))
        elif self._current_na[channel] > self._supply.limit_na:
            outcomes.append(entry.denied("current"))
        elif entry.latest_ns < now_ns:
            outcomes.append(entry.denied("late"))
        else:
            self._waiting[channel] = entry
            self._next_ns = min(self._next_ns, entry.due_ns)
        return outcomes

    def withdraw_contact(self, channel: int, now_ns: int) -> list[Outcome]:
        """Deny the contact that waits on a channel, ``superseded``: it is not wanted any more. Anything else stays.

        :param channel: actuator index from 0.
        :param now_ns: the time now (ns).
        :return: its outcome; none if no contact waits there.
        """
        entry = self._waiting.get(channel)
        if entry is None or entry.request.priority is not Priority.CONTACT:
            return []
        return self._make_way(channel, now_ns)

    def _make_way(self, channel: int, now_ns: int) -> list[Outcome]:
        """Take the newest entry of a channel out of the queue; the first release is kept for its turn."""
        older = self._waiting.pop(channel, None)
        if older is None:
            return []
        if older.request.priority is Priority.RELEASE and channel not in self._releases:
            self._releases[channel] = older
            return []
        self._next_ns = min(self._next_ns, now_ns)  # others may have waited for this one's share of the current
        return [older.denied("superseded", self._holder(older, now_ns))]

    def step(self, now_ns: int, until_ns: int) -> tuple[list[CoilPulse], list[Outcome]]:
        """Commit every start that falls into ``now_ns <= start <= until_ns``; final.

        Starts are exact: the moment a slot or a coil falls free, or a request's earliest start. For that the spans of successive
        calls must touch (``until_ns`` not before the next call's ``now_ns``). A longer span lets a board know ahead, and lets a
        later, more urgent request wait that much longer. Pulses come out in order of their commitment; each coil's in order of
        time.

        :param now_ns: the time now (ns).
        :param until_ns: up to when starts are committed (ns).
        :return: pulses to send, and outcomes: of what was committed whole, of bursts that were cut, of what was denied.
        :raises InputError: ``until_ns`` before ``now_ns``.
        """
        if now_ns > until_ns:
            raise InputError(f"until_ns = {until_ns}; expected at least now_ns = {now_ns}")
        if until_ns < self._next_ns:
            return [], []
        pulses: list[CoilPulse] = []
        outcomes: list[Outcome] = []
        at_ns = now_ns
        while at_ns <= until_ns:
            self._start_all(at_ns, pulses, outcomes)
            at_ns = self._next_event_ns(at_ns)
        self._deny_late(until_ns + 1, outcomes)
        self._next_ns = min([at_ns, *(entry.latest_ns for entry in self._all_waiting())])
        return pulses, outcomes

    def rise_k(self, now_ns: int) -> list[float]:
        """Rise of each coil, with all that was given out booked, even if it plays a little after ``now_ns``.

        :param now_ns: the time now (ns).
        :return: kelvin above the room, one value a coil.
        """
        return [budget.rise_k(max(now_ns, budget.latest_ns)) for budget in self.budgets]

    def headroom_k(self, now_ns: int) -> list[float]:
        """Room under each coil's limit, booked like ``rise_k``.

        :param now_ns: the time now (ns).
        :return: kelvin, one value a coil, 0 where it is used up.
        """
        return [budget.headroom_k(max(now_ns, budget.latest_ns)) for budget in self.budgets]

    def pulses_left(self, channel: int, energy_j: float, spacing_s: float | None, now_ns: int) -> int | None:
        """Pulses that a coil still takes, each leaving room for a release after it.

        :param channel: actuator index from 0.
        :param energy_j: of one pulse (J).
        :param spacing_s: from pulse to pulse (s); None: all at once.
        :param now_ns: the time now (ns).
        :return: how many; None if there is no end.
        """
        budget = self.budgets[channel]
        reserve_k = pulse_rise_k(self._reserve_j[channel], budget.parameters)
        jump_k = pulse_rise_k(energy_j, budget.parameters)
        rise_k = budget.rise_k(max(now_ns, budget.latest_ns))
        limit_k = max(budget.limit_k - reserve_k, 0.0)
        if spacing_s is None or rise_k + jump_k > limit_k:
            return allowed_now(rise_k, jump_k, limit_k)
        return first_denied_index(jump_k, spacing_s, limit_k, rise_k, budget.parameters)

    def wait_s(self, request: Request, now_ns: int) -> float:
        """How long a request has to wait for its coil to be cool enough, if nothing else is asked of it.

        :param request: a contact, pulse or burst, which leaves room for a release.
        :param now_ns: the time now (ns).
        :return: seconds, 0 if it may play now; infinite if never.
        """
        channel = request.channel
        longest_s = max(sum(stroke.duration_s for stroke in unit) for unit in request.units)
        energy_j = self._power_w[channel] * longest_s + self._reserve_j[channel]
        budget = self.budgets[channel]
        return budget.wait_s(1, max(now_ns, budget.latest_ns), energy_j)

    def _all_waiting(self) -> Iterator[UnderWay]:
        yield from self._releases.values()
        yield from self._waiting.values()

    def _start_all(self, at_ns: int, pulses: list[CoilPulse], outcomes: list[Outcome]) -> None:
        """Start whoever may start at ``at_ns``, most urgent first, until the current does not suffice for the next one."""
        self._deny_late(at_ns, outcomes)
        ready = [w for w in self._all_waiting() if w.due_ns <= at_ns and self._channel_free_ns[w.request.channel] <= at_ns]
        for channel, entry in list(self._bursting.items()):
            if entry.due_ns <= at_ns:
                newer = [w.due_ns for w in (self._releases.get(channel), self._waiting.get(channel)) if w is not None]
                if newer and min(newer) < at_ns + entry.lengths_ns[entry.cycles] + self._gap_ns:
                    outcomes.append(self._bursting.pop(channel).cut("channel"))
                else:
                    ready.append(entry)
        ready.sort(key=_urgency)
        kept = False
        for entry in ready:
            channel = entry.request.channel
            if self._channel_free_ns[channel] > at_ns:
                continue  # the release before it has just started
            enough = not kept and self._supply.free_ns(self._current_na[channel]) <= at_ns
            kept = kept or not (enough or entry.cycles)  # what is left is for the one that waits; a burst does not
            self._start(entry, at_ns, enough, pulses, outcomes)

    def _start(self, entry: UnderWay, at_ns: int, enough: bool, pulses: list[CoilPulse], outcomes: list[Outcome]) -> None:
        """Commit the next unit of ``entry`` at ``at_ns``, or leave it waiting, or end it. ``enough``: the current suffices."""
        channel, playing = entry.request.channel, entry.begun_ns is not None
        obstacle = self._heat_obstacle(entry, at_ns) if enough else "current"
        if obstacle is not None:
            if playing:
                outcomes.append(self._bursting.pop(channel).cut(obstacle))
            elif obstacle == "heat" and entry.request.priority is not Priority.RELEASE:
                outcomes.append(self._waiting.pop(channel).denied("heat", "heat"))
            return
        unit, end_ns = entry.units[entry.cycles], at_ns + entry.lengths_ns[entry.cycles]
        stroke_ns = at_ns
        for stroke in unit:
            pulses.append(CoilPulse(channel, stroke_ns, stroke.duration_s, stroke.toward_skin, entry.request.token))
            stroke_ns += seconds_to_ns(stroke.duration_s)
        entry.held_by = entry.held_by if playing else self._holder(entry, at_ns - 1)
        self.budgets[channel].spend(self._unit_energy_j(entry), end_ns)
        self._release_paid[channel] = entry.request.priority is not Priority.RELEASE
        self._channel_free_ns[channel] = end_ns + self._gap_ns
        self._supply.take(self._current_na[channel], at_ns, self._channel_free_ns[channel])
        if not playing:
            entry.begun_ns = at_ns
            self._leave_queue(entry, at_ns, outcomes)
            self._bursting[channel] = entry
            entry.order = (int(entry.request.priority), 0, *entry.order[2:])  # its next cycle goes before its class
        entry.cycles += 1
        entry.due_ns = self._channel_free_ns[channel]
        if entry.cycles == len(entry.units):
            del self._bursting[channel]
            outcomes.append(entry.played())

    def _leave_queue(self, entry: UnderWay, at_ns: int, outcomes: list[Outcome]) -> None:
        """``entry`` starts: a release that was to go before it is void, and so is a release asked for after a release."""
        channel = entry.request.channel
        void, newest = self._releases.pop(channel, None), self._waiting.get(channel)
        if newest is entry:
            del self._waiting[channel]
        elif newest is not None and newest.request.priority is Priority.RELEASE:
            void = self._waiting.pop(channel)
        else:
            void = None
        if void is not None:
            outcomes.append(void.denied("superseded", self._holder(void, at_ns)))

    def _heat_obstacle(self, entry: UnderWay, at_ns: int) -> str | None:
        """``heat`` if the next unit may not start at ``at_ns``.

        A release that an admitted pulse has paid for is never held. Another one (the pin should be in already) is made to
        wait until the coil has cooled enough, which is moved into its due time.
        """
        channel, budget = entry.request.channel, self.budgets[entry.request.channel]
        energy_j = self._unit_energy_j(entry)
        if entry.request.priority is not Priority.RELEASE:
            return None if budget.allows(energy_j, at_ns, self._reserve_j[channel]) else "heat"
        if self._release_paid[channel] or budget.allows(energy_j, at_ns):
            return None
        entry.held_by = "heat"
        wait_s = budget.wait_s(1, at_ns, energy_j)
        entry.due_ns = FOREVER_NS if wait_s == math.inf else at_ns + math.ceil(wait_s * NS_PER_S) + 1
        return "heat"

    def _unit_energy_j(self, entry: UnderWay) -> float:
        return self._power_w[entry.request.channel] * entry.lengths_ns[entry.cycles] / NS_PER_S

    def _next_event_ns(self, after_ns: int) -> int:
        """The next moment at which something that waits could start."""
        next_ns, first_late_ns, behind = FOREVER_NS, FOREVER_NS, False
        for entry in self._all_waiting():
            channel = entry.request.channel
            may_ns = max(entry.due_ns, self._channel_free_ns[channel], self._supply.free_ns(self._current_na[channel]))
            if may_ns > after_ns:
                next_ns, first_late_ns = min(next_ns, may_ns), min(first_late_ns, entry.latest_ns + 1)
            else:
                behind = True  # it may start when a more urgent one that needs more current has started, or has become late
        for entry in self._bursting.values():
            next_ns = min(next_ns, entry.due_ns)
        return max(min(next_ns, first_late_ns) if behind else next_ns, after_ns + 1)

    def _deny_late(self, at_ns: int, outcomes: list[Outcome]) -> None:
        for queue in (self._releases, self._waiting):
            for channel in [channel for channel, entry in queue.items() if entry.latest_ns < at_ns]:
                entry = queue.pop(channel)
                outcomes.append(entry.denied("late", self._holder(entry, entry.latest_ns)))

    def _holder(self, entry: UnderWay, at_ns: int) -> str | None:
        """What keeps ``entry`` from starting at ``at_ns``, or last kept it."""
        if entry.due_ns <= at_ns:
            if self._channel_free_ns[entry.request.channel] > at_ns:
                return "channel"
            if self._supply.free_ns(self._current_na[entry.request.channel]) > at_ns:
                return "current"
        return entry.held_by


def _urgency(entry: UnderWay) -> tuple[int, ...]:
    return entry.order

"""Driver of the tactor array (protocol: ``pulse``, ``cancel``, ``tactiles_telemetry`` in ``docs/reference/protocol.md``).

Turns "contact here", "pulse there" into coil pulses on the board's clock. Heat, current and priorities are the scheduler's;
what the board itself refuses comes back as a denial with the board's reason. What is asked for lives while the board is armed:
disarmed, all of it is denied and forgotten, and nothing of it plays after the next arming. Takes an open link; never sleeps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

from haptics.devices.coil_commands import CoilCommands
from haptics.devices.pace import COMMAND_LEAD_NS, SHORTEST_LEAD_NS, TickSpacing
from haptics.devices.pins import Pin
from haptics.devices.result import Reason, Result, ResultKind
from haptics.errors import InputError
from haptics.link.connection import Link
from haptics.physics.latch.pulse import PULSE_BACK_S, PULSE_TOWARD_S, TRAIN_BACK_S, TRAIN_TOWARD_S
from haptics.scheduling import CoilLimits, CoilPulse, Outcome, Priority, Request, Scheduler, Stroke, ThermalBudget
from haptics.time import NS_PER_MS, NS_PER_S, seconds_to_ns
from haptics.units import nearest

_KINDS: dict[Priority, ResultKind] = {
    Priority.RELEASE: "release",
    Priority.CONTACT: "contact",
    Priority.PULSE: "pulse",
    Priority.BURST: "burst",
}
WORTH_ANOTHER_TRY = ("late", "full", "clock", "company", "unknown")
"""A pin that a board did not move for one of these reasons, or perhaps did not, is asked to move again, as long as that is still
wanted."""
RELEASE_AGAIN_NS = {"hot": 250 * NS_PER_MS}
"""A release is asked for again for these reasons too, after this long: a pin is not left out."""
PASSING = ("current", "late", "clock", "unknown", "company", "full")
"""What was denied for one of these may be asked for again at once."""
RATE_KEPT_NS = 2 * NS_PER_S
"""Two pulses farther apart than this, or longer ago, are no rate."""
MAX_CYCLES = 10
"""Of a burst: 50 ms (thesis 3.5.2)."""
_STROKES_OF_PINS = (Priority.CONTACT, Priority.RELEASE)
TELLING_NS = 50 * NS_PER_MS
"""A board that disarmed itself has reported it after this long, by telemetry at the latest: later strokes may not have played."""


class TactilesDriver:
    """The array as sites that can be touched.

    :param link: link with a tactiles board.
    :param sites: site of each channel, in channel order.
    :param limits: current limit and coil current, A, and each coil's power, W.
    :param budgets: thermal budget of each channel.
    :param contact_pulse_s: coil time of a contact or release, 50 us to 10 ms (thesis 3.4.3).

    :ivar overdue: pulses asked for when their time had passed: their loop was ticked too seldom.
    """

    def __init__(
        self,
        link: Link,
        sites: Sequence[str],
        limits: CoilLimits,
        budgets: Sequence[ThermalBudget],
        contact_pulse_s: float = 0.010,
    ):
        self.link = link
        self.sites = tuple(sites)
        self.budgets = tuple(budgets)
        self._channel = {site: channel for channel, site in enumerate(self.sites)}
        self._scheduler = Scheduler(len(self.sites), limits, self.budgets)
        self._pins = [Pin() for _ in self.sites]
        self._askers = ["" for _ in self.sites]  # who asked last where each pin is to be
        self._armed = False
        pulse_s = PULSE_TOWARD_S + PULSE_BACK_S
        self._pulse_j = [power_w * pulse_s for power_w in limits.power_w(len(self.sites))]
        self._last_pulses = [(0, 0) for _ in self.sites]  # starts of the last two that played, ns
        self._spacing = TickSpacing()
        self._now_ns = 0
        self._again: dict[int, int] = {}
        self._contact = (Stroke(True, contact_pulse_s),)
        self._release = (Stroke(False, contact_pulse_s),)
        self._pulse = (Stroke(True, PULSE_TOWARD_S), Stroke(False, PULSE_BACK_S))
        self._cycle = (Stroke(True, TRAIN_TOWARD_S), Stroke(False, TRAIN_BACK_S))
        self._requests: dict[int, tuple[Request, str]] = {}  # with its owner
        self._outcomes: dict[int, Outcome] = {}  # of those whose commands were not all answered
        self._commands = CoilCommands(link)
        self._later: list[tuple[int, str, int, str]] = []
        self._next_token = 0
        self._ended: Reason | None = None  # going off: nothing but releases from now on
        self._results: list[Result] = []
        self.overdue = 0

    @property
    def armed(self) -> bool:
        """Whether what is asked for can play."""
        return self._armed

    def contact(self, site: str, now_ns: int, at_ns: int | None = None, owner: str = "") -> bool:
        """Bring the pin of a site to the skin, where it stays without power (thesis 3.4.5).

        :param site: one of ``sites``.
        :param now_ns: ns on the link's clock.
        :param at_ns: wanted start of the coil pulse, ns; as soon as possible if None or too near.
        :param owner: named in the result.
        :return: False if it is out, or on its way, already: nothing was asked for then.
        :raises InputError: no tactor sits at this site.
        """
        return self._set_pin(site, True, now_ns, at_ns, owner)

    def release(self, site: str, now_ns: int, at_ns: int | None = None, owner: str = "") -> bool:
        """Withdraw the pin of a site; a contact that waits is given up.

        :param site: one of ``sites``.
        :param now_ns: ns on the link's clock.
        :param at_ns: wanted start of the coil pulse, ns; as soon as possible if None or too near.
        :param owner: named in the result.
        :return: False if it is in, or on its way, already: nothing was asked for then.
        :raises InputError: no tactor sits at this site.
        """
        return self._set_pin(site, False, now_ns, at_ns, owner)

    def pulse(self, site: str, now_ns: int, at_ns: int | None = None, owner: str = "") -> None:
        """One pulse-mode stroke: toward the skin and back at once, without touching it (thesis 3.4.5).

        A pin that is out stays out: the request is denied, ``contact``.

        :param site: one of ``sites``.
        :param now_ns: ns on the link's clock.
        :param at_ns: wanted start, ns; as soon as possible if None or too near.
        :param owner: named in the result.
        :raises InputError: no tactor sits at this site.
        """
        channel = self._channel_of(site)
        self.overdue += at_ns is not None and at_ns < now_ns
        if at_ns is not None and self._armed and self._spacing.lead_ns > COMMAND_LEAD_NS:
            self._play_later([(at_ns, site, now_ns, owner)])  # others of this site may come before it, until the next tick
        else:
            self._ask_pulse(channel, now_ns, at_ns, owner)

    def miss(self, site: str, now_ns: int, owner: str = "") -> None:
        """A pulse whose time had passed before anybody came to ask for it: denied, ``late``; ``unarmed`` while that is so.

        :param site: one of ``sites``.
        :param now_ns: ns on the link's clock.
        :param owner: named in the result.
        :raises InputError: no tactor sits at this site.
        """
        channel = self._channel_of(site)
        self.overdue += 1
        self._deny(channel, "pulse", "late" if self._armed else "unarmed", now_ns, owner)

    def train(self, site: str, count: int, period_ns: int, now_ns: int, owner: str = "") -> None:
        """Pulses at a steady rate; each is a request of its own.

        :param site: one of ``sites``.
        :param count: how many.
        :param period_ns: from start to start, ns.
        :param now_ns: ns on the link's clock.
        :param owner: named in the results.
        :raises InputError: no tactor sits at this site.
        """
        channel = self._channel_of(site)
        if not self._armed:
            for _ in range(count):
                self._deny(channel, "pulse", "unarmed", now_ns, owner)
            return
        first_ns = now_ns + COMMAND_LEAD_NS
        self._play_later([(first_ns + i * period_ns, site, now_ns, owner) for i in range(count)])

    def burst(self, site: str, cycles: int, now_ns: int, at_ns: int | None = None, owner: str = "") -> None:
        """Cycles of 5 ms, 200 Hz (thesis 3.4.5); may be cut at the end of a cycle by something more urgent.

        :param site: one of ``sites``.
        :param cycles: 1 to 10, as a burst lasts at most 50 ms (thesis 3.5.2).
        :param now_ns: ns on the link's clock.
        :param at_ns: wanted start, ns; as soon as possible if None or too near.
        :param owner: named in the result.
        :raises InputError: no tactor sits at this site, or too many cycles.
        """
        if not 1 <= cycles <= MAX_CYCLES:
            raise InputError(f"cycles = {cycles}; must be 1 to {MAX_CYCLES} (a burst lasts at most 50 ms)")
        channel = self._channel_of(site)
        if self._armed and self._ended is not None:
            self._deny(channel, "burst", self._ended, now_ns, owner)
        elif self._armed and self._in_contact(channel):
            self._deny(channel, "burst", "contact", now_ns, owner)
        else:
            self._make_sure_in(channel, now_ns)
            self._submit(channel, Priority.BURST, self._cycle * cycles, now_ns, at_ns, owner)

    def tick(self, now_ns: int) -> None:
        """Send what is due until the next tick and the command lead after it, and note what the board answered.

        Best every millisecond. Called less often it sends that much farther ahead, at 30 Hz still all of it in time.

        :param now_ns: ns on the link's clock.
        """
        self._now_ns = now_ns
        self._spacing.observe(now_ns)
        first_ns, last_ns = now_ns + SHORTEST_LEAD_NS, now_ns + self._spacing.lead_ns
        if self._again:
            self._try_again(now_ns)
        pulses: list[CoilPulse] = []
        outcomes: list[Outcome] = []
        while self._later and self._later[0][0] <= last_ns:
            at_ns, site, _, owner = self._later.pop(0)
            self.overdue += at_ns < now_ns
            if at_ns > first_ns:  # give out what comes before, so that this one does not replace it
                self._give_out(first_ns, at_ns - 1, pulses, outcomes)
            self._ask_pulse(self._channel[site], now_ns, at_ns, owner)
        self._give_out(first_ns, last_ns, pulses, outcomes)
        if pulses:
            self._commands.send(pulses, now_ns)
        for outcome in outcomes:
            self._settle(outcome)
        if not self._commands.idle:
            for token in self._commands.read():
                self._close(token)

    def _try_again(self, now_ns: int) -> None:
        for channel in [channel for channel, due_ns in self._again.items() if due_ns <= now_ns]:
            del self._again[channel]
            self._set_pin(self.sites[channel], self._pins[channel].wanted_out, now_ns, None, self._askers[channel])

    def _give_out(self, first_ns: int, last_ns: int, pulses: list[CoilPulse], outcomes: list[Outcome]) -> None:
        more_pulses, more_outcomes = self._scheduler.step(first_ns, last_ns)
        pulses += more_pulses
        outcomes += more_outcomes

    def take_results(self) -> list[Result]:
        """What became of requests; each gives exactly one result, sooner or later.

        :return: results since the last call.
        """
        results, self._results = self._results, []
        return results

    def set_armed(self, armed: bool, sure_until_ns: int | None = None) -> None:
        """The board was armed, or is no longer: without, every request is denied, ``unarmed``. Either way nothing is wanted.

        :param armed: whether it is armed now.
        :param sure_until_ns: strokes that end later may not have played: the board was made safe then, or perhaps was.
        """
        self._armed = False  # nothing of what is settled now is tried again
        self._again.clear()
        self._deny_later("unarmed")
        for pin in self._pins:
            pin.wanted_out = False
        for outcome in self._scheduler.set_armed(False):
            self._settle(outcome)
        for token in [*self._commands.read(), *self._commands.give_up()]:
            self._close(token)
        if sure_until_ns is not None:
            for pin in self._pins:
                pin.doubt(sure_until_ns)
        self._armed, self._ended = armed, None
        self._scheduler.set_armed(armed)

    def withdraw_all(self, now_ns: int) -> None:
        """Release every pin that is out, may be out, or is on its way: the first step of going off.

        :param now_ns: ns on the link's clock.
        """
        for site, pin in zip(self.sites, self._pins, strict=True):
            if pin.heading is not False:
                self.release(site, now_ns)

    def end(self, reason: Reason) -> None:
        """Deny whatever has not started, and from now on, until it is armed again, everything but releases.

        :param reason: given in the results.
        """
        self._ended = reason
        self._again.clear()
        self._deny_later(reason)
        for outcome in self._scheduler.stop(reason):
            self._settle(outcome)

    def _deny_later(self, reason: Reason) -> None:
        for _, site, asked_ns, owner in self._later:
            self._deny(self._channel[site], "pulse", reason, asked_ns, owner)
        self._later.clear()

    @property
    def idle(self) -> bool:
        """Nothing waits to be scheduled, sent, answered or tried again."""
        return not self._requests and self._commands.idle and not self._again

    @property
    def busy_until_ns(self) -> int:
        """When the last coil pulse sent so far ends."""
        return self._commands.busy_until_ns

    def pins_out(self) -> tuple[bool, ...]:
        """Where the pins are, by the last stroke of each that a board acknowledged.

        :return: by channel, whether the pin is out; True also where nobody knows.
        """
        return tuple(pin.out is not False for pin in self._pins)

    def take_pins_for_in(self) -> None:
        """Believe, before the first arming, that no pin was left out: for a bench, where a person looks at the tactor."""
        for pin in self._pins:
            pin.out = False

    def pins_left_out(self) -> tuple[str, ...]:
        """Pins that are out, or may be, though nobody wants them out.

        :return: their sites, in the order of channels.
        """
        pins = zip(self.sites, self._pins, strict=True)
        return tuple(site for site, pin in pins if pin.out is not False and not pin.wanted_out)

    def rises_k(self, now_ns: int) -> list[float]:
        """How warm the coils can be.

        :param now_ns: ns on the link's clock.
        :return: by channel, temperature rise above the room by the thermal budget, an upper bound, K.
        """
        return self._scheduler.rise_k(now_ns)

    def headrooms_k(self, now_ns: int) -> list[float]:
        """How much warmer the coils may become.

        :param now_ns: ns on the link's clock.
        :return: by channel, room under the limit of the rise, K.
        """
        return self._scheduler.headroom_k(now_ns)

    def check_site(self, site: str) -> None:
        """Refuse a site that is not of this array.

        :param site: one of ``sites``.
        :raises InputError: no tactor sits there.
        """
        self._channel_of(site)

    def pulses_left(self, now_ns: int) -> list[int | None]:
        """How many more pulses the coils take at the present rate: that of the last two, while they are less than 2 s old.

        :param now_ns: ns on the link's clock.
        :return: by channel, a lower bound; at once where there is no rate; None where it can go on for ever.
        """
        left: list[int | None] = []
        for channel, (before_ns, last_ns) in enumerate(self._last_pulses):
            recent = last_ns - before_ns > 0 and now_ns - last_ns < RATE_KEPT_NS and last_ns - before_ns < RATE_KEPT_NS
            spacing_s = (last_ns - before_ns) / NS_PER_S if recent else None
            left.append(self._scheduler.pulses_left(channel, self._pulse_j[channel], spacing_s, now_ns))
        return left

    def _play_later(self, pulses: list[tuple[int, str, int, str]]) -> None:
        self._later += pulses
        self._later.sort()

    def _ask_pulse(self, channel: int, now_ns: int, at_ns: int | None, owner: str) -> None:
        if self._armed and self._ended is not None:
            self._deny(channel, "pulse", self._ended, now_ns, owner)
        elif self._armed and self._in_contact(channel):
            self._deny(channel, "pulse", "contact", now_ns, owner)
        else:
            self._make_sure_in(channel, now_ns)
            self._submit(channel, Priority.PULSE, self._pulse, now_ns, at_ns, owner)

    def _deny(self, channel: int, kind: ResultKind, reason: Reason, asked_ns: int, owner: str) -> None:
        """What came to no request."""
        retry_ns = asked_ns if reason in PASSING else None
        self._results.append(Result(self.sites[channel], kind, False, reason, asked_ns, None, owner, retry_ns))

    def _in_contact(self, channel: int) -> bool:
        """The pin is out, or a contact or release is under way: a newer request would take its place.

        Where nobody knows and nobody wants it out, it is brought in first.
        """
        pin = self._pins[channel]
        return pin.moving or pin.out is True or (pin.out is None and pin.wanted_out)

    def _make_sure_in(self, channel: int, now_ns: int) -> None:
        """A release ahead of what is asked for now, where a pin may be out that nobody wants out."""
        if self._armed and self._pins[channel].out is None:
            self._set_pin(self.sites[channel], False, now_ns, None, "")

    def _channel_of(self, site: str) -> int:
        if site not in self._channel:
            raise InputError(f"site = {site!r} has no tactor; allowed: {', '.join(self.sites)}{nearest(site, self.sites)}")
        return self._channel[site]

    def _set_pin(self, site: str, out: bool, now_ns: int, at_ns: int | None, owner: str) -> bool:
        channel = self._channel_of(site)
        pin = self._pins[channel]
        if self._armed and self._ended is not None and out:
            self._deny(channel, "contact", self._ended, now_ns, owner)
            return False
        if self._armed:
            self._askers[channel] = owner
            pin.wanted_out = out
            if not out:
                for outcome in self._scheduler.withdraw_contact(channel, now_ns):
                    self._settle(outcome)
            if pin.heading is out:
                return False
        priority, strokes = (Priority.CONTACT, self._contact) if out else (Priority.RELEASE, self._release)
        self._submit(channel, priority, strokes, now_ns, at_ns, owner)
        return True

    def _submit(
        self, channel: int, priority: Priority, strokes: tuple[Stroke, ...], now_ns: int, at_ns: int | None, owner: str
    ) -> None:
        soonest_ns = now_ns + COMMAND_LEAD_NS
        start_ns = soonest_ns if at_ns is None else max(soonest_ns, at_ns)
        request = Request(
            channel=channel,
            priority=priority,
            strokes=strokes,
            submitted_ns=now_ns,
            start_ns=start_ns,
            token=self._next_token,
        )
        self._requests[self._next_token] = request, owner
        if priority in _STROKES_OF_PINS:
            self._pins[channel].ask(self._next_token, priority is Priority.CONTACT)
        self._next_token += 1
        for outcome in self._scheduler.submit(request, now_ns):
            self._settle(outcome)

    def _settle(self, outcome: Outcome) -> None:
        token = outcome.request.token
        assert isinstance(token, int)  # ours
        self._outcomes[token] = outcome
        self._close(token)

    def _close(self, token: int) -> None:
        """The result of a request, once scheduler and board have both answered."""
        if token not in self._outcomes or self._commands.waits_for(token):
            return
        outcome, (request, owner) = self._outcomes.pop(token), self._requests.pop(token)
        refused = self._commands.take_refusal(token)
        last = self._commands.take_last(token)
        reason = outcome.reason if not outcome.played else refused
        played = reason is None
        if request.priority in _STROKES_OF_PINS:
            self._settle_pin(token, request, outcome, reason)
        elif last is not None:
            self._settle_pulse(request.channel, *last)
        kind, why = _KINDS[request.priority], cast(Reason | None, reason)
        if played and request.priority is Priority.PULSE and outcome.start_ns is not None:
            self._last_pulses[request.channel] = (self._last_pulses[request.channel][1], outcome.start_ns)
        retry_ns = None if why is None else self._retry_ns(request, why)
        site, asked_ns = self.sites[request.channel], request.submitted_ns
        self._results.append(Result(site, kind, played, why, asked_ns, outcome.start_ns, owner, retry_ns))

    def _retry_ns(self, request: Request, reason: Reason) -> int | None:
        """From when on the same request would be let through, by what is known now."""
        now_ns = max(self._now_ns, request.submitted_ns)
        if reason in RELEASE_AGAIN_NS:
            return now_ns + RELEASE_AGAIN_NS[reason]
        if reason != "heat":
            return now_ns if reason in PASSING else None
        wait_s = self._scheduler.wait_s(request, now_ns)
        return None if wait_s == math.inf else now_ns + seconds_to_ns(wait_s)

    def _settle_pin(self, token: int, request: Request, outcome: Outcome, reason: str | None) -> None:
        pin, out = self._pins[request.channel], request.priority is Priority.CONTACT
        ends_ns = (outcome.start_ns or 0) + seconds_to_ns(request.strokes[0].duration_s)
        pin.settle(token, None if reason == "unknown" else reason is None, ends_ns)
        if self._armed and pin.wanted_out is out:
            if reason in WORTH_ANOTHER_TRY:
                self._again[request.channel] = self._now_ns
            elif reason in RELEASE_AGAIN_NS and not out:
                self._again[request.channel] = self._now_ns + RELEASE_AGAIN_NS[reason]

    def _settle_pulse(self, channel: int, ends_ns: int, toward_skin: bool | None) -> None:
        """Of a pulse or a burst a board may have taken the stroke out and not the one back: that is made up for."""
        pin = self._pins[channel]
        pin.pulsed(toward_skin is False, ends_ns)
        if self._armed and pin.out is None and not pin.wanted_out and not pin.moving:
            self._again[channel] = self._now_ns

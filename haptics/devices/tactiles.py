"""Driver of the tactor array (protocol: ``pulse``, ``cancel``, ``tactiles_telemetry`` in ``docs/reference/protocol.md``).

Turns "contact here", "pulse there" into coil pulses on the board's clock. Heat, current and priorities are the scheduler's;
what the board itself refuses comes back as a denial with the board's reason. Takes an open link; never sleeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from haptics.devices.coil_ends import CoilEnds
from haptics.errors import ClockUncertain, InputError
from haptics.link.commands import Pending
from haptics.link.connection import Link
from haptics.link.messages import COIL_CHANNELS, DURATION_UNIT_US, Status
from haptics.physics.latch import PULSE_BACK_S, PULSE_TOWARD_S, TRAIN_BACK_S, TRAIN_TOWARD_S
from haptics.scheduling import CoilLimits, CoilPulse, Outcome, Priority, Request, Scheduler, Stroke, ThermalBudget
from haptics.time import NS_PER_MS, seconds_to_ns

COMMAND_LEAD_NS = 3 * NS_PER_MS
"""A pulse leaves the host this long before it starts: a tick, three frames at 500 kbaud, and the error of the clock."""


WORTH_ANOTHER_TRY = ("late", "full", "clock")
"""A pin that a board did not move for one of these reasons is asked to move again, as long as that is still wanted."""


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one request. ``reason`` says why a denied one was."""

    site: str
    kind: str
    played: bool
    reason: str | None
    requested_ns: int
    start_ns: int | None


class _InFlight:
    """A request whose strokes have been sent and whose replies are awaited."""

    __slots__ = ("outcome", "refused", "waiting")

    def __init__(self) -> None:
        self.waiting = 0
        self.refused: str | None = None
        self.outcome: Outcome | None = None


class TactilesDriver:
    """The array as sites that can be touched.

    :param link: link with a tactiles board.
    :param sites: site of each channel, in channel order.
    :param limits: current limit and coil current.
    :param budgets: thermal budget of each channel.
    :param contact_pulse_s: coil time of a contact or release, s (at most 10 ms; thesis 3.4.3).
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
        self._pin_out = [False] * len(self.sites)
        self._wanted_out = [False] * len(self.sites)
        self._again: list[int] = []
        self._contact = (Stroke(True, contact_pulse_s),)
        self._release = (Stroke(False, contact_pulse_s),)
        self._pulse = (Stroke(True, PULSE_TOWARD_S), Stroke(False, PULSE_BACK_S))
        self._cycle = (Stroke(True, TRAIN_TOWARD_S), Stroke(False, TRAIN_BACK_S))
        self._requests: dict[int, Request] = {}
        self._flying: dict[int, _InFlight] = {}
        self._replies: list[tuple[Pending, list[int]]] = []
        self._later: list[tuple[int, str]] = []
        self._ends = CoilEnds()
        self._next_token = 0
        self._results: list[Result] = []
        self.busy_until_ns = 0
        """When the last coil pulse sent so far ends."""

    def contact(self, site: str, now_ns: int, at_ns: int | None = None) -> bool:
        """Bring the pin of ``site`` to the skin, where it stays. False if it is out (or on its way) already.

        :param at_ns: wanted start of the coil pulse; as soon as possible if None or too near.
        :raises InputError: no actuator sits at this site.
        """
        return self._set_pin(site, True, now_ns, at_ns)

    def release(self, site: str, now_ns: int, at_ns: int | None = None) -> bool:
        """Withdraw the pin of ``site``. False if it is in already.

        :raises InputError: no actuator sits at this site.
        """
        return self._set_pin(site, False, now_ns, at_ns)

    def pulse(self, site: str, now_ns: int, at_ns: int | None = None) -> None:
        """One pulse-mode stroke: toward the skin and back at once, without touching it (thesis 3.4.5).

        A pin that is out stays out: the request is denied, ``contact``.

        :raises InputError: no actuator sits at this site.
        """
        channel = self._channel_of(site)
        if self._in_contact(channel):
            self._results.append(Result(site, "pulse", False, "contact", now_ns, None))
        else:
            self._submit(channel, Priority.PULSE, self._pulse, now_ns, at_ns)

    def train(self, site: str, count: int, period_ns: int, now_ns: int) -> None:
        """``count`` pulses, one each ``period_ns``; each is a request of its own.

        :raises InputError: no actuator sits at this site.
        """
        self._channel_of(site)
        first_ns = now_ns + COMMAND_LEAD_NS
        self._later += [(first_ns + i * period_ns, site) for i in range(count)]
        self._later.sort()

    def burst(self, site: str, cycles: int, now_ns: int, at_ns: int | None = None) -> None:
        """``cycles`` cycles of 5 ms, 200 Hz; may be cut at the end of a cycle by something more urgent.

        :param cycles: 1 to 10, as a burst lasts at most 50 ms (thesis 3.5.2).
        :raises InputError: no actuator sits at this site, or too many cycles.
        """
        if not 1 <= cycles <= 10:
            raise InputError(f"cycles = {cycles} is not allowed; allowed: 1 to 10 (a burst lasts at most 50 ms)")
        channel = self._channel_of(site)
        if self._in_contact(channel):
            self._results.append(Result(site, "burst", False, "contact", now_ns, None))
        else:
            self._submit(channel, Priority.BURST, self._cycle * cycles, now_ns, at_ns)

    def tick(self, now_ns: int) -> None:
        """Send what is due within the command lead and note what the board answered."""
        while self._later and self._later[0][0] <= now_ns + COMMAND_LEAD_NS:
            at_ns, site = self._later.pop(0)
            self.pulse(site, now_ns, at_ns)
        if self._again:
            again, self._again = self._again, []
            for channel in again:
                self._set_pin(self.sites[channel], self._wanted_out[channel], now_ns, None)
        pulses, outcomes = self._scheduler.step(now_ns, now_ns + COMMAND_LEAD_NS)
        if pulses:
            self._send(pulses, now_ns)
        for outcome in outcomes:
            self._settle(outcome)
        if self._replies:
            self._read_replies()

    def take_results(self) -> list[Result]:
        """Results since the last call; every request gives exactly one, sooner or later."""
        results, self._results = self._results, []
        return results

    def set_armed(self, armed: bool) -> None:
        """The board was armed, or is no longer: without, every request is denied, ``unarmed``."""
        for outcome in self._scheduler.set_armed(armed):
            self._settle(outcome)

    def withdraw_all(self, now_ns: int) -> None:
        """Release every pin that is out: the first step of going off."""
        for site, out in zip(self.sites, self._pin_out, strict=True):
            if out:
                self.release(site, now_ns)

    def end(self, reason: str) -> None:
        """Deny whatever has not started, with ``reason``."""
        for _, site in self._later:
            self._results.append(Result(site, "pulse", False, reason, 0, None))
        self._later.clear()
        for outcome in self._scheduler.stop(reason):
            self._settle(outcome)

    @property
    def idle(self) -> bool:
        """Nothing waits to be scheduled, sent or answered."""
        return not self._requests and not self._replies

    def pins_out(self) -> tuple[bool, ...]:
        """Per channel: whether the pin was last told to be out."""
        return tuple(self._pin_out)

    def rises_k(self, now_ns: int) -> list[float]:
        """Per channel: temperature rise by the thermal budget, K."""
        return self._scheduler.rise_k(now_ns)

    def headrooms_k(self, now_ns: int) -> list[float]:
        """Per channel: room under the limit of the rise, K."""
        return self._scheduler.headroom_k(now_ns)

    def _in_contact(self, channel: int) -> bool:
        """The pin is out, or its release waits: a newer request would take the release's place."""
        return self._pin_out[channel] or any(
            request.channel == channel and request.priority is Priority.RELEASE for request in self._requests.values()
        )

    def _channel_of(self, site: str) -> int:
        if site not in self._channel:
            raise InputError(f"site = {site!r} has no actuator; allowed: {', '.join(self.sites)}")
        return self._channel[site]

    def _set_pin(self, site: str, out: bool, now_ns: int, at_ns: int | None) -> bool:
        channel = self._channel_of(site)
        self._wanted_out[channel] = out
        if self._pin_out[channel] == out:
            return False
        self._pin_out[channel] = out
        priority, strokes = (Priority.CONTACT, self._contact) if out else (Priority.RELEASE, self._release)
        self._submit(channel, priority, strokes, now_ns, at_ns)
        return True

    def _submit(self, channel: int, priority: Priority, strokes: tuple[Stroke, ...], now_ns: int, at_ns: int | None) -> None:
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
        self._requests[self._next_token] = request
        self._next_token += 1
        for outcome in self._scheduler.submit(request, now_ns):
            self._settle(outcome)

    def _send(self, pulses: list[CoilPulse], now_ns: int) -> None:
        together: dict[int, list[CoilPulse]] = {}
        for pulse in pulses:
            together.setdefault(pulse.start_ns, []).append(pulse)
        for start_ns, group in sorted(together.items()):
            channels = toward = 0
            durations = [0] * COIL_CHANNELS
            for pulse in group:
                bit = 1 << pulse.channel
                channels |= bit
                toward |= bit if pulse.toward_skin else 0
                durations[pulse.channel] = round(pulse.duration_s * 1e6 / DURATION_UNIT_US)
                self.busy_until_ns = max(self.busy_until_ns, start_ns + seconds_to_ns(pulse.duration_s))
            tokens = [pulse.token for pulse in group if isinstance(pulse.token, int)]
            try:
                ticks = self._ends.start(
                    self.link.to_ticks(start_ns), {pulse.channel: durations[pulse.channel] for pulse in group}
                )
            except ClockUncertain:
                for token in tokens:
                    self._flying.setdefault(token, _InFlight()).refused = "clock"
                continue
            pending = self.link.send("pulse", ticks, channels, toward, durations, now_ns=now_ns)
            for token in tokens:
                self._flying.setdefault(token, _InFlight()).waiting += 1
            self._replies.append((pending, tokens))

    def _read_replies(self) -> None:
        waiting: list[tuple[Pending, list[int]]] = []
        for pending, tokens in self._replies:
            if not pending.done:
                waiting.append((pending, tokens))
                continue
            refused = None
            if pending.error is not None:
                refused = "unknown"
            elif pending.status != Status.OK:
                refused = Status(pending.status).name.lower()
            for token in tokens:
                flying = self._flying[token]
                flying.waiting -= 1
                flying.refused = flying.refused or refused
                self._close(token)
        self._replies = waiting

    def _settle(self, outcome: Outcome) -> None:
        token = outcome.request.token
        assert isinstance(token, int)  # ours
        flying = self._flying.setdefault(token, _InFlight())
        flying.outcome = outcome
        self._close(token)

    def _close(self, token: int) -> None:
        flying = self._flying[token]
        outcome = flying.outcome
        if outcome is None or flying.waiting:
            return
        del self._flying[token]
        request = self._requests.pop(token)
        played = outcome.played and flying.refused is None
        reason = None if played else (flying.refused or outcome.reason)
        if not played and request.priority in (Priority.CONTACT, Priority.RELEASE) and reason != "superseded":
            self._pin_out[request.channel] = request.priority is Priority.RELEASE
            if reason in WORTH_ANOTHER_TRY:
                self._again.append(request.channel)
        self._results.append(
            Result(
                self.sites[request.channel],
                request.priority.name.lower(),
                played,
                reason,
                request.submitted_ns,
                outcome.start_ns,
            )
        )

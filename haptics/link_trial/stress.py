"""Many scheduled commands over a line with faults, and whether the link kept its promises.

On a simulated board every edge of its outputs is held against the commands; on a real one, what telemetry counts.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from random import Random
from typing import Any

from haptics.errors import HapticsError, InputError, LinkError
from haptics.link.commands import NEVER_NS, Pending
from haptics.link.connection import Link
from haptics.link.events import Disarmed, Rebooted, Telemetry
from haptics.link.line_faults import LineFaults, parse_faults
from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS, DEFAULT_BAUD, HEAT_UNIT_MS, Board, State, Status
from haptics.link.port_url import is_simulated, query_of, with_defaults
from haptics.link.ports import BytePort, open_port
from haptics.link.runner import RealtimeRunner, VirtualRunner, connect, finish
from haptics.link.session import LinkSession
from haptics.link_trial.counted import Counted
from haptics.link_trial.effects import Effects, Expected
from haptics.link_trial.faulty_port import FaultyPort
from haptics.link_trial.observed import ObservedPort
from haptics.link_trial.report import StressReport, quantiles_us
from haptics.link_trial.workload import BrakeCommands, CoilCommands, Command
from haptics.time import NS_PER_MS, NS_PER_S

_IN_FLIGHT = 8
_SETTLED_NS = NS_PER_S
"""How long after its time a command is judged."""
_BLIND_NS = 200 * NS_PER_MS
"""How long a board may have been disarmed before its host learns of it."""
_DEAD_MAN_MS = 100.0  # of the protocol, whatever a board reports
_NOTICE_MS = 1.0
"""A board acts no sooner than its dead-man time is over, and at most so much later: it looks at least each millisecond."""
_DISCHARGE_MS = 5.0
_ARMINGS = 10
_SILENCES = 20
_SILENCE_NS = 400 * NS_PER_MS
_STEP_NS = NS_PER_MS // 20
_UP = (State.ARMED, State.DRIVING)


@dataclass(slots=True)
class _Sent:
    """A command in flight, with what it is expected to put on."""

    command: Command
    pending: Pending
    expected: list[Expected]
    void: bool = False  # the board was disarmed and forgot it


def stress(port: str, frames: int, faults: str = "", seed: int = 1, baud: int = DEFAULT_BAUD) -> StressReport:
    """Arm the board behind a port, send commands at random, then fall silent.

    :param port: a URL; a simulated board runs in virtual time unless the URL names a clock.
    :param frames: commands to send, at least 1.
    :param faults: see ``parse_faults``; played in a simulated board's cable, else on this side of the port.
    :param seed: of commands and faults, and of a simulated board unless its URL has one.
    :param baud: speed of a serial line.
    :return: counts and violations.
    :raises InputError: an argument that cannot be used.
    :raises LinkError: no board, or it does not arm.
    """
    if frames < 1:
        raise InputError(f"frames = {frames}; expected at least 1")
    in_url = query_of(port).get("faults", "")
    if faults and in_url:
        raise InputError(f"faults = {faults!r}, and the port's URL names faults too; give them in one place")
    faults = faults or in_url
    parsed = parse_faults(faults)
    opened, url = _open(port, parsed, faults, seed, baud)
    link = Link(opened, LinkSession(None, url, baud=baud))
    observed = opened if isinstance(opened, ObservedPort) else None
    virtual = observed is not None and observed.virtual
    runner = VirtualRunner([link]) if virtual else RealtimeRunner([link])
    try:
        return _Trial(runner, link, observed, parsed, faults, seed).run(frames)
    finally:
        _leave(runner, link)
        if isinstance(runner, RealtimeRunner):
            runner.close()
        link.close()


def _leave(runner: VirtualRunner | RealtimeRunner, link: Link) -> None:
    """However it ended, the board is not left to its dead-man."""
    with suppress(LinkError):
        finish(runner, link.stop(runner.now_ns()), port=link.name)


def _open(port: str, parsed: LineFaults, faults: str, seed: int, baud: int) -> tuple[BytePort, str]:
    if not is_simulated(port):
        opened = open_port(port, baud)
        return (FaultyPort(opened, parsed, seed) if faults else opened), port
    url = with_defaults(port, clock="virtual", seed=seed, **({"faults": faults} if faults else {}))
    return open_port(url, baud), url


class _Trial:
    """One run, from the handshake to the silence."""

    def __init__(
        self,
        runner: VirtualRunner | RealtimeRunner,
        link: Link,
        observed: ObservedPort | None,
        parsed: LineFaults,
        faults: str,
        seed: int,
    ):
        self._runner, self._link, self._observed = runner, link, observed
        self._parsed, self._faults, self._seed = parsed, faults, seed
        self._random = Random(f"{seed} commands")
        self._effects = Effects()
        if observed is not None:
            observed.watch(self._effects.switched)
        self._counted = Counted()
        self._open: list[Pending] = []
        self._sent: deque[_Sent] = deque()
        self._state: int = State.DISARMED
        self._telemetry: Any = None
        self._news = False  # the board is no longer armed
        self._reasons: list[str] = []  # why
        self._statuses = {"acknowledged": 0, "refused": 0, "unknown": 0, "late": 0, "pulses": 0, "lost": 0}
        self._contradictions = 0  # played though refused
        self._disarmed = 0
        self._too_short = 0
        self._min_margin_ns = NEVER_NS

    # The run.

    def run(self, frames: int) -> StressReport:
        """All of it."""
        connect(self._runner)
        began_ns = self._runner.now_ns()
        self._arm()
        workload = self._workload()
        count = 0
        while count < frames and self._link.error is None:
            if self._news:
                self._rearm()
                workload = self._workload()
                continue
            command = workload.next(self._runner.now_ns())
            if command is None:
                self._pass(NS_PER_MS)
                continue
            self._send(command)
            count += 1
            self._pass(self._random.randint(*workload.every_ns))
            self._hold_back()
        self._runner.wait_for(lambda: self._link.error is not None or all(one.pending.done for one in self._sent), 2.0)
        if self._link.error is None:
            self._pass(_SETTLED_NS)
        elif isinstance(self._runner, VirtualRunner):
            self._link.advance(self._runner.now_ns() + NS_PER_S)  # the board goes on without a host
        self._listen()
        self._judge(all_of_them=True)
        lasted_s = (self._runner.now_ns() - began_ns) / NS_PER_S
        ended = None if self._link.error is None else str(self._link.error)
        # A board whose host is gone makes itself safe, in the middle of a pulse if need be.
        self._too_short = len(self._effects.cut_ns) if ended is None else 0
        silence_ms = self._silence(workload) if ended is None and self._can_be_silent() else None
        return self._report(frames, silence_ms, lasted_s, ended)

    def _pass(self, duration_ns: int) -> None:
        """Let time pass."""
        if isinstance(self._runner, VirtualRunner):
            self._runner.run_until(self._runner.now_ns() + duration_ns)
        else:
            self._runner.wait_for(lambda: False, duration_ns / NS_PER_S)
        self._listen()

    def _hold_back(self) -> None:
        """No more than eight commands without an outcome: what waits in the host for long comes too late."""
        self._open = [pending for pending in self._open if not pending.done]
        if len(self._open) >= _IN_FLIGHT:
            self._runner.wait_for(lambda: sum(not pending.done for pending in self._open) < _IN_FLIGHT, 1.0)
            self._listen()

    def _send(self, command: Command) -> None:
        now_ns = self._runner.now_ns()
        try:
            tick = self._link.to_ticks(command.start_ns)
        except LinkError as error:
            pending = Pending(command.name)
            pending.fail(error)
            self._sent.append(_Sent(command, pending, []))
            return
        expected = [] if self._observed is None else self._effects.expect(command, self._observed.tick_ns(tick))
        pending = self._link.send(command.name, tick, *command.values, now_ns=now_ns)
        self._open.append(pending)
        self._sent.append(_Sent(command, pending, expected))
        self._judge()

    # What comes back.

    def _listen(self) -> None:
        for event in self._link.events():
            if isinstance(event, Telemetry):
                self._state, self._telemetry = event.message.state, event.message
                self._counted.take(event.message)
            elif isinstance(event, Disarmed):
                self._news = True
                self._reasons.append(event.reason)
            elif isinstance(event, Rebooted):
                self._news = True
                self._reasons.append("it rebooted")

    def _judge(self, all_of_them: bool = False) -> None:
        """Count the commands whose time is long past."""
        before_ns = self._runner.now_ns() - _SETTLED_NS
        while self._sent and (all_of_them or (self._sent[0].command.start_ns < before_ns and self._sent[0].pending.done)):
            one = self._sent.popleft()
            pending, counts = one.pending, self._statuses
            played = sum(entry.plays > 0 for entry in one.expected)
            if pending.ok:
                counts["acknowledged"] += 1
                if pending.board_time_ns is not None:
                    self._min_margin_ns = min(self._min_margin_ns, one.command.start_ns - pending.board_time_ns)
                counts["pulses"] += len(one.command.outputs)
                counts["lost"] += self._observed is not None and not one.void and played < len(one.command.outputs)
                continue
            unknown = not pending.done or (pending.error is not None and pending.sent)
            counts["unknown" if unknown else "refused"] += 1
            counts["late"] += pending.status == Status.LATE
            self._counted.perhaps += len(one.command.outputs) if unknown else 0
            self._contradictions += not unknown and played > 0

    # Arming, as a person would.

    def _arm(self) -> None:
        """:raises LinkError: it does not arm, however often it is asked."""
        link, runner = self._link, self._runner
        trouble: HapticsError | None = None
        for _ in range(_ARMINGS):
            if not runner.wait_for(lambda: link.ready or link.error is not None, 10.0) or link.error is not None:
                break
            try:
                finish(runner, link.send("disarm", now_ns=runner.now_ns()), port=link.name)
                finish(runner, link.arm(runner.now_ns()), port=link.name)
            except LinkError as error:
                trouble = error
                continue
            if runner.wait_for(self._is_up, 1.0):
                self._news = False
                self._effects.listening = True
                return
        if link.error is None:
            raise trouble or LinkError(link.name, "the board does not arm", "arm", "see its telemetry for the fault")

    def _is_up(self) -> bool:
        self._listen()
        return self._link.armed and self._state in _UP

    def _rearm(self) -> None:
        self._disarmed += 1
        self._effects.listening = False
        since_ns = self._runner.now_ns() - _BLIND_NS
        for one in self._sent:
            one.void = one.void or one.command.start_ns > since_ns
        self._effects.cut_ns = [cut_ns for cut_ns in self._effects.cut_ns if cut_ns < since_ns]
        self._arm()

    def _workload(self) -> CoilCommands | BrakeCommands:
        limits = tuple(self._link.identity.limits)
        if self._link.board == Board.TACTILES:
            heat = self._telemetry.heat if self._telemetry is not None else [limits[4] // HEAT_UNIT_MS] * COIL_CHANNELS
            return CoilCommands(limits, self._random, heat, self._runner.now_ns())
        measured = self._telemetry.capacitance if self._telemetry is not None else [0] * BRAKE_CHANNELS
        return BrakeCommands(limits, [channel for channel, one_pf in enumerate(measured) if one_pf], self._random)

    def _clock_is_sure(self) -> bool:
        try:
            self._link.to_ticks(self._runner.now_ns() + NS_PER_S)
        except LinkError:
            return False
        return True

    # Silence.

    def _can_be_silent(self) -> bool:
        return self._observed is not None and isinstance(self._runner, VirtualRunner)

    def _silence(self, workload: CoilCommands | BrakeCommands) -> float:
        """See until when anything is on after the host fell silent; infinite if nothing was on whenever it did."""
        for _ in range(_SILENCES):
            if self._news:
                self._rearm()
            silence_ns = self._fall_silent(workload)
            if silence_ns is not None:
                return silence_ns / NS_PER_MS
            self._pass(_SILENCE_NS)
        return inf

    def _fall_silent(self, workload: CoilCommands | BrakeCommands) -> int | None:
        """Leave the board with much to do and send nothing more; None if nothing was on by then."""
        observed, runner = self._observed, self._runner
        assert observed is not None
        assert isinstance(runner, VirtualRunner)
        self._effects.listening = False
        if not runner.wait_for(self._clock_is_sure, 10.0):
            return None
        lasting = workload.lasting(runner.now_ns())
        if not lasting:
            return None
        for command in lasting:
            tick = self._link.to_ticks(command.start_ns)
            self._effects.expect(command, observed.tick_ns(tick))
            self._link.send(command.name, tick, *command.values, now_ns=runner.now_ns())
        runner.run_until(lasting[0].start_ns + 20 * NS_PER_MS)
        runner.wait_for(lambda: bool(observed.out_waiting), 0.1)  # the worst moment: just after it was heard
        now_ns = silent_ns = runner.now_ns()
        was_on, was_sending, off_ns = False, bool(observed.out_waiting), None
        while now_ns < silent_ns + _SILENCE_NS:
            now_ns = min(max(observed.next_event() or now_ns, now_ns + 1), now_ns + _STEP_NS)
            runner.clock.advance_to(now_ns)
            self._link.advance(now_ns)
            silent_ns = now_ns if was_sending else silent_ns
            off_ns = now_ns if was_on else off_ns
            was_on, was_sending = bool(observed.energised()), bool(observed.out_waiting)
        return None if off_ns is None or off_ns < silent_ns else off_ns - silent_ns

    # The outcome.

    def _report(self, frames: int, silence_ms: float | None, lasted_s: float, ended: str | None) -> StressReport:
        counts, effects, counted = self._statuses, self._effects, self._counted
        seen = self._observed is not None
        limit_ms = _DEAD_MAN_MS + _NOTICE_MS + (_DISCHARGE_MS if self._link.board == Board.BRAKE else 0.0)
        sent = counts["acknowledged"] + counts["refused"] + counts["unknown"]
        duplicates = effects.duplicates if seen else counted.surplus(counts["pulses"])
        whole = ended is None and self._disarmed == 0  # else it is unknown what was forgotten, or not reported any more
        lost = counts["lost"] if seen else counted.missing(counts["pulses"]) if whole else None
        broken = {
            "commands had their effect twice": duplicates,
            "were played more than 100 us late": effects.late,
            "were played more than 100 us early": effects.early,
            "outputs went on without a command": effects.uncommanded,
            "outputs went on with the wrong sign": effects.reversed,
            "outputs stayed on more than 200 us too long": effects.too_long,
            "outputs went off more than 200 us too soon": self._too_short,
            "commands were played though the board had refused them": self._contradictions,
            "commands were acknowledged and never played": lost or 0,
        }
        violations = [f"{number} {what}" for what, number in broken.items() if number]
        if silence_ms == inf:
            violations.append(f"nothing was on when the host fell silent, {_SILENCES} times over: silence could not be judged")
        elif silence_ms is not None and silence_ms > limit_ms:
            violations.append(f"outputs were on for {silence_ms:g} ms after the host fell silent; limit {limit_ms:g} ms")
        if ended is not None and not self._parsed.ends_the_link:
            violations.append(f"the link ended after {sent} of {frames} commands: {ended}")
        return StressReport(
            port=self._link.name,
            seed=self._seed,
            faults=self._faults,
            sent=sent,
            acknowledged=counts["acknowledged"],
            refused=counts["refused"],
            unknown_outcomes=counts["unknown"],
            late=counts["late"],
            min_margin_ms=self._min_margin_ns / NS_PER_MS if counts["acknowledged"] else None,
            retried=self._link.session.counters.retries,
            pulses=counts["pulses"],
            lost=lost,
            duplicate_effects=duplicates,
            played_late=effects.late if seen else None,
            played_early=effects.early if seen else None,
            played_uncommanded=effects.uncommanded if seen else None,
            played_too_long=effects.too_long if seen else None,
            played_too_short=self._too_short if seen else None,
            disarmed=self._disarmed,
            disarmed_because=self._reasons,
            max_energised_after_silence_ms=silence_ms if silence_ms != inf else None,
            silence_limit_ms=limit_ms,
            edge_error_us=quantiles_us(effects.errors_ns) if seen else None,
            lasted_s=lasted_s,
            ended=ended,
            violations=violations,
        )

"""The coil board: fifteen H-bridges that are on for a stated time from a stated tick.

A pulse command is taken whole or refused whole. Reasons to refuse it, in this order: not armed (interlock); a mask,
duration or time out of range; no place in the queue (full, detail 0); a pulse already on one of its channels at that time
(full, detail the mask of those channels); more coils on at once than the current limit allows, each counted at the
maximum current a coil can draw (full, detail with bit 15 set); a coil that was on for too long of late (hot, detail the mask
of those coils). So the limits hold by construction, whatever is queued.
``CoilGuards`` watch that what is measured agrees. The feed between supply and drivers is on only while armed.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Mapping
from typing import Any, NamedTuple

from firmware_models.boards.board import FirmwareModel, Refusal
from firmware_models.boards.coil_guards import COIL_WORST_MA, CoilGuards
from firmware_models.boards.coil_heat import CoilHeat
from firmware_models.line.uart import NEVER_NS, Line
from firmware_models.options import Option
from firmware_models.plants.tactiles_plant import PLANT_OPTIONS, Actuators
from haptics.link.messages import COIL_CHANNELS, DURATION_UNIT_US, TICK_HZ, TICKS_PER_US, Board, Fault, State, Status
from haptics.physics.latch.parameters import LONGEST_PULSE_S
from haptics.time import NS_PER_S

QUEUE_DEPTH = 64
MIN_SUPPLY_MV = 3000
ON_TIME_MS = 2500
TOO_MANY_COILS = 1 << 15
_ALL_CHANNELS = (1 << COIL_CHANNELS) - 1
_TICKS_PER_UNIT = DURATION_UNIT_US * TICKS_PER_US
_LONGEST_PULSE, _COIL_CURRENT, _QUEUE, _MIN_SUPPLY, _ON_TIME = range(5)  # the order of identity.limits


class Pulse(NamedTuple):
    """One coil on, from edge to edge.

    :param start_ns: world time at which it goes on, ns.
    :param end_ns: world time at which it goes off, ns.
    :param start: the first edge in full tick counts.
    :param end: the last edge in full tick counts.
    :param channel: coil, 0 to 14.
    :param sign: 1 toward the skin, -1 back.
    """

    start_ns: int
    end_ns: int
    start: int
    end: int
    channel: int
    sign: int


class TactilesBoard(FirmwareModel):
    """Firmware of the coil board around its fifteen actuators.

    :param options: values of ``BOARD_OPTIONS``, ``plants.tactiles_plant.PLANT_OPTIONS`` and ``current_limit_a``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    """

    kind = Board.TACTILES
    channels = COIL_CHANNELS
    build = b"py-tac-1"
    telemetry_name = "tactiles_telemetry"
    stricter_upward = frozenset({_MIN_SUPPLY})

    @classmethod
    def options(cls) -> dict[str, Option]:
        return {
            "current_limit_a": Option(12.0, "limit the firmware was built with, all coils together", "A", 0.0, 60.0),
            **PLANT_OPTIONS,
        }

    @classmethod
    def built_limits(cls, options: Mapping[str, Any]) -> tuple[int, ...]:
        longest = round(LONGEST_PULSE_S * 1e6) // DURATION_UNIT_US
        return (longest, round(1000 * options["current_limit_a"]), QUEUE_DEPTH, MIN_SUPPLY_MV, ON_TIME_MS)

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int):
        super().__init__(options, transmitter, start_ns)
        self.plant = Actuators(options, self.plant_rng, start_ns, fed=False)
        self._guards = CoilGuards(self.plant)
        self.heat = CoilHeat(start_ns)
        self._queue: list[Pulse] = []
        self._on: dict[int, Pulse] = {}
        self._forget()
        self._commands |= {"pulse": self._pulse, "cancel": self._cancel}

    # Commands.

    def _pulse(self, message: Any) -> int:
        self._require_armed()
        if message.channels == 0 or message.channels & ~_ALL_CHANNELS:
            raise Refusal(Status.BAD_VALUE, 1)
        chosen = [channel for channel in range(COIL_CHANNELS) if message.channels >> channel & 1]
        if any(not 1 <= message.duration[channel] <= self.limits[_LONGEST_PULSE] for channel in chosen):
            raise Refusal(Status.BAD_VALUE, 3)
        start = self._due(message.time)
        if len(self._queue) + len(chosen) > self.limits[_QUEUE]:
            raise Refusal(Status.FULL)
        pulses: list[Pulse] = []
        for channel in chosen:
            end = start + message.duration[channel] * _TICKS_PER_UNIT
            sign = 1 if message.toward_skin >> channel & 1 else -1
            pulses.append(Pulse(self.ticks.time_ns(start), self.ticks.time_ns(end), start, end, channel, sign))
        self._check_room(pulses)
        self._check_heat(pulses)
        for pulse in pulses:
            insort(self._queue, pulse)
        self.heat.note(_on_time_s(self._queue), self.now_ns)
        return 0

    def _check_room(self, wanted: list[Pulse]) -> None:
        """Refuse what overlaps on a channel, or makes the worst concurrent current exceed the limit."""
        present = [*self._on.values(), *self._queue]
        blocked = 0
        for pulse in wanted:
            for other in present:
                if other.channel == pulse.channel and other.start < pulse.end and pulse.start < other.end:
                    blocked |= 1 << pulse.channel
        if blocked:
            raise Refusal(Status.FULL, blocked)
        together = [*present, *wanted]
        first, last = wanted[0].start, max(pulse.end for pulse in wanted)
        for edge in {first} | {pulse.start for pulse in present if first < pulse.start < last}:  # current peaks at a start
            coils = sum(pulse.start <= edge < pulse.end for pulse in together)
            if coils * COIL_WORST_MA > self.limits[_COIL_CURRENT]:
                raise Refusal(Status.FULL, TOO_MANY_COILS)

    def _check_heat(self, wanted: list[Pulse]) -> None:
        """Refuse what takes a coil's account of on-time beyond its limit."""
        hot = self.heat.hot(_on_time_s(wanted), _on_time_s(self._queue), self._max_on_s(), self.now_ns)
        if hot:
            raise Refusal(Status.HOT, hot)

    def _max_on_s(self) -> float:
        return self.limits[_ON_TIME] / 1000

    def _cancel(self, message: Any) -> int:
        kept = [pulse for pulse in self._queue if not message.channels >> pulse.channel & 1]
        forgotten = len(self._queue) - len(kept)
        self._queue = kept
        return forgotten

    def _charge_unasked(self, flowed_ns: int) -> None:
        """Current that no command explains may have been any coil's: each is charged with how long it flowed."""
        if flowed_ns:
            for channel in range(COIL_CHANNELS):
                self.heat.begin(channel, flowed_ns / NS_PER_S, self.now_ns)
            self.heat.note(_on_time_s(self._queue), self.now_ns)

    def _begin_arming(self) -> None:
        if self._supply_low():
            raise Refusal(Status.INTERLOCK, 1 << Fault.SUPPLY)
        hot = self.heat.beyond(self.built_limits(self._options)[_ON_TIME] / 1000, self.now_ns)
        if hot:
            raise Refusal(Status.HOT, hot)
        self.state = State.ARMED
        self.plant.feed(True, self.now_ns)
        self._guards.begin(self.now_ns)

    # Outputs.

    def _next_output_ns(self) -> int:
        begins = self._queue[0].start_ns if self._queue else NEVER_NS
        return min(begins, min((pulse.end_ns for pulse in self._on.values()), default=NEVER_NS), self._guards.next_ns)

    def _run_outputs(self) -> None:
        changes: dict[int, int] = {}
        was_on = len(self._on)
        for pulse in list(self._on.values()):
            if pulse.end_ns <= self.now_ns:
                changes[pulse.channel] = 0
                del self._on[pulse.channel]
        while self._queue and self._queue[0].start_ns <= self.now_ns:
            pulse = self._queue.pop(0)
            changes[pulse.channel] = pulse.sign
            self._on[pulse.channel] = pulse
            self.heat.begin(pulse.channel, _length_s(pulse), self.now_ns)
            self._played[pulse.channel] = (self._played[pulse.channel] + 1) & 0xFFFF
        if changes:
            self.plant.switch(changes, self.now_ns)
            self._guards.wake(self.now_ns, was_on)
        if self._guards.next_ns <= self.now_ns:
            limits = self.limits
            trip, flowed_ns = self._guards.sample(
                self.now_ns, len(self._on), limits[_MIN_SUPPLY], limits[_COIL_CURRENT], limits[_LONGEST_PULSE]
            )
            self._charge_unasked(flowed_ns)
            if trip is not None:
                self.latch(*trip)

    def _outputs_off(self) -> None:
        self._queue.clear()
        self._charge_unasked(self._guards.rest(self.now_ns))
        if self._on:
            self.plant.switch(dict.fromkeys(self._on, 0), self.now_ns)
            self._on.clear()
        self.plant.feed(False, self.now_ns)

    def _forget(self) -> None:
        self._played = [0] * COIL_CHANNELS

    def reset(self) -> None:
        """As of any board; what was in the queue the firmware no longer knows, and it is charged to the accounts as if played."""
        for pulse in self._queue:
            self.heat.begin(pulse.channel, _length_s(pulse), self.now_ns)
        super().reset()

    def brown_out(self) -> None:
        """As of any board; the accounts of on-time are lost, but for what was noted."""
        super().brown_out()
        self.heat.lose_power(self._max_on_s(), self.now_ns)

    def _supply_mv(self) -> int:
        return round(1000 * self.plant.volts)

    def _supply_low(self) -> bool:
        return self._supply_mv() < self.limits[_MIN_SUPPLY]

    def _cause_gone(self, fault: Fault) -> bool:
        return fault != Fault.SUPPLY or not self._supply_low()

    def _telemetry(self) -> tuple[Any, ...]:
        milliamps = min(round(1000 * self.plant.current_a(self.now_ns)), 0xFFFF)
        heat = self.heat.units(_on_time_s(self._queue), self.now_ns)
        return (self._played, heat, self._supply_mv(), milliamps, len(self._queue))

    # Seen from outside.

    def truth(self) -> dict[str, Any]:
        """The fifteen actuators and the supply as they are now.

        :return: lists over channels: ``rise_k, position_m, latched, energy_j, switches, coils_on``; ``fitted``, the channels that
            have an actuator; ``outside``, what was asked outside the level's valid range; ``time_ns, supply_v, state``;
            ``events`` since the last call as ``(time_ns, channel, kind, speed_m_s)``.
        """
        return {**self.plant.truth(self.now_ns), "state": self.state}

    def _act(self, channel: int, load: Mapping[str, float]) -> None:
        self.plant.load(channel, self.now_ns, **load)
        if self.armed:
            self._guards.wake(self.now_ns, len(self._on))

    def energised(self) -> list[int]:
        return self.plant.energised


def _length_s(pulse: Pulse) -> float:
    return (pulse.end - pulse.start) / TICK_HZ


def _on_time_s(pulses: list[Pulse]) -> list[float]:
    """Of each coil."""
    total_s = [0.0] * COIL_CHANNELS
    for pulse in pulses:
        total_s[pulse.channel] += _length_s(pulse)
    return total_s

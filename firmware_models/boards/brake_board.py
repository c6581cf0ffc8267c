"""The brake controller: one high-voltage supply, five bridged outputs, five fingertip piezos.

::

    DISARMED -> arm, below 42.4 V -> SELF_TEST -> ARMED -> drive -> DRIVING -> end of its time, or 0 V -> DISCHARGING -> ARMED

``stop`` and ``disarm`` go to DISARMED through DISCHARGING, any latched fault to FAULT; both short every output at once.
The self test ramps one output after the other to volts too low for any force and takes the capacitance from the slope; an
output with next to none has no brake and is not driven. While it drives, the firmware samples volts and current each
millisecond and latches what its guards see. It knows only what it can measure; the plant knows the rest.

A drive that keeps mask and frequency goes on in the phase of the one it replaces, so that a host which renews its command
in time does not stop the reversals that keep charge out of the dielectric. A higher amplitude takes effect at once, a lower
one at the next reversal, for the supply cannot sink. Any other drive begins anew, ``RESTART_NS`` after the outputs were shorted.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Mapping
from typing import Any, NamedTuple

from firmware_models.boards.board import WHOLE_BOARD, FirmwareModel, Refusal
from firmware_models.boards.brake_guards import Guards
from firmware_models.boards.brake_power_on import Measured, SelfTest
from firmware_models.line.uart import NEVER_NS, Line
from firmware_models.options import Option
from firmware_models.plants.brake_plant import DISCHARGED_VOLTS, PLANT_OPTIONS, Brakes
from haptics.link.messages import BRAKE_CHANNELS, TICK_HZ, Board, Fault, State, Status
from haptics.physics.brake.parameters import MAX_VOLTS, capacitance_f
from haptics.time import NS_PER_MS

HIGHEST_FIELD_V_M = 150e6
SUPPLY_CURRENT_UA = 500
HIGHEST_FREQUENCY_DHZ = 10_000
LOWEST_FREQUENCY_DHZ = 5  # a reversal at least each second keeps charge out of the dielectric
LONGEST_TTL_MS = 2000
QUEUE_DEPTH = 8
TOUCHABLE_VOLTS = 42.4
DISCHARGE_NS = 5 * NS_PER_MS
"""From any volts to below 60 V; longer latches a fault."""
RESTART_NS = 2 * NS_PER_MS
STORED_CHARGE_NC = 45_000  # assumed
_DISCHARGE_SAMPLE_NS = NS_PER_MS // 10
_ALL = (1 << BRAKE_CHANNELS) - 1
_AMPLITUDE, _CURRENT, _FREQUENCY, _TTL, _CHARGE = range(5)  # the order of identity.limits


class Drive(NamedTuple):
    """A drive command that was taken.

    :param start_ns: world time at which it takes effect, ns.
    :param order: how many commands were taken up to it; keeps two for the same time in order.
    :param mask: outputs to drive, bit 0 for output 0; 0 shorts all of them.
    :param volts: amplitude, V.
    :param frequency_hz: of the square wave, Hz.
    :param end_ns: world time at which it ends unless another replaces it, ns.
    """

    start_ns: int
    order: int
    mask: int
    volts: int
    frequency_hz: float
    end_ns: int


class Burst(NamedTuple):
    """A piezo on, edge to edge.

    :param start_ns: world time at which it goes on, ns.
    :param end_ns: world time at which it goes off, ns.
    :param mask: piezos, bit 0 for piezo 0.
    """

    start_ns: int
    end_ns: int
    mask: int


class BrakeBoard(FirmwareModel):
    """Firmware of the high-voltage controller around its brakes.

    :param options: values of ``BOARD_OPTIONS`` and ``plants.brake_plant.PLANT_OPTIONS``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    """

    kind = Board.BRAKE
    channels = BRAKE_CHANNELS
    build = b"py-brk-1"
    telemetry_name = "brake_telemetry"

    @classmethod
    def options(cls) -> dict[str, Option]:
        return PLANT_OPTIONS

    @classmethod
    def built_limits(cls, options: Mapping[str, Any]) -> tuple[int, ...]:
        volts = min(MAX_VOLTS, HIGHEST_FIELD_V_M * options["thickness_m"])
        return (int(volts), SUPPLY_CURRENT_UA, HIGHEST_FREQUENCY_DHZ, LONGEST_TTL_MS, STORED_CHARGE_NC)

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int):
        super().__init__(options, transmitter, start_ns)
        self.plant = Brakes(options, self.plant_rng, start_ns)
        self._nominal_f = capacitance_f(options["overlap_m2"], options["thickness_m"], options["permittivity"])
        self._guards = Guards(self.plant, [0.0] * BRAKE_CHANNELS)
        self._queue: list[Drive] = []
        self._bursts: list[Burst] = []
        self._taken = 0
        self._test: SelfTest | None = None
        self._drive: Drive | None = None
        self._waiting: Drive | None = None  # for the outputs to be empty
        self._shorted_ns = start_ns - RESTART_NS
        self._then = State.DISARMED  # what DISCHARGING ends in
        self._discharge_ns = NEVER_NS  # next look at a discharge
        self._discharge_by_ns = NEVER_NS
        self._commands |= {"drive": self._take_drive, "piezo": self._take_piezo}

    # Commands.

    def _take_drive(self, message: Any) -> int:
        self._require_armed()
        off = message.amplitude == 0 or message.channels == 0
        if not off:
            self._check_drive(message)
        start = self._due(message.time)
        if len(self._queue) >= QUEUE_DEPTH:
            raise Refusal(Status.FULL)
        end = start + message.ttl * TICK_HZ // 1000
        self._taken += 1
        insort(
            self._queue,
            Drive(
                self.ticks.time_ns(start),
                self._taken,
                0 if off else message.channels,
                message.amplitude,
                message.frequency / 10,
                self.ticks.time_ns(end),
            ),
        )
        return 0

    def _check_drive(self, message: Any) -> None:
        """Refuse what breaks a limit; ``detail`` is the field's index."""
        chosen = [channel for channel in range(BRAKE_CHANNELS) if message.channels >> channel & 1]
        if message.channels & ~_ALL or any(self._guards.capacitance_f[channel] == 0.0 for channel in chosen):
            raise Refusal(Status.BAD_VALUE, 1)
        total_f = sum(self._guards.capacitance_f[channel] for channel in chosen)
        charge_c = total_f * message.amplitude
        if message.amplitude > self.limits[_AMPLITUDE] or charge_c > 1e-9 * self.limits[_CHARGE]:
            raise Refusal(Status.BAD_VALUE, 2)
        # Each reversal charges from 0 V, twice a period.
        fastest_dhz = 10 * self.limits[_CURRENT] * 1e-6 / (2 * charge_c)
        if not LOWEST_FREQUENCY_DHZ <= message.frequency <= min(self.limits[_FREQUENCY], fastest_dhz):
            raise Refusal(Status.BAD_VALUE, 3)
        if not 0 < message.ttl <= self.limits[_TTL]:
            raise Refusal(Status.BAD_VALUE, 4)

    def _take_piezo(self, message: Any) -> int:
        self._require_armed()
        if message.channels == 0 or message.channels & ~_ALL:
            raise Refusal(Status.BAD_VALUE, 1)
        if not 0 < message.duration <= self.limits[_TTL]:
            raise Refusal(Status.BAD_VALUE, 2)
        start = self._due(message.time)
        if len(self._bursts) >= QUEUE_DEPTH:
            raise Refusal(Status.FULL)
        end = start + message.duration * TICK_HZ // 1000
        insort(self._bursts, Burst(self.ticks.time_ns(start), self.ticks.time_ns(end), message.channels))
        return 0

    @property
    def armed(self) -> bool:
        return super().armed or (self.state == State.DISCHARGING and self._then == State.ARMED)

    def _begin_arming(self) -> None:
        if self.plant.lid_open or self.plant.highest_v(self.now_ns) >= TOUCHABLE_VOLTS:
            raise Refusal(Status.INTERLOCK)
        self.state, self._discharge_ns = State.SELF_TEST, NEVER_NS
        self._test = SelfTest(self.plant, self._nominal_f, self.plant_rng, self.now_ns)

    # Time.

    def _next_output_ns(self) -> int:
        next_ns = self._discharge_ns
        if self._test is not None:
            next_ns = min(next_ns, self._test.next_ns)
        if self._drive is not None:
            next_ns = min(next_ns, self._drive.end_ns, self._guards.next_ns)
        if self._queue:
            next_ns = min(next_ns, self._queue[0].start_ns)
        if self._waiting is not None:
            next_ns = min(next_ns, self._shorted_ns + RESTART_NS)
        for burst in self._bursts:
            next_ns = min(next_ns, burst.start_ns if burst.start_ns > self.now_ns else burst.end_ns)
        return next_ns

    def _run_outputs(self) -> None:
        now_ns = self.now_ns
        if self._test is not None and self._test.next_ns <= now_ns:
            self._step_self_test(self._test)
        while self._queue and self._queue[0].start_ns <= now_ns:
            self._replace(self._queue.pop(0))
        if self._waiting is not None and self._shorted_ns + RESTART_NS <= now_ns:
            self._begin(self._waiting)
        if self._bursts:
            self._run_piezos()
        if self._drive is not None and self._drive.end_ns <= now_ns:
            self._discharge(State.ARMED)
        if self._drive is not None and self._guards.next_ns <= now_ns:
            trip = self._guards.sample(now_ns)
            if trip is not None:
                self.latch(*trip)
        if self._discharge_ns <= now_ns:
            self._watch_discharge()

    def _step_self_test(self, test: SelfTest) -> None:
        result = test.step(self.now_ns)
        if isinstance(result, Measured):
            self._guards.capacitance_f = result.capacitance_f
            self._discharge(State.ARMED)
        elif result is not None:
            self.latch(result.fault, result.channel, result.value)

    def _run_piezos(self) -> None:
        self._bursts = [burst for burst in self._bursts if burst.end_ns > self.now_ns]
        mask = 0
        for burst in self._bursts:
            if burst.start_ns <= self.now_ns:
                mask |= burst.mask
        self.plant.set_piezos(mask, self.now_ns)

    # Outputs.

    def _replace(self, drive: Drive) -> None:
        """Put a drive in force in place of what ran, or of what waited to."""
        running = self._drive
        if running is not None and (drive.mask, drive.frequency_hz) != (running.mask, running.frequency_hz):
            self._discharge(State.ARMED)
        self._waiting = None if drive.mask == 0 else drive
        if drive.mask and self._drive is not None:
            self._begin(drive)

    def _begin(self, drive: Drive) -> None:
        """Volts, from empty outputs or in the phase of the same wave; none for a drive that is over before it could begin."""
        self._waiting = None
        if drive.end_ns <= self.now_ns:
            return
        self._guards.begin(drive.mask, float(drive.volts), drive.frequency_hz, self.now_ns)
        self.plant.drive(drive.mask, float(drive.volts), drive.frequency_hz, self.now_ns)
        self._drive, self.state = drive, State.DRIVING
        self._discharge_ns = NEVER_NS

    def _discharge(self, then: State) -> None:
        """Short every output and wait until it is safe."""
        self._off()
        self.state, self._then = State.DISCHARGING, then

    def _off(self) -> None:
        self._drive, self._test, self._waiting = None, None, None
        self._guards.end()
        self.plant.drive(0, 0.0, 0.0, self.now_ns)
        self._shorted_ns = self.now_ns
        self._discharge_by_ns = self.now_ns + DISCHARGE_NS
        self._discharge_ns = self.now_ns + _DISCHARGE_SAMPLE_NS

    def _watch_discharge(self) -> None:
        volts = self.plant.highest_v(self.now_ns)
        self._discharge_ns = self.now_ns + _DISCHARGE_SAMPLE_NS
        if volts < DISCHARGED_VOLTS:
            self._discharge_ns = NEVER_NS
            if self.state == State.DISCHARGING:
                self.state = self._then
        elif self.now_ns >= self._discharge_by_ns and not self.faults >> Fault.BRIDGE_STUCK & 1:
            self.latch(Fault.BRIDGE_STUCK, WHOLE_BOARD, round(volts))

    def _outputs_off(self) -> None:
        self._queue.clear()
        self._bursts.clear()
        self.plant.set_piezos(0, self.now_ns)
        self._off()
        self._then = State.DISARMED

    def _forget(self) -> None:
        self._guards.capacitance_f = [0.0] * BRAKE_CHANNELS

    def _resting_state(self) -> State:
        if self.faults:
            return State.FAULT
        return State.DISARMED if self.plant.highest_v(self.now_ns) < DISCHARGED_VOLTS else State.DISCHARGING

    def _cause_gone(self, fault: Fault) -> bool:
        return fault != Fault.BRIDGE_STUCK or self.plant.highest_v(self.now_ns) < DISCHARGED_VOLTS

    # Seen from outside.

    def _telemetry(self) -> tuple[Any, ...]:
        now_ns = self.now_ns
        return (
            [round(abs(volts)) for volts in self.plant.volts(now_ns)],
            [min(round(one * 1e12), 0xFFFF) for one in self._guards.capacitance_f],
            [min(round(one * 1e7), 0xFFFF) for one in self._guards.leakage_a],
            max(round(self.plant.stage.bus_v), 0),  # the divider shows nothing below
            min(round(self.plant.supply_current_a() * 1e6), 0xFFFF),
            len(self._queue) + len(self._bursts),
        )

    def truth(self) -> dict[str, Any]:
        """The five outputs and the supply as they are now.

        :return: lists over outputs: ``volts`` (signed), ``amplitude_v, capacity_n, held_n, slipping, tension_n, slip_m, energy_j,
            piezo``; single values: ``time_ns, supply_energy_j, supply_power_w, state``; ``events`` since the last call as
            ``(time_ns, channel, kind, value)``: driven (V), shorted, half_capacity (N), piezo_on, piezo_off.
        """
        return {**self.plant.truth(self.now_ns), "state": self.state}

    def _act(self, channel: int, load: Mapping[str, float]) -> None:
        self.plant.load(channel, self.now_ns, **load)
        if self._drive is not None:
            self._guards.wake(self.now_ns)
        if self.plant.lid_open and self.armed:
            self._outputs_off()
            self.state = self._resting_state()

    def energised(self) -> list[int]:
        return self.plant.energised(self.now_ns)

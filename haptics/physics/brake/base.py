"""What all levels of the brake model share: the output stage, hands, overlaps, and what is reported of them."""

from __future__ import annotations

import math

from haptics.errors import InputError
from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.plant import BrakeEvent, BrakePlant
from haptics.physics.brake.system import BrakeSystem, ForceTable
from haptics.units import in_range

LATEST_S = 1e9
"""Times are counted up to here, about thirty years: a double then still resolves 0.1 us."""


class BrakeBase(BrakePlant):
    """Brakes at rest, shorted, their hands at 0; see ``BrakePlant`` for every member. A level adds how time passes.

    :param system: the brakes, their supply, and what pulls on them.
    :param start_s: time at the start (s), within 1e9.
    :raises InputError: a start outside its range.
    """

    level = ""

    def __init__(self, system: BrakeSystem, start_s: float):
        self._system = system
        outputs = system.outputs
        self._start_s = self._now_s = in_range("start_s", start_s, -LATEST_S, LATEST_S, "s")
        self.stage = OutputStage([system.capacitance_f(k) for k in range(outputs)], system.drive, start_s, system.reversal)
        for k in range(outputs):
            self.stage.set_output(start_s, k, breakdown_v=system.breakdown_v)
        self._tables = [ForceTable(system, k) for k in range(outputs)]
        self._capacity_n = [table.off_n for table in self._tables]
        self._tension_n = [0.0] * outputs
        self._slip_m = [0.0] * outputs
        self._finger_m = [0.0] * outputs
        self._travel_m = [0.0] * outputs
        self._share = [1.0] * outputs
        """Overlap left, for the force; ``_stage_share`` is what the stage's capacitance goes by, which follows less often."""
        self._stage_share = [1.0] * outputs
        self._half_n = [math.inf] * outputs
        self._hands = [(0.0, 0.0, self._start_s)] * outputs
        self._pulling: list[int] = []
        """Outputs whose hand does anything; the others' fingers cost nothing."""
        self._events: list[BrakeEvent] = []

    # What acts on the brakes.

    def drive(self, time_s: float, mask: int, volts: float, frequency_hz: float) -> None:
        self._system.check_volts(volts)
        self.advance(time_s)
        self.stage.drive(time_s, mask, volts, frequency_hz)
        self._await_half(volts)
        self._changed()

    def pins(self, time_s: float, mask: int, volts: float, polarity: int, enabled: bool = True) -> None:
        self.advance(time_s)
        stage, before = self.stage, (self.stage.mask, self.stage.set_v)
        stage.pins(time_s, mask, volts, polarity, enabled)
        if (stage.mask, stage.set_v) != before:
            self._await_half(min(stage.set_v, self._system.breakdown_v))
        self._changed()

    def move(self, output: int, time_s: float, position_m: float, speed_m_s: float = 0.0) -> None:
        self._check_output(output)
        in_range("position_m", position_m, -10.0, 10.0, "m")
        in_range("speed_m_s", speed_m_s, -100.0, 100.0, "m/s")
        self.advance(time_s)
        self._hands[output] = (float(position_m), float(speed_m_s), float(time_s))
        if output not in self._pulling:
            self._pulling = sorted([*self._pulling, output])
        self._changed()

    def set_output(
        self,
        time_s: float,
        output: int,
        *,
        travel_m: float | None = None,
        leak_ohm: float | None = None,
        breakdown_v: float | None = None,
    ) -> None:
        self._check_output(output)
        if travel_m is not None:
            in_range("travel_m", travel_m, 0.0, 10.0, "m")
        self.advance(time_s)
        if travel_m is not None:
            self._travel_m[output] = float(travel_m)
            self._slide(output, time_s, self.slip_m[output])
        if leak_ohm is not None or breakdown_v is not None:
            self.stage.set_output(time_s, output, leak_ohm=leak_ohm, breakdown_v=breakdown_v)
        self._changed()

    def advance(self, to_s: float) -> None:
        raise NotImplementedError

    def _changed(self) -> None:
        """Something acted from outside; a level that plans ahead plans anew."""

    # What there is to see.

    @property
    def system(self) -> BrakeSystem:
        return self._system

    @property
    def now_s(self) -> float:
        return self._now_s

    @property
    def mask(self) -> int:
        return self.stage.mask

    @property
    def voltages_v(self) -> list[float]:
        return self.stage.voltages_v

    def voltage_v(self, output: int) -> float:
        return self.stage.voltage_v(self._check_output(output))

    def amplitude_v(self, output: int) -> float:
        return self.stage.amplitude_v(self._check_output(output))

    def steady_force_n(self, output: int, volts: float) -> float:
        return self._tables[self._check_output(output)].force_n(self._system.check_volts(volts), self._share[output])

    @property
    def capacity_n(self) -> list[float]:
        return self._capacity_n.copy()

    @property
    def tension_n(self) -> list[float]:
        return self._tension_n.copy()

    @property
    def slip_m(self) -> list[float]:
        return self._slip_m.copy()

    @property
    def finger_m(self) -> list[float]:
        return self._finger_m.copy()

    @property
    def bus_v(self) -> float:
        return self.stage.bus_v

    @property
    def supply_current_a(self) -> float:
        return self.stage.supply_current_a

    @property
    def supply_energy_j(self) -> float:
        return self.stage.energy_j

    @property
    def supply_charge_c(self) -> float:
        return self.stage.charge_c

    @property
    def stored_charge_c(self) -> float:
        return self.stage.stored_charge_c

    @property
    def next_event_s(self) -> float | None:
        return self.stage.next_event_s

    def take_events(self) -> list[BrakeEvent]:
        if not self._events:
            return []
        events, self._events = sorted(self._events, key=lambda event: event.time_s), []
        return events

    # For the levels.

    def _check_time(self, to_s: float) -> None:
        if not self._now_s <= to_s <= LATEST_S:
            raise InputError(f"time = {to_s!r} s; must be {self._now_s!r} (it never goes back) to {LATEST_S:g} s")

    def _check_output(self, output: int) -> int:
        if output not in range(self._system.outputs):
            raise InputError(f"output = {output!r}; must be 0 to {self._system.outputs - 1}")
        return output

    def _hand_m(self, output: int, time_s: float) -> float:
        position_m, speed_m_s, since_s = self._hands[output]
        return position_m + speed_m_s * (time_s - since_s)

    def _slide(self, output: int, time_s: float, slip_m: float) -> None:
        """Take the overlap, and with it the capacitance, to what this slip leaves."""
        slid_m = self._travel_m[output] + slip_m
        share = self._share[output] = self._system.share(output, slid_m)
        if share != self._stage_share[output]:
            self._stage_share[output] = share
            self.stage.set_output(time_s, output, capacitance_f=self._system.capacitance_f(output, slid_m))

    def _await_half(self, volts: float) -> None:
        """From now on, report when a driven output's capacity passes half of what ``volts`` will give."""
        capacity_n = self.capacity_n
        for k in range(self._system.outputs):
            half_n = 0.5 * self.steady_force_n(k, volts) if self.stage.mask >> k & 1 else math.inf
            # What holds half already has nothing to report.
            self._half_n[k] = math.inf if capacity_n[k] >= half_n else half_n

    def _report_half(self, output: int, time_s: float) -> None:
        self._events.append(BrakeEvent(time_s, output, "half_capacity", self._half_n[output]))
        self._half_n[output] = math.inf

"""Level ``static``: the law's force at the amplitude, a fixed delay after the setpoint changed; no ripple, no lag, no mass.

Up: the time to half of the force, charging of everything driven (to ``sqrt(1/2)`` of the setpoint) and ``tau_on ln 2``.
Down: ``tau_off ln 2``. A jump at half height is the step nearest to an exponential. The finger's tension is what the hand pulls
with, at most the capacity. Volts still come from the closed form: they cost little, and what a controller's guards and self test
watch is volts. Where pins drive, the amplitude is that at the frequency of their last whole half period; before there
was one, the setpoint's.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from haptics.physics.brake.charging import rise_time_s, steady_half_period
from haptics.physics.brake.lagged import LaggedBrakes, steps_at
from haptics.physics.brake.system import BrakeSystem

STEP_S = 1e-3


class Jump(NamedTuple):
    """A change of capacity, before any sliding, at a time.

    :param time_s: when (s).
    :param force_n: capacity from then on (N).
    """

    time_s: float
    force_n: float


class StaticBrakes(LaggedBrakes):
    """Brakes at level ``static``; see ``BrakePlant``.

    :param system: the brakes, their supply, and what pulls on them.
    :param start_s: time at the start (s), within 1e9.
    :param step_s: between looks at hands that pull (s), 1 us to 100 ms.
    :raises InputError: a number outside its range.
    """

    level = "static"

    def __init__(self, system: BrakeSystem, start_s: float = 0.0, step_s: float = STEP_S):
        super().__init__(system, start_s, step_s)
        self._full_n = [table.off_n for table in self._tables]
        self._jumps: list[Jump | None] = [None] * system.outputs
        self._setpoint: tuple[float, ...] = ()

    def advance(self, to_s: float) -> None:
        self._check_time(to_s)
        while self.stage.may_break and (at_s := self.stage.next_event_s) is not None and at_s <= to_s:
            broken = self.stage.broken_down
            self._carry(at_s)
            if self.stage.broken_down != broken:
                self._changed()
        self._carry(to_s)

    def _carry(self, to_s: float) -> None:
        self._to_s = to_s
        last = 2 * steps_at(to_s, self._start_s, self._step_s)
        while self._pulling and self._halves < last:
            self._halves += 2
            self._jump(self._grid_s())
            for k in self._pulling:
                self._pull(k)
            if self._halves // 2 % self._every == 0:
                self._end_pulls()
        self._halves = max(self._halves, last)
        self._jump(to_s)
        self.stage.advance(to_s)
        self._now_s = to_s

    @property
    def tension_n(self) -> list[float]:
        return [min(tension, capacity) for tension, capacity in zip(self._tension_n, self._capacity_n, strict=True)]

    @property
    def next_event_s(self) -> float | None:
        times_s = [jump.time_s for jump in self._jumps if jump is not None]
        if self.stage.next_event_s is not None:
            times_s.append(self.stage.next_event_s)
        return min(times_s, default=None)

    def _changed(self) -> None:
        """Plan the jumps to what the stage is now set to give."""
        stage, system = self.stage, self._system
        load = stage.load
        setpoint = (stage.mask, load.set_v, stage.frequency_hz, load.capacitance_f, load.leak_s)
        if setpoint == self._setpoint:
            return
        self._setpoint = setpoint
        driven_f = max(0.0, load.capacitance_f - system.drive.stray_f)
        amplitude_v = rise_s = 0.0
        if stage.mask:
            half = steady_half_period(load.set_v, stage.frequency_hz, driven_f, system.drive, system.reversal, load.leak_s)
            amplitude_v = abs(half.amplitude_v)
            rise_s = rise_time_s(load.set_v, driven_f, system.drive, math.sqrt(0.5), load.leak_s)
        for k in range(system.outputs):
            table = self._tables[k]
            target_n = table.force_n(amplitude_v) if stage.mask >> k & 1 else table.off_n
            self._plan(k, target_n, (rise_s if math.isfinite(rise_s) else 0.0) + self._tau_on_s * math.log(2.0))

    def _plan(self, k: int, target_n: float, up_s: float) -> None:
        """One jump at a time: a further change in the same direction keeps the time of the first."""
        full_n, planned = self._full_n[k], self._jumps[k]
        if target_n == full_n:
            self._jumps[k] = None
        elif planned is not None and (planned.force_n > full_n) == (target_n > full_n):
            self._jumps[k] = Jump(planned.time_s, target_n)
        else:
            delay_s = up_s if target_n > full_n else self._tau_off_s * math.log(2.0)
            self._jumps[k] = Jump(self._now_s + delay_s, target_n)

    def _jump(self, to_s: float) -> None:
        """Take the jumps that are due, and capacity to what is left of the overlap."""
        for k, jump in enumerate(self._jumps):
            off_n = self._tables[k].off_n
            share = self._system.share(k, self._travel_m[k] + self._slip_m[k])
            if jump is not None and jump.time_s <= to_s:
                self._full_n[k], self._jumps[k] = jump.force_n, None
                if off_n + (jump.force_n - off_n) * share >= self._half_n[k]:
                    self._report_half(k, jump.time_s)
            self._capacity_n[k] = off_n + (self._full_n[k] - off_n) * share

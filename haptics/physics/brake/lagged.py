"""Level ``lagged``: volts in closed form, the contact's exact lag on a fixed grid, elasto-plastic play behind a slow hand.

::

    F' = (F_law(V, overlap) - F) / tau,    V taken at each step's middle
    T = k (q - s - slack), 0 <= T <= F,    k of hand and strips in series

Second order in the step while volts move. While they are held, or gone, and no hand moves, time passes in one exact step.
"""

from __future__ import annotations

import math

from haptics.physics.brake.base import BrakeBase
from haptics.physics.brake.finger import series_stiffness_n_m
from haptics.physics.brake.kernel import pulled
from haptics.physics.brake.system import BrakeSystem
from haptics.units import in_range

STEP_S = 0.5e-3
MIN_STEP_S, MAX_STEP_S = 1e-6, 100e-3
CAPACITANCE_EVERY_S = 1e-3
"""How often capacitance follows sliding strips, on the grid; at 1 mm/s it moves by 1e-4 of itself meanwhile."""
HELD = 1.0 - 1e-7
"""Of the setpoint: from here on volts do not change till the next reversal."""
_EVER = 1 << 62


def steps_at(time_s: float, start_s: float, step_s: float) -> int:
    """Whole steps from the start to ``time_s``, one that ends within rounding of it included.

    :param time_s: asked for (s).
    :param start_s: where the grid begins (s).
    :param step_s: of the grid (s), more than 0.
    :return: number of steps.
    """
    steps = (time_s - start_s) / step_s
    # The allowance for rounding grows with time, but must stay far below a step, however long the run.
    return int(steps + min(1e-12 * steps, 0.01))


class LaggedBrakes(BrakeBase):
    """Brakes at level ``lagged``; see ``BrakePlant``.

    :param system: the brakes, their supply, and what pulls on them.
    :param start_s: time at the start (s), within 1e9.
    :param step_s: of the grid (s), 1 us to 100 ms.
    :raises InputError: a number outside its range.
    """

    level = "lagged"

    def __init__(self, system: BrakeSystem, start_s: float = 0.0, step_s: float = STEP_S):
        super().__init__(system, start_s)
        self._step_s = in_range("step_s", step_s, MIN_STEP_S, MAX_STEP_S, "s")
        self._half_step_s = 0.5 * self._step_s
        self._to_s = self._start_s
        self._halves = 0
        """Half steps done: capacity is that of ``halves // 2`` whole steps; odd means that the next one's volts are known."""
        self._quiet = False
        """All shorted, and nothing left on any output."""
        self._sampled_v = [0.0] * system.outputs
        self._every = max(1, round(CAPACITANCE_EVERY_S / self._step_s))
        self._still_v = 1.0 / self._tables[0].per_volt
        self._off_n = [table.off_n for table in self._tables]
        self._series_n_m = series_stiffness_n_m(system.finger)
        tau_on_s, tau_off_s = system.contact.tau_on_s, system.contact.tau_off_s
        self._tau_on_s, self._tau_off_s = tau_on_s, tau_off_s
        self._rise, self._fall = -math.expm1(-self._step_s / tau_on_s), -math.expm1(-self._step_s / tau_off_s)

    def advance(self, to_s: float) -> None:
        self._check_time(to_s)
        self._to_s = to_s
        stage = self.stage
        last = steps_at(to_s, self._start_s, self._half_step_s)
        while self._halves < last:
            if self._halves & 1:
                self._halves += 1
                self._follow(1)
                continue
            steps = (last - self._halves) // 2
            if steps:
                steps = min(self._steady_steps(), steps)
            if steps > 1:
                self._halves += 2 * steps
                self._sampled_v = stage.voltages_v
                self._follow(steps)
            else:
                self._halves += 1
                stage.advance(self._grid_s())
                self._sampled_v = stage.voltages_v
        stage.advance(to_s)
        self._now_s = to_s

    def _grid_s(self) -> float:
        # What is due by rounding may lie a few ulp beyond the time advanced to; the stage's time could not come back.
        return min(self._start_s + self._halves * self._half_step_s, self._to_s)

    def _steady_steps(self) -> int:
        """For how many steps from the last one neither volts nor fingers will change; 0 if they do."""
        if self._pulling:
            return 0
        if self._quiet:
            return _EVER
        stage = self.stage
        set_v = stage.set_v
        # Above a setpoint that was lowered volts fall by the bleeder.
        held = stage.charging and HELD * set_v <= stage.bridge_v <= set_v
        if (stage.mask and not held) or not stage.shorted_below(self._still_v):
            return 0
        self._quiet = stage.mask == 0
        next_s = stage.next_event_s
        return _EVER if next_s is None else int((next_s - self._grid_s()) / self._step_s)

    def _changed(self) -> None:
        self._quiet = False

    def _follow(self, steps: int) -> None:
        """Let capacities follow the volts sampled, and tensions the hands, up to the grid point reached."""
        capacity_n, still_v = self._capacity_n, self._still_v
        for k, volts in enumerate(self._sampled_v):
            before_n = capacity_n[k]
            if volts == 0.0 and before_n == self._off_n[k]:
                continue
            table = self._tables[k]
            target_n = table.off_n if -still_v < volts < still_v else table.force_n(abs(volts), self._share[k])
            if target_n == before_n:
                continue
            rises = target_n > before_n
            if steps == 1:
                done = self._rise if rises else self._fall
            else:
                done = -math.expm1(-steps * self._step_s / (self._tau_on_s if rises else self._tau_off_s))
            after_n = capacity_n[k] = before_n + (target_n - before_n) * done
            if after_n >= self._half_n[k]:
                share = (self._half_n[k] - before_n) / (target_n - before_n)
                ago_s = steps * self._step_s + self._tau_on_s * math.log1p(-share)
                self._report_half(k, self._grid_s() - ago_s)
        if not self._pulling:
            return
        for k in self._pulling:
            self._pull(k)
        if self._halves // 2 % self._every == 0:
            self._end_pulls()

    def _pull(self, k: int) -> None:
        """Slip and tension at the grid point, by the hand there."""
        hand_m = self._hand_m(k, self._grid_s())
        finger = self._system.finger
        slip_m, tension_n = pulled(self._slip_m[k], hand_m, self._capacity_n[k], self._series_n_m, finger.slack_m)
        self._slip_m[k], self._tension_n[k] = slip_m, tension_n
        self._share[k] = self._system.share(k, self._travel_m[k] + slip_m)
        self._finger_m[k] = hand_m - tension_n / finger.load_stiffness_n_m

    def _end_pulls(self) -> None:
        """Capacitance as the strips are now; a hand that stands still and pulls at nothing is done."""
        for k in self._pulling:
            self._slide(k, self._grid_s(), self._slip_m[k])
        self._pulling = [k for k in self._pulling if self._hands[k][1] != 0.0 or self._tension_n[k] != 0.0]

"""Level ``dynamic``: as ``lagged``, with the finger's mass, stepped in time by one of two implicit friction laws.

``coulomb`` is set-valued, ``lugre`` gives way gradually; ``kernel`` has their equations and the proof that neither makes energy.
Both are stable at any step from 1 us to 100 ms and any stiffness, and of first order; the capacity behind them is of second.
A stretch without switching is carried in one compiled call, so that a step costs well under a microsecond.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from haptics.physics.brake import kernel as loop
from haptics.physics.brake.finger import finger_parameters
from haptics.physics.brake.lagged import LaggedBrakes, steps_at
from haptics.physics.brake.system import BrakeSystem
from haptics.units import one_of

STEP_S = 50e-6
FRICTIONS = ("coulomb", "lugre")


class DynamicBrakes(LaggedBrakes):
    """Brakes at level ``dynamic``; see ``BrakePlant``.

    :param system: the brakes, their supply, and what pulls on them.
    :param start_s: time at the start (s), within 1e9.
    :param step_s: of the grid (s), 1 us to 100 ms.
    :param friction: coulomb or lugre.
    :param compiled: False: the same lines in plain Python.
    :raises InputError: a number outside its range, or an unknown friction.
    """

    level = "dynamic"

    def __init__(
        self,
        system: BrakeSystem,
        start_s: float = 0.0,
        step_s: float = STEP_S,
        friction: str = "coulomb",
        compiled: bool = True,
    ):
        super().__init__(system, start_s, step_s)
        self._bristles = one_of("friction", friction, FRICTIONS) == "lugre"
        self._carry = loop.kernel("carry", compiled)
        outputs, brake = system.outputs, system.brake
        self._state = np.zeros((outputs, loop.WIDTH))
        self._state[:, loop.FORCE] = self._capacity_n
        self._modes = np.zeros(outputs, np.int64)
        self._taus = np.ones(outputs)
        self._overlap = np.zeros((outputs, 2))
        self._overlap[:, 0] = [brake.width_m / system.overlap_m2(k) if system.overlap_m2(k) else 0.0 for k in range(outputs)]
        self._hand_rows = np.zeros((outputs, 3))
        self._tabled_v = -1.0
        self._table_rows: NDArray[np.float64] = np.zeros((outputs, 2))
        self._finger = finger_parameters(system.finger)
        self._lag = (float(system.contact.tau_on_s), float(system.contact.tau_off_s))
        drive = system.drive
        self._limits = (float(drive.output_resistance_ohm), float(drive.bleeder_ohm), float(drive.supply_current_a))

    @property
    def speed_m_s(self) -> list[float]:
        """Of each finger (m/s)."""
        return self._state[:, loop.V].tolist()

    def advance(self, to_s: float) -> None:
        self._check_time(to_s)
        self._to_s = to_s
        stage = self.stage
        last = steps_at(to_s, self._start_s, self._half_step_s)
        while self._halves < last:
            if self._halves & 1:
                self._carry_steps(1, given=True)
            else:
                self._go_on((last - self._halves) // 2)
            if self._pulling and self._halves & 1 == 0 and self._halves // 2 % self._every == 0:
                self._end_pulls()
        stage.advance(to_s)
        self._now_s = to_s

    def _go_on(self, left: int) -> None:
        """From a grid point: through all steps without switching at once, or to the middle of one that has some."""
        stage = self.stage
        steady = min(self._steady_steps(), left)
        if steady > 1:
            self._halves += 2 * steady
            self._sampled_v = stage.voltages_v
            self._follow(steady)
            self._state[:, loop.FORCE] = self._capacity_n
            return
        steps = min(self._steps_before_switching(), left)
        if steps >= 1:
            self._carry_steps(steps, given=False)
            stage.advance(self._grid_s())
        else:
            self._halves += 1
            stage.advance(self._grid_s())
            self._sampled_v = stage.voltages_v

    def _steps_before_switching(self) -> int:
        """Whole steps up to the next switching, the next look at capacitance at most."""
        grid_s, next_s = self._grid_s(), self.stage.next_event_s
        up_to = self._every - self._halves // 2 % self._every if self._pulling else 1 << 20
        return up_to if next_s is None else min(up_to, int((next_s - grid_s) / self._step_s))

    def _carry_steps(self, steps: int, given: bool) -> None:
        """Carry everything through whole steps, by the stage's volts from now on or by those sampled already."""
        stage, state, load = self.stage, self._state, self.stage.load
        from_s = self._start_s + (self._halves // 2) * self._step_s
        first_s = from_s + self._half_step_s - stage.now_s
        state[:, loop.HALF] = self._half_n
        state[:, loop.VOLTS] = self._sampled_v if given else stage.voltages_v
        for k in range(self._system.outputs):
            if given:
                self._modes[k] = loop.GIVEN
            elif stage.mask >> k & 1 and stage.charging:
                self._modes[k] = loop.CHARGING
            else:
                # Without capacitance the volts are gone at once.
                self._modes[k], self._taus[k] = loop.DECAYING, stage.decay_s(k) or 1e-12
            self._overlap[k, 1] = self._travel_m[k]
            self._hand_rows[k] = (self._hand_m(k, from_s), self._hands[k][1], float(k in self._pulling))
        self._carry(
            state,
            steps,
            self._step_s,
            first_s,
            self._modes,
            self._taus,
            float(stage.polarity),
            (load.set_v, load.capacitance_f, load.leak_s, *self._limits),
            self._table_rows,
            self._tables[0].per_volt,
            self._overlap,
            self._hand_rows,
            self._lag,
            self._finger,
            self._bristles,
        )
        self._halves = 2 * (self._halves // 2 + steps)
        self._take(from_s)

    def _take(self, from_s: float) -> None:
        """Report what the compiled loop has found."""
        state = self._state
        for k in range(self._system.outputs):
            half_at_s = float(state[k, loop.HALF_AT])
            if not math.isnan(half_at_s):
                self._report_half(k, from_s + half_at_s)
        self._capacity_n = state[:, loop.FORCE].tolist()
        self._finger_m = state[:, loop.Y].tolist()
        self._slip_m = state[:, loop.S].tolist()
        self._tension_n = state[:, loop.T].tolist()

    def _changed(self) -> None:
        super()._changed()
        highest_v = max(self.stage.set_v, max(map(abs, self.stage.voltages_v)))
        if highest_v > self._tabled_v:
            self._tabled_v = highest_v
            self._table_rows = np.array([table.array(highest_v) for table in self._tables])

    def _end_pulls(self) -> None:
        """As ``lagged``; the finger must have come to rest as well."""
        for k in self._pulling:
            self._slide(k, self._grid_s(), self._slip_m[k])
        at_rest = np.abs(self._state[:, loop.V]) < 1e-9
        self._pulling = [k for k in self._pulling if self._hands[k][1] != 0.0 or self._tension_n[k] != 0.0 or not at_rest[k]]

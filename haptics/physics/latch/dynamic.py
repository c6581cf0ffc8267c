"""Level ``dynamic``: the equation of motion, stepped only while something moves.

At rest (pin still, current settled) the state jumps to the exact equilibrium and time passes free of charge, under
voltage too: a coil that is stuck on draws ``V^2/R`` and costs no steps.
"""

from __future__ import annotations

import math
from collections import deque

from haptics.errors import InputError
from haptics.physics.latch.kernel import (
    BEYOND,
    FREE,
    LEFT_OFF,
    LEFT_ON,
    OFF_STOP,
    ON_STOP,
    PASSED,
    REACHED_END,
    REACHED_OFF,
    REACHED_ON,
    RESTING,
    kernel,
    kernel_parameters,
)
from haptics.physics.latch.parameters import LATCH, LatchParameters
from haptics.physics.latch.plant import (
    DEEPEST,
    Latched,
    LatchEvent,
    LatchPlant,
    beyond_stop,
    checked_resistance,
    checked_time,
    latched_at,
)
from haptics.units import in_range

STEP_S = 50e-6
"""Default step: arrival within a microsecond of the reference (see ``tests/physics/latch/test_latch_reference.py``)."""


class DynamicLatch(LatchPlant):
    """One tactor at level ``dynamic``; see ``LatchPlant`` for the meaning of every member.

    :param parameters: of the tactor.
    :param latched: where it rests at first: on or off.
    :param start_s: time at the start (s).
    :param step_s: of the integration (s), 1 us to 1 ms.
    :param compiled: step in compiled code (numba, imported at the first motion) or in plain Python; same results.
    :raises InputError: a state it cannot rest in, or a step outside its range.
    """

    def __init__(
        self,
        parameters: LatchParameters = LATCH,
        latched: Latched = "off",
        start_s: float = 0.0,
        step_s: float = STEP_S,
        compiled: bool = True,
    ):
        if latched not in ("on", "off"):
            raise InputError(f"latched = {latched!r} is not allowed; allowed: on, off (a tactor cannot rest in between)")
        self.rise_k = 0.0
        self._step_s = in_range("step_s", step_s, 1e-6, 1e-3, "s")
        self._compiled, self._integrate = compiled, kernel(compiled)
        self._parameters = parameters
        self._packed = kernel_parameters(parameters)
        self._events: deque[LatchEvent] = deque()
        self._touch_on, self._touch_off = latched == "on", latched == "off"
        self._volts: float = 0.0
        self._resistance: float = parameters.resistance_ohm
        self._origin_s, self._now_s = float(start_s), float(start_s)
        # Committed state: a whole number of steps after the last change of drive, at most one step behind now.
        self._x: float = parameters.stroke_m if latched == "on" else 0.0
        self._v: float = 0.0
        self._i: float = 0.0
        self._t: float = 0.0
        self._charge: float = 0.0
        self._touching: int = ON_STOP if latched == "on" else OFF_STOP
        self._energy_j: float = 0.0
        self._resting: bool = True
        self._peeked: tuple[float, float, float, float] | None = None
        self._settle()

    def drive(self, time_s: float, volts: float) -> None:
        volts = in_range("volts", volts, -1e3, 1e3, "V")
        resistance = checked_resistance(self._parameters, self.rise_k)
        self._commit(time_s)
        self._resting = self._resting and volts == self._volts and resistance == self._resistance
        self._volts, self._resistance = volts, resistance

    def load_skin(self, time_s: float, stiffness_n_m: float, at_m: float) -> None:
        parameters = self._parameters.with_values(skin_stiffness_n_m=stiffness_n_m, skin_at_m=at_m)
        self._commit(time_s)
        self._parameters, self._packed = parameters, kernel_parameters(parameters)
        self._resting = False

    def advance(self, to_s: float) -> None:
        self._now_s = checked_time(to_s, self._now_s)
        self._peeked = None
        if not self._resting:
            self._run(to_s - self._origin_s, whole=True)

    def take_events(self) -> list[LatchEvent]:
        events = list(self._events)
        self._events.clear()
        return events

    @property
    def parameters(self) -> LatchParameters:
        """Of this tactor, the skin as it is now."""
        return self._parameters

    @property
    def position_m(self) -> float:
        return self._peek()[0]

    @property
    def speed_m_s(self) -> float:
        return self._peek()[1]

    @property
    def current_a(self) -> float:
        return self._peek()[2]

    @property
    def energy_j(self) -> float:
        return self._energy_j + self._volts * self._peek()[3]

    @property
    def at_rest(self) -> bool:
        return self._resting

    @property
    def outside(self) -> tuple[str, ...]:
        return ()

    @property
    def latched(self) -> Latched:
        return latched_at(self.position_m, self._parameters)

    def _commit(self, time_s: float) -> None:
        """Bring the committed state to exactly ``time_s`` and count time from there."""
        self.advance(time_s)
        self._run(time_s - self._origin_s, whole=False)
        if self._resting:
            self._charge += self._volts / self._resistance * (time_s - self._origin_s - self._t)
        self._energy_j += self._volts * self._charge
        self._origin_s, self._t, self._charge = time_s, 0.0, 0.0
        self._peeked = None

    def _marker(self) -> float:
        """Position beyond which the pin has left the stop it touched last; negative once it has."""
        if self._touch_on:
            return self._parameters.stroke_m - self._parameters.near_stop_m
        return self._parameters.near_stop_m if self._touch_off else -1.0

    def _run(self, end: float, whole: bool) -> None:
        while not self._resting:
            why = self._step(end, whole, self._marker())
            if why == REACHED_END:
                return
            self._report(why)

    def _step(self, end: float, whole: bool, marker: float) -> int:
        """Carry the state toward ``end`` until there is something to report, and return what."""
        self._x, self._v, self._i, self._touching, self._t, why, self._charge = self._integrate(
            self._x, self._v, self._i, self._touching, self._t, end, self._step_s, whole,
            self._volts, self._resistance, marker, self._charge, self._packed,
        )  # fmt: skip
        return why

    def _report(self, why: int) -> None:
        time_s = self._origin_s + self._t
        if why == REACHED_ON and not self._touch_on:
            self._touch_on = True
            self._events.append(LatchEvent(time_s, "reached_skin", self._v))
        elif why == REACHED_OFF and not self._touch_off:
            self._touch_off = True
            self._events.append(LatchEvent(time_s, "reached_off", self._v))
        elif why == PASSED:
            if self._touch_on:
                self._events.append(LatchEvent(time_s, "left_skin", self._v))
            self._touch_on = self._touch_off = False
        elif why == RESTING:
            self._resting = True
            self._settle()
        elif why == BEYOND:
            raise beyond_stop(self._parameters, self._volts)
        else:
            assert why in (REACHED_ON, REACHED_OFF, LEFT_ON, LEFT_OFF)

    def _peek(self) -> tuple[float, float, float, float]:
        """Position, speed, current and charge now: one cut step beyond the committed state, which stays."""
        if self._peeked is None:
            committed = self._x, self._v, self._i, self._touching, self._t, self._charge
            end = self._now_s - self._origin_s
            why = RESTING if self._resting else REACHED_ON
            while why not in (REACHED_END, RESTING):
                why = self._step(end, False, -1.0)
                if why == BEYOND:
                    raise beyond_stop(self._parameters, self._volts)
            self._peeked = (self._x, self._v, self._i, self._charge + self._volts / self._resistance * (end - self._t))
            self._x, self._v, self._i, self._touching, self._t, self._charge = committed
        return self._peeked

    def _settle(self) -> None:
        """Jump to the equilibrium that the pin has all but reached, by Newton's method on the static force."""
        p = self._parameters
        self._v, self._i = 0.0, self._volts / self._resistance
        for _ in range(8):
            x = self._x
            u_on, u_off = 1.0 + (p.stroke_m - x) / p.plate_length_m, 1.0 + x / p.plate_length_m
            on_n, off_n = p.hold_on_n * u_on**-p.plate_power, p.hold_off_n * u_off**-p.plate_power
            near, far = math.exp(-x / p.thrust_length_m), math.exp((x - p.stroke_m) / p.thrust_length_m)
            thrust = p.thrust_n_a * self._i / (1.0 + math.exp(-p.stroke_m / p.thrust_length_m))
            force = thrust * (near + far) + on_n - off_n
            slope = thrust * (far - near) / p.thrust_length_m + p.plate_power / p.plate_length_m * (on_n / u_on + off_n / u_off)
            if self._touching != FREE:
                stiffness = p.off_stiffness_n_m if self._touching == OFF_STOP else p.on_stiffness_n_m
                force -= stiffness * (x - (0.0 if self._touching == OFF_STOP else p.stroke_m))
                slope -= stiffness
            if x > p.skin_at_m:
                force -= p.skin_stiffness_n_m * (x - p.skin_at_m)
                slope -= p.skin_stiffness_n_m
            self._x -= force / slope
            if not -DEEPEST * p.plate_length_m <= self._x <= p.stroke_m + DEEPEST * p.plate_length_m:
                raise beyond_stop(p, self._volts)
            if abs(force) < 1e-9 * abs(slope):  # converges as the square: this step was the last that counts
                return

"""Level ``reference``: the equation of motion by an explicit Runge-Kutta method of order 8, as exact as doubles allow.

The equations are those of ``kernel``, written again as plainly as they can be. Contact begins and ends at events that the
solver locates, so that the force is smooth on every leg between them. A leg is solved once, to its end, and looked up at any
time before: how time is cut into calls of ``advance`` changes nothing. A pin counts as at rest when it has all but stopped.

Some thousand times dearer than level ``dynamic``: for judging the others, and for studies of single pulses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from scipy.integrate import solve_ivp  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from haptics.errors import InputError
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
from haptics.physics.looked_up import LOOKED_UP
from haptics.units import in_range

RELATIVE_TOLERANCE = 1e-10
_ABSOLUTE_TOLERANCE = (1e-15, 1e-12, 1e-10, 1e-13)  # m, m/s, A, A s
_LEG_S = 5e-3
"""Longest leg; at its end it is seen whether the pin rests."""
_REST_M_S, _REST_M_S2, _REST_A = 1e-6, 1e-2, 1e-7

_Force = Callable[[float, float, float, float], float]


class ReferenceLatch(LatchPlant):
    """One tactor at level ``reference``; see ``LatchPlant`` for the meaning of every member.

    :param parameters: of the tactor.
    :param latched: where it rests at first: on or off.
    :param start_s: time at the start (s).
    :raises InputError: a state it cannot rest in; here or later, a motion that cannot be solved.
    """

    def __init__(self, parameters: LatchParameters = LATCH, latched: Latched = "off", start_s: float = 0.0):
        if latched not in ("on", "off"):
            raise InputError(f"latched = {latched!r} is not allowed; allowed: on, off (a tactor cannot rest in between)")
        self.rise_k = 0.0
        self._p = parameters
        self._events: list[LatchEvent] = []
        self._volts, self._resistance = 0.0, parameters.resistance_ohm
        self._energy_j = 0.0
        self._now_s = self._from_s = float(start_s)
        self._stop: Latched = latched  # the stop that is touched, or between
        self._away_from: Latched = latched  # the stop last reached, until the pin has passed near_stop_m
        self._state = np.array([0.0 if latched == "off" else parameters.stroke_m, 0.0, 0.0, 0.0])
        self._leg: Callable[[float], np.ndarray] | None = None  # None: at rest
        self._ends_s, self._why = math.inf, ""
        self._rest()

    def drive(self, time_s: float, volts: float) -> None:
        volts = in_range("volts", volts, -1e3, 1e3, "V")
        resistance = checked_resistance(self._p, self.rise_k)
        if (volts, resistance) == (self._volts, self._resistance):
            # The leg goes on; its time must not be counted anew.
            self.advance(time_s)
            return
        self._commit(time_s)
        self._volts, self._resistance = volts, resistance
        self._next_leg()

    def load_skin(self, time_s: float, stiffness_n_m: float, at_m: float) -> None:
        parameters = self._p.with_values(skin_stiffness_n_m=stiffness_n_m, skin_at_m=at_m)
        self._commit(time_s)
        self._p = parameters
        self._next_leg()

    def advance(self, to_s: float) -> None:
        checked_time(to_s, self._now_s)
        while self._ends_s <= to_s:
            self._end_leg()
        self._now_s = to_s

    def take_events(self) -> list[LatchEvent]:
        events, self._events = self._events, []
        return events

    @property
    def parameters(self) -> LatchParameters:
        """Of this tactor, the skin as it is now."""
        return self._p

    @property
    def position_m(self) -> float:
        return float(self._at(self._now_s)[0])

    @property
    def speed_m_s(self) -> float:
        return float(self._at(self._now_s)[1])

    @property
    def current_a(self) -> float:
        return float(self._at(self._now_s)[2])

    @property
    def energy_j(self) -> float:
        return self._energy_j + self._volts * float(self._at(self._now_s)[3])

    @property
    def at_rest(self) -> bool:
        return self._leg is None

    @property
    def outside(self) -> tuple[str, ...]:
        return ()

    @property
    def latched(self) -> Latched:
        return latched_at(self.position_m, self._p)

    def _at(self, time_s: float) -> np.ndarray:
        """Position, speed, current, and charge since the leg's voltage began."""
        if self._leg is None:
            x, _, i, q = self._state
            return np.array([x, 0.0, i, q + i * (time_s - self._from_s)])
        return self._leg(time_s - self._from_s)

    def _commit(self, time_s: float) -> None:
        """Bring the state to ``time_s`` and count charge from there."""
        self.advance(time_s)
        self._state = self._at(time_s)
        self._energy_j += self._volts * float(self._state[3])
        self._state[3], self._from_s = 0.0, time_s

    def _next_leg(self) -> None:
        """Solve from the present state to the next contact, loss of contact, passing of the marker, or ``_LEG_S``."""
        p, volts, resistance = self._p, self._volts, self._resistance
        force, thrust, mass_kg, inductance_h = self._force(), self._thrust(), p.mass_kg, p.inductance_h

        def motion(_: float, y: np.ndarray) -> tuple[float, float, float, float]:
            x, v, i, _charge = y.tolist()
            thrust_n_a = thrust(x)
            return v, force(x, v, i, thrust_n_a) / mass_kg, (volts - resistance * i - thrust_n_a * v) / inductance_h, i

        borders = self._borders()
        events = [_crossing(at_m, direction) for _, at_m, direction in borders]
        solved = cast(Any, solve_ivp(
            motion, (0.0, _LEG_S), self._state, LOOKED_UP, dense_output=True, events=events,
            rtol=RELATIVE_TOLERANCE, atol=_ABSOLUTE_TOLERANCE, first_step=1e-7,
        ))  # fmt: skip
        if not solved.success:
            raise InputError(f"the motion of {p} at {volts:g} V cannot be solved: {solved.message}")
        self._leg, self._why = solved.sol, ""
        for (why, at_m, _), met in zip(borders, solved.y_events, strict=True):
            if len(met):
                self._why, self._met_m = why, at_m
        self._ends_s = self._from_s + float(solved.t[-1])

    def _borders(self) -> list[tuple[str, float, int]]:
        """What ends a leg: its name, where, and in which direction of motion."""
        p = self._p
        if self._stop == "on":
            return [("leave", p.stroke_m, -1), ("beyond", p.stroke_m + DEEPEST * p.plate_length_m, 1)]
        if self._stop == "off":
            return [("leave", 0.0, 1), ("beyond", -DEEPEST * p.plate_length_m, -1)]
        borders = [("on", p.stroke_m, 1), ("off", 0.0, -1)]
        if self._away_from == "on":
            borders.append(("passed", p.stroke_m - p.near_stop_m, -1))
        elif self._away_from == "off":
            borders.append(("passed", p.near_stop_m, 1))
        return borders

    def _end_leg(self) -> None:
        """Take the leg's end as the state, report what happened there, and go on."""
        if self._why == "beyond":
            raise beyond_stop(self._p, self._volts)
        time_s = self._ends_s
        self._state, self._from_s, why = self._at(time_s), time_s, self._why
        self._energy_j += self._volts * float(self._state[3])
        self._state[3] = 0.0
        speed = float(self._state[1])
        if why:
            self._state[0] = self._met_m
        if why == "leave":
            self._stop = "between"
        elif why == "passed":
            if self._away_from == "on":
                self._events.append(LatchEvent(time_s, "left_skin", speed))
            self._away_from = "between"
        elif why in ("on", "off"):
            self._stop = why
            if self._away_from != why:
                self._events.append(LatchEvent(time_s, "reached_skin" if why == "on" else "reached_off", speed))
            self._away_from = why
        elif self._stop != "between" and self._still():
            self._rest()
            return
        self._next_leg()

    def _still(self) -> bool:
        x, v, i, _ = self._state.tolist()
        acceleration = self._force()(x, v, i, self._thrust()(x)) / self._p.mass_kg
        return abs(v) < _REST_M_S and abs(acceleration) < _REST_M_S2 and abs(i - self._volts / self._resistance) < _REST_A

    def _rest(self) -> None:
        """Jump to the equilibrium against the stop, by bisection between the stop and the minimum depth that it pushes back from.

        Strong volts make a second equilibrium further in, from which the pin would go through; it is not the one meant.
        """
        p, i = self._p, self._volts / self._resistance
        force, thrust, stop = self._force(), self._thrust(), 0.0 if self._stop == "off" else p.stroke_m
        into = -1.0 if self._stop == "off" else 1.0
        depth_m = max(1e-9, 0.9 * into * (float(self._state[0]) - stop))
        while into * force(stop + into * depth_m, 0.0, i, thrust(stop + into * depth_m)) > 0.0:
            depth_m *= 1.02
            if depth_m > DEEPEST * p.plate_length_m:
                raise beyond_stop(p, self._volts)
        low, high = sorted((stop, stop + into * depth_m))
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if force(middle, 0.0, i, thrust(middle)) > 0.0 else (low, middle)
        self._state = np.array([0.5 * (low + high), 0.0, i, float(self._state[3])])
        self._leg, self._ends_s = None, math.inf

    def _thrust(self) -> Callable[[float], float]:
        """Coil force for each ampere, N/A, at a position."""
        p = self._p
        thrust_n_a, length_m, stroke_m = p.thrust_n_a, p.thrust_length_m, p.stroke_m
        both = 1.0 + math.exp(-stroke_m / length_m)

        def thrust(x: float) -> float:
            return thrust_n_a * (math.exp(-x / length_m) + math.exp((x - stroke_m) / length_m)) / both

        return thrust

    def _force(self) -> _Force:
        """Force on the pin (N) at a position, speed, current and thrust, with the stop that is touched now."""
        p, stop = self._p, self._stop
        stroke_m, plate_m, power = p.stroke_m, p.plate_length_m, -p.plate_power
        hold_on_n, hold_off_n, drag_n_s_m = p.hold_on_n, p.hold_off_n, p.drag_n_s_m
        skin_n_m, skin_at_m = p.skin_stiffness_n_m, p.skin_at_m

        def force(x: float, v: float, i: float, thrust_n_a: float) -> float:
            # A trial step may overshoot a stop by more than the plates' law has a meaning for.
            on = hold_on_n * max(0.1, 1.0 + (stroke_m - x) / plate_m) ** power
            off = hold_off_n * max(0.1, 1.0 + x / plate_m) ** power
            total = thrust_n_a * i + on - off - drag_n_s_m * v
            if stop == "on":
                total -= p.on_stiffness_n_m * (x - stroke_m) * max(0.0, 1.0 + p.on_loss_s_m * v)
            elif stop == "off":
                total -= p.off_stiffness_n_m * x * max(0.0, 1.0 - p.off_loss_s_m * v)
            return total - skin_n_m * max(0.0, x - skin_at_m)

        return force


def _crossing(at_m: float, direction: int) -> Callable[[float, np.ndarray], float]:
    def crossing(_: float, y: np.ndarray) -> float:
        return float(y[0]) - at_m

    crossing.terminal, crossing.direction = True, direction  # type: ignore[attr-defined]
    return crossing

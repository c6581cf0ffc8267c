"""Level ``reference``: lag and finger by an explicit Runge-Kutta method of order 8, as exact as doubles allow.

The equations are those of ``finger`` and ``contact``, written again as plainly as they can be; volts in closed form.
Time is cut into legs inside which everything is smooth: at what the bridge does, where the supply begins or ends to limit, where
the law has its kink, and at events that the solver locates: the target passes the capacity (the lag's time constant changes),
strips begin and cease to slide, become taut or loose, or are pushed together. A leg is solved once, to its end, and looked up at
any time before: how time is cut into calls of ``advance`` changes nothing.

Capacitance follows sliding strips once a leg, at its value in the leg's middle, legs being short meanwhile: second order, 1e-9 of
the force at 1 mm/s. Some forty times dearer than ``dynamic``: for judging the others, and for studies of single pulls.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy.integrate import solve_ivp  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from haptics.errors import InputError
from haptics.physics.brake.base import BrakeBase
from haptics.physics.brake.charging import Regime, moved, time_to_reach_s
from haptics.physics.brake.lagged import HELD
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.looked_up import LOOKED_UP

RELATIVE_TOLERANCE = 1e-10
_ABSOLUTE_TOLERANCE = (1e-12, 1e-15, 1e-12)  # N, m, m/s
_LONGEST_S, _LONGEST_PULLED_S, _LONGEST_CHARGED_S = 50e-3, 5e-3, 1e-3
"""Longest leg: of brakes left alone, of one that is pulled, and of one that is pulled while it charges."""
_SHORTEST_S = 1e-12
_PAST_N, _PAST_M, _PAST_M_S = 1e-10, 1e-14, 1e-12
"""How far past its border an event counts, so that rounding at the border it starts from makes none."""
SLACK, PUSHED, STICKS, SLIDES = "slack", "pushed", "sticks", "slides"

Signed = Callable[[float, Any], float]


@dataclass(slots=True)
class Piece:
    """One output between two events.

    :param until_s: where it ends (s).
    :param at: capacity (N), position (m) and speed (m/s) as a function of time (s).
    :param mode: how the strips are: slack, pushed, sticks or slides.
    :param slip_m: slip at the piece's beginning (m).
    """

    until_s: float
    at: Callable[[float], Any]
    mode: str
    slip_m: float


@dataclass(slots=True)
class Volts:
    """A course of volts: ``V = target + (from - target) exp(-(t - since) / tau)``.

    :param since_s: where it begins (s).
    :param from_v: volts there, signed.
    :param regime: where they head, and how fast.
    """

    since_s: float
    from_v: float
    regime: Regime

    def __call__(self, time_s: float) -> float:
        return moved(self.from_v, self.regime, time_s - self.since_s)


class ReferenceBrakes(BrakeBase):
    """Brakes at level ``reference``; see ``BrakePlant``.

    :param system: the brakes, their supply, and what pulls on them.
    :param start_s: time at the start (s), within 1e9.
    :raises InputError: a start outside its range; here or later, a motion that cannot be solved.
    """

    level = "reference"

    def __init__(self, system: BrakeSystem, start_s: float = 0.0):
        super().__init__(system, start_s)
        outputs = system.outputs
        self._leg_from_s = self._leg_until_s = self._start_s
        self._pieces: list[list[Piece]] = [[] for _ in range(outputs)]
        self._halves: list[tuple[float, int]] = []  # when, and at which output, this leg passes half of a capacity
        self._state = [np.array([capacity_n, 0.0, 0.0]) for capacity_n in self._capacity_n]
        self._mode = [SLACK] * outputs
        self._rising = [True] * outputs
        self._full_n = [system.full_force(k) for k in range(outputs)]
        self._kink_v = [self._kink(k) for k in range(outputs)]
        self._next_leg()

    def advance(self, to_s: float) -> None:
        self._check_time(to_s)
        while self._leg_until_s <= to_s:
            self._take(self._leg_until_s)
            self._next_leg()
        self.stage.advance(to_s)
        self._look(to_s)
        self._now_s = to_s

    @property
    def speed_m_s(self) -> list[float]:
        """Of each finger (m/s)."""
        return [float(self._piece(k, self._now_s).at(self._now_s)[2]) for k in range(self._system.outputs)]

    def _changed(self) -> None:
        self._take(self._now_s)
        self._next_leg()

    # Where everything is.

    def _piece(self, k: int, time_s: float) -> Piece:
        return next(piece for piece in self._pieces[k] if time_s <= piece.until_s)

    def _look(self, time_s: float) -> None:
        """What there is to see of every output at a time in the leg."""
        for k in range(self._system.outputs):
            piece = self._piece(k, time_s)
            state = piece.at(time_s)
            force_n, y_m, _ = state.tolist()
            self._capacity_n[k], self._finger_m[k] = force_n, y_m
            self._slip_m[k] = self._slip(k, piece.mode, piece.slip_m, state)
            self._tension_n[k] = min(max(0.0, self._tension(piece.mode, piece.slip_m, state)), force_n)

    def _take(self, time_s: float) -> None:
        """Make a time in the leg the present, and report what came before."""
        self.stage.advance(time_s)
        self._look(time_s)
        for k in range(self._system.outputs):
            piece = self._piece(k, time_s)
            self._state[k], self._mode[k] = piece.at(time_s), piece.mode
        for at_s, k in self._halves:
            if at_s <= time_s and math.isfinite(self._half_n[k]):
                self._report_half(k, at_s)

    # Legs.

    def _next_leg(self) -> None:
        """Solve all outputs from the present to the next thing that volts do by themselves."""
        from_s = self._leg_from_s = self.stage.now_s
        self._choose_capacitances()
        volts, until_s = self._volts()
        self._leg_until_s, self._halves = until_s, []
        for k in range(self._system.outputs):
            self._pieces[k] = self._solve(k, volts[k], from_s, until_s)

    def _longest_s(self) -> float:
        if not self._pulling:
            return _LONGEST_S
        stage = self.stage
        if stage.charging and max(map(abs, stage.voltages_v)) < HELD * stage.set_v:
            return _LONGEST_CHARGED_S
        return _LONGEST_PULLED_S

    def _choose_capacitances(self) -> None:
        """Capacitances as they will be in the leg's middle, the strips going on as they slide now."""
        now_s, ahead_s = self.stage.now_s, 0.5 * self._longest_s()
        for k in self._pulling:
            force_n, _, v = self._state[k].tolist()
            speed_m_s = 0.0
            if self._mode[k] == SLIDES:
                rate = self._rate(k, abs(self.stage.voltage_v(k)), self._slip_m[k], force_n)
                speed_m_s = max(0.0, v - rate / self._system.finger.strip_stiffness_n_m)
            elif self._mode[k] == PUSHED:
                speed_m_s = min(0.0, v)
            self._slide(k, now_s, max(0.0, self._slip_m[k] + speed_m_s * ahead_s))

    def _volts(self) -> tuple[list[Volts], float]:
        """Every output's course of volts, and how long all of them last."""
        stage = self.stage
        now_s = stage.now_s
        shortest_s = _SHORTEST_S + 1e-15 * abs(now_s)
        next_s = stage.next_event_s
        until_s = min(now_s + self._longest_s(), math.inf if next_s is None else next_s)
        courses: list[Volts] = []
        for k in range(self._system.outputs):
            u_v = stage.voltage_v(k)
            if stage.mask >> k & 1 and stage.charging:
                sign = stage.polarity
                regime = stage.load.regime(u_v * sign)
                left_s = math.inf if math.isnan(regime.until_v) else time_to_reach_s(u_v * sign, regime.until_v, regime)
                if left_s < shortest_s:
                    border_v = regime.until_v if regime.supply == "current" else math.nextafter(regime.until_v, -math.inf)
                    regime = stage.load.regime(border_v)
                    left_s = math.inf if math.isnan(regime.until_v) else time_to_reach_s(border_v, regime.until_v, regime)
                course = Volts(now_s, u_v, Regime(sign * regime.target_v, regime.tau_s, math.nan, regime.supply))
                until_s = min(until_s, now_s + left_s)
            else:
                course = Volts(now_s, u_v, Regime(0.0, stage.decay_s(k) or _SHORTEST_S, math.nan, "none"))
            for level_v in (self._kink_v[k], -self._kink_v[k], 0.0):
                reach_s = time_to_reach_s(u_v, level_v, course.regime)
                if reach_s > shortest_s:
                    until_s = min(until_s, now_s + reach_s)
            courses.append(course)
        return courses, until_s

    def _solve(self, k: int, volts: Volts, from_s: float, until_s: float) -> list[Piece]:
        """One output through a leg, from event to event."""
        state, mode, slip_m, now_s = self._state[k], self._mode[k], self._slip_m[k], from_s
        pieces: list[Piece] = []
        mode, slip_m = self._settled(k, mode, slip_m, state, abs(volts(now_s)))
        rising = self._rate(k, abs(volts(now_s)), self._slip(k, mode, slip_m, state), float(state[0])) >= 0.0
        if self._target(k, abs(volts(now_s)), slip_m) == float(state[0]):
            rising = self._rising[k]
            if k not in self._pulling and volts.from_v == volts.regime.target_v == 0.0:
                return [Piece(until_s, lambda _: state, mode, slip_m)]  # nothing acts, and nothing is on its way
        while True:
            motion = self._motion(k, volts, mode, slip_m, rising)
            borders = self._borders(k, volts, mode, slip_m, rising, motion)
            events = [_crossing(of, direction) for _, of, direction in borders]
            events.append(_passing(self._half_n[k]))
            solved = cast(Any, solve_ivp(
                motion, (now_s, until_s), state, LOOKED_UP, dense_output=True, events=events,
                rtol=RELATIVE_TOLERANCE, atol=_ABSOLUTE_TOLERANCE, first_step=min(1e-6, until_s - now_s) or None,
            ))  # fmt: skip
            if not solved.success:
                raise InputError(f"the motion of output {k} of {self._system} cannot be solved: {solved.message}")
            end_s = float(solved.t[-1])
            pieces.append(Piece(end_s if solved.status == 1 else until_s, solved.sol, mode, slip_m))
            self._halves += [(float(at_s), k) for at_s in solved.t_events[-1]]
            if solved.status != 1 or end_s >= until_s:
                pieces[-1].until_s = until_s
                self._rising[k] = rising
                return pieces
            state, now_s = solved.y[:, -1], end_s
            slip_m = self._slip(k, mode, slip_m, state)
            for (why, _, _), met in zip(borders, solved.t_events[:-1], strict=True):
                if len(met):
                    if why == "turned":
                        rising = not rising
                    else:
                        mode = why
            if (pieces[-1].mode, mode) == (SLACK, STICKS) and float(state[0]) < 2.0 * _PAST_N:
                # Without capacity the border to sliding is the one just passed, and would not be met again.
                mode = SLIDES
            if mode == SLIDES:
                slip_m = self._slip(k, mode, slip_m, state)

    def _settled(self, k: int, mode: str, slip_m: float, state: Any, volts: float) -> tuple[str, float]:
        """Mode and slip for what acts now: a jump of volts or of the hand may have changed the direction of motion."""
        if mode == SLIDES:
            rate = self._rate(k, volts, self._slip(k, mode, slip_m, state), float(state[0]))
            if float(state[2]) < rate / self._system.finger.strip_stiffness_n_m:
                return STICKS, self._slip(k, mode, slip_m, state)
        return mode, slip_m

    # The equations.

    def _target(self, k: int, volts: float, slip_m: float) -> float:
        """Steady capacity at these volts with this slip, by the law itself."""
        off_n = self._tables[k].off_n
        share = self._system.share(k, self._travel_m[k] + slip_m)
        return off_n + (self._full_n[k](volts) - off_n) * share

    def _rate(self, k: int, volts: float, slip_m: float, force_n: float, rising: bool | None = None) -> float:
        ahead_n, contact = self._target(k, volts, slip_m) - force_n, self._system.contact
        if rising is None:
            rising = ahead_n > 0.0
        return ahead_n / (contact.tau_on_s if rising else contact.tau_off_s)

    def _slip(self, k: int, mode: str, slip_m: float, state: Any) -> float:
        finger = self._system.finger
        if mode == SLIDES:
            return max(slip_m, float(state[1]) - finger.slack_m - float(state[0]) / finger.strip_stiffness_n_m)
        return min(slip_m, max(0.0, float(state[1]))) if mode == PUSHED else slip_m

    def _tension(self, mode: str, slip_m: float, state: Any) -> float:
        finger = self._system.finger
        if mode == SLIDES:
            return float(state[0])
        return finger.strip_stiffness_n_m * (float(state[1]) - slip_m - finger.slack_m) if mode == STICKS else 0.0

    def _motion(self, k: int, volts: Volts, mode: str, slip_m: float, rising: bool) -> Callable[[float, Any], Any]:
        """``(F', y', v')``; a hand that does nothing leaves the finger where it is."""
        f, moves = self._system.finger, k in self._pulling
        position_m, speed_m_s, since_s = self._hands[k]

        def motion(time_s: float, state: Any) -> Any:
            force_n, y, v = state.tolist()
            rate = self._rate(k, abs(volts(time_s)), self._slip(k, mode, slip_m, state), force_n, rising)
            if not moves:
                return rate, 0.0, 0.0
            hand_m = position_m + speed_m_s * (time_s - since_s)
            pull_n = f.load_stiffness_n_m * (hand_m - y) + f.load_damping_n_s_m * (speed_m_s - v)
            return rate, v, (pull_n - f.damping_n_s_m * v - self._tension(mode, slip_m, state)) / f.finger_mass_kg

        return motion

    def _borders(
        self, k: int, volts: Volts, mode: str, slip_m: float, rising: bool, motion: Callable[[float, Any], Any]
    ) -> list[tuple[str, Signed, int]]:
        """What ends a piece: the mode it leads to, a function with a root there, and that root's direction."""
        f, past = self._system.finger, -1.0 if rising else 1.0

        def turned(time_s: float, y: Any) -> float:
            ahead_n = self._target(k, abs(volts(time_s)), self._slip(k, mode, slip_m, y)) - float(y[0])
            return ahead_n - past * _PAST_N * 1e-2

        borders: list[tuple[str, Signed, int]] = [("turned", turned, int(past))]
        if k not in self._pulling:
            return borders
        if mode == STICKS:
            borders.append((SLIDES, lambda _, y: self._tension(STICKS, slip_m, y) - float(y[0]) - _PAST_N, 1))
            borders.append((SLACK, lambda _, y: self._tension(STICKS, slip_m, y) + _PAST_N, -1))
        elif mode == SLIDES:
            slides = f.strip_stiffness_n_m
            borders.append((STICKS, lambda t, y: float(y[2]) - motion(t, y)[0] / slides + _PAST_M_S, -1))
        elif mode == SLACK:
            borders.append((STICKS, lambda _, y: self._tension(STICKS, slip_m, y) - _PAST_N, 1))
            if slip_m > 0.0:
                borders.append((PUSHED, lambda _, y: float(y[1]) - slip_m + _PAST_M, -1))
        else:
            borders.append((SLACK, lambda _, y: float(y[2]) - _PAST_M_S, 1))
            borders.append((SLACK, lambda _, y: float(y[1]) + _PAST_M, -1))
        return borders

    def _kink(self, k: int) -> float:
        """Volts at which the law begins to rise, which overlap has no part in; 0 if it rises from 0 V on, or never."""
        law, brake, strips = self._system.laws[k], self._system.brake, self._system.strips
        geometry = (BRAKE.overlap_m2, brake.thickness_m, brake.permittivity, strips)
        off_n = law.force_n(0.0, *geometry, extrapolate=True)
        if law.force_n(1e4, *geometry, extrapolate=True) <= off_n:
            return 0.0
        # Next to nothing above the off force takes just those volts.
        return law.volts_for(off_n * (1.0 + 1e-12), *geometry, extrapolate=True)


def _crossing(of: Signed, direction: int) -> Signed:
    def crossing(time_s: float, state: Any) -> float:
        return of(time_s, state)

    crossing.terminal, crossing.direction = True, direction  # type: ignore[attr-defined]
    return crossing


def _passing(half_n: float) -> Signed:
    def passing(_: float, state: Any) -> float:
        return float(state[0]) - half_n if math.isfinite(half_n) else -1.0

    passing.terminal, passing.direction = False, 1  # type: ignore[attr-defined]
    return passing

"""The inner loops of the brake: volts on a bridge, the contact's lag, and three kinds of friction step.

Friction is implicit (backward Euler), solved exactly at every step instead of by iteration. With ``q1`` the hand's position at
the step's end, ``D = m/h + c + c_l + h k_l`` and ``R = m v/h + k_l (q1 - y) + c_l q'`` the finger's equation reads
``D v1 = R - T1``:

- ``coulomb`` (set-valued, by return mapping): solve it sticking; if the tension comes out above the capacity solve it sliding at
  ``T1 = F``, if it comes out negative solve it slack. Deciding any of it before the solve would chatter.
- ``lugre``: ``z' = v - |v| k_s z / F``, ``T = k_s z``, whose end value makes a quadratic of ``v1`` for each sign, with one root.
  Without bristle damping, which above ``4 F/|v|`` would feed energy; with a capacity that falls the bristles let go at once.
- ``pulled``: elasto-plastic play behind a slow hand, no mass.

Energy ``E = m v^2/2 + k_l (q - y)^2/2 + T^2/(2 k_s)`` never grows by itself: multiply ``D v1 = R - T1`` by ``h v1``, and with
``a (a - b) >= (a^2 - b^2)/2`` for each storage, ``T1 (y1 - y0) >= (T1^2 - T0^2)/(2 k_s)`` because strips slide in one direction
only while taut, ``E1 - E0 <= (k_l (q1 - y1) + c_l (q' - v1)) (q1 - q0) - h c v1^2``: the hand's work less what damping takes (for
``c_l``, as long as ``q' = (q1 - q0)/h``). True for any step, stiffness and course of the capacity.

Plain functions, so that numba can compile them whole; ``kernel(name, compiled=False)`` gives the same lines in Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

(FORCE, VOLTS, Y, V, S, T, HALF, HALF_AT) = range(8)
"""Columns of a plant's state: capacity, signed volts, finger's position and speed, slip, tension; the capacity to be reported
(infinite: none) and when it was passed, from the first step's beginning (nan: not)."""
WIDTH = 8
DECAYING, CHARGING, GIVEN = 0, 1, 2
"""What an output's volts do: die away, follow the supply, or are given for the one step."""


def regimes(set_v: float, total_f: float, leak: float, r: float, r_b: float, limit: float) -> tuple[float, ...]:
    """Where the supply limits what, and where the load heads meanwhile; the equations are those of ``charging.Charging``.

    :param set_v: setpoint (V).
    :param total_f: capacitance on the bridge, stray included (F).
    :param leak: conductance (siemens).
    :param r: output resistance (ohm).
    :param r_b: bleeder (ohm).
    :param limit: current limit (A).
    :return: setpoint (V); volts below which current is limited; time constant (s), target and border (V) of the current limit;
        the same of the voltage limit, whose time constant is that of a clamped output as well.
    """
    knee = set_v - r * (limit - set_v / r_b)
    through_bleeder, through_supply = 1.0 / (r_b + r) + leak, 1.0 / r + leak
    ramp, hold = limit / (1.0 + r / r_b) / through_bleeder, set_v / r / through_supply
    tau_b, tau_s = total_f / through_bleeder, total_f / through_supply
    ramp_to, hold_to = knee if ramp > knee else math.nan, math.nan if hold >= knee else knee
    return set_v, min(knee, set_v), tau_b, ramp, ramp_to, tau_s, hold, hold_to


def charged(u: float, dt: float, load: tuple[float, ...]) -> float:
    """Bridge volts after charging for a time, regime by regime.

    :param u: volts at the start, in the bridge's frame.
    :param dt: time (s).
    :param load: see ``regimes``.
    :return: volts at the end.
    """
    set_v, below, tau_b, ramp, ramp_to, tau_s, hold, hold_to = load
    for changes in range(8):
        if u > set_v:
            target, tau, until = 0.0, tau_b, set_v
        elif u < below:
            target, tau, until = ramp, tau_b, ramp_to
        else:
            target, tau, until = hold, tau_s, hold_to
        if u == target:
            return u
        step = dt
        if changes < 7 and not math.isnan(until):
            share = (until - u) / (target - u)
            if share == 0.0:
                step = 0.0
            elif 0.0 < share < 1.0:
                step = min(dt, -tau * math.log1p(-share))
        if step >= dt:
            return u + (target - u) * -math.expm1(-dt / tau)
        u = until if u < below else np.nextafter(until, -math.inf)
        dt -= step
    return u


def pulled(s: float, q: float, force: float, stiffness: float, slack: float) -> tuple[float, float]:
    """Slip and tension once a slow hand is at ``q``: ``T = k (q - s - slack)``, strips sliding no more than they must.

    Exact if hand and capacity each moved in one direction since the last call.

    :param s: slip before (m).
    :param q: the hand's position (m).
    :param force: capacity (N).
    :param stiffness: of hand and strips in series (N/m).
    :param slack: play before strips are taut (m).
    :return: slip (m) and tension (N).
    """
    taut = q - slack
    s = max(s, taut - force / stiffness)
    s = min(s, max(0.0, q))
    return s, min(max(0.0, stiffness * (taut - s)), force)


def coulomb(
    y: float, v: float, s: float, force: float, q1: float, dq: float, h: float, p: tuple[float, ...]
) -> tuple[float, float, float, float]:
    """One step of a finger against set-valued friction.

    :param y: finger's position (m).
    :param v: its speed (m/s).
    :param s: slip (m).
    :param force: capacity in the step (N).
    :param q1: the hand's position at the step's end (m).
    :param dq: the hand's speed (m/s).
    :param h: step (s).
    :param p: see ``finger_parameters``.
    :return: position (m), speed (m/s), slip (m) and tension (N) after the step.
    """
    mass, damping, k_l, c_l, slack, k_s = p
    d = mass / h + damping + c_l + h * k_l
    r = mass / h * v + k_l * (q1 - y) + c_l * dq
    v1 = (r - k_s * (y - s - slack)) / (d + h * k_s)
    tension = k_s * (y + h * v1 - s - slack)
    if tension > force:
        tension = force
        v1 = (r - force) / d
        s = y + h * v1 - slack - force / k_s
    elif tension < 0.0:
        tension = 0.0
        v1 = r / d
    y1 = y + h * v1
    if tension == 0.0:
        s = min(s, max(0.0, y1))
    return y1, v1, s, tension


def lugre(
    y: float, v: float, s: float, force: float, q1: float, dq: float, h: float, p: tuple[float, ...]
) -> tuple[float, float, float, float]:
    """As ``coulomb``, with bristles that give way gradually.

    :param y: finger's position (m).
    :param v: its speed (m/s).
    :param s: slip (m).
    :param force: capacity in the step (N).
    :param q1: the hand's position at the step's end (m).
    :param dq: the hand's speed (m/s).
    :param h: step (s).
    :param p: see ``finger_parameters``.
    :return: position (m), speed (m/s), slip (m) and tension (N) after the step.
    """
    mass, damping, k_l, c_l, slack, k_s = p
    d = mass / h + damping + c_l + h * k_l
    r = mass / h * v + k_l * (q1 - y) + c_l * dq
    v1, tension = r / d, 0.0
    if force > 1e-12:
        s = max(s, y - slack - force / k_s)
        stretch = y - s - slack  # negative while slack
        a = h * k_s / force
        # (D w -+ R)(1 + a w) +- k_s (stretch +- h w) = 0 for the speed's magnitude w.
        sign = 1.0 if r >= k_s * stretch else -1.0
        b = d - sign * r * a + h * k_s
        c = sign * (r - k_s * stretch)
        root = math.sqrt(b * b + 4.0 * d * a * c)
        w = 2.0 * c / (b + root) if b > 0.0 else (root - b) / (2.0 * d * a)
        z = (stretch + sign * h * w) / (1.0 + a * w)
        if z > 0.0:
            v1, tension = sign * w, min(k_s * z, force)
    y1 = y + h * v1
    s = max(s, y1 - slack - tension / k_s)
    if tension == 0.0:
        s = min(s, max(0.0, y1))
    return y1, v1, s, tension


def carry(
    state: Any,
    steps: int,
    h: float,
    first: float,
    modes: Any,
    taus: Any,
    polarity: float,
    load: tuple[float, ...],
    tables: Any,
    per_volt: float,
    overlap: Any,
    hands: Any,
    taus_contact: tuple[float, float],
    finger: tuple[float, ...],
    bristles: bool,
) -> None:
    """Carry all outputs of one supply through steps without any switching.

    :param state: (outputs, WIDTH), changed in place; columns as above.
    :param steps: how many.
    :param h: step (s).
    :param first: from the present volts to the first step's middle (s).
    :param modes: (outputs,), DECAYING, CHARGING or GIVEN.
    :param taus: (outputs,), time constants of decay (s).
    :param polarity: of the bridge, +1 or -1.
    :param load: setpoint (V), total capacitance (F), leak (siemens), R, bleeder (ohm), current limit (A).
    :param tables: (outputs, points), steady capacity (N).
    :param per_volt: table points a volt.
    :param overlap: (outputs, 2), overlap lost a metre, and metres slid besides ``S``.
    :param hands: (outputs, 3), position at the first step's beginning (m), speed (m/s), and whether the hand does anything.
    :param taus_contact: of the contact, on and off (s).
    :param finger: see ``finger_parameters``.
    :param bristles: True: ``lugre``, else ``coulomb``.
    """
    charging = regimes(load[0], load[1], load[2], load[3], load[4], load[5])
    on, off = -math.expm1(-h / taus_contact[0]), -math.expm1(-h / taus_contact[1])
    for k in range(len(state)):
        row = state[k]
        force, u, y, v, s, tension = row[FORCE], row[VOLTS], row[Y], row[V], row[S], row[T]
        table, lost, besides = tables[k], overlap[k, 0], overlap[k, 1]
        row[HALF_AT] = math.nan
        for i in range(steps):
            if modes[k] != GIVEN:
                dt = first if i == 0 else h
                if modes[k] == CHARGING:
                    u = charged(u * polarity, dt, charging) * polarity
                else:
                    u *= math.exp(-dt / taus[k])
            at = abs(u) * per_volt
            low = min(int(at), len(table) - 2)
            share = max(0.0, 1.0 - lost * (s + besides))
            full = table[low] + (table[low + 1] - table[low]) * (at - low)
            target = table[0] + (full - table[0]) * share
            before = force
            force += (target - force) * (on if target > force else off)
            if force >= row[HALF]:
                row[HALF_AT] = i * h - taus_contact[0] * math.log1p(-(row[HALF] - before) / (target - before))
                row[HALF] = math.inf
            if hands[k, 2] != 0.0:
                q1 = hands[k, 0] + hands[k, 1] * (i + 1) * h
                if bristles:
                    y, v, s, tension = lugre(y, v, s, force, q1, hands[k, 1], h, finger)
                else:
                    y, v, s, tension = coulomb(y, v, s, force, q1, hands[k, 1], h, finger)
        row[FORCE], row[VOLTS], row[Y], row[V], row[S], row[T] = force, u, y, v, s, tension


(B_FORCE, B_VOLTS, B_Y, B_V, B_S, B_T, B_FARAD, B_POLARITY, B_FROM, B_REVERSAL) = range(10)
"""Columns of a bank's state: as a plant's, then capacitance, polarity, end of the clamp, next reversal."""
B_WIDTH = 10


def wave(
    u: float, polarity: float, clamped_to: float, reversal: float, now: float, to: float, hz: float, clamp: float,
    load: tuple[float, ...],
) -> tuple[float, float, float, float]:  # fmt: skip
    """One driven clutch from ``now`` to ``to``; as ``OutputStage``.

    :param u: volts now, signed.
    :param polarity: of the bridge, +1 or -1.
    :param clamped_to: end of the clamp (s).
    :param reversal: next reversal (s).
    :param now: time (s).
    :param to: time to reach (s).
    :param hz: of the wave (Hz).
    :param clamp: length of a clamp (s).
    :param load: see ``regimes``.
    :return: volts, polarity, end of clamp and next reversal at ``to``.
    """
    while True:
        at = min(to, reversal)
        if clamped_to > now:
            at = min(at, clamped_to)
            u *= math.exp((now - at) / load[5])
        elif at > now:
            u = charged(u * polarity, at - now, load) * polarity
        now = at
        if at >= reversal:
            polarity = -polarity
            clamped_to = at + clamp
            reversal = at + 0.5 / hz
        elif at >= to:
            return u, polarity, clamped_to, reversal


def carry_bank(
    state: Any,
    first_step: int,
    steps: int,
    h: float,
    every: int,
    set_v: Any,
    hz: Any,
    clamp: Any,
    hands: Any,
    limits: tuple[float, ...],
    table: Any,
    per_volt: float,
    gain: Any,
    overlap: Any,
    farad: Any,
    lost: Any,
    taus_contact: tuple[float, float],
    finger: tuple[float, ...],
    model: int,
) -> None:
    """Carry every clutch of a bank, each on a supply of its own.

    :param state: (count, B_WIDTH), changed in place; columns as above.
    :param first_step: number of the first step, from 0.
    :param steps: how many.
    :param h: step (s).
    :param every: steps between looks at the capacitance.
    :param set_v: (count,), setpoints (V).
    :param hz: (count,), frequencies (Hz).
    :param clamp: (count,), lengths of a clamp (s).
    :param hands: (count, 2), position at time 0 (m) and speed (m/s).
    :param limits: R, bleeder (ohm), current limit (A), stray capacitance (F).
    :param table: (points,), steady capacity (N).
    :param per_volt: table points a volt.
    :param gain: (count,), force over the table's.
    :param overlap: (count,), overlap at first over the table's.
    :param farad: (count,), capacitance at first (F).
    :param lost: (count,), share of its own overlap lost a metre.
    :param taus_contact: of the contact, on and off (s).
    :param finger: see ``finger_parameters``.
    :param model: 0 ``pulled``, 1 ``coulomb``, 2 ``lugre``.
    """
    r, r_b, limit, stray = limits
    on, off = -math.expm1(-h / taus_contact[0]), -math.expm1(-h / taus_contact[1])
    k_l, slack, k_s = finger[2], finger[4], finger[5]
    series = k_l * k_s / (k_l + k_s)
    for k in range(len(state)):
        row = state[k]
        force, u, y, v, s, tension = row[B_FORCE], row[B_VOLTS], row[B_Y], row[B_V], row[B_S], row[B_T]
        polarity, clamped_to, reversal, one_f = row[B_POLARITY], row[B_FROM], row[B_REVERSAL], row[B_FARAD]
        load = regimes(set_v[k], max(one_f + stray, 1e-12), 0.0, r, r_b, limit)
        for i in range(first_step, first_step + steps):
            start, middle, end = i * h, (i + 0.5) * h, (i + 1) * h
            sampled = 0.0
            if set_v[k] > 0.0:
                u, polarity, clamped_to, reversal = wave(u, polarity, clamped_to, reversal, start, middle, hz[k], clamp[k], load)
                sampled = u
                u, polarity, clamped_to, reversal = wave(u, polarity, clamped_to, reversal, middle, end, hz[k], clamp[k], load)
            elif u != 0.0:
                kept = math.exp(-0.5 * h / (r * one_f)) if one_f > 0.0 else 0.0
                sampled = u * kept
                u = sampled * kept
            at = abs(sampled) * per_volt
            low = min(int(at), len(table) - 2)
            full = table[low] + (table[low + 1] - table[low]) * (at - low)
            target = gain[k] * (table[0] + (full - table[0]) * overlap[k] * max(0.0, 1.0 - lost[k] * s))
            force += (target - force) * (on if target > force else off)
            q1 = hands[k, 0] + hands[k, 1] * end
            if model == 0:
                s, tension = pulled(s, q1, force, series, slack)
                y = q1 - tension / k_l
            elif model == 1:
                y, v, s, tension = coulomb(y, v, s, force, q1, hands[k, 1], h, finger)
            else:
                y, v, s, tension = lugre(y, v, s, force, q1, hands[k, 1], h, finger)
            if (i + 1) % every == 0:
                left_f = farad[k] * max(0.0, 1.0 - lost[k] * s)
                if left_f != one_f:
                    one_f = left_f
                    load = regimes(set_v[k], max(one_f + stray, 1e-12), 0.0, r, r_b, limit)
        row[B_FORCE], row[B_VOLTS], row[B_Y], row[B_V], row[B_S], row[B_T] = force, u, y, v, s, tension
        row[B_POLARITY], row[B_FROM], row[B_REVERSAL], row[B_FARAD] = polarity, clamped_to, reversal, one_f


@cache
def kernel(name: str, compiled: bool = True) -> Callable[..., Any]:
    """A loop, compiled by numba (imported when first needed; plain where it is not installed) or plain.

    :param name: ``carry`` or ``carry_bank``.
    :param compiled: False: the plain function.
    :return: the loop.
    """
    function: Any = {"carry": carry, "carry_bank": carry_bank}[name]
    if not compiled:
        return function
    try:
        import numba
        from numba.extending import register_jitable
    except ImportError:
        return function
    for inner in (regimes, charged, pulled, coulomb, lugre, wave):
        register_jitable(inner)
    jit: Any = numba.njit(cache=True)
    return jit(function)

"""Free flight from a table: where the pin is half a millisecond on, as a function of position, speed and voltage.

Between the stops the coil's current follows speed and voltage within ``L/R`` (14 us), so that position and speed alone decide
what happens next. Their change over ``SPAN_S`` is tabulated on a grid of position, speed and voltage by the fine steps of
``kernel``, and interpolated by cubics (four nodes in each direction). Between the ends of a span the path is the quintic through
position, speed and acceleration, which also gives when the pin meets a stop.

Voltage counts as the current it drives, ``u = V R0 / R``. Resistance also sets the braking by induced voltage, ``K^2/R``; its
departure from the table's is put in as a small impulse. When voltage changes in flight the current is off its slow course for a
few ``L/R``; the pin's response to that is linear and is put in as a jump of speed and position.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np

from haptics.physics.latch.kernel import maybe_compiled
from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS, LatchParameters

SPAN_S = 0.5e-3
UNTABLED = 7
"""Why ``fly`` came back, besides the reasons of ``kernel``: here the table has no answer."""
_NODES = ((41, 21, 21), (61, 31, 31))  # of position, speed, voltage; the first that is fine enough is used
_SUBSTEPS = 20
_MAX_V = 1.4 * NOMINAL_VOLTS  # the coldest coil of minimum resistance draws as much as this at 5 V
_FAITHFUL = 2e-5  # of the stroke: largest error over a span with which a table is used


def fly(
    x: float,
    v: float,
    i: float,
    t: float,
    end: float,
    whole: bool,
    volts: float,
    resistance: float,
    marker: float,
    charge: float,
    p: tuple[float, ...],
    grid: tuple[float, ...],
    nodes: Any,
) -> tuple[float, float, float, int, float, int, float]:
    """Carry a free pin toward a time span by span; come back at the first thing worth reporting.

    Arguments and result as ``kernel.integrate``, but that the pin touches nothing at first. With ``whole`` the last span is not
    cut, but what happens in it before ``end`` is reported.

    :param x: position (m).
    :param v: speed (m/s).
    :param i: current (A).
    :param t: time now (s).
    :param end: time to reach (s).
    :param whole: True: stop short of ``end`` rather than cut the last span.
    :param volts: at the terminals (V).
    :param resistance: of the coil (ohm).
    :param marker: a position (m) whose crossing is reported too; negative: none.
    :param charge: integral of the current so far (A s).
    :param p: see ``kernel_parameters``.
    :param grid: span (s), maximum speed (m/s) and voltage (V) of the table, its resistance (ohm).
    :param nodes: see ``FlowTable``.
    :return: ``(x, v, i, touching, t, why, charge)`` as ``kernel.integrate``; ``why`` may be ``UNTABLED``.
    """
    (stroke, mass, hold_on, hold_off, d, power, thrust, length, drag, inductance) = p[:10]
    span, v_max, u_max, r_table = grid
    n_x, n_v, n_u = nodes.shape[0], nodes.shape[1], nodes.shape[2]
    norm = thrust / (1.0 + math.exp(-stroke / length))
    tau, beta = inductance / resistance, drag / mass
    u = volts * r_table / resistance
    decay = math.exp(-beta * span)
    mean_decay = (1.0 - decay) / (beta * span) if beta * span > 1e-6 else 1.0
    mean_shift = (1.0 - mean_decay) / (beta * span) if beta * span > 1e-6 else 0.5
    while t < end:
        if not (0.0 <= x <= stroke and abs(v) <= v_max and abs(u) <= u_max):
            return x, v, i, 0, t, 7, charge
        # Acceleration and the current's slow course here.
        e0, e1 = norm * math.exp(-x / length), norm * math.exp((x - stroke) / length)
        k0 = e0 + e1
        pull = hold_on * (1.0 + (stroke - x) / d) ** -power - hold_off * (1.0 + x / d) ** -power
        i_now = (volts - k0 * v) / resistance
        a0 = (k0 * i_now + pull - drag * v) / mass
        i_slow = i_now + tau / resistance * ((e1 - e0) / length * v * v + k0 * a0)
        # The current's return to that course pushes the pin a little.
        kick = k0 * (i - i_slow) * tau / mass / (1.0 - beta * tau)
        x0, v0 = x - kick * tau, v + kick
        if abs(kick) > 1e-12:
            i_now = (volts - k0 * v0) / resistance
            a0 = (k0 * i_now + pull - drag * v0) / mass
        # Where a span leads: four nodes in each direction.
        f_x, f_v, f_u = x0 / stroke * (n_x - 1), 0.5 * (v0 / v_max + 1.0) * (n_v - 1), 0.5 * (u / u_max + 1.0) * (n_u - 1)
        j_x = min(max(int(f_x) - 1, 0), n_x - 4)
        j_v = min(max(int(f_v) - 1, 0), n_v - 4)
        j_u = min(max(int(f_u) - 1, 0), n_u - 4)
        s_x, s_v, s_u = f_x - j_x, f_v - j_v, f_u - j_u
        dx = v1 = 0.0
        for a in range(4):
            w_a = (
                -(s_x - 1.0) * (s_x - 2.0) * (s_x - 3.0) / 6.0 if a == 0
                else 0.5 * s_x * (s_x - 2.0) * (s_x - 3.0) if a == 1
                else -0.5 * s_x * (s_x - 1.0) * (s_x - 3.0) if a == 2
                else s_x * (s_x - 1.0) * (s_x - 2.0) / 6.0
            )  # fmt: skip
            for b in range(4):
                w_b = w_a * (
                    -(s_v - 1.0) * (s_v - 2.0) * (s_v - 3.0) / 6.0 if b == 0
                    else 0.5 * s_v * (s_v - 2.0) * (s_v - 3.0) if b == 1
                    else -0.5 * s_v * (s_v - 1.0) * (s_v - 3.0) if b == 2
                    else s_v * (s_v - 1.0) * (s_v - 2.0) / 6.0
                )  # fmt: skip
                w_0 = -w_b * (s_u - 1.0) * (s_u - 2.0) * (s_u - 3.0) / 6.0
                w_1 = 0.5 * w_b * s_u * (s_u - 2.0) * (s_u - 3.0)
                w_2 = -0.5 * w_b * s_u * (s_u - 1.0) * (s_u - 3.0)
                w_3 = w_b * s_u * (s_u - 1.0) * (s_u - 2.0) / 6.0
                at = nodes[j_x + a, j_v + b]
                dx += w_0 * at[j_u, 0] + w_1 * at[j_u + 1, 0] + w_2 * at[j_u + 2, 0] + w_3 * at[j_u + 3, 0]
                v1 += w_0 * at[j_u, 1] + w_1 * at[j_u + 1, 1] + w_2 * at[j_u + 2, 1] + w_3 * at[j_u + 3, 1]
        # Braking by induced voltage, as far as it differs from the table's.
        middle = x0 + 0.5 * dx
        k_middle = norm * (math.exp(-middle / length) + math.exp((middle - stroke) / length))
        impulse = -k_middle * k_middle * (1.0 / resistance - 1.0 / r_table) * dx / mass
        v1 += impulse * mean_decay
        x1 = x0 + dx + impulse * span * mean_shift
        k1 = norm * (math.exp(-x1 / length) + math.exp((x1 - stroke) / length))
        pull = hold_on * (1.0 + (stroke - x1) / d) ** -power - hold_off * (1.0 + x1 / d) ** -power
        a1 = (k1 * (volts - k1 * v1) / resistance + pull - drag * v1) / mass
        # The quintic x0 + s c1 + ... + s^5 c5 through both ends.
        c1, c2 = v0 * span, 0.5 * a0 * span * span
        r0, r1, r2 = x1 - x0 - c1 - c2, v1 * span - c1 - 2.0 * c2, a1 * span * span - 2.0 * c2
        c3 = 10.0 * r0 - 4.0 * r1 + 0.5 * r2
        c4 = -15.0 * r0 + 7.0 * r1 - r2
        c5 = 6.0 * r0 - 3.0 * r1 + 0.5 * r2
        # The first thing on it: a stop, or the marker.
        why, cut, target = 0, 1.0, 0.0
        low, x_low = 0.0, x0
        for quarter in range(1, 5):
            high = 0.25 * quarter
            x_high = x0 + high * (c1 + high * (c2 + high * (c3 + high * (c4 + high * c5))))
            for what in range(3):
                level = stroke if what == 0 else 0.0 if what == 1 else marker
                if what == 0:
                    meets = x_high > stroke
                elif what == 1:
                    meets = x_high < 0.0
                else:
                    meets = marker >= 0.0 and (x_low - marker) * (x_high - marker) < 0.0
                if not meets:
                    continue
                left, right, rising = low, high, x_high > level
                for _ in range(48):
                    s = 0.5 * (left + right)
                    at_s = x0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
                    if (at_s > level) == rising:
                        right = s
                    else:
                        left = s
                if why == 0 or right < cut:
                    cut, target = right, level
                    why = 1 if what == 0 else 3 if what == 1 else 6
            if why != 0:
                break
            low, x_low = high, x_high
        limit = (end - t) / span
        last = limit < cut
        if last and whole:
            break
        if last:
            cut, why = limit, 0
        if cut < 1.0:
            x1 = x0 + cut * (c1 + cut * (c2 + cut * (c3 + cut * (c4 + cut * c5)))) if why == 0 else target
            v1 = (c1 + cut * (2.0 * c2 + cut * (3.0 * c3 + cut * (4.0 * c4 + cut * 5.0 * c5)))) / span
            e0, e1 = norm * math.exp(-x1 / length), norm * math.exp((x1 - stroke) / length)
            k1 = e0 + e1
            pull = hold_on * (1.0 + (stroke - x1) / d) ** -power - hold_off * (1.0 + x1 / d) ** -power
            a1 = (k1 * (volts - k1 * v1) / resistance + pull - drag * v1) / mass
        else:
            e0, e1 = norm * math.exp(-x1 / length), norm * math.exp((x1 - stroke) / length)
        i1 = (volts - k1 * v1) / resistance + tau / resistance * ((e1 - e0) / length * v1 * v1 + k1 * a1)
        # What of the current's return is still to come is left to the next span, with its push.
        unsettled = math.exp(-cut * span / tau)
        if unsettled > 1e-12:
            i1 += (i - i_slow) * unsettled
            v1 -= kick * unsettled
            if why == 0:
                x1 += kick * unsettled * tau
        passed_off = math.exp(-x / length) - math.exp(-x1 / length)
        passed_on = math.exp((x1 - stroke) / length) - math.exp((x - stroke) / length)
        flux = norm * length * (passed_off + passed_on)
        charge += (volts * cut * span - flux - inductance * (i1 - i)) / resistance
        x, v, i = x1, v1, i1
        t = end if last else t + cut * span
        if why == 1:
            return x, v, i, 1, t, why, charge
        if why == 3:
            return x, v, i, -1, t, why, charge
        if why == 6:
            return x, v, i, 0, t, why, charge
    return x, v, i, 0, t, 0, charge


@cache
def flight(compiled: bool = True) -> Callable[..., tuple[float, float, float, int, float, int, float]]:
    """``fly``, compiled by numba or as it stands.

    :param compiled: False: the plain function.
    :return: the function.
    """
    return maybe_compiled(fly) if compiled else fly


@dataclass(frozen=True, eq=False)
class FlowTable:
    """Flight of one parameter set over ``SPAN_S``.

    :param grid: span (s), maximum speed (m/s), maximum voltage (V), resistance (ohm).
    :param nodes: (position, speed, voltage, 2), the last axis being change of position (m) and speed after a span (m/s); equally
        spaced from 0 to the stroke, and from minus to plus the maximum speed and voltage.
    :param error_m: largest error of the position after a span (m), tried halfway between nodes.
    """

    grid: tuple[float, float, float, float]
    nodes: np.ndarray
    error_m: float


@lru_cache(maxsize=256)
def flow_table(parameters: LatchParameters) -> FlowTable | None:
    """The table of a parameter set, or None where half a millisecond is too long a span for it.

    Made once for all coils that differ by resistance and skin only, in under 0.1 s.

    :param parameters: of the tactor; its resistance and skin do not count.
    :return: the table, or None.
    """
    return _flow_table(parameters.with_values(resistance_ohm=LATCH.resistance_ohm, skin_stiffness_n_m=0.0))


@lru_cache(maxsize=64)
def _flow_table(p: LatchParameters) -> FlowTable | None:
    rate, beta = p.resistance_ohm / p.inductance_h, p.drag_n_s_m / p.mass_kg
    # The current's slow course must be reached well within a span; and a pin that stops at once has no flight to speak of.
    if rate * SPAN_S < 10.0 or beta * SPAN_S > 5.0:
        return None
    v_max = _max_speed(p)
    for counts in _NODES:
        ends = ((0.0, p.stroke_m), (-v_max, v_max), (-_MAX_V, _MAX_V))
        axes = [np.linspace(*end, count) for end, count in zip(ends, counts, strict=True)]
        x, v, u = np.meshgrid(*axes, indexing="ij")
        nodes = np.stack(_after_a_span(x, v, u, p), axis=-1)
        middles = [0.5 * (axis[1:-2] + axis[2:-1]) for axis in axes]
        x, v, u = np.meshgrid(*middles, indexing="ij")
        true, tried = _after_a_span(x, v, u, p), nodes
        for axis in range(3):
            tried = _halfway(tried, axis)
        error_m = float(np.max(np.abs(tried[..., 0] - true[0])))
        if error_m <= _FAITHFUL * p.stroke_m:
            return FlowTable((SPAN_S, v_max, _MAX_V, p.resistance_ohm), nodes, error_m)
    return None


def _halfway(nodes: np.ndarray, axis: int) -> np.ndarray:
    """The cubic through four nodes, halfway between the middle two."""
    n = np.moveaxis(nodes, axis, 0)
    return np.moveaxis((9.0 * (n[1:-2] + n[2:-1]) - n[:-3] - n[3:]) / 16.0, 0, axis)


def _after_a_span(x: np.ndarray, v: np.ndarray, u: np.ndarray, p: LatchParameters) -> tuple[np.ndarray, np.ndarray]:
    """Change of position and the speed after a span of free flight, as if there were no stops; Runge-Kutta of order 4."""
    h = SPAN_S / _SUBSTEPS
    x0, x1, v1 = x, x, v
    for _ in range(_SUBSTEPS):
        a = _acceleration(x1, v1, u, p)
        b_v = v1 + 0.5 * h * a
        b = _acceleration(x1 + 0.5 * h * v1, b_v, u, p)
        c_v = v1 + 0.5 * h * b
        c = _acceleration(x1 + 0.5 * h * b_v, c_v, u, p)
        d_v = v1 + h * c
        d = _acceleration(x1 + h * c_v, d_v, u, p)
        x1, v1 = x1 + h / 6.0 * (v1 + 2.0 * b_v + 2.0 * c_v + d_v), v1 + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return x1 - x0, v1


def _acceleration(x: np.ndarray, v: np.ndarray, u: np.ndarray, p: LatchParameters) -> np.ndarray:
    """Of a free pin whose current is on its slow course."""
    norm = p.thrust_n_a / (1.0 + math.exp(-p.stroke_m / p.thrust_length_m))
    e0, e1 = norm * np.exp(-x / p.thrust_length_m), norm * np.exp((x - p.stroke_m) / p.thrust_length_m)
    k = e0 + e1
    # Beyond a stop flight goes on in the mind only, and no further than a tenth of the plates' length.
    u_on = np.maximum(0.1, 1.0 + (p.stroke_m - x) / p.plate_length_m)
    u_off = np.maximum(0.1, 1.0 + x / p.plate_length_m)
    pull = p.hold_on_n * u_on**-p.plate_power - p.hold_off_n * u_off**-p.plate_power - p.drag_n_s_m * v
    i = (u - k * v) / p.resistance_ohm
    a = (k * i + pull) / p.mass_kg
    i += p.inductance_h / p.resistance_ohm**2 * ((e1 - e0) / p.thrust_length_m * v * v + k * a)
    return (k * i + pull) / p.mass_kg


def _max_speed(p: LatchParameters) -> float:
    """A speed that a pin started at rest does not pass between the stops at the maximum voltage: by energy, and by drag."""
    force = p.thrust_n_a * _MAX_V / p.resistance_ohm + max(p.hold_on_n, p.hold_off_n)
    by_energy = math.sqrt(2.0 * force * p.stroke_m / p.mass_kg)
    return min(by_energy, force / p.drag_n_s_m) if p.drag_n_s_m else by_energy

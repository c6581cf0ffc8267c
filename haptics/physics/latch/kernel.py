"""The inner loop of the ``dynamic`` level: one tactor under constant terminal voltage, step by step.

::

    m x'' = K(x) i + F_plates(x) - b x' + F_contact - F_skin
    L i'  = V - R i - K(x) x'
    K(x)        = K_s (exp(-x/l) + exp(-(s-x)/l)) / (1 + exp(-s/l))
    F_plates(x) = F_on (1 + (s-x)/d)^-p - F_off (1 + x/d)^-p
    F_contact   = k depth max(0, 1 + c depth')                      (Hunt-Crossley, away from the stop)

The step is a fourth-order Rosenbrock method (Shampine 1982): a Runge-Kutta step whose stages are made implicit by the
Jacobian, contact and coil linearised with it. It is A-stable, so that neither a stop of 1e8 N/m nor a step far beyond
``L/R`` can blow up, and needs no iteration. Contact begins and ends exactly at a step's end: a step that would pass a stop
is cut where the cubic through its ends does, so that the force is smooth inside every step.

One plain function, so that numba can compile it whole; ``kernel(compiled=False)`` runs the same lines in Python.
"""

# Types that depend on one another through these loops are beyond what a checker infers.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from haptics.physics.latch.parameters import LatchParameters
from haptics.physics.latch.plant import DEEPEST

REACHED_END, REACHED_ON, LEFT_ON, REACHED_OFF, LEFT_OFF, RESTING, PASSED, BEYOND = 0, 1, 2, 3, 4, 5, 6, 8
"""Why ``integrate`` came back. PASSED: the pin went through the marker position. BEYOND: it is so deep in a stop that the
plates' law has no meaning (7 is ``flow_map.UNTABLED``)."""
OFF_STOP, FREE, ON_STOP = -1, 0, 1
"""What the magnet touches."""


def integrate(
    x: float,
    v: float,
    i: float,
    touching: int,
    t: float,
    end: float,
    step: float,
    whole: bool,
    volts: float,
    resistance: float,
    marker: float,
    charge: float,
    p: tuple[float, ...],
) -> tuple[float, float, float, int, float, int, float]:
    """Carry the pin toward a time in steps; come back at the first thing worth reporting.

    :param x: position (m).
    :param v: speed (m/s).
    :param i: current (A).
    :param touching: one of OFF_STOP, FREE, ON_STOP.
    :param t: time now (s).
    :param end: time to reach (s).
    :param step: length of a step (s).
    :param whole: True: stop short of ``end`` rather than cut the last step.
    :param volts: at the terminals (V).
    :param resistance: of the coil (ohm).
    :param marker: a position (m) whose crossing is reported too; negative: none.
    :param charge: integral of the current so far (A s).
    :param p: see ``kernel_parameters``.
    :return: ``(x, v, i, touching, t, why, charge)`` when it came back, ``why`` one of the reasons above.
    """
    (stroke, mass, hold_on, hold_off, d, power, thrust, length, drag, inductance, k_off, c_off, k_on, c_on, k_skin, skin_at) = p
    norm = thrust / (1.0 + math.exp(-stroke / length))
    rate = resistance / inductance
    why = 0
    if not -DEEPEST * d <= x <= stroke + DEEPEST * d:
        return x, v, i, touching, t, 8, charge
    while t < end:
        h = step
        # A bounce off a hard stop is shorter than a step: follow it down to 1 us; what is faster the implicit step damps.
        # Bounces below 0.15 m/s decide nothing any more.
        if touching != 0:
            stop_rate2 = (k_off if touching < 0 else k_on) / mass
            depth = x if touching < 0 else x - stroke
            share = 0.2 if v * v + stop_rate2 * depth * depth > 0.15 * 0.15 else 0.3
            h = min(h, max(1e-6, share / math.sqrt(stop_rate2)))
        else:
            # No long step across a bounce: plates and speed bound how soon the pin could be back.
            h = min(h, max(20e-6, 0.5 * abs(v) * mass / (hold_on + hold_off + 1e-9)))
        # After a change of voltage the current needs a few L/R: begin within that, and double from step to step.
        h = min(h, 0.2 / rate + t)
        last = h >= end - t
        if last:
            if whole and h > end - t:
                break
            h = end - t
        cut, target = 1.0, 0.0
        x1, v1, i1 = x, v, i
        moved_on = False
        for attempt in range(2):
            # Linearise at the start of the step.
            e0 = norm * math.exp(-x / length)
            e1 = norm * math.exp((x - stroke) / length)
            k_x = e0 + e1
            u_on = 1.0 + (stroke - x) / d
            u_off = 1.0 + x / d
            p_on = hold_on * u_on**-power
            p_off = hold_off * u_off**-power
            force = k_x * i + p_on - p_off - drag * v
            slope_x = (e1 - e0) / length * i + power / d * (p_on / u_on + p_off / u_off)
            slope_v = -drag
            if touching < 0 and 1.0 - c_off * v > 0.0:
                force -= k_off * x * (1.0 - c_off * v)
                slope_x -= k_off * (1.0 - c_off * v)
                slope_v += k_off * x * c_off
            elif touching > 0 and 1.0 + c_on * v > 0.0:
                depth = x - stroke
                force -= k_on * depth * (1.0 + c_on * v)
                slope_x -= k_on * (1.0 + c_on * v)
                slope_v -= k_on * depth * c_on
            if x > skin_at:
                force -= k_skin * (x - skin_at)
                slope_x -= k_skin
            if attempt == 0:
                a_now = force / mass
                if abs(v) < 1e-4 and abs(a_now) < 0.5 and slope_x < 0.0 and abs(i - volts / resistance) < 1e-5 + 1e-6 * abs(i):
                    return x, v, i, touching, t, 5, charge
            j_vx = slope_x / mass
            j_vv = slope_v / mass
            j_vi = k_x / mass
            j_ix = -(e1 - e0) / length * v / inductance
            j_iv = -k_x / inductance
            g = 0.5 * h
            # (1/g - J) k = r, by elimination of position and current.
            w_i = 1.0 / g + rate
            w_v = 1.0 / g - j_vv - g * j_vx - j_vi / w_i * (j_iv + g * j_ix)
            gx1 = gv1 = gi1 = gx2 = gv2 = gi2 = gx3 = gv3 = gi3 = 0.0
            f_x, f_v, f_i = v, force / mass, (volts - k_x * v) / inductance - rate * i
            for stage in range(4):
                if stage == 1 or stage == 2:
                    if stage == 1:
                        xs, vs, cs = x + 2.0 * gx1, v + 2.0 * gv1, i + 2.0 * gi1
                    else:
                        xs = x + 48.0 / 25.0 * gx1 + 6.0 / 25.0 * gx2
                        vs = v + 48.0 / 25.0 * gv1 + 6.0 / 25.0 * gv2
                        cs = i + 48.0 / 25.0 * gi1 + 6.0 / 25.0 * gi2
                    kx = norm * (math.exp(-xs / length) + math.exp((xs - stroke) / length))
                    force = kx * cs - drag * vs
                    # Far beyond a stop the plate's law has no meaning; only the stage of a step that will be cut gets there.
                    force += hold_on * max(0.1, 1.0 + (stroke - xs) / d) ** -power - hold_off * max(0.1, 1.0 + xs / d) ** -power
                    if touching < 0 and 1.0 - c_off * vs > 0.0:
                        force -= k_off * xs * (1.0 - c_off * vs)
                    elif touching > 0 and 1.0 + c_on * vs > 0.0:
                        force -= k_on * (xs - stroke) * (1.0 + c_on * vs)
                    if xs > skin_at:
                        force -= k_skin * (xs - skin_at)
                    f_x, f_v, f_i = vs, force / mass, (volts - kx * vs) / inductance - rate * cs
                r_x, r_v, r_i = f_x, f_v, f_i
                if stage == 1:
                    r_x, r_v, r_i = r_x - 8.0 / h * gx1, r_v - 8.0 / h * gv1, r_i - 8.0 / h * gi1
                elif stage == 2:
                    r_x += (14.88 * gx1 + 2.4 * gx2) / h
                    r_v += (14.88 * gv1 + 2.4 * gv2) / h
                    r_i += (14.88 * gi1 + 2.4 * gi2) / h
                elif stage == 3:
                    r_x += (-0.896 * gx1 - 0.432 * gx2 - 0.4 * gx3) / h
                    r_v += (-0.896 * gv1 - 0.432 * gv2 - 0.4 * gv3) / h
                    r_i += (-0.896 * gi1 - 0.432 * gi2 - 0.4 * gi3) / h
                gv = (r_v + g * j_vx * r_x + j_vi / w_i * (r_i + g * j_ix * r_x)) / w_v
                gx = g * (r_x + gv)
                gi = (r_i + j_ix * gx + j_iv * gv) / w_i
                if stage == 0:
                    gx1, gv1, gi1 = gx, gv, gi
                elif stage == 1:
                    gx2, gv2, gi2 = gx, gv, gi
                elif stage == 2:
                    gx3, gv3, gi3 = gx, gv, gi
                else:
                    x1 = x + 19.0 / 9.0 * gx1 + 0.5 * gx2 + 25.0 / 108.0 * gx3 + 125.0 / 108.0 * gx
                    v1 = v + 19.0 / 9.0 * gv1 + 0.5 * gv2 + 25.0 / 108.0 * gv3 + 125.0 / 108.0 * gv
                    i1 = i + 19.0 / 9.0 * gi1 + 0.5 * gi2 + 25.0 / 108.0 * gi3 + 125.0 / 108.0 * gi
            if attempt == 1:
                break
            # Does the step pass a stop, or the marker?
            if touching == 0:
                if x1 > stroke:
                    why, target, moved_on = 1, stroke, True
                elif x1 < 0.0:
                    why, target, moved_on = 3, 0.0, True
                elif marker >= 0.0 and (x - marker) * (x1 - marker) < 0.0:
                    why, target, moved_on = 6, marker, True
            elif touching > 0 and x1 < stroke:
                why, target, moved_on = 2, stroke, True
            elif touching < 0 and x1 > 0.0:
                why, target, moved_on = 4, 0.0, True
            if not moved_on:
                break
            # Bisection on the cubic through both ends; the crossing looked for is the last one in the step.
            low, high = 0.0, 1.0
            rising = x1 > target
            for _ in range(50):
                s = 0.5 * (low + high)
                at = (
                    (1.0 + 2.0 * s) * (1.0 - s) ** 2 * x
                    + s * (1.0 - s) ** 2 * h * v
                    + s * s * (3.0 - 2.0 * s) * x1
                    + s * s * (s - 1.0) * h * v1
                )
                if (at > target) == rising:
                    high = s
                else:
                    low = s
            cut = high
            if cut * h < 1e-12:
                # In and out of a stop within one step: let the whole step stand.
                cut = 1.0
                break
            h *= cut
            last = False
        # L di = (V - R i) dt - K dx integrates exactly, whatever the step did to the current inside it.
        passed_off = math.exp(-x / length) - math.exp(-x1 / length)
        passed_on = math.exp((x1 - stroke) / length) - math.exp((x - stroke) / length)
        flux = norm * length * (passed_off + passed_on)
        charge += (volts * h - flux - inductance * (i1 - i)) / resistance
        x, v, i = x1, v1, i1
        t = end if last else t + h
        if not -DEEPEST * d <= x <= stroke + DEEPEST * d:
            return x, v, i, touching, t, 8, charge
        if moved_on:
            if cut < 1.0:
                x = target
            if why == 1:
                touching = 1
            elif why == 3:
                touching = -1
            elif why == 2 or why == 4:
                touching = 0
            return x, v, i, touching, t, why, charge
    return x, v, i, touching, t, 0, charge


def kernel_parameters(p: LatchParameters) -> tuple[float, ...]:
    """The parameters in the order that ``integrate`` unpacks them.

    :param p: of the tactor.
    :return: sixteen numbers, SI.
    """
    return (
        float(p.stroke_m),
        float(p.mass_kg),
        float(p.hold_on_n),
        float(p.hold_off_n),
        float(p.plate_length_m),
        float(p.plate_power),
        float(p.thrust_n_a),
        float(p.thrust_length_m),
        float(p.drag_n_s_m),
        float(p.inductance_h),
        float(p.off_stiffness_n_m),
        float(p.off_loss_s_m),
        float(p.on_stiffness_n_m),
        float(p.on_loss_s_m),
        float(p.skin_stiffness_n_m),
        float(p.skin_at_m),
    )


@cache
def kernel(compiled: bool = True) -> Callable[..., tuple[float, float, float, int, float, int, float]]:
    """``integrate``, compiled or as it stands.

    :param compiled: False: the plain function.
    :return: the function.
    """
    return maybe_compiled(integrate) if compiled else integrate


def maybe_compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function compiled by numba (imported here, when first needed), or as it stands where numba is not installed.

    :param function: of plain numbers and arrays.
    :return: the function, compiled or the same.
    """
    try:
        import numba
    except ImportError:
        return function
    jit: Any = numba.njit(cache=True)
    return jit(function)

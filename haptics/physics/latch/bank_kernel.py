"""The compiled loop over a bank of tactors. Imported when a bank is first made, so that nothing else waits for numba.

The rules are those of ``DynamicLatch`` and ``TableLatch``, on rows of numbers instead of objects. Times are seconds since the
bank was made, but ``TIME``, which counts from ``FROM``.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from haptics.physics.latch import flow_map as latch_flow, kernel as latch_kernel
from haptics.physics.latch.flow_map import flight
from haptics.physics.latch.kernel import kernel, maybe_compiled
from haptics.physics.latch.plant import DEEPEST

X, V, AMPS, TIME, CHARGE, FROM, ENERGY, TOUCHING, LAST, RESTS, VOLTS, OHMS = range(12)
"""Columns of ``state``: position, speed, current; time and charge since ``FROM``, when the drive last changed, and energy before;
what is touched, the stop last reached, whether it rests; the drive."""
LANDED, LANDED_V, LANDED_I, LANDED_VOLTS, LANDED_OHMS, LANDED_J, CHANGED = range(12, 19)
"""The last landing: when (nan: forgotten), speed, current, drive, the energy taken till then; and when the drive changed for the
first time since."""
WIDTH = 19
SKIN_S, OFF_S, IMPACT, ARRIVALS = range(4)
"""Columns of ``seen``: when the skin and the off stop were last reached (nan: never), speed there, and how often either was."""
_STILL_M_S = 1e-4

integrate: Any = kernel()
fly: Any = flight()


def _rest(s: Any, p: Any) -> None:
    """Put the pin at rest against the stop it touches, by Newton's method on the static force."""
    stroke, hold_on, hold_off, d, power, thrust, length = p[0], p[2], p[3], p[4], p[5], p[6], p[7]
    i = s[VOLTS] / s[OHMS]
    near_off = s[TOUCHING] < 0.0
    stiffness, stop = (p[10], 0.0) if near_off else (p[12], stroke)
    norm = thrust / (1.0 + math.exp(-stroke / length))
    x = s[X]
    for _ in range(8):
        u_on, u_off = 1.0 + (stroke - x) / d, 1.0 + x / d
        on, off = hold_on * u_on**-power, hold_off * u_off**-power
        e0, e1 = norm * math.exp(-x / length), norm * math.exp((x - stroke) / length)
        force = (e0 + e1) * i + on - off
        slope = (e1 - e0) / length * i + power / d * (on / u_on + off / u_off)
        if s[TOUCHING] != 0.0:
            force -= stiffness * (x - stop)
            slope -= stiffness
        if x > p[15]:
            force -= p[14] * (x - p[15])
            slope -= p[14]
        x -= force / slope
        if not -DEEPEST * d <= x <= stroke + DEEPEST * d:
            x = math.nan
            break
        if abs(force) < 1e-9 * abs(slope):  # converges as the square: this step was the last that counts
            break
    s[X], s[V], s[AMPS], s[RESTS] = x, 0.0, i, 1.0


rest: Any = maybe_compiled(_rest)


def _rest_now(s: Any, p: Any) -> None:
    """Count a pin that bounces as at rest and the current as settled, less the charge that its settling takes from it."""
    s[CHARGE] -= p[9] * (s[VOLTS] / s[OHMS] - s[AMPS]) / s[OHMS]
    rest(s, p)


rest_now: Any = maybe_compiled(_rest_now)


def _bounces_j(s: Any, time_s: float, p: Any) -> float:
    """What the bounces since the last landing may still hold; see ``table``."""
    return 0.5 * p[1] * s[LANDED_V] ** 2 * math.exp(-0.5 * p[8] / p[1] * (time_s - s[LANDED]))


bounces_j: Any = maybe_compiled(_bounces_j)


def _holds(energy_j: float, side: float, volts: float, ohms: float, wells: Any) -> bool:
    """Whether plates and coil keep a bouncing pin at its stop."""
    well = wells[1] if side > 0.0 else wells[0]
    return side * volts >= 0.0 and energy_j < well[0] + well[1] * abs(volts) / ohms


holds: Any = maybe_compiled(_holds)


def _carry_one(
    s: Any, seen: Any, to_s: float, whole: bool, step: float, near: float, p: Any, grid: Any, nodes: Any, wells: Any
) -> None:
    """Carry one tactor to ``to_s``; with ``whole`` the last step is not cut, and the state stays behind by less than it."""
    stroke = p[0]
    tabled = nodes.shape[0] > 0 and p[14] == 0.0
    end = to_s - s[FROM]
    while s[RESTS] == 0.0:
        marker = stroke - near if s[LAST] > 0.0 else near if s[LAST] < 0.0 else -1.0
        why, x, v, i, t, charge, touching = 7, s[X], s[V], s[AMPS], s[TIME], s[CHARGE], int(s[TOUCHING])
        if tabled and touching == 0:
            x, v, i, touching, t, why, charge = fly(x, v, i, t, end, whole, s[VOLTS], s[OHMS], marker, charge, p, grid, nodes)
        if why == 7:
            x, v, i, touching, t, why, charge = integrate(
                x, v, i, touching, t, end, step, whole, s[VOLTS], s[OHMS], marker, charge, p
            )
        s[X], s[V], s[AMPS], s[TIME], s[CHARGE], s[TOUCHING] = x, v, i, t, charge, touching
        if why == 0:
            return
        if why == 6:
            s[LAST] = 0.0
        elif why == 5:
            rest(s, p)
        elif why == 1 or why == 3:
            side = 1.0 if why == 1 else -1.0
            if s[LAST] != side:
                seen[SKIN_S if why == 1 else OFF_S] = s[FROM] + t
                seen[IMPACT] = v
                seen[ARRIVALS] += 1.0
            s[LAST] = side
            if tabled and holds(0.5 * p[1] * v * v, side, s[VOLTS], s[OHMS], wells):
                s[LANDED], s[LANDED_V], s[LANDED_I], s[CHANGED] = s[FROM] + t, v, i, math.inf
                s[LANDED_VOLTS], s[LANDED_OHMS], s[LANDED_J] = s[VOLTS], s[OHMS], s[ENERGY] + s[VOLTS] * charge
                rest_now(s, p)
        elif why == 8:
            s[X], s[RESTS] = math.nan, 1.0


carry_one: Any = maybe_compiled(_carry_one)


def _catch_up(s: Any, time_s: float, step: float, near: float, p: Any) -> None:
    """Bounce from the last landing to ``time_s`` under what has driven the coil since."""
    stroke = p[0]
    x, v, i, touching = stroke if s[TOUCHING] > 0.0 else 0.0, s[LANDED_V], s[LANDED_I], int(s[TOUCHING])
    energy_j = s[LANDED_J]
    for part in range(2):
        volts, ohms = (s[LANDED_VOLTS], s[LANDED_OHMS]) if part == 0 else (s[VOLTS], s[OHMS])
        from_s = s[LANDED] if part == 0 else min(s[CHANGED], time_s)
        # Counted from the change of drive: near a billion seconds a bounce would be lost in rounding.
        t, end, charge = 0.0, (min(s[CHANGED], time_s) if part == 0 else time_s) - from_s, 0.0
        why = 1
        while t < end and why != 5 and why != 8:
            marker = stroke - near if s[LAST] > 0.0 else near if s[LAST] < 0.0 else -1.0
            x, v, i, touching, t, why, charge = integrate(x, v, i, touching, t, end, step, False, volts, ohms, marker, charge, p)
            if why == 1 or why == 3 or why == 6:
                s[LAST] = 1.0 if why == 1 else -1.0 if why == 3 else 0.0
        if why == 8:
            x = math.nan
        energy_j += volts * (charge + volts / ohms * (end - t))
    s[ENERGY] = energy_j
    s[X], s[V], s[AMPS], s[TOUCHING], s[RESTS], s[LANDED] = x, v, i, touching, 0.0, math.nan


catch_up: Any = maybe_compiled(_catch_up)


def _carry(state: Any, seen: Any, to_s: float, step: float, near: float, p: Any, grid: Any, nodes: Any, wells: Any) -> None:
    """Carry every tactor to ``to_s``. ``nodes`` of no length: stepped throughout (level ``dynamic``)."""
    for k in range(state.shape[0]):
        carry_one(state[k], seen[k], to_s, True, step, near, p, grid, nodes, wells)


carry: Any = maybe_compiled(_carry)


def _drive(
    state: Any,
    seen: Any,
    time_s: float,
    volts: Any,
    ohms: Any,
    step: float,
    near: float,
    p: Any,
    grid: Any,
    nodes: Any,
    wells: Any,
) -> None:
    """Carry every tactor to exactly ``time_s`` and put ``volts`` over ``ohms`` on it."""
    for k in range(state.shape[0]):
        s = state[k]
        carry_one(s, seen[k], time_s, True, step, near, p, grid, nodes, wells)
        carry_one(s, seen[k], time_s, False, step, near, p, grid, nodes, wells)
        if s[RESTS] != 0.0:
            s[CHARGE] += s[VOLTS] / s[OHMS] * (time_s - s[FROM] - s[TIME])
        s[ENERGY] += s[VOLTS] * s[CHARGE]
        s[FROM], s[TIME], s[CHARGE] = time_s, 0.0, 0.0
        if volts[k] == s[VOLTS] and ohms[k] == s[OHMS]:
            continue
        bouncing = s[RESTS] != 0.0 and not math.isnan(s[LANDED])
        energy_j = bounces_j(s, time_s, p) if bouncing else 0.0
        if energy_j < 0.5 * p[1] * _STILL_M_S**2:
            s[LANDED], s[RESTS] = math.nan, 0.0
            s[VOLTS], s[OHMS] = volts[k], ohms[k]
        elif s[CHANGED] == math.inf and holds(energy_j, s[TOUCHING], volts[k], ohms[k], wells):
            # One change of drive is remembered; a second one while it still bounces is worth catching up for.
            s[CHANGED] = time_s
            s[VOLTS], s[OHMS] = volts[k], ohms[k]
            rest_now(s, p)
        else:
            catch_up(s, time_s, step, near, p)
            s[VOLTS], s[OHMS] = volts[k], ohms[k]


drive: Any = maybe_compiled(_drive)


def _forget_stale() -> None:
    """Remove cached machine code of this file that is older than the files whose code is compiled into it.

    The cache of one file does not see that another has changed.
    """
    newest = max(Path(source.__code__.co_filename).stat().st_mtime for source in (latch_kernel.integrate, latch_flow.fly))
    stats = getattr(carry, "stats", None)  # none where numba is not installed
    for index in Path(stats.cache_path).glob(f"{Path(__file__).stem}.*.nbi") if stats is not None else ():
        if index.stat().st_mtime < newest:
            index.unlink(missing_ok=True)


_forget_stale()

"""Heat of one tactor: a first-order body warmed by switching.

``rise' = (c P - rise) / tau`` with ``rise`` (K) above the room, ``P`` (W) electrical power, ``c`` (K/W), ``tau`` (s)
(thesis 3.5.2). One switch is short against ``tau`` and counts as a jump of ``E c / tau``. Advancing is exact at any step, so
heat costs nothing between events. ``c`` was measured with the coil's resistance rise in it: power is what a cold coil takes,
18 W a pulse, and does not fall as the coil warms, or that rise would be counted twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS, RESISTANCE_TOLERANCE_OHM
from haptics.physics.parameters import Parameters, parameter
from haptics.units import in_range


@dataclass(frozen=True)
class ThermalParameters(Parameters):
    """First-order heating of one tactor on a glove."""

    tau_s: float = parameter(102.0, "s", "stated", "thesis 3.5.2, +- 5 s", low=1e-3, high=1e6)
    c_k_per_w: float = parameter(69.0, "K/W", "stated", "thesis 3.5.2, +- 10 K/W", low=1e-6, high=1e6)
    tau_sd_s: float = parameter(5.0, "s", "stated", "thesis 3.5.2", low=0.0)
    c_sd_k_per_w: float = parameter(10.0, "K/W", "stated", "thesis 3.5.2", low=0.0)


THERMAL = ThermalParameters()
PULSE_POWER_W = 18.0
"""Power of a coil that is on (thesis 3.4.3: 5 V, 3.6 A)."""
WORST_PULSE_POWER_W = NOMINAL_VOLTS**2 / (LATCH.resistance_ohm - RESISTANCE_TOLERANCE_OHM)
"""Maximum that a cold coil within the stated tolerance takes: 19.5 W at 5 V and 1.28 ohm (thesis 3.4.3)."""
PULSE_S = 10e-3
"""Longest pulse, and the one the thesis' heat figures assume (3.4.3)."""
PULSE_ENERGY_J = PULSE_POWER_W * PULSE_S
MEASURED_RISE_K = 25.0
"""Heating was measured up to here: six minutes at 2 Hz (thesis 3.5.2, Fig 3.4)."""
DEFAULT_LIMIT_K = 25.0
"""Assumed limit of the rise: what the thesis calls safe at 120 switches a minute (3.5.2). A setting everywhere."""


def relax(rise_k: float, power_w: float, dt_s: float, parameters: ThermalParameters = THERMAL) -> float:
    """Rise after ``dt_s`` at constant power: ``rise + (c P - rise)(1 - exp(-dt/tau))``, exact at any step.

    The state must be float64. Above 4 K two float32 lie 4.8e-7 K apart, more than twice what a microsecond at 0.36 W adds, so
    that a rise kept in them sticks at 4.0 K where 15.5 K is true: a float32 rise is refused. Step and power may come in any
    precision; the arithmetic is float64.

    :param rise_k: rise now (K above the room); may be negative just after the room warmed.
    :param power_w: mean power over the step (W), 0 or more.
    :param dt_s: step (s), 0 or more. A clock that stepped back is the caller's fault to count; it must not cool the device.
    :param parameters: of the body.
    :return: rise after the step (K).
    :raises InputError: a negative step or power, anything not finite, or a rise of less than double precision.
    """
    in_s = in_range("dt_s", dt_s, 0.0, math.inf, "s")
    in_w = in_range("power_w", power_w, 0.0, math.inf, "W")
    dtype = getattr(rise_k, "dtype", None)
    if dtype is not None and dtype.kind == "f" and dtype.itemsize < 8:
        raise InputError(f"rise_k is {dtype}; expected float64: small steps vanish in anything coarser")
    return _relaxed(in_range("rise_k", rise_k, -math.inf, math.inf, "K"), parameters.c_k_per_w * in_w, in_s, parameters.tau_s)


def _relaxed(rise_k: float, final_k: float, dt_s: float, tau_s: float) -> float:
    """The step itself, unchecked and of plain numbers, so that numba can compile it."""
    return rise_k + (final_k - rise_k) * -math.expm1(-dt_s / tau_s)


def bounding(c_k_per_w: float, tau_low_s: float, tau_high_s: float) -> ThermalParameters:
    """Parameters of a first-order body that is never cooler than any with ``c <= c_k_per_w`` and ``tau`` between the two.

    A pulse of energy ``E`` leaves ``(E c / tau) exp(-t / tau)``. For every ``tau`` between ``a`` and ``b`` that is at most
    ``(E c / a) exp(-t / b)``, which is what it leaves in a body with ``tau = b`` and ``c b / a``. Rises are sums of such terms,
    none of them negative, so the bound holds for any pulses in any order (``docs/explanation/heat.md``). With ``a = b`` it is
    the body itself.

    :param c_k_per_w: maximum steady rise over power (K/W).
    :param tau_low_s: minimum time constant (s), 1 ms or more.
    :param tau_high_s: maximum time constant (s).
    :return: parameters of the bounding body.
    :raises InputError: a value that no body can have, or ``tau_low_s`` above ``tau_high_s``.
    """
    in_range("tau_low_s", tau_low_s, 1e-3, tau_high_s, "s")
    return ThermalParameters(tau_s=tau_high_s, c_k_per_w=c_k_per_w * tau_high_s / tau_low_s)


def pulse_rise_k(energy_j: float = PULSE_ENERGY_J, parameters: ThermalParameters = THERMAL) -> float:
    """Jump in rise of one short pulse, ``E c / tau``: 0.1218 K for the 0.18 J of a 10 ms switch at 18 W.

    :param energy_j: of the pulse (J), 0 or more.
    :param parameters: of the body.
    :return: jump (K).
    :raises InputError: ``energy_j`` negative or not finite.
    """
    return in_range("energy_j", energy_j, 0.0, math.inf, "J") * parameters.c_k_per_w / parameters.tau_s


def burst_energy_j(burst_s: float, frequency_hz: float, cycle_on_s: float = 5e-3, power_w: float = PULSE_POWER_W) -> float:
    """Energy of a burst of pulse cycles: ``power * burst * duty``, ``duty = min(1, frequency * cycle_on)``.

    A cycle is 2 ms toward the skin and 3 ms back (thesis 3.4.5), so at 200 Hz the coil is on all the time and a 50 ms
    burst holds 0.9 J.

    :param burst_s: length of the burst (s), 0 or more.
    :param frequency_hz: cycles a second (Hz), 0 or more.
    :param cycle_on_s: time in each cycle that the coil is on (s).
    :param power_w: of a coil that is on (W), 0 or more.
    :return: energy (J).
    :raises InputError: anything negative or not finite.
    """
    in_range("burst_s", burst_s, 0.0, math.inf, "s")
    in_range("frequency_hz", frequency_hz, 0.0, math.inf, "Hz")
    in_range("cycle_on_s", cycle_on_s, 0.0, math.inf, "s")
    in_range("power_w", power_w, 0.0, math.inf, "W")
    return power_w * burst_s * min(1.0, frequency_hz * cycle_on_s)

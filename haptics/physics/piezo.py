"""The fingertip piezo: a burst of vibration as an envelope (thesis 4.6.1: 240 Hz, 1.2 g on 20 g, 6 mW, 0.3 s a grasp)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.physics.parameters import Parameters, parameter
from haptics.units import STANDARD_GRAVITY_M_S2, in_range


@dataclass(frozen=True)
class PiezoParameters(Parameters):
    """One piezo vibrator on a fingertip."""

    frequency_hz: float = parameter(240.0, "Hz", "stated", "thesis 4.6.1", low=1.0, high=1e5)
    acceleration_g: float = parameter(1.2, "g", "stated", "thesis 4.6.1", low=0.0, high=1e3)
    mass_kg: float = parameter(20e-3, "kg", "stated", "thesis 4.6.1", low=1e-6, high=10.0)
    power_w: float = parameter(6e-3, "W", "stated", "thesis 4.6.1", low=0.0, high=10.0)
    tau_s: float = parameter(5e-3, "s", "assumed", "ring-up and ring-down, about a period", low=1e-6, high=1.0)


PIEZO = PiezoParameters()
GRASP_BURST_S = 0.3
"""Burst at the beginning of a grasp, none at release (thesis 4.6.1)."""


def envelope(time_s: float, burst_s: float = GRASP_BURST_S, parameters: PiezoParameters = PIEZO) -> float:
    """Share (0 to 1) of full vibration at ``time_s`` after a burst of ``burst_s`` begins: first-order up, then down.

    ``1 - exp(-t/tau)`` to the burst's end, then ``exp(-(t - burst)/tau)`` of what was reached. 0 before the burst.

    :param time_s: since the burst began (s), any finite time.
    :param burst_s: length of the burst (s), 0 or more; 0.3 by default.
    :param parameters: of the vibrator.
    :return: share of full vibration, 0 to 1.
    :raises InputError: a negative burst, or anything not finite.
    """
    in_range("time_s", time_s, -math.inf, math.inf, "s")
    in_range("burst_s", burst_s, 0.0, math.inf, "s")
    if time_s <= 0.0:
        return 0.0
    risen = -math.expm1(-min(time_s, burst_s) / parameters.tau_s)
    return risen if time_s <= burst_s else risen * math.exp(-(time_s - burst_s) / parameters.tau_s)


def acceleration_m_s2(time_s: float, burst_s: float = GRASP_BURST_S, parameters: PiezoParameters = PIEZO) -> float:
    """Acceleration of the 20 g load: a sine at 240 Hz under the envelope (thesis 4.6.1).

    :param time_s: since the burst began (s), any finite time.
    :param burst_s: length of the burst (s), 0 or more; 0.3 by default.
    :param parameters: of the vibrator.
    :return: acceleration (m/s2), signed; at most 1.2 g.
    :raises InputError: as ``envelope``.
    """
    peak = parameters.acceleration_g * STANDARD_GRAVITY_M_S2 * envelope(time_s, burst_s, parameters)
    return peak * math.sin(2.0 * math.pi * parameters.frequency_hz * time_s)


def burst_energy_j(burst_s: float = GRASP_BURST_S, parameters: PiezoParameters = PIEZO) -> float:
    """Electrical energy of a burst, ``power * length``: 1.8 mJ for a grasp.

    :param burst_s: length of the burst (s), 0 or more; 0.3 by default.
    :param parameters: of the vibrator.
    :return: energy (J).
    :raises InputError: a negative burst.
    """
    return parameters.power_w * in_range("burst_s", burst_s, 0.0, math.inf, "s")

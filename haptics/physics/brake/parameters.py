"""What an electrostatic brake is made of (thesis 4.4, 4.7.1) and where its stated range ends."""

from __future__ import annotations

from dataclasses import dataclass

from haptics.physics.parameters import Parameters, parameter
from haptics.units import VACUUM_PERMITTIVITY_F_PER_M, in_range


@dataclass(frozen=True)
class BrakeParameters(Parameters):
    """Two steel strips with a thin dielectric between them."""

    overlap_m2: float = parameter(11e-4, "m2", "stated", "thesis 4.7.1", low=0.0, high=1.0)
    thickness_m: float = parameter(13e-6, "m", "stated", "polyimide, thesis 4.4.2", low=1e-7, high=1e-2)
    permittivity: float = parameter(3.4, "1", "stated", "polyimide, thesis 4.4.2", low=1.0, high=1e3)
    friction: float = parameter(0.2, "1", "stated", "kapton on steel, thesis 4.7.1", low=0.0, high=10.0)
    breakdown_v_per_m: float = parameter(300e6, "V/m", "stated", "polyimide, thesis 4.4.2", low=1e3, high=1e10)
    width_m: float = parameter(1e-2, "m", "stated", "thesis 4.4.2", low=1e-4, high=1.0)


BRAKE = BrakeParameters()
MAX_VOLTS = 1500.0
"""Maximum amplitude (V) at which force was measured (thesis 4.7.3), and the setpoint's limit."""


def capacitance_f(overlap_m2: float, thickness_m: float, permittivity: float, strips: int = 1) -> float:
    """``C = n e_r e_0 A / d`` (Eq 4.1), 2.547 nF for the thesis' brake.

    :param overlap_m2: area of one pair of strips that overlaps (m2), 0 to 1.
    :param thickness_m: of the dielectric (m), 0.1 um to 10 mm.
    :param permittivity: relative, 1 to 1000.
    :param strips: stacked pairs of strips, 1 to 1000.
    :return: capacitance of all pairs together (F).
    :raises InputError: negative area, no thickness, permittivity below 1, or no strip.
    """
    in_range("overlap_m2", overlap_m2, 0.0, 1.0, "m2")
    in_range("thickness_m", thickness_m, 1e-7, 1e-2, "m")
    in_range("permittivity", permittivity, 1.0, 1e3)
    in_range("strips", strips, 1, 1000)
    return strips * permittivity * VACUUM_PERMITTIVITY_F_PER_M * overlap_m2 / thickness_m


def compression_n(volts: float, overlap_m2: float, thickness_m: float, permittivity: float, strips: int = 1) -> float:
    """``F = n e_r e_0 A V^2 / (2 d^2)`` (Eq 4.2), without any gap: 220 N at 1500 V for the thesis' brake.

    :param volts: amplitude (V); its sign has no effect.
    :param overlap_m2: as ``capacitance_f``.
    :param thickness_m: as ``capacitance_f``.
    :param permittivity: as ``capacitance_f``.
    :param strips: as ``capacitance_f``.
    :return: force that presses the strips together (N), of all pairs.
    :raises InputError: as ``capacitance_f``.
    """
    return (
        capacitance_f(overlap_m2, thickness_m, permittivity, strips)
        * in_range("volts", volts, -1e6, 1e6, "V") ** 2
        / (2.0 * thickness_m)
    )


def overlap_sensitivity_f_per_m(parameters: BrakeParameters = BRAKE) -> float:
    """Capacitance per metre of sliding, ``e_r e_0 w / d``: the same 23 pF/mm senses a finger's position (derived).

    :param parameters: width, thickness and permittivity of the brake.
    :return: loss of capacitance over sliding (F/m).
    """
    return capacitance_f(parameters.width_m, parameters.thickness_m, parameters.permittivity)

"""The calculator: what a brake does at an amplitude, and the amplitude that a force takes, with uncertainty and validity."""

from __future__ import annotations

from dataclasses import dataclass

from haptics.physics.brake.charging import (
    DRIVE,
    DriveParameters,
    eq44_power_w,
    max_frequency_hz,
    rise_time_s,
    steady_half_period,
)
from haptics.physics.brake.force_laws import force_law
from haptics.physics.brake.parameters import BRAKE, MAX_VOLTS, BrakeParameters, capacitance_f, compression_n
from haptics.units import in_range

MAX_FIELD_V_PER_M = 150e6
"""Field a controller may set: half of breakdown (assumed)."""
MIN_FREQUENCY_HZ = 0.5
"""Below a reversal each second, charge creeps into the dielectric and holds after switch-off (thesis 4.4.3; figure assumed)."""


@dataclass(frozen=True)
class BrakePrediction:
    """What a brake does under a bipolar square wave.

    :param volts: amplitude asked for (V).
    :param finger: whose law.
    :param law: its name.
    :param strips: stacked pairs.
    :param clutches: charging together.
    :param overlap_m2: of one pair (m2).
    :param thickness_m: of the dielectric (m).
    :param permittivity: relative.
    :param frequency_hz: of the wave (Hz).
    :param force_n: holding capacity at ``amplitude_v`` (N), 0 past breakdown.
    :param force_sd_n: its standard deviation from the law's fit (N).
    :param amplitude_v: amplitude really reached (V).
    :param capacitance_f: of one clutch, all its strips (F).
    :param compression_ideal_n: Eq 4.2 at ``volts`` (N).
    :param friction_ideal_n: Eq 4.3 at ``volts`` (N).
    :param field_v_per_um: in the dielectric (V/um).
    :param t90_ms: from 0 V to 90 % of ``volts`` (ms), all clutches charging together.
    :param max_frequency_hz: what the supply's current allows at full swing (Hz).
    :param power_eq44_w: Eq 4.4 for one clutch (W).
    :param supply_power_w: mean of v i at the supply's output for all clutches (W), stray and bleeder included.
    :param stored_charge_c: on all clutches at ``volts`` (C).
    :param valid: False with ``reasons`` where the figures are outside what was measured or allowed.
    :param reasons: one sentence for each.
    :param extrapolated: what lies outside the law's fit, one sentence each.
    """

    volts: float
    finger: str
    law: str
    strips: int
    clutches: int
    overlap_m2: float
    thickness_m: float
    permittivity: float
    frequency_hz: float
    force_n: float
    force_sd_n: float
    amplitude_v: float
    capacitance_f: float
    compression_ideal_n: float
    friction_ideal_n: float
    field_v_per_um: float
    t90_ms: float
    max_frequency_hz: float
    power_eq44_w: float
    supply_power_w: float
    stored_charge_c: float
    valid: bool
    reasons: tuple[str, ...]
    extrapolated: tuple[str, ...]


def predict_brake(
    volts: float,
    finger: str = "index",
    strips: int = 1,
    overlap_m2: float = BRAKE.overlap_m2,
    thickness_m: float = BRAKE.thickness_m,
    frequency_hz: float = 10.0,
    law: str = "threshold",
    *,
    permittivity: float = BRAKE.permittivity,
    clutches: int = 1,
    reversal: str = "clamped",
    brake: BrakeParameters = BRAKE,
    drive: DriveParameters = DRIVE,
) -> BrakePrediction:
    """Force, field, charge and power at a setpoint.

    :param volts: amplitude (V), 0 to 100 kV.
    :param finger: whose law: index or thumb.
    :param strips: stacked pairs, 1 to 64.
    :param overlap_m2: of one pair (m2), 0 to 1.
    :param thickness_m: of the dielectric (m), 0.1 um to 10 mm.
    :param frequency_hz: of the wave (Hz), 0 (constant) to 1 MHz.
    :param law: threshold, ideal or closing_gap.
    :param permittivity: relative, 1 to 1000.
    :param clutches: identical ones charging from the same supply, 1 to 64.
    :param reversal: clamped or direct, see ``charging``.
    :param brake: friction and breakdown field.
    :param drive: supply and bridge.
    :return: the prediction.
    :raises InputError: an unknown finger, law or reversal, or a number outside its range; what is merely beyond the valid range
        is answered with ``valid`` False, what is beyond the law's fit with ``extrapolated``.
    """
    the_law = force_law(finger, law)
    in_range("volts", volts, 0.0, 1e5, "V")
    in_range("strips", strips, 1, 64)
    in_range("clutches", clutches, 1, 64)
    in_range("frequency_hz", frequency_hz, 0.0, 1e6, "Hz")
    one_f = capacitance_f(overlap_m2, thickness_m, permittivity, strips)
    reached_v = min(volts, drive.supply_volts)
    half = steady_half_period(reached_v, frequency_hz, clutches * one_f, drive, reversal)
    fastest_hz = max_frequency_hz(volts, clutches * one_f, drive, reversal)
    power_w = half.energy_j * (2.0 * frequency_hz if frequency_hz else 1.0)
    field = volts / thickness_m
    broken = field > brake.breakdown_v_per_m
    reasons: list[str] = []
    if broken:
        limit = brake.breakdown_v_per_m * 1e-6
        reasons.append(f"field of {field * 1e-6:.4g} V/um is past breakdown ({limit:g} V/um): a fault, not a force")
    elif field > MAX_FIELD_V_PER_M:
        limit = MAX_FIELD_V_PER_M * 1e-6
        reasons.append(f"field of {field * 1e-6:.4g} V/um is above the {limit:g} V/um a controller may set")
    if volts > MAX_VOLTS:
        reasons.append(f"{volts:g} V is above the {MAX_VOLTS:g} V up to which force was measured")
    if volts > drive.supply_volts:
        reasons.append(f"{volts:g} V is above the supply's {drive.supply_volts:g} V")
    if frequency_hz > fastest_hz:
        reasons.append(f"{frequency_hz:g} Hz is above the {fastest_hz:.4g} Hz of full swing that supply and bridge allow")
    if frequency_hz < MIN_FREQUENCY_HZ:
        reasons.append(f"{frequency_hz:g} Hz leaves charge behind; at least {MIN_FREQUENCY_HZ:g} Hz is needed")
    if power_w > drive.supply_power_w:
        reasons.append(f"{power_w:.4g} W is above the supply's {drive.supply_power_w:g} W")
    geometry = (overlap_m2, thickness_m, permittivity, strips)
    compression = compression_n(volts, *geometry)
    return BrakePrediction(
        volts=volts,
        finger=finger,
        law=law,
        strips=strips,
        clutches=clutches,
        overlap_m2=overlap_m2,
        thickness_m=thickness_m,
        permittivity=permittivity,
        frequency_hz=frequency_hz,
        force_n=0.0 if broken else the_law.force_n(half.amplitude_v, *geometry, extrapolate=True),
        force_sd_n=0.0 if broken else the_law.force_sd_n(half.amplitude_v, *geometry, extrapolate=True),
        amplitude_v=half.amplitude_v,
        capacitance_f=one_f,
        compression_ideal_n=compression,
        friction_ideal_n=brake.friction * compression,
        field_v_per_um=field * 1e-6,
        t90_ms=1e3 * rise_time_s(volts, clutches * one_f, drive),
        max_frequency_hz=fastest_hz,
        power_eq44_w=eq44_power_w(volts, frequency_hz, one_f),
        supply_power_w=power_w,
        stored_charge_c=clutches * one_f * volts,
        valid=not reasons,
        reasons=tuple(reasons),
        extrapolated=() if broken else the_law.outside(half.amplitude_v, thickness_m, permittivity),
    )


def predict_volts(
    force_n: float,
    finger: str = "index",
    strips: int = 1,
    overlap_m2: float = BRAKE.overlap_m2,
    thickness_m: float = BRAKE.thickness_m,
    frequency_hz: float = 10.0,
    law: str = "threshold",
    *,
    permittivity: float = BRAKE.permittivity,
    clutches: int = 1,
    reversal: str = "clamped",
    brake: BrakeParameters = BRAKE,
    drive: DriveParameters = DRIVE,
) -> BrakePrediction:
    """The prediction at the amplitude that holds a force by the law; its ``valid`` is whether that amplitude may be had.

    :param force_n: force to hold (N), 0 or more.
    :param finger: as ``predict_brake``.
    :param strips: as ``predict_brake``.
    :param overlap_m2: as ``predict_brake``, but more than 0.
    :param thickness_m: as ``predict_brake``.
    :param frequency_hz: as ``predict_brake``.
    :param law: as ``predict_brake``.
    :param permittivity: as ``predict_brake``.
    :param clutches: as ``predict_brake``.
    :param reversal: as ``predict_brake``.
    :param brake: as ``predict_brake``.
    :param drive: as ``predict_brake``.
    :return: the prediction; its ``volts`` are the amplitude.
    :raises InputError: a force below 0, one that takes more than 100 kV, no overlap, or as ``predict_brake``.
    """
    volts = force_law(finger, law).volts_for(force_n, overlap_m2, thickness_m, permittivity, strips, extrapolate=True)
    return predict_brake(
        volts,
        finger,
        strips,
        overlap_m2,
        thickness_m,
        frequency_hz,
        law,
        permittivity=permittivity,
        clutches=clutches,
        reversal=reversal,
        brake=brake,
        drive=drive,
    )

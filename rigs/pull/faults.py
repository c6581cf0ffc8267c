"""What can be wrong with a pull and shows in its forces; a rig that sees one of these gives no fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptics.physics.brake.parameters import BRAKE
from rigs.fitting import Vector
from rigs.pull.parts import fit_rise, sliding_parts
from rigs.pull.record import OnePull, PullRecord
from rigs.result import Fault

_NO_FORCE_N = 0.5
"""At 1500 V; a fortieth of what is published."""
_LOST_SHARE = 0.4
"""Of the overlap that sliding strips lose; less: they do not slide, the clamp does."""
_TAUT_N = 0.2
_GROWN_M = 0.4e-3


def fit_faults(record: PullRecord, noise_n: float, overlap_m2: float) -> tuple[Fault, ...]:
    """Faults that show in the forces of all pulls together.

    :param record: of a whole run.
    :param noise_n: standard deviation of one sample, N.
    :param overlap_m2: what the strips should overlap.
    :return: the first fault found, or none.
    """
    slow = [one for one in record.pulls if one.slow and one.volts]
    fast = [one for one in record.pulls if not one.slow]
    max_n = max(float(record.of(one)[1].max()) for one in slow)
    if (fault := no_force(max_n, record.capacitance_f)) is not None:
        return (fault,)
    if (fault := growing_slack(record, slow) or growing_slack(record, fast)) is not None:
        return (fault,)
    sliding = sliding_parts(record, fast, fit_rise(record, slow, noise_n))
    for one in sliding:
        if len(one.slip_m) < 10:
            seen = f"at {one.volts:g} V the strips hardly slide within {1e3 * record.travel_m:g} mm"
            return (Fault("way_too_short", f"{seen}; shorten the slack, stiffen the frame"),)
    for one in reversed(sliding):
        fault = clamp_fault(one.volts, one.slip_m, one.force_n, noise_n, overlap_m2)
        if fault is not None:
            return (fault,)
    return ()


def growing_slack(record: PullRecord, pulls: Sequence[OnePull]) -> Fault | None:
    """Pulls of one speed, each of which takes longer to get taut than the first: the clamp has slipped meanwhile.

    :param record: of a whole run.
    :param pulls: of one speed, in their order.
    :return: ``clamp_slips``, or None.
    """
    taut: list[tuple[float, float]] = []
    for one in pulls:
        seconds, force_n = record.of(one)
        if float(force_n.max()) > 2.0 * _TAUT_N:
            taut.append((one.volts, one.speed_m_s * float(seconds[int(np.argmax(force_n > _TAUT_N))])))
    for volts, travel_m in taut[1:]:
        if travel_m - taut[0][1] > _GROWN_M:
            why = (
                f"at {volts:g} V the strips are taut after {1e3 * travel_m:.1f} mm, at {taut[0][0]:g} V they were after "
                f"{1e3 * taut[0][1]:.1f} mm: the clamp slips along the strip; tighten it"
            )
            return Fault("clamp_slips", why)
    return None


def no_force(max_n: float, capacitance_f: float) -> Fault | None:
    """Nothing was pulled.

    :param max_n: maximum force with 1500 V on, N.
    :param capacitance_f: of the output by the board's self test, F.
    :return: ``stage_still``, or None above 0.5 N.
    """
    if max_n >= _NO_FORCE_N:
        return None
    why = (
        f"the force stays below {max_n:.2g} N, though the brake has {capacitance_f * 1e9:.1f} nF and the stage reports that "
        "it moved; does its carriage move, and is the strip in the clamp?"
    )
    return Fault("stage_still", why)


def clamp_fault(volts: float, slip_m: Vector, force_n: Vector, noise_n: float, overlap_m2: float) -> Fault | None:
    """What slides loses no overlap, so that it is not the strips.

    :param volts: of the pull, V.
    :param slip_m: of samples while something slid.
    :param force_n: of the same samples (n,), N.
    :param noise_n: standard deviation of one sample, N.
    :param overlap_m2: what the strips should overlap, m^2.
    :return: ``clamp_slips``, or None where the force falls as overlap is lost.
    """
    slope, at_none_n = np.polyfit(slip_m, force_n, 1)
    lost = -float(slope / at_none_n)
    # Where the samples do not determine the slope there is nothing to report.
    slope_sd = noise_n / float(np.sqrt(np.sum((slip_m - slip_m.mean()) ** 2))) / at_none_n
    if lost >= _LOST_SHARE * BRAKE.width_m / overlap_m2 - 4.0 * slope_sd:
        return None
    why = (
        f"at {volts:g} V the force stays at {at_none_n:.3g} N while {1e3 * slip_m[-1]:.1f} mm slide, where strips would lose "
        "overlap and force: the clamp slips along the strip; tighten it"
    )
    return Fault("clamp_slips", why)

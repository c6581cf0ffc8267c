"""What can be wrong at a pull tester, and how it shows; a rig that sees one of these gives no fit."""

from __future__ import annotations

import numpy as np

from haptics.physics.brake_parameters import BRAKE
from haptics.time import NS_PER_S
from rigs.bench import Bench
from rigs.pull_fit import PullRecord, fit_rise, sliding_parts
from rigs.result import Fault

_SILENT_NS = NS_PER_S
_FLAT_SAMPLES = 100
"""A converter of 24 bits does not repeat itself that often."""
_NO_FORCE_N = 0.5
"""At 1500 V; a fortieth of what is published."""
_LOST_SHARE = 0.4
"""Of the overlap that sliding strips lose; less: they do not slide, the clamp does."""


def bench_faults(bench: Bench, channel: int) -> tuple[Fault, ...]:
    """Faults of load cell, stage, brake and board that show while the rig runs."""
    return (*cell_faults(bench), *stage_faults(bench), *brake_faults(bench, channel))


def cell_faults(bench: Bench) -> tuple[Fault, ...]:
    """The load cell is off scale, silent, or flat."""
    cell = bench.instruments["loadcell"]
    samples = cell.samples()
    force_n = samples.column()
    full_scale_n = cell.number("full_scale_n", 1e-3, 1e6, "N")
    most_n = float(np.abs(force_n).max())
    if most_n > full_scale_n:
        why = f"the load cell read {most_n:.3g} N of {full_scale_n:g} N; use one for more force, and check the zero of this one"
        return (Fault("load_cell_off_scale", why),)
    late_ns = bench.now_ns - samples.start_ns - round(float(samples.time_s[-1]) * 1e9)
    if late_ns > _SILENT_NS:
        return (Fault("load_cell_silent", f"no sample of the load cell for {late_ns / 1e9:.1f} s; check plug and supply"),)
    if len(force_n) > _FLAT_SAMPLES and np.ptp(force_n[-_FLAT_SAMPLES:]) == 0.0:
        seen = f"the load cell repeats {force_n[-1]:.4g} N to the last count"
        return (Fault("load_cell_flat", f"{seen}; is the cell wired to its converter?"),)
    return ()


def stage_faults(bench: Bench) -> tuple[Fault, ...]:
    """The stage refuses to move, or has not arrived."""
    stage = bench.stage
    if stage.refusals:
        seen = ", ".join(sorted(set(stage.refusals)))
        return (Fault("stage_still", f"the stage does not move: {seen}, state {stage.state}; home or unlock it"),)
    if not stage.idle:
        return (Fault("stage_still", f"the stage has not arrived, state {stage.state}; check its supply and its line"),)
    return ()


def brake_faults(bench: Bench, channel: int) -> tuple[Fault, ...]:
    """There is no brake, or the board saw something."""
    seen_pf = [message.capacitance[channel] for _, message in bench.telemetry]
    if seen_pf and max(seen_pf) == 0:
        why = f"output {channel} has no capacitance by the board's self test; is a brake plugged in there?"
        return (Fault("brake_absent", why),)
    return bench.faults()


def fit_faults(record: PullRecord, noise_n: float, overlap_m2: float) -> tuple[Fault, ...]:
    """Faults that show in the forces of all pulls together. :param overlap_m2: what the strips should overlap."""
    slow = [one for one in record.pulls if one.slow and one.volts]
    fast = [one for one in record.pulls if not one.slow]
    most_n = max(float(record.of(one)[1].max()) for one in slow)
    if most_n < _NO_FORCE_N:
        why = (
            f"the force stays below {most_n:.2g} N, though the brake has {record.capacitance_f * 1e9:.1f} nF and the stage says "
            "that it went; does its carriage move, and is the strip in the clamp?"
        )
        return (Fault("stage_still", why),)
    sliding = sliding_parts(record, fast, fit_rise(record, slow, noise_n))
    expected = BRAKE.width_m / overlap_m2
    for one in sliding:
        if len(one.slip_m) < 10:
            seen = f"at {one.volts:g} V the strips hardly slide within {1e3 * record.way_m:g} mm"
            return (Fault("way_too_short", f"{seen}; shorten the slack, stiffen the frame"),)
    for one in reversed(sliding):
        slope, at_none_n = np.polyfit(one.slip_m, one.force_n, 1)
        lost = -float(slope / at_none_n)
        # Where a few hundred samples cannot tell the slope there is nothing to say.
        slope_sd = noise_n / float(np.sqrt(np.sum((one.slip_m - one.slip_m.mean()) ** 2))) / at_none_n
        if lost < _LOST_SHARE * expected - 4.0 * slope_sd:
            why = (
                f"at {one.volts:g} V the force stays at {at_none_n:.3g} N while {1e3 * one.slip_m[-1]:.1f} mm slide: strips would "
                "lose overlap and force. The clamp slips along the strip; tighten it"
            )
            return (Fault("clamp_slips", why),)
    return ()

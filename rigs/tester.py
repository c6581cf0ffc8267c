"""A pull tester: what its rigs pull with, and what can be wrong at one of them and shows while it runs."""

from __future__ import annotations

import numpy as np

from haptics.errors import LimitError
from haptics.time import NS_PER_S
from rigs.bench import Bench
from rigs.result import Fault

_SILENT_NS = NS_PER_S
_TELEMETRY_S = 0.1
_FLAT_SAMPLES = 100
"""A converter of 24 bits does not repeat itself that often."""
FRAME = {"load_stiffness_n_m": 1e5, "load_damping_n_s_m": 50.0, "damping_n_s_m": 0.0}
"""What pulls a simulated brake: the stiff frame of ``haptics.physics.brake.pull.TESTER``, in place of a finger."""


def arm(bench: Bench, channel: int) -> tuple[Fault, ...]:
    """Arm the board; faults where its self test finds no brake on this output, or a bad one.

    :param bench: not armed yet.
    :param channel: output with the brake.
    :return: faults; empty if the board is armed and the brake is there.
    :raises HapticsError: it would not arm for another reason.
    """
    try:
        bench.arm()
    except LimitError:
        if any("self_test" in text for text in bench.glove.faults):  # no output has a brake
            return (_absent(channel),)
        if bench.glove.faults:
            return bench.faults()
        raise
    bench.wait(_TELEMETRY_S)
    return brake_faults(bench, channel)


def bench_faults(bench: Bench, channel: int) -> tuple[Fault, ...]:
    """Faults of load cell, stage, brake and board that show while the rig runs.

    :param bench: of the running rig.
    :param channel: output with the brake.
    :return: all that are seen now.
    """
    return (*cell_faults(bench), *stage_faults(bench), *brake_faults(bench, channel))


def cell_faults(bench: Bench) -> tuple[Fault, ...]:
    """The load cell is off scale, silent, or flat.

    :param bench: of the running rig.
    :return: at most one fault.
    """
    cell = bench.instruments["loadcell"]
    samples = cell.samples()
    force_n = samples.column()
    full_scale_n = cell.number("full_scale_n", 1e-3, 1e6, "N")
    max_n = float(np.abs(force_n).max())
    if max_n > full_scale_n:
        why = f"the load cell read {max_n:.3g} N of {full_scale_n:g} N; use one for more force, and check the zero of this one"
        return (Fault("load_cell_off_scale", why),)
    late_ns = bench.now_ns - samples.start_ns - round(float(samples.time_s[-1]) * 1e9)
    if late_ns > _SILENT_NS:
        return (Fault("load_cell_silent", f"no sample of the load cell for {late_ns / 1e9:.1f} s; check plug and supply"),)
    if len(force_n) > _FLAT_SAMPLES and np.ptp(force_n[-_FLAT_SAMPLES:]) == 0.0:
        seen = f"the load cell repeats {force_n[-1]:.4g} N to the last count"
        return (Fault("load_cell_flat", f"{seen}; is the cell wired to its converter?"),)
    return ()


def stage_faults(bench: Bench) -> tuple[Fault, ...]:
    """The stage refuses to move, or has not arrived.

    :param bench: of the running rig, its moves done.
    :return: at most one fault.
    """
    stage = bench.stage
    if stage.refusals:
        seen = ", ".join(sorted(set(stage.refusals)))
        return (Fault("stage_still", f"the stage does not move: {seen}, state {stage.state}; home or unlock it"),)
    if not stage.idle:
        return (Fault("stage_still", f"the stage has not arrived, state {stage.state}; check its supply and its line"),)
    return ()


def brake_faults(bench: Bench, channel: int) -> tuple[Fault, ...]:
    """There is no brake, or the board saw something.

    :param bench: armed.
    :param channel: output with the brake.
    :return: faults; empty for a sound brake.
    """
    seen_pf = [message.capacitance[channel] for _, message in bench.telemetry]
    if seen_pf and max(seen_pf) == 0:
        return (_absent(channel),)
    return bench.faults()


def _absent(channel: int) -> Fault:
    return Fault("brake_absent", f"output {channel} has no capacitance by the board's self test; is a brake plugged in there?")


def spare_the_cell(bench: Bench) -> None:
    """Stop the stage when the load cell is beyond what it is made for; to be a bench's ``watch``.

    :param bench: of the running rig.
    """
    cell = bench.instruments["loadcell"]
    latest = cell.latest()
    if latest is not None and abs(latest[0]) > cell.number("full_scale_n", 1e-3, 1e6, "N") and not bench.stage.idle:
        bench.stage.stop()

"""Response rig: how fast one brake grips and lets go (thesis 4.7.3).

Purpose: time from 0 to 1500 V until the force has 90 % of what it reaches, time back to 10 %, and the slew between.

Wiring: as for the pull rig, strips clamped short, so that the frame loads faster than the brake grips. Reversals play no part:
the drive has 1 Hz, and is off again before the first one.

Steps: one slow pull with volts on, which shows how fast the frame loads; then ten times: the stage pulls the free strips along at
50 mm/s, volts on for 0.12 s, volts off, on to the end of the travel, home. Each time the step lies elsewhere between two samples
of the load cell, so that all together show the edges ten times as finely.

Safe-off: on every exit the stage stops first, then volts drop and the board is disarmed; a force beyond the load cell's full
scale stops the stage.
"""

from __future__ import annotations

from rigs.bench import Bench, BenchOptions
from rigs.fitting import noise_sd
from rigs.instruments import LoadCell, Stage
from rigs.pull.faults import clamp_fault, no_force
from rigs.response.fit import ResponseRecord, Step, fit_response
from rigs.response.plots import response_plots
from rigs.result import Answer, Fault, Measured, Measurement, RigResult
from rigs.tester import FRAME, arm, bench_faults, spare_the_cell

NAME = "response"
BOARD = "brake"
INSTRUMENTS = (LoadCell, Stage)
PUBLISHED = {"response_s": Answer("response_time"), "release_s": Answer("response_time"), "slew_n_s": Answer("force_slew")}
"""Quantity here, number of the reference it answers."""
VOLTS, DRIVE_HZ = 1500.0, 1.0
STEPS = 10
TRAVEL_M = 20e-3
PULL_M_S = 50e-3
LOADING_M_S, LOADING_TRAVEL_M = 10e-3, 4e-3
BACK_M_S = 20e-3
REST_S = 0.5
BEFORE_S, HELD_S = 0.13, 0.12
"""From the move until volts are asked for, and from then until they are asked to go."""
SHORT_STRIPS = {**FRAME, "strip_stiffness_n_m": 1e6}
"""A simulated brake's strips: 10 cm of steel, 0.1 mm by 1 cm, between clamp and overlap have 2e6 N/m (E A / l)."""
_ALIKE = 0.75
"""Force of any step over that of the slow pull, at least: it has lost a little overlap."""
_MIN_DRAG_N = 2.5e-3
"""Half of what free strips drag with (thesis 4.9: a few millinewton)."""
_PASSED = 4.0
"""A frame that could load so many times the force, while it is held, has long done so when slopes are judged."""
_GOLDEN = 0.6180339887498949

MEASUREMENTS = {
    "noise_n": Measurement("noise_n", "N", 0.0, 0.02, "noise of the load cell at rest"),
    "rate_hz": Measurement("rate_hz", "Hz", 300.0, 1e4, "samples a second; fewer do not show the edge"),
    "loading_n_s": Measurement("loading_n_s", "N/s", 1500.0, 1e7, "how fast the frame loads held strips; less: it is the limit"),
    "force_n": Measurement("force_n", "N", 1.0, 45.0, "maximum force of a step"),
    "scatter_s": Measurement("scatter_s", "s", 0.0, 2e-3, "scatter of single steps about the common edge"),
}


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one brake, output ``options.channel``.

    :param options: where it runs; ``channel`` is the output.
    :return: quantities, or faults.
    :raises HapticsError: the board or an instrument cannot be used; the board is off then.
    """
    channel = options.channel
    with Bench(BOARD, INSTRUMENTS, options, rig=NAME, simulate=SHORT_STRIPS, plot=("loadcell", "force_n")) as bench:
        if faults := arm(bench, channel):
            return RigResult(NAME, faults=faults)
        bench.watch = lambda: spare_the_cell(bench)
        _let_polls_wander(bench)
        rest_ns = (bench.now_ns, _rest(bench))
        options.progress("response: how fast the frame loads")
        loading_ns = _load(bench)
        steps: list[Step] = []
        for k in range(STEPS):
            if faults := bench_faults(bench, channel):
                return RigResult(NAME, faults=faults)
            options.progress(f"response: step {k + 1} of {STEPS}")
            steps.append(_step(bench))
        if faults := bench_faults(bench, channel):
            return RigResult(NAME, faults=faults)
        bench.disarm()
        capacitance_f = max(message.capacitance[channel] for _, message in bench.telemetry) * 1e-12
        record = ResponseRecord(bench.samples("loadcell"), rest_ns, loading_ns, tuple(steps), PULL_M_S, capacitance_f)
        overlap_m2 = options.configuration.brake.overlap_m2
    return evaluate(record, overlap_m2)


def evaluate(record: ResponseRecord, overlap_m2: float) -> RigResult:
    """Faults, or times, from what was recorded.

    :param record: of a whole run.
    :param overlap_m2: what the strips should overlap.
    :return: quantities, or faults.
    """
    noise_n = noise_sd(record.raw(*record.rest_ns)[1])
    measured = [Measured(MEASUREMENTS["noise_n"], noise_n), Measured(MEASUREMENTS["rate_hz"], record.rate_hz)]
    faults = _faults(record, noise_n, overlap_m2)
    if faults:
        return RigResult(NAME, faults=faults, measured=tuple(measured))
    fit = fit_response(record)
    measured += [
        Measured(MEASUREMENTS["loading_n_s"], record.loading_n_s(PULL_M_S / LOADING_M_S)),
        Measured(MEASUREMENTS["force_n"], fit.force_n),
        Measured(MEASUREMENTS["scatter_s"], fit.response.scatter_s),
    ]
    return RigResult(
        NAME,
        quantities=fit.quantities(),
        measured=tuple(measured),
        plots=response_plots(fit, NAME),
        notes=fit.notes(VOLTS, record.capacitance_f, measured[2].value),
    )


def _let_polls_wander(bench: Bench) -> None:
    """Look at the load cell at many phases of its samples: the one that is read soonest shows when samples are taken."""
    for k in range(100):
        bench.wait(3e-3 + 2e-3 * ((k * _GOLDEN) % 1.0))


def _rest(bench: Bench) -> int:
    bench.wait(REST_S)
    return bench.now_ns


def _home(bench: Bench, travel_m: float) -> None:
    bench.wait(0.2)
    bench.move(-travel_m, BACK_M_S)
    bench.settle()


def _load(bench: Bench) -> tuple[int, int]:
    """One pull of a brake that holds already; returns when it began and ended."""
    bench.engage(bench.options.channel, VOLTS, DRIVE_HZ)
    bench.wait(0.3)  # past the first reversal, before the second
    moved_ns = bench.now_ns
    bench.move(LOADING_TRAVEL_M, LOADING_M_S)
    bench.wait(0.43)
    ended_ns = bench.now_ns
    bench.release(bench.options.channel)
    bench.settle()
    _home(bench, LOADING_TRAVEL_M)
    return moved_ns, ended_ns


def _step(bench: Bench) -> Step:
    """Pull along, volts on, volts off, home."""
    period_s = 1.0 / bench.instruments["loadcell"].rate_hz
    rest_ns = bench.now_ns
    bench.wait(0.1 + _GOLDEN * period_s)
    moved_ns = bench.now_ns
    bench.move(TRAVEL_M, PULL_M_S)
    bench.wait(BEFORE_S)
    on_ns = bench.engage(bench.options.channel, VOLTS, DRIVE_HZ)
    bench.wait(HELD_S)
    off_ns = bench.release(bench.options.channel)
    bench.settle()
    end_ns = bench.now_ns
    _home(bench, TRAVEL_M)
    return Step(rest_ns, moved_ns, on_ns, off_ns, end_ns)


def _faults(record: ResponseRecord, noise_n: float, overlap_m2: float) -> tuple[Fault, ...]:
    max_n = [float(record.since_on(one)[1].max()) for one in record.steps]
    drag_n, drag_sd_n = record.drag_n(noise_n)
    fault = no_force(max(max_n), record.capacitance_f)
    if fault is None and min(max_n) < _ALIKE * record.loaded_n():
        why = (
            f"steps reach {min(max_n):.3g} to {max(max_n):.3g} N, the slow pull before them {record.loaded_n():.3g} N: the "
            "clamp slips along the strip; tighten it"
        )
        fault = Fault("clamp_slips", why)
    fast = PULL_M_S / LOADING_M_S
    if fault is None and record.loading_n_s(fast) * HELD_S > _PASSED * max(max_n):
        fault = clamp_fault(VOLTS, *record.held(), noise_n, overlap_m2)
    if fault is None and drag_n + 3.0 * drag_sd_n < _MIN_DRAG_N:
        why = (
            f"before volts come the strips pull with {1e3 * drag_n:.1f} mN, where they should drag along with a few: they hang "
            "loose yet; take up the slack, or use a stage that speeds up sooner"
        )
        fault = Fault("strips_loose", why)
    return () if fault is None else (fault,)

"""Pull rig: the force of one brake against volts, on a pull tester (thesis 4.7.2, 4.7.3).

Purpose: two numbers that are easily taken for each other, and the law behind them. *Capacity* is what the brake holds while its
volts stand still. *Plateau* is the mean of the published pull, 1 mm/s under 10 Hz AC; it lies below the capacity, for at each
reversal the capacity dips, the strips slip, and the frame has loaded them again by a fraction only when the next one comes.

Wiring: the brake's strips between the stage's clamp and the load cell, overlap 11 cm2, slack, on one output; nothing else driven.

Steps, for each of 0, 250 ... 1500 V: a rest for the tare; 10 Hz; the published pull of 10 mm at 1 mm/s; volts off, back. Then,
with volts, once more at 0.5 Hz and 15 mm/s, which is over before the next reversal comes: its sliding part is the capacity.

Safe-off: on every exit the stage stops first, then volts drop and the board is disarmed; a force beyond the load cell's full
scale stops the stage.
"""

from __future__ import annotations

from haptics.time import seconds_to_ns
from rigs.bench import Bench, BenchOptions
from rigs.fitting import noise_sd
from rigs.instruments import LoadCell, Stage
from rigs.pull.faults import fit_faults
from rigs.pull.fit import TABLE_V, fit_pulls
from rigs.pull.plots import pull_plots
from rigs.pull.record import OnePull, PullRecord
from rigs.result import Answer, Measured, Measurement, RigResult
from rigs.tester import FRAME, arm, bench_faults, spare_the_cell

NAME = "pull"
BOARD = "brake"
INSTRUMENTS = (LoadCell, Stage)
PUBLISHED = {
    "plateau_1500_n": Answer("pull_force"),
    **{f"plateau_{volts:.0f}_n": Answer("force_index", at=volts) for volts in TABLE_V},
    "off_force_n": Answer("off_force"),
}
"""Quantity here, number or point of the reference it answers: those of the index's brake."""
VOLTS = (0.0, 250.0, 500.0, 750.0, 1000.0, 1250.0, 1500.0)
TRAVEL_M = 10e-3
SLOW_M_S, SLOW_HZ = 1e-3, 10.0
FAST_M_S, FAST_HZ = 15e-3, 0.5
BACK_M_S = 20e-3
REST_S, LONG_REST_S = 0.3, 2.0
ENGAGED_S = 0.3
"""Volts on before the published pull begins."""
REVERSED_S = 0.12
"""After its first reversal the capacity has recovered from the dip (a few contact lags)."""
LET_GO_S = 0.2

MEASUREMENTS = {
    "noise_n": Measurement("noise_n", "N", 0.0, 0.02, "noise of the load cell at rest"),
    "rate_hz": Measurement("rate_hz", "Hz", 70.0, 1e4, "samples a second; fewer miss the ripple at 10 Hz"),
    "capacitance_f": Measurement("capacitance_f", "F", 0.5e-9, 30e-9, "of the output, as the board's self test found it"),
    "misfit_share": Measurement("misfit_share", "1", 0.0, 0.03, "root mean square of the law's misfit over capacity at 1500 V"),
    "slid_m": Measurement(
        "slid_m", "m", 1e-3, TRAVEL_M, "how far the strips slid at 1500 V; less: not enough travel for the plateau"
    ),
}


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one brake, output ``options.channel``.

    :param options: where it runs; ``channel`` is the output.
    :return: quantities, or faults.
    :raises HapticsError: the board or an instrument cannot be used; the board is off then.
    """
    with Bench(BOARD, INSTRUMENTS, options, rig=NAME, simulate=FRAME, plot=("loadcell", "force_n")) as bench:
        if faults := arm(bench, options.channel):
            return RigResult(NAME, faults=faults)
        bench.watch = lambda: spare_the_cell(bench)
        pulls: list[OnePull] = []
        bench.wait(LONG_REST_S)
        for volts in VOLTS:
            options.progress(f"pull: {volts:g} V")
            for slow in (True, False) if volts else (True,):
                pulls.append(_pull(bench, volts, slow))
                faults = bench_faults(bench, options.channel)
                if faults:
                    return RigResult(NAME, faults=faults)
        bench.wait(LONG_REST_S)
        bench.disarm()
        capacitance_f = max(message.capacitance[options.channel] for _, message in bench.telemetry) * 1e-12
        record = PullRecord(bench.samples("loadcell"), tuple(pulls), bench.now_ns, TRAVEL_M, capacitance_f)
        overlap_m2 = options.configuration.brake.overlap_m2
    return evaluate(record, overlap_m2)


def evaluate(record: PullRecord, overlap_m2: float) -> RigResult:
    """Faults, or the fit, from what was recorded.

    :param record: of a whole run.
    :param overlap_m2: what the strips should overlap.
    :return: quantities, or faults.
    """
    noise_n = noise_sd(record.rest_force_n())
    measured = [
        Measured(MEASUREMENTS["noise_n"], noise_n),
        Measured(MEASUREMENTS["rate_hz"], record.rate_hz),
        Measured(MEASUREMENTS["capacitance_f"], record.capacitance_f),
    ]
    faults = fit_faults(record, noise_n, overlap_m2)
    if faults:
        return RigResult(NAME, faults=faults, measured=tuple(measured))
    fit = fit_pulls(record, noise_n)
    measured += [
        Measured(MEASUREMENTS["misfit_share"], fit.misfit_share),
        Measured(MEASUREMENTS["slid_m"], fit.slid_m),
    ]
    return RigResult(
        NAME,
        quantities=fit.quantities(),
        reduced_chi2=fit.law.reduced_chi2,
        measured=tuple(measured),
        plots=pull_plots(record, fit, NAME),
        notes=fit.notes(),
        details={"levels": fit.levels()},
    )


def _pull(bench: Bench, volts: float, slow: bool) -> OnePull:
    """Rest, engage, pull, release, and back home."""
    channel = bench.options.channel
    rest_ns = bench.now_ns
    bench.wait(REST_S if volts else LONG_REST_S)
    frequency_hz = SLOW_HZ if slow else FAST_HZ
    begun_ns = bench.engage(channel, volts, frequency_hz) if volts else bench.now_ns
    first_reversal_s = 0.25 / frequency_hz
    bench.wait(ENGAGED_S if slow else first_reversal_s + REVERSED_S)
    speed_m_s = SLOW_M_S if slow else FAST_M_S
    moved_ns = bench.now_ns
    bench.move(TRAVEL_M, speed_m_s)
    bench.settle()
    until_ns = bench.now_ns
    if not slow:  # the next reversal is at three times the first
        until_ns = min(until_ns, begun_ns + seconds_to_ns(3 * first_reversal_s))
    if volts:
        bench.release(channel)
        bench.wait(LET_GO_S)
    bench.move(-TRAVEL_M, BACK_M_S)
    bench.settle()
    return OnePull(volts, slow, speed_m_s, rest_ns, moved_ns, until_ns)

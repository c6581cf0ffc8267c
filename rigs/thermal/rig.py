"""Thermal rig: how warm an actuator gets, and how fast (thesis 3.5.2, Fig 3.4).

Purpose: ``tau``, ``c`` and the rise that switching without end would reach, of one actuator on a board.

Wiring: one thermocouple between latching plates and coil of the actuator; nothing else on the board moves.

Steps: 20 s of rest, 6 min of switching at 2 Hz (one on-off cycle a second), then 6 min of cooling with the board disarmed. The
power is measured, not assumed: pulses are timed such that the board's telemetry meets each of them at another phase, so that
the samples of current average over what the pin's motion and the coil's warmth do to it.

Safe-off: the board is disarmed, and pins withdrawn, on every exit; a rise above ``HOTTEST_K`` ends the run.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from haptics.errors import LimitError
from haptics.time import NS_PER_S, seconds_to_ns
from rigs.bench import Bench, BenchOptions
from rigs.coil_current import MAX_DIP, MIN_DIP, PulseRecord, currents, meeting_telemetry, tells_motion
from rigs.fitting import Vector, noise_sd
from rigs.instruments import Thermocouple
from rigs.result import Answer, Fault, Measured, Measurement, RigResult
from rigs.thermal.fit import HeatFit, fit_heat
from rigs.thermal.plots import heat_plots
from rigs.thermal.record import ThermalRun

NAME = "thermal"
BOARD = "tactiles"
INSTRUMENTS = (Thermocouple,)
PUBLISHED = {
    "tau_s": Answer("thermal_tau"),
    "c_nominal_k_per_w": Answer("thermal_c"),
    "rise_max_k": Answer("thermal_rise"),
    "nominal_power_w": Answer("thermal_power"),
}
"""Quantity here, number of the reference it answers."""
REST_S, HEAT_S, COOL_S = 20.0, 360.0, 360.0
SWITCHES_HZ = 2.0
PULSE_S = 10e-3
HOTTEST_K = 50.0
_GOLDEN = 0.6180339887498949

MEASUREMENTS = {
    "noise_k": Measurement("noise_k", "K", 0.0, 0.25, "noise of the thermocouple at rest; more: it is loose"),
    "lag_s": Measurement("lag_s", "s", 0.0, 4.0, "lag of the junction; more: it is loose"),
    "reduced_chi2": Measurement("reduced_chi2", "1", 0.0, 1.5, "first-order heating describes the curve"),
    "current_a": Measurement("current_a", "A", 2.0, 5.0, "mean current of a pulse; a coil draws 3.6 A (3.4.3)"),
    "rise_k": Measurement("rise_k", "K", 3.0, HOTTEST_K, "rise at the end of heating"),
    "landing_dip": Measurement(
        "landing_dip", "1", MIN_DIP, MAX_DIP, "share of the current that motion takes before the pin lands"
    ),
}


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one actuator, ``options.channel``.

    :param options: where it runs; ``channel`` is the actuator's.
    :return: quantities, or faults.
    :raises HapticsError: the board or thermocouple cannot be used, or it got too warm; the board is off then.
    """
    with Bench(BOARD, INSTRUMENTS, options, rig=NAME, plot=("thermocouple", "temperature_c")) as bench:
        start_ns = bench.now_ns
        options.progress("thermal: at rest")
        bench.wait(REST_S)
        bench.arm()
        thermocouple = bench.instruments["thermocouple"]
        base_c = None if thermocouple.latest() is None else float(np.mean(bench.samples("thermocouple").column()))
        heat_ns = _heat(bench, base_c)
        bench.disarm()
        for minute in range(int(COOL_S // 60)):
            options.progress(f"thermal: cooling, {minute} of {COOL_S / 60:g} min")
            bench.wait(60.0)
        faults = list(bench.faults())
        words = tuple(sorted({word for _, word in thermocouple.faults}))
        if "open" in words:
            faults.append(Fault("thermocouple_open", "the thermocouple's wire is broken: it reads 'open'; check plug and wire"))
        if faults:
            return RigResult(NAME, faults=tuple(faults))
        pulses = _pulses(bench, heat_ns)
        record = ThermalRun(start_ns, heat_ns, pulses, bench.samples("thermocouple"), words)
    return evaluate(record, tells_motion(options))


def evaluate(record: ThermalRun, motion_shows: bool = True) -> RigResult:
    """Faults, or the fit, from what was recorded.

    :param record: of a whole run.
    :param motion_shows: the current shows whether the pin moves; on a board simulated at level event it does not.
    :return: quantities, or faults.
    """
    seconds = record.temperatures.since(record.start_ns)
    celsius = record.temperatures.column()
    noise_k = noise_sd(celsius[seconds < REST_S])
    current_a, dip = record.pulses.mean_current_a, record.pulses.landing_dip
    measured = [Measured(MEASUREMENTS["noise_k"], noise_k), Measured(MEASUREMENTS["current_a"], current_a)]
    if motion_shows:
        measured.append(Measured(MEASUREMENTS["landing_dip"], dip))
    faults = _faults_before_fit(measured, celsius, seconds, record)
    if faults:
        return RigResult(NAME, faults=tuple(faults), measured=tuple(measured))
    fit = fit_heat(seconds, celsius, record.pulses.relative_to(record.start_ns), noise_sd(celsius))
    measured += [
        Measured(MEASUREMENTS["lag_s"], fit.lag_s),
        Measured(MEASUREMENTS["rise_k"], fit.rise_reached_k),
        Measured(MEASUREMENTS["reduced_chi2"], fit.reduced_chi2),
    ]
    faults = _faults_of_fit(measured, fit, seconds)
    plots = heat_plots(seconds, celsius, fit, record, NAME)
    if faults:
        return RigResult(NAME, faults=tuple(faults), measured=tuple(measured), plots=plots[:1])
    return RigResult(
        NAME,
        quantities=fit.quantities(),
        reduced_chi2=fit.reduced_chi2,
        measured=tuple(measured),
        plots=plots,
        notes=fit.notes(),
        details={"c_sd": fit.c_sd},
    )


def _heat(bench: Bench, base_c: float | None) -> tuple[int, int]:
    """Switch for ``HEAT_S``; returns when it began and ended."""
    thermocouple = bench.instruments["thermocouple"]

    def too_warm() -> None:
        latest = thermocouple.latest()
        if base_c is not None and latest is not None and latest[0] - base_c > HOTTEST_K:
            raise LimitError(
                f"{bench.options.board_url('tactiles')}: {latest[0] - base_c:.1f} K of rise, above the limit of {HOTTEST_K:g} K; "
                "the board is off"
            )

    bench.watch = too_warm
    channel, spacing_ns = bench.options.channel, seconds_to_ns(1.0 / SWITCHES_HZ)
    first_ns = bench.now_ns + seconds_to_ns(0.2)
    count = round(HEAT_S * SWITCHES_HZ)
    for k in range(count):
        if k % 60 == 0:
            bench.options.progress(f"thermal: heating, {k / SWITCHES_HZ:.0f} of {HEAT_S:.0f} s")
        bench.wait_until(first_ns + k * spacing_ns - seconds_to_ns(0.1))
        at_ns = meeting_telemetry(bench, first_ns + k * spacing_ns, PULSE_S * ((k * _GOLDEN) % 1.0))
        bench.pulse([channel], at_ns, PULSE_S, toward_skin=k % 2 == 0)
    bench.wait(0.2)
    bench.watch = None
    return first_ns, first_ns + count * spacing_ns


def _pulses(bench: Bench, heat_ns: tuple[int, int]) -> PulseRecord:
    starts_ns = [at_ns for at_ns in bench.pulsed_ns if heat_ns[0] - NS_PER_S < at_ns < heat_ns[1]]
    return PulseRecord.of(starts_ns, PULSE_S, currents(bench))


def _faults_before_fit(measured: list[Measured], celsius: Vector, seconds: Vector, record: ThermalRun) -> list[Fault]:
    faults: list[Fault] = []
    values = {one.measurement.name: one for one in measured}
    noise, current = values["noise_k"], values["current_a"]
    if not noise.within:
        faults.append(_loose(f"at rest it scatters by {noise.value:.2g} K"))
    elif (jump := _noise_jump(celsius)) is not None:
        at, before_k, after_k = jump
        faults.append(_loose(f"its scatter goes from {before_k:.2g} to {after_k:.2g} K after {seconds[at]:.0f} s"))
    if not current.within:
        faults.append(
            Fault(
                "coil", f"a pulse draws {current.value:.2f} A, expected 2 to 5 A. Is the coil connected, and the supply at 5 V?"
            )
        )
    dip = values.get("landing_dip")
    if current.within and dip is not None and not dip.within:
        faults.append(
            Fault(
                "actuator_stuck",
                f"the current dips by {100 * dip.value:.2f} % before the pin should land; a pin that moves takes 0.15 to 5 %. "
                "Is it free?",
            )
        )
    return faults


def _faults_of_fit(measured: list[Measured], fit: HeatFit, seconds: Vector) -> list[Fault]:
    values = {one.measurement.name: one for one in measured}
    if not values["rise_k"].within:
        return [
            Fault("thermocouple_elsewhere", f"it rose by {fit.rise_reached_k:.2g} K only; is the thermocouple on this actuator?")
        ]
    if not values["lag_s"].within:
        return [_loose(f"it lags by {fit.lag_s:.1f} s")]
    if not values["reduced_chi2"].within:
        at_s = fit.worst_at_s(seconds)
        return [_loose(f"the curve is not of first order (reduced chi squared {fit.reduced_chi2:.1f}, worst at {at_s:.0f} s)")]
    return []


def _loose(seen: str) -> Fault:
    return Fault("thermocouple_loose", f"the thermocouple is loose: {seen}; press it on and run again")


def _noise_jump(celsius: Vector, pieces: int = 24) -> tuple[int, float, float] | None:
    """Where the scatter of successive samples more than doubles, and both values; None if nowhere."""
    edges = np.linspace(0, len(celsius), pieces + 1).astype(int)
    noise = np.array([noise_sd(celsius[low:high]) for low, high in pairwise(edges)])
    for k in range(1, pieces):
        before_k = float(np.median(noise[:k]))
        if noise[k] > 2.0 * before_k:
            return int(edges[k]), before_k, float(noise[k])
    return None

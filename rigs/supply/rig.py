"""Supply rig: what the high-voltage side of a brake does (thesis 4.4.3, 4.7.1).

Purpose: capacitance, limiting current, time to charge and to discharge, volts reached over volts asked for, power at the
supply's output beside Eq 4.4, and how much capacitance a millimetre of sliding takes.

Wiring: a 1000:1 probe across one output with a brake on it, a shunt in the supply's return (0 V side). Where there is a
stage, its clamp holds the finger end of the brake and stands where the slack begins.

Steps: rest, for the probe's offsets; arm; ``CHARGES`` times from 0 V to the highest volts and shorted again; bipolar
square waves of ``WAVES``, as far as the supply can make them; with volts off the stage pulls by 2 mm, five times, and
the capacitance is measured by ramps at each stop; back, disarm.

What is measured honestly: the probe sees the output, not the supply. The supply's own volts are the output's and what falls
off at the resistance in between, which the fall of the current at the end of a ramp shows; while the bridge shorts the output
the supply stands at its set volts and feeds only its bleeder.

Safe-off: outputs are shorted and the board is disarmed on every exit.
"""

from __future__ import annotations

from typing import Any

from haptics.errors import CommandRefused, LimitError
from haptics.link.port_url import is_simulated
from haptics.physics.brake.charging import clamp_time_s
from haptics.time import seconds_to_ns
from rigs.bench import Bench, BenchOptions
from rigs.instruments import Probe, Stage
from rigs.result import Answer, Fault, Measured, Measurement, RigResult
from rigs.supply.faults import NOISIEST_A, NOISIEST_V, SupplyRun, board_faults, probe_faults
from rigs.supply.fit import Phase, SupplyFit
from rigs.supply.overlap import OverlapFit
from rigs.supply.plots import supply_plots
from rigs.supply.quantities import supply_quantities

NAME = "supply"
BOARD = "brake"
INSTRUMENTS = (Probe, Stage)
PUBLISHED = {
    "supply_current_a": Answer("supply_current"),
    "t90_s": Answer("predicted_charge_time", "time_to_charge"),
    "power_20hz_w": Answer("brake_power_bound", "power_of_one_charge"),
}
"""Quantity here, number of the reference it answers."""
REST_S = 0.2
TOP_V = 1500.0
CHARGES = 8
HELD_S = 60e-3
_CHARGE_HZ = 1.0  # its first quarter period outlasts a charge
WAVES = (
    *((1.0, hertz) for hertz in (5.0, 10.0, 20.0, 50.0)),
    *((2.0 / 3.0, hertz) for hertz in (5.0, 10.0, 20.0, 50.0)),
    *((share, 20.0) for share in (1.0 / 3.0, 1.0 / 6.0)),
)
"""Share of the highest volts, and Hz."""
STOPS_M = tuple(2e-3 * k for k in range(6))
_STAGE_M_S = 20e-3
_TRAVEL_SHARE, _TRAVEL_RAMP_S, _TRAVEL_S = 1.0 / 3.0, 1.5e-3, 0.16
_TRAVEL_HZ = (50.0, 20.0, 10.0)
_EMPTY_S = 30e-3
_LET_GO_S = 0.2  # the force stays for a while after the volts have gone
_STRAY_F = 0.3e-9  # beside what the board reports, and some to spare
_FULL_SHARE = 0.97
_LEAD_NS = 2_000_000
_GOLDEN = 0.6180339887498949

MEASUREMENTS = {
    "noise_v": Measurement("noise_v", "V", 0.0, NOISIEST_V, "noise of the probe's volts at rest"),
    "noise_a": Measurement("noise_a", "A", 0.0, NOISIEST_A, "noise of the shunt at rest"),
    "reduced_chi2": Measurement("reduced_chi2", "1", 0.0, 2.0, "volts are a line over charge: a capacitor"),
    "volts_reached": Measurement("volts_reached", "1", 0.95, 1.05, "volts reached over volts asked for; the guard trips at 1.05"),
    "discharged_s": Measurement("discharged_s", "s", 0.0, 5e-3, "from full volts to below 60 V; the board's own limit is 5 ms"),
    "lost_f": Measurement("lost_f", "F", 20e-12, 5e-9, "capacitance lost over the stage's travel; strips of 1 cm: 210 pF"),
    "travel_chi2": Measurement("travel_chi2", "1", 0.0, 10.0, "capacitance is a line over travel once the slack is out"),
    "supply_limit_a": Measurement("supply_limit_a", "A", 0.0, 550e-6, "current while the supply limits; the guard's threshold"),
}


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one output, ``options.channel``. The stage is left out on hardware that has none.

    :param options: where it runs; ``channel`` is the output.
    :return: quantities, or faults.
    :raises HapticsError: board or probe cannot be used; the board is off then.
    """
    simulated = is_simulated(options.board_url(BOARD))
    instruments = INSTRUMENTS if simulated or "stage" in options.instruments else (Probe,)
    with Bench(BOARD, instruments, options, rig=NAME, plot=("probe", "volts_v")) as bench:
        rest_ns = bench.now_ns
        options.progress("supply: at rest")
        bench.wait(REST_S)
        rested_ns = bench.now_ns
        try:
            bench.arm()
        except (LimitError, CommandRefused):
            faults = bench.faults()
            if not faults:
                raise
            return RigResult(NAME, faults=board_faults(faults))
        fault = _no_brake(bench)
        if fault is not None:
            return RigResult(NAME, faults=(fault,))
        phases: list[Phase] = []
        for step in (_charges, _waves, *((_travel,) if Stage in instruments else ())):
            step(bench, phases)
            faults = board_faults(bench.faults()) or probe_faults(_record(bench, (rest_ns, rested_ns), phases))
            if not faults and Stage in instruments and bench.stage.refusals:
                refused = ", ".join(bench.stage.refusals)
                faults = (Fault("stage_refuses", f"the stage answers {refused}; home or unlock it, and check its limits"),)
            if faults:
                return RigResult(NAME, faults=faults)
        bench.disarm()
        record = _record(bench, (rest_ns, rested_ns), phases)
    return evaluate(record)


def evaluate(record: SupplyRun) -> RigResult:
    """Faults, or the fit, from what was recorded.

    :param record: of a whole run.
    :return: quantities, or faults.
    :raises InputError: too little was recorded for a quantity.
    """
    faults = probe_faults(record)
    if faults:
        return RigResult(NAME, faults=faults)
    fit = SupplyFit(record.samples, record.rest_ns, record.phases, record.load_ohm, record.step)
    seen = {
        "noise_v": fit.noise_v,
        "noise_a": fit.noise_a,
        "reduced_chi2": fit.capacitance_f[2],
        "volts_reached": fit.settled_v[0] / fit.asked_v,
        "discharged_s": fit.discharged_within_s,
        "supply_limit_a": fit.limit_a[0],
    }
    measured = tuple(Measured(MEASUREMENTS[name], value) for name, value in seen.items())
    if not measured[2].within:
        misfit = f"volts over charge are not a straight line (reduced chi squared {measured[2].value:.1f})"
        return RigResult(NAME, faults=(Fault("probe_loose", f"{misfit}; press tip and leads on"),), measured=measured)
    if fit.overlap is not None:
        of_travel = {"lost_f": fit.overlap.lost_f, "travel_chi2": fit.overlap.reduced_chi2}
        measured += tuple(Measured(MEASUREMENTS[name], value) for name, value in of_travel.items())
        if not all(one.within for one in measured[-2:]):
            return RigResult(NAME, faults=(_stage_fault(fit.overlap),), measured=measured)
    board_f = record.said(record.phases[0])[-1].capacitance[record.channel] * 1e-12
    return RigResult(
        NAME,
        quantities=supply_quantities(fit),
        reduced_chi2=fit.capacitance_f[2],
        measured=measured,
        plots=supply_plots(fit, record, NAME),
        notes=_notes(fit, board_f),
        details={
            "waves": [_row(point) for point in fit.powers],
            "board_capacitance_f": board_f,
            "discharge_resolved": fit.discharge.resolved,
        },
    )


def _charges(bench: Bench, phases: list[Phase]) -> None:
    volts = _top_v(bench)
    for k in range(CHARGES):
        bench.options.progress(f"supply: charge {k + 1} of {CHARGES}")
        _drive(bench, phases, "charge", volts, _CHARGE_HZ, HELD_S)
        # Each charge meets the probe's samples at another phase.
        bench.wait(_EMPTY_S + 1e-4 * ((k * _GOLDEN) % 1.0))
        if bench.faults():
            return


def _waves(bench: Bench, phases: list[Phase]) -> None:
    for share, frequency_hz in WAVES:
        volts = round(share * _top_v(bench))
        if not _can_make(bench, volts, frequency_hz):
            continue
        bench.options.progress(f"supply: {volts:.0f} V at {frequency_hz:g} Hz")
        _drive(bench, phases, "power", volts, frequency_hz, max(0.35, 3.3 / frequency_hz))
        bench.wait(_EMPTY_S)
        if bench.faults():
            return


def _travel(bench: Bench, phases: list[Phase]) -> None:
    # Volts high enough for a ramp of some samples, whatever the capacitance.
    ramp_v = _TRAVEL_RAMP_S * bench.link.identity.limits[1] * 1e-6 / (_board_f(bench) + _STRAY_F)
    volts = round(min(_top_v(bench), max(_TRAVEL_SHARE * _top_v(bench), ramp_v)))
    frequency_hz = next((hertz for hertz in _TRAVEL_HZ if _can_make(bench, volts, hertz)), _TRAVEL_HZ[-1])
    at_m = 0.0
    for stop_m in STOPS_M:
        bench.options.progress(f"supply: capacitance {1e3 * stop_m:g} mm apart")
        bench.wait(_LET_GO_S)
        if stop_m > at_m:
            bench.move(stop_m - at_m, _STAGE_M_S)
            bench.settle()
            at_m = stop_m
        if bench.faults() or bench.stage.refusals:
            return
        _drive(bench, phases, "travel", volts, frequency_hz, _TRAVEL_S, stop_m)
    bench.wait(_LET_GO_S)
    bench.move(-at_m, _STAGE_M_S)
    bench.settle()


def _drive(
    bench: Bench, phases: list[Phase], kind: str, volts: float, frequency_hz: float, lasting_s: float, travel_m: float = 0.0
) -> None:
    start_ns = bench.engage(bench.options.channel, volts, frequency_hz)
    bench.wait_until(start_ns + seconds_to_ns(lasting_s))
    end_ns = bench.release(bench.options.channel)
    bench.wait(_EMPTY_S)
    phases.append(Phase(kind, volts, frequency_hz, start_ns - _LEAD_NS, end_ns, travel_m))


def _top_v(bench: Bench) -> float:
    return min(TOP_V, float(bench.link.identity.limits[0]))


def _can_make(bench: Bench, volts: float, frequency_hz: float) -> bool:
    """The supply swings the output fully, and the board allows it."""
    limits = bench.link.identity.limits
    total_f = _board_f(bench) + _STRAY_F
    charging_s = total_f * volts / (limits[1] * 1e-6)
    return charging_s < _FULL_SHARE * (0.5 / frequency_hz - clamp_time_s(frequency_hz))


def _board_f(bench: Bench) -> float:
    return 1e-12 * bench.telemetry[-1][1].capacitance[bench.options.channel]


def _no_brake(bench: Bench) -> Fault | None:
    if _board_f(bench) > 0.0:
        return None
    return Fault(
        "no_brake",
        f"the board's self test found no brake on output {bench.options.channel}; connect one, or choose another output",
    )


def _stage_fault(fit: OverlapFit) -> Fault:
    return Fault(
        "stage_loose",
        f"the stage's {1e3 * STOPS_M[-1]:g} mm took {1e12 * fit.lost_f:.0f} pF (reduced chi squared of the line "
        f"{fit.reduced_chi2:.1f}); is its clamp on the finger end of this brake, and free to move?",
    )


def _record(bench: Bench, rest_ns: tuple[int, int], phases: list[Phase]) -> SupplyRun:
    probe: Any = bench.instruments["probe"]
    return SupplyRun(
        channel=bench.options.channel,
        rest_ns=rest_ns,
        phases=tuple(phases),
        end_ns=bench.now_ns,
        samples=probe.samples(),
        telemetry=tuple(bench.telemetry),
        load_ohm=probe.load_ohm,
        step=(probe.number("volts_per_count", 1e-6, 1e4, "V"), probe.number("amps_per_count", 1e-12, 1.0, "A")),
        saturated=dict(probe.saturated),
        lost=probe.lost / max(1, probe.count),
    )


def _row(point: Any) -> dict[str, float]:
    phase = point.phase
    return {
        "volts": phase.volts,
        "frequency_hz": phase.frequency_hz,
        "power_w": point.power_w,
        "power_sd_w": point.sd_w,
        "steady_power_w": point.steady_w,
    }


def _notes(fit: SupplyFit, board_f: float) -> tuple[str, ...]:
    c_f = fit.capacitance_f[0]
    charge_s = c_f * fit.settled_v[0] / fit.limit_a[0]
    notes = [
        f"capacitance_f is all of the output, wiring and bridge included; the board, which takes 0.2 nF off for them, "
        f"reports {1e9 * board_f:.3f} nF.",
        f"C V / I is {1e3 * charge_s:.2f} ms; 4.7.1 prints 50 ms for it, which its own numbers do not give (7.6 ms).",
        "power is the mean of v i at the supply's output, which sags to the load while it charges; steady_power is what a supply "
        "at its set volts would give for the same charge, and Eq 4.4 counts one charge a period where the bridge makes two.",
    ]
    if not fit.discharge.resolved:
        notes.append(f"the discharge is faster than the probe: below 60 V within {1e6 * fit.discharged_within_s:.0f} us at most.")
    if fit.asked_v < TOP_V:
        notes.append(f"this board allows {fit.asked_v:.0f} V; what is stated for the highest volts holds for these.")
    if not any(point.phase.frequency_hz == 20.0 and point.phase.volts == fit.asked_v for point in fit.powers):
        notes.append("the supply cannot swing this brake at 20 Hz and the highest volts; there is no power to compare.")
    if fit.overlap is None:
        notes.append("no stage: capacitance against travel was not measured.")
    return tuple(notes)

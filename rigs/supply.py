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
from haptics.physics.brake_drive import clamp_time_s
from haptics.time import seconds_to_ns
from rigs.bench import Bench, BenchOptions
from rigs.instruments import Probe, Stage
from rigs.result import Fault, Measured, Measurement, RigResult
from rigs.supply_faults import SupplyRun, board_faults, probe_faults
from rigs.supply_fit import Phase, SupplyFit
from rigs.supply_plots import supply_plots

NAME = "supply"
BOARD = "brake"
INSTRUMENTS = (Probe, Stage)
PUBLISHED = {
    "supply_current_a": "supply_current",
    "t90_s": "predicted_charge_time",
    "charge_s": "charge_time",
    "eq44_20hz_w": "predicted_power",
    "power_20hz_w": "brake_power_bound",
}
"""Quantity here, number of the reference it answers."""
REST_S = 0.2
TOP_V = 1500.0
CHARGES = 8
HELD_S = 60e-3
_CHARGE_HZ = 1.0  # its first quarter period outlasts a charge
WAVES = (
    *((1500.0, hertz) for hertz in (5.0, 10.0, 20.0, 50.0)),
    *((1000.0, hertz) for hertz in (5.0, 10.0, 20.0, 50.0)),
    *((volts, 20.0) for volts in (250.0, 500.0)),
)
STOPS_M = tuple(2e-3 * k for k in range(6))
_STAGE_M_S = 20e-3
_TRAVEL_V, _TRAVEL_HZ, _TRAVEL_S = 500.0, 50.0, 0.16
_EMPTY_S = 30e-3
_LET_GO_S = 0.2  # the force stays for a while after the volts have gone
_STRAY_F = 0.3e-9  # beside what the board tells, and some to spare
_FULL_SHARE = 0.97
_LEAD_NS = 2_000_000
_GOLDEN = 0.6180339887498949

MEASUREMENTS = {
    "noise_v": Measurement("noise_v", "V", 0.0, 5.0, "noise of the probe's volts at rest"),
    "noise_a": Measurement("noise_a", "A", 0.0, 3e-6, "noise of the shunt at rest"),
    "reduced_chi2": Measurement("reduced_chi2", "1", 0.0, 2.0, "volts are a line over charge: a capacitor"),
    "volts_reached": Measurement("volts_reached", "1", 0.95, 1.05, "volts reached over volts asked for; the guard trips at 1.05"),
    "discharged_s": Measurement("discharged_s", "s", 0.0, 5e-3, "from full volts to below 60 V; the board's own limit is 5 ms"),
    "supply_limit_a": Measurement("supply_limit_a", "A", 0.0, 550e-6, "current while the supply limits; the guard's threshold"),
}


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one output, ``options.channel``. The stage is left out on hardware that has none.

    :raises HapticsError: board or probe cannot be used; the board is off then.
    """
    simulated = options.board_url(BOARD).startswith("sim://")
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
            if faults:
                return RigResult(NAME, faults=faults)
        bench.disarm()
        record = _record(bench, (rest_ns, rested_ns), phases)
    return evaluate(record)


def evaluate(record: SupplyRun) -> RigResult:
    """Faults, or the fit, from what was recorded.

    :raises InputError: too little was recorded to tell a quantity.
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
    if fit.noise_v > MEASUREMENTS["noise_v"].high or fit.noise_a > MEASUREMENTS["noise_a"].high:
        seen_noise = f"{fit.noise_v:.2g} V and {1e6 * fit.noise_a:.2g} uA"
        return RigResult(
            NAME, faults=(Fault("probe_noisy", f"at rest it scatters by {seen_noise}; check its ground"),), measured=measured
        )
    if not measured[2].within:
        seen_chi2 = f"reduced chi squared {measured[2].value:.1f}"
        return RigResult(
            NAME,
            faults=(Fault("probe_loose", f"volts are no line over charge ({seen_chi2}); press tip and leads on"),),
            measured=measured,
        )
    told_f = record.said(record.phases[0])[-1].capacitance[record.channel] * 1e-12
    return RigResult(
        NAME,
        quantities=fit.quantities(),
        reduced_chi2=fit.capacitance_f[2],
        measured=measured,
        plots=supply_plots(fit, record, NAME),
        notes=_notes(fit, told_f),
        details={
            "waves": [_row(point) for point in fit.powers],
            "board_capacitance_f": told_f,
            "discharge_resolved": fit.discharge.resolved,
        },
    )


def _charges(bench: Bench, phases: list[Phase]) -> None:
    channel, volts = bench.options.channel, _top_v(bench)
    for k in range(CHARGES):
        bench.options.progress(f"supply: charge {k + 1} of {CHARGES}")
        _drive(bench, phases, "charge", volts, _CHARGE_HZ, HELD_S)
        # Each charge meets the probe's samples at another phase.
        bench.wait(_EMPTY_S + 1e-4 * ((k * _GOLDEN) % 1.0))
        if k == 0 and (bench.faults() or bench.samples("probe").column(0).size == 0):
            return
    del channel


def _waves(bench: Bench, phases: list[Phase]) -> None:
    for volts, frequency_hz in WAVES:
        top_v = min(volts, _top_v(bench))
        if not _can_make(bench, top_v, frequency_hz):
            continue
        bench.options.progress(f"supply: {top_v:.0f} V at {frequency_hz:g} Hz")
        _drive(bench, phases, "power", top_v, frequency_hz, max(0.35, 3.3 / frequency_hz))
        bench.wait(_EMPTY_S)
        if bench.faults():
            return


def _travel(bench: Bench, phases: list[Phase]) -> None:
    at_m = 0.0
    for stop_m in STOPS_M:
        bench.options.progress(f"supply: capacitance {1e3 * stop_m:g} mm apart")
        bench.wait(_LET_GO_S)
        if stop_m > at_m:
            bench.move(stop_m - at_m, _STAGE_M_S)
            bench.settle()
            at_m = stop_m
        if bench.faults():
            return
        _drive(bench, phases, "travel", min(_TRAVEL_V, _top_v(bench)), _TRAVEL_HZ, _TRAVEL_S, stop_m)
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
    phases.append(Phase(kind, round(volts), frequency_hz, start_ns - _LEAD_NS, end_ns, travel_m))


def _top_v(bench: Bench) -> float:
    return min(TOP_V, float(bench.link.identity.limits[0]))


def _can_make(bench: Bench, volts: float, frequency_hz: float) -> bool:
    """The supply swings the output fully, and the board allows it."""
    limits = bench.link.identity.limits
    total_f = _told_f(bench) + _STRAY_F
    charging_s = total_f * volts / (limits[1] * 1e-6)
    return charging_s < _FULL_SHARE * (0.5 / frequency_hz - clamp_time_s(frequency_hz))


def _told_f(bench: Bench) -> float:
    return 1e-12 * bench.telemetry[-1][1].capacitance[bench.options.channel]


def _no_brake(bench: Bench) -> Fault | None:
    if _told_f(bench) > 0.0:
        return None
    return Fault(
        "no_brake",
        f"the board's self test found no brake on output {bench.options.channel}; connect one, or choose another output",
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


def _notes(fit: SupplyFit, told_f: float) -> tuple[str, ...]:
    c_f = fit.capacitance_f[0]
    charge_s = c_f * fit.settled_v[0] / fit.limit_a[0]
    notes = [
        f"capacitance_f is all of the output, wiring and bridge included; the board, which takes 0.2 nF off for them, "
        f"says {1e9 * told_f:.3f} nF.",
        f"C V / I is {1e3 * charge_s:.2f} ms; 4.7.1 prints 50 ms for it, which its own numbers do not give (7.6 ms).",
        "power is the mean of v i at the supply's output, which sags to the load while it charges; steady_power is what a supply "
        "at its set volts would give for the same charge, and Eq 4.4 counts one charge a period where the bridge makes two.",
    ]
    if not fit.discharge.resolved:
        notes.append(f"the discharge is faster than the probe: below 60 V within {1e6 * fit.discharged_within_s:.0f} us at most.")
    if fit.asked_v < TOP_V:
        notes.append(f"this board allows {fit.asked_v:.0f} V; what is said of the highest volts is said of these.")
    if not any(point.phase.frequency_hz == 20.0 and point.phase.volts == fit.asked_v for point in fit.powers):
        notes.append("the supply cannot swing this brake at 20 Hz and the highest volts; there is no power to compare.")
    if fit.overlap is None:
        notes.append("no stage: capacitance against travel was not measured.")
    return tuple(notes)

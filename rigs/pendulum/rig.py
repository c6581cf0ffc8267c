"""Pendulum rig: what the wrist feels when a pin comes back, on bare plate, silicone and foam (thesis 3.5.1, Fig 3.3).

Purpose: ``tau`` and peak of the recoil, and how long the pin takes to come back, of one actuator.

Wiring: the actuator on a pendulum of 1 m and 40 g, an accelerometer beside it with an axis along the pin, 3200 samples a
second; nothing else on the board moves. What lies under the off plate is ``surface``; a simulated board whose URL does not
name it is measured on all three, one after another.

Steps: 20 on-off cycles, a switch every 0.4 s, so that pendulum and coil come to rest in between. Pulses are timed such that the
board's telemetry meets half of them while the pin should fly and half after it: a pin that moves takes a share of the current.

Safe-off: the board is disarmed, and pins withdrawn, on every exit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from haptics.errors import InputError
from haptics.link.port_url import is_simulated, query_of
from haptics.physics.latch.recoil import SURFACES
from haptics.time import seconds_to_ns
from haptics.units import one_of
from rigs.bench import Bench, BenchOptions
from rigs.coil_current import PulseRecord, currents, meeting_telemetry, tells_motion
from rigs.instruments import Accelerometer
from rigs.landings import LOOSE_G, MEASUREMENTS as SET_UP, Trace, fault_of_silence, faults_of_set_up, set_up, traces
from rigs.pendulum.fit import FLIGHT_S, SurfaceFit, fit_surface
from rigs.pendulum.plots import recoil_plots
from rigs.result import Answer, Fault, Measured, Measurement, Quantity, RigResult

NAME = "pendulum"
BOARD = "tactiles"
INSTRUMENTS = (Accelerometer,)
PUBLISHED = {
    "tau_bare_s": Answer("recoil_tau_bare"),
    "tau_silicone_s": Answer("recoil_tau_silicone"),
    "tau_foam_s": Answer("recoil_tau_foam"),
    "peak_g_bare": Answer("recoil_peak"),
    "travel_s": Answer("contact_travel"),
}
"""Quantity here, number of the reference it answers."""
CYCLES = 20
SPACING_S = 0.4
PULSE_S = 10e-3
_GOLDEN = 0.6180339887498949
_MOVING_S, _RESTING_S = (3.45e-3, 4.35e-3), (7.2e-3, 9.5e-3)
"""Phases of a pulse at which telemetry is to meet it: the pin flies; the pin has landed."""

MEASUREMENTS = {
    **SET_UP,
    "landings": Measurement("landings", "1", 0.9, 1.0, "landings felt for each return of the pin"),
    "max_g": Measurement("max_g", "g", LOOSE_G, 16.0, "maximum acceleration; less: the accelerometer is loose"),
    "reduced_chi2": Measurement("reduced_chi2", "1", 0.0, 3.0, "a decaying ring of one frequency describes a landing"),
}


@dataclass(frozen=True)
class Swing:
    """Landings on one surface.

    :param surface: ``bare``, ``silicone`` or ``foam``.
    :param measured: of the set-up.
    :param faults: at the bench; there is no fit then.
    :param fit: None where there is a fault.
    """

    surface: str
    measured: tuple[Measured, ...]
    faults: tuple[Fault, ...] = ()
    fit: SurfaceFit | None = None


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one actuator, ``options.channel``, on ``options.surface`` or, simulated, on all three.

    :param options: where it runs; ``channel`` is the actuator's.
    :return: quantities of all surfaces, or faults.
    :raises InputError: hardware without a surface; or another than the simulated board's URL names.
    :raises HapticsError: board or accelerometer cannot be used; the board is off then.
    """
    chosen = surfaces(options)
    swings: list[Swing] = []
    for surface in chosen:
        swings.append(_swing(options if len(chosen) == 1 else options.part(surface), surface))
        if swings[-1].faults:
            break
    return evaluate(swings)


def surfaces(options: BenchOptions) -> tuple[str, ...]:
    """The surfaces that a run with these options measures.

    :param options: ``surface`` and the board's URL count.
    :return: one surface, or all three.
    :raises InputError: see ``run``.
    """
    url, wanted = options.board_url(BOARD), options.surface
    if wanted is not None:
        one_of("surface", wanted, SURFACES)
    named = query_of(url).get("surface") if is_simulated(url) else wanted
    if not is_simulated(url) and wanted is None:
        raise InputError(
            f"port = {url!r} is hardware: state what lies under its pin with --surface; allowed: {', '.join(SURFACES)}"
        )
    if None not in (named, wanted) and named != wanted:
        raise InputError(f"surface = {wanted!r}, and port = {url!r} names another; give one of the two")
    one = named or wanted
    return SURFACES if one is None else (one,)


def evaluate(swings: list[Swing]) -> RigResult:
    """The result of all surfaces; without quantities if one of them shows a fault.

    :param swings: one for each surface.
    :return: quantities, or faults.
    """
    measured = tuple(one for swing in swings for one in _named(swing, several=len(swings) > 1))
    faults = tuple(fault for swing in swings for fault in swing.faults)
    fits = [swing.fit for swing in swings if swing.fit is not None]
    plots = recoil_plots(fits, NAME) if fits else ()
    if faults:
        return RigResult(NAME, faults=faults, measured=measured, plots=plots[:1])
    quantities: dict[str, Quantity] = {}
    for fit in fits:
        quantities |= fit.quantities()
    travels = [fit.travel_s for fit in fits]
    # Delay of sampling and link is common to all of them: averaging does not lessen it.
    travel = Quantity(float(np.mean([one.value for one in travels])), max(one.sd for one in travels), "s")
    return RigResult(
        NAME,
        quantities={**quantities, "travel_s": travel},
        reduced_chi2=float(np.mean([fit.reduced_chi2 for fit in fits])),
        measured=measured,
        plots=plots,
        notes=(
            "tau is the mean of fits to each landing; by the thesis' method it is of the aligned and averaged magnitude. peak is "
            "the envelope at the landing, ahead of the accelerometer's low-pass; max_g is the mean of the maximum samples, "
            "which is what Fig 3.3 shows at 0.",
            "travel is from the command's start to the landing, pins coming back (on to off).",
        ),
        details={"surfaces": [fit.surface for fit in fits], "landings": {fit.surface: len(fit.rings) for fit in fits}},
    )


def _named(swing: Swing, several: bool) -> tuple[Measured, ...]:
    """Measurements of a surface, named after it where there are several."""
    if not several:
        return swing.measured
    return tuple(
        replace(one, measurement=replace(one.measurement, name=f"{one.measurement.name}_{swing.surface}"))
        for one in swing.measured
    )


def _swing(options: BenchOptions, surface: str) -> Swing:
    with Bench(
        BOARD,
        INSTRUMENTS,
        options,
        rig=NAME,
        simulate={"surface": surface},
        plot=("accelerometer", "acceleration_g"),
    ) as bench:
        options.progress(f"pendulum, {surface}: at rest")
        bench.wait(0.5)
        bench.arm()
        backs_ns = _switch(bench, surface)
        bench.disarm()
        faults = bench.faults()
        if faults:
            return Swing(surface, (), faults)
        accelerometer = bench.instruments["accelerometer"]
        assert isinstance(accelerometer, Accelerometer)
        found = traces(bench.samples("accelerometer"), backs_ns, SPACING_S - 20e-3)
        pulses = PulseRecord.of(bench.pulsed_ns[: 2 * CYCLES], PULSE_S, currents(bench))
        measured = set_up(accelerometer, found[0].noise_g, pulses)
        dip = pulses.landing_dip if tells_motion(options) else None
        return _look(surface, found, dip, measured, accelerometer.bandwidth_hz)


def _switch(bench: Bench, surface: str) -> list[int]:
    """Out and back ``CYCLES`` times; returns the commanded start of each return."""
    backs_ns: list[int] = []
    first_ns = bench.now_ns + seconds_to_ns(0.2)
    for k in range(2 * CYCLES):
        if k % 10 == 0:
            bench.options.progress(f"pendulum, {surface}: switch {k} of {2 * CYCLES}")
        near_ns = first_ns + seconds_to_ns(k * SPACING_S)
        bench.wait_until(near_ns - seconds_to_ns(0.1))
        low_s, high_s = _MOVING_S if (k // 2) % 2 == 0 else _RESTING_S
        at_ns = meeting_telemetry(bench, near_ns, low_s + (high_s - low_s) * ((k * _GOLDEN) % 1.0))
        bench.pulse([bench.options.channel], at_ns, PULSE_S, toward_skin=k % 2 == 0)
        bench.wait_until(at_ns + seconds_to_ns(2.0 * PULSE_S))
        if k % 2:
            backs_ns.append(at_ns)
    bench.wait(SPACING_S)
    return backs_ns


def _look(surface: str, found: list[Trace], dip: float | None, measured: Mapping[str, Measured], bandwidth_hz: float) -> Swing:
    """Faults, or the fit."""
    values = dict(measured)
    faults = faults_of_set_up(values)
    if faults:
        return Swing(surface, tuple(values.values()), tuple(faults))
    onsets = [trace.onset(*FLIGHT_S) for trace in found]
    max_g = float(np.median([_max_g(trace) for trace in found]))
    felt = sum(onset is not None for onset in onsets)
    for name, value in (("landings", felt / len(found)), ("max_g", max_g)):
        values[name] = Measured(MEASUREMENTS[name], value)
    if not values["max_g"].within:
        return Swing(surface, tuple(values.values()), (fault_of_silence(max_g, dip),))
    if not values["landings"].within:
        missed = Fault(
            "actuator_misses",
            f"{len(found) - felt} of {len(found)} returns of the pin are not felt; is the pin free, and the supply at 5 V?",
        )
        return Swing(surface, tuple(values.values()), (missed,))
    fit = fit_surface(surface, found, bandwidth_hz)
    values["reduced_chi2"] = Measured(MEASUREMENTS["reduced_chi2"], fit.reduced_chi2)
    return Swing(surface, tuple(values.values()), fit=fit)


def _max_g(trace: Trace) -> float:
    flight = (trace.after_s > FLIGHT_S[0]) & (trace.after_s < FLIGHT_S[1])
    return float(np.abs(trace.g[flight]).max()) if flight.any() else 0.0

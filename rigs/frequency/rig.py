"""Frequency rig: pulse trains from 1 to 200 Hz, what was delivered against what was asked (thesis 3.4.5, 3.5.2).

Purpose: the highest rate at which every pulse is played and every cycle's landing is felt; rate, jitter and energy of it; how
often bursts of 50 ms at that rate may come.

Wiring: the actuator on the pendulum with the accelerometer, as for the pendulum rig; nothing else on the board moves.

Steps: contact mode (10 ms out, 10 ms back, 15 cycles), pulse mode (3 ms out, 3 ms back), then for each rate bursts of 50 ms, or
of 5 cycles where that is longer, of 2 ms toward the skin and 3 ms back, with 0.4 s of rest after each. At 200 Hz the two leave no
time between pulses, and a board refuses pulses that meet, so the pulse back is 0.1 ms shorter. At the end one burst of 200 Hz
through the host's scheduler, for comparison.

Safe-off: the board is disarmed, and pins withdrawn, on every exit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from haptics.physics.latch.pulse import PULSE_BACK_S, PULSE_TOWARD_S, TRAIN_BACK_S, TRAIN_TOWARD_S
from haptics.time import seconds_to_ns
from rigs.bench import Bench, BenchOptions
from rigs.coil_current import PulseRecord, currents, tells_motion
from rigs.fitting import quadrature
from rigs.frequency.plots import rate_plots
from rigs.frequency.trains import GAP_S, Delivered, Train, felt, jitter, play, whole_up_to
from rigs.frequency.use import burst_use, felt_scheduled, scheduled
from rigs.instruments import Accelerometer
from rigs.instruments.accelerometer import DELAY_SD_S
from rigs.landings import LINK_SD_S, LOOSE_G, MEASUREMENTS as SET_UP, SAMPLE_S, fault_of_silence, faults_of_set_up, set_up, traces
from rigs.result import Answer, Fault, Measured, Measurement, Quantity, RigResult

NAME = "frequency"
BOARD = "tactiles"
INSTRUMENTS = (Accelerometer,)
PUBLISHED = {"highest_rate_hz": Answer("train_rate"), "burst_length_s": Answer("burst_length")}
"""Quantity here, number of the reference it answers."""
RATES_HZ = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 150.0, 200.0)
BURST_S = 50e-3
_FEWEST_CYCLES = 5
CONTACT = Train("contact", 1.0, 10e-3, 10e-3, 0.5, 3, 5)
_CONTACT_PHASES_S = (8.3e-3, 3.9e-3, 8.5e-3, 4.0e-3, 8.7e-3)
"""Telemetry meets pulses after the pin has landed, and while it flies, in turn: the coil warms meanwhile."""
_PULSE = Train("pulse", 5.0, PULSE_TOWARD_S, PULSE_BACK_S, PULSE_TOWARD_S + GAP_S, 5, 1)
_PHASES_S = (0.40e-3, 1.28e-3, 2.66e-3, 4.04e-3)
"""Within pulses of both directions, and at four parts of the accelerometer's period."""
_LANDS_S = 0.5e-3
"""After the return begins, before which no landing is looked for."""

MEASUREMENTS = {
    **SET_UP,
    "max_g": Measurement("max_g", "g", LOOSE_G, 16.0, "maximum acceleration; less: the accelerometer is loose"),
    "contact_landings": Measurement("contact_landings", "1", 0.9, 1.0, "landings felt for each return in contact mode"),
    "highest_rate_hz": Measurement("highest_rate_hz", "Hz", 200.0, 200.0, "highest rate that came whole (3.5.2)"),
    "ring_left": Measurement("ring_left", "1", 0.0, 0.3, "what still rings at the next landing; more: landings hide, use foam"),
    "rate_error": Measurement("rate_error", "1", -0.01, 0.01, "rate of that train over what was asked, less 1"),
    "burst_energy_j": Measurement(
        "burst_energy_j", "J", 0.1, 1.0, "of 50 ms at that rate; 18 W make 0.9 J, a coil of 1.28 ohm 0.98 (3.4.3)"
    ),
}


@dataclass(frozen=True)
class FrequencyRun:
    """What was recorded: trains as they were felt, the set-up, and what the host's scheduler made of a burst.

    :param measured: of the set-up, by name.
    :param dip: share of the current that motion takes; None where the current does not show motion.
    :param max_g: median over the contacts of the maximum acceleration, g.
    :param scheduler: of a burst through the host's scheduler: cycles, landings, rate (Hz), whether it was played.
    """

    contact: Delivered
    """Returns of contact mode."""
    out: Delivered
    """Its strokes out, which land on the skin side."""
    others: tuple[Delivered, ...]
    """Pulse mode, then the trains, slowest first."""
    measured: Mapping[str, Measured]
    dip: float | None
    max_g: float
    seen: tuple[tuple[int, float, float], ...]
    """Time (ns), current (A), volts of telemetry that saw the coil on."""
    scheduler: Mapping[str, Any]


def train_at(rate_hz: float) -> Train:
    """The bursts of one rate.

    :param rate_hz: 1 to 200 Hz.
    :return: bursts of at least 50 ms or 5 cycles.
    """
    back_s = min(TRAIN_BACK_S, 1.0 / rate_hz - TRAIN_TOWARD_S - 2.0 * GAP_S)
    cycles = max(_FEWEST_CYCLES, round(BURST_S * rate_hz))
    return Train(f"{rate_hz:g} Hz", rate_hz, TRAIN_TOWARD_S, back_s, TRAIN_TOWARD_S + GAP_S, cycles, 4 if rate_hz >= 10.0 else 2)


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one actuator, ``options.channel``.

    :param options: where it runs; ``channel`` is the actuator's.
    :return: quantities, or faults.
    :raises HapticsError: board or accelerometer cannot be used; the board is off then.
    """
    with Bench(BOARD, INSTRUMENTS, options, rig=NAME, plot=("accelerometer", "acceleration_g")) as bench:
        options.progress("frequency: at rest")
        bench.wait(0.5)
        bench.arm()
        options.progress("frequency: contact mode and pulse mode")
        contact = play(bench, CONTACT, _CONTACT_PHASES_S)
        pulsed_ns = list(bench.pulsed_ns)
        others = [play(bench, _PULSE, _PHASES_S)]
        for rate_hz in RATES_HZ:
            options.progress(f"frequency: {rate_hz:g} Hz")
            others.append(play(bench, train_at(rate_hz), _PHASES_S))
        options.progress("frequency: the host's scheduler")
        burst = scheduled(bench)
        bench.disarm()
        if bench.glove.faults or all(one.refused == one.asked for one in (contact, *others)):
            return RigResult(NAME, faults=bench.faults())
        samples, accelerometer = bench.samples("accelerometer"), bench.instruments["accelerometer"]
        assert isinstance(accelerometer, Accelerometer)
        seen = currents(bench)
        pulses = PulseRecord.of(pulsed_ns, CONTACT.toward_s, seen)
        contact_traces = traces(samples, [at_ns + seconds_to_ns(CONTACT.back_at_s) for at_ns in contact.starts_ns], 25e-3)
        record = FrequencyRun(
            felt(samples, contact, CONTACT.back_at_s + _LANDS_S, lands=0.0),
            felt(samples, replace(contact, train=replace(CONTACT, back_at_s=0.0)), _LANDS_S, lands=0.0),
            tuple(felt(samples, one, one.train.back_at_s + _LANDS_S) for one in others),
            set_up(accelerometer, contact_traces[0].noise_g, pulses),
            pulses.landing_dip if tells_motion(options) else None,
            float(np.median([np.abs(trace.g).max() for trace in contact_traces])),
            tuple(seen),
            felt_scheduled(samples, burst),
        )
    return evaluate(record)


def evaluate(record: FrequencyRun) -> RigResult:
    """Faults, or what was delivered, from what was recorded.

    :param record: of a whole run.
    :return: quantities, or faults.
    """
    values = dict(record.measured)
    faults = faults_of_set_up(values)
    values["max_g"] = Measured(MEASUREMENTS["max_g"], record.max_g)
    contact_share = record.contact.landings / len(record.contact.late_s)
    values["contact_landings"] = Measured(MEASUREMENTS["contact_landings"], contact_share)
    if not faults and record.max_g < LOOSE_G:
        faults = [fault_of_silence(record.max_g, record.dip)]
    if not faults and not values["contact_landings"].within:
        faults = [_misses(f"{100 * (1.0 - contact_share):.0f} % of the returns of 10 ms")]
    trains = record.others[1:]
    best = whole_up_to(trains)
    if not faults and best is None:
        slowest = trains[0]
        faults = [
            _misses(f"{len(slowest.late_s) - slowest.landings} of {len(slowest.late_s)} cycles at {slowest.played.train.name}")
        ]
    if faults or best is None:
        return RigResult(NAME, faults=tuple(faults), measured=tuple(values.values()))
    quantities = _quantities(record, best)
    left = max(float(np.nanmedian(one.ring_left)) for one in trains if one.landings)
    values["ring_left"] = Measured(MEASUREMENTS["ring_left"], left)
    for name in ("highest_rate_hz", "rate_error", "burst_energy_j"):
        if name in quantities:
            values[name] = Measured(MEASUREMENTS[name], quantities[name].value)
    return RigResult(
        NAME,
        quantities=quantities,
        measured=tuple(values.values()),
        plots=rate_plots(trains, NAME),
        notes=(
            f"At {best.played.train.rate_hz:g} Hz a cycle is {1e3 * best.played.train.toward_s:g} ms toward the skin and "
            f"{1e3 * best.played.train.back_s:g} ms back: a board refuses pulses that meet.",
            "The rise of one burst each 5 s takes the published c; the thermal rig measures an actuator's own.",
        ),
        details={
            "rows": [one.row() for one in (record.contact, *record.others)],
            "scheduler": dict(record.scheduler),
        },
    )


def _quantities(record: FrequencyRun, best: Delivered) -> dict[str, Quantity]:
    """What the rig is for."""
    train, rate, spacing = best.played.train, best.rate_hz, best.spacing_s
    assert rate is not None  # a train that came whole has landings enough
    assert spacing is not None
    found = {
        "highest_rate_hz": Quantity(train.rate_hz, 0.0, "Hz"),
        "rate_hz": rate,
        "rate_error": Quantity(rate.value / train.rate_hz - 1.0, rate.sd / train.rate_hz, "1"),
        "jitter_s": jitter(best, record.others[1:]),
        "burst_length_s": Quantity(train.cycles * spacing.value, train.cycles * spacing.sd, "s"),
        "travel_back_s": _travel(record.contact),
    }
    if record.out.landings >= _FEWEST_CYCLES:
        found["travel_out_s"] = _travel(record.out)
    return found | burst_use(best.played, list(record.seen))


def _travel(one: Delivered) -> Quantity:
    """From command to landing."""
    late_s = one.late_s[np.isfinite(one.late_s)]
    step_s = SAMPLE_S / math.sqrt(12.0)
    sd_s = max(float(late_s.std(ddof=1)), step_s) / math.sqrt(len(late_s))
    return Quantity(one.travel_s, quadrature((sd_s, DELAY_SD_S, LINK_SD_S)), "s")


def _misses(what: str) -> Fault:
    return Fault("actuator_misses", f"{what} are not felt; is the pin free, and the supply at 5 V?")

"""Frequency rig: pulse trains from 1 to 200 Hz, what was delivered against what was asked (thesis 3.4.5, 3.5.2).

Purpose: the highest rate at which every pulse is played and every cycle's landing is felt; rate, jitter and energy of it; how
often bursts of 50 ms at that rate may come.

Wiring: the actuator on the pendulum with the accelerometer, as for the pendulum rig; nothing else on the board moves.

Steps: contact mode (10 ms out, 10 ms back, 10 cycles), pulse mode (3 ms out, 3 ms back), then for each rate bursts of 50 ms, or
of 5 cycles where that is longer, of 2 ms toward the skin and 3 ms back, with 0.4 s of rest after each. At 200 Hz the two leave no
time between pulses, and a board refuses pulses that meet, so the way back is 0.1 ms shorter. At the end one burst of 200 Hz
through the host's scheduler, for comparison.

Safe-off: the board is disarmed, and pins withdrawn, on every exit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from haptics.physics.latch import PULSE_BACK_S, PULSE_TOWARD_S, TRAIN_BACK_S, TRAIN_TOWARD_S
from haptics.time import seconds_to_ns
from rigs.bench import Bench, BenchOptions
from rigs.frequency_plots import rate_plots
from rigs.frequency_trains import GAP_S, LEAD_S, Delivered, Played, Train, felt, play, whole_up_to
from rigs.frequency_use import burst_use, scheduled
from rigs.instruments import Accelerometer
from rigs.instruments.accelerometer import DELAY_SD_S
from rigs.landings import (
    LOOSE_G,
    MEASUREMENTS as SET_UP,
    currents,
    fault_of_silence,
    faults_of_set_up,
    set_up,
    tells_motion,
    traces,
)
from rigs.result import Fault, Measured, Measurement, Quantity, RigResult
from rigs.thermal_fit import PulseRecord

NAME = "frequency"
BOARD = "tactiles"
INSTRUMENTS = (Accelerometer,)
PUBLISHED = {"highest_rate_hz": "train_rate", "burst_length_s": "burst_length", "least_burst_interval_s": "burst_interval"}
"""Quantity here, number of the reference it answers."""
RATES_HZ = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 150.0, 200.0)
BURST_S = 50e-3
_FEWEST_CYCLES = 5
_CONTACT = Train("contact", 1.0, 10e-3, 10e-3, 0.5, 10, 1)
_PULSE = Train("pulse", 5.0, PULSE_TOWARD_S, PULSE_BACK_S, PULSE_TOWARD_S + GAP_S, 5, 1)
_LANDS_S = 0.5e-3
"""After the return begins, before which no landing is looked for."""

MEASUREMENTS = {
    **SET_UP,
    "greatest_g": Measurement("greatest_g", "g", LOOSE_G, 16.0, "greatest acceleration; less: the accelerometer is loose"),
    "contact_landings": Measurement("contact_landings", "1", 0.9, 1.0, "landings felt for each return in contact mode"),
    "highest_rate_hz": Measurement("highest_rate_hz", "Hz", 200.0, 200.0, "highest rate that came whole (3.5.2)"),
    "rate_error": Measurement("rate_error", "1", -0.01, 0.01, "rate of that train over what was asked, less 1"),
    "burst_energy_j": Measurement("burst_energy_j", "J", 0.1, 0.9, "of 50 ms at that rate; 18 W all the time make 0.9 J (3.4.3)"),
}


@dataclass(frozen=True)
class FrequencyRun:
    """What was recorded: trains as they were felt, contact mode's set-up, and what the host's scheduler made of a burst."""

    contact: Delivered
    pulse: Delivered
    trains: tuple[Delivered, ...]
    measured: Mapping[str, Measured]
    dip: float | None
    greatest_g: float
    current_a: Mapping[str, tuple[float, ...]]
    supply_v: float
    scheduler: Mapping[str, Any]


def train_at(rate_hz: float) -> Train:
    """The bursts of one rate."""
    back_s = min(TRAIN_BACK_S, 1.0 / rate_hz - TRAIN_TOWARD_S - 2.0 * GAP_S)
    cycles = max(_FEWEST_CYCLES, round(BURST_S * rate_hz))
    return Train(f"{rate_hz:g} Hz", rate_hz, TRAIN_TOWARD_S, back_s, TRAIN_TOWARD_S + GAP_S, cycles, 4 if rate_hz >= 10.0 else 2)


def run(options: BenchOptions) -> RigResult:
    """Run the rig on one actuator, ``options.channel``.

    :raises HapticsError: board or accelerometer cannot be used; the board is off then.
    """
    with Bench(BOARD, INSTRUMENTS, options, rig=NAME, plot=("accelerometer", "acceleration_g")) as bench:
        options.progress("frequency: at rest")
        bench.wait(0.5)
        bench.arm()
        played: list[Played] = []
        options.progress("frequency: contact mode")
        played.append(play(bench, _CONTACT, (3.45e-3, 4.35e-3)))
        contact_pulses = len(bench.pulsed_ns)
        played.append(play(bench, _CONTACT, (7.2e-3, 9.5e-3)))
        contact_pulses = len(bench.pulsed_ns)
        options.progress("frequency: pulse mode")
        played.append(play(bench, _PULSE, (0.0, 1e-3)))
        for rate_hz in RATES_HZ:
            options.progress(f"frequency: {rate_hz:g} Hz")
            played.append(play(bench, train_at(rate_hz), (0.2e-3, 1.8e-3)))
        every_one_refused = all(one.refused == one.asked for one in played)
        if bench.glove.faults or every_one_refused:
            return RigResult(NAME, faults=bench.faults())
        options.progress("frequency: the host's scheduler")
        scheduler = scheduled(bench)
        bench.disarm()
        samples, accelerometer = bench.samples("accelerometer"), bench.instruments["accelerometer"]
    return RigResult(NAME)

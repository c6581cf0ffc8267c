"""What an accelerometer shows of landing pins: when, from quiet to loud; and what the pulses' currents show beside it.

A landing lies between the last sample that is quiet and the first that is loud. The sample's period, 0.31 ms, is the
resolution of one landing; many landings of commands that meet the sampling at different phases give their mean far better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from haptics.physics.latch.recoil import SAMPLE_RATE_HZ
from rigs.coil_current import MAX_DIP, MIN_DIP, PulseRecord
from rigs.fitting import Vector
from rigs.instruments import Accelerometer, InstrumentSilent, Samples
from rigs.result import Fault, Measured, Measurement

REST_S = 60e-3
"""Samples this long before a command show offset and noise."""
LOUD_SDS = 8.0
LOOSE_G = 0.5
"""Maximum acceleration that counts as no landing at all: a twentieth of the published recoil."""
RATE_SD = 1e-4
"""Of the host's clock, which sampling and trains are measured by, as a share (assumed: any crystal)."""
LINK_SD_S = 0.1e-3
"""Of a command's time on the board's clock (assumed: the link cannot separate the delay there from the delay back)."""
SAMPLE_S = 1.0 / SAMPLE_RATE_HZ

MEASUREMENTS = {
    "noise_g": Measurement("noise_g", "g", 1e-3, 0.05, "noise at rest; less: it is off; more: it is loose, or the bench shakes"),
    "sample_rate_hz": Measurement("sample_rate_hz", "Hz", 2800.0, 4000.0, "rate of sampling; slower, the ring is not resolved"),
    "lost_share": Measurement("lost_share", "1", 0.0, 0.01, "share of the samples that did not come"),
    "clipped": Measurement("clipped", "1", 0.0, 0.0, "samples at the end of the accelerometer's range"),
    "supply_v": Measurement("supply_v", "V", 4.5, 5.5, "supply while a coil is on; the drive is stated at 5 V (3.4.3)"),
    "current_a": Measurement("current_a", "A", 2.0, 5.0, "mean current of a pulse; a coil draws 3.6 A (3.4.3)"),
    "landing_dip": Measurement(
        "landing_dip", "1", MIN_DIP, MAX_DIP, "share of the current that motion takes before the pin lands"
    ),
}


@dataclass(frozen=True)
class Trace:
    """Acceleration after one command.

    :param after_s: time of each sample since the command (n,), s.
    :param g: acceleration less its mean at rest (n,), g.
    :param period_s: of sampling, s.
    """

    after_s: Vector
    g: Vector
    period_s: float
    noise_g: float
    """Standard deviation of one sample at rest, of all traces together."""

    def onset(self, earliest_s: float, latest_s: float) -> int | None:
        """Number of the first loud sample within a time after the command, or None.

        :param earliest_s: start of the window, s after the command.
        :param latest_s: end of the window, s after the command.
        :return: index into ``g``; None if no sample is loud.
        """
        loud = (self.after_s > earliest_s) & (self.after_s < latest_s) & (np.abs(self.g) > LOUD_SDS * self.noise_g)
        return int(np.argmax(loud)) if loud.any() else None


def traces(samples: Samples, commands_ns: Sequence[int], length_s: float) -> list[Trace]:
    """One trace for each command, from ``REST_S`` before it to ``length_s`` after it.

    A command without samples around it makes an empty trace.

    :param samples: of the accelerometer, g.
    :param commands_ns: time of each command (n,), ns.
    :param length_s: of a trace after its command, s.
    :return: n traces with one noise in common.
    """
    column, period_s = samples.column(), float(np.median(np.diff(samples.time_s)))
    cut: list[tuple[Vector, Vector]] = []
    rests: list[Vector] = []
    for at_ns in commands_ns:
        after_s = samples.since(at_ns)
        low, high = np.searchsorted(after_s, (-REST_S, length_s))
        after_s, g = after_s[low:high], column[low:high]
        rest = g[after_s < 0.0]
        rests.append(rest - rest.mean() if len(rest) else rest)
        cut.append((after_s, g - (rest.mean() if len(rest) else 0.0)))
    noise_g = float(np.concatenate(rests).std())
    return [Trace(after_s, g, period_s, noise_g) for after_s, g in cut]


def set_up(accelerometer: Accelerometer, noise_g: float, pulses: PulseRecord) -> dict[str, Measured]:
    """The measurements that decide whether anything else is worth evaluating: all of ``MEASUREMENTS`` but ``landing_dip``, which
    a silent accelerometer alone asks for (``PulseRecord.landing_dip``).

    :param accelerometer: after the run.
    :param noise_g: standard deviation of one sample at rest, g.
    :param pulses: of the run, with the telemetry that met them.
    :return: six, by name, in the order of ``MEASUREMENTS``.
    :raises InstrumentSilent: no sample came.
    """
    if not accelerometer.count:
        raise InstrumentSilent(accelerometer.url, f"no sample came from the accelerometer: {accelerometer.seen()}", "measure")
    counted = accelerometer.count + accelerometer.lost + len(accelerometer.faults)
    volts = float(pulses.volts.mean()) if len(pulses.volts) else 0.0
    values = {
        "noise_g": noise_g,
        "sample_rate_hz": accelerometer.rate_hz,
        "lost_share": accelerometer.lost / counted,
        "clipped": float(accelerometer.clipped()),
        "supply_v": volts,
        "current_a": pulses.mean_current_a,
    }
    return {name: Measured(MEASUREMENTS[name], value) for name, value in values.items()}


def faults_of_set_up(measured: dict[str, Measured]) -> list[Fault]:
    """What ``set_up`` shows to be wrong, the cause before what follows from it.

    :param measured: what ``set_up`` returned.
    :return: one fault for each cause; empty for a sound set-up.
    """
    value = {name: one.value for name, one in measured.items()}
    bad = {name for name, one in measured.items() if not one.within}
    faults: list[Fault] = []
    if "current_a" in bad and value["current_a"] < 2.0:
        faults.append(
            Fault(
                "coil",
                f"a pulse draws {value['current_a']:.2f} A, expected 2 to 5 A. Is the coil connected, and the supply at 5 V?",
            )
        )
    elif "supply_v" in bad:
        faults.append(Fault("supply", f"the coils get {value['supply_v']:.2f} V, expected 4.5 to 5.5 V. Check supply and cable"))
    if "sample_rate_hz" in bad:
        faults.append(
            Fault(
                "accelerometer_rate",
                f"samples come at {value['sample_rate_hz']:.0f} Hz, expected 2800 to 4000 Hz. Set it to 3200 Hz, and its line to "
                "a baud rate that carries that",
            )
        )
    if "lost_share" in bad:
        faults.append(
            Fault(
                "samples_lost",
                f"{100 * value['lost_share']:.1f} % of the accelerometer's samples did not come, 1 % may be missing. "
                "Check cable and baud rate",
            )
        )
    if "clipped" in bad:
        faults.append(
            Fault(
                "accelerometer_saturated",
                f"{value['clipped']:.0f} samples lie at the end of the accelerometer's range; set a wider one (16 g)",
            )
        )
    if "noise_g" in bad:
        faults.append(_loose(f"at rest it scatters by {value['noise_g']:.2g} g, expected 0.001 to 0.05 g"))
    return faults


def fault_of_silence(max_g: float, dip: float | None) -> Fault:
    """Pulses draw current, and no landing is felt: by the current's own dip, whether the pin moved.

    :param max_g: felt after a command.
    :param dip: see ``PulseRecord.landing_dip``; None: the current does not show it.
    :return: stuck actuator, loose accelerometer, or either where the current does not show which.
    """
    felt = f"nothing above {max_g:.2g} g is felt after a command"
    if dip is None or np.isnan(dip):
        return Fault("actuator_stuck_or_accelerometer_loose", f"{felt}. Is the pin free, and the accelerometer fixed?")
    moves = f"the current dips by {100 * dip:.2f} % before the pin should land; a pin that moves takes 0.15 to 5 %"
    if MIN_DIP <= dip <= MAX_DIP:
        return _loose(f"{felt}, though {moves}")
    return Fault("actuator_stuck", f"{felt}, and {moves}. Is it free?")


def _loose(seen: str) -> Fault:
    return Fault("accelerometer_loose", f"the accelerometer is loose: {seen}; fix it to the pendulum and run again")

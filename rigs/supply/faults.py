"""What can be wrong at the bench of the supply rig, told from the record: each with a word and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from haptics.link.messages import State
from haptics.time import NS_PER_MS
from rigs.fitting import noise_sd
from rigs.instruments import Samples
from rigs.result import Fault
from rigs.supply.fit import Phase

_SAME = (0.9, 1.1)
"""Probe over board: outside, they look at different things."""
_MIN_CHARGE = 0.5
_MIN_ON = 0.6
"""Share of a wave's time with at least a tenth of its volts: the rest is clamp and the foot of the ramp, a fifth at 50 Hz."""
NOISIEST_V, NOISIEST_A = 5.0, 3e-6
"""Noise at rest that a sound probe keeps below."""
_SILENT_NS = 100 * NS_PER_MS
_LOST = 0.01
_BOARD = {
    "short": (
        "short",
        "look for a burnt spot in the dielectric, for a wire that touches another, and whether the supply gives its current",
    ),
    "leak": ("leak", "current flows where none should: dry and clean the strips and the wiring"),
    "open": ("open", "less capacitance than a brake has: press the strips together, check both wires"),
    "self_test": ("no_brake", "no output has a brake: connect one"),
}


@dataclass(frozen=True)
class SupplyRun:
    """What was recorded.

    ``rest_ns``: from when to when nothing was on. ``step``: what a count is worth, V and A. ``end_ns``: when the record ended.
    ``saturated``: samples at the end of a range, by column. ``lost``: share of the samples that did not come.
    """

    channel: int
    rest_ns: tuple[int, int]
    phases: tuple[Phase, ...]
    end_ns: int
    samples: Samples
    telemetry: tuple[tuple[int, Any], ...]
    load_ohm: float
    step: tuple[float, float]
    saturated: dict[str, int]
    lost: float

    def said(self, phase: Phase) -> list[Any]:
        """Telemetry from a phase."""
        return [message for time_ns, message in self.telemetry if phase.start_ns < time_ns < phase.end_ns]


def board_faults(faults: tuple[Fault, ...]) -> tuple[Fault, ...]:
    """The board's own faults, with this rig's words for those that say something about brake or probe."""
    named: list[Fault] = []
    for fault in faults:
        words = [known for word, known in _BOARD.items() if f": {word}" in fault.why]
        named.append(Fault(words[0][0], f"the board says {fault.why}; {words[0][1]}") if words else fault)
    known = {fault.what: fault for fault in reversed(named) if fault.what != "board"}
    # A board that latched says so again and refuses what comes after, which is nothing new.
    return tuple(known.values()) or tuple(named)


def probe_faults(run: SupplyRun) -> tuple[Fault, ...]:
    """What is wrong with probe or shunt, the likeliest only; empty for a sound bench."""
    samples = run.samples
    last_ns = samples.start_ns + round(float(samples.time_s[-1]) * 1e9)
    if run.end_ns - last_ns > _SILENT_NS:
        seen_s = (last_ns - run.rest_ns[0]) / 1e9
        return (Fault("probe_silent", f"the probe printed nothing after {seen_s:.2f} s; check its cable and power"),)
    if run.lost > _LOST:
        return (
            Fault("probe_line", f"{100 * run.lost:.1f} % of the probe's samples did not come; is its line good, at 2 Mbaud?"),
        )
    for column, name, count in (("volts_v", "volts", run.step[0]), ("supply_a", "current", run.step[1])):
        if run.saturated[column]:
            greatest = float(np.max(np.abs(samples.column(0 if column == "volts_v" else 1))))
            return (
                Fault(
                    "probe_saturated",
                    f"{run.saturated[column]} samples of {name} stand at the end of the range, {greatest:.3g} "
                    f"({count:.3g} a count); choose a wider range",
                ),
            )
    rest = samples.since(run.rest_ns[0]) < (run.rest_ns[1] - run.rest_ns[0]) / 1e9
    noise_v, noise_a = (noise_sd(samples.column(k)[rest]) for k in (0, 1))
    if noise_v > NOISIEST_V or noise_a > NOISIEST_A:
        return (Fault("probe_noisy", f"at rest it scatters by {noise_v:.2g} V and {1e6 * noise_a:.2g} uA; check its ground"),)
    for phase in run.phases:
        fault = _of_phase(run, phase)
        if fault is not None:
            return (fault,)
    return ()


def _of_phase(run: SupplyRun, phase: Phase) -> Fault | None:
    said = [message for message in run.said(phase) if message.state == State.DRIVING]
    if not said:
        return None
    # Telemetry may meet a wave at the same phase each time: it tells the least, and what was asked for tells the most.
    told_v = float(max(message.output[run.channel] for message in said))
    told_f = 1e-12 * said[-1].capacitance[run.channel]
    seconds = run.samples.since(phase.start_ns)
    lasting_s = (phase.end_ns - phase.start_ns) / 1e9
    low, high = np.searchsorted(seconds, [0.0, lasting_s])
    volts, amps = (run.samples.values[low:high, k] - np.median(run.samples.values[:200, k]) for k in (0, 1))
    seen_v = float(np.percentile(np.abs(volts), 95)) if len(volts) else 0.0
    if not _SAME[0] * told_v < seen_v < _SAME[1] * max(told_v, phase.volts):
        return Fault(
            "probe_loose",
            f"the probe reads {seen_v:.0f} V where the board has {told_v:.0f} V on output {run.channel}; "
            "is its tip on, and on this output, and its ground?",
        )
    if float(np.mean(np.abs(volts) > 0.1 * phase.volts)) < _MIN_ON:
        return Fault("probe_loose", f"the probe's volts come and go at {phase.volts:.0f} V; press its tip on")
    swings = max(1.0, np.floor(2.0 * phase.frequency_hz * lasting_s))
    given_c = float(np.sum(amps)) * float(np.median(np.diff(seconds[:1000])))
    share = given_c / (swings * told_f * phase.volts)
    if share < -_MIN_CHARGE:
        return Fault("shunt_reversed", "the supply's current reads negative while it charges; swap the shunt's leads")
    if share < _MIN_CHARGE:
        return Fault(
            "shunt_open",
            f"the shunt sees {max(100 * share, 0):.0f} % of the charge that {phase.volts:.0f} V need; is it in the supply's "
            "return, and its leads on?",
        )
    return None

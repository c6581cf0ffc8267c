"""What can be wrong at the bench of the supply rig, seen in the record: each with a word and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from haptics.link.messages import State
from haptics.time import NS_PER_MS
from rigs.fitting import noise_sd
from rigs.instruments import Samples
from rigs.result import Fault, readable
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
    """What was recorded. Times are on the bench's clock.

    :param channel: output that the probe is on.
    :param rest_ns: start and end of the rest with nothing on, ns.
    :param phases: stretches with volts on, in their order.
    :param end_ns: end of the record, ns.
    :param samples: of the probe, V and A.
    :param telemetry: of the board: time (ns) and message.
    :param load_ohm: resistance of the probe's divider, ohm.
    :param step: value of one count, V and A.
    :param saturated: samples at the end of a range, by column.
    :param lost: share of the samples that did not come, 0 to 1.
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
        """Telemetry from a phase.

        :param phase: one of ``phases``.
        :return: messages that came during the phase.
        """
        return [message for time_ns, message in self.telemetry if phase.start_ns < time_ns < phase.end_ns]


def board_faults(faults: tuple[Fault, ...]) -> tuple[Fault, ...]:
    """The board's own faults, with this rig's words for those that concern brake or probe.

    :param faults: as the bench reports them.
    :return: faults of brake and probe where there are some; others only without these.
    """
    named: list[Fault] = []
    for fault in faults:
        words = [known for word, known in _BOARD.items() if f": {word}" in fault.why]
        named.append(Fault(words[0][0], f"the board reports {fault.why}; {words[0][1]}") if words else fault)
    known = {fault.what: fault for fault in reversed(named) if fault.what != "board"}
    # A latched board repeats its fault and refuses what comes after, which is nothing new.
    return tuple(known.values()) or tuple(named)


def probe_faults(run: SupplyRun) -> tuple[Fault, ...]:
    """What is wrong with probe or shunt, the likeliest only; empty for a sound bench.

    :param run: so far; it need not be complete.
    :return: at most one fault.
    """
    samples = run.samples
    last_ns = samples.start_ns + round(float(samples.time_s[-1]) * 1e9)
    if run.end_ns - last_ns > _SILENT_NS:
        seen_s = (last_ns - run.rest_ns[0]) / 1e9
        return (Fault("probe_silent", f"the probe printed nothing after {seen_s:.2f} s; check its cable and power"),)
    if run.lost > _LOST:
        return (
            Fault("probe_line", f"{100 * run.lost:.1f} % of the probe's samples did not come; is its line good, at 2 Mbaud?"),
        )
    for column, name, count, unit in (("volts_v", "volts", run.step[0], "V"), ("supply_a", "current", run.step[1], "A")):
        if run.saturated[column]:
            max_seen = float(np.max(np.abs(samples.column(0 if column == "volts_v" else 1))))
            return (
                Fault(
                    "probe_saturated",
                    f"{run.saturated[column]} samples of {name} stand at the end of the range, "
                    f"{readable(max_seen, unit, 3)} ({readable(count, unit, 3)} a count); choose a wider range",
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
    messages = [message for message in run.said(phase) if message.state == State.DRIVING]
    if not messages:
        return None
    # Telemetry may meet a wave at the same phase each time: it gives the minimum, and the commanded volts the maximum.
    board_v = float(max(message.output[run.channel] for message in messages))
    board_f = 1e-12 * messages[-1].capacitance[run.channel]
    seconds = run.samples.since(phase.start_ns)
    lasting_s = (phase.end_ns - phase.start_ns) / 1e9
    low, high = np.searchsorted(seconds, [0.0, lasting_s])
    volts, amps = (run.samples.values[low:high, k] - np.median(run.samples.values[:200, k]) for k in (0, 1))
    seen_v = float(np.percentile(np.abs(volts), 95)) if len(volts) else 0.0
    if not _SAME[0] * board_v < seen_v < _SAME[1] * max(board_v, phase.volts):
        return Fault(
            "probe_loose",
            f"the probe reads {seen_v:.0f} V where the board has {board_v:.0f} V on output {run.channel}; "
            "is its tip on, and on this output, and its ground?",
        )
    if float(np.mean(np.abs(volts) > 0.1 * phase.volts)) < _MIN_ON:
        return Fault("probe_loose", f"the probe's volts come and go at {phase.volts:.0f} V; press its tip on")
    swings = max(1.0, np.floor(2.0 * phase.frequency_hz * lasting_s))
    given_c = float(np.sum(amps)) * float(np.median(np.diff(seconds[:1000])))
    share = given_c / (swings * board_f * phase.volts)
    if share < -_MIN_CHARGE:
        return Fault("shunt_reversed", "the supply's current reads negative while it charges; swap the shunt's leads")
    if share < _MIN_CHARGE:
        return Fault(
            "shunt_open",
            f"the shunt sees {max(100 * share, 0):.0f} % of the charge that {phase.volts:.0f} V need; is it in the supply's "
            "return, and its leads on?",
        )
    return None

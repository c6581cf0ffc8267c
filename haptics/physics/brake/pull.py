"""A standard pull: what a level of the brake model makes of engaging a brake, pulling it till it slides, and letting go.

The brake is driven from rest for half a second at least and four half periods; then a stiff frame loads it, and pulls on at the
published 1 mm/s (thesis 4.7.2) while the strips slide; then it is switched off. The published pull is longer, 10 mm, and loses
more overlap. The plateau lies below the capacity between reversals: at each the capacity dips, the strips slip, and the
frame takes time to load them again; what a faster pull shows is higher.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

from haptics.physics.brake.finger import FINGER, FingerParameters, series_stiffness_n_m
from haptics.physics.brake.force_laws import force_law
from haptics.physics.brake.levels import LEVELS, brake_plant
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.brake.plant import BrakePlant
from haptics.physics.brake.predict import BrakePrediction
from haptics.physics.brake.system import BrakeSystem
from haptics.units import in_range, one_of

PULL_M_S = 1e-3
TESTER = FINGER.with_values(load_stiffness_n_m=1e5, load_damping_n_s_m=50.0, damping_n_s_m=0.0, slack_m=0.0)
"""A frame a hundred times stiffer than muscle, near critical damping (assumed)."""
_HALF_PERIODS = 8
_LONGEST_HALF_S = 1.0
"""Below 0.5 Hz, where no brake should be driven, the pull is over before the wave has come round."""
_SAMPLE_S = 0.5e-3
_MIN_RELEASED_N = 0.05
"""A brake that holds less than this, ten times the off force, has no release worth a time."""


@dataclass(frozen=True)
class Pull:
    """What a pull shows.

    :param level: of the model.
    :param plateau_n: mean tension while the strips slide (N), over whole periods.
    :param ripple_n: its peak to peak there (N).
    :param response_ms: from the drive until the capacity has 90 % of the maximum it reaches before the pull (ms).
    :param release_ms: from switching off until it is down to 10 % of what it was (ms); nan if there was next to none.
    """

    level: str
    plateau_n: float
    ripple_n: float
    response_ms: float
    release_ms: float


def pull(
    level: str,
    volts: float,
    frequency_hz: float = 10.0,
    system: BrakeSystem | None = None,
    *,
    tester: FingerParameters = TESTER,
    step_s: float | None = None,
) -> Pull:
    """Drive, pull and release output 0 of a system; all outputs are driven, as they share the supply.

    :param level: of the model, one of ``LEVELS``.
    :param volts: amplitude (V), 0 to the supply's, below breakdown.
    :param frequency_hz: of the wave (Hz), 0 (constant) to the bridge's.
    :param system: the brakes; one published brake by default.
    :param tester: what pulls, in place of the system's finger.
    :param step_s: as ``brake_plant``.
    :return: what the pull shows.
    :raises InputError: an unknown level, or a number outside its range.
    """
    one_of("level", level, LEVELS)
    system = replace(BrakeSystem() if system is None else system, finger=tester)
    plant = brake_plant(level, system, step_s=step_s)
    in_range("frequency_hz", frequency_hz, 0.0, system.drive.bridge_hz, "Hz")
    half_s = min(0.5 / frequency_hz, _LONGEST_HALF_S) if frequency_hz else 0.0
    engaged_s = max(0.5, 4 * half_s)
    plant.drive(0.0, (1 << system.outputs) - 1, volts, frequency_hz)
    rise = _watch(plant, engaged_s)
    max_n = max(force_n for _, force_n in rise)
    loaded_m = tester.slack_m + max_n / series_stiffness_n_m(tester)
    loading_s = max(0.1, 2 * half_s)
    plant.move(0, engaged_s, 0.0, loaded_m / loading_s)
    plant.advance(engaged_s + loading_s)
    plant.move(0, engaged_s + loading_s, loaded_m, PULL_M_S)
    settled_s = engaged_s + loading_s + max(0.1, 2 * half_s)
    plant.advance(settled_s)
    sliding_s = _HALF_PERIODS * half_s if half_s >= 2 * _SAMPLE_S else 0.1
    samples = max(1, round(sliding_s / _SAMPLE_S))
    tension_n: list[float] = []
    for k in range(samples):
        plant.advance(settled_s + (k + 1) * sliding_s / samples)
        tension_n.append(plant.tension_n[0])
    held_n, off_s = plant.capacity_n[0], plant.now_s
    plant.drive(off_s, 0, 0.0, 0.0)
    released_s = math.nan
    if held_n > _MIN_RELEASED_N:
        fall = _watch(plant, off_s + 5.0 * system.contact.tau_off_s + 0.1)
        released_s = _first_s([(at_s, -force_n) for at_s, force_n in fall], -0.1 * held_n) - off_s
    return Pull(
        level=level,
        plateau_n=sum(tension_n) / len(tension_n),
        ripple_n=max(tension_n) - min(tension_n),
        response_ms=1e3 * _first_s(rise, 0.9 * max_n),
        release_ms=1e3 * released_s,
    )


def predicted_pull(prediction: BrakePrediction, level: str) -> Pull:
    """The pull of the brake that a prediction is about.

    :param prediction: of the brake; at most 8 clutches.
    :param level: of the model, one of ``LEVELS``.
    :return: the pull; all nan where there is none to be had: past breakdown, above what the supply or the bridge can do.
    :raises InputError: an unknown level, or more than 8 clutches.
    """
    one_of("level", level, LEVELS)
    p, drive = prediction, BrakeSystem().drive
    system = BrakeSystem(
        brake=BRAKE.with_values(thickness_m=p.thickness_m, permittivity=p.permittivity),
        laws=(force_law(p.finger, p.law),) * p.clutches,
        overlaps_m2=(p.overlap_m2,) * p.clutches,
        strips=p.strips,
    )
    if p.volts > min(system.breakdown_v, drive.supply_volts) or p.frequency_hz > drive.bridge_hz:
        return Pull(level, math.nan, math.nan, math.nan, math.nan)
    return pull(level, p.volts, p.frequency_hz, system)


def _watch(plant: BrakePlant, until_s: float) -> list[tuple[float, float]]:
    """Time and capacity of output 0 at each sample from now on."""
    from_s = plant.now_s
    seen = [(from_s, plant.capacity_n[0])]
    samples = math.ceil((until_s - from_s) / _SAMPLE_S)
    for k in range(samples):
        plant.advance(from_s + (k + 1) * (until_s - from_s) / samples)
        seen.append((plant.now_s, plant.capacity_n[0]))
    return seen


def _first_s(seen: list[tuple[float, float]], level: float) -> float:
    """When ``level`` is first reached, straight between samples; nan if never."""
    for (from_s, below), (to_s, above) in pairwise(seen):
        if below < level <= above:
            return from_s + (to_s - from_s) * (level - below) / (above - below)
    return seen[0][0] if seen[0][1] >= level else math.nan

"""The cases over which levels of the brake are measured against the reference, and what is compared.

A hand pulls at a strip while the brake is driven, held and let go, as on a pull tester (thesis 4.7.2). *typical*: 400 to 1500 V
at 5 to 20 Hz, at most half a second. *edge*: down to the threshold of any force and to frequencies that no swing completes, a
step from one amplitude to another, fast and stiff pulls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptics.physics.brake.finger import FINGER, FingerParameters
from haptics.physics.brake.levels import BrakeSystem, brake_plant

SAMPLE_S = 0.5e-3
"""Forces are compared this often."""
OFF_S = 0.15
"""How long a case is followed after its volts are gone."""


@dataclass(frozen=True)
class BrakeCase:
    """One run of a brake: drives one after another at one frequency, while the hand pulls at a constant speed from the start.

    :param kind: typical or edge.
    :param drives: (volts, seconds) of each.
    :param frequency_hz: of the wave (Hz).
    :param pull_m_s: speed of the hand (m/s).
    :param finger: what pulls.
    """

    kind: str
    drives: tuple[tuple[float, float], ...]
    frequency_hz: float
    pull_m_s: float
    finger: FingerParameters


@dataclass(frozen=True)
class BrakeRun:
    """What came of a case, every ``SAMPLE_S``.

    :param capacity_n: (samples,), what the brake can hold (N).
    :param tension_n: (samples,), what the finger feels (N).
    :param energy_j: of the supply (J), of the same drives with the hand at rest: an overlap that slides away is another load.
    :param first: sample at which the first drive ends.
    :param on: sample at which all drives end.
    """

    capacity_n: np.ndarray
    tension_n: np.ndarray
    energy_j: float
    first: int
    on: int


def play(case: BrakeCase, level: str) -> BrakeRun:
    """Run a case.

    :param case: what to run.
    :param level: one of ``brake_plant``'s.
    :return: what came of it.
    """
    plant, still = (brake_plant(level, BrakeSystem(finger=case.finger)) for _ in range(2))
    plant.move(0, 0.0, 0.0, case.pull_m_s)
    capacity_n, tension_n = [], []
    samples, at = 0, 0
    for volts, length_s in (*case.drives, (0.0, OFF_S)):
        for one in (plant, still):
            one.drive(at * SAMPLE_S, int(volts > 0.0), volts, case.frequency_hz if volts else 0.0)
        samples += round(length_s / SAMPLE_S)
        while at < samples:
            at += 1
            plant.advance(at * SAMPLE_S)
            capacity_n.append(plant.capacity_n[0])
            tension_n.append(plant.tension_n[0])
    still.advance(at * SAMPLE_S)
    ends = np.cumsum([round(length_s / SAMPLE_S) for _, length_s in case.drives])
    return BrakeRun(np.array(capacity_n), np.array(tension_n), still.supply_energy_j, int(ends[0]), int(ends[-1]))


def brake_cases(kind: str, count: int, seed: int = 1) -> list[BrakeCase]:
    """Draw cases; the same for the same seed.

    :param kind: typical or edge.
    :param count: how many.
    :param seed: of the draw.
    :return: the cases.
    """
    rng = np.random.default_rng([seed, kind == "edge"])
    return [_edge(rng) if kind == "edge" else _typical(rng) for _ in range(count)]


def errors(run: BrakeRun, true: BrakeRun) -> dict[str, float]:
    """Error of each observable. Times are those of capacity; plateau and ripple those of the first drive's second half.

    :param run: of the level judged.
    :param true: of the reference.
    :return: by observable, in ``measure.UNITS``.
    """
    peak_n = float(true.capacity_n[: true.first].max())
    found = {"force over time": float(np.sqrt(np.mean((run.tension_n - true.tension_n) ** 2)))}
    if true.energy_j > 0.0:
        found["supply power"] = 100.0 * abs(run.energy_j / true.energy_j - 1.0)
    if peak_n < 0.05:
        return found  # no force to speak of: nothing rises, holds or falls
    hold = slice(true.first // 2, true.first)
    found["plateau"] = 100.0 * abs(float(run.capacity_n[hold].mean() / true.capacity_n[hold].mean()) - 1.0)
    found["ripple"] = (
        100.0 * abs(float(np.ptp(run.capacity_n[hold]) - np.ptp(true.capacity_n[hold]))) / true.capacity_n[hold].mean()
    )
    found["response time"] = abs(_rises_ms(run) - _rises_ms(true))
    found["release time"] = abs(_falls_ms(run) - _falls_ms(true))
    return found


def _rises_ms(run: BrakeRun) -> float:
    """Until half of what is reached in the first drive, when a renderer counts the brake as closed."""
    first = run.capacity_n[: run.first]
    return _passes_ms(first >= 0.5 * first.max(), first, 0.5 * first.max())


def _falls_ms(run: BrakeRun) -> float:
    """From the end of the drives until a tenth of what was held then."""
    after = run.capacity_n[run.on - 1 :]
    return _passes_ms(after <= 0.1 * after[0], after, 0.1 * after[0])


def _passes_ms(past: np.ndarray, force_n: np.ndarray, level_n: float) -> float:
    """When a level is first passed, between samples by a straight line; the whole time if it never is."""
    k = int(np.argmax(past)) if past.any() else len(past)
    if 0 < k < len(past):
        return 1e3 * SAMPLE_S * (k - 1 + float((level_n - force_n[k - 1]) / (force_n[k] - force_n[k - 1])))
    return 1e3 * SAMPLE_S * k


def _typical(rng: np.random.Generator) -> BrakeCase:
    drive = (float(rng.uniform(400.0, 1500.0)), float(rng.uniform(0.15, 0.5)))
    return BrakeCase("typical", (drive,), float(rng.uniform(5.0, 20.0)), float(rng.uniform(0.5e-3, 20e-3)), FINGER)


def _edge(rng: np.random.Generator) -> BrakeCase:
    first, second = (float(volts) for volts in 10.0 ** rng.uniform(1.5, np.log10(1500.0), 2))
    frequency_hz = float(10.0 ** rng.uniform(0.0, 2.0))
    finger = FINGER.with_values(load_stiffness_n_m=float(10.0 ** rng.uniform(2.0, np.log10(3e5))))
    drives = ((first, float(rng.uniform(0.1, 0.4))), (second, float(rng.uniform(0.1, 0.3))))
    return BrakeCase("edge", drives, frequency_hz, float(rng.uniform(0.0, 0.2)), finger)

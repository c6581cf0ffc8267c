"""The cases over which levels of the latch are measured against the reference, and what is compared.

*typical*: what boards of this kind do. One pulse of 2.5 to 10 ms at 4.5 to 5 V, in either direction, coil up to 50 K warm, any
resistance in the stated band. *edge*: what else they may be asked: weak and strong drive, cold and hot coils, pulses down to a
microsecond, within a few per cent of the threshold, reversed in flight, trains up to 200 Hz, drives that begin while the pin
still bounces, a skin under the pin. A pulse within ``latch.UNCERTAIN_WITHIN`` of the threshold is no case: there every level
answers that it does not know.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from haptics.errors import InputError
from haptics.physics.latch.dynamic import DynamicLatch
from haptics.physics.latch.parameters import LATCH, LatchParameters
from haptics.physics.latch.plant import Latched
from haptics.physics.latch.pulse import UNCERTAIN_WITHIN, latch_plant, min_pulse_s
from haptics.physics.thermal.one_node import THERMAL

Stroke = tuple[float, float]
"""Volts (signed), seconds."""
SETTLE_S = 0.3
_FINE_S = 5e-6
_HARDEST = 10
"""Cases taken for each level and observable."""
STEADY_K = THERMAL.c_k_per_w * 0.36
"""Rise of a tactor that switches twice a second (thesis 3.5.2): what an error of energy is counted on, in kelvin."""


@dataclass(frozen=True)
class LatchCase:
    """Strokes one after another, from rest.

    :param kind: typical or edge.
    :param strokes: signed volts and seconds of each.
    :param latched: where the pin rests at first.
    :param rise_k: the coil's rise above the room (K).
    :param parameters: of the tactor.
    """

    kind: str
    strokes: tuple[Stroke, ...]
    latched: Latched
    rise_k: float
    parameters: LatchParameters


@dataclass(frozen=True)
class LatchRun:
    """What came of a case.

    A single stroke after which the pin falls back to where it was has no arrival: nobody feels it.

    :param final: the stop it ended at.
    :param arrival_s: first arrival there since the last stroke began (s), None if there is none.
    :param speed_m_s: speed then, unsigned (m/s).
    :param energy_j: electrical (J).
    """

    final: Latched
    arrival_s: float | None
    speed_m_s: float | None
    energy_j: float


def play(case: LatchCase, level: str, step_s: float | None = None) -> LatchRun | None:
    """Run a case.

    :param case: what to run.
    :param level: one of ``latch_plant``'s.
    :param step_s: level ``dynamic`` in other steps (s) than its own.
    :return: what came of it; None if the level refuses the case or reports that it lies outside what it answers for.
    """
    try:
        if step_s is None:
            plant = latch_plant(level, case.parameters, latched=case.latched)
        else:
            plant = DynamicLatch(case.parameters, case.latched, step_s=step_s)
        plant.rise_k = case.rise_k
        at_s, last_s = 0.0, 0.0
        for volts, length_s in case.strokes:
            plant.drive(at_s, volts)
            last_s = at_s if volts else last_s
            at_s += length_s
        plant.drive(at_s, 0.0)
        plant.advance(at_s + SETTLE_S)
    except InputError:
        return None
    if plant.outside:
        return None
    kind = "reached_skin" if plant.latched == "on" else "reached_off"
    arrived = next((event for event in plant.take_events() if event.kind == kind and event.time_s > last_s), None)
    if arrived is None or (len(case.strokes) == 1 and plant.latched == case.latched):
        return LatchRun(plant.latched, None, None, plant.energy_j)
    return LatchRun(plant.latched, arrived.time_s, abs(arrived.speed_m_s), plant.energy_j)


def latch_cases(kind: str, count: int, seed: int = 1) -> list[LatchCase]:
    """Draw cases away from the threshold; the same for the same seed.

    :param kind: typical or edge.
    :param count: how many.
    :param seed: of the draw.
    :return: the cases.
    """
    rng = np.random.default_rng([seed, kind == "edge"])
    found: list[LatchCase] = []
    for case in _typical(rng) if kind == "typical" else _edge(rng):
        if _settled(case):
            found.append(case)
        if len(found) == count:
            break
    return found


def hardest_cases(kind: str, among: int, seed: int = 1) -> list[LatchCase]:
    """Of many more cases, those in which a level is furthest off, in arrival or in impact, by comparison with fine steps.

    The tail of the errors is long: the nearer to the threshold, the more any difference grows. A sample that is small enough
    for the reference would miss it, and its worst would be no bound.

    :param kind: typical or edge.
    :param among: cases that are looked through.
    :param seed: of the draw.
    :return: at most ten cases for each level and observable, none twice.
    """
    ranked: dict[tuple[str, str], list[tuple[float, LatchCase]]] = {}
    for case in latch_cases(kind, among, seed):
        fine = play(case, "dynamic", _FINE_S)
        for level in ("event", "table", "dynamic"):
            run = play(case, level)
            for observable, error in (errors(run, fine) if run and fine else {}).items():
                if observable in ("arrival time", "impact speed", "energy"):
                    ranked.setdefault((level, observable), []).append((error, case))
    chosen = [sorted(of, key=lambda pair: -pair[0])[:_HARDEST] for of in ranked.values()]
    return list(dict.fromkeys(case for of in chosen for _, case in of))


def errors(run: LatchRun, true: LatchRun) -> dict[str, float]:
    """Error of each observable that both runs have.

    :param run: of the level judged.
    :param true: of the reference.
    :return: by observable, in ``measure.UNITS``.
    """
    energy = abs(run.energy_j / true.energy_j - 1.0) if true.energy_j else 0.0
    found = {
        "wrong final state": float(run.final != true.final),
        "energy": 100.0 * energy,
        "temperature": STEADY_K * energy,
    }
    if run.arrival_s is not None and true.arrival_s is not None and run.final == true.final:
        found["arrival time"] = 1e3 * abs(run.arrival_s - true.arrival_s)
    if run.speed_m_s and true.speed_m_s and run.final == true.final:
        found["impact speed"] = 100.0 * abs(run.speed_m_s / true.speed_m_s - 1.0)
    return found


def _settled(case: LatchCase) -> bool:
    """Whether longer and shorter strokes end at the same stop."""
    finals = set()
    for scale in (1.0 - UNCERTAIN_WITHIN, 1.0, 1.0 + UNCERTAIN_WITHIN):
        strokes = tuple((volts, length_s * scale) for volts, length_s in case.strokes)
        run = play(LatchCase(case.kind, strokes, case.latched, case.rise_k, case.parameters), "dynamic")
        finals.add(None if run is None else run.final)
    return len(finals) == 1


def _typical(rng: np.random.Generator) -> Iterator[LatchCase]:
    while True:
        parameters = LATCH.with_values(resistance_ohm=float(rng.uniform(1.28, 1.48)))
        latched: Latched = "off" if rng.integers(2) else "on"
        volts = float(rng.uniform(4.5, 5.0)) * (1.0 if latched == "off" else -1.0)
        length_s = float(rng.uniform(2.5e-3, 10e-3))
        yield LatchCase("typical", ((volts, length_s),), latched, float(rng.uniform(0.0, 50.0)), parameters)


def _edge(rng: np.random.Generator) -> Iterator[LatchCase]:
    kinds = ("drive", "short", "threshold", "reversed", "train", "bouncing", "skin")
    while True:
        for kind in kinds:
            latched: Latched = "off" if rng.integers(2) else "on"
            sign = 1.0 if latched == "off" else -1.0
            volts, rise_k = float(rng.uniform(3.8, 5.5)), float(rng.uniform(-20.0, 80.0))
            parameters = LATCH.with_values(resistance_ohm=float(rng.uniform(1.28, 1.48)))
            if kind == "skin":
                skin = {"skin_stiffness_n_m": float(rng.uniform(50.0, 600.0)), "skin_at_m": float(rng.uniform(1e-3, 1.9e-3))}
                parameters = parameters.with_values(**skin)
            if kind in ("drive", "skin"):
                strokes = [(sign * volts, float(rng.uniform(2e-3, 20e-3)))]
            elif kind == "short":
                strokes = [(sign * volts, float(10.0 ** rng.uniform(-6.0, -2.9)))]
            elif kind == "threshold":
                direction = "off-on" if latched == "off" else "on-off"
                at_nominal_v = volts * LATCH.resistance_ohm / parameters.resistance_ohm
                min_s = min_pulse_s(at_nominal_v, direction, rise_k, extrapolate=True)
                if not min_s < 40e-3:
                    continue
                strokes = [(sign * volts, min_s * (1.0 + float(rng.choice([-1.0, 1.0]) * rng.uniform(0.025, 0.08))))]
            elif kind == "reversed":
                strokes = [(sign * volts, float(rng.uniform(1e-3, 4e-3))), (-sign * volts, float(rng.uniform(0.5e-3, 8e-3)))]
            elif kind == "train":
                latched, gap_s = "off", float(rng.choice([0.0, 5e-3, 15e-3, 45e-3]))
                strokes = [stroke for _ in range(4) for stroke in ((volts, 2e-3), (-volts, 3e-3), (0.0, gap_s))][:-1]
            else:
                strokes = [(sign * volts, 7e-3), (0.0, float(rng.uniform(0.0, 10e-3))), (-sign * volts, 10e-3)]
            strokes = [stroke for stroke in strokes if stroke[1] > 0.0]
            yield LatchCase("edge", tuple(strokes), latched, rise_k, parameters)

"""The latch at its extremes: drives, stops, steps, supplies and parameters that break careless integrators."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from haptics.fidelity.cases.latch import LatchCase, LatchRun, errors, latch_cases, play
from haptics.fidelity.stress.tally import StressRow, Tally
from haptics.physics.latch.dynamic import DynamicLatch
from haptics.physics.latch.parameters import LATCH, LatchParameters
from haptics.physics.latch.plant import Latched
from haptics.physics.latch.pulse import LEVELS, latch_plant, min_pulse_s, switch

YEAR_S = 365.25 * 86400.0
ARRIVAL_MS = {"event": 2.0, "table": 0.03, "dynamic": 0.01, "reference": 0.0}
"""Bounds on arrival over edge cases; what is measured for each level is below them."""


def stress_latch(quick: bool, seed: int) -> list[StressRow]:
    """All extremes of all levels.

    :param quick: True: fewer cases.
    :param seed: of drawn cases.
    :return: a row for each extreme.
    """
    rows: list[StressRow] = []
    count = 12 if quick else 120
    for level in LEVELS:
        # The reference is its own judge but where an exact answer is known; there are fewer of its cases, as they are dear.
        some = count // 6 if level == "reference" else count
        rows += [
            _shorter_than_the_coil(level, some, seed),
            _near_the_threshold(level, some, seed),
            _stiff_stops(level, some, seed),
            _sagging_supply(level),
            _hot_coil(level),
            _at_rest_for_a_year(level),
            _nonsense(level),
        ]
        if level != "reference":
            rows += [_any_parameters(level, some, seed), _edge_cases(level, some, seed)]
    rows += [_any_step(), _bounces_without_end()]
    return rows


@lru_cache(maxsize=512)
def _true(case: LatchCase) -> LatchRun | None:
    """What every level's answer to a case is held against: played once for all levels, being the dearest."""
    return play(case, "reference")


def _shorter_than_the_coil(level: str, count: int, seed: int) -> StressRow:
    """Exact while the pin has not moved: charge of a coil, V/R (t - tau (1 - exp(-t/tau)))."""
    tally = Tally("latch", level, "pulse of 1 ns to L/R", "%", 0.5)
    coil_s = LATCH.inductance_h / LATCH.resistance_ohm
    for t in np.geomspace(1e-9, coil_s, max(4, count // 4)):

        def question(t: float = float(t)) -> float:
            z = t / coil_s
            exact_j = 25.0 / LATCH.resistance_ohm * coil_s * (z + math.expm1(-z) if z > 1e-4 else z * z * (0.5 - z / 6.0))
            outcome = switch(t, 5.0, "off-on", 0.0, level)
            return math.inf if outcome.switched else 100.0 * abs(outcome.energy_j / exact_j - 1.0)

        tally.ask(question)
    return tally.row()


def _near_the_threshold(level: str, count: int, seed: int) -> StressRow:
    """Within 2 % of the shortest pulse the answer must report that it is uncertain."""
    tally = Tally("latch", level, "pulse within 2 % of the shortest that switches", "share", 0.0, "reports that it is uncertain")
    rng = np.random.default_rng([seed, 1])
    for _ in range(max(3, count // 6)):
        direction = "off-on" if rng.integers(2) else "on-off"
        volts, share = float(rng.uniform(4.5, 5.0)), float(rng.uniform(-0.019, 0.019))

        def question(direction: str = direction, volts: float = volts, share: float = share) -> float | None:
            min_s = min_pulse_s(volts, direction, 0.0, level)
            return None if switch(min_s * (1.0 + share), volts, direction, 0.0, level).uncertain else 1.0

        tally.ask(question)
    return tally.row()


def _stiff_stops(level: str, count: int, seed: int) -> StressRow:
    """The stop's spring helps a start a little; without it arrival moves by up to 2 %, and no more."""
    tally = Tally("latch", level, "stops of 1e6 to 1e8 N/m", "%", 2.0, "event: fits its constants to them")
    for stiffness in (1e6, 1e7) if level == "reference" else (1e6, 1e7, 1e8):
        for direction, exact_s in (("off-on", 4.8561e-3), ("on-off", 6.0e-3)):

            def question(stiffness: float = stiffness, direction: str = direction, exact_s: float = exact_s) -> float:
                p = LATCH.with_values(on_stiffness_n_m=stiffness, off_stiffness_n_m=stiffness)
                outcome = switch(10e-3, 5.0, direction, 0.0, level, p)
                return math.inf if outcome.arrival_s is None else 100.0 * abs(outcome.arrival_s / exact_s - 1.0)

            tally.ask(question)
    return tally.row()


def _sagging_supply(level: str) -> StressRow:
    """Several coils on a supply of 0.1 ohm: those that no longer switch must show in the state, as many as at the reference."""
    tally = Tally("latch", level, "1 to 10 coils sharing 0.1 ohm", "actuators", 0.0)

    def stuck(level: str, together: int) -> tuple[bool, tuple[str, ...]]:
        plant = latch_plant(level, latched="on")
        plant.drive(0.0, -5.0 / (1.0 + 0.1 * together / LATCH.resistance_ohm))
        plant.drive(10e-3, 0.0)
        plant.advance(0.3)
        return plant.latched != "off", plant.outside

    for together in range(1, 11):

        def question(together: int = together) -> float | None:
            (found, outside), (true, _) = stuck(level, together), stuck("dynamic", together)
            return None if outside else float(found != true)

        tally.ask(question)
    first = next(n for n in range(1, 16) if stuck("dynamic", n)[0])
    tally.limit = f"coil {first} of those that fire together sticks, and its state shows it"
    return tally.row()


def _hot_coil(level: str) -> StressRow:
    tally = Tally("latch", level, "coil at -250 to +200 K", "ms", ARRIVAL_MS[level] or 1e-6, "refused where resistance vanishes")
    for rise_k in (-40.0, 0.0, 50.0, 100.0, 200.0):
        case = LatchCase("edge", ((5.0, 10e-3),), "off", rise_k, LATCH)

        def question(case: LatchCase = case) -> float | None:
            run, true = play(case, level), _true(case)
            if run is None or true is None:
                return None
            return errors(run, true).get("arrival time", 0.0) if run.final == true.final else math.inf

        tally.ask(question)

    def impossible() -> float:
        plant = latch_plant(level)
        plant.rise_k = -300.0
        plant.drive(0.0, 5.0)
        return 0.0

    tally.ask(impossible, must_refuse=True)
    return tally.row()


def _at_rest_for_a_year(level: str) -> StressRow:
    """A coil stuck on for a year, then released: exact is V^2 t / R."""
    tally = Tally("latch", level, "a coil stuck on for a year", "%", 1e-3)

    def question() -> float:
        plant = latch_plant(level)
        plant.drive(0.0, 5.0)
        plant.advance(YEAR_S)
        plant.drive(YEAR_S, 0.0)
        plant.advance(2.0 * YEAR_S)
        exact_j = 25.0 / LATCH.resistance_ohm * YEAR_S
        return 100.0 * abs(plant.energy_j / exact_j - 1.0) if plant.latched == "on" else math.inf

    tally.ask(question)
    return tally.row()


def _nonsense(level: str) -> StressRow:
    tally = Tally("latch", level, "NaN, infinite, huge, backward; subnormal and zero", "m", 1e-3, "refused by name")

    def driven(time_s: float, volts: float) -> float:
        plant = latch_plant(level)
        plant.drive(0.0, 0.0)
        plant.advance(1.0)
        plant.drive(time_s, volts)
        plant.advance(max(1.0, time_s) + 0.3)
        finite = all(map(math.isfinite, (plant.position_m, plant.speed_m_s, plant.current_a, plant.energy_j)))
        return abs(plant.position_m) if finite else math.nan

    for time_s, volts in ((1.0, math.nan), (1.0, math.inf), (1.0, 1e4), (0.5, 5.0), (math.nan, 5.0)):
        tally.ask(lambda time_s=time_s, volts=volts: driven(time_s, volts), must_refuse=True)
    for volts in (0.0, -0.0, 5e-324, -1e-310, 1e-12):
        tally.ask(lambda volts=volts: driven(1.0, volts))
    return tally.row()


def _any_parameters(level: str, count: int, seed: int) -> StressRow:
    """Parameter sets drawn far and wide: an end state that the fine steps of ``dynamic`` give too, or a refusal."""
    tally = Tally("latch", level, "random parameter sets", "share", 0.0, "refused where the level cannot describe them")
    for p, latched in _parameter_sets(count, seed):
        case = LatchCase("edge", ((5.0 if latched == "off" else -5.0, 10e-3),), latched, 0.0, p)

        def question(case: LatchCase = case) -> float | None:
            finals = {_end(case, 5e-6, scale) for scale in (0.97, 1.0, 1.03)}
            if len(finals) > 1 or None in finals:
                return None  # on the watershed, or without rest: no level is asked to know
            run = play(case, level)
            if run is None:
                return None
            return float(run.final not in finals) if math.isfinite(run.energy_j) else math.nan

        tally.ask(question)
    return tally.row()


def _parameter_sets(count: int, seed: int) -> Iterator[tuple[LatchParameters, Latched]]:
    rng = np.random.default_rng([seed, 2])
    spread = {
        "mass_kg": 10.0, "hold_on_n": 5.0, "hold_off_n": 5.0, "thrust_n_a": 4.0, "thrust_length_m": 4.0, "drag_n_s_m": 10.0,
        "inductance_h": 30.0, "resistance_ohm": 3.0, "stroke_m": 3.0, "on_stiffness_n_m": 1e3, "off_stiffness_n_m": 1e3,
        "on_loss_s_m": 10.0, "off_loss_s_m": 10.0, "plate_length_m": 2.0, "plate_power": 1.5,
    }  # fmt: skip
    for _ in range(count):
        values = {name: getattr(LATCH, name) * float(of ** rng.uniform(-1.0, 1.0)) for name, of in spread.items()}
        yield LATCH.with_values(**values), "off" if rng.integers(2) else "on"


def _end(case: LatchCase, step_s: float, scale: float) -> str | None:
    """Where a case ends, its volts scaled; None if it does not come to rest."""
    plant = DynamicLatch(case.parameters, case.latched, step_s=step_s)
    at_s = 0.0
    for volts, length_s in case.strokes:
        plant.drive(at_s, volts * scale)
        at_s += length_s
    plant.drive(at_s, 0.0)
    plant.advance(at_s + 0.3)
    return plant.latched if plant.at_rest else None


def _edge_cases(level: str, count: int, seed: int) -> StressRow:
    """Weak, strong, short, reversed in flight, trains, driven away while bouncing; see ``latch_cases``."""
    tally = Tally("latch", level, "reversals in flight, trains, weak and strong drive", "ms", ARRIVAL_MS[level])
    tally.limit = "it reports what it does not answer for" if level == "event" else ""
    for case in latch_cases("edge", count, seed + 1000):

        def question(case: LatchCase = case) -> float | None:
            run, true = play(case, level), _true(case)
            if run is None or true is None:
                return None
            return math.inf if run.final != true.final else errors(run, true).get("arrival time", 0.0)

        tally.ask(question)
    return tally.row()


def _any_step() -> StressRow:
    tally = Tally("latch", "dynamic", "steps of 1 us to 100 ms, stops to 1e8 N/m", "%", 2.0, "steps above 1 ms are refused")
    for step_s in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1):
        for stiffness in (3e3, 1e5, 1e8):

            def question(step_s: float = step_s, stiffness: float = stiffness) -> float:
                p = LATCH.with_values(on_stiffness_n_m=stiffness, off_stiffness_n_m=stiffness)
                plant = DynamicLatch(p, "off", step_s=step_s)
                plant.drive(0.0, 5.0)
                plant.drive(10e-3, 0.0)
                plant.advance(0.3)
                arrived = [event.time_s for event in plant.take_events() if event.kind == "reached_skin"]
                landed = plant.latched == "on" and plant.at_rest and arrived
                return 100.0 * abs(arrived[0] / 4.8561e-3 - 1.0) if landed else math.inf

            tally.ask(question, must_refuse=step_s > 1e-3)
    return tally.row()


def _bounces_without_end() -> StressRow:
    tally = Tally("latch", "dynamic", "lossless stops of 1e8 N/m (Zeno)", "m", 1e-6, "drag brings them to rest")

    def question() -> float:
        plant = DynamicLatch(LATCH.with_values(on_stiffness_n_m=1e8, on_loss_s_m=0.0, off_loss_s_m=0.0))
        plant.drive(0.0, 5.0)
        plant.drive(10e-3, 0.0)
        plant.advance(0.5)
        return abs(plant.position_m - LATCH.stroke_m) if plant.at_rest else math.inf

    tally.ask(question)
    return tally.row()

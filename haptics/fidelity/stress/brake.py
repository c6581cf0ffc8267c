"""The brake at its extremes: no volts and breakdown, no overlap, any film and step, stiff hands, many at once, hours."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from haptics.fidelity.cases.brake import BrakeCase, BrakeRun, brake_cases, play
from haptics.fidelity.stress.tally import StressRow, Tally
from haptics.physics.brake.bank import BrakeBank
from haptics.physics.brake.finger import FINGER, FingerParameters
from haptics.physics.brake.levels import LEVELS, BrakeSystem, brake_plant
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.brake.plant import BrakePlant

FORCE_N = {"static": 3.0, "lagged": 1.0, "dynamic": 0.1, "reference": 0.0}
"""Bounds on force, root mean square over an edge case; what is measured for each level is below them."""
STEPPED = ("static", "lagged", "dynamic")
TOO_MUCH_N = 1e-6
"""Tension may pass capacity by rounding only."""


def stress_brake(quick: bool, seed: int) -> list[StressRow]:
    """All extremes of all levels.

    :param quick: True: fewer cases and shorter runs.
    :param seed: of drawn cases.
    :return: a row for each extreme.
    """
    rows: list[StressRow] = []
    count = 4 if quick else 24
    for level in LEVELS:
        rows += [_volts(level), _films(level), _little_overlap(level), _stiff_hand(level), _hours(level, quick), _nonsense(level)]
        if level != "reference":
            rows += [_any_step(level, quick), _edge_cases(level, count, seed)]
    rows += [_energy(friction, count, seed) for friction in ("coulomb", "lugre")]
    return [*rows, *(_many(level) for level in ("lagged", "dynamic"))]


@lru_cache(maxsize=64)
def _true(case: BrakeCase) -> BrakeRun:
    """What every level's answer to a case is held against: played once for all levels, being the dearest."""
    return play(case, "reference")


def _pull(
    level: str,
    volts: float,
    system: BrakeSystem,
    step_s: float | None = None,
    speed_m_s: float = 0.02,
    hz: float = 10.0,
    held_s: float = 0.3,
) -> tuple[float, float, BrakePlant]:
    """Hold for a while against a pull: what the law gives at the end, and the capacity, infinite if a rule of force broke."""
    plant = brake_plant(level, system, step_s=step_s)
    plant.move(0, 0.0, 0.0, speed_m_s)
    plant.drive(0.0, 1, volts, hz)
    broken = False
    for k in range(1, round(held_s / 0.01) + 1):
        plant.advance(0.01 * k)
        tension_n, capacity_n = plant.tension_n[0], plant.capacity_n[0]
        finite = all(map(math.isfinite, (tension_n, capacity_n, plant.slip_m[0], plant.voltage_v(0))))
        broken |= not finite or not -TOO_MUCH_N <= tension_n <= capacity_n + TOO_MUCH_N
    law_n = plant.steady_force_n(0, plant.amplitude_v(0))
    return law_n, math.inf if broken else plant.capacity_n[0], plant


def _off_by(
    level: str, volts: float, system: BrakeSystem, step_s: float | None = None, hz: float = 10.0, held_s: float = 0.3
) -> float:
    """Of what the law gives, in per cent of it, with the dip of the last reversal allowed for by the bound."""
    law_n, capacity_n, _ = _pull(level, volts, system, step_s=step_s, hz=hz, held_s=held_s)
    return 100.0 * abs(capacity_n - law_n) / max(law_n, 1e-3)


def _volts(level: str) -> StressRow:
    tally = Tally("brake", level, "0 V to breakdown", "%", 12.0, "past breakdown (300 V/um) refused: a fault, not a force")
    for volts in (0.0, 5e-324, 1e-12, 1.0, 100.0, 172.0, 1500.0, 2000.0):
        tally.ask(lambda volts=volts: _off_by(level, volts, BrakeSystem()))
    thin = BrakeSystem(brake=BRAKE.with_values(thickness_m=2e-6))
    tally.ask(lambda: _off_by(level, 700.0, thin), must_refuse=True)
    return tally.row()


def _films(level: str) -> StressRow:
    tally = Tally("brake", level, "dielectric of 1 um to 1 mm", "%", 12.0)
    for thickness_m in (1e-6, 3e-6, 13e-6, 100e-6, 1e-3):
        system = BrakeSystem(brake=BRAKE.with_values(thickness_m=thickness_m))
        volts = min(1500.0, 150e6 * thickness_m)
        tally.ask(lambda system=system, volts=volts: _off_by(level, volts, system, hz=1.0))
    return tally.row()


def _little_overlap(level: str) -> StressRow:
    tally = Tally("brake", level, "overlap to nothing, pulled off", "N", TOO_MUCH_N, "force ends with the overlap")
    for overlap_m2 in (0.0, 1e-12, 1e-6, 1e-4):

        def question(overlap_m2: float = overlap_m2) -> float:
            system = BrakeSystem(overlaps_m2=(overlap_m2,))
            _, capacity_n, _ = _pull(level, 1000.0, system, speed_m_s=1.0)
            return 0.0 if math.isfinite(capacity_n) else math.inf

        tally.ask(question)
    return tally.row()


def _stiff_hand(level: str) -> StressRow:
    tally = Tally("brake", level, "hands of 1 to 3e5 N/m, strips to 1e7 N/m", "N", TOO_MUCH_N, "tension never passes capacity")
    for load, strip in ((1.0, 4e3), (1e3, 4e3), (3e5, 4e3), (3e5, 1e6), (3e5, 1e7)):

        def question(load: float = load, strip: float = strip) -> float:
            finger = FINGER.with_values(load_stiffness_n_m=load, strip_stiffness_n_m=strip)
            return 0.0 if math.isfinite(_pull(level, 1000.0, BrakeSystem(finger=finger), speed_m_s=0.1)[1]) else math.inf

        tally.ask(question)
    return tally.row()


def _any_step(level: str, quick: bool) -> StressRow:
    tally = Tally("brake", level, "steps of 1 us to 100 ms", "%", 100.0, "shorter and longer steps refused")
    for step_s in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1):
        # All of the pull in steps of a microsecond takes seconds.
        held_s = 0.06 if quick and step_s < 1e-5 else 0.3
        tally.ask(
            lambda step_s=step_s, held_s=held_s: _off_by(level, 1000.0, BrakeSystem(), step_s=step_s, hz=2.0, held_s=held_s)
        )
    for step_s in (1e-7, 1.0, math.nan):
        tally.ask(lambda step_s=step_s: _off_by(level, 1000.0, BrakeSystem(), step_s=step_s), must_refuse=True)
    return tally.row()


def _hours(level: str, quick: bool) -> StressRow:
    """On and off for hours, then rest: volts, force and charge end where they began."""
    # The reference looks every 50 ms even at what rests.
    seconds, rest_s = (6.0, 10.0) if level == "reference" else (60.0 if quick else 7200.0, 7 * 86400.0)
    tally = Tally("brake", level, f"{seconds:g} s of switching, then {rest_s:g} s of rest", "N", 1e-3)

    def question() -> float:
        plant = brake_plant(level)
        off_n = plant.capacity_n[0]
        for k in range(int(seconds / 2.0)):
            plant.drive(2.0 * k, 1, 1000.0, 10.0)
            plant.drive(2.0 * k + 0.3, 0, 0.0, 0.0)
        plant.advance(seconds + rest_s)
        held = abs(plant.voltage_v(0)) < 1e-6 and math.isfinite(plant.supply_energy_j)
        return abs(plant.capacity_n[0] - off_n) if held else math.inf

    tally.ask(question)
    return tally.row()


def _nonsense(level: str) -> StressRow:
    tally = Tally("brake", level, "NaN, infinite, huge, backward", "N", 1e3, "refused by name")

    def asked(
        time_s: float = 1.0, volts: float = 500.0, hz: float = 10.0, position_m: float = 0.0, speed_m_s: float = 0.0
    ) -> float:
        plant = brake_plant(level)
        plant.advance(1.0)
        plant.move(0, time_s, position_m, speed_m_s)
        plant.drive(time_s, 1, volts, hz)
        plant.advance(time_s + 0.1)
        return plant.tension_n[0]

    for wrong in (
        {"volts": math.nan}, {"volts": math.inf}, {"volts": 1e9}, {"volts": -1.0}, {"hz": math.nan}, {"hz": 1e9}, {"time_s": 0.5},
        {"time_s": math.nan}, {"position_m": math.inf}, {"position_m": 1e9}, {"speed_m_s": math.nan},
    ):  # fmt: skip
        tally.ask(lambda wrong=wrong: asked(**wrong), must_refuse=True)
    for fair in ({"volts": 5e-324}, {"position_m": 5e-324}, {"speed_m_s": -1e-300}, {"position_m": -10.0}):
        tally.ask(lambda fair=fair: asked(**fair))
    return tally.row()


def _edge_cases(level: str, count: int, seed: int) -> StressRow:
    tally = Tally("brake", level, "steps of amplitude, 1 to 100 Hz, fast and stiff pulls", "N", FORCE_N[level])
    for case in brake_cases("edge", count, seed + 1000):
        tally.ask(lambda case=case: float(np.sqrt(np.mean((play(case, level).tension_n - _true(case).tension_n) ** 2))))
    return tally.row()


def _energy(friction: str, count: int, seed: int) -> StressRow:
    """A finger let go against a brake that holds: kinetic and elastic energy never grow from step to step."""
    tally = Tally("brake", "dynamic", f"energy of a finger let go, {friction}", "J", 1e-12, "any stiffness, mass and step")
    rng = np.random.default_rng([seed, 3])
    for _ in range(4 * count):
        finger = FINGER.with_values(
            finger_mass_kg=float(10.0 ** rng.uniform(-3.5, 0.5)),
            load_stiffness_n_m=float(10.0 ** rng.uniform(1.0, 5.4)),
            strip_stiffness_n_m=float(10.0 ** rng.uniform(2.0, 6.0)),
            damping_n_s_m=0.0,
            load_damping_n_s_m=0.0,
            slack_m=0.0,
        )
        step_s = float(10.0 ** rng.uniform(-6.0, -1.0))
        tally.ask(lambda finger=finger, step_s=step_s: _grows(finger, step_s, friction))
    return tally.row()


def _grows(finger: FingerParameters, step_s: float, friction: str) -> float:
    """Largest growth of energy over 200 steps, less what the hand's first jump put in."""
    bank = BrakeBank(1, "dynamic", BrakeSystem(finger=finger), step_s=step_s, friction=friction)
    bank.move(5e-3)
    bank.step(1)
    largest = 0.0
    before = math.inf
    for _ in range(200):
        y0 = float(bank.finger_m[0])
        bank.step(1)
        y, tension_n = float(bank.finger_m[0]), float(bank.tension_n[0])
        speed = (y - y0) / step_s
        energy = 0.5 * finger.finger_mass_kg * speed**2 + 0.5 * finger.load_stiffness_n_m * (5e-3 - y) ** 2
        energy += 0.5 * tension_n**2 / finger.strip_stiffness_n_m
        if before < math.inf:
            largest = max(largest, energy - before - 1e-9 * before)
        before = energy
    return largest if math.isfinite(before) else math.inf


def _many(level: str) -> StressRow:
    """1 to 64 clutches at once behave as each would alone."""
    tally = Tally("brake", level, "1 to 64 clutches at once", "N", 1e-12)
    for count in (1, 7, 64):

        def question(count: int = count) -> float:
            volts = np.linspace(300.0, 1500.0, count)
            together = BrakeBank(count, level)
            together.drive(volts, 10.0)
            together.move(0.0, 5e-3)
            together.step(300)
            alone = []
            for one_v in volts[:: max(1, count // 7)]:
                bank = BrakeBank(1, level)
                bank.drive(float(one_v), 10.0)
                bank.move(0.0, 5e-3)
                bank.step(300)
                alone.append(float(bank.tension_n[0]))
            found = together.tension_n[:: max(1, count // 7)]
            if not np.isfinite(together.tension_n).all():
                raise ArithmeticError("a clutch among many is not finite")
            return float(np.max(np.abs(found - alone)))

        tally.ask(question)
    return tally.row()

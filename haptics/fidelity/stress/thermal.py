"""Heat at its extremes: microseconds to years, drift over many steps, coarse floats, clocks that step back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from haptics.fidelity.stress.tally import StressRow, Tally
from haptics.physics.thermal.one_node import PULSE_POWER_W, THERMAL, relax
from haptics.physics.thermal.plant import LEVELS, ThermalPlant, thermal_plant
from haptics.physics.thermal.two_node import TWO_NODE

YEAR_S = 365.25 * 86400.0


def stress_thermal(quick: bool, seed: int) -> list[StressRow]:
    """All extremes of both levels.

    :param quick: True: fewer and shorter runs.
    :param seed: of drawn cases.
    :return: a row for each extreme.
    """
    rows: list[StressRow] = []
    for level in LEVELS:
        rows += [_any_step(level), _cut_at_random(level, 1_000 if quick else 20_000, seed), _nonsense(level)]
    return [*rows, _drift(10**5 if quick else 10**6), _coarse_floats()]


def _matrix(level: str, dt_s: float, power_w: float) -> float:
    """The body's rise after one step from the room's temperature, by scipy's exponential of the network's matrix."""
    from scipy.linalg import expm

    if level == "exact":
        flow, heat = np.array([[-1.0 / THERMAL.tau_s]]), np.array([THERMAL.c_k_per_w * power_w / THERMAL.tau_s])
    else:
        p = TWO_NODE
        flow = np.array(
            [
                [-p.coupling_w_per_k / p.coil_j_per_k, p.coupling_w_per_k / p.coil_j_per_k],
                [p.coupling_w_per_k / p.body_j_per_k, -(p.coupling_w_per_k + 1.0 / p.c_k_per_w) / p.body_j_per_k],
            ]
        )
        heat = np.array([power_w / p.coil_j_per_k, 0.0])
    size = len(heat)
    both = np.zeros((size + 1, size + 1))
    both[:size, :size], both[:size, size] = flow, heat
    return float(expm(both * dt_s)[size - 1, size])


def _any_step(level: str) -> StressRow:
    tally = Tally("thermal", level, "one step of 1 us to 100 years", "%", 1e-6)
    for dt_s in np.geomspace(1e-6, 100.0 * YEAR_S, 40):

        def question(dt_s: float = float(dt_s)) -> float:
            plant = thermal_plant(level)
            plant.advance(dt_s, 0.36)
            # Past a thousand time constants nothing changes, and the matrix would only square its rounding.
            exact = _matrix(level, min(dt_s, 1e3 * THERMAL.tau_s), 0.36)
            return 100.0 * abs(plant.rise_k / exact - 1.0)

        tally.ask(question)
    return tally.row()


def _cut_at_random(level: str, steps: int, seed: int) -> StressRow:
    """Steps over ten orders of size lead where one step does."""
    tally = Tally("thermal", level, f"{steps} steps of 1 us to 1 h, cut at random", "K", 1e-9)
    lengths_s = 10.0 ** np.random.default_rng(seed).uniform(-6.0, 3.5, steps)

    def question() -> float:
        cut, whole = thermal_plant(level), thermal_plant(level)
        for dt_s in lengths_s.tolist():
            cut.advance(dt_s, 0.36)
        whole.advance(float(lengths_s.sum()), 0.36)
        return abs(cut.rise_k - whole.rise_k)

    tally.ask(question)
    return tally.row()


def _nonsense(level: str) -> StressRow:
    tally = Tally(
        "thermal", level, "NaN, infinite, backward; subnormal and huge", "K", 1e300, "a clock that stepped back does not cool"
    )

    def advanced(dt_s: float, power_w: float) -> float:
        plant: ThermalPlant = thermal_plant(level)
        plant.advance(10.0, 1.0)
        before_k = plant.rise_k
        plant.advance(dt_s, power_w)
        cooled = dt_s <= 0.0 and plant.rise_k < before_k
        return math.nan if cooled or not math.isfinite(plant.rise_k) else abs(plant.rise_k)

    for dt_s, power_w in ((-1e-9, 0.0), (math.nan, 1.0), (math.inf, 1.0), (1.0, -1.0), (1.0, math.nan), (1.0, math.inf)):
        tally.ask(lambda dt_s=dt_s, power_w=power_w: advanced(dt_s, power_w), must_refuse=True)
    for dt_s, power_w in ((0.0, 0.0), (5e-324, 1.0), (1.0, 5e-324), (1e308, 1.0), (1.0, 1e300), (1e-300, 1e-300)):
        tally.ask(lambda dt_s=dt_s, power_w=power_w: advanced(dt_s, power_w))
    return tally.row()


def _drift(steps: int) -> StressRow:
    """Many exact steps against the closed form; a billion of them are walked by the long tests."""
    tally = Tally("thermal", "exact", f"drift over {steps:.0e} steps of 1 ms", "K", 1e-9)

    def question() -> float:
        rise_k, dt_s = 0.0, 1e-3
        for _ in range(steps):
            rise_k = relax(rise_k, 0.36, dt_s)
        return abs(rise_k - relax(0.0, 0.36, steps * dt_s))

    tally.ask(question)
    return tally.row()


def _coarse_floats() -> StressRow:
    """A state in single precision would stick: steps of 1 us change it by less than it can hold. It is not offered."""
    tally = Tally(
        "thermal", "exact", "state in float32", "K", 0.0, "float32 is not offered: in steps of 1 us it sticks at 4.0 of 15.5 K"
    )
    coarse: Any = np.float32(4.0)
    tally.ask(lambda: relax(coarse, PULSE_POWER_W, 1e-6), must_refuse=True)
    return tally.row()

"""Levels of heat compared.

*typical*: trains of 10 ms switches at up to 2 Hz, then cooling. The published curve does not distinguish one node from two, so
here the one node, advanced exactly from event to event, is compared with a general solver on the same equation. *edge*: a coil
that stays on. There two nodes are the reference, and the error is what one temperature hides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptics.physics.thermal.one_node import PULSE_POWER_W, PULSE_S, THERMAL
from haptics.physics.thermal.plant import thermal_plant


@dataclass(frozen=True)
class ThermalCase:
    """Stretches of constant power from the room's temperature.

    :param kind: typical or edge.
    :param stretches: (seconds, watts) of each.
    """

    kind: str
    stretches: tuple[tuple[float, float], ...]


def thermal_cases(kind: str, count: int, seed: int = 1) -> list[ThermalCase]:
    """Draw cases; the same for the same seed.

    :param kind: typical or edge.
    :param count: how many.
    :param seed: of the draw.
    :return: the cases.
    """
    rng = np.random.default_rng([seed, kind == "edge"])
    return [ThermalCase(kind, _stuck(rng) if kind == "edge" else _train(rng)) for _ in range(count)]


def errors(case: ThermalCase, level: str) -> dict[str, float]:
    """Largest error at the stretches' ends.

    :param case: what to run.
    :param level: exact or two_node.
    :return: by observable (K).
    """
    if case.kind == "typical":
        return {"temperature": _against_a_solver(case, level)}
    tried, true = thermal_plant(level), thermal_plant("two_node")
    body_k = coil_k = 0.0
    for dt_s, power_w in case.stretches:
        tried.advance(dt_s, power_w)
        true.advance(dt_s, power_w)
        body_k = max(body_k, abs(tried.rise_k - true.rise_k))
        coil_k = max(coil_k, abs(tried.coil_rise_k - true.coil_rise_k))
    return {"temperature": body_k, "coil temperature": coil_k}


def _against_a_solver(case: ThermalCase, level: str) -> float:
    """The level against DOP853 on its own equations: one node, or two by their matrix."""
    from scipy.integrate import solve_ivp

    from haptics.physics.thermal.two_node import TWO_NODE as P

    tried, worst_k = thermal_plant(level), 0.0
    state = np.zeros(1 if level == "exact" else 2)
    for dt_s, power_w in case.stretches:

        def warming(_: float, rise: np.ndarray, power_w: float = power_w) -> list[float]:
            if level == "exact":
                return [(THERMAL.c_k_per_w * power_w - rise[0]) / THERMAL.tau_s]
            through_w = P.coupling_w_per_k * (rise[0] - rise[1])
            return [(power_w - through_w) / P.coil_j_per_k, (through_w - rise[1] / P.c_k_per_w) / P.body_j_per_k]

        state = solve_ivp(warming, (0.0, dt_s), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        tried.advance(dt_s, power_w)
        worst_k = max(worst_k, abs(tried.rise_k - float(state[-1])))
    return worst_k


def _train(rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    period_s = 1.0 / float(rng.uniform(0.5, 2.0))
    switches = int(rng.integers(1, 40))
    switch = ((PULSE_S, PULSE_POWER_W), (period_s - PULSE_S, 0.0))
    return (*(switch * switches), (float(rng.uniform(0.0, 120.0)), 0.0))


def _stuck(rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    return (float(rng.uniform(0.1, 2.0)), PULSE_POWER_W), (float(rng.uniform(0.0, 60.0)), 0.0)

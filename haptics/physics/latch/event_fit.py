"""The constants of level ``event`` for any parameter set, by asking the equation of motion.

Travel time and shortest pulse are asked of level ``table`` at six voltages and put into the form ``T5 ((5 - V0)/(V - V0))^q`` by
least squares; impact and leaving are those at 5 V. The time in which a coasting pin leaves the watershed follows from the slope
of the force there: ``m / tau^2 + b / tau = dF/dx``.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, cast

from haptics.errors import InputError
from haptics.physics.latch.parameters import NOMINAL_VOLTS, LatchParameters
from haptics.physics.latch.plant import LatchEvent
from haptics.physics.latch.table import TableLatch, watershed_m
from haptics.physics.latch.travel import FITTED_V, TravelTable

_LONGEST_S = 50e-3
_VOLTS = 6
_FAITHFUL = 0.01
"""Maximum relative error of a time over ``FITTED_V`` with which the form is used; 0.004 for the published tactor."""


@lru_cache(maxsize=32)
def fit_travel(parameters: LatchParameters) -> TravelTable:
    """Travel and thresholds of both directions over ``FITTED_V``, each time within 1 % of the equation of motion's.

    :param parameters: of the tactor.
    :return: constants of both directions.
    :raises InputError: this tactor does not switch all over that range in either direction, or not in that form.
    """
    values: dict[str, float] = {}
    for side in ("on", "off"):
        travel = [(volts, _travel_s(parameters, side, volts)) for volts in _range()]
        if any(math.isinf(time_s) for _, time_s in travel):
            raise InputError(
                f"level event cannot describe {parameters}: to {side}, it does not switch all over "
                f"{FITTED_V[0]:g} to {FITTED_V[1]:g} V; use level table, dynamic or reference"
            )
        shortest = [(volts, _min_s(parameters, side, volts)) for volts in _range()]
        for name, points in (("travel", travel), ("min", shortest)):
            at_nominal_s, zero_v, power, error = _fit(points)
            if error > _FAITHFUL:
                raise InputError(
                    f"level event cannot describe {parameters}: {name} to {side} strays by {100 * error:.2g} % from its form; "
                    "use level table, dynamic or reference"
                )
            values |= {f"{side}_{name}_s": at_nominal_s, f"{side}_{name}_zero_v": zero_v, f"{side}_{name}_power": power}
        events = _flight(parameters, side, NOMINAL_VOLTS, _LONGEST_S)
        arrived = next(event for event in events if event.kind == _arrival(side))
        left = next((event.time_s for event in events if event.kind == "left_skin"), 0.0)
        values |= {f"{side}_impact_m_s": abs(arrived.speed_m_s), f"{side}_min_v": _min_v(parameters, side)}
        values[f"{side}_escape_s"] = _escape_s(parameters)
        if side == "off":
            values["off_leave_fraction"] = left / arrived.time_s
    return TravelTable(**values)


def _range() -> list[float]:
    low, high = FITTED_V
    return [low + (high - low) * k / (_VOLTS - 1) for k in range(_VOLTS)]


def _arrival(side: str) -> str:
    return "reached_skin" if side == "on" else "reached_off"


def _flight(parameters: LatchParameters, side: str, volts: float, pulse_s: float) -> list[LatchEvent]:
    toward_on = side == "on"
    plant = TableLatch(parameters, "off" if toward_on else "on")
    plant.drive(0.0, volts if toward_on else -volts)
    plant.drive(pulse_s, 0.0)
    plant.advance(pulse_s + 0.2)
    return plant.take_events()


def _travel_s(parameters: LatchParameters, side: str, volts: float) -> float:
    events = _flight(parameters, side, volts, _LONGEST_S)
    return next((event.time_s for event in events if event.kind == _arrival(side)), math.inf)


def _min_s(parameters: LatchParameters, side: str, volts: float) -> float:
    low, high = 0.0, _travel_s(parameters, side, volts)
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        switches = any(event.kind == _arrival(side) for event in _flight(parameters, side, volts, middle))
        low, high = (low, middle) if switches else (middle, high)
    return high


def _min_v(parameters: LatchParameters, side: str) -> float:
    low, high = 0.0, FITTED_V[0]
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.isinf(_travel_s(parameters, side, middle)) else (low, middle)
    return high


def _fit(points: list[tuple[float, float]]) -> tuple[float, float, float, float]:
    """Time at 5 V, V0, q, and the maximum relative error; infinite where times are too short or long to be a pin's."""
    import numpy as np
    from scipy.optimize import least_squares  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

    volts, times_s = np.array(points).T
    if not (times_s.min() > 1e-6 and times_s.max() < 1.0):
        return 0.0, 0.0, 0.0, math.inf

    def residuals(z: np.ndarray) -> np.ndarray:
        at_nominal_s, zero_v, power = z
        return np.log(at_nominal_s) + power * np.log((NOMINAL_VOLTS - zero_v) / (volts - zero_v)) - np.log(times_s)

    start = (float(cast(Any, np.interp(NOMINAL_VOLTS, volts, times_s))), 0.4 * FITTED_V[0], 0.7)
    bounds = ([1e-6, 0.0, 0.01], [1.0, 0.98 * FITTED_V[0], 3.0])
    found = cast(Any, least_squares(residuals, start, bounds=bounds, x_scale=(1e-3, 1.0, 0.1)))
    return float(found.x[0]), float(found.x[1]), float(found.x[2]), float(np.max(np.abs(found.fun)))


def _escape_s(p: LatchParameters) -> float:
    x = watershed_m(p)
    u_on, u_off = 1.0 + (p.stroke_m - x) / p.plate_length_m, 1.0 + x / p.plate_length_m
    pull = p.hold_on_n * u_on ** (-p.plate_power - 1.0) + p.hold_off_n * u_off ** (-p.plate_power - 1.0)
    slope = p.plate_power / p.plate_length_m * pull
    if slope <= 0.0:
        raise InputError(
            f"level event cannot describe {p}: between its plates nothing pulls in either direction; "
            "use level table, dynamic or reference"
        )
    rate = (-p.drag_n_s_m + math.sqrt(p.drag_n_s_m**2 + 4.0 * p.mass_kg * slope)) / (2.0 * p.mass_kg)
    return 1.0 / rate

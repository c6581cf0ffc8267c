"""One actuator's heat carried through time: one interface, two levels.

``exact`` is one node (``thermal.relax``), enough for budgets and for switching; ``two_node`` tells the coil from the body
(``two_node``), for a coil that stays on. Both are exact at any step under constant power.
"""

from __future__ import annotations

import math
from typing import Protocol

from haptics.errors import InputError
from haptics.physics.thermal.one_node import THERMAL, ThermalParameters, relax
from haptics.physics.thermal.two_node import TWO_NODE, TwoNodeHeat, TwoNodeParameters
from haptics.units import in_range, one_of

LEVELS: tuple[str, ...] = ("exact", "two_node")


class ThermalPlant(Protocol):
    """An actuator that warms and cools. Its state is float64, whatever precision power and step come in."""

    def advance(self, dt_s: float, power_w: float) -> None:
        """Carry it over ``dt_s`` (s, >= 0) at mean power ``power_w`` (W, >= 0).

        :raises InputError: a negative step or power, or anything not finite; nothing has changed then, so that a clock which
            stepped back does not cool the actuator.
        """
        ...

    @property
    def rise_k(self) -> float:
        """The body's rise above the room (K)."""
        ...

    @property
    def coil_rise_k(self) -> float:
        """The coil's rise above the room (K); the body's where the level does not tell them apart."""
        ...


class OneNodeHeat:
    """The first-order body of ``thermal``: coil and body are one.

    :param rise_k: rise at the start (K). :raises InputError: a rise that is not finite.
    """

    def __init__(self, parameters: ThermalParameters = THERMAL, rise_k: float = 0.0) -> None:
        self.parameters = parameters
        self._rise_k = in_range("rise_k", rise_k, -math.inf, math.inf, "K")

    def advance(self, dt_s: float, power_w: float) -> None:
        """See ``ThermalPlant.advance``."""
        self._rise_k = relax(self._rise_k, power_w, dt_s, self.parameters)

    @property
    def rise_k(self) -> float:
        """Rise above the room."""
        return self._rise_k

    @property
    def coil_rise_k(self) -> float:
        """The same rise: this level has one temperature."""
        return self._rise_k


def thermal_plant(
    level: str = "exact",
    parameters: ThermalParameters | TwoNodeParameters | None = None,
    *,
    rise_k: float = 0.0,
) -> ThermalPlant:
    """An actuator at one temperature, ``rise_k`` above the room.

    :param level: one of ``LEVELS``. :param parameters: the level's own kind; the published device if None.
    :raises InputError: an unknown level, parameters of the other level, or a rise that is not finite.
    """
    if one_of("level", level, LEVELS) == "exact":
        chosen = THERMAL if parameters is None else parameters
        if not isinstance(chosen, ThermalParameters):
            raise InputError(f"parameters of level 'exact' are {type(chosen).__name__}; allowed: ThermalParameters")
        return OneNodeHeat(chosen, rise_k)
    chosen = TWO_NODE if parameters is None else parameters
    if not isinstance(chosen, TwoNodeParameters):
        raise InputError(f"parameters of level 'two_node' are {type(chosen).__name__}; allowed: TwoNodeParameters")
    return TwoNodeHeat(chosen, rise_k)

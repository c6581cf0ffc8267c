"""One tactor's heat carried through time: one interface, two levels.

``exact`` is one node (``thermal.relax``), enough for budgets and for switching; ``two_node`` separates the coil from the body
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
    """A tactor that warms and cools. Its state is float64, whatever precision power and step come in."""

    def advance(self, dt_s: float, power_w: float) -> None:
        """Carry the tactor over a step at constant power.

        :param dt_s: step (s), 0 or more.
        :param power_w: mean power over the step (W), 0 or more.
        :raises InputError: a negative step or power, or anything not finite; nothing has changed then, so that a clock which
            stepped back does not cool the tactor.
        """
        ...

    @property
    def rise_k(self) -> float:
        """The body's rise above the room (K)."""
        ...

    @property
    def coil_rise_k(self) -> float:
        """The coil's rise above the room (K); the body's where the level has one temperature."""
        ...


class OneNodeHeat:
    """The first-order body of ``thermal``: coil and body are one.

    :param parameters: of the body.
    :param rise_k: rise at the start (K).
    :raises InputError: a rise that is not finite.
    """

    def __init__(self, parameters: ThermalParameters = THERMAL, rise_k: float = 0.0) -> None:
        self.parameters = parameters
        self._rise_k = in_range("rise_k", rise_k, -math.inf, math.inf, "K")

    def advance(self, dt_s: float, power_w: float) -> None:
        """See ``ThermalPlant.advance``.

        :param dt_s: step (s), 0 or more.
        :param power_w: mean power over the step (W), 0 or more.
        :raises InputError: a negative step or power, or anything not finite.
        """
        self._rise_k = relax(self._rise_k, power_w, dt_s, self.parameters)

    @property
    def rise_k(self) -> float:
        """Rise above the room (K)."""
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
    """A tactor at one temperature, coil and body alike.

    :param level: one of ``LEVELS``.
    :param parameters: the level's own kind; the published device if None.
    :param rise_k: rise above the room at first (K).
    :return: a plant of that level.
    :raises InputError: an unknown level, parameters of the other level, or a rise that is not finite.
    """
    if one_of("level", level, LEVELS) == "exact":
        chosen = THERMAL if parameters is None else parameters
        if not isinstance(chosen, ThermalParameters):
            raise InputError(f"parameters of level 'exact' are {type(chosen).__name__}; expected ThermalParameters")
        return OneNodeHeat(chosen, rise_k)
    chosen = TWO_NODE if parameters is None else parameters
    if not isinstance(chosen, TwoNodeParameters):
        raise InputError(f"parameters of level 'two_node' are {type(chosen).__name__}; expected TwoNodeParameters")
    return TwoNodeHeat(chosen, rise_k)

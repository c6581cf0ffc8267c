"""Travel times and shortest pulses of level ``event``, as functions of voltage: ``T5 ((5 - V0)/(V - V0))^q``."""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.physics.fitted import ROUNDING, refuse_outside
from haptics.physics.latch.parameters import NOMINAL_VOLTS
from haptics.physics.parameters import Parameters, parameter

FITTED_V = (3.75, 5.5)
"""Min and max volts, at nominal resistance, over which the constants are fitted."""
_FROM = "level dynamic, 3.75 to 5.5 V"


@dataclass(frozen=True)
class TravelTable(Parameters):
    """Travel and threshold of both directions. ``on``: off to on, toward the skin; ``off``: on to off.

    Of each direction ``travel`` and ``min`` (the shortest pulse) have a time at 5 V, ``zero_v`` and ``power`` of the form above;
    below ``min_v`` nothing switches. ``off_leave_fraction`` is the share of the travel to off after which the skin is left.
    """

    on_travel_s: float = parameter(4.8561e-3, "s", "identified", _FROM, low=1e-5, high=1.0)
    on_travel_zero_v: float = parameter(1.2690, "V", "identified", _FROM, low=0.0, high=4.9)
    on_travel_power: float = parameter(0.68737, "1", "identified", _FROM, low=0.0, high=3.0)
    on_min_s: float = parameter(2.2022e-3, "s", "identified", _FROM, low=1e-6, high=1.0)
    on_min_zero_v: float = parameter(1.2804, "V", "identified", _FROM, low=0.0, high=4.9)
    on_min_power: float = parameter(0.95509, "1", "identified", _FROM, low=0.0, high=3.0)
    on_escape_s: float = parameter(4.86e-3, "s", "identified", _FROM, low=1e-5, high=1.0)
    on_min_v: float = parameter(2.00, "V", "identified", "level dynamic, endless pulse", low=0.0, high=5.0)
    on_impact_m_s: float = parameter(0.755, "m/s", "identified", _FROM, low=0.0, high=100.0)
    off_travel_s: float = parameter(6.0000e-3, "s", "stated", "thesis 3.4.5, Fig 3.3", low=1e-5, high=1.0)
    off_travel_zero_v: float = parameter(2.8357, "V", "identified", _FROM, low=0.0, high=4.9)
    off_travel_power: float = parameter(0.55980, "1", "identified", _FROM, low=0.0, high=3.0)
    off_min_s: float = parameter(3.8621e-3, "s", "identified", _FROM, low=1e-6, high=1.0)
    off_min_zero_v: float = parameter(2.7942, "V", "identified", _FROM, low=0.0, high=4.9)
    off_min_power: float = parameter(0.74024, "1", "identified", _FROM, low=0.0, high=3.0)
    off_escape_s: float = parameter(4.5e-3, "s", "identified", _FROM, low=1e-5, high=1.0)
    off_min_v: float = parameter(3.29, "V", "identified", "level dynamic, endless pulse", low=0.0, high=5.0)
    off_impact_m_s: float = parameter(0.663, "m/s", "identified", _FROM, low=0.0, high=100.0)
    off_leave_fraction: float = parameter(0.168, "1", "identified", _FROM, low=0.0, high=1.0)

    def travel_s(self, toward_on: bool, volts: float, *, extrapolate: bool = False) -> float:
        """Travel time under volts that last until arrival.

        :param toward_on: True: toward the skin.
        :param volts: magnitude (V) at nominal resistance, 3.75 to 5.5.
        :param extrapolate: True: answer for other volts too.
        :return: time (s) from the pulse's beginning; infinite if the volts are too weak.
        :raises InputError: volts that switch, outside ``FITTED_V``, without ``extrapolate``.
        """
        if toward_on:
            found_s = _scaled(self.on_travel_s, self.on_travel_zero_v, self.on_travel_power, volts, self.on_min_v)
        else:
            found_s = _scaled(self.off_travel_s, self.off_travel_zero_v, self.off_travel_power, volts, self.off_min_v)
        return found_s if extrapolate else _inside(volts, found_s)

    def min_s(self, toward_on: bool, volts: float, *, extrapolate: bool = False) -> float:
        """Length of the shortest pulse that switches.

        :param toward_on: as ``travel_s``.
        :param volts: as ``travel_s``.
        :param extrapolate: as ``travel_s``.
        :return: length (s); infinite if no pulse switches.
        :raises InputError: as ``travel_s``.
        """
        if toward_on:
            found_s = _scaled(self.on_min_s, self.on_min_zero_v, self.on_min_power, volts, self.on_min_v)
        else:
            found_s = _scaled(self.off_min_s, self.off_min_zero_v, self.off_min_power, volts, self.off_min_v)
        return found_s if extrapolate else _inside(volts, found_s)


def outside_fit(volts: float) -> tuple[str, ...]:
    """What about a voltage lies outside ``FITTED_V``.

    :param volts: magnitude (V) at nominal resistance.
    :return: a sentence, or nothing inside the fit.
    """
    low, high = FITTED_V
    if low * (1.0 - ROUNDING) <= volts <= high * (1.0 + ROUNDING):
        return ()
    return (f"{volts:.3g} V at nominal resistance is outside the {low:g} to {high:g} V that level event is fitted over",)


def _inside(volts: float, time_s: float) -> float:
    # That nothing switches is known of weak volts too: the threshold is asked of the equation of motion.
    if math.isfinite(time_s):
        refuse_outside(f"volts = {volts:g} V", outside_fit(volts))
    return time_s


def _scaled(at_nominal_s: float, zero_v: float, power: float, volts: float, min_v: float) -> float:
    if volts <= max(min_v, zero_v):
        return math.inf
    return at_nominal_s * ((NOMINAL_VOLTS - zero_v) / (volts - zero_v)) ** power


TRAVEL = TravelTable()

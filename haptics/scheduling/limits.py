"""How many coils may be on at once, and what a stroke costs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.errors import InputError
from haptics.units import in_range


@dataclass(frozen=True)
class CoilLimits:
    """Settings of the scheduler that are the same for the whole run.

    :param current_limit_a: what the supply may be asked for (A); 12 A is a setting.
    :param coil_current_a: one coil's current at 5 V (A): one number for all, or one each as measured. 3.9 A is the worst of
        1.38 ± 0.1 ohm (thesis 3.4.3).
    :param coil_power_w: V²/R while a coil is on (W): one number for all, or one each; 18 W (thesis 3.4.3).
    :param gap_s: shortest time between one unit's end and the next one's start on the same coil or in the same share of the
        current (s), 0 to 1.
    :raises InputError: a value outside its range.
    """

    current_limit_a: float = 12.0
    coil_current_a: float | tuple[float, ...] = 3.9
    coil_power_w: float | tuple[float, ...] = 18.0
    gap_s: float = 0.0

    def __post_init__(self) -> None:
        in_range("current_limit_a", self.current_limit_a, 0.0, math.inf, "A")
        for current_a in _each(self.coil_current_a):
            in_range("coil_current_a", current_a, 1e-3, math.inf, "A")
        for power_w in _each(self.coil_power_w):
            in_range("coil_power_w", power_w, 0.0, math.inf, "W")
        in_range("gap_s", self.gap_s, 0.0, 1.0, "s")

    @property
    def coils_at_once(self) -> int:
        """``floor(current limit / worst coil's current)``: any that many coils stay within the limit."""
        return math.floor(self.current_limit_a / max(_each(self.coil_current_a)) + 1e-9)

    def power_w(self, channels: int) -> tuple[float, ...]:
        """Power of each coil.

        :param channels: number of coils.
        :return: watts, one value a coil.
        :raises InputError: the number of powers given is not ``channels``.
        """
        return _one_a_channel("coil_power_w", self.coil_power_w, channels)

    def current_a(self, channels: int) -> tuple[float, ...]:
        """Current of each coil.

        :param channels: number of coils.
        :return: amperes, one value a coil.
        :raises InputError: the number of currents given is not ``channels``.
        """
        return _one_a_channel("coil_current_a", self.coil_current_a, channels)


def _one_a_channel(name: str, values: float | tuple[float, ...], channels: int) -> tuple[float, ...]:
    if isinstance(values, tuple) and len(values) != channels:
        raise InputError(f"{name} has {len(values)} values; expected 1, or {channels}, one a channel")
    return values if isinstance(values, tuple) else (values,) * channels


def _each(values: float | tuple[float, ...]) -> tuple[float, ...]:
    return values if isinstance(values, tuple) else (values,)

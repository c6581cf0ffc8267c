"""What the coil board's CPU is wired to: drivers and feed by one output word, and two senses (docs/reference/boards.md).

The hardware is ``Actuators``, as for the Python board: the same options and seed make the same plant.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from firmware_models.plants.tactiles_plant import Actuators
from haptics.errors import InputError
from haptics.link.messages import COIL_CHANNELS

FEED = 1 << 15
_TOWARD_SKIN = 16  # bit of channel 0's direction
_SUPPLY, _CURRENT = range(2)
_SUPPLY_V_PER_COUNT = 10e-3
_CURRENT_A_PER_COUNT = 64e-3
FULL_SCALE = 1023


def count(value: float, per_count: float) -> int:
    """What a converter makes of a value.

    :param value: what is measured.
    :param per_count: how much of it a count is worth, above 0; the same unit.
    :return: the nearest count, 0 to 1023.
    """
    return min(max(round(value / per_count), 0), FULL_SCALE)


class CoilPins:
    """Drivers, feed and senses around the plant. Times are world nanoseconds and never go back.

    :param options: values of ``tactiles_plant.PLANT_OPTIONS`` and ``spread``.
    :param rng: the plant's own.
    :param start_ns: world time of power-on, ns.
    """

    interlock_closed = True
    """There is no lid."""

    def __init__(self, options: Mapping[str, Any], rng: np.random.Generator, start_ns: int):
        self.plant = Actuators(options, rng, start_ns, fed=False)
        self._word = 0

    def outputs(self, word: int, time_ns: int) -> None:
        """The outputs are ``word`` from ``time_ns`` on.

        :param word: drivers, directions and feed, 32 bits (docs/reference/boards.md).
        :param time_ns: world time, ns.
        """
        before, self._word = self._word, word
        signs = {channel: _sign(word, channel) for channel in range(COIL_CHANNELS)}
        changes = {channel: sign for channel, sign in signs.items() if sign != _sign(before, channel)}
        if changes:
            self.plant.switch(changes, time_ns)
        if (word ^ before) & FEED:
            self.plant.feed(bool(word & FEED), time_ns)

    def off(self, time_ns: int) -> None:
        """The CPU is in reset: nothing is driven, nothing is fed.

        :param time_ns: world time, ns.
        """
        self.outputs(0, time_ns)

    def counts(self, sense: int, time_ns: int) -> int:
        """One analogue input now.

        :param sense: 0 for the supply (10 mV a count), 1 for the current (64 mA a count).
        :param time_ns: world time, ns.
        :return: counts, 0 to 1023.
        :raises InputError: no such input.
        """
        if sense == _SUPPLY:
            return count(self.plant.volts, _SUPPLY_V_PER_COUNT)
        if sense == _CURRENT:
            return count(self.plant.sensed_current_a(time_ns), _CURRENT_A_PER_COUNT)
        raise InputError(f"input = {sense} is not wired on the coil board; allowed: 0, 1")

    def truth(self, time_ns: int) -> dict[str, Any]:
        """The plant as it is now; see ``Actuators.truth``.

        :param time_ns: world time, ns.
        :return: values by name.
        """
        return self.plant.truth(time_ns)

    def set_load(self, channel: int, time_ns: int, **load: float) -> None:
        """Act on the plant from outside; see ``Actuators.load``.

        :param channel: coil, 0 to 14.
        :param time_ns: world time, ns.
        :param load: what ``Actuators.load`` takes.
        :raises InputError: see ``Actuators.load``.
        """
        self.plant.load(channel, time_ns, **load)

    def energised(self, time_ns: int) -> list[int]:
        """Channels whose coil is on.

        :param time_ns: world time, ns; coils switch at once, so that it does not matter.
        :return: channel numbers, 0 to 14, rising.
        """
        return self.plant.energised


def _sign(word: int, channel: int) -> int:
    """1 toward the skin, -1 back, 0 off."""
    if not word >> channel & 1:
        return 0
    return 1 if word >> (_TOWARD_SKIN + channel) & 1 else -1

"""What the brake controller's CPU is wired to: outputs, bridge, supply and piezos by one output word; senses; the lid.

The hardware is ``Brakes``, as for the Python board: the same options and seed make the same plant. docs/reference/boards.md has
the word's bits and the senses' scales.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from firmware_models.cores.coil_pins import count
from firmware_models.plants.brake_plant import Brakes
from haptics.errors import InputError
from haptics.link.messages import BRAKE_CHANNELS

_ALL = (1 << BRAKE_CHANNELS) - 1
_PIEZOS, _ENABLED, _POSITIVE, _NEGATIVE, _SETPOINT = 5, 10, 11, 12, 16  # bits
_BRIDGE, _LOW, _HIGHEST, _CURRENT, _BUS = range(5, 10)  # inputs, behind those of the outputs
_VOLTS_PER_COUNT = 2.0
_BRIDGE_V_PER_COUNT, _BRIDGE_ZERO = 4.0, 512
_LOW_V_PER_COUNT = 1.0 / 16.0
_AMPS_PER_COUNT = 1e-6


class BrakePins:
    """Switches, supply and dividers around the plant. Times are world nanoseconds and never go back.

    :param options: values of ``plants.brake_plant.PLANT_OPTIONS`` and ``spread``.
    :param rng: the plant's own.
    :param start_ns: world time of power-on, ns.
    """

    def __init__(self, options: Mapping[str, Any], rng: np.random.Generator, start_ns: int):
        self.plant = Brakes(options, rng, start_ns)
        self._word = 0

    @property
    def interlock_closed(self) -> bool:
        """Whether the lid is closed."""
        return not self.plant.lid_open

    def outputs(self, word: int, time_ns: int) -> None:
        """The outputs are ``word`` from ``time_ns`` on.

        :param word: outputs, piezos, bridge and setpoint, 32 bits (docs/reference/boards.md).
        :param time_ns: world time, ns.
        """
        changed, self._word = self._word ^ word, word
        self.plant.set_piezos(word >> _PIEZOS & _ALL, time_ns)
        if not changed & ~(_ALL << _PIEZOS):
            return
        # Both legs of the bridge on would be a short of the supply; the driver takes it for none.
        polarity = (word >> _POSITIVE & 1) - (word >> _NEGATIVE & 1)
        self.plant.pins(word & _ALL, float(word >> _SETPOINT), polarity, bool(word >> _ENABLED & 1), time_ns)

    def off(self, time_ns: int) -> None:
        """The CPU is in reset: outputs shorted, supply off, piezos off.

        :param time_ns: world time, ns.
        """
        self.outputs(0, time_ns)

    def counts(self, sense: int, time_ns: int) -> int:
        """One analogue input now.

        :param sense: number of the input, 0 to 9 (docs/reference/boards.md).
        :param time_ns: world time, ns.
        :return: counts, 0 to 1023.
        :raises InputError: no such input.
        """
        volts, stage = self.plant.volts(time_ns), self.plant.stage
        bridge_v = stage.bridge_v * stage.polarity
        if 0 <= sense < BRAKE_CHANNELS:
            return count(abs(volts[sense]), _VOLTS_PER_COUNT)
        if sense == _BRIDGE:
            return count(bridge_v + _BRIDGE_ZERO * _BRIDGE_V_PER_COUNT, _BRIDGE_V_PER_COUNT)
        if sense == _LOW:
            return count(abs(bridge_v), _LOW_V_PER_COUNT)
        if sense == _HIGHEST:
            return count(self.plant.highest_v(time_ns), _VOLTS_PER_COUNT)
        if sense == _CURRENT:
            return count(self.plant.supply_current_a(), _AMPS_PER_COUNT)
        if sense == _BUS:
            return count(stage.bus_v, _VOLTS_PER_COUNT)
        raise InputError(f"input = {sense} is not wired on the brake controller; must be 0 to {_BUS}")

    def truth(self, time_ns: int) -> dict[str, Any]:
        """The plant as it is now; see ``Brakes.truth``.

        :param time_ns: world time, ns.
        :return: values by name.
        """
        return self.plant.truth(time_ns)

    def set_load(self, channel: int, time_ns: int, **load: float) -> None:
        """Act on the plant from outside; see ``Brakes.load``.

        :param channel: output, 0 to 4.
        :param time_ns: world time, ns.
        :param load: what ``Brakes.load`` takes.
        :raises InputError: see ``Brakes.load``.
        """
        self.plant.load(channel, time_ns, **load)

    def energised(self, time_ns: int) -> list[int]:
        """Outputs that the supply is on, or that have dangerous volts.

        :param time_ns: world time, ns.
        :return: output numbers, 0 to 4, rising.
        """
        return self.plant.energised(time_ns)

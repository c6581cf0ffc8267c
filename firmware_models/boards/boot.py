"""What a simulated board's seed decides: its crystal, its plant, and the clock and the boot id of each power-on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from firmware_models.boards.ticks import TickCounter
from firmware_models.options import Option
from haptics.link.messages import Board

_CRYSTAL_PPM = 50.0

BOARD_OPTIONS: dict[str, Option] = {
    "seed": Option(1, "boot id, clock and plant are drawn from it", low=0, high=2**32 - 1, whole=True),
    "baud": Option(500_000, "what the board's UART is set to", "baud", 300, 4_000_000, whole=True),
    "ppm": Option(None, f"error of the board's crystal; default drawn within {_CRYSTAL_PPM:g}", "ppm", -1000, 1000),
    "tick_offset": Option(None, "tick count at power-on; default drawn", "tick", 0, 2**32 - 1, whole=True),
    "spread": Option(1.0, "how far the plant strays from its nominal parameters; 0: not at all", "", 0, 3),
}


class Boot(NamedTuple):
    """One power-on.

    :param ticks: the board's clock from there on.
    :param boot_id: what ``identity`` reports and ``arm`` must repeat, 1 to 2**32 - 1.
    """

    ticks: TickCounter
    boot_id: int


class Boots:
    """The draws of one board; the same seed gives the same ones, whatever firmware runs.

    ``plant_rng``: of the hardware around the CPU. ``latency_rng``: of how long the firmware takes.

    :param options: values of ``BOARD_OPTIONS``.
    :param kind: which board; boards of two kinds with one seed draw independently.
    """

    def __init__(self, options: Mapping[str, Any], kind: Board):
        clock_seed, latency_seed, plant_seed = np.random.SeedSequence([options["seed"], kind]).spawn(3)
        self._clock = np.random.default_rng(clock_seed)
        self.plant_rng = np.random.default_rng(plant_seed)
        self.latency_rng = np.random.default_rng(latency_seed)
        self._options = options
        self._ppm: float | None = options["ppm"]

    def power_on(self, now_ns: int) -> Boot:
        """The next boot: the crystal stays, the count begins anew.

        :param now_ns: world time of the boot, ns.
        :return: its clock and its id.
        """
        offset, ppm = int(self._clock.integers(2**32)), float(self._clock.uniform(-_CRYSTAL_PPM, _CRYSTAL_PPM))
        boot_id = int(self._clock.integers(1, 2**32))
        if self._ppm is None:
            self._ppm = ppm
        if self._options["tick_offset"] is not None:
            offset = self._options["tick_offset"]
        return Boot(TickCounter(now_ns, offset, self.drift_ppb), boot_id)

    @property
    def drift_ppb(self) -> int:
        """How much faster than nominal the crystal runs, parts in 1e9; drawn, unless it is given, at the first power-on."""
        return round(1000 * (self._ppm or 0.0))

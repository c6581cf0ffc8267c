"""What really happened at a simulated board while a rig ran on it: seen from a second instrument in the same world."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from haptics.link.ports import open_port
from rigs.bench import BenchOptions

_worlds = itertools.count(1)
NOMINAL_SPEED_M_S = 0.6634
"""Of the landing after a nominal switch: ``predict latch`` at level reference."""


class Witness:
    """Stays in the world when the rig has gone. Use as a context manager."""

    def __init__(self, query: str = ""):
        world = f"witness-{next(_worlds)}"
        self.url = f"sim://tactiles?world={world}" + (f"&{query}" if query else "")
        self._port: Any = open_port(f"sim://thermocouple?world={world}&clock=virtual")
        self.switches: list[tuple[int, int]] = []
        """World time and sign of each change at channel 0."""
        self.said: list[tuple[str, int, float]] = []
        """What the rig said, when, and the energy that channel 0 had taken by then."""

    def __enter__(self) -> Witness:
        return self

    def __exit__(self, *_: object) -> None:
        self._port.close()

    def options(self, **more: Any) -> BenchOptions:
        """Options for a rig on the board that is watched."""
        return BenchOptions(port=self.url, progress=self._hear, **more)

    @property
    def plant(self) -> Any:
        return self._port.board.plant()

    @property
    def now_ns(self) -> int:
        return self._port.now_ns

    def landings(self) -> list[tuple[int, float]]:
        """Time and speed of each arrival of channel 0 at the off stop."""
        return [
            (time_ns, abs(speed)) for time_ns, channel, kind, speed in self.plant.events if (channel, kind) == (0, "reached_off")
        ]

    def peaks_g(self) -> np.ndarray:
        """Envelope of each of these landings at its beginning."""
        recoil = self.plant.recoils[0]
        speeds = np.array([speed for _, speed in self.landings()])
        return recoil.peak_g * (speeds / NOMINAL_SPEED_M_S) ** recoil.speed_power

    def travels_s(self) -> np.ndarray:
        """From each start of a pulse back to the landing that followed."""
        landed = np.array([time_ns for time_ns, _ in self.landings()])
        backs = [time_ns for time_ns, sign in self.switches if sign < 0]
        return np.array([landed[np.searchsorted(landed, at_ns)] - at_ns for at_ns in backs if at_ns < landed[-1]]) / 1e9

    def _hear(self, text: str) -> None:
        plant = self.plant
        if not self.said:
            switch = plant.switch

            def watched(changes: dict[int, int], now_ns: int) -> None:
                if 0 in changes:
                    self.switches.append((now_ns, changes[0]))
                switch(changes, now_ns)

            plant.switch = watched
        now_ns = self._port.now_ns
        kept = list(plant.events)
        energy_j = plant.truth(now_ns)["energy_j"][0]  # hands out the events, which are wanted later
        plant.events.extend(kept)
        self.said.append((text, now_ns, energy_j))

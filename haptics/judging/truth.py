"""What the simulated plants did, whatever was asked of them: what everything felt is judged by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS


@dataclass
class Truth:
    """What the simulated plants did, gathered while the session runs.

    ``pins`` and ``brakes``: (time_ns, channel, kind) of what happened, such as ``reached_skin`` or ``half_capacity``;
    ``pin_speeds_m_s`` goes with ``pins``. ``forces_n``: (time_ns, capacity of each output), as sampled. Peaks are of the samples.
    """

    pins: list[tuple[int, int, str]] = field(default_factory=list)
    pin_speeds_m_s: list[float] = field(default_factory=list)
    brakes: list[tuple[int, int, str]] = field(default_factory=list)
    forces_n: list[tuple[int, tuple[float, ...]]] = field(default_factory=list)
    latched: list[str] = field(default_factory=list)
    peak_rise_k: Any = field(default_factory=lambda: np.zeros(COIL_CHANNELS))
    peak_volts: Any = field(default_factory=lambda: np.zeros(BRAKE_CHANNELS))
    peak_force_n: Any = field(default_factory=lambda: np.zeros(BRAKE_CHANNELS))
    energy_j: Any = field(default_factory=lambda: np.zeros(BRAKE_CHANNELS))
    switches: Any = field(default_factory=lambda: np.zeros(COIL_CHANNELS, dtype=int))

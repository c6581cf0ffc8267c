"""What the simulated plants did, whatever was commanded: the reference for all that was felt."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS


@dataclass
class Truth:
    """What the simulated plants did, gathered while the session runs. Peaks are of the samples.

    :param pins: (time_ns, channel, kind) of what a pin did, such as ``reached_skin``.
    :param pin_speeds_m_s: the pin's speed at each entry of ``pins``, m/s.
    :param brakes: (time_ns, channel, kind) of what a brake did, such as ``half_capacity``.
    :param forces_n: (time_ns, blocking force of each output, N), as sampled.
    :param latched: final state of each tactor, ``on`` or ``off``, by channel.
    :param peak_rise_k: (coil channels,), highest temperature rise, K.
    :param peak_volts: (brake channels,), highest voltage, V.
    :param peak_force_n: (brake channels,), highest blocking force, N.
    :param energy_j: (brake channels,), energy drawn, J.
    :param switches: (coil channels,), how often each coil was switched.
    """

    pins: deque[tuple[int, int, str]] = field(default_factory=deque)
    pin_speeds_m_s: deque[float] = field(default_factory=deque)
    brakes: deque[tuple[int, int, str]] = field(default_factory=deque)
    forces_n: deque[tuple[int, tuple[float, ...]]] = field(default_factory=deque)
    latched: list[str] = field(default_factory=list)
    peak_rise_k: NDArray[np.float64] = field(default_factory=lambda: np.zeros(COIL_CHANNELS))
    peak_volts: NDArray[np.float64] = field(default_factory=lambda: np.zeros(BRAKE_CHANNELS))
    peak_force_n: NDArray[np.float64] = field(default_factory=lambda: np.zeros(BRAKE_CHANNELS))
    energy_j: NDArray[np.float64] = field(default_factory=lambda: np.zeros(BRAKE_CHANNELS))
    switches: NDArray[np.int64] = field(default_factory=lambda: np.zeros(COIL_CHANNELS, dtype=int))

    @classmethod
    def keeping(cls, kept: int | None) -> Truth:
        """Nothing gathered yet.

        :param kept: of ``pins``, ``brakes`` and ``forces_n`` the last so many stay; None: all.
        :return: the truth, to gather in.
        """
        return cls(deque(maxlen=kept), deque(maxlen=kept), deque(maxlen=kept), deque(maxlen=kept))

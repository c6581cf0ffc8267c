"""What one brake does when it is closed, pulled at and let go, level ``lagged``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from haptics.physics.brake.lagged import STEP_S
from haptics.physics.brake.levels import brake_plant
from haptics.physics.brake.system import BrakeSystem

FREQUENCY_HZ = 20.0
"""Square wave of the glove (thesis 4.5.2)."""
TIMED_FORCE_N = 10.0
"""Commanded force at which times are taken: the maximum volts, so the longest charge."""
HAND_M_S = 0.1
"""Speed of a closing hand against the brake (assumed)."""
FELT_N = 1.0
"""Tension that counts as felt (assumed)."""
_HELD_S = 0.1
"""In the middle between two reversals of the wave: full volts when the brake is let go."""
_FOLLOWED_S = 0.3


@dataclass(frozen=True)
class Times:
    """Times of one brake. All are nan where it takes longer than 0.1 s (0.3 s for the release).

    :param engage_s: from the drive's start until 90 % of the steady force can be held, s.
    :param felt_s: from the drive's start until a closing hand feels ``FELT_N``, s.
    :param release_s: from the drive's end until a tenth of the held force is left, s.
    """

    engage_s: float
    felt_s: float
    release_s: float


@lru_cache(maxsize=8)  # a host without calibration believes the same of every device
def times(system: BrakeSystem, volts: float) -> Times:
    """Of a brake driven with ``volts``, as they are made, for 0.1 s.

    :param system: brake and drive.
    :param volts: at the output, V.
    :return: the three times.
    """
    plant = brake_plant("lagged", system)
    plant.drive(0.0, 1, volts, FREQUENCY_HZ)
    held_n = []
    for k in range(round(_HELD_S / STEP_S) + 1):
        plant.advance(k * STEP_S)
        held_n.append(plant.capacity_n[0])
    plant.drive(_HELD_S, 0, 0.0, 0.0)
    left_n = [held_n[-1]]
    for k in range(1, round(_FOLLOWED_S / STEP_S) + 1):
        if left_n[-1] <= 0.1 * left_n[0]:
            break
        plant.advance(_HELD_S + k * STEP_S)
        left_n.append(plant.capacity_n[0])
    return Times(
        engage_s=_passes_s(held_n, 0.9 * system.full_force_n(0, volts)),
        felt_s=_felt_s(system, volts),
        release_s=_passes_s([-n for n in left_n], -0.1 * left_n[0]),
    )


def _felt_s(system: BrakeSystem, volts: float) -> float:
    """On a plant of its own: what slides while a brake is let go under load would mix with its release."""
    plant = brake_plant("lagged", system)
    plant.drive(0.0, 1, volts, FREQUENCY_HZ)
    plant.move(0, 0.0, 0.0, HAND_M_S)
    tension_n = [0.0]
    while tension_n[-1] < FELT_N and len(tension_n) * STEP_S <= _HELD_S:
        plant.advance(len(tension_n) * STEP_S)
        tension_n.append(plant.tension_n[0])
    return _passes_s(tension_n, FELT_N)


def _passes_s(samples: Sequence[float], level: float) -> float:
    """When samples first come up to a level, between two of them by a straight line."""
    k = next((k for k, sample in enumerate(samples) if sample >= level), None)
    if k is None:
        return math.nan
    if k == 0:
        return 0.0
    below, above = samples[k - 1], samples[k]
    return STEP_S * (k - 1 + (level - below) / (above - below))

"""What a train of switches does to an actuator when the host decides by what it believes of it.

A train is contact, release, contact, ... evenly spaced. As in the scheduler, a contact is played only if the believed rise, its
own jump and that of one more release stay within the limit; its release then always is (``docs/explanation/schedule.md``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.physics.thermal.one_node import DEFAULT_LIMIT_K, PULSE_S, ThermalParameters, pulse_rise_k
from haptics.physics.thermal.trains import GUARD, train_rise_k


@dataclass(frozen=True, slots=True)
class Train:
    """Contacts of one switch out and one back.

    :param name: for people.
    :param spacing_s: between switches, s.
    :param contacts: in the train.
    """

    name: str
    spacing_s: float
    contacts: int


TWO_HERTZ = Train("2 Hz for 6 min", 0.5, 360)
"""The switching of Fig 3.4 (thesis 3.5.2)."""
THREE_HERTZ = Train("3 Hz for 6 min", 1.0 / 3.0, 540)
"""Half as fast again (assumed): more than the default limit sustains, so that every budget has to deny."""
USE_PER_MIN = 44.0
"""Switches a minute in use (thesis 3.4.3)."""


@dataclass(frozen=True)
class Body:
    """What one tactor's temperature goes by: as it is, or as a host believes it is.

    :param thermal: time constant (s), and rise per power of steady heating (K/W).
    :param power_w: electric power of the coil while it is on, W.
    """

    thermal: ThermalParameters
    power_w: float

    @property
    def jump_k(self) -> float:
        """Rise right after one switch of 10 ms (``PULSE_S``) from cold, K."""
        return pulse_rise_k(self.power_w * PULSE_S, self.thermal)


def peak_rise_k(train: Train, body: Body) -> float:
    """Maximum rise if every switch is played: right after the last one.

    :param train: to play.
    :param body: that is heated.
    :return: K.
    """
    return train_rise_k(body.jump_k, train.spacing_s, 2 * train.contacts - 1, parameters=body.thermal)[0]


def use_rise_k(body: Body) -> float:
    """Maximum rise in steady use, ``J / (1 - exp(-spacing/tau))``.

    :param body: that is heated.
    :return: K.
    """
    return train_rise_k(body.jump_k, 60.0 / USE_PER_MIN, parameters=body.thermal)[0]


@dataclass(frozen=True)
class Played:
    """One train as it was admitted.

    :param contacts: that were admitted.
    :param peak_k: maximum true rise, K.
    """

    contacts: int
    peak_k: float


def played(train: Train, real: Body, believed: Body, limit_k: float = DEFAULT_LIMIT_K) -> Played:
    """The train as a host plays it that believes ``believed`` of an actuator that is ``real``.

    :param train: to play.
    :param real: the actuator.
    :param believed: what the host's heat account assumes of it.
    :param limit_k: of the account, K.
    :return: contacts admitted, and the true rise.
    """
    own_k, own_decay = real.jump_k, math.exp(-train.spacing_s / real.thermal.tau_s)
    host_k, host_decay = believed.jump_k, math.exp(-train.spacing_s / believed.thermal.tau_s)
    within_k = limit_k * (1 + GUARD)
    rise_k = account_k = peak_k = 0.0
    contacts = 0
    for _ in range(train.contacts):
        if account_k + 2.0 * host_k > within_k:
            rise_k *= own_decay**2
            account_k *= host_decay**2
            continue
        contacts += 1
        for _switch in range(2):
            rise_k += own_k
            account_k += host_k
            peak_k = max(peak_k, rise_k)
            rise_k *= own_decay
            account_k *= host_decay
    return Played(contacts, peak_k)

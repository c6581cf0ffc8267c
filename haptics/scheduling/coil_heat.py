"""What one coil's heat account goes by, and how it stands to the account that a board keeps.

A host counts kelvin, a board only seconds of on-time: ``da/dt = u - a / tau_b``, u = 1 while the coil is on
(``docs/reference/protocol.md``). ``limit_k`` and ``on_time_s`` turn one limit into the other so that whatever the host admits the
board admits, too; ``docs/explanation/heat.md`` has the proof.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.physics.thermal.one_node import PULSE_POWER_W, PULSE_S, THERMAL, ThermalParameters
from haptics.units import in_range

BOARD_TAU_S = 102.0
"""Time constant of every board's account."""
BUILT_ON_TIME_S = 2.5
"""Limit that every board is built with; a host may only lower it."""
MARGIN = 0.01
"""Share of a board's limit that a host leaves unused: a board charges a pulse when it takes it, by a clock of its own, and may
hold an account up to 0.1 % too high (``docs/reference/protocol.md``, heat of the coils)."""


@dataclass(frozen=True, slots=True)
class CoilHeat:
    """What one coil's heat account is computed with; the published device if not given.

    :param parameters: of the first-order thermal model (thesis 3.5.2).
    :param power_w: power that a pulse is charged with (W).
    """

    parameters: ThermalParameters = THERMAL
    power_w: float = PULSE_POWER_W

    @property
    def jump_k_per_s(self) -> float:
        """Rise for each second of on-time, ``c P / tau``."""
        return self.parameters.c_k_per_w * self.power_w / self.parameters.tau_s

    def limit_k(self, on_time_s: float) -> float:
        """Largest limit of the rise under which nothing that is admitted takes a board's account above ``on_time_s``.

        ``A c P / max(tau, tau_b)``, with ``MARGIN`` taken off ``A``.

        :param on_time_s: limit ``A`` of the board's account (s), at least one pulse.
        :return: limit of the rise above the room (K).
        :raises InputError: less on-time than one pulse takes.
        """
        in_range("on_time_s", on_time_s, PULSE_S, math.inf, "s")
        return (1.0 - MARGIN) * on_time_s * self.jump_k_per_s * min(1.0, self.parameters.tau_s / BOARD_TAU_S)

    def on_time_s(self, limit_k: float) -> float:
        """Smallest limit of a board's account that admits whatever a host with ``limit_k`` does; inverts ``CoilHeat.limit_k``.

        :param limit_k: the host's limit of the rise above the room (K), above 0.
        :return: on-time (s).
        :raises InputError: a limit that is not above 0.
        """
        in_range("limit_k", limit_k, 1e-9, math.inf, "K")
        return limit_k / ((1.0 - MARGIN) * self.jump_k_per_s * min(1.0, self.parameters.tau_s / BOARD_TAU_S))

    def rise_k(self, account_s: float) -> float:
        """Largest value of this account, had it seen all that led a board's account to ``account_s``.

        ``g a`` (``g = c P / tau``) for ``tau <= tau_b``. A slower body remembers longer: behind ``a`` there is at worst an
        account that was at the limit ``A`` for ever and then left alone, hence ``g A (tau/tau_b) (a/A)^(tau_b/tau)``.

        :param account_s: the board's account ``a`` (s of on-time), at least 0.
        :return: rise above the room (K).
        :raises InputError: a negative account.
        """
        in_range("account_s", account_s, 0.0, math.inf, "s")
        slowness = max(1.0, self.parameters.tau_s / BOARD_TAU_S)
        max_s = max(account_s, BUILT_ON_TIME_S)
        return self.jump_k_per_s * max_s * slowness * (account_s / max_s) ** (1.0 / slowness)

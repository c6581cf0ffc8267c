"""The heat account of one actuator: what it has taken, what it may still take.

First order (thesis 3.5.2): every pulse is a jump of ``E c / tau``, between pulses the rise decays by ``exp(-dt/tau)``. The
account moves only when it is asked or charged, and then exactly, over integer nanoseconds. The closed forms themselves
are those of ``haptics.physics``; here they start from the rise as it is now.

An account is as good as its parameters. With the published ones it is the nominal actuator; with those of ``bounding`` and
the most power a coil can take it is never below the truth of any actuator within tolerance (``CoilHeat``).
"""

from __future__ import annotations

import math

from haptics.errors import InputError
from haptics.physics.thermal.one_node import DEFAULT_LIMIT_K, PULSE_ENERGY_J, THERMAL, ThermalParameters, pulse_rise_k, relax
from haptics.physics.thermal.trains import GUARD, allowed_now, first_denied_index, min_spacing_s, wait_s
from haptics.time import NS_PER_S
from haptics.units import in_range


class ThermalBudget:
    """Rise of one actuator above the room (K) and the room left under its limit.

    ``rise_k``, ``headroom_k`` and ``spend`` set the account's time. All other questions may be asked ahead of time: they answer
    for ``now_ns`` and leave the account where it was.

    A *pulse* below is any lump of ``energy_j``: a switch (0.18 J, the default) or a burst (``burst_energy_j``).

    :param parameters: of the first-order thermal model (thesis 3.5.2); the published ones are the nominal actuator's.
    :param limit_k: largest rise allowed (K), above 0; 25 K is assumed, a setting.
    :param rise_k: rise at ``at_ns`` (K), for an account that goes on from an earlier one.
    :param at_ns: when the account begins (ns).
    :raises InputError: ``limit_k`` not positive, or ``rise_k`` negative.
    """

    def __init__(
        self,
        parameters: ThermalParameters = THERMAL,
        limit_k: float = DEFAULT_LIMIT_K,
        *,
        rise_k: float = 0.0,
        at_ns: int = 0,
    ):
        self.parameters = parameters
        self.limit_k = in_range("limit_k", limit_k, 1e-9, math.inf, "K")
        self.clock_faults = 0
        """How often a time was handed in that lay before one already seen."""
        self.latest_ns = at_ns
        """Latest time seen; the account never goes back before it."""
        self._rise_k = in_range("rise_k", rise_k, 0.0, math.inf, "K")

    def rise_k(self, now_ns: int) -> float:
        """Rise now. A time before the latest one seen counts as a clock fault and cools nothing.

        :param now_ns: the time now (ns).
        :return: kelvin above the room.
        """
        self._rise_k = self._look_ahead(now_ns)
        self.latest_ns = max(self.latest_ns, now_ns)
        return self._rise_k

    def headroom_k(self, now_ns: int) -> float:
        """Rise that is left under the limit.

        :param now_ns: the time now (ns).
        :return: kelvin, 0 where it is used up.
        """
        return max(0.0, self.limit_k - self.rise_k(now_ns))

    def spend(self, energy_j: float, at_ns: int) -> float:
        """Charge energy. Nothing is refused here: ``allows`` asks first.

        :param energy_j: what the actuator took (J), at least 0.
        :param at_ns: when it is charged (ns).
        :return: the rise after it (K).
        :raises InputError: ``energy_j`` negative or not finite; the account is then unchanged.
        """
        jump_k = pulse_rise_k(energy_j, self.parameters)
        self._rise_k = self.rise_k(at_ns) + jump_k
        return self._rise_k

    def raise_to(self, rise_k: float, now_ns: int) -> None:
        """Learn of heat from elsewhere. Never lowers the account.

        :param rise_k: what the rise is at least (K).
        :param now_ns: the time now (ns).
        :raises InputError: ``rise_k`` negative or not finite.
        """
        self._rise_k = max(self.rise_k(now_ns), in_range("rise_k", rise_k, 0.0, math.inf, "K"))

    def allows(self, energy_j: float, now_ns: int, reserve_j: float = 0.0) -> bool:
        """Whether energy may be spent so that a reserve could still be spent right after it.

        :param energy_j: what is to be spent (J), at least 0.
        :param now_ns: when (ns).
        :param reserve_j: what must fit in afterwards (J).
        :return: whether both stay under the limit.
        :raises InputError: the sum is negative or not finite.
        """
        jump_k = pulse_rise_k(energy_j + reserve_j, self.parameters)
        return self._look_ahead(now_ns) + jump_k <= self.limit_k * (1 + GUARD)

    def allowed_now(self, now_ns: int, energy_j: float = PULSE_ENERGY_J) -> int:
        """Pulses allowed at once: ``floor((limit - rise) / jump)``.

        :param now_ns: when (ns).
        :param energy_j: of one pulse (J), above 0.
        :return: how many.
        :raises InputError: ``energy_j`` not above 0.
        """
        return allowed_now(self._look_ahead(now_ns), self._jump_k(energy_j), self.limit_k)

    def allowed_at(self, spacing_s: float, now_ns: int, energy_j: float = PULSE_ENERGY_J) -> int | None:
        """Pulses allowed in a row, one now and one every ``spacing_s``.

        :param spacing_s: time between two pulses (s).
        :param now_ns: when the first one is (ns).
        :param energy_j: of one pulse (J), above 0.
        :return: how many; None if there is no end.
        :raises InputError: ``energy_j`` not above 0.
        """
        return first_denied_index(self._jump_k(energy_j), spacing_s, self.limit_k, self._look_ahead(now_ns), self.parameters)

    def min_spacing_s(self, energy_j: float = PULSE_ENERGY_J) -> float:
        """Shortest spacing that can be sustained, ``-tau ln(1 - jump/limit)``.

        :param energy_j: of one pulse (J), above 0.
        :return: seconds; infinite if one pulse is too many.
        :raises InputError: ``energy_j`` not above 0.
        """
        return min_spacing_s(self._jump_k(energy_j), self.limit_k, self.parameters)

    def wait_s(self, count: int, now_ns: int, energy_j: float = PULSE_ENERGY_J) -> float:
        """Time until some pulses are allowed at once, ``tau ln(rise / (limit - count jump))``.

        :param count: how many.
        :param now_ns: from when (ns).
        :param energy_j: of one pulse (J), above 0.
        :return: seconds, 0 if they are allowed now; infinite if never.
        :raises InputError: ``energy_j`` not above 0.
        """
        return wait_s(self._look_ahead(now_ns), count, self._jump_k(energy_j), self.limit_k, self.parameters)

    def _look_ahead(self, now_ns: int) -> float:
        elapsed_ns = now_ns - self.latest_ns
        if elapsed_ns < 0:
            self.clock_faults += 1
        return self._rise_k if elapsed_ns <= 0 else relax(self._rise_k, 0.0, elapsed_ns / NS_PER_S, self.parameters)

    def _jump_k(self, energy_j: float) -> float:
        if energy_j <= 0:
            raise InputError(f"energy_j = {energy_j:g} J; expected more than 0 J")
        return pulse_rise_k(energy_j, self.parameters)

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

    ``rise_k``, ``headroom_k`` and ``spend`` tell the account what time it is. All other questions may be asked ahead of time:
    they answer for ``now_ns`` and leave the account where it was.

    A *pulse* below is any lump of ``energy_j``: a switch (0.18 J, the default) or a burst (``burst_energy_j``).

    :param limit_k: largest rise allowed; 25 K is assumed, a setting.
    :param rise_k: rise at ``at_ns``, for an account that goes on from an earlier one.
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
        """Rise at ``now_ns``. A time before the latest one seen counts as a clock fault and cools nothing."""
        self._rise_k = self._look_ahead(now_ns)
        self.latest_ns = max(self.latest_ns, now_ns)
        return self._rise_k

    def headroom_k(self, now_ns: int) -> float:
        """Rise that is left under the limit, 0 where it is used up."""
        return max(0.0, self.limit_k - self.rise_k(now_ns))

    def spend(self, energy_j: float, at_ns: int) -> float:
        """Charge ``energy_j`` at ``at_ns``; the rise after it. Nothing is refused here: ``allows`` asks first.

        :raises InputError: ``energy_j`` negative or not finite; the account is then unchanged.
        """
        jump_k = pulse_rise_k(energy_j, self.parameters)
        self._rise_k = self.rise_k(at_ns) + jump_k
        return self._rise_k

    def raise_to(self, rise_k: float, now_ns: int) -> None:
        """Learn of heat from elsewhere: the rise at ``now_ns`` is at least ``rise_k``. Never lowers the account.

        :raises InputError: ``rise_k`` negative or not finite.
        """
        self._rise_k = max(self.rise_k(now_ns), in_range("rise_k", rise_k, 0.0, math.inf, "K"))

    def allows(self, energy_j: float, now_ns: int, reserve_j: float = 0.0) -> bool:
        """Whether ``energy_j`` may be spent at ``now_ns`` so that ``reserve_j`` could still be spent right after it."""
        jump_k = pulse_rise_k(energy_j + reserve_j, self.parameters)
        return self._look_ahead(now_ns) + jump_k <= self.limit_k * (1 + GUARD)

    def allowed_now(self, now_ns: int, energy_j: float = PULSE_ENERGY_J) -> int:
        """Pulses allowed at once: ``floor((limit - rise) / jump)``."""
        return allowed_now(self._look_ahead(now_ns), self._jump_k(energy_j), self.limit_k)

    def allowed_at(self, spacing_s: float, now_ns: int, energy_j: float = PULSE_ENERGY_J) -> int | None:
        """Pulses allowed in a row, one now and one every ``spacing_s``; None: as many as one likes."""
        return first_denied_index(self._jump_k(energy_j), spacing_s, self.limit_k, self._look_ahead(now_ns), self.parameters)

    def min_spacing_s(self, energy_j: float = PULSE_ENERGY_J) -> float:
        """Least spacing that can be kept up for ever, ``-tau ln(1 - jump/limit)``; infinite if one pulse is too many."""
        return min_spacing_s(self._jump_k(energy_j), self.limit_k, self.parameters)

    def wait_s(self, count: int, now_ns: int, energy_j: float = PULSE_ENERGY_J) -> float:
        """Time until ``count`` pulses are allowed at once, ``tau ln(rise / (limit - count jump))``; infinite if never."""
        return wait_s(self._look_ahead(now_ns), count, self._jump_k(energy_j), self.limit_k, self.parameters)

    def _look_ahead(self, now_ns: int) -> float:
        elapsed_ns = now_ns - self.latest_ns
        if elapsed_ns < 0:
            self.clock_faults += 1
        return self._rise_k if elapsed_ns <= 0 else relax(self._rise_k, 0.0, elapsed_ns / NS_PER_S, self.parameters)

    def _jump_k(self, energy_j: float) -> float:
        if energy_j <= 0:
            raise InputError(f"energy_j = {energy_j:g} J is not allowed; allowed: more than 0 J")
        return pulse_rise_k(energy_j, self.parameters)

"""Contact between the strips keeps memory: capacity follows the voltage's force with a lag, fast on, slow off.

``F' = (F_target - F) / tau``, ``tau`` being ``tau_on`` while the target is above and ``tau_off`` while it is below. Without
the slow release the dips at each polarity reversal would collapse the measured plateau; release is bounded by the < 100 ms of
thesis 4.7.3, so that ``tau_off`` is at most 43 ms (down to a tenth). Exact for a target that is constant over a step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from haptics.physics.parameters import Parameters, parameter
from haptics.units import in_range


@dataclass(frozen=True)
class ContactParameters(Parameters):
    """Lag of the contact."""

    tau_on_s: float = parameter(2e-3, "s", "assumed", "zipping together", low=1e-6, high=1.0)
    tau_off_s: float = parameter(30e-3, "s", "assumed", "15 to 43 ms: plateau kept, release < 100 ms (4.7.3)", low=1e-6, high=1.0)


CONTACT = ContactParameters()


def lagged(force_n: float, target_n: float, dt_s: float, parameters: ContactParameters = CONTACT) -> float:
    """Force after ``dt_s`` toward a constant target, exact at any step.

    :raises InputError: a negative step.
    """
    in_range("dt_s", dt_s, 0.0, math.inf, "s")
    tau_s = parameters.tau_on_s if target_n > force_n else parameters.tau_off_s
    return force_n + (target_n - force_n) * -math.expm1(-dt_s / tau_s)


def time_to_reach_s(force_n: float, level_n: float, target_n: float, parameters: ContactParameters = CONTACT) -> float:
    """Time until the lagged force passes ``level_n`` under a constant target; infinite if it never does, 0 if it is there."""
    if level_n == force_n:
        return 0.0
    tau_s = parameters.tau_on_s if target_n > force_n else parameters.tau_off_s
    ahead_n = target_n - force_n
    share = (level_n - force_n) / ahead_n if ahead_n else math.inf
    return -tau_s * math.log1p(-share) if 0.0 < share < 1.0 else math.inf


class ContactLag:
    """A lagged force carried through time.

    :param target_n: force that the law gives, as a function of time (s); taken as constant over each step of ``step_s``, at the
        step's middle. Steps lie on one fixed grid, so how time is cut into calls does not change the result.
    """

    def __init__(
        self,
        parameters: ContactParameters = CONTACT,
        force_n: float = 0.0,
        start_s: float = 0.0,
        step_s: float = 1e-3,
    ):
        self._parameters = parameters
        self._step_s = in_range("step_s", step_s, 1e-7, 1.0, "s")
        self._start_s = start_s
        self._steps = 0
        self.force_n = force_n

    def advance(self, to_s: float, target_n: Callable[[float], float]) -> float:
        """Force at the last whole step at or before ``to_s``.

        ``target_n`` is asked at the middle of each step, times growing.
        """
        last = math.floor((to_s - self._start_s) / self._step_s * (1 + 1e-12))
        while self._steps < last:
            at_s = self._start_s + (self._steps + 0.5) * self._step_s
            self.force_n = lagged(self.force_n, target_n(at_s), self._step_s, self._parameters)
            self._steps += 1
        return self.force_n

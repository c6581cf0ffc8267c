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

    :param force_n: force now (N).
    :param target_n: steady force at the present volts (N).
    :param dt_s: step (s), 0 or more.
    :param parameters: the two time constants; ``tau_on_s`` counts while the target is above.
    :return: force after the step (N).
    :raises InputError: a negative step.
    """
    in_range("dt_s", dt_s, 0.0, math.inf, "s")
    tau_s = parameters.tau_on_s if target_n > force_n else parameters.tau_off_s
    return force_n + (target_n - force_n) * -math.expm1(-dt_s / tau_s)


def time_to_reach_s(force_n: float, level_n: float, target_n: float, parameters: ContactParameters = CONTACT) -> float:
    """Time until the lagged force passes a level under a constant target.

    :param force_n: force now (N).
    :param level_n: force waited for (N).
    :param target_n: steady force at the present volts (N).
    :param parameters: the two time constants.
    :return: time (s); 0 if the force is at the level, infinite if it never passes it.
    """
    if level_n == force_n:
        return 0.0
    tau_s = parameters.tau_on_s if target_n > force_n else parameters.tau_off_s
    ahead_n = target_n - force_n
    share = (level_n - force_n) / ahead_n if ahead_n else math.inf
    return -tau_s * math.log1p(-share) if 0.0 < share < 1.0 else math.inf


class ContactLag:
    """A lagged force carried through time, on a fixed grid: how time is cut into calls does not change the result.

    :param parameters: the two time constants.
    :param force_n: force at the start (N).
    :param start_s: time at the start (s), in any one clock.
    :param step_s: of the grid (s), 0.1 us to 1 s; the target counts as constant over a step.
    :raises InputError: a step outside its range.
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
        """Carry the force forward.

        :param to_s: time (s), in the clock of ``start_s``; one that lies before changes nothing.
        :param target_n: force that the law gives (N) as a function of time (s), asked at the middle of each step, times growing.
        :return: force (N) at the last whole step at or before ``to_s``.
        """
        last = math.floor((to_s - self._start_s) / self._step_s * (1 + 1e-12))
        while self._steps < last:
            at_s = self._start_s + (self._steps + 0.5) * self._step_s
            self.force_n = lagged(self.force_n, target_n(at_s), self._step_s, self._parameters)
            self._steps += 1
        return self.force_n

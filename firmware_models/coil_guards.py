"""What the coil board watches while it is armed: supply and current, sampled about each millisecond, and guards that latch.

- supply: the coils' supply is below its least;
- coil_current: for 2 ms more current than the coils that are on can draw, or than the limit;
- coil_on_time: current flows, though no coil was on for longer than the longest pulse: a driver is stuck.

Volts and current change when something is switched, or acts on the plant from outside, and settle soon after. So the model
looks for as long as they change or something is wrong, and then not again before it is woken: an idle board costs nothing.
"""

from __future__ import annotations

import math

from firmware_models.board import WHOLE_BOARD, Trip
from firmware_models.tactiles_plant import RESISTANCE_SPREAD_OHM, Actuators
from firmware_models.uart import NEVER_NS
from haptics.link.messages import DURATION_UNIT_US, Fault
from haptics.physics.latch_parameters import LATCH, NOMINAL_VOLTS
from haptics.time import NS_PER_MS, NS_PER_US

COIL_WORST_MA = math.ceil(1000 * NOMINAL_VOLTS / (LATCH.resistance_ohm - RESISTANCE_SPREAD_OHM))
"""The most that one coil can draw."""
MARGIN = 1.25
"""Of the worst current of the coils that are on; beyond it, and ``IDLE_MA`` more, something else draws."""
IDLE_MA = 200
"""What the sense reads without any current, at most."""
OVER_NS = 2 * NS_PER_MS
SAMPLE_NS = NS_PER_MS
_SETTLED_MA = 64  # two looks that differ by less saw the same: one count of the sense


class CoilGuards:
    """The samples of one armed stretch. ``wake`` and ``sample`` only while armed; ``rest`` when made safe."""

    def __init__(self, plant: Actuators):
        self._plant = plant
        self.rest()

    def rest(self) -> None:
        """Nothing is fed any more."""
        self.next_ns = NEVER_NS
        self._over_since_ns = self._stray_since_ns = NEVER_NS
        self._before_ma = -1

    def wake(self, now_ns: int) -> None:
        """Something was switched, or changed from outside."""
        self.next_ns = min(self.next_ns, now_ns + SAMPLE_NS)
        self._before_ma = -1

    def sample(self, now_ns: int, on: int, least_mv: int, limit_ma: int, longest: int) -> Trip | None:
        """Look once; to be called at ``next_ns``.

        :param on: coils that are on by command. The limits are those of ``identity``, in its units.
        """
        supply_mv, current_ma = round(1000 * self._plant.volts), round(1000 * self._plant.sensed_current_a(now_ns))
        if supply_mv < least_mv:
            return Trip(Fault.SUPPLY, WHOLE_BOARD, supply_mv)
        # Current with no coil on is a stuck driver's, and another fault's matter, unless it is more than all coils may draw.
        over = current_ma > limit_ma or (on > 0 and current_ma > MARGIN * COIL_WORST_MA * on + IDLE_MA)
        self._over_since_ns = min(self._over_since_ns, now_ns) if over else NEVER_NS
        if now_ns - self._over_since_ns >= OVER_NS:
            return Trip(Fault.COIL_CURRENT, WHOLE_BOARD, current_ma)
        stray = not on and current_ma > IDLE_MA
        self._stray_since_ns = min(self._stray_since_ns, now_ns) if stray else NEVER_NS
        if now_ns - self._stray_since_ns > longest * DURATION_UNIT_US * NS_PER_US + OVER_NS:
            return Trip(Fault.COIL_ON_TIME, WHOLE_BOARD, current_ma)
        settled = not over and not stray and abs(current_ma - self._before_ma) < _SETTLED_MA
        self._before_ma = current_ma
        self.next_ns = NEVER_NS if settled else now_ns + SAMPLE_NS
        return None

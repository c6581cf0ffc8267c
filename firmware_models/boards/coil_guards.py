"""What the coil board watches while it is armed: supply and current, sampled about each millisecond, and guards that latch.

- supply: the coils' supply is below its minimum;
- coil_current: for 2 ms more current than the coils that are on can draw, or than the limit;
- coil_on_time: current that no command explains flowed for longer than the longest pulse, at looks between which it never ceased:
  a driver is stuck.

How long such current may have flowed is reckoned, too, however the armed stretch ends: it may have been any coil's.

Volts and current change when something is switched, or acts on the plant from outside, and settle soon after. So the model
looks for as long as they change or something is wrong, and then not again before it is woken: an idle board costs nothing.
"""

from __future__ import annotations

import math

from firmware_models.boards.board import WHOLE_BOARD, Trip
from firmware_models.line.uart import NEVER_NS
from firmware_models.plants.tactiles_plant import RESISTANCE_SPREAD_OHM, Actuators
from haptics.link.messages import DURATION_UNIT_US, Fault
from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS
from haptics.time import NS_PER_MS, NS_PER_US

COIL_WORST_MA = math.ceil(1000 * NOMINAL_VOLTS / (LATCH.resistance_ohm - RESISTANCE_SPREAD_OHM))
"""Maximum that one coil can draw, mA."""
MARGIN = 1.25
"""Of what the worst coils draw at the supply as it is; beyond it, and ``IDLE_MA`` more, something else draws."""
IDLE_MA = 200
"""What the sense reads without any current, at most, mA."""
OVER_NS = 2 * NS_PER_MS
SAMPLE_NS = NS_PER_MS
FADE_NS = 200 * NS_PER_US
"""After it a coil that has gone off, or come on, is so in the reading."""
_SETTLED_MA = 64  # two looks that differ by less saw the same: one count of the sense


class CoilGuards:
    """The samples of one armed stretch, from ``begin`` to ``rest``; ``wake`` and ``sample`` only meanwhile.

    :param plant: whose supply and current are sampled.
    """

    def __init__(self, plant: Actuators):
        self._plant = plant
        self._doubted = False
        self.rest(0)

    def begin(self, now_ns: int) -> None:
        """The drivers are fed from now on, and nobody has looked yet.

        :param now_ns: world time, ns.
        """
        self._looked_ns, self._doubted = now_ns, True
        self.wake(now_ns, 0)

    def rest(self, now_ns: int) -> int:
        """Nothing is fed any more.

        :param now_ns: world time, ns.
        :return: for how long current may have flowed that no command explains, ns.
        """
        doubted_ns = now_ns - self._looked_ns if self._doubted else 0
        self.next_ns = NEVER_NS
        self._looked_ns = now_ns
        self._over_since_ns = NEVER_NS
        self._doubted = self._unasked = False
        self._unasked_ns = 0
        self._before_ma = -1
        self._before: list[tuple[int, int]] = []  # coils that were on until then
        return doubted_ns

    def wake(self, now_ns: int, on: int) -> None:
        """Look again soon: something was switched, or changed from outside.

        :param now_ns: world time, ns.
        :param on: how many coils were on until now.
        """
        if self.next_ns == NEVER_NS and not self._doubted:
            self._looked_ns = now_ns  # all was in order, and nothing has changed since
        self.next_ns = min(self.next_ns, now_ns + SAMPLE_NS)
        self._before_ma = -1
        self._before.append((now_ns, on))

    def sample(self, now_ns: int, on: int, min_mv: int, limit_ma: int, longest: int) -> tuple[Trip | None, int]:
        """Look once; to be called at ``next_ns``.

        :param now_ns: world time, ns.
        :param on: how many coils are on by command.
        :param min_mv: supply below which the guard trips, mV.
        :param limit_ma: current of all coils above which it trips, mA.
        :param longest: longest pulse, in units of ``DURATION_UNIT_US``; current that no command explains may last so long.
        :return: the guard that fired or None, and for how long current has flowed since the last look that no command explains,
            ns.
        """
        supply_mv, current_ma = round(1000 * self._plant.volts), round(1000 * self._plant.sensed_current_a(now_ns))
        self._before = [(until_ns, was_on) for until_ns, was_on in self._before if until_ns > now_ns - FADE_NS]
        lately = [on, *(was_on for _, was_on in self._before)]
        unexplained = current_ma > _drawable_ma(max(lately), supply_mv)
        doubtful = not unexplained and current_ma > _drawable_ma(min(lately), supply_mv)
        since_ns = now_ns - self._looked_ns
        self._unasked = self._unasked and current_ma > IDLE_MA
        if unexplained:
            self._unasked_ns = self._unasked_ns + since_ns if self._unasked else 0
            self._unasked = True
        self._doubted = self._unasked or doubtful
        if self._unasked or not doubtful:
            self._looked_ns = now_ns
        flowed_ns = since_ns if self._unasked else 0
        # With no coil on it is a stuck driver's, and another fault's matter, unless it is more than all coils may draw.
        over = current_ma > limit_ma or (max(lately) > 0 and unexplained)
        self._over_since_ns = min(self._over_since_ns, now_ns) if over else NEVER_NS
        settled = not over and not self._doubted and abs(current_ma - self._before_ma) < _SETTLED_MA
        self._before_ma = current_ma
        self.next_ns = NEVER_NS if settled else now_ns + (FADE_NS if doubtful else SAMPLE_NS)
        if supply_mv < min_mv:
            return Trip(Fault.SUPPLY, WHOLE_BOARD, supply_mv), flowed_ns
        if now_ns - self._over_since_ns >= OVER_NS:
            return Trip(Fault.COIL_CURRENT, WHOLE_BOARD, current_ma), flowed_ns
        if unexplained and self._unasked_ns >= longest * DURATION_UNIT_US * NS_PER_US + OVER_NS:
            return Trip(Fault.COIL_ON_TIME, WHOLE_BOARD, current_ma), flowed_ns
        return None, flowed_ns


def _drawable_ma(coils: int, supply_mv: int) -> float:
    """Maximum that so many coils draw at this supply, with the margin, mA."""
    return MARGIN * COIL_WORST_MA * coils * supply_mv / (1000 * NOMINAL_VOLTS) + IDLE_MA

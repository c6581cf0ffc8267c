"""A fault to play: an actuator whose pin is stuck. Its coil carries current and warms as any other; nothing moves."""

from __future__ import annotations

import math

from haptics.physics.latch.parameters import LatchParameters
from haptics.physics.latch.plant import Latched, LatchEvent, checked_resistance, checked_time


class JammedLatch:
    """A ``LatchPlant`` that stays at the off stop: ``L i' = V - R i``, exact.

    :param parameters: resistance and inductance count.
    :param start_s: time at which it is at rest without current, s.
    """

    def __init__(self, parameters: LatchParameters, start_s: float = 0.0):
        self._parameters = parameters
        self._now_s = start_s
        self._volts = 0.0
        self._resistance_ohm = parameters.resistance_ohm
        self.rise_k = 0.0
        self.position_m, self.speed_m_s = 0.0, 0.0
        self.current_a, self.energy_j = 0.0, 0.0
        self.latched: Latched = "off"
        self.outside: tuple[str, ...] = ()

    @property
    def at_rest(self) -> bool:
        """Whether nothing changes any more: no volts, no current."""
        return self._volts == 0.0 and abs(self.current_a) < 1e-9

    def drive(self, time_s: float, volts: float) -> None:
        """Put ``volts`` on the terminals from ``time_s`` on.

        :param time_s: s, not before the last time given.
        :param volts: V, of either sign.
        """
        self.advance(time_s)
        self._volts = volts
        self._resistance_ohm = checked_resistance(self._parameters, self.rise_k)

    def advance(self, to_s: float) -> None:
        """Carry the current to ``to_s``.

        :param to_s: s, not before the last time given.
        """
        dt_s = checked_time(to_s, self._now_s) - self._now_s
        self._now_s = to_s
        final_a, tau_s = self._volts / self._resistance_ohm, self._parameters.inductance_h / self._resistance_ohm
        gone = -math.expm1(-dt_s / tau_s)
        charge_c = final_a * dt_s + (self.current_a - final_a) * tau_s * gone
        self.current_a += (final_a - self.current_a) * gone
        self.energy_j += self._volts * charge_c

    def load_skin(self, time_s: float, stiffness_n_m: float, at_m: float) -> None:
        """A skin changes nothing for a pin that does not move.

        :param time_s: s, not before the last time given.
        :param stiffness_n_m: ignored.
        :param at_m: ignored.
        """
        self.advance(time_s)

    def take_events(self) -> list[LatchEvent]:
        """Events since the last call: a pin that does not move has none.

        :return: an empty list.
        """
        return []

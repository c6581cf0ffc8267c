"""What the brake controller watches while it drives, by sampling volts and current: guards that latch.

It knows the phase of its own square wave, so that it knows a ramp from a clamp from a hold:

- over-voltage: an output 5 % above the setpoint (the higher one, until a reversal, after it was lowered);
- over-current: the supply gives more than 550 uA for 1 ms;
- bridge stuck: no sign change in 1.5 half periods;
- short, open: the ramp's slope gives a capacitance outside 0.5 to 1.5 of what the self test measured;
- leak, while volts are held: 50 uA beyond the bleeder's current, or volts falling by 100 V in 1 ms.

It looks each millisecond. While volts are held and nobody touches the plant nothing can change, so the model looks less
often then, and again within a millisecond of a touch (``wake``).
"""

from __future__ import annotations

import math

from firmware_models.boards.board import WHOLE_BOARD, Trip
from firmware_models.plants.brake_plant import Brakes
from haptics.link.messages import BRAKE_CHANNELS, Fault
from haptics.physics.brake.charging import DRIVE, clamp_time_s
from haptics.time import NS_PER_MS, NS_PER_S, seconds_to_ns

OVER_VOLTAGE = 1.05
OVER_CURRENT_A = 550e-6
LEAK_A = 50e-6
SUDDEN_DROP_V = 100.0
SOUND = (0.5, 1.5)
STUCK_HALF_PERIODS = 1.5
SAMPLE_NS = NS_PER_MS
_HELD_SAMPLE_NS = 5 * NS_PER_MS
_HELD = 0.98  # of the setpoint: from here on the supply only makes up for leakage
_RAMP = (30.0, 0.6)  # slope is judged where it should have made more than these volts, and less than this share of the setpoint
_SETTLED_NS = 2 * NS_PER_MS  # held for so long, the last of the charging current has gone
_SENSED_V = 20.0  # minimum volts whose sign the dividers resolve


class Guards:
    """The samples of one drive, from its first volts to its end.

    :param plant: what is sampled.
    :param capacitance_f: of each output as last measured, F (5,); a ramp of a single output measures it again.
    """

    def __init__(self, plant: Brakes, capacitance_f: list[float]):
        self._plant = plant
        self.capacitance_f = capacitance_f
        self.leakage_a = [0.0] * BRAKE_CHANNELS
        self._chosen: list[int] = []  # outputs of this drive; none: nothing is driven
        self._set_v = self._trip_v = 0.0
        self._half_ns = self._clamp_ns = 1
        self._phase_ns = 0
        self._ramp_known_from = 0  # half period from which a ramp begins at 0 V
        self._sign = 0
        self._sign_ns = 0
        self._over_current_since_ns: int | None = None
        self._held: tuple[int, int, float] | None = None  # half period, since when, volts last seen
        self._lowered_in = 0  # half period up to which volts may still stand above a lowered setpoint
        self.next_ns = 0

    def begin(self, mask: int, volts: float, frequency_hz: float, now_ns: int) -> None:
        """A drive takes effect: from discharged outputs, or with another amplitude only, in the phase of the one before.

        :param mask: outputs driven, bit 0 for output 0; not 0.
        :param volts: setpoint, V.
        :param frequency_hz: of the square wave, Hz; ignored where a wave goes on.
        :param now_ns: world time, ns.
        """
        if not self._chosen:
            half_ns = round(0.5 * NS_PER_S / frequency_hz)
            self._phase_ns, self._half_ns, self._clamp_ns = now_ns, half_ns, seconds_to_ns(clamp_time_s(frequency_hz))
            self._trip_v = volts
            self._sign, self._sign_ns = 0, now_ns
            self._ramp_known_from = self._lowered_in = 0
            self.next_ns = now_ns + self._interval_ns()
        elif volts != self._set_v:
            self._ramp_known_from = self._half_period(now_ns) + 1
            self._lowered_in = self._half_period(now_ns)
            self._trip_v = max(self._trip_v, volts)
            self._held = None
        self._chosen, self._set_v = [channel for channel in range(BRAKE_CHANNELS) if mask >> channel & 1], volts

    def wake(self, now_ns: int) -> None:
        """Look again soon: something acted on the plant from outside.

        :param now_ns: world time, ns.
        """
        self.next_ns = min(self.next_ns, now_ns + self._interval_ns())

    def end(self) -> None:
        """The outputs are shorted."""
        self._chosen = []
        self._held = self._over_current_since_ns = None
        self.leakage_a = [0.0] * BRAKE_CHANNELS

    def sample(self, now_ns: int) -> Trip | None:
        """Look once; to be called at ``next_ns``.

        :param now_ns: world time, ns.
        :return: the guard that fired; None if all is well.
        """
        self.next_ns = now_ns + self._interval_ns()
        channel = self._chosen[0] if len(self._chosen) == 1 else WHOLE_BOARD
        signed_v, amps = self._plant.volts(now_ns)[self._chosen[0]], self._plant.supply_current_a()
        volts = abs(signed_v)
        half_period = self._half_period(now_ns)
        charging_ns = now_ns - self._charging_from_ns(half_period)
        if half_period > self._lowered_in and charging_ns > 0:
            self._trip_v = self._set_v
        if volts > OVER_VOLTAGE * self._trip_v:
            return Trip(Fault.OVER_VOLTAGE, channel, round(volts))
        if self._over_current(amps, now_ns):
            return Trip(Fault.OVER_CURRENT, WHOLE_BOARD, round(amps * 1e6))
        if self._stuck(signed_v, now_ns):
            return Trip(Fault.BRIDGE_STUCK, channel, (now_ns - self._sign_ns) // NS_PER_MS)
        if charging_ns <= 0:
            return None
        ramp = self._judge_ramp(channel, volts, charging_ns, now_ns) if half_period >= self._ramp_known_from else None
        return ramp or self._judge_hold(channel, volts, amps, half_period, now_ns)

    def _interval_ns(self) -> int:
        return min(SAMPLE_NS, self._half_ns // 4)

    def _half_period(self, now_ns: int) -> int:
        """Which half period it is, from 0; the first one has half the length."""
        return (now_ns - self._phase_ns + self._half_ns - self._half_ns // 2) // self._half_ns

    def _charging_from_ns(self, half_period: int) -> int:
        """When the supply began, or will begin, to charge in this half period: after the clamp, but in the first."""
        if half_period == 0:
            return self._phase_ns
        return self._phase_ns + self._half_ns // 2 + (half_period - 1) * self._half_ns + self._clamp_ns

    def _over_current(self, amps: float, now_ns: int) -> bool:
        if amps <= OVER_CURRENT_A:
            self._over_current_since_ns = None
        elif self._over_current_since_ns is None:
            self._over_current_since_ns = now_ns
        return self._over_current_since_ns is not None and now_ns - self._over_current_since_ns >= NS_PER_MS

    def _stuck(self, volts: float, now_ns: int) -> bool:
        sign = (volts > _SENSED_V) - (volts < -_SENSED_V)
        if sign and sign != self._sign:
            self._sign, self._sign_ns = sign, now_ns
        # After a reversal the sign shows when the ramp has passed what can be sensed.
        slack_ns = self._clamp_ns + 2 * self._interval_ns()
        return self._set_v >= 2 * _SENSED_V and now_ns - self._sign_ns > STUCK_HALF_PERIODS * self._half_ns + slack_ns

    def _judge_ramp(self, channel: int, volts: float, charging_ns: int, now_ns: int) -> Trip | None:
        if volts > _SENSED_V and self._sign_ns < now_ns - charging_ns:
            return None  # still the old sign: no ramp at all, and another guard's matter
        total_f = DRIVE.stray_f + sum([self.capacitance_f[one] for one in self._chosen])
        expected_v = DRIVE.supply_current_a * charging_ns / NS_PER_S / total_f
        if not _RAMP[0] <= expected_v <= _RAMP[1] * self._set_v:
            return None
        # A large capacitance is not quite empty after the clamp, and starts a little on the other side.
        kept_v = self._trip_v * math.exp(-self._clamp_ns / NS_PER_S / (DRIVE.output_resistance_ohm * total_f))
        if volts < (expected_v - kept_v) / SOUND[1]:
            return Trip(Fault.SHORT, channel, round(volts))
        if volts > min(expected_v / SOUND[0], _HELD * self._set_v):
            return Trip(Fault.OPEN, channel, round(volts))
        if channel != WHOLE_BOARD and volts > _SENSED_V > kept_v:
            self.capacitance_f[channel] = total_f * expected_v / volts - DRIVE.stray_f
        return None

    def _judge_hold(self, channel: int, volts: float, amps: float, half_period: int, now_ns: int) -> Trip | None:
        before = self._held if self._held is not None and self._held[0] == half_period else None
        if volts >= _HELD * self._set_v:
            self._held = (half_period, before[1] if before else now_ns, volts)
        else:
            self._held = None
        if before is None:
            return None
        if before[2] - volts > SUDDEN_DROP_V:
            return Trip(Fault.LEAK, channel, round(before[2] - volts))
        if self._held is None or now_ns - before[1] < _SETTLED_NS:
            return None
        self.next_ns = now_ns + min(_HELD_SAMPLE_NS, self._half_ns // 4)
        leak_a = max(amps - self._set_v / DRIVE.bleeder_ohm, 0.0)
        for one in range(BRAKE_CHANNELS):
            self.leakage_a[one] = leak_a / len(self._chosen) if one in self._chosen else 0.0
        return Trip(Fault.LEAK, channel, round(leak_a * 1e7)) if leak_a > LEAK_A else None

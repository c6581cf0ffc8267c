"""The output stage as a plant: clutches on one supply and one bridge, and the two means by which the bridge is switched.

``drive`` makes a bipolar square wave here, whose first half period has half the length, so that the mean is zero from the
start. ``pins`` follows a controller edge by edge: the same edges give the same volts. ``bridge`` has the circuit.
"""

from __future__ import annotations

import math

from haptics.errors import InputError
from haptics.physics.brake.bridge import BridgeCircuit
from haptics.physics.brake.charging import DRIVE, DriveParameters, bleeder_alone_v, clamp_time_s
from haptics.units import in_range

_SAME_WAVE = 0.01
"""Half periods that differ by less are of one frequency: a controller's edges fall on its ticks."""


class OutputStage(BridgeCircuit):
    """Supply, bridge and outputs; see ``BridgeCircuit`` for what there is to set and to see.

    :param capacitances_f: of each output (F), 0 where none is connected; 1 to 8 outputs.
    :param drive: supply and bridge.
    :param start_s: time at the start (s).
    :param reversal: clamped or direct.
    :raises InputError: other outputs than these, or a supply with a reservoir.
    """

    def __init__(
        self,
        capacitances_f: tuple[float, ...] | list[float],
        drive: DriveParameters = DRIVE,
        start_s: float = 0.0,
        reversal: str = "clamped",
    ):
        super().__init__(capacitances_f, drive, start_s, reversal)
        self._frequency_hz: float = 0.0
        self._reversal_s: float = math.inf
        self._by_pins = False
        self._turned_s = math.nan  # last reversal that pins made
        self.stuck = False
        """Fault: the bridge misses its reversals."""
        self.reversals = 0
        """Sign changes of the bridge since the beginning."""

    def drive(self, time_s: float, mask: int, volts: float, frequency_hz: float) -> None:
        """From ``time_s`` on: a square wave of this setpoint on the outputs in ``mask``; all others shorted.

        Mask or volts 0 shorts everything. A wave of the same frequency goes on in phase; 0 Hz is constant voltage.

        :param time_s: when (s), not before ``now_s``.
        :param mask: one bit an output.
        :param volts: setpoint (V), 0 to the supply's.
        :param frequency_hz: of the wave (Hz), 0 to the bridge's.
        :raises InputError: time going back, a mask beyond the outputs, a number outside its range.
        """
        if not 0 <= mask < 1 << len(self._outputs):
            raise InputError(f"mask = {mask:#x}; must be 0 to {(1 << len(self._outputs)) - 1:#x}")
        in_range("volts", volts, 0.0, self._drive.supply_volts, "V")
        in_range("frequency_hz", frequency_hz, 0.0, self._drive.bridge_hz, "Hz")
        self.advance(time_s)
        if volts == 0.0:
            mask = 0
        running = self._mask != 0 and not self._by_pins
        if mask != self._mask:
            self._connect(mask)
        if not mask:
            self._bridge_v = 0.0  # the stray capacitance goes with the short
        self._live, self._by_pins, self._legs_shorted = mask != 0, False, True
        self._set_v = volts if mask else 0.0
        self._idle_v = bleeder_alone_v(self._set_v, self._drive)
        self._load = self._present_load()
        if not mask:
            self._charging_from_s = self._reversal_s = math.inf
        elif not running or frequency_hz != self._frequency_hz:
            self._charging_from_s = time_s
            # A quarter period first: half a half period.
            self._reversal_s = time_s + 0.25 / frequency_hz if frequency_hz else math.inf
            if self._bridge_v * self._polarity < 0.0:
                self._polarity = -self._polarity
        self._frequency_hz = frequency_hz if mask else 0.0
        self._await_breakdown()

    def pins(self, time_s: float, mask: int, volts: float, polarity: int, enabled: bool = True) -> None:
        """From ``time_s`` on, what a controller's pins set: the outputs in ``mask`` on the bridge, all others shorted.

        :param time_s: when (s), not before ``now_s``.
        :param mask: one bit an output.
        :param volts: setpoint of the supply (V), 0 to the supply's.
        :param polarity: of the bridge, +1 or -1; 0: its legs are shorted.
        :param enabled: False: the supply gives nothing, and only its bleeder is there.
        :raises InputError: time going back, a mask beyond the outputs, a number outside its range.
        """
        if not 0 <= mask < 1 << len(self._outputs):
            raise InputError(f"mask = {mask:#x}; must be 0 to {(1 << len(self._outputs)) - 1:#x}")
        in_range("volts", volts, 0.0, self._drive.supply_volts, "V")
        if polarity not in (-1, 0, 1):
            raise InputError(f"polarity = {polarity!r} is not allowed; allowed: -1, 0, 1")
        self.advance(time_s)
        charged, begins = self.charging, self._mask == 0
        if self.stuck:
            polarity = self._polarity if charged or polarity else 0
        if mask != self._mask:
            self._connect(mask)
        elif charged and polarity != self._polarity:
            self._note_peaks()
        if begins:
            self._frequency_hz, self._turned_s, self._polarity = 0.0, math.nan, polarity or self._polarity
        elif polarity == -self._polarity:
            self._turn(time_s)
        self._set_v = volts if enabled else 0.0
        self._idle_v = bleeder_alone_v(self._set_v, self._drive)
        self._live, self._by_pins, self._legs_shorted = mask != 0 or enabled, True, polarity == 0
        if not mask and (self._legs_shorted or not enabled):
            self._bridge_v = 0.0  # the stray capacitance goes with the short
        self._charging_from_s = -math.inf if enabled and polarity else math.inf
        self._reversal_s = math.inf
        self._load = self._present_load()
        self._await_breakdown()

    def advance(self, to_s: float) -> None:
        """Carry every voltage to ``to_s``.

        :param to_s: time (s), not before ``now_s``.
        :raises InputError: time going back.
        """
        if not self._now_s <= to_s < math.inf:
            raise InputError(f"to_s = {to_s!r} s; must be at least {self._now_s!r} s; time only moves forward")
        # What may come next is compared first: nearly every call ends before it.
        while self._reversal_s <= to_s or self._now_s < self._charging_from_s <= to_s or self._breakdown_s <= to_s:
            at_s = self._next_event_s()
            self._evolve(at_s)
            if at_s >= self._breakdown_s:
                self._break_down()
            elif at_s >= self._reversal_s:
                self._reverse(at_s)
            else:
                self._charging_from_s = -math.inf
            self._await_breakdown()
        if to_s > self._now_s:
            self._evolve(to_s)

    @property
    def next_event_s(self) -> float | None:
        """When the stage changes its course next by itself (end of a clamp, reversal, breakdown), or None."""
        at_s = self._next_event_s()
        return None if at_s == math.inf else at_s

    @property
    def frequency_hz(self) -> float:
        """Of the wave (Hz); of one that pins make by its last whole half period, 0 before there was any."""
        return self._frequency_hz

    def _next_event_s(self) -> float:
        own_s = min(self._charging_from_s, self._reversal_s) if self._charging_from_s > self._now_s else self._reversal_s
        return min(own_s, self._breakdown_s)

    def _reverse(self, at_s: float) -> None:
        self._reversal_s = at_s + 0.5 / self._frequency_hz
        if self.stuck:
            return
        self._polarity = -self._polarity
        self.reversals += 1
        self._charging_from_s = at_s + (0.0 if self._stiff else clamp_time_s(self._frequency_hz, self._drive))
        self._note_peaks()

    def _turn(self, at_s: float) -> None:
        """Pins turn the bridge round."""
        self._polarity = -self._polarity
        self.reversals += 1
        if math.isfinite(self._turned_s) and at_s > self._turned_s:
            frequency_hz = min(0.5 / (at_s - self._turned_s), self._drive.bridge_hz)
            if abs(frequency_hz - self._frequency_hz) > _SAME_WAVE * self._frequency_hz:
                self._frequency_hz = frequency_hz
        self._turned_s = at_s

"""Supply, bridge and up to eight clutches as a circuit: what volts do between the moments at which anything is switched.

Outputs in the mask hang in parallel on the bridge; all others are shorted, each through its own resistance. Connecting
an output shares charge at once. Nothing is integrated: between switching times every voltage is an exponential. A dielectric
that sees more than its ``breakdown_v`` breaks down, at that very moment, and conducts from then on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.brake.charging import DRIVE, Charging, DriveParameters, time_to_reach_s
from haptics.units import in_range, one_of

BROKEN_DOWN_OHM = 10e3
"""Across a dielectric that broke down (assumed: a carbonised channel)."""


@dataclass(slots=True)
class Output:
    """One clutch's electrical side; values may be swapped while it runs (``BridgeCircuit.set_output``).

    :param capacitance_f: of the clutch (F), 0: not connected.
    :param leak_ohm: across it (ohm), infinite: none.
    :param breakdown_v: volts that its dielectric stands, infinite: any.
    :param volts: on it now, signed.
    :param peak_v: magnitude at the end of the last half period (V).
    :param energy_j: its share of what the supply gave (J).
    """

    capacitance_f: float
    leak_ohm: float = math.inf
    breakdown_v: float = math.inf
    volts: float = 0.0
    peak_v: float = 0.0
    energy_j: float = 0.0


class BridgeCircuit:
    """What ``OutputStage`` carries through time. Times are seconds in any one clock and must not go back.

    :param capacitances_f: of each output (F), 0 where none is connected; 1 to 8 outputs.
    :param drive: supply and bridge.
    :param start_s: time at the start (s).
    :param reversal: clamped or direct.
    :raises InputError: other outputs than these, or a supply with a reservoir (``drive.reservoir_f``).
    """

    def __init__(
        self,
        capacitances_f: tuple[float, ...] | list[float],
        drive: DriveParameters = DRIVE,
        start_s: float = 0.0,
        reversal: str = "clamped",
    ):
        if not 1 <= len(capacitances_f) <= 8:
            raise InputError(f"{len(capacitances_f)} capacitances given; 1 to 8 allowed, one per output")
        self._outputs = [Output(in_range("capacitance_f", c, 0.0, 1e-3, "F")) for c in capacitances_f]
        self._drive = drive
        self._stiff = one_of("reversal", reversal, ("clamped", "direct")) == "direct"
        self._now_s = float(start_s)
        self._mask = 0
        self._connected: list[Output] = []
        self._shorted = self._outputs
        self._live = False  # the bridge carries anything at all
        self._set_v = 0.0
        self._idle_v = 0.0  # of the supply while the bridge shorts what it drives
        self._polarity: int = 1
        self._bridge_v = 0.0  # on the connected outputs and the stray capacitance, signed
        self._charging_from_s = math.inf
        self._legs_shorted: bool = (
            True  # while it does not charge: the bridge's legs are together; else it hangs on a dead supply
        )
        self._breakdown_s = math.inf
        self._weakest_v = math.inf  # minimum breakdown_v of all outputs
        self._load = self._present_load()
        self.broken_down = 0
        """Mask of the outputs whose dielectric broke down."""
        self.charge_c = 0.0
        """Charge the supply has given."""
        self.energy_j = 0.0
        """Energy the supply has given: the integral of v i at its output."""

    def advance(self, to_s: float) -> None:
        """Carry every voltage to a time.

        :param to_s: time (s), not before ``now_s``.
        :raises InputError: time going back.
        """
        raise NotImplementedError

    @property
    def now_s(self) -> float:
        """Time advanced to (s)."""
        return self._now_s

    @property
    def mask(self) -> int:
        """Outputs on the bridge, one bit each."""
        return self._mask

    @property
    def set_v(self) -> float:
        """The setpoint in force, 0 while everything is shorted."""
        return self._set_v if self._mask else 0.0

    @property
    def bridge_v(self) -> float:
        """Volts on the outputs in the mask, in the bridge's present polarity: negative while it has yet to turn them round."""
        return self._bridge_v * self._polarity

    @property
    def charging(self) -> bool:
        """The supply is on the outputs in the mask: neither all shorted nor clamped before a reversal."""
        return self._live and self._now_s >= self._charging_from_s

    @property
    def load(self) -> Charging:
        """What hangs on the bridge, and where charging would lead it."""
        return self._load

    @property
    def polarity(self) -> int:
        """+1 or -1: the bridge's present polarity."""
        return self._polarity

    @property
    def bus_v(self) -> float:
        """Volts at the supply's output: the setpoint, less while the load holds it down, more while the load holds it up."""
        u_v = self._bridge_v * self._polarity
        if not self.charging:
            held_up_v = 0.0 if self._legs_shorted else u_v / (1.0 + self._drive.output_resistance_ohm / self._drive.bleeder_ohm)
            return max(self._idle_v, held_up_v)
        if self._stiff:
            return self._set_v
        if u_v >= self._set_v:
            # The supply cannot sink: the load feeds the bleeder.
            return max(self._set_v, u_v / (1.0 + self._drive.output_resistance_ohm / self._drive.bleeder_ohm))
        return min(self._set_v, u_v + self._current_into_bridge_a() * self._drive.output_resistance_ohm)

    @property
    def supply_current_a(self) -> float:
        """What the supply gives now (A), bleeder included."""
        if not self._live:
            return 0.0
        if not self.charging:
            return self._idle_v / self._drive.bleeder_ohm
        supply = self._load.regime(self._bridge_v * self._polarity).supply
        if supply == "current":
            return self._drive.supply_current_a
        # Blocked: the load holds the bus up.
        return 0.0 if supply == "blocked" else self._current_into_bridge_a() + self._set_v / self._drive.bleeder_ohm

    @property
    def may_break(self) -> bool:
        """The setpoint is more than what the weakest output stands."""
        return self._set_v > self._weakest_v

    @property
    def stored_charge_c(self) -> float:
        """Sum of the magnitudes of charge on all outputs (C)."""
        return sum(abs(o.capacitance_f * o.volts) for o in self._outputs) + self._drive.stray_f * abs(self._bridge_v)

    @property
    def voltages_v(self) -> list[float]:
        """Signed volts on each output now."""
        return [o.volts for o in self._outputs]

    def voltage_v(self, output: int) -> float:
        """Signed voltage on one output now.

        :param output: from 0.
        :return: volts.
        """
        return self._outputs[output].volts

    def amplitude_v(self, output: int) -> float:
        """Amplitude reached: magnitude at the end of the last half period, or now if that is more; now, if shorted.

        :param output: from 0.
        :return: volts, unsigned.
        """
        o = self._outputs[output]
        return max(o.peak_v, abs(o.volts)) if self._mask >> output & 1 else abs(o.volts)

    def output_energy_j(self, output: int) -> float:
        """This output's share, by capacitance, of the energy the supply gave.

        :param output: from 0.
        :return: energy (J).
        """
        return self._outputs[output].energy_j

    def shorted_below(self, volts: float) -> bool:
        """Whether no output outside the mask has these volts left, of either sign.

        :param volts: magnitude (V).
        :return: True also if no output is shorted.
        """
        return not self._shorted or max([abs(o.volts) for o in self._shorted]) < volts

    def decay_s(self, output: int) -> float:
        """Time constant with which an output that is shorted, or clamped with its group, loses its volts.

        :param output: from 0.
        :return: time constant (s); 0 for an output without capacitance.
        """
        o, r = self._outputs[output], self._drive.output_resistance_ohm
        if self._mask >> output & 1:
            return self._load.capacitance_f / (1.0 / self._passive_ohm + self._load.leak_s)
        return r * o.capacitance_f

    def set_output(
        self,
        time_s: float,
        output: int,
        capacitance_f: float | None = None,
        leak_ohm: float | None = None,
        breakdown_v: float | None = None,
    ) -> None:
        """Change an output while it runs: overlap moved, a leak, a short, an open, or what its dielectric stands from now on.

        Voltage is kept; the charge that a changing capacitance moves is not counted.

        :param time_s: when (s), not before ``now_s``.
        :param output: which, from 0.
        :param capacitance_f: of the clutch (F), 0 (open) to 1 mF; None: as it was.
        :param leak_ohm: across it (ohm), 1 (short) or more, infinite: none; None: as it was.
        :param breakdown_v: volts that its dielectric stands, 0 or more, infinite: any; None: as it was.
        :raises InputError: time going back, or a number outside its range.
        """
        self.advance(time_s)
        o = self._outputs[output]
        if capacitance_f is not None:
            o.capacitance_f = in_range("capacitance_f", capacitance_f, 0.0, 1e-3, "F")
        if leak_ohm is not None:
            o.leak_ohm = math.inf if leak_ohm == math.inf else in_range("leak_ohm", leak_ohm, 1.0, math.inf, "ohm")
        if breakdown_v is not None:
            o.breakdown_v = math.inf if breakdown_v == math.inf else in_range("breakdown_v", breakdown_v, 0.0, math.inf, "V")
            self._weakest_v = min(one.breakdown_v for one in self._outputs)
        self._load = self._present_load()
        self._await_breakdown()

    @property
    def _passive_ohm(self) -> float:
        """Across the bridge while the supply is not on it: its shorted legs, or a dead supply's bleeder."""
        r = self._drive.output_resistance_ohm
        return r if self._legs_shorted else r + self._drive.bleeder_ohm

    def _present_load(self) -> Charging:
        """The supply on what hangs on the bridge."""
        # Without any capacitance the voltage would jump; a picofarad keeps the equations regular.
        total_f = max(self._drive.stray_f + sum(o.capacitance_f for o in self._connected), 1e-12)
        leak_s = sum(1.0 / o.leak_ohm for o in self._connected)
        return Charging(self._set_v, total_f, leak_s, self._drive, self._stiff)

    def _current_into_bridge_a(self) -> float:
        load, u_v = self._load, self._bridge_v * self._polarity
        regime = load.regime(u_v)
        return load.capacitance_f * (regime.target_v - u_v) / regime.tau_s + u_v * load.leak_s

    def _connect(self, mask: int) -> None:
        """Put the outputs in ``mask`` in parallel (charge is shared at once); the others keep their voltage and are shorted."""
        self._mask = mask
        group = self._connected = [o for k, o in enumerate(self._outputs) if mask >> k & 1]
        self._shorted = [o for k, o in enumerate(self._outputs) if not mask >> k & 1]
        charge_c = self._drive.stray_f * self._bridge_v + sum(o.capacitance_f * o.volts for o in group)
        self._bridge_v = charge_c / self._present_load().capacitance_f if group else 0.0
        for o in group:
            o.volts, o.peak_v = self._bridge_v, abs(self._bridge_v)

    def _note_peaks(self) -> None:
        """A half period ends: what its outputs have reached."""
        for o in self._connected:
            o.peak_v = min(abs(o.volts), self._set_v)

    def _await_breakdown(self) -> None:
        """Work out when what charges now reaches the breakdown of the weakest output on the bridge."""
        self._breakdown_s = math.inf
        if not self.may_break or not self.charging:
            return
        weakest_v = min([o.breakdown_v for o in self._connected], default=math.inf)
        u_v, after_s = self._bridge_v * self._polarity, 0.0
        while u_v < weakest_v:
            regime = self._load.regime(u_v)
            if regime.target_v <= u_v:
                return
            stop_v = weakest_v if math.isnan(regime.until_v) else min(weakest_v, regime.until_v)
            after_s += time_to_reach_s(u_v, stop_v, regime)
            u_v = stop_v
        self._breakdown_s = self._now_s + after_s

    def _break_down(self) -> None:
        weakest_v = min(o.breakdown_v for o in self._connected)
        for k, o in enumerate(self._outputs):
            if self._mask >> k & 1 and o.breakdown_v == weakest_v:
                o.breakdown_v, o.leak_ohm = math.inf, min(o.leak_ohm, BROKEN_DOWN_OHM)
                self.broken_down |= 1 << k
        self._weakest_v = min(o.breakdown_v for o in self._outputs)
        self._load = self._present_load()

    def _evolve(self, to_s: float) -> None:
        """Carry all voltages to ``to_s``, no switching in between."""
        dt_s = to_s - self._now_s
        if dt_s <= 0.0:
            return
        r = self._drive.output_resistance_ohm
        for o in self._shorted:
            if o.volts != 0.0:
                o.volts = o.volts * math.exp(-dt_s / (r * o.capacitance_f)) if o.capacitance_f else 0.0
        if self._live:
            load = self._load
            if self.charging:
                u_v, taken_c, taken_j = load.charge(self._bridge_v * self._polarity, dt_s)
                self._bridge_v = u_v * self._polarity
            else:
                self._bridge_v *= math.exp(-dt_s * (1.0 / self._passive_ohm + load.leak_s) / load.capacitance_f)
                taken_c = self._idle_v / self._drive.bleeder_ohm * dt_s
                taken_j = self._idle_v * taken_c
            self.charge_c += taken_c
            self.energy_j += taken_j
            for o in self._connected:
                o.volts = self._bridge_v
                o.energy_j += taken_j * o.capacitance_f / load.capacitance_f
        self._now_s = to_s

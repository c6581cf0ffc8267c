"""Charge and power of a clutch on a current-limited supply behind a bridge: closed forms for one half period.

::

    supply (<= I, <= V) --+-- R --- bridge ---+-- C + C_stray
                          R_b                 R_leak

In the bridge's frame ``u`` (output voltage times present polarity) the charging is first order in three regimes:

- current limited, ``u < V - R (I - V/R_b)``:  ``C u' = (I - u/R_b) / (1 + R/R_b) - u/R_leak``   (nearly a ramp, ``I t / C``)
- voltage limited:                              ``C u' = (V - u)/R - u/R_leak``
- blocked, ``u > V`` (the supply cannot sink):  ``C u' = -u/(R_b + R) - u/R_leak``

Reversal *clamped* (default): the bridge first shorts the output, then charges it in the other polarity, so the supply gives
``C V`` each half period, ``2 C V f`` in all. *Direct*: the supply drives the whole swing, ``4 C V f``, and must stay at its set
voltage meanwhile. Supply power is the mean of v i at the supply's output, where a current-limited supply sags to the load's
voltage: at least ``C V^2 f`` clamped, ``4 C V^2 f`` direct, against the ``C V^2 f / 2`` of Eq 4.4, which counts one charge a
period. ``C V / I`` is 7.6 ms for the thesis' brake, not the 50 ms of 4.7.1. A reservoir on the bus adds a charge share at each
reversal: ``steady_half_period`` and ``supply_power_w`` know it (``reservoir``); ``Charging``, with its one capacitance, refuses
it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from haptics.errors import InputError
from haptics.physics.brake.reservoir import Bus, steady
from haptics.physics.parameters import Parameters, parameter
from haptics.units import in_range, one_of


@dataclass(frozen=True)
class DriveParameters(Parameters):
    """Supply and bridge (thesis 4.4.3)."""

    supply_current_a: float = parameter(500e-6, "A", "stated", "thesis 4.4.3", low=1e-9, high=1.0)
    supply_volts: float = parameter(2000.0, "V", "stated", "thesis 4.4.3", low=1.0, high=1e5)
    supply_power_w: float = parameter(1.0, "W", "stated", "thesis 4.4.3", low=1e-6, high=1e4)
    bridge_hz: float = parameter(1000.0, "Hz", "stated", "thesis 4.4.3", low=0.1, high=1e6)
    output_resistance_ohm: float = parameter(20e3, "ohm", "assumed", "optocouplers and wiring", low=1.0, high=1e9)
    bleeder_ohm: float = parameter(500e6, "ohm", "assumed", "across the supply", low=1e3, high=1e15)
    stray_f: float = parameter(0.2e-9, "F", "assumed", "wiring and bridge", low=0.0, high=1e-6)
    clamp_s: float = parameter(1e-3, "s", "assumed", "short before a reversal, at most a tenth of a half", low=0.0, high=1.0)
    reservoir_f: float = parameter(0.0, "F", "assumed", "none stated; across the supply, where one is fitted", low=0.0, high=1e-3)


DRIVE = DriveParameters()


@dataclass(frozen=True)
class HalfPeriod:
    """One half period in steady state; a second of it at 0 Hz.

    :param amplitude_v: volts at its end.
    :param charge_c: charge that the supply gave (C), bleeder included.
    :param energy_j: energy that the supply gave (J), bleeder included.
    """

    amplitude_v: float
    charge_c: float
    energy_j: float


class Regime(NamedTuple):
    """First-order motion of the output voltage ``u``: ``u' = (target - u) / tau``.

    :param target_v: volts that ``u`` heads for.
    :param tau_s: time constant (s).
    :param until_v: volts at which the regime ends; nan: it never does.
    :param supply: what limits: "current", "voltage", "blocked" (the supply cannot sink) or "none".
    """

    target_v: float
    tau_s: float
    until_v: float
    supply: str


def moved(u_v: float, regime: Regime, dt_s: float) -> float:
    """``u`` after ``dt_s`` in one regime, exact.

    :param u_v: voltage now (V), in the bridge's frame.
    :param regime: the motion it is in.
    :param dt_s: time passed (s), 0 or more.
    :return: voltage (V) afterwards; the regime's end is not looked at.
    """
    return u_v + (regime.target_v - u_v) * -math.expm1(-dt_s / regime.tau_s)


def volt_seconds(u_v: float, regime: Regime, dt_s: float) -> float:
    """Integral of ``u`` over ``dt_s`` in one regime, exact; a series where the exponential is all but a line.

    :param u_v: voltage now (V), in the bridge's frame.
    :param regime: the motion it is in.
    :param dt_s: time passed (s), 0 or more.
    :return: integral (V s).
    """
    z = dt_s / regime.tau_s
    bend = 0.5 - z / 6.0 + z * z / 24.0 if z < 1e-4 else (z + math.expm1(-z)) / (z * z)
    return u_v * dt_s + (regime.target_v - u_v) * dt_s * z * bend


def time_to_reach_s(u_v: float, level_v: float, regime: Regime) -> float:
    """Time until ``u`` is at a level in one regime.

    :param u_v: voltage now (V).
    :param level_v: voltage waited for (V).
    :param regime: the motion it is in.
    :return: time (s); infinite if it never gets there.
    """
    ahead = regime.target_v - u_v
    if level_v == u_v:
        return 0.0
    share = (level_v - u_v) / ahead if ahead else math.inf
    if not 0.0 < share < 1.0:
        return math.inf
    return -regime.tau_s * math.log1p(-share)


class Charged(NamedTuple):
    """Where charging led.

    :param u_v: voltage at the end (V), in the bridge's frame.
    :param charge_c: taken from the supply (C), bleeder included.
    :param energy_j: taken from the supply (J), bleeder included.
    """

    u_v: float
    charge_c: float
    energy_j: float


class Charging:
    """A load under one setpoint: which regime holds at which ``u``, and where charging leads.

    :param set_v: setpoint of the supply (V), 0 or more.
    :param capacitance_f: of everything on the output (F), stray included, more than 0.
    :param leak_s: leak conductance (siemens), 0 or more.
    :param drive: supply and bridge.
    :param stiff: the supply stays at ``set_v`` while it limits current (direct reversal) instead of sagging to the load.
    :raises InputError: a supply with a reservoir, which makes two capacitances of one.
    """

    def __init__(self, set_v: float, capacitance_f: float, leak_s: float, drive: DriveParameters = DRIVE, stiff: bool = False):
        if drive.reservoir_f:
            raise InputError(
                f"reservoir_f = {drive.reservoir_f:g} F; only steady_half_period and supply_power_w take a reservoir, "
                "elsewhere it must be 0 F"
            )
        self.set_v, self.capacitance_f, self.leak_s = set_v, capacitance_f, leak_s
        self._drive, self._stiff = drive, stiff
        r, r_b, limit_a = drive.output_resistance_ohm, drive.bleeder_ohm, drive.supply_current_a
        knee_v = set_v - r * (limit_a - set_v / r_b)
        through_bleeder, through_supply = 1.0 / (r_b + r) + leak_s, 1.0 / r + leak_s
        ramp_v, hold_v = limit_a / (1.0 + r / r_b) / through_bleeder, set_v / r / through_supply
        self._limited_below_v = min(knee_v, set_v)
        self._blocked = Regime(0.0, capacitance_f / through_bleeder, set_v, "blocked")
        self._current = Regime(ramp_v, capacitance_f / through_bleeder, knee_v if ramp_v > knee_v else math.nan, "current")
        self._voltage = Regime(hold_v, capacitance_f / through_supply, math.nan if hold_v >= knee_v else knee_v, "voltage")

    def regime(self, u_v: float) -> Regime:
        """Which regime holds at a voltage.

        :param u_v: output voltage in the bridge's frame (V).
        :return: the regime, as long as its ``until_v`` is ahead.
        """
        if u_v > self.set_v:
            return self._blocked
        return self._current if u_v < self._limited_below_v else self._voltage

    def charge(self, u_v: float, dt_s: float) -> Charged:
        """Charge for a time, regime by regime; exact.

        :param u_v: output voltage at the start, in the bridge's frame (V).
        :param dt_s: time (s), 0 or more.
        :return: voltage at the end, charge and energy taken from the supply.
        """
        set_v, drive = self.set_v, self._drive
        r, r_b, limit_a = drive.output_resistance_ohm, drive.bleeder_ohm, drive.supply_current_a
        charge_c = energy_j = 0.0
        left_s = dt_s
        # Three regimes need at most a few changes; an equilibrium on a border could change for ever by rounding.
        for changes in range(8):
            regime = self.regime(u_v)
            step_s = left_s
            if changes < 7 and not math.isnan(regime.until_v):
                step_s = min(left_s, time_to_reach_s(u_v, regime.until_v, regime))
            area = volt_seconds(u_v, regime, step_s)
            if regime.supply == "current":
                # Supply: I = i + (u + i R)/R_b; its terminals are at u + i R.
                charge_c += limit_a * step_s
                energy_j += limit_a * (set_v * step_s if self._stiff else (area + r * limit_a * step_s) / (1.0 + r / r_b))
            elif regime.supply == "voltage":
                taken_c = (set_v * step_s - area) / r + set_v / r_b * step_s
                charge_c += taken_c
                energy_j += set_v * taken_c
            if step_s >= left_s:
                return Charged(moved(u_v, regime, step_s), charge_c, energy_j)
            # Falling onto a border, step just below it, where the next regime begins.
            u_v = regime.until_v if regime.supply == "current" else math.nextafter(regime.until_v, -math.inf)
            left_s -= step_s
        return Charged(u_v, charge_c, energy_j)


def steady_half_period(
    set_v: float,
    frequency_hz: float,
    capacitance_f: float,
    drive: DriveParameters = DRIVE,
    reversal: str = "clamped",
    leak_s: float = 0.0,
) -> HalfPeriod:
    """The half period that repeats itself under a bipolar square wave; at 0 Hz a second of constant voltage.

    A reservoir on the bus (``drive.reservoir_f``) counts exactly, charge share and all.

    :param set_v: setpoint (V), 0 to 100 kV.
    :param frequency_hz: of the wave (Hz), 0 to 1 MHz.
    :param capacitance_f: of all clutches on the supply together (F), 0 to 1 mF; stray is added here.
    :param drive: supply and bridge.
    :param reversal: clamped or direct, see above.
    :param leak_s: leak conductance (siemens).
    :return: amplitude at the end of a half period, charge and energy given in it.
    """
    one_of("reversal", reversal, ("clamped", "direct"))
    in_range("set_v", set_v, 0.0, 1e5, "V")
    in_range("frequency_hz", frequency_hz, 0.0, 1e6, "Hz")
    total_f = in_range("capacitance_f", capacitance_f, 0.0, 1e-3, "F") + drive.stray_f
    if total_f == 0.0:
        return HalfPeriod(set_v, 0.0, 0.0)
    if frequency_hz == 0.0:
        return _held_a_second(set_v, total_f, drive, leak_s)
    half_s = 0.5 / frequency_hz
    clamped_s = clamp_time_s(frequency_hz, drive) if reversal == "clamped" else 0.0
    if drive.reservoir_f:
        given = steady(_bus(set_v, total_f, drive, leak_s, reversal == "direct"), clamped_s, half_s)
        return HalfPeriod(given.load_v, given.charge_c, given.energy_j)
    r = drive.output_resistance_ohm
    kept = math.exp(-clamped_s * (1.0 + r * leak_s) / (r * total_f))
    idle_v = bleeder_alone_v(set_v, drive)
    bleed_a = idle_v / drive.bleeder_ohm
    charging = Charging(set_v, total_f, leak_s, drive, stiff=reversal == "direct")
    amplitude_v = set_v
    done = Charged(0.0, 0.0, 0.0)
    # The map from one half period's amplitude to the next contracts (or, direct and current limited, alternates about its fixed
    # point): averaging makes it converge in both cases.
    for _ in range(500):
        done = charging.charge(-amplitude_v * kept, half_s - clamped_s)
        if abs(done.u_v - amplitude_v) <= 1e-12 * max(1.0, set_v):
            break
        amplitude_v = 0.5 * (amplitude_v + done.u_v)
    return HalfPeriod(done.u_v, done.charge_c + bleed_a * clamped_s, done.energy_j + idle_v * bleed_a * clamped_s)


def _held_a_second(set_v: float, total_f: float, drive: DriveParameters, leak_s: float) -> HalfPeriod:
    """A second at constant voltage, all capacitances full at its beginning."""
    if drive.reservoir_f:
        given = _bus(set_v, total_f, drive, leak_s, False).joined(set_v, set_v, 1.0)
        return HalfPeriod(given.load_v, given.charge_c, given.energy_j)
    done = Charging(set_v, total_f, leak_s, drive).charge(set_v, 1.0)
    return HalfPeriod(done.u_v, done.charge_c, done.energy_j)


def _bus(set_v: float, total_f: float, drive: DriveParameters, leak_s: float, stiff: bool) -> Bus:
    r, r_b = drive.output_resistance_ohm, drive.bleeder_ohm
    return Bus(drive.supply_current_a, set_v, r, r_b, drive.reservoir_f, total_f, leak_s, stiff)


def bleeder_alone_v(set_v: float, drive: DriveParameters = DRIVE) -> float:
    """The supply's volts with nothing but its bleeder: the setpoint, or what its current makes of a bleeder too strong for it.

    :param set_v: setpoint (V), 0 or more.
    :param drive: supply and bridge.
    :return: volts at the supply's output.
    """
    return min(set_v, drive.supply_current_a * drive.bleeder_ohm)


def clamp_time_s(frequency_hz: float, drive: DriveParameters = DRIVE) -> float:
    """How long the bridge shorts the output before each reversal: ``clamp_s``, at most a tenth of a half period.

    :param frequency_hz: of the wave (Hz), 0 or more.
    :param drive: supply and bridge.
    :return: time (s).
    """
    return drive.clamp_s if frequency_hz == 0.0 else min(drive.clamp_s, 0.05 / frequency_hz)


def supply_power_w(
    set_v: float, frequency_hz: float, capacitance_f: float, drive: DriveParameters = DRIVE, reversal: str = "clamped"
) -> float:
    """Mean of v i at the supply's output in steady state, bleeder and stray included.

    :param set_v: as ``steady_half_period``.
    :param frequency_hz: as ``steady_half_period``.
    :param capacitance_f: as ``steady_half_period``.
    :param drive: supply and bridge.
    :param reversal: as ``steady_half_period``.
    :return: power (W).
    :raises InputError: as ``steady_half_period``.
    """
    half = steady_half_period(set_v, frequency_hz, capacitance_f, drive, reversal)
    return half.energy_j * (2.0 * frequency_hz if frequency_hz else 1.0)


def eq44_power_w(volts: float, frequency_hz: float, capacitance_f: float) -> float:
    """``C V^2 f / 2`` (Eq 4.4): 57.3 mW at 1500 V and 20 Hz. It counts one charge a period, where a bipolar bridge makes two.

    :param volts: amplitude (V).
    :param frequency_hz: of the wave (Hz).
    :param capacitance_f: of one clutch (F).
    :return: power (W).
    """
    return 0.5 * capacitance_f * volts**2 * frequency_hz


def max_frequency_hz(set_v: float, capacitance_f: float, drive: DriveParameters = DRIVE, reversal: str = "clamped") -> float:
    """Fastest full swing the supply's current allows: ``I / (2 C V)`` clamped, ``I / (4 C V)`` direct; at most the bridge's.

    :param set_v: setpoint (V), 0 to 100 kV.
    :param capacitance_f: of all clutches on the supply together (F), 0 to 1 mF; stray is added here.
    :param drive: supply and bridge.
    :param reversal: clamped or direct.
    :return: frequency (Hz).
    :raises InputError: a number outside its range, or an unknown reversal.
    """
    one_of("reversal", reversal, ("clamped", "direct"))
    in_range("set_v", set_v, 0.0, 1e5, "V")
    in_range("capacitance_f", capacitance_f, 0.0, 1e-3, "F")
    charge_c = (2.0 if reversal == "clamped" else 4.0) * (capacitance_f + drive.stray_f) * set_v
    return min(drive.bridge_hz, drive.supply_current_a / charge_c) if charge_c else drive.bridge_hz


def rise_time_s(
    set_v: float, capacitance_f: float, drive: DriveParameters = DRIVE, share: float = 0.9, leak_s: float = 0.0
) -> float:
    """Time from 0 V to a share of the setpoint: t90 by default.

    :param set_v: setpoint (V), 0 to 100 kV.
    :param capacitance_f: of all clutches on the supply together (F), 0 to 1 mF; stray is added here.
    :param drive: supply and bridge.
    :param share: of the setpoint, 0 to 1.
    :param leak_s: leak conductance (siemens).
    :return: time (s); infinite if the supply never gets there.
    :raises InputError: a number outside its range, or a supply with a reservoir.
    """
    in_range("share", share, 0.0, 1.0)
    in_range("set_v", set_v, 0.0, 1e5, "V")
    total_f = in_range("capacitance_f", capacitance_f, 0.0, 1e-3, "F") + drive.stray_f
    level_v, u_v, time_s = share * set_v, 0.0, 0.0
    charging = Charging(set_v, total_f, leak_s, drive)
    while u_v < level_v and total_f > 0.0:
        regime = charging.regime(u_v)
        stop_v = level_v if math.isnan(regime.until_v) else min(level_v, regime.until_v)
        time_s += time_to_reach_s(u_v, stop_v, regime)
        if math.isinf(time_s):
            return math.inf
        u_v = stop_v
    return time_s


def discharge_time_s(from_v: float, to_v: float, capacitance_f: float, drive: DriveParameters = DRIVE) -> float:
    """Time for the shorted bridge to bring an output from one voltage down to another: ``R C ln(from/to)``.

    :param from_v: voltage at the start (V), 0 to 1 MV.
    :param to_v: voltage waited for (V), 1 nV to 1 MV.
    :param capacitance_f: of the clutch (F); stray is added here.
    :param drive: supply and bridge.
    :return: time (s); 0 if the output is below ``to_v`` already.
    :raises InputError: a voltage outside its range.
    """
    in_range("to_v", to_v, 1e-9, 1e6, "V")
    in_range("from_v", from_v, 0.0, 1e6, "V")
    tau_s = drive.output_resistance_ohm * (capacitance_f + drive.stray_f)
    return tau_s * math.log(from_v / to_v) if from_v > to_v else 0.0

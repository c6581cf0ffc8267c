"""This project's models of a run of the brake, at given instants."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from haptics.errors import InputError
from haptics.physics.brake.charging import HalfPeriod, clamp_time_s, steady_half_period
from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.reservoir import Bus
from rigs.judge.judgement import Floats
from rigs.judge.netlists.brake import BrakeRun


class Followed(NamedTuple):
    """A run of the brake as the models see it.

    :param volts: on the clutches at each instant (n,), V.
    :param bus: volts on the bus (n,), V.
    :param charge_c: given by the supply until the last instant, C.
    :param energy_j: likewise, J.
    """

    volts: Floats
    bus: Floats
    charge_c: float
    energy_j: float


def followed(run: BrakeRun, time_s: Floats) -> Followed:
    """The run by ``OutputStage``, or where a reservoir stands on the bus by its two capacitances.

    :param run: to follow.
    :param time_s: instants (n,), s, ascending.
    :return: volts at each instant, charge and energy at the last.
    """
    return _two_capacitances(run, time_s) if run.system.drive.reservoir_f else _stage(run, time_s)


def repeating_half(run: BrakeRun) -> HalfPeriod:
    """The half period that the run's last setpoint leads to.

    :param run: with a frequency above 0 Hz.
    :return: its closed form.
    """
    system = run.system
    driven_f = run.total_f - system.drive.stray_f
    leak_s = sum(1.0 / ohm for ohm in run.leaks_ohm)
    return steady_half_period(run.setpoints[-1][1], run.frequency_hz, driven_f, system.drive, system.reversal, leak_s)


def _stage(run: BrakeRun, time_s: Floats) -> Followed:
    system = run.system
    stage = OutputStage([system.capacitance_f(k) for k in range(system.outputs)], system.drive, reversal=system.reversal)
    for output, leak_ohm in enumerate(run.leaks_ohm):
        stage.set_output(0.0, output, leak_ohm=leak_ohm)
    all_of_them, ahead = (1 << system.outputs) - 1, list(run.setpoints)
    volts, bus = np.empty(len(time_s)), np.empty(len(time_s))
    for at, now_s in enumerate(time_s.tolist()):
        while ahead and ahead[0][0] <= now_s:
            from_s, set_v = ahead.pop(0)
            stage.drive(from_s, all_of_them, set_v, run.frequency_hz)
        stage.advance(now_s)
        volts[at], bus[at] = stage.voltage_v(0), stage.bus_v
    return Followed(volts, bus, stage.charge_c, stage.energy_j)


def _two_capacitances(run: BrakeRun, time_s: Floats) -> Followed:
    """Bus and load from 0 V on, turned at each reversal, shorted while clamped.

    :raises InputError: more than one setpoint, or constant voltage: neither is needed to judge a reservoir.
    """
    if len(run.setpoints) != 1 or run.frequency_hz == 0.0:
        raise InputError(
            f"{len(run.setpoints)} setpoints at {run.frequency_hz:g} Hz; a reservoir is judged with one setpoint, above 0 Hz"
        )
    drive, direct = run.system.drive, run.system.reversal == "direct"
    bus = Bus(
        drive.supply_current_a, run.setpoints[0][1], drive.output_resistance_ohm, drive.bleeder_ohm, drive.reservoir_f,
        run.total_f, sum(1.0 / ohm for ohm in run.leaks_ohm), direct,
    )  # fmt: skip
    half_s = 0.5 / run.frequency_hz
    clamp_s = 0.0 if direct else clamp_time_s(run.frequency_hz, drive)
    bus_v = load_v = charge_c = energy_j = at_s = reversed_s = 0.0
    clamp_s, pause_s, next_s, sign = 0.0, clamp_s, 0.5 * half_s, 1.0
    volts, on_bus = np.empty(len(time_s)), np.empty(len(time_s))
    for at, now_s in enumerate(time_s.tolist()):
        while at_s < now_s:
            shorting = at_s < reversed_s + clamp_s
            until_s = min(now_s, next_s, reversed_s + clamp_s if shorting else now_s)
            given = (bus.shorted if shorting else bus.joined)(bus_v, load_v, until_s - at_s)
            bus_v, load_v, at_s = given.bus_v, given.load_v, until_s
            charge_c, energy_j = charge_c + given.charge_c, energy_j + given.energy_j
            if at_s >= next_s:
                load_v, sign, reversed_s, clamp_s, next_s = -load_v, -sign, next_s, pause_s, next_s + half_s
        volts[at], on_bus[at] = sign * load_v, bus_v
    return Followed(volts, on_bus, charge_c, energy_j)

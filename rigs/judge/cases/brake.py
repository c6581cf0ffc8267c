"""Cases of the brake's drive, and how far model and simulator may lie apart in each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from haptics.physics.brake.charging import DRIVE
from haptics.physics.brake.force_laws import default_law
from haptics.physics.brake.system import BrakeSystem
from rigs.judge.judgement import Floats, Judgement, judged_curve, judged_number, running_integral
from rigs.judge.netlists.brake import (
    DIODE_EMISSION,
    DIODE_SATURATION_A,
    SWITCH_OFF_OHM,
    SWITCH_ON_OHM,
    BrakeRun,
    brake_netlist,
    bridge_legs,
)
from rigs.judge.netlists.brake_models import followed, repeating_half
from rigs.judge.ngspice import Saved, simulate
from rigs.judge.transient import RELATIVE_TOLERANCE

_THERMAL_V = 0.025865
"""k T/q at the simulator's 27 degrees Celsius."""


@dataclass(frozen=True)
class BrakeCase:
    """One run of the brake's drive, to be judged.

    :param name: for people.
    :param run: what is driven, and how.
    :param repeats: the last half period repeats, and its closed form is judged too.
    :param quick: among the few cases of a quick judgement.
    """

    name: str
    run: BrakeRun
    repeats: bool = True
    quick: bool = False

    def judged(self) -> list[Judgement]:
        """Run it and compare.

        :return: one judgement for each quantity.
        :raises HapticsError: ngspice is not installed, or failed.
        """
        return self.compared(simulate(brake_netlist(self.run)))

    def compared(self, saved: Saved) -> list[Judgement]:
        """The models of this run against what a simulator saved.

        :param saved: of a run of ``brake_netlist``.
        :return: one judgement for each quantity.
        """
        run, time_s = self.run, saved["time"]
        volts, ours = saved["v(load)"] - saved["v(b)"], followed(run, time_s)
        times, charge_c = running_integral(time_s, saved["i(vmeter)"])
        # Power is counted where the supply is stiff: at the bus, or before the regulator.
        stiff = run.system.reversal == "direct"
        power_w = -saved["i(vset)"] * saved["v(set)"] if stiff else saved["i(vmeter)"] * saved["v(bus)"]
        energy_j = running_integral(time_s, power_w)[1]
        parts = volts_apart(run, len(time_s))
        halves = 2.0 * run.frequency_hz * run.end_s + 1.0
        charge, energy = _supply_apart(run, parts, halves, float(charge_c[-1]), run.end_s)
        rows = [
            judged_curve(self.name, "volts on the clutches", time_s, ours.volts, volts, "V", parts),
            judged_number(self.name, "charge given", ours.charge_c, float(charge_c[-1]), "C", sum(charge.values()), charge),
            judged_number(self.name, "energy given", ours.energy_j, float(energy_j[-1]), "J", sum(energy.values()), energy),
        ]
        if run.system.reversal == "clamped":
            # A bus without a reservoir jumps with the bridge, and half an edge early is as wrong as can be: edges are left out.
            apart = _away_from_edges(run, time_s)
            bus = judged_curve(self.name, "volts on the bus", time_s[apart], ours.bus[apart], saved["v(bus)"][apart], "V", parts)
            rows.insert(1, bus)
        if self.repeats:
            half_s, again = 0.5 / run.frequency_hz, repeating_half(run)
            taken_c = float(charge_c[-1] - np.interp(run.end_s - half_s, times, charge_c))
            taken_w = float(energy_j[-1] - np.interp(run.end_s - half_s, times, energy_j)) / half_s
            _, once = _supply_apart(run, parts, 1.0, taken_c, half_s)
            watts = {name: joule / half_s for name, joule in once.items()}
            rows += [
                judged_number(
                    self.name, "amplitude", again.amplitude_v, abs(float(volts[-1])), "V", sum(parts.values()), parts
                ),
                judged_number(
                    self.name, "supply power", again.energy_j / half_s, taken_w, "W", sum(watts.values()), watts
                ),
            ]  # fmt: skip
        return rows


def _away_from_edges(run: BrakeRun, time_s: Floats) -> NDArray[np.bool_]:
    """Instants at which no source is on its way from one stair to the next; the end may be the instant of a reversal."""
    away = np.abs(time_s - run.end_s) > run.transient.edge_s
    for at_s in {at_s for steps in (*bridge_legs(run), run.setpoints) for at_s, _ in steps}:
        away &= np.abs(time_s - at_s) > run.transient.edge_s
    return away


def volts_apart(run: BrakeRun, points: int) -> dict[str, float]:
    """What may separate the volts, each from a choice of the netlist (or, last, of the model).

    - on: the switches lengthen ``R C`` by ``d = 2 R_on/R``; of an exponential that is at most ``d/e`` of its swing.
    - edges: half an edge, at the maximum slope.
    - diodes: each drop from none to that at full current.
    - steps: the simulator's tolerance of a step, times the steps of a half period.
    - off: what the open switches let through in a half period.
    - border: the model has the supply give nothing from ``V`` on up, where it gives part of the bleeder's current
      until ``V (1 + R/R_b)``; only a lowered setpoint leads there.

    :param run: to be judged.
    :param points: instants that the simulator saved.
    :return: bound of each part by name, V.
    """
    drive, clamped = run.system.drive, run.system.reversal == "clamped"
    volts, r = run.max_v, drive.output_resistance_ohm
    swing_v = volts if clamped else 2.0 * volts
    steep = clamped or drive.reservoir_f > 0.0
    slope = swing_v / (r * run.total_f) if steep else drive.supply_current_a / run.total_f
    half_s = 0.5 / run.frequency_hz if run.frequency_hz else run.end_s
    halves = max(1.0, run.end_s / half_s)
    set_v = [volts for _, volts in run.setpoints]
    lowered_v = max([after for before, after in pairwise(set_v) if after < before], default=0.0)
    return {
        "on": swing_v * 2.0 * SWITCH_ON_OHM / r / math.e,
        "edges": slope * 0.5 * run.transient.edge_s,
        "diodes": 2.0 * DIODE_EMISSION * _THERMAL_V * math.log(drive.supply_current_a / DIODE_SATURATION_A),
        "steps": RELATIVE_TOLERANCE * volts * points / halves,
        "off": 2.0 * volts / SWITCH_OFF_OHM * half_s / run.total_f,
        "border": lowered_v * r / drive.bleeder_ohm,
    }


def _supply_apart(
    run: BrakeRun, parts: dict[str, float], halves: float, charge_c: float, span_s: float
) -> tuple[dict[str, float], dict[str, float]]:
    """What may separate charge and energy, over so many half periods that took ``charge_c`` and ``span_s`` in all.

    Volts that are off at the end of a half period are so much charge, by the load's and the reservoir's capacitance.
    """
    drive, stored_f = run.system.drive, run.total_f + run.system.drive.reservoir_f
    charge = {
        "volts": stored_f * (sum(parts.values()) + (halves - 1.0) * parts["diodes"]),
        "edges": 2.0 * halves * drive.supply_current_a * run.transient.edge_s,
        "off": 2.0 * run.max_v / SWITCH_OFF_OHM * span_s,
        "bleeder": sum(parts.values()) / drive.bleeder_ohm * span_s,
    }
    energy = {name: run.max_v * part for name, part in charge.items()}
    return charge, energy | {"diodes": parts["diodes"] * charge_c}


def _wave(
    name: str, volts: float, hertz: float, halves: int = 4, clutches: int = 1, leak_ohm: float = 0.0, reversal: str = "clamped",
    repeats: bool = True, quick: bool = False, **drive: float,
) -> BrakeCase:  # fmt: skip
    """A square wave from 0 s on: half a half period, then ``halves`` whole ones, up to the instant of a reversal."""
    system = BrakeSystem(laws=(default_law("index"),) * clutches, drive=DRIVE.with_values(**drive), reversal=reversal)
    leaks = (leak_ohm,) * clutches if leak_ohm else ()
    run = BrakeRun(system, ((0.0, volts),), hertz, (0.25 + 0.5 * halves) / hertz, leaks)
    return BrakeCase(f"brake, {name}", run, repeats, quick)


def brake_cases() -> list[BrakeCase]:
    """All cases of the brake's drive: volts, frequencies, reversals, loads, setpoints that change, and a reservoir.

    :return: the cases, quick ones among them.
    """
    plain = BrakeSystem()
    return [
        *[
            _wave(f"{volts:g} V at {hertz:g} Hz", volts, hertz, quick=(volts, hertz) == (1500.0, 20.0))
            for volts in (250.0, 750.0, 1500.0)
            for hertz in (5.0, 10.0, 20.0, 50.0, 60.0)
        ],
        *[
            _wave(f"{volts:g} V at {hertz:g} Hz, direct", volts, hertz, reversal="direct", quick=(volts, hertz) == (1500.0, 20.0))
            for volts in (250.0, 1500.0)
            for hertz in (5.0, 20.0)
        ],
        # Current limits the whole swing: a half period that ends high makes the next end low, and only the bleeder damps it.
        _wave("1500 V at 50 Hz, direct", 1500.0, 50.0, reversal="direct", repeats=False),
        _wave("two clutches", 1500.0, 20.0, clutches=2),
        _wave("eight clutches", 1500.0, 10.0, clutches=8),
        _wave("leak of 5 Mohm", 1500.0, 10.0, leak_ohm=5e6, quick=True),
        _wave("leak of 100 kohm at 1 kHz", 300.0, 1000.0, halves=12, leak_ohm=1e5),
        _wave("stray of 2 nF", 1500.0, 20.0, stray_f=2e-9),
        _wave("bleeder of 10 Mohm", 1500.0, 20.0, bleeder_ohm=1e7),
        _wave("bleeder too strong for the supply", 1500.0, 20.0, bleeder_ohm=2e6, quick=True),
        BrakeCase("brake, constant volts with a leak", BrakeRun(plain, ((0.0, 1000.0),), 0.0, 0.1, (2e7,)), repeats=False),
        BrakeCase(
            "brake, setpoint lowered and raised",
            BrakeRun(plain, ((0.0, 1500.0), (0.03, 600.0), (0.11, 1000.0)), 10.0, 0.225),
            repeats=False,
        ),
        BrakeCase(
            "brake, setpoint lowered with a bleeder of 10 Mohm",
            BrakeRun(BrakeSystem(drive=DRIVE.with_values(bleeder_ohm=1e7)), ((0.0, 1500.0), (0.03, 1000.0)), 5.0, 0.15),
            repeats=False,
        ),
        _wave("reservoir of 1 nF", 1500.0, 20.0, reservoir_f=1e-9),
        _wave("reservoir of 5 nF", 1500.0, 20.0, halves=6, reservoir_f=5e-9, quick=True),
        _wave("reservoir of 20 nF", 1500.0, 20.0, halves=10, reservoir_f=20e-9),
        _wave("reservoir of 5 nF, direct", 1500.0, 20.0, halves=10, reservoir_f=5e-9, reversal="direct"),
    ]

"""Cases of coils on a shared supply, and how far model and simulator may lie apart in each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS, LatchParameters
from haptics.physics.latch.pulse import latch_plant
from rigs.judge.judgement import Floats, Judgement, judged_curve, judged_number, running_integral
from rigs.judge.netlists.coil import SWITCH_ON_OHM, CoilRun, coil_netlist
from rigs.judge.ngspice import Saved, simulate
from rigs.judge.transient import RELATIVE_TOLERANCE

HELD = LATCH.with_values(thrust_n_a=0.0)
"""A coil that moves nothing: its pin stays, as if held."""


def shared_volts(run: CoilRun) -> float:
    """Terminal volts with all coils on and settled: ``V = V0 / (1 + Rs sum(1/R))``.

    :param run: coils and supply.
    :return: V.
    """
    return run.volts / (1.0 + run.shared_ohm * sum(1.0 / coil.resistance_ohm for coil in run.coils))


@dataclass(frozen=True)
class CoilCase:
    """One pulse. The model puts the settled volts on each coil at once; the simulator lets them sag as the currents rise.

    :param name: for people.
    :param run: coils, supply and pulse.
    :param quick: among the few cases of a quick judgement.
    """

    name: str
    run: CoilRun
    quick: bool = False

    def judged(self) -> list[Judgement]:
        """Run it and compare.

        :return: one judgement for each quantity.
        :raises HapticsError: ngspice is not installed, or failed.
        """
        return self.compared(simulate(coil_netlist(self.run)))

    def compared(self, saved: Saved) -> list[Judgement]:
        """The models against what a simulator saved: volts, and of the coil that is furthest off current and energy.

        :param saved: of a run of ``coil_netlist``.
        :return: settled volts, current, energy of a pulse.
        """
        run, time_s, volts = self.run, saved["time"], shared_volts(self.run)
        before_off = int(np.searchsorted(time_s, run.on_s - run.transient.edge_s)) - 1
        # What the last instant before the edge has not settled yet, and what the switches take.
        settled = {"unsettled": volts * math.exp(-time_s[before_off] / _slowest_s(run)), "switches": volts * 2.0 * _switch(run)}
        settled["steps"] = RELATIVE_TOLERANCE * volts * len(time_s)
        rows = [
            judged_number(
                self.name, "settled volts", volts, float(saved["v(rail)"][before_off]), "V", sum(settled.values()), settled
            )
        ]  # fmt: skip
        # Coils that are alike in all that counts are alike in what they do.
        alike = {(coil.resistance_ohm, coil.inductance_h): k for k, coil in enumerate(run.coils)}
        currents, energies = zip(*[self._coil(k, saved, volts) for k in alike.values()], strict=True)
        return [*rows, max(currents, key=_off), max(energies, key=_off)]

    def _coil(self, k: int, saved: Saved, volts: float) -> tuple[Judgement, Judgement]:
        run, time_s, coil = self.run, saved["time"], self.run.coils[k]
        current, terminal = saved[f"i(vmeter{k})"], saved[f"v(t{k})"]
        times, taken_j = running_integral(time_s, current * terminal)
        simulated_j = float(np.interp(run.on_s, times, taken_j))
        full_a, edge_s = volts / coil.resistance_ohm, run.transient.edge_s
        # What the shared resistance still gives while currents rise, integrated over time (V s), and the slowest of the coils.
        extra = run.shared_ohm * sum(volts / c.resistance_ohm * c.inductance_h / c.resistance_ohm for c in run.coils)
        sagging_v = run.shared_ohm * sum(volts / c.resistance_ohm for c in run.coils)
        apart_a = {
            "sag": sagging_v * _slowest_s(run) / (math.e * coil.inductance_h),
            "edges": 0.5 * edge_s * run.volts / coil.inductance_h,
            "switches": full_a * 2.0 * _switch(run),
            "steps": RELATIVE_TOLERANCE * full_a * len(time_s),
        }
        # A trapezoid of a step whose truncation is bounded so is off by no more than that.
        apart_j = {
            "sag": 2.0 * full_a * extra,
            "edges": edge_s * volts * full_a,
            "others": volts * run.on_s * (apart_a["switches"] + apart_a["steps"]),
        }
        ours_a, _ = _plant(coil, run, volts, time_s, "reference")
        _, ours_j = _plant(coil, run, volts, time_s[-1:], "dynamic")
        return (
            judged_curve(self.name, "current", time_s, ours_a, current, "A", apart_a),
            judged_number(self.name, "energy of a pulse", ours_j, simulated_j, "J", sum(apart_j.values()), apart_j),
        )


def _plant(coil: LatchParameters, run: CoilRun, volts: float, time_s: Floats, level: str) -> tuple[Floats, float]:
    """Current at each instant, and energy taken, of one level of the latch with its pin held."""
    plant = latch_plant(level, coil.with_values(thrust_n_a=0.0))
    plant.drive(0.0, volts)
    on, currents = True, np.empty(len(time_s))
    for at, now_s in enumerate(time_s.tolist()):
        if on and now_s >= run.on_s:
            plant.drive(run.on_s, 0.0)
            on = False
        plant.advance(now_s)
        currents[at] = plant.current_a
    return currents, plant.energy_j


def _slowest_s(run: CoilRun) -> float:
    return max(coil.inductance_h / coil.resistance_ohm for coil in run.coils)


def _switch(run: CoilRun) -> float:
    """Share of a coil's resistance that is its switch."""
    return SWITCH_ON_OHM / min(coil.resistance_ohm for coil in run.coils)


def _off(row: Judgement) -> float:
    return row.error_worst / row.allowed


def coil_cases() -> list[CoilCase]:
    """One coil alone, one glove's coils at once, and three unlike coils. Pulses of 2 ms (thesis 3.4.5).

    :return: the cases, quick ones among them.
    """
    on_s, end_s = 2e-3, 2.2e-3
    unlike = [
        HELD.with_values(resistance_ohm=ohm, inductance_h=henry) for ohm, henry in ((1.28, 20e-6), (1.38, 30e-6), (1.48, 12e-6))
    ]
    return [
        CoilCase("coil alone", CoilRun((HELD,), NOMINAL_VOLTS, 0.0, on_s, end_s), quick=True),
        CoilCase("15 coils, 20 mohm shared", CoilRun((HELD,) * 15, NOMINAL_VOLTS, 0.02, on_s, end_s), quick=True),
        CoilCase("3 unlike coils, 50 mohm shared", CoilRun(tuple(unlike), NOMINAL_VOLTS, 0.05, on_s, end_s)),
    ]

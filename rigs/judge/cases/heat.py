"""Cases of one actuator's heat, and how far model and simulator may lie apart in each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptics.physics.thermal.one_node import PULSE_ENERGY_J, PULSE_POWER_W, PULSE_S, THERMAL, relax
from haptics.physics.thermal.two_node import TWO_NODE, TwoNodeHeat, TwoNodeParameters
from rigs.judge.judgement import Floats, Judgement, judged_curve
from rigs.judge.netlists.heat import HeatRun, full_heat_j, heat_netlist
from rigs.judge.ngspice import Saved, simulate
from rigs.judge.transient import RELATIVE_TOLERANCE


@dataclass(frozen=True)
class HeatCase:
    """One course of power.

    :param name: for people.
    :param run: parameters and power over time.
    :param quick: among the few cases of a quick judgement.
    """

    name: str
    run: HeatRun
    quick: bool = False

    def judged(self) -> list[Judgement]:
        """Run it and compare.

        :return: one judgement for each node.
        :raises HapticsError: ngspice is not installed, or failed.
        """
        return self.compared(simulate(heat_netlist(self.run)))

    def compared(self, saved: Saved) -> list[Judgement]:
        """The models against what a simulator saved, one row a node.

        :param saved: of a run of ``heat_netlist``.
        :return: rise of the body, and of the coil where it is a node.
        """
        run, time_s = self.run, saved["time"]
        body_k, coil_k = _followed(run, time_s)
        rows = [
            judged_curve(self.name, "rise of the body", time_s, body_k, saved["v(body)"], "K", _apart(run, "body", len(time_s)))
        ]
        if coil_k is not None:
            apart = _apart(run, "coil", len(time_s))
            rows.append(judged_curve(self.name, "rise of the coil", time_s, coil_k, saved["v(coil)"], "K", apart))
        return rows


def _apart(run: HeatRun, node: str, points: int) -> dict[str, float]:
    """What may separate a rise: half an edge of power, and the simulator's tolerance of a step over all steps.

    A step may misplace its tolerance's share of all the heat in either node; of a coil whose memory is short only the steps since
    the last stair of power count, but the bound is kept simple.
    """
    p = run.parameters
    capacity = (
        p.tau_s / p.c_k_per_w if not isinstance(p, TwoNodeParameters) else p.coil_j_per_k if node == "coil" else p.body_j_per_k
    )
    watts = max(watts for _, watts in run.powers)
    return {
        "edges": 0.5 * watts * run.transient.edge_s / capacity,
        "steps": RELATIVE_TOLERANCE * full_heat_j(run) / capacity * points,
    }


def _followed(run: HeatRun, time_s: Floats) -> tuple[Floats, Floats | None]:
    """Rise of the body, and of the coil where it is a node of its own, at each instant."""
    p, ahead, watts, now_s, rise_k = run.parameters, list(run.powers), 0.0, 0.0, 0.0
    pair = TwoNodeHeat(p) if isinstance(p, TwoNodeParameters) else None
    body_k, coil_k = np.empty(len(time_s)), np.empty(len(time_s))
    for at, to_s in enumerate(time_s.tolist()):
        while now_s < to_s:
            while ahead and ahead[0][0] <= now_s:
                watts = ahead.pop(0)[1]
            until_s = min(to_s, ahead[0][0]) if ahead else to_s
            if pair is not None:
                pair.advance(until_s - now_s, watts)
            elif not isinstance(p, TwoNodeParameters):
                rise_k = relax(rise_k, watts, until_s - now_s, p)
            now_s = until_s
        body_k[at] = rise_k if pair is None else pair.rise_k
        coil_k[at] = 0.0 if pair is None else pair.coil_rise_k
    return body_k, None if pair is None else coil_k


def heat_cases() -> list[HeatCase]:
    """Six minutes at 2 Hz and as long to cool (thesis 3.5.2), by mean power; and its first ten seconds, pulse by pulse.

    :return: the cases, quick ones among them.
    """
    hertz, heated_s = 2.0, 360.0
    mean = ((0.0, PULSE_ENERGY_J * hertz), (heated_s, 0.0))
    edges = [(k / hertz + late_s, watts) for k in range(20) for late_s, watts in ((0.0, PULSE_POWER_W), (PULSE_S, 0.0))]
    cases = []
    for name, parameters in (("one node", THERMAL), ("two nodes", TWO_NODE)):
        cases += [
            HeatCase(f"heat of {name}, 6 min at 2 Hz", HeatRun(parameters, mean, 2.0 * heated_s, 1.0)),
            HeatCase(f"heat of {name}, true pulses", HeatRun(parameters, tuple(edges), 10.0, 10e-3), quick=True),
        ]
    return cases

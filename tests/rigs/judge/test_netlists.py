from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.physics.brake.charging import DRIVE
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.latch.parameters import LATCH
from haptics.physics.thermal.one_node import THERMAL
from haptics.physics.thermal.two_node import TWO_NODE
from rigs.judge.netlists.brake import BrakeRun, brake_netlist, bridge_legs
from rigs.judge.netlists.coil import CoilRun, coil_netlist
from rigs.judge.netlists.heat import HeatRun, heat_netlist
from rigs.judge.ngspice import simulate

WAVE = BrakeRun(BrakeSystem(), ((0.0, 1500.0),), 20.0, 62.5e-3, (1e8,))
PULSE = CoilRun((LATCH, LATCH), 5.0, 0.05, 2e-3, 2.2e-3)
WARMING = HeatRun(THERMAL, ((0.0, 0.36), (60.0, 0.0)), 100.0, 1.0)


def drive(**values):
    return replace(WAVE, system=BrakeSystem(drive=DRIVE.with_values(**values)))


def brake(**values):
    return replace(WAVE, system=BrakeSystem(brake=BRAKE.with_values(**values)))


def two_nodes(**values):
    return replace(WARMING, parameters=TWO_NODE.with_values(**values))


def mean(saved, name):
    """Over time; the simulator's instants need not be even."""
    return float(np.trapezoid(saved[name], saved["time"]) / saved["time"][-1])


def size(saved, name):
    return float(np.sqrt(np.trapezoid(saved[name] ** 2, saved["time"]) / saved["time"][-1]))


@pytest.mark.slow
@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize(
    ("changed", "name", "measure"),
    [
        (drive(supply_current_a=450e-6), "v(load)", size),
        (drive(output_resistance_ohm=40e3), "v(bus)", size),
        (drive(bleeder_ohm=1e7), "i(vmeter)", mean),
        (drive(stray_f=0.5e-9), "i(vmeter)", mean),
        (drive(stray_f=0.0), "i(vmeter)", mean),
        (drive(clamp_s=0.5e-3), "v(load)", size),
        (drive(reservoir_f=2e-9), "i(vmeter)", mean),
        (brake(thickness_m=12e-6), "i(vmeter)", mean),
        (brake(permittivity=3.0), "i(vmeter)", mean),
        (replace(WAVE, system=BrakeSystem(strips=2)), "i(vmeter)", mean),
        (replace(WAVE, system=BrakeSystem(overlaps_m2=(5e-4,))), "i(vmeter)", mean),
        (replace(WAVE, system=BrakeSystem(reversal="direct")), "i(vmeter)", mean),
        (replace(WAVE, leaks_ohm=(1e7,)), "i(vmeter)", mean),
        (replace(WAVE, setpoints=((0.0, 1500.0), (0.03, 1000.0))), "v(load)", size),
        (replace(WAVE, frequency_hz=30.0), "i(vmeter)", mean),
    ],
)
def test_each_parameter_of_the_brake_changes_what_the_simulator_says(changed, name, measure):
    before, after = (measure(simulate(brake_netlist(run)), name) for run in (WAVE, changed))
    # Repeats of one netlist are the same to the last digit; what is changed here shows in the first three.
    assert abs(after / before - 1.0) > 1e-3


@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize(
    "changed",
    [
        replace(PULSE, coils=(LATCH.with_values(resistance_ohm=1.3), LATCH)),
        replace(PULSE, coils=(LATCH.with_values(inductance_h=40e-6), LATCH)),
        replace(PULSE, coils=(LATCH,)),
        replace(PULSE, shared_ohm=0.0),
        replace(PULSE, volts=4.9),
        replace(PULSE, on_s=1.9e-3),
    ],
)
def test_each_parameter_of_the_coils_changes_what_the_simulator_says(changed):
    before, after = (size(simulate(coil_netlist(run)), "i(vmeter0)") for run in (PULSE, changed))
    assert abs(after / before - 1.0) > 1e-3


@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize(
    ("plain", "changed"),
    [
        (WARMING, replace(WARMING, parameters=THERMAL.with_values(tau_s=97.0))),
        (WARMING, replace(WARMING, parameters=THERMAL.with_values(c_k_per_w=79.0))),
        (WARMING, replace(WARMING, powers=((0.0, 0.36), (59.0, 0.0)))),
        (two_nodes(), two_nodes(tau_s=97.0)),
        (two_nodes(), two_nodes(c_k_per_w=79.0)),
        (two_nodes(), two_nodes(coil_j_per_k=0.15)),
        (two_nodes(), two_nodes(coupling_w_per_k=0.02)),
        (WARMING, two_nodes()),
    ],
)
def test_each_parameter_of_heat_changes_what_the_simulator_says(plain, changed):
    before, after = (mean(simulate(heat_netlist(run)), "v(body)") for run in (plain, changed))
    assert abs(after / before - 1.0) > 1e-3


def test_the_netlist_holds_components_not_a_solution():
    text = brake_netlist(replace(drive(reservoir_f=3e-9), leaks_ohm=(2e7,)))
    parts = [line.split()[0] for line in text.splitlines()[1:] if not line.startswith(".")]
    assert parts == [
        "Vset", "Ilimit", "Dclamp", "Dseries", "Vmeter", "Rbleeder", "Creservoir", "Vone", "Vlega", "Vlegb",
        "Sup_a", "Sdown_a", "Sup_b", "Sdown_b", "Rout", "Cstray", "C0", "Rleak0",
    ]  # fmt: skip
    assert "exp" not in text


def test_the_bridge_turns_first_after_a_quarter_period_and_shorts_before_each_turn():
    leg_a, leg_b = bridge_legs(WAVE)
    assert leg_a == [(0.0, 1.0), (12.5e-3, 0.0), (pytest.approx(38.5e-3), 1.0)]
    assert leg_b == [(0.0, 0.0), (pytest.approx(13.5e-3), 1.0), (pytest.approx(37.5e-3), 0.0)]
    direct_a, direct_b = bridge_legs(replace(WAVE, system=BrakeSystem(reversal="direct")))
    assert [at for at, _ in direct_a] == [at for at, _ in direct_b]
    # A short of at most a tenth of a half period: 50 us of the 500 us at 1 kHz.
    fast = bridge_legs(replace(WAVE, frequency_hz=1000.0, end_s=1e-3))[1]
    assert fast[1][0] - 0.25e-3 == pytest.approx(50e-6, rel=1e-9)
    assert bridge_legs(replace(WAVE, frequency_hz=0.0)) == ([(0.0, 1.0)], [(0.0, 0.0)])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: replace(WAVE, setpoints=()), "setpoints"),
        (lambda: replace(WAVE, setpoints=((0.1, 5.0),)), "setpoints"),
        (lambda: replace(WAVE, setpoints=((0.0, 5.0), (0.0, 6.0))), "setpoints"),
        (lambda: replace(WAVE, setpoints=((0.0, -5.0),)), "volts = -5 V"),
        (lambda: replace(WAVE, frequency_hz=1e5), "frequency_hz"),
        (lambda: replace(WAVE, end_s=0.0), "end_s"),
        (lambda: replace(WAVE, leaks_ohm=(1e6, 1e6)), "2 leaks"),
        (lambda: replace(PULSE, coils=()), "coils"),
        (lambda: replace(PULSE, end_s=1e-3), "end_s"),
        (lambda: replace(WARMING, powers=((1.0, 0.36),)), "power does not begin at 0 s"),
    ],
)
def test_runs_that_make_no_sense_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()

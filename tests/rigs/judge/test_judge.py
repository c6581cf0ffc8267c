from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from firmware_models.plants.tactiles_plant import PLANT_OPTIONS, Actuators
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.latch.parameters import LATCH
from rigs.judge import judge
from rigs.judge.cases.brake import brake_cases
from rigs.judge.cases.coil import HELD, coil_cases, shared_volts
from rigs.judge.cases.heat import heat_cases
from rigs.judge.compare import all_cases
from rigs.judge.judgement import judged_curve, judged_number, mean_square_root, running_integral
from rigs.judge.netlists.brake import brake_netlist
from rigs.judge.netlists.brake_models import followed
from rigs.judge.netlists.coil import CoilRun, coil_netlist
from rigs.judge.netlists.heat import heat_netlist
from rigs.judge.ngspice import simulate

CASES = {case.name: case for case in all_cases()}


@pytest.mark.slow
@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize("name", CASES)
def test_model_and_simulator_agree(name):
    for row in CASES[name].judged():
        assert row.agrees, row
        assert row.why
        assert row.error_rms <= row.error_worst * (1 + 1e-9)
        if row.quantity == "volts on the clutches":
            # The specification found about 1 V RMS.
            assert row.error_rms < 0.1
            assert row.error_worst < 1.0


@pytest.mark.usefixtures("simulator")
def test_a_quick_judgement_has_every_kind_and_tells_its_progress():
    told: list[str] = []
    rows = judge(quick=True, progress=told.append)
    assert told == [case.name for case in all_cases(quick=True)]
    assert list(dict.fromkeys(row.case for row in rows)) == told
    assert {name.split(",")[0].split(" ")[0] for name in told} == {"brake", "coil", "15", "heat"}
    assert 0 < len(told) < len(CASES)


def wrong_drive(case, **values):
    drive = case.run.system.drive.with_values(**values)
    return brake_netlist(replace(case.run, system=replace(case.run.system, drive=drive)))


@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize(
    ("case", "wrong"),
    [
        # A thousandth of what sets the ramp, a percent of what sets the tail, a tenth of what is hardly there.
        ("brake, 1500 V at 20 Hz", {"supply_current_a": 500.5e-6}),
        ("brake, 1500 V at 20 Hz", {"stray_f": 0.203e-9}),
        ("brake, 1500 V at 20 Hz", {"output_resistance_ohm": 20.2e3}),
        ("brake, 1500 V at 20 Hz", {"bleeder_ohm": 450e6}),
        ("brake, 1500 V at 20 Hz", {"clamp_s": 0.99e-3}),
        ("brake, reservoir of 5 nF", {"reservoir_f": 4.99e-9}),
        ("brake, 1500 V at 20 Hz, direct", {"supply_current_a": 500.5e-6}),
    ],
)
def test_a_wrong_parameter_of_the_drive_is_found_out(case, wrong):
    rows = CASES[case].compared(simulate(wrong_drive(CASES[case], **wrong)))
    assert not all(row.agrees for row in rows)


@pytest.mark.usefixtures("simulator")
def test_a_first_half_period_of_full_length_is_found_out():
    case = CASES["brake, 1500 V at 20 Hz"]
    legs = brake_netlist(case.run).replace("0.0125", "0.025").replace("0.0135", "0.026")
    assert not case.compared(simulate(legs))[0].agrees


@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize("wrong", [{"resistance_ohm": 1.39}, {"inductance_h": 20.2e-6}])
def test_a_wrong_coil_is_found_out(wrong):
    case = next(case for case in coil_cases() if case.name == "coil alone")
    netlist = coil_netlist(replace(case.run, coils=(HELD.with_values(**wrong),)))
    assert not all(row.agrees for row in case.compared(simulate(netlist)))


@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize("name", [case.name for case in heat_cases()])
@pytest.mark.parametrize("wrong", [{"tau_s": 102.2}, {"c_k_per_w": 69.2}])
def test_a_wrong_time_constant_or_resistance_to_the_room_is_found_out(name, wrong):
    case = CASES[name]
    netlist = heat_netlist(replace(case.run, parameters=case.run.parameters.with_values(**wrong)))
    assert not all(row.agrees for row in case.compared(simulate(netlist)))


@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize("farad", [1e-9, 5e-9])
def test_the_closed_form_without_the_reservoir_is_off_by_more_than_a_hundred_volts(farad):
    case = CASES[f"brake, reservoir of {farad * 1e9:g} nF"]
    saved = simulate(brake_netlist(case.run))
    bare = replace(case.run, system=BrakeSystem())
    error = followed(bare, saved["time"]).volts - (saved["v(load)"] - saved["v(b)"])
    assert mean_square_root(saved["time"], error) > 100.0


@pytest.mark.parametrize("count", [1, 7, 15])
def test_the_settled_volts_are_those_of_the_simulated_board(count):
    options = {name: option.default for name, option in PLANT_OPTIONS.items()}
    options |= {"spread": 1.0, "supply_ohm": 0.03, "level": "event"}
    actuators = Actuators(options, np.random.default_rng(3), 0)
    actuators.switch({channel: 1 for channel in range(count)}, 0)
    run = CoilRun(tuple(actuators.latches[:count]), actuators.supply_volts, 0.03, 2e-3, 3e-3)
    assert shared_volts(run) == pytest.approx(actuators.volts, rel=1e-12)
    assert shared_volts(run) < 5.0


@pytest.mark.usefixtures("simulator")
def test_volts_that_sag_at_once_give_too_little_and_never_too_much():
    # While currents rise the rail is above its settled volts: the model's pulse has less energy, by at most the allowed part.
    run = CoilRun((LATCH,) * 15, 5.0, 0.02, 2e-3, 2.2e-3)
    case = replace(coil_cases()[1], run=run)
    energy = case.judged()[-1]
    assert energy.quantity == "energy of a pulse"
    assert 0.001 < energy.ngspice / energy.ours - 1.0 < 0.003


def test_all_cases_have_names_of_their_own():
    assert len(CASES) == len(all_cases()) == len(brake_cases()) + len(coil_cases()) + len(heat_cases())


def test_a_curve_is_judged_by_its_worst_instant_and_a_number_by_itself():
    time_s, zero = np.array([0.0, 1.0, 3.0]), np.zeros(3)
    bent = judged_curve("c", "q", time_s, np.array([0.0, 3.0, 3.0]), zero, "V", {"one": 1.0, "other": 1.5, "none": 0.0})
    assert (bent.error_worst, bent.allowed, bent.agrees, bent.why) == (3.0, 2.5, False, "one 1 + other 1.5")
    # Trapezoids of the square: 4.5 + 18 over 3 s.
    assert bent.error_rms == pytest.approx(7.5**0.5, rel=1e-12)
    exact = judged_number("c", "q", 2.0, 2.5, "A", 0.5, {"all": 0.5})
    assert exact.agrees
    assert exact.error_rms == exact.error_worst == 0.5


def test_an_integral_counts_from_zero_though_the_simulator_saves_from_its_first_step_on():
    time_s, integral = running_integral(np.array([0.1, 0.2]), np.array([2.0, 4.0]))
    assert time_s.tolist() == [0.0, 0.1, 0.2]
    assert integral == pytest.approx([0.0, 0.2, 0.5], rel=1e-12)

"""Banks of clutches: each behaves as if it were alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.physics.brake.bank import BrakeBank
from haptics.physics.brake.charging import DRIVE
from haptics.physics.brake.force_laws import force_law
from haptics.physics.brake.levels import brake_plant
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.brake.system import BrakeSystem

MODELS = [("lagged", "coulomb"), ("dynamic", "coulomb"), ("dynamic", "lugre")]
LAW = force_law("index")


def seen(thing):
    return thing.voltages_v, thing.capacity_n, thing.tension_n, thing.slip_m, thing.finger_m


@pytest.mark.parametrize(("level", "friction"), MODELS)
@pytest.mark.parametrize("step_s", [50e-6, 0.3e-3, 1e-3, 10e-3])
def test_every_clutch_of_a_bank_is_a_plant_of_its_own(level, friction, step_s) -> None:
    """Four clutches with volts, frequencies, hands, gains and overlaps of their own, through changes of all of them."""
    volts = [(1500.0, 700.0), (400.0, 1500.0), (1000.0, 0.0), (0.0, 900.0)]
    hertz = [(20.0, 20.0), (0.0, 33.0), (50.0, 10.0), (10.0, 10.0)]
    speeds = [(0.02, -0.03), (0.01, 0.01), (0.1, -0.1), (0.0, 0.05)]
    gains, overlaps = [1.0, 0.9, 1.2, 1.0], [11e-4, 9e-4, 12e-4, 5e-4]
    bank = BrakeBank(4, level, step_s=step_s, force_gain=gains, overlap_m2=overlaps, friction=friction)
    plants = [
        brake_plant(level, BrakeSystem(force_gain=(gain,), overlaps_m2=(overlap,)), step_s=step_s, friction=friction)
        for gain, overlap in zip(gains, overlaps, strict=True)
    ]
    for leg in range(2):
        now_s = bank.now_s
        bank.drive([v[leg] for v in volts], [hz[leg] for hz in hertz])
        bank.move([0.004 * leg] * 4, [speed[leg] for speed in speeds])
        for k, plant in enumerate(plants):
            plant.drive(now_s, int(volts[k][leg] > 0), volts[k][leg], hertz[k][leg])
            plant.move(0, now_s, 0.004 * leg, speeds[k][leg])
        for _ in range(4):
            bank.step(max(1, round(0.05 / step_s)))
            for k, plant in enumerate(plants):
                plant.advance(bank.now_s)
                for ours, theirs in zip(seen(bank), seen(plant), strict=True):
                    assert ours[k] == pytest.approx(theirs[0], rel=1e-6, abs=1e-9)
    assert bank.slip_m.max() > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 64, 1000, 15_000])
@pytest.mark.parametrize("level", ["lagged", "dynamic"])
def test_a_bank_of_any_size_holds_the_laws_force(count, level) -> None:
    bank = BrakeBank(count, level)
    volts = np.linspace(200.0, 1500.0, count)
    bank.drive(volts, 0.0)
    bank.step(150)
    assert bank.capacity_n == pytest.approx([LAW.force_n(v) for v in volts], rel=1e-4)
    bank.drive(0.0, 0.0)
    bank.step(500)
    assert bank.capacity_n == pytest.approx([LAW.off_force_n] * count, rel=1e-3)


@pytest.mark.parametrize(("level", "friction"), MODELS)
def test_compiled_and_plain_loops_agree(level, friction) -> None:
    banks = [BrakeBank(3, level, friction=friction, compiled=compiled) for compiled in (True, False)]
    for bank in banks:
        bank.drive([300.0, 900.0, 1500.0], [0.0, 17.0, 40.0])
        bank.move(0.0, [0.01, 0.1, -0.1])
        bank.step(200)
        bank.drive([900.0, 0.0, 600.0], 25.0)
        bank.step(200)
    for compiled, plain in zip(*map(seen, banks), strict=True):
        assert compiled == pytest.approx(plain, rel=1e-12, abs=1e-12)


def test_steps_taken_together_are_steps_taken_one_by_one() -> None:
    together, apart = BrakeBank(5), BrakeBank(5)
    for bank in (together, apart):
        bank.drive([100.0, 300.0, 700.0, 1100.0, 1500.0], 20.0)
        bank.move(0.0, 0.03)
    together.step(333)
    for _ in range(333):
        apart.step()
    for one, other in zip(seen(together), seen(apart), strict=True):
        assert (one == other).all()


def test_hours_of_switching_stay_finite_and_repeat() -> None:
    """An hour at 100 ms a step; every tenth minute is as the first."""
    bank = BrakeBank(8, "dynamic", step_s=0.1)
    peaks = []
    for _ in range(6):
        bank.drive(np.linspace(0.0, 1500.0, 8), 1.0)
        bank.move(0.0, 1e-5)
        bank.step(3000)
        peaks.append(bank.capacity_n)
        bank.drive(0.0, 0.0)
        bank.move(0.0)
        bank.step(3000)
        assert bank.slip_m == pytest.approx(np.zeros(8), abs=1e-6)
    assert np.isfinite(peaks).all()
    assert peaks[-1] == pytest.approx(peaks[0], rel=0.02)


@pytest.mark.parametrize("hertz", [5e-324, 1e-300, 1e-9, 999.0])
def test_extreme_frequencies_are_finite(hertz) -> None:
    bank = BrakeBank(3)
    bank.drive([5e-324, 1.0, 1500.0], hertz)
    bank.step(100)
    assert all(np.isfinite(values).all() for values in seen(bank))


def test_a_clutch_without_overlap_holds_nothing() -> None:
    bank = BrakeBank(2, overlap_m2=[0.0, 11e-4])
    bank.drive(1000.0, 0.0)
    bank.step(100)
    assert bank.capacity_n[0] == 0.0
    assert bank.capacity_n[1] > 8.0
    assert np.isfinite(bank.voltages_v).all()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"count": 0}, "count"),
        ({"count": math.nan}, "count"),
        ({"count": 2, "level": "static"}, "level"),
        ({"count": 2, "friction": "dry"}, "friction"),
        ({"count": 2, "step_s": 0.5}, "step_s"),
        ({"count": 2, "force_gain": [1.0, 2.0, 3.0]}, "force_gain"),
        ({"count": 2, "force_gain": math.nan}, "force_gain"),
        ({"count": 2, "overlap_m2": -1.0}, "overlap_m2"),
        ({"count": 2, "system": BrakeSystem(reversal="direct")}, "reversal"),
        ({"count": 2, "system": BrakeSystem(drive=DRIVE.with_values(reservoir_f=1e-9))}, "reservoir_f"),
    ],
)
def test_a_bank_there_is_none_of_is_refused(arguments, named) -> None:
    with pytest.raises(InputError, match=named):
        BrakeBank(**arguments)


def test_nonsense_is_refused_and_changes_nothing() -> None:
    bank = BrakeBank(2, system=BrakeSystem(brake=BRAKE.with_values(thickness_m=4e-6)))
    for volts, hertz, named in (
        ([100.0, math.nan], 10.0, "volts"),
        (-1.0, 10.0, "volts"),
        (2500.0, 10.0, "volts"),
        (1201.0, 10.0, "breakdown"),
        (100.0, 1e4, "frequency_hz"),
        (100.0, [1.0, 2.0, 3.0], "frequency_hz"),
    ):
        with pytest.raises(InputError, match=named):
            bank.drive(volts, hertz)
    with pytest.raises(InputError, match="position_m"):
        bank.move(math.inf)
    with pytest.raises(InputError, match="speed_m_s"):
        bank.move(0.0, 1e6)
    with pytest.raises(InputError, match="steps"):
        bank.step(-1)
    bank.step(10)
    assert (bank.voltages_v == 0.0).all()

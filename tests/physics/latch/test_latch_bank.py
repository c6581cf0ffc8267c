"""Many tactors at once behave as that many single ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.physics.latch.bank import LatchBank
from haptics.physics.latch.dynamic import DynamicLatch
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.table import TableLatch

SINGLE = {"table": TableLatch, "dynamic": DynamicLatch}


@pytest.mark.parametrize("level", SINGLE)
def test_a_bank_does_what_its_members_would_do_alone(level):
    rng = np.random.default_rng(1)
    count = 25
    ohms = rng.uniform(1.28, 1.48, count)
    bank = LatchBank(count, level, resistance_ohm=ohms)
    single = [SINGLE[level](LATCH.with_values(resistance_ohm=float(r))) for r in ohms]
    events = [[] for _ in single]
    at_s = 0.0
    for _ in range(30):
        volts, rise_k = rng.choice([5.0, -5.0, 0.0, 4.5], count), float(rng.uniform(0, 40))
        bank.drive(at_s, volts, rise_k)
        for plant, one_v, seen in zip(single, volts, events, strict=True):
            plant.rise_k = rise_k
            plant.drive(at_s, float(one_v))
            seen += plant.take_events()
        at_s += float(rng.choice([2e-3, 3e-3, 10e-3, 50e-3]))
    bank.drive(at_s, 0.0, rise_k)
    bank.advance(at_s + 0.5)
    for plant, seen in zip(single, events, strict=True):
        plant.drive(at_s, 0.0)
        plant.advance(at_s + 0.5)
        seen += plant.take_events()
    stops = [[e for e in seen if e.kind != "left_skin"] for seen in events]
    skin = [max((e.time_s for e in seen if e.kind == "reached_skin"), default=math.nan) for seen in events]
    assert bank.at_rest.all()
    assert bank.position_m == pytest.approx([plant.position_m for plant in single], abs=1e-15)
    assert [{1: "on", -1: "off", 0: "between"}[s] for s in bank.latched.tolist()] == [plant.latched for plant in single]
    assert bank.arrivals.tolist() == [len(seen) for seen in stops]
    assert bank.reached_skin_s == pytest.approx(skin, abs=0.5e-6, nan_ok=True)
    assert bank.impact_m_s == pytest.approx([seen[-1].speed_m_s if seen else math.nan for seen in stops], rel=1e-3, nan_ok=True)
    assert bank.energy_j == pytest.approx([plant.energy_j for plant in single], rel=2e-4)


def test_a_coil_that_is_stuck_on_draws_its_ohmic_power():
    bank = LatchBank(3)
    bank.drive(0.0, 5.0)
    bank.advance(3600.0)
    assert bank.energy_j == pytest.approx(25 / LATCH.resistance_ohm * 3600, rel=1e-6)


def test_time_only_moves_forward_and_numbers_must_be_numbers():
    bank = LatchBank(2)
    bank.advance(1.0)
    for call in (
        lambda: bank.advance(0.5),
        lambda: bank.advance(math.nan),
        lambda: bank.drive(2.0, math.nan),
        lambda: bank.drive(2.0, [1.0, 2.0, 3.0]),
        lambda: bank.drive(2.0, 5e3),
        lambda: bank.drive(2.0, 5.0, -300.0),
        lambda: LatchBank(0),
        lambda: LatchBank(2, "event"),
        lambda: LatchBank(2, latched="between"),
        lambda: LatchBank(2, resistance_ohm=[1.0, 0.0]),
    ):
        with pytest.raises(InputError):
            call()
    assert (bank.latched == -1).all()

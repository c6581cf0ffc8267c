"""The brake controller's hardware as its CPU sees it: one word out, ten senses in, and the plant that the Python board has."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from firmware_models.boards.boot import BOARD_OPTIONS
from firmware_models.cores.brake_pins import BrakePins
from firmware_models.plants.brake_plant import PLANT_OPTIONS, Brakes
from haptics.errors import InputError
from haptics.physics.brake.charging import Charging
from haptics.physics.brake.levels import LEVELS

MS = 1_000_000
BRIDGE, LOW, HIGHEST, AMPS, BUS = range(5, 10)
ENABLED, POSITIVE, NEGATIVE = 1 << 10, 1 << 11, 1 << 12
EXACT = {"spread": 0, "volts_gain": 1.0}


def options(**given: Any) -> dict[str, Any]:
    return {key: option.default for key, option in {**BOARD_OPTIONS, **PLANT_OPTIONS}.items()} | given


def pins(seed: int = 1, **given: Any) -> BrakePins:
    return BrakePins(options(**given), np.random.default_rng(seed), 0)


def word(mask: int, volts: int, polarity: int, piezos: int = 0, enabled: bool = True) -> int:
    legs = {1: POSITIVE, -1: NEGATIVE, 0: 0}[polarity]
    return mask | piezos << 5 | (ENABLED if enabled else 0) | legs | volts << 16


@pytest.mark.parametrize("level", LEVELS)
def test_words_at_the_edges_of_a_wave_do_to_the_plant_what_the_python_boards_wave_does(level) -> None:
    """Same seed, same edges; volts, forces, charge and energy agree to rounding."""
    by_word = pins(seed=4, level=level)
    by_wave = Brakes(options(level=level), np.random.default_rng(4), 0)
    half_ns, clamp_ns = 25 * MS, 1 * MS
    by_wave.load(1, 0, hand_m=0.01, hand_m_s=0.05)
    by_word.set_load(1, 0, hand_m=0.01, hand_m_s=0.05)
    by_wave.drive(0b11, 1200.0, 20.0, 5 * MS)
    by_word.outputs(word(0b11, 1200, 1), 5 * MS)
    polarity, edge_ns = 1, 5 * MS + half_ns // 2
    while edge_ns < 180 * MS:
        by_word.outputs(word(0b11, 1200, 0), edge_ns)
        polarity = -polarity
        by_word.outputs(word(0b11, 1200, polarity), edge_ns + clamp_ns)
        by_wave.advance(edge_ns + clamp_ns)
        edge_ns += half_ns
        at_ns = edge_ns - 3 * MS
        a, b = by_wave.truth(at_ns), by_word.truth(at_ns)
        for key in ("volts", "amplitude_v", "capacity_n", "tension_n", "slip_m", "energy_j", "supply_energy_j"):
            assert b[key] == pytest.approx(a[key], rel=1e-9, abs=1e-12), key
        assert by_word.plant.supply_charge_c(at_ns) == pytest.approx(by_wave.supply_charge_c(at_ns), rel=1e-9)
        assert [event[:3] for event in b["events"]] == [event[:3] for event in a["events"]]
    by_wave.drive(0, 0.0, 0.0, edge_ns)
    by_word.off(edge_ns)
    a, b = by_wave.truth(edge_ns + 40 * MS), by_word.truth(edge_ns + 40 * MS)
    assert b["capacity_n"] == pytest.approx(a["capacity_n"], rel=1e-9)
    assert b["events"] == a["events"]


def test_senses_read_by_their_scales() -> None:
    one = pins(**EXACT)
    one.outputs(word(0b1, 1000, -1), 0)
    system = one.plant.stage
    charged = Charging(1000.0, system.load.capacitance_f, 0.0)
    low_ns, high_ns = 200_000, 60 * MS
    volts = charged.charge(0.0, low_ns / 1e9).u_v
    assert one.counts(0, low_ns) == round(volts / 2)
    assert one.counts(1, low_ns) == 0
    assert one.counts(BRIDGE, low_ns) == round(512 - volts / 4)
    assert one.counts(LOW, low_ns) == round(16 * volts)
    assert one.counts(AMPS, low_ns) == 500
    bus_v = volts + 20e3 * 500e-6
    assert one.counts(BUS, low_ns) == pytest.approx(bus_v / 2, abs=1)
    assert one.counts(HIGHEST, low_ns) == one.counts(BUS, low_ns)
    assert one.counts(0, high_ns) == 500
    assert one.counts(BRIDGE, high_ns) == 512 - 250
    assert one.counts(LOW, high_ns) == 1023  # clamped
    assert one.counts(AMPS, high_ns) == 2  # 1000 V on 500 Mohm
    assert one.counts(BUS, high_ns) == 500


def test_the_highest_sense_sees_an_output_that_was_left_behind() -> None:
    one = pins(**EXACT, output_resistance_ohm=1e9)
    one.outputs(word(0b1, 800, 1), 0)
    one.outputs(word(0b10, 100, 1, enabled=False), 5_000 * MS)
    assert one.counts(HIGHEST, 5_000 * MS) == one.counts(0, 5_000 * MS) > 300


def test_both_legs_at_once_are_taken_as_shorted() -> None:
    one = pins(**EXACT)
    one.outputs(word(0b1, 500, 1), 0)
    one.outputs(word(0b1, 500, 0) | POSITIVE | NEGATIVE, 30 * MS)
    assert one.counts(0, 31 * MS) == 0


def test_nothing_is_driven_without_the_high_voltage_enabled() -> None:
    one = pins(**EXACT)
    one.outputs(word(0b11111, 1500, 1, enabled=False), 0)
    assert one.plant.volts(100 * MS) == [0.0] * 5
    assert one.energised(100 * MS) == []
    assert one.truth(100 * MS)["supply_energy_j"] == 0.0


def test_a_setpoint_beyond_the_supply_makes_what_the_supply_can() -> None:
    one = pins(**EXACT, supply_volts=1000.0)
    one.outputs(word(0b1, 0xFFFF, 1), 0)
    assert one.counts(0, 100 * MS) == 500


def test_off_shorts_the_outputs_and_stops_the_piezos_at_once() -> None:
    one = pins(**EXACT)
    one.outputs(word(0b111, 1500, 1, piezos=0b101), 0)
    assert one.energised(50 * MS) == [0, 1, 2]
    assert one.truth(50 * MS)["piezo"] == [True, False, True, False, False]
    one.off(50 * MS)
    assert one.truth(50 * MS)["piezo"] == [False] * 5
    assert max(map(abs, one.plant.volts(51 * MS))) < 60.0
    assert one.energised(51 * MS) == []


def test_piezos_leave_the_wave_alone() -> None:
    a, b = pins(seed=2), pins(seed=2)
    for one, piezos in ((a, 0), (b, 0b11)):
        one.outputs(word(0b1, 900, 1), 0)
        for k in range(1, 5):
            one.outputs(word(0b1, 900, 1, piezos if k % 2 else 0), k * 3 * MS)
    assert a.truth(20 * MS)["volts"] == b.truth(20 * MS)["volts"]


def test_the_lid() -> None:
    one = pins()
    assert one.interlock_closed
    one.set_load(0, 0, lid_open=1)
    assert not one.interlock_closed
    one.set_load(3, 0, lid_open=0)
    assert one.interlock_closed
    assert not pins(lid_open=1).interlock_closed


def test_a_breakdown_is_for_the_outputs_whose_volts_it_is_given() -> None:
    one = pins(**EXACT)
    one.set_load(1, 0, breakdown_v=600.0)
    one.outputs(word(0b1, 1000, 1), 0)
    assert one.counts(0, 60 * MS) == 500
    one.outputs(word(0b10, 1000, 1), 60 * MS)
    assert one.counts(1, 120 * MS) < 10
    every = pins(**EXACT, breakdown_v=600.0)
    every.outputs(word(0b1, 1000, 1), 0)
    assert every.counts(0, 60 * MS) < 10


@pytest.mark.parametrize("load", [{"lid_open": 2}, {"bridge_stuck": -1}, {"breakdown_v": -1.0}, {"weight": 1.0}])
def test_a_load_that_makes_no_sense_is_refused_by_name(load) -> None:
    with pytest.raises(InputError, match=next(iter(load))):
        pins().set_load(0, 0, **load)


def test_an_input_that_is_not_wired_is_refused() -> None:
    with pytest.raises(InputError, match="input = 10"):
        pins().counts(10, 0)

"""Level ``event`` against level ``dynamic``, from which its constants come."""

from __future__ import annotations

import itertools
import statistics

import pytest

from haptics.physics.latch.event import EventLatch
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.pulse import DIRECTIONS, latch_plant, min_pulse_s, switch, travel_s
from haptics.physics.latch.travel import TRAVEL

DRIVES = list(itertools.product(DIRECTIONS, (4.0, 4.5, 5.0, 5.5)))


@pytest.mark.parametrize(("direction", "volts"), DRIVES)
def test_travel_and_threshold_are_those_of_the_dynamic_level(direction, volts):
    # The scaling law fits the dynamic level within 0.4 % over 3.75 to 5.5 V, constants rounded to five digits.
    for question in (travel_s, min_pulse_s):
        if question is travel_s:
            event, dynamic = (travel_s(direction, volts, level=level) for level in ("event", "dynamic"))
        else:
            event, dynamic = (min_pulse_s(volts, direction, level=level) for level in ("event", "dynamic"))
        assert event == pytest.approx(dynamic, rel=5e-3)


def test_heat_acts_through_the_current_only():
    hot = travel_s("off-on", 5.0, 50.0, "event")
    assert hot == pytest.approx(travel_s("off-on", 5.0, 50.0, "dynamic"), rel=4e-3)
    assert hot == pytest.approx(travel_s("off-on", 5.0 / (1 + 0.0039 * 50), 0.0, "event"), rel=1e-12)


def test_arrival_and_energy_errors_over_the_stated_drive():
    arrival_ms, energy = [], []
    for direction, volts, rise_k, pulse_ms in itertools.product(DIRECTIONS, (4.5, 5.0), (0.0, 25.0), (3, 4, 5, 6, 8, 10)):
        event, dynamic = (switch(pulse_ms * 1e-3, volts, direction, rise_k, level) for level in ("event", "dynamic"))
        if dynamic.uncertain:
            continue
        assert event.switched == dynamic.switched
        energy.append(abs(event.energy_j / dynamic.energy_j - 1))
        # Within a quarter of the threshold arrival diverges; a renderer is told by the margin.
        if event.switched and dynamic.margin > 0.25:
            arrival_ms.append(1e3 * abs(event.arrival_s - dynamic.arrival_s))
    assert statistics.median(arrival_ms) < 0.3
    assert max(arrival_ms) < 1.4
    assert max(energy) < 0.06


def test_a_coasting_pin_leaves_the_watershed_exponentially():
    plant = EventLatch()
    plant.drive(0.0, 5.0)
    plant.drive(2.5e-3, 0.0)
    positions = []
    for k in range(3):
        plant.advance(2.5e-3 + k * TRAVEL.on_escape_s / 4)
        positions.append(plant.position_m)
    watershed_m = TRAVEL.on_min_s / TRAVEL.on_travel_s * LATCH.stroke_m
    gaps = [x - watershed_m for x in positions]
    assert gaps[1] / gaps[0] == pytest.approx(gaps[2] / gaps[1], rel=1e-9)


def test_position_is_continuous_through_any_drive():
    plant = latch_plant("event")
    changes = {10: 5.0, 35: 0.0, 50: -5.0, 58: 3.0, 75: 0.0, 300: 0.0}
    last = plant.position_m
    for tenths in range(400):
        plant.advance(tenths * 1e-4)
        assert abs(plant.position_m - last) < 0.15e-3  # 2 mm in 4.9 ms is 0.04 mm; an exponential escape ends at 0.1 mm
        last = plant.position_m
        if tenths in changes:
            plant.drive(tenths * 1e-4, changes[tenths])
    assert plant.at_rest

"""Level ``event`` against level ``dynamic``, from which its constants come."""

from __future__ import annotations

import itertools
import math
import statistics

import pytest

from haptics.errors import InputError
from haptics.physics.latch.event import EventLatch
from haptics.physics.latch.event_fit import fit_travel
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.pulse import DIRECTIONS, latch_plant, min_pulse_s, switch, travel_s
from haptics.physics.latch.travel import TRAVEL
from haptics.physics.parameters import provenance

DRIVES = list(itertools.product(DIRECTIONS, (4.0, 4.5, 5.0, 5.5)))


@pytest.mark.parametrize(("direction", "volts"), DRIVES)
def test_travel_and_threshold_are_those_of_the_dynamic_level(direction, volts):
    # The scaling law fits the dynamic level within 0.4 % over 3.75 to 5.5 V, constants rounded to five digits.
    for question in (travel_s, min_pulse_s):
        if question is travel_s:
            event, dynamic = (travel_s(direction, volts, level=level, extrapolate=True) for level in ("event", "dynamic"))
        else:
            event, dynamic = (min_pulse_s(volts, direction, level=level, extrapolate=True) for level in ("event", "dynamic"))
        assert event == pytest.approx(dynamic, rel=5e-3)


def test_times_refuse_volts_beyond_the_fit_and_beyond_the_stated_drive() -> None:
    for ask in (TRAVEL.travel_s, TRAVEL.min_s):
        with pytest.raises(InputError, match=r"volts = 9 V.*3\.75 to 5\.5 V.*extrapolate=True"):
            ask(True, 9.0)
        assert ask(True, 9.0, extrapolate=True) < ask(True, 5.5)
        assert math.isinf(ask(False, 1.0))  # that nothing switches is known, not extrapolated
    with pytest.raises(InputError, match=r"3\.6 V at nominal resistance is outside"):
        travel_s("off-on", 3.6)
    for level in ("event", "dynamic"):
        with pytest.raises(InputError, match=r"12 V is above the stated 5 V.*extrapolate=True"):
            travel_s("off-on", 12.0, level=level)
        with pytest.raises(InputError, match=r"12 V is above the stated 5 V"):
            min_pulse_s(12.0, level=level)
    assert min_pulse_s(12.0, extrapolate=True) < min_pulse_s()


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
        # Within a quarter of the threshold arrival diverges; the margin shows it to a renderer.
        if event.switched and dynamic.margin > 0.25:
            arrival_ms.append(1e3 * abs(event.arrival_s - dynamic.arrival_s))
    assert statistics.median(arrival_ms) < 0.3
    assert max(arrival_ms) < 1.4
    assert max(energy) < 0.06


def test_the_constants_are_what_the_fit_gives_and_other_parameters_get_their_own() -> None:
    fitted = fit_travel(LATCH)
    for row, committed in zip(provenance(fitted), provenance(TRAVEL), strict=True):
        # Committed with three to five digits; the time of escape is that of the force's slope at the watershed.
        near = 0.1 if row.name.endswith("escape_s") else 0.02
        assert row.value == pytest.approx(committed.value, rel=near, abs=1e-9), row.name
    heavier = LATCH.with_values(mass_kg=1.2 * LATCH.mass_kg)
    for direction in DIRECTIONS:
        event, dynamic = (travel_s(direction, level=level, parameters=heavier) for level in ("event", "dynamic"))
        assert event == pytest.approx(dynamic, rel=0.01)  # what the fit is refused beyond
        assert event > travel_s(direction)


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

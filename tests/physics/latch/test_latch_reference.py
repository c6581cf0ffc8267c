"""Level ``reference`` against a second integrator: another method, another way of keeping contact, its own equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.reference import ReferenceLatch

SKIN = LATCH.with_values(skin_stiffness_n_m=300.0)
CASES = {
    "toward the skin": ("off", [(5.0, 10e-3)], LATCH, 0.0),
    "back": ("on", [(-5.0, 10e-3)], LATCH, 0.0),
    "weak and hot": ("on", [(-4.4, 9e-3)], LATCH, 40.0),
    "a pulse that just switches": ("off", [(5.0, 2.3e-3), (0.0, 30e-3)], LATCH, 0.0),
    "reversed in flight": ("off", [(5.0, 3e-3), (-5.0, 2e-3)], LATCH, 0.0),
    "against a skin": ("off", [(5.0, 10e-3)], SKIN, 0.0),
}


def by_implicit_steps(latched, strokes, p, rise_k):
    """First arrival, speed there and energy at the end, by Radau IIA on one equation without modes."""
    resistance = p.resistance_ohm * (1 + p.resistance_per_k * rise_k)
    scale = 1 + math.exp(-p.stroke_m / p.thrust_length_m)
    x0 = rest_position(p, latched)
    y, t, met = np.array([x0, 0.0, 0.0, 0.0]), 0.0, None
    for volts, length_s in strokes:

        def motion(_, y, volts=volts):
            x, v, i, _energy = y
            k = p.thrust_n_a * (math.exp(-x / p.thrust_length_m) + math.exp(-(p.stroke_m - x) / p.thrust_length_m)) / scale
            on_gap, off_gap = 1 + (p.stroke_m - x) / p.plate_length_m, 1 + x / p.plate_length_m
            f = k * i + p.hold_on_n / on_gap**p.plate_power - p.hold_off_n / off_gap**p.plate_power - p.drag_n_s_m * v
            into_off, into_on = max(0.0, -x), max(0.0, x - p.stroke_m)
            f += p.off_stiffness_n_m * into_off * max(0.0, 1 - p.off_loss_s_m * v)
            f -= p.on_stiffness_n_m * into_on * max(0.0, 1 + p.on_loss_s_m * v)
            f -= p.skin_stiffness_n_m * max(0.0, x - p.skin_at_m)
            return [v, f / p.mass_kg, (volts - resistance * i - k * v) / p.inductance_h, volts * i]

        def arrival(_, y):
            return y[0] - (p.stroke_m if latched == "off" else 0.0)

        arrival.direction = 1 if latched == "off" else -1
        # No step longer than 5 us, so that the kink of a stop is never far inside one.
        solved = solve_ivp(motion, (t, t + length_s), y, "Radau", events=arrival, rtol=1e-9, atol=1e-14, max_step=5e-6)
        if met is None and len(solved.t_events[0]):
            met = solved.t_events[0][0], solved.y_events[0][0][1]
        y, t = solved.y[:, -1], t + length_s
    return met, y[3]


def rest_position(p, latched):
    def pull(x):
        on = p.hold_on_n * (1 + (p.stroke_m - x) / p.plate_length_m) ** -p.plate_power
        off = p.hold_off_n * (1 + x / p.plate_length_m) ** -p.plate_power
        stop = p.off_stiffness_n_m * max(0.0, -x) - p.on_stiffness_n_m * max(0.0, x - p.stroke_m)
        return on - off + stop - p.skin_stiffness_n_m * max(0.0, x - p.skin_at_m)

    from scipy.optimize import brentq

    return brentq(pull, *((-1e-3, 1e-6) if latched == "off" else (p.stroke_m - 1e-6, p.stroke_m + 1e-3)), xtol=1e-18)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_second_integrator_agrees_to_a_millionth(case):
    latched, strokes, p, rise_k = CASES[case]
    plant = ReferenceLatch(p, latched)
    plant.rise_k = rise_k
    at_s = 0.0
    for volts, length_s in strokes:
        plant.drive(at_s, volts)
        at_s += length_s
    plant.advance(at_s)
    met, energy_j = by_implicit_steps(latched, strokes, p, rise_k)
    kind = "reached_skin" if latched == "off" else "reached_off"
    arrivals = [event for event in plant.take_events() if event.kind == kind]
    if met is None:
        assert not arrivals
    else:
        assert arrivals[0].time_s == pytest.approx(met[0], rel=1e-6)
        assert arrivals[0].speed_m_s == pytest.approx(met[1], rel=1e-6)
    assert plant.energy_j == pytest.approx(energy_j, rel=1e-6)


def test_how_time_is_cut_changes_nothing():
    def play(cuts):
        plant = ReferenceLatch()
        plant.drive(0.0, 5.0)
        for k in range(1, cuts):
            plant.advance(10e-3 * k / cuts)
            _ = plant.position_m
        plant.drive(10e-3, 0.0)
        plant.advance(0.1)
        return plant.take_events(), plant.energy_j, plant.position_m

    assert play(1) == play(97)


def test_a_lossless_coil_and_stops_give_back_what_was_put_in():
    """Without drag, loss in the stops or current, kinetic energy and the plates' and stops' potential stay what they were."""
    p = LATCH.with_values(drag_n_s_m=0.0, on_loss_s_m=0.0, off_loss_s_m=0.0, thrust_n_a=0.0, hold_on_n=0.1, hold_off_n=0.1)
    plant = ReferenceLatch(p)
    plant._state[0] = -200e-6  # let go from a compressed stop: no call can bring it there without a coil
    plant._next_leg()

    def total_j():
        x, v = plant.position_m, plant.speed_m_s
        power, d = 1 - p.plate_power, p.plate_length_m
        plates = p.hold_on_n * d / power * (1 + (p.stroke_m - x) / d) ** power + p.hold_off_n * d / power * (1 + x / d) ** power
        springs = p.off_stiffness_n_m * max(0.0, -x) ** 2 + p.on_stiffness_n_m * max(0.0, x - p.stroke_m) ** 2
        return 0.5 * p.mass_kg * v * v + plates + 0.5 * springs

    begun_j = total_j()
    scale = 0.5 * p.off_stiffness_n_m * 200e-6**2
    for k in range(1, 21):
        plant.advance(k * 5e-4)
        assert total_j() == pytest.approx(begun_j, abs=1e-7 * scale)

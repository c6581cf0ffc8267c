"""Level ``dynamic`` as a numerical method: against an independent reference, at extremes, and compiled against plain."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from haptics.errors import InputError
from haptics.physics.latch.dynamic import DynamicLatch
from haptics.physics.latch.parameters import LATCH


def run(strokes, parameters=LATCH, latched="off", rise_k=0.0, settle_s=0.3, **options):
    """Events and plant after (volts, seconds) one after another, then nothing."""
    plant = DynamicLatch(parameters, latched, **options)
    plant.rise_k = rise_k
    at_s = 0.0
    for volts, length_s in strokes:
        plant.drive(at_s, volts)
        at_s += length_s
    plant.drive(at_s, 0.0)
    plant.advance(at_s + settle_s)
    return plant.take_events(), plant


def reference(volts, latched, p=LATCH, rise_k=0.0, until_s=30e-3):
    """First arrival at the far stop under constant voltage, and work done on the way, by DOP853 with its own equations."""
    resistance = p.resistance_ohm * (1 + p.resistance_per_k * rise_k)

    def thrust(x):
        shape = np.exp(-x / p.thrust_length_m) + np.exp((x - p.stroke_m) / p.thrust_length_m)
        return p.thrust_n_a * shape / (1 + np.exp(-p.stroke_m / p.thrust_length_m))

    def motion(_t, y, touching):
        x, v, i, _energy, _heat, _drag = y
        force = thrust(x) * i - p.drag_n_s_m * v
        force += p.hold_on_n * max(0.1, 1 + (p.stroke_m - x) / p.plate_length_m) ** -p.plate_power
        force -= p.hold_off_n * max(0.1, 1 + x / p.plate_length_m) ** -p.plate_power  # trial steps may overshoot
        if touching == "off":
            force += p.off_stiffness_n_m * -x * max(0.0, 1 - p.off_loss_s_m * v)
        elif touching == "on":
            force -= p.on_stiffness_n_m * (x - p.stroke_m) * max(0.0, 1 + p.on_loss_s_m * v)
        if x > p.skin_at_m:
            force -= p.skin_stiffness_n_m * (x - p.skin_at_m)
        di = (volts - resistance * i - thrust(x) * v) / p.inductance_h
        return [v, force / p.mass_kg, di, volts * i, resistance * i * i, p.drag_n_s_m * v * v]

    def stop(at, direction):
        def event(_t, y, _touching):
            return y[0] - at

        event.terminal, event.direction = True, direction
        return event

    start = DynamicLatch(p, latched)
    up = latched == "off"
    leave = stop(0.0 if up else p.stroke_m, 1 if up else -1)
    arrive = stop(p.stroke_m if up else 0.0, 1 if up else -1)
    y, t = [start.position_m, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0
    for touching, event in ((latched, leave), ("nothing", arrive)):
        part = solve_ivp(motion, (t, until_s), y, "DOP853", events=event, args=(touching,), rtol=1e-11, atol=1e-14)
        assert part.t_events[0].size == 1
        t, y = part.t_events[0][0], part.y_events[0][0]
    return t, y


CASES = list(itertools.product(("off", "on"), (4.5, 5.0), (0.0, 50.0), (1.28, 1.48)))


@pytest.mark.parametrize(("latched", "volts", "rise_k", "resistance"), CASES)
def test_arrival_speed_and_energy_agree_with_the_reference(latched, volts, rise_k, resistance):
    p = LATCH.with_values(resistance_ohm=resistance)
    sign = 1.0 if latched == "off" else -1.0
    arrival_s, y = reference(sign * volts, latched, p, rise_k)
    events, _ = run([(sign * volts, arrival_s + 1e-3)], p, latched, rise_k)
    arrived = events[-1]
    assert arrived.time_s == pytest.approx(arrival_s, abs=0.5e-6)  # published for this level: 0.2 median, 0.5 us worst
    assert arrived.speed_m_s == pytest.approx(y[1], rel=1e-4)
    plant = DynamicLatch(p, latched)
    plant.rise_k = rise_k
    plant.drive(0.0, sign * volts)
    plant.advance(arrival_s)
    assert plant.energy_j == pytest.approx(y[3], rel=2e-4)  # published: 0.02 %


@pytest.mark.parametrize("latched", ["off", "on"])
def test_the_reference_itself_conserves_energy(latched):
    sign = 1.0 if latched == "off" else -1.0
    p = LATCH.with_values(off_loss_s_m=0.0, on_loss_s_m=0.0)
    x0 = DynamicLatch(p, latched).position_m
    _, (x, v, i, electrical, heat, drag) = reference(sign * 5.0, latched, p)

    def plates(x):  # integral of the plates' force, and the stop's spring
        power, d = 1 - p.plate_power, p.plate_length_m
        on = p.hold_on_n * d / -power * (1 + (p.stroke_m - x) / d) ** power
        off = p.hold_off_n * d / -power * (1 + x / d) ** power
        depth_off, depth_on = max(0.0, -x), max(0.0, x - p.stroke_m)
        return on + off - 0.5 * p.off_stiffness_n_m * depth_off**2 - 0.5 * p.on_stiffness_n_m * depth_on**2

    stored = 0.5 * p.mass_kg * v * v + 0.5 * p.inductance_h * i * i
    assert electrical + plates(x) - plates(x0) == pytest.approx(heat + drag + stored, rel=1e-8)


@pytest.mark.parametrize("latched", ["off", "on"])
def test_the_step_converges_in_high_order(latched):
    sign = 1.0 if latched == "off" else -1.0
    arrivals = []
    for step_s in (40e-6, 20e-6, 10e-6, 1e-6):
        events, _ = run([(sign * 5.0, 10e-3)], latched=latched, step_s=step_s)
        arrivals.append(events[-1].time_s)
    errors = [abs(a - arrivals[-1]) for a in arrivals[:-1]]
    assert errors[1] < 0.1e-6
    # Order 4 in smooth stretches, but the loss of contact and the coil's first 15 us dominate at these steps.
    assert errors[2] < errors[0] / 4 + 1e-10


@pytest.mark.parametrize("step_s", [1e-6, 5e-6, 20e-6, 100e-6, 1e-3])
@pytest.mark.parametrize("stiffness", [3e3, 1e5, 1e6, 1e7, 1e8])
def test_no_step_and_no_stop_make_it_blow_up_or_land_on_the_wrong_side(step_s, stiffness):
    p = LATCH.with_values(on_stiffness_n_m=stiffness, off_stiffness_n_m=stiffness)
    for latched, sign, far in (("off", 1.0, "on"), ("on", -1.0, "off")):
        events, plant = run([(sign * 5.0, 10e-3)], p, latched, step_s=step_s)
        assert plant.latched == far
        assert plant.at_rest
        # The spring of a stop helps the start a little; without it, and with 1 ms steps, arrival moves by up to 2 %.
        assert events[-1].time_s == pytest.approx(4.86e-3 if sign > 0 else 6.0e-3, rel=0.02)
        assert -1e-4 < plant.position_m < LATCH.stroke_m + 1e-4


def test_hard_bounces_come_to_rest():
    p = LATCH.with_values(on_stiffness_n_m=1e8, on_loss_s_m=0.0, off_loss_s_m=0.0)
    _, plant = run([(5.0, 10e-3)], p)
    assert plant.at_rest
    assert plant.latched == "on"


def test_a_lossless_bounce_keeps_its_speed():
    # The same elastic stop, finely and normally stepped: rebound by the highest point after the first impact.
    p = LATCH.with_values(on_loss_s_m=0.0)

    def rebound_m(step_s):
        plant = DynamicLatch(p, step_s=step_s)
        plant.drive(0.0, 5.0)
        lowest = math.inf
        for k in range(400):
            plant.advance(4.9e-3 + k * 1e-5)
            lowest = min(lowest, plant.position_m)
        return p.stroke_m - lowest

    assert rebound_m(1e-6) > 50e-6
    assert rebound_m(20e-6) == pytest.approx(rebound_m(1e-6), rel=0.02)


SEQUENCES = [
    [(5.0, 10e-3)],
    [(5.0, 2.2e-3)],
    [(5.0, 3e-3), (-5.0, 3e-3)],
    [(5.0, 2e-3), (-5.0, 3e-3)] * 3,
    [(4.1, 1.7e-3), (0.0, 1e-3), (5.0, 5e-6), (3.0, 9e-3)],
]


@pytest.mark.parametrize("strokes", SEQUENCES)
def test_compiled_and_plain_python_agree(strokes):
    fast_events, fast = run(strokes, compiled=True)
    plain_events, plain = run(strokes, compiled=False)
    assert [e.kind for e in fast_events] == [e.kind for e in plain_events]
    for a, b in zip(fast_events, plain_events, strict=True):
        assert a.time_s == pytest.approx(b.time_s, rel=1e-12)
        assert a.speed_m_s == pytest.approx(b.speed_m_s, rel=1e-10)
    assert fast.energy_j == pytest.approx(plain.energy_j, rel=1e-12)
    assert fast.position_m == pytest.approx(plain.position_m, rel=1e-12, abs=1e-15)


def test_resting_actuators_cost_no_steps(monkeypatch):
    plant = DynamicLatch()
    monkeypatch.setattr("haptics.physics.latch.dynamic.kernel", lambda _compiled: pytest.fail("stepped at rest"))
    for k in range(1000):
        plant.advance(k * 1.0)
    assert plant.at_rest


def test_a_sagging_supply_is_drive_like_any_other():
    # 5 V falling to 4.2 V 1 ms into the stroke: later than at 5 V, earlier than at 4.2 V.
    times = [run(s)[0][-1].time_s for s in ([(5.0, 10e-3)], [(5.0, 1e-3), (4.2, 9e-3)], [(4.2, 10e-3)])]
    assert times == sorted(times)


@pytest.mark.parametrize("step_s", [0.0, 2e-3, math.nan])
def test_steps_outside_their_range_are_refused(step_s):
    with pytest.raises(InputError, match="step_s"):
        DynamicLatch(step_s=step_s)

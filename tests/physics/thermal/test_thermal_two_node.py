"""Two thermal nodes against an ODE solver, a matrix exponential and the one node; and what float32 does to small steps."""

from __future__ import annotations

import math
import random
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import curve_fit

from haptics.errors import InputError
from haptics.physics.parameters import provenance
from haptics.physics.thermal import one_node as thermal, two_node as thermal_two_node
from haptics.physics.thermal.one_node import THERMAL, ThermalParameters, relax
from haptics.physics.thermal.plant import LEVELS, thermal_plant
from haptics.physics.thermal.two_node import TWO_NODE, TwoNodeHeat, TwoNodeParameters, time_constants_s

C, TAU = 69.0, 102.0
LOOSE = TwoNodeParameters(coil_j_per_k=0.7, coupling_w_per_k=0.02)  # capacities alike: the two rates come close
STIFF = TwoNodeParameters(coil_j_per_k=1e-4, coupling_w_per_k=1.0)  # rates five decades apart
TINY = TwoNodeParameters(coil_j_per_k=1.02, coupling_w_per_k=0.04)  # nearly all heat is in the coil
EVERY = pytest.mark.parametrize("p", [TWO_NODE, LOOSE, STIFF, TINY], ids=["default", "loose", "stiff", "tiny body"])


def matrices(p):
    """``T' = A T + b P`` of (coil, body), written out from the heat flows."""
    g, loss, coil, body = p.coupling_w_per_k, 1 / p.c_k_per_w, p.coil_j_per_k, p.body_j_per_k
    return np.array([[-g / coil, g / coil], [g / body, -(g + loss) / body]]), np.array([1 / coil, 0.0])


def stepped(p, dt_s, power_w, coil_k=0.0, body_k=0.0):
    heat = TwoNodeHeat(p, body_k, coil_k)
    heat.advance(dt_s, power_w)
    return np.array([heat.coil_rise_k, heat.rise_k])


# Against other programs


@EVERY
@pytest.mark.parametrize("dt_s", [1e-6, 1e-3, 1.0, 30.0, 1e3])
def test_a_step_is_the_matrix_exponential(p, dt_s):
    a, b = matrices(p)
    start, power_w = np.array([40.0, 7.0]), 18.0
    steady = -np.linalg.solve(a, b * power_w)
    expected = steady + expm(a * dt_s) @ (start - steady)
    assert stepped(p, dt_s, power_w, *start) == pytest.approx(expected, rel=1e-10)  # what expm loses on the stiff network


@EVERY
@pytest.mark.parametrize("dt_s", [1e-6, 1e-3, 1.0, 30.0, 1e3])
def test_a_step_is_right_to_the_last_digits(p, dt_s):
    # The exponential's series in 80 digits, squared back up: slow, and free of rounding.
    with localcontext() as context:
        context.prec = 80
        g, loss = Decimal(p.coupling_w_per_k), 1 / Decimal(p.c_k_per_w)
        coil, body, dt = Decimal(p.coil_j_per_k), Decimal(p.body_j_per_k), Decimal(dt_s)
        small = dt / 2**40
        a = [[-g / coil, g / coil, 18 / coil], [g / body, -(g + loss) / body, Decimal(0)], [Decimal(0)] * 3]
        a = [[entry * small for entry in row] for row in a]

        def times(x, y):
            return [[sum(x[i][k] * y[k][j] for k in range(3)) for j in range(3)] for i in range(3)]

        whole = term = [[Decimal(int(i == j)) for j in range(3)] for i in range(3)]
        for order in range(1, 12):
            term = [[entry / order for entry in row] for row in times(term, a)]
            whole = [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(whole, term, strict=True)]
        for _ in range(40):
            whole = times(whole, whole)
        expected = [float(row[0] * 40 + row[1] * 7 + row[2]) for row in whole[:2]]
    # A few spacings, times how far coupling outweighs the loss to the room (69 in the stiff network).
    assert stepped(p, dt_s, 18.0, 40.0, 7.0) == pytest.approx(expected, rel=5e-14)


@EVERY
def test_a_stuck_coil_that_is_switched_off_follows_an_ode_solver(p):
    a, b = matrices(p)
    solved = solve_ivp(lambda _t, y: a @ y + b * 18.0, (0, 0.5), [3.0, 1.0], "Radau", rtol=1e-11, atol=1e-12, jac=a)
    cooled = solve_ivp(lambda _t, y: a @ y, (0, 120.0), solved.y[:, -1], "Radau", rtol=1e-11, atol=1e-12, jac=a)
    heat = TwoNodeHeat(p, 1.0, 3.0)
    heat.advance(0.5, 18.0)
    assert [heat.coil_rise_k, heat.rise_k] == pytest.approx(solved.y[:, -1], rel=1e-8)  # the solver's tolerance, accumulated
    heat.advance(120.0, 0.0)
    assert [heat.coil_rise_k, heat.rise_k] == pytest.approx(cooled.y[:, -1], rel=1e-7)


@EVERY
def test_the_sum_of_the_time_constants_is_the_stated_one(p):
    rates = -np.linalg.eigvals(matrices(p)[0])
    slow_s, fast_s = time_constants_s(p)
    assert [fast_s, slow_s] == pytest.approx(sorted(1 / rates), rel=1e-9)
    assert slow_s + fast_s == pytest.approx(TAU, rel=1e-12)
    assert slow_s > fast_s


# Limits


@EVERY
@pytest.mark.parametrize("dt_s", [1e7, 1e9, 1e300])
def test_years_end_at_the_steady_rise(p, dt_s):
    coil_k, body_k = stepped(p, dt_s, 0.36)
    assert body_k == pytest.approx(C * 0.36, rel=1e-12)
    assert coil_k == pytest.approx(C * 0.36 + 0.36 / p.coupling_w_per_k, rel=1e-12)
    assert stepped(p, dt_s, 0.0, 80.0, 20.0) == pytest.approx([0.0, 0.0], abs=1e-10)


def test_a_microsecond_keeps_every_digit_of_what_the_body_gains():
    # From cold the body gains G P dt^2 / (2 C_c C_b), the coil P dt / C_c; the next terms are 1e-7 of them, and known.
    dt_s, power_w = 1e-6, 18.0
    a, _ = matrices(TWO_NODE)
    coil_k, body_k = stepped(TWO_NODE, dt_s, power_w)
    gain_k = power_w * dt_s / TWO_NODE.coil_j_per_k
    assert coil_k == pytest.approx(gain_k * (1 + a[0, 0] * dt_s / 2), rel=1e-13)
    assert body_k == pytest.approx(gain_k * a[1, 0] * dt_s / 2 * (1 + (a[0, 0] + a[1, 1]) * dt_s / 3), rel=1e-13, abs=0)


@EVERY
def test_both_ways_of_the_divided_difference_agree_where_they_meet(p):
    # 0.5 / fast is where the series takes over; one step across is two short ones, which are series only.
    edge_s = 0.5 * time_constants_s(p)[1]
    for dt_s in (edge_s * (1 - 1e-9), edge_s * (1 + 1e-9)):
        half = stepped(p, dt_s / 2, 18.0, *stepped(p, dt_s / 2, 18.0))
        assert stepped(p, dt_s, 18.0) == pytest.approx(half, rel=1e-14)


def test_no_step_changes_nothing():
    assert stepped(TWO_NODE, 0.0, 18.0, 40.0, 7.0).tolist() == [40.0, 7.0]


# Conservation and order


@EVERY
def test_energy_is_kept(p):
    power_w, dt_s = 18.0, 20.0
    lost_j, error_j = quad(lambda t: stepped(p, t, power_w, 5.0, 2.0)[1] / C, 0, dt_s, epsabs=1e-10, epsrel=1e-12, limit=200)
    coil_k, body_k = stepped(p, dt_s, power_w, 5.0, 2.0)
    kept_j = p.coil_j_per_k * (coil_k - 5.0) + p.body_j_per_k * (body_k - 2.0)
    assert kept_j + lost_j == pytest.approx(power_w * dt_s, rel=1e-10, abs=2 * error_j)


@given(st.floats(0, 1e4), st.floats(0, 1e4), st.floats(-20, 200), st.floats(-20, 100), st.floats(0, 20))
def test_two_steps_are_one_step(first_s, second_s, coil_k, body_k, power_w):
    there = stepped(TWO_NODE, second_s, power_w, *stepped(TWO_NODE, first_s, power_w, coil_k, body_k))
    assert there == pytest.approx(stepped(TWO_NODE, first_s + second_s, power_w, coil_k, body_k), rel=1e-12, abs=1e-10)


@given(st.floats(0, 1e9), st.floats(-20, 200), st.floats(-20, 100))
def test_left_alone_neither_node_passes_what_surrounds_it(dt_s, coil_k, body_k):
    low, high = min(coil_k, body_k, 0.0), max(coil_k, body_k, 0.0)
    for rise_k in stepped(TWO_NODE, dt_s, 0.0, coil_k, body_k):
        assert low - 1e-10 <= rise_k <= high + 1e-10


# What it is for


def test_a_stuck_coil_is_hot_long_before_the_body_shows_it():
    coil_k, body_k = stepped(TWO_NODE, 0.5, 18.0)
    assert 60.0 < coil_k < 18.0 * 0.5 / 0.125  # short of what copper alone would gain if nothing flowed out
    assert 0.1 < body_k < 0.3
    assert relax(0.0, 18.0, 0.5) > 20 * body_k  # one node spreads the heat at once, and so cannot show either


def test_copper_of_the_stated_tracks_and_resistance_holds_the_assumed_heat():
    # R = rho l sum(1/A_layer) and m = density l sum(A_layer), l the track's length in each layer (thesis 3.4.3).
    areas_m2 = [220e-6 * 105e-6] * 6 + [220e-6 * 75e-6] * 2
    length_m = 1.38 / (1.72e-8 * sum(1 / area for area in areas_m2))
    mass_kg = 8960 * length_m * sum(areas_m2)
    assert mass_kg == pytest.approx(0.32e-3, abs=0.005e-3)  # two digits
    assert 385 * mass_kg == pytest.approx(TWO_NODE.coil_j_per_k, rel=0.01)


def test_slow_heating_is_the_one_node():
    # Mean delay is matched, so what is left falls with the square of the time scale: ramps four times as slow, a sixteenth.
    def apart_k(scale_s):
        one, two = thermal_plant("exact"), thermal_plant("two_node")
        worst_k, steps = 0.0, int(2 * scale_s)  # half a second each, short against either time constant
        for k in range(steps):
            power_w = 0.36 * math.sin(math.pi * (k + 0.5) / steps) ** 4
            for plant in (one, two):
                plant.advance(0.5, power_w)
            worst_k = max(worst_k, abs(one.rise_k - two.rise_k))
        return worst_k

    slow, slower = apart_k(3e3), apart_k(12e3)
    assert slow < 0.1
    assert math.log2(slow / slower) / 2 == pytest.approx(2.0, abs=0.1)


def test_the_published_run_is_met_within_its_uncertainty():
    worst_k = max(abs(stepped(TWO_NODE, t, 0.36)[1] - relax(0.0, 0.36, t)) for t in range(1, 361))
    assert worst_k < 1.2  # of 24.1 K, with c known to 14 %


# Identifiability


def published_run(p, times_s):
    """Body's rise over 6 min at 0.36 W, then cooling (thesis 3.5.2)."""
    hot = stepped(p, 360.0, 0.36)
    return np.array([stepped(p, t, 0.36)[1] if t <= 360 else stepped(p, t - 360, 0.0, *hot)[1] for t in times_s])


def one_node_run(times_s, tau_s, c_k_per_w):
    risen = 1 - np.exp(-np.minimum(times_s, 360) / tau_s)
    return 0.36 * c_k_per_w * risen * np.exp(-np.maximum(times_s - 360, 0) / tau_s)


def two_node_run(times_s, tau_s, c_k_per_w, lag):
    """The body's answer written with its two time constants, ``lag`` the fast one as a share of their sum."""
    fast, slow = lag * tau_s, (1 - lag) * tau_s

    def step(t):
        t = np.maximum(t, 0)
        return 1 - (slow * np.exp(-t / slow) - fast * np.exp(-t / fast)) / (slow - fast)

    return 0.36 * c_k_per_w * (step(times_s) - step(times_s - 360))


def gains_in_chi2(p, sd_k, seeds=range(60)):
    """By how much two nodes fit noisy readings of the published run better than one, for each seed; and the one-node fits."""
    times_s = np.arange(0.0, 1080.0, 10.0)
    true, gains, ones = published_run(p, times_s), [], []
    for seed in seeds:
        readings = true + np.random.default_rng(seed).normal(0, sd_k, times_s.size)
        sd = np.full_like(times_s, sd_k)
        one, covariance = curve_fit(one_node_run, times_s, readings, (100, 70), sd, absolute_sigma=True)
        two, _ = curve_fit(two_node_run, times_s, readings, (*one, 0.05), sd, bounds=([10, 1, 1e-4], [1e3, 1e3, 0.49]))
        chi2 = [np.sum(((f - readings) / sd_k) ** 2) for f in (one_node_run(times_s, *one), two_node_run(times_s, *two))]
        gains.append(chi2[0] - chi2[1])
        ones.append((one[0], covariance[0, 0] ** 0.5))
    return np.array(gains), np.array(ones)


@pytest.fixture(scope="module")
def readings_sd_k():
    """Noise of readings each 10 s for which a one-node fit knows tau to the published 5 s."""
    return 5.0 / gains_in_chi2(TWO_NODE, 1.0, range(1))[1][0, 1]


def test_the_second_node_cannot_be_told_from_the_published_curve(readings_sd_k):
    gains, ones = gains_in_chi2(TWO_NODE, readings_sd_k)
    assert ones[:, 1] == pytest.approx(5.0, rel=0.2)  # the noise does what it was made for
    assert np.median(gains) < 2.0
    assert ones[:, 0].mean() == pytest.approx(TAU, abs=5.0)  # and one node fitted to two finds the published tau
    # Without noise: all that the lag, 7 s in 102, adds to what the third parameter gains by chance.
    times_s = np.arange(0.0, 1080.0, 10.0)
    true = published_run(TWO_NODE, times_s)
    best, _ = curve_fit(one_node_run, times_s, true, (100, 70))
    assert 1.0 < np.sum(((one_node_run(times_s, *best) - true) / readings_sd_k) ** 2) < 2.0


def test_quieter_readings_would_tell_it(readings_sd_k):
    gains, _ = gains_in_chi2(TWO_NODE, 0.2 * readings_sd_k, range(5))
    assert np.median(gains) > 10.0


# Small steps


def test_a_million_random_steps_are_the_closed_form():
    numba = pytest.importorskip("numba")
    step = numba.njit(thermal_two_node.propagate)
    made = thermal_two_node.network(TWO_NODE)
    steps_s = 10.0 ** np.random.default_rng(3).uniform(-7, -3, 1_000_000)

    @numba.njit
    def walk(steps_s):
        coil_k, body_k = 0.0, 0.0
        for dt_s in steps_s:
            coil_k, body_k = step(coil_k, body_k, 18.0, dt_s, *made)
        return coil_k, body_k

    # 1e6 roundings of a state near 500 K, at worst 1e6 * 6e-14 K, if random 1e-10 K.
    assert walk(steps_s) == pytest.approx(stepped(TWO_NODE, math.fsum(steps_s), 18.0), rel=1e-11)


def test_single_steps_of_the_plant_are_those_of_the_compiled_walk():
    generator = random.Random(5)
    plant, total_s = thermal_plant("two_node"), 0.0
    for _ in range(20_000):
        dt_s = 10.0 ** generator.uniform(-6, -2)
        plant.advance(dt_s, 0.36)
        total_s += dt_s
    assert [plant.coil_rise_k, plant.rise_k] == pytest.approx(stepped(TWO_NODE, total_s, 0.36), rel=1e-11)


def walk_exact(steps):
    """``steps`` exact microseconds of the one node at 0.36 W, compiled; and its closed form."""
    numba = pytest.importorskip("numba")
    step = numba.njit(thermal._relaxed)

    @numba.njit
    def walk(steps):
        rise_k = 0.0
        for _ in range(steps):
            rise_k = step(rise_k, 69 * 0.36, 1e-6, 102.0)
        return rise_k

    return walk(steps), relax(0.0, 0.36, steps * 1e-6)


DRIFT_K = 5e-11
"""Roundings of 1.8e-15 K, remembered for tau, that is 1e8 steps, and as good as random: 2e-11 K."""


def test_a_hundred_million_exact_microseconds_do_not_drift():
    walked_k, closed_k = walk_exact(100_000_000)
    assert walked_k == pytest.approx(closed_k, abs=DRIFT_K)


@pytest.mark.soak
def test_a_billion_exact_microseconds_do_not_drift():
    walked_k, closed_k = walk_exact(1_000_000_000)
    print(f"1e9 steps of 1 us at 0.36 W: {walked_k - closed_k:.2g} K off")
    assert walked_k == pytest.approx(closed_k, abs=DRIFT_K)


@pytest.mark.soak
def test_a_billion_exact_milliseconds_do_not_drift():
    numba = pytest.importorskip("numba")
    one, two = numba.njit(thermal._relaxed), numba.njit(thermal_two_node.propagate)
    made = thermal_two_node.network(TWO_NODE)

    @numba.njit
    def walk(steps):
        rise_k = coil_k = body_k = 0.0
        for _ in range(steps):
            rise_k = one(rise_k, 24.84, 1e-3, 102.0)
            coil_k, body_k = two(coil_k, body_k, 0.36, 1e-3, *made)
        return rise_k, coil_k, body_k

    rise_k, coil_k, body_k = walk(1_000_000_000)
    print(f"1e9 steps of 1 ms: {rise_k - 24.84:.2g} K off, coil {coil_k - 44.84:.2g} K, body {body_k - 24.84:.2g} K")
    # It stops short of the end where a step gains less than half a spacing of float64: 1.8e-15 K * 102 s / 1 ms = 1.8e-10 K; the
    # coil's spacing is twice that.
    assert rise_k == pytest.approx(24.84, abs=2e-10)
    assert [coil_k, body_k] == pytest.approx([24.84 + 0.36 / 0.018, 24.84], abs=4e-10)


def test_naive_float32_steps_of_a_microsecond_stick_at_four_kelvin():
    numba = pytest.importorskip("numba")

    @numba.njit
    def walk(steps):
        rise_k, final_k, share = np.float32(0.0), np.float32(69 * 0.36), np.float32(1e-6 / 102)
        for _ in range(steps):
            rise_k = np.float32(rise_k + np.float32((final_k - rise_k) * share))
        return rise_k

    true_k = relax(0.0, 0.36, 100.0)
    assert true_k == pytest.approx(15.52, abs=0.005)
    assert walk(100_000_000) == 4.0  # exactly: half the spacing above it, 2.4e-7 K, is more than a step's 2.0e-7 K


def test_a_float32_state_is_refused_and_float32_inputs_are_computed_in_double():
    with pytest.raises(InputError, match="rise_k is float32; expected float64"):
        relax(np.float32(4.0), 18.0, 1e-6)
    with pytest.raises(InputError, match="float16"):
        relax(np.float16(4.0), 18.0, 1e-6)
    step, power = np.float32(1e-6), np.float32(18.0)
    warmed = relax(0.0, power, step)
    assert type(warmed) is float
    assert warmed == relax(0.0, float(power), float(step))
    for level in LEVELS:
        plant, same = thermal_plant(level, rise_k=np.float32(4.0)), thermal_plant(level, rise_k=4.0)
        for _ in range(1000):
            plant.advance(step, power)
            same.advance(float(step), 18.0)
        assert type(plant.rise_k) is float
        assert type(plant.coil_rise_k) is float
        assert (plant.rise_k, plant.coil_rise_k) == (same.rise_k, same.coil_rise_k)


# One interface


@pytest.mark.parametrize("level", LEVELS)
def test_a_clock_that_stepped_back_is_refused_and_cools_nothing(level):
    plant = thermal_plant(level)
    plant.advance(1.0, 18.0)
    before = plant.rise_k, plant.coil_rise_k
    for dt_s, power_w, word in (
        (-1e-9, 0.0, "dt_s"),
        (1.0, -1.0, "power_w"),
        (math.nan, 0.0, "dt_s"),
        (1.0, math.inf, "power_w"),
    ):
        with pytest.raises(InputError, match=word):
            plant.advance(dt_s, power_w)
    assert (plant.rise_k, plant.coil_rise_k) == before


def test_the_one_node_plant_is_relax():
    plant = thermal_plant("exact", ThermalParameters(tau_s=50.0), rise_k=3.0)
    plant.advance(7.0, 0.5)
    assert plant.rise_k == plant.coil_rise_k == relax(3.0, 0.5, 7.0, THERMAL.with_values(tau_s=50.0))


def test_nonsense_is_refused():
    for call, word in (
        (lambda: thermal_plant("three_node"), "exact, two_node"),
        (lambda: thermal_plant("two_node", THERMAL), "TwoNodeParameters"),
        (lambda: thermal_plant("exact", TWO_NODE), "ThermalParameters"),
        (lambda: thermal_plant("two_node", rise_k=math.nan), "rise_k"),
        (lambda: TwoNodeHeat(coil_rise_k=math.inf), "coil_rise_k"),
        (lambda: TwoNodeParameters(coil_j_per_k=1.2), "less than tau_s"),
        (lambda: TWO_NODE.with_values(coupling_w_per_k=0.0), "coupling_w_per_k"),
    ):
        with pytest.raises(InputError, match=word):
            call()


def test_what_was_not_measured_is_marked_assumed():
    kinds = {row.name: row.provenance for row in provenance(TWO_NODE)}
    assert kinds == {"tau_s": "stated", "c_k_per_w": "stated", "coil_j_per_k": "assumed", "coupling_w_per_k": "assumed"}

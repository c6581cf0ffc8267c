"""The tolerance study against error propagation, closed forms and static balances that do not use it."""

from __future__ import annotations

import json
import math
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import typer
from numpy.random import SeedSequence
from typer.testing import CliRunner

from haptics.errors import InputError
from haptics.physics.latch.parameters import LatchParameters
from haptics.physics.latch.pulse import latch_plant
from haptics.physics.thermal.one_node import PULSE_S, THERMAL, relax
from haptics.scheduling import ThermalBudget
from haptics.time import NS_PER_S
from rigs.tolerance import study
from rigs.tolerance.brake import times
from rigs.tolerance.calibration import NOISES, BenchUncertainty, calibrated_host, published_host
from rigs.tolerance.command import _show, tolerance
from rigs.tolerance.draws import NAMES, NOMINAL_DEVICE, VARIED, device
from rigs.tolerance.heat import THREE_HERTZ, TWO_HERTZ, Body, played
from rigs.tolerance.pin import pin
from rigs.tolerance.study import ToleranceReport, process_pool, tolerance_study
from rigs.tolerance.summary import FeltRow, spread_of

pytestmark = pytest.mark.slow


PERFECT = BenchUncertainty(
    tau_s=0.0, c_k_per_w=0.0, power_share=0.0, force_constant_share=0.0, threshold_v=0.0, capacitance_share=0.0, travel_s=0.0
)
LATCH_NAMES = NAMES[: NAMES.index("coil_supply_v") + 1]
HALF = {row.name: row.half_width for row in VARIED}
NOMINAL = {row.name: row.nominal for row in VARIED}


def here(devices: int, **arguments) -> ToleranceReport:
    """The study in this process."""
    with ThreadPoolExecutor(1) as executor:
        return tolerance_study(devices, executor=executor, **arguments)


def row(report: ToleranceReport, quantity: str) -> FeltRow:
    return next(one for one in report.felt if one.quantity == quantity)


def three_sigma(n: int) -> float:
    """Of the relative sampling error of a standard deviation; that of a normal variable, a uniform one's is smaller."""
    return 3.0 / math.sqrt(2.0 * n)


@pytest.fixture(scope="module")
def of_heat_and_force() -> ToleranceReport:
    """c and the brake's gain vary: each felt in its own quantities only."""
    return here(300, only=("c_k_per_w", "force_gain"))


# Against linear error propagation -------------------------------------------------------------------------------------


def reference_arrival_s(parameters: LatchParameters, volts: float, toward_skin: bool) -> float:
    plant = latch_plant("reference", parameters, latched="off" if toward_skin else "on")
    plant.drive(0.0, volts if toward_skin else -volts)
    plant.advance(PULSE_S)
    kind = "reached_skin" if toward_skin else "reached_off"
    return next(event.time_s for event in plant.take_events() if event.kind == kind)


def test_spread_of_arrival_is_that_of_its_parameters_times_its_sensitivities():
    spread, n = 0.02, 200
    report = here(n, spread=spread, only=LATCH_NAMES)
    for quantity, toward_skin in (("arrival on the skin", True), ("arrival back", False)):
        variance = 0.0
        for name in LATCH_NAMES:
            step = 0.1 * HALF[name]
            around_s = []
            for value in (NOMINAL[name] - step, NOMINAL[name] + step):
                volts = value if name == "coil_supply_v" else NOMINAL_DEVICE.coil_supply_v
                shifted = {} if name == "coil_supply_v" else {name: value}
                around_s.append(reference_arrival_s(NOMINAL_DEVICE.latch.with_values(**shifted), volts, toward_skin))
            slope = (around_s[1] - around_s[0]) / (2.0 * step)
            variance += (slope * spread * HALF[name]) ** 2 / 3.0
        assert row(report, quantity).before.sd == pytest.approx(1e3 * math.sqrt(variance), rel=three_sigma(n))


def test_spread_of_warmth_is_c_times_power(of_heat_and_force: ToleranceReport):
    own = pin(NOMINAL_DEVICE.latch, NOMINAL_DEVICE.coil_supply_v)
    energy_j = 0.5 * (own.out.energy_j + own.back.energy_j)
    decay = math.exp(-0.5 / THERMAL.tau_s)
    per_c = energy_j / THERMAL.tau_s * sum(decay**k for k in range(720))  # every switch of 6 min at 2 Hz, added one by one
    found = row(of_heat_and_force, "warmth, 2 Hz for 6 min")
    assert found.nominal == pytest.approx(THERMAL.c_k_per_w * per_c, rel=1e-9)  # rounding of 720 sums
    assert found.before.sd == pytest.approx(per_c * 10.0 / math.sqrt(3.0), rel=three_sigma(300))
    believed_k = THERMAL.c_k_per_w * per_c * 18.0 * PULSE_S / energy_j
    max_k = (THERMAL.c_k_per_w + 10.0) * per_c - believed_k
    assert 0.95 * max_k < abs(found.before.worst) <= max_k  # of 300 devices some are within a twentieth of the end
    assert [cause.parameter for cause in found.causes] == ["c_k_per_w"]
    assert found.causes[0].share == pytest.approx(1.0, abs=1e-9)


def test_warmth_left_by_calibration_is_the_bench_s_own(of_heat_and_force: ToleranceReport):
    found = row(of_heat_and_force, "warmth, 44 a minute")
    # Steady: peak = c P s / tau / (1 - exp(-s/tau)) is c P to within s / (2 tau), so tau is hardly felt.
    bench = BenchUncertainty()
    expected_k = found.nominal * math.hypot(bench.c_k_per_w / THERMAL.c_k_per_w, bench.power_share)
    # c itself varies by 8 % from device to device, which adds its square to a product of errors: 0.4 % of the power's share.
    assert found.after.sd == pytest.approx(expected_k, rel=three_sigma(300) + 0.01)
    assert found.removed_share == pytest.approx(1.0 - found.after.sd / found.before.sd)


@pytest.mark.parametrize("force_n", [1.0, 4.0, 10.0])
def test_a_gain_of_ten_per_cent_makes_that_error_of_force(of_heat_and_force: ToleranceReport, force_n: float):
    found = row(of_heat_and_force, f"force for {force_n:g} N")
    on_share = 1.0 - 5e-3 / force_n  # the 5 mN of a brake that is off do not go with the gain
    assert found.before.sd == pytest.approx(on_share * 10.0 / math.sqrt(3.0), rel=three_sigma(300))
    assert 0.95 * 10.0 * on_share < abs(found.before.worst) <= 10.0 * on_share
    assert [cause.parameter for cause in found.causes] == ["force_gain"]
    # After: 3 % of k, and 5 V of the threshold by the law's slope, dF/F = 2 V0 dV0 / (V^2 - V0^2), with
    # V^2 - V0^2 = F/k; Table 4.2's k and V0.
    left = math.hypot(3.0, 100.0 * 2.0 * 172.2985 * 5.0 * 9.630792e-6 / (force_n - 5e-3)) * on_share
    # Gain alters the volts that are set, by at most a tenth: its square adds up to 1 % to the threshold's part.
    assert found.after.sd == pytest.approx(left, rel=three_sigma(300) + 0.01)


def test_what_does_not_vary_is_not_felt(of_heat_and_force: ToleranceReport):
    for quantity in ("arrival on the skin", "arrival back", "impact on the skin", "brake felt by a closing hand"):
        found = row(of_heat_and_force, quantity)
        assert found.before.sd == 0.0
        assert found.removed_share is None
        assert found.causes == ()


# Limiting cases -------------------------------------------------------------------------------------------------------


def test_no_spread_of_parameters_is_no_spread_of_anything():
    report = here(5, spread=0.0)
    assert report.parameters == VARIED
    for found in report.felt:
        assert found.before.n == 5
        assert found.before.sd == 0.0
        assert found.before.p2_5 == found.before.p97_5 == found.before.worst
        assert found.removed_share is None


def test_a_perfect_bench_leaves_no_error_in_what_it_can_reach():
    # What a bench cannot know varies not: skin and slack are the wearer's, lags and supply current are not measured.
    # A gain of the supply is inside k and threshold, but a brake also takes that much longer to charge.
    measured = [name for name in NAMES if name not in ("slack_m", "supply_current_a", "tau_on_s", "tau_off_s", "volts_gain")]
    measured = [name for name in measured if not name.startswith("skin")]
    report = here(20, calibration=PERFECT, only=measured)
    for quantity in ("brake closes to 90 %", "brake lets go"):
        assert abs(row(report, quantity).after.worst) < 1e-6  # ms; force tables go a volt at a time and scale exactly
    # The bench's pin has no skin under it: what skin takes of the coil's energy is 2.4e-6 of it, 6e-5 K; c adds a seventh.
    assert abs(row(report, "warmth, 2 Hz for 6 min").after.worst) < 1e-4
    assert abs(row(report, "above the limit, 3 Hz for 6 min").after.worst) < 1e-4
    # One contact of 540 may still fall on the other side of the limit for those 2.4e-6.
    assert abs(row(report, "denied needlessly, 3 Hz for 6 min").after.worst) <= 1.0 / 540.0


def test_a_perfect_bench_knows_when_a_bare_pin_arrives():
    rng = np.random.default_rng(5)
    for _ in range(5):
        one = device(rng.uniform(-1.0, 1.0, len(VARIED)).tolist())
        host = calibrated_host(one, PERFECT, [0.0] * NOISES)
        alone = one.latch.with_values(skin_stiffness_n_m=0.0)
        # Level dynamic is within 0.5 us of the reference (docs/explanation/fidelity.md).
        assert host.out_s == pytest.approx(reference_arrival_s(alone, one.coil_supply_v, True), abs=0.5e-6)
        assert host.back_s == pytest.approx(reference_arrival_s(alone, one.coil_supply_v, False), abs=0.5e-6)


@pytest.fixture(scope="module")
def of_a_perfect_bench() -> ToleranceReport:
    return here(60, calibration=PERFECT)


def test_a_perfect_bench_knows_the_volts_for_a_force(of_a_perfect_bench: ToleranceReport):
    for force_n in (1, 4, 10):
        found = row(of_a_perfect_bench, f"force for {force_n} N")
        assert abs(found.before.worst) > 10.0
        assert abs(found.after.worst) < 1e-9  # %, rounding of square roots of squares


def test_impacts_and_failures_are_out_of_a_bench_s_reach(of_a_perfect_bench: ToleranceReport):
    report = of_a_perfect_bench
    for quantity in ("contact fails", "impact on the skin", "recoil of the release"):
        assert row(report, quantity).after == row(report, quantity).before


# One device -----------------------------------------------------------------------------------------------------------


def test_a_contact_fails_where_the_skin_pushes_harder_than_the_plates_hold():
    rng = np.random.default_rng(3)
    failed = 0
    for _ in range(150):
        one = device(rng.uniform(-1.0, 1.0, len(VARIED)).tolist(), spread=2.0)
        p = one.latch

        def net_n(x: float, p: LatchParameters = p) -> float:
            plates_n = p.hold_on_n * (1.0 + (p.stroke_m - x) / p.plate_length_m) ** -p.plate_power
            plates_n -= p.hold_off_n * (1.0 + x / p.plate_length_m) ** -p.plate_power
            return plates_n - p.skin_stiffness_n_m * (x - p.skin_at_m)

        # A pin counts as on within near_stop_m of the stop: it rests there if the net force holds it at either end.
        holds = max(net_n(p.stroke_m), net_n(p.stroke_m - p.near_stop_m)) > 0.0
        assert pin(p, one.coil_supply_v).out.switched == holds
        failed += not holds
    assert 15 < failed < 135  # neither all nor none: the comparison says something


def test_a_pin_that_fails_neither_arrives_nor_comes_back_and_still_warms():
    stiff = NOMINAL_DEVICE.latch.with_values(skin_stiffness_n_m=600.0)
    found = pin(stiff, 5.0)
    assert not found.out.switched
    assert not found.back.switched
    assert math.isnan(found.out.arrival_s)
    assert math.isnan(found.back.impact_m_s)
    assert found.power_w == pytest.approx(18.0, rel=0.01)  # V^2/R is 18.1 W, less the rise of the current


@pytest.mark.parametrize("train", [TWO_HERTZ, THREE_HERTZ])
@pytest.mark.parametrize(("c_k_per_w", "tau_s"), [(69.0, 102.0), (78.0, 98.0), (60.0, 106.0)])
def test_a_train_is_played_as_the_heat_account_of_a_glove_would(train, c_k_per_w: float, tau_s: float):
    real = Body(THERMAL.with_values(c_k_per_w=72.0, tau_s=100.0), 17.0)
    believed = Body(THERMAL.with_values(c_k_per_w=c_k_per_w, tau_s=tau_s), 18.0)
    budget = ThermalBudget(believed.thermal)
    energy_j = 18.0 * PULSE_S
    rise_k = peak_k = 0.0
    admitted, between_ns = 0, round(train.spacing_s * NS_PER_S)
    for k in range(2 * train.contacts):
        if k % 2 == 0:
            plays = budget.allows(energy_j, k * between_ns, reserve_j=energy_j)
            admitted += plays
        if plays:
            budget.spend(energy_j, k * between_ns)
            rise_k += real.jump_k
        peak_k = max(peak_k, rise_k)
        rise_k = relax(rise_k, 0.0, train.spacing_s, real.thermal)
    found = played(train, real, believed)
    assert found.contacts == admitted
    assert found.peak_k == pytest.approx(peak_k, rel=1e-9)  # rounding over a thousand steps


def test_brake_times_are_those_of_charge_lag_and_slack():
    found = times(NOMINAL_DEVICE.brake, 1000.0)
    contact, drive, finger = NOMINAL_DEVICE.brake.contact, NOMINAL_DEVICE.brake.drive, NOMINAL_DEVICE.brake.finger
    # Let go: an exponential to a tenth, after the shorted output has fallen (R C is 55 us) and less the 5 mN that stay.
    held_n = NOMINAL_DEVICE.brake.full_force_n(0, 1000.0)
    falls_s = contact.tau_off_s * math.log((held_n - 5e-3) / (0.1 * held_n - 5e-3))
    assert found.release_s == pytest.approx(falls_s, abs=0.25e-3)  # half a step, at whose middle volts are taken
    # Closes: volts ramp by I/C, capacity follows their force with its lag, both written out in steps of a microsecond. The
    # ramp's end is rounded off over R C = 55 us; half of a step of 0.5 ms squared over the lag of 2 ms is as much again.
    volt_s = drive.supply_current_a / (NOMINAL_DEVICE.brake.capacitance_f(0) + drive.stray_f)
    now_n, k = 0.0, 0
    while now_n < 0.9 * held_n:
        volts = min(1000.0, volt_s * k * 1e-6)
        now_n += (9.630792e-6 * max(0.0, volts**2 - 172.2985**2) + 5e-3 - now_n) * 1e-6 / contact.tau_on_s
        k += 1
    assert found.engage_s == pytest.approx(k * 1e-6, abs=0.11e-3)
    # A hand takes up the slack, then stretches hand (1 kN/m) and strips (4 kN/m) to 1 N: both on a closed brake.
    assert found.felt_s == pytest.approx((finger.slack_m + 1.0 / 800.0) / 0.1, abs=1e-9)


# The pool -------------------------------------------------------------------------------------------------------------


def test_the_result_is_the_same_whoever_computes_it(monkeypatch: pytest.MonkeyPatch):
    alone = here(9, seed=7)
    monkeypatch.setattr(study, "CHUNK", 2)
    told: list[str] = []
    with process_pool(2) as executor:
        assert tolerance_study(9, 7, executor=executor, progress=told.append) == alone
    assert told[-1] == "9 of 9 devices"
    assert len(told) == 5
    with ThreadPoolExecutor(3) as executor:
        assert tolerance_study(9, 7, executor=executor) == alone
    assert here(9, seed=8) != alone


def test_processes_are_started_where_none_are_given():
    assert tolerance_study(3, 7) == here(3, seed=7)


def test_a_device_draws_the_same_whichever_parameters_vary():
    seeds = SeedSequence(4).spawn(3)
    everything, _, _ = study.play(seeds, 1.0, PERFECT, NAMES)
    one, _, _ = study.play(seeds, 1.0, PERFECT, ("tau_s",))
    k = NAMES.index("tau_s")
    assert (one[:, k] == everything[:, k]).all()
    assert not np.delete(one, k, axis=1).any()
    assert np.unique(everything).size == everything.size  # no stream is used twice


class OneThenNever(Executor):
    """Runs what it is handed first; the rest never begins."""

    def __init__(self) -> None:
        self.futures: list[Future] = []

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        if not self.futures:
            future.set_result(fn(*args, **kwargs))
        self.futures.append(future)
        return future


def test_an_interruption_gives_up_what_has_not_begun(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(study, "CHUNK", 1)
    executor = OneThenNever()

    def interrupt(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tolerance_study(4, executor=executor, progress=interrupt)
    assert len(executor.futures) == 4
    assert all(future.cancelled() for future in executor.futures[1:])


# Summary, command, refusals -------------------------------------------------------------------------------------------


def test_a_spread_leaves_out_devices_that_have_no_error():
    found = spread_of(np.array([1.0, -3.0, math.nan, 2.0, 0.0]), jnd=1.0)
    assert found.n == 4
    assert found.mean == 0.0
    assert found.sd == pytest.approx(math.sqrt(14.0 / 3.0))
    assert found.worst == -3.0
    assert found.beyond_jnd == 0.5  # 1.0 itself is not beyond
    assert found.p2_5 == pytest.approx(-3.0 + 0.075 * 3.0)  # 2.5 % of three intervals from the least
    assert spread_of(np.array([math.nan, 1.0]), 1.0).n == 1
    assert math.isnan(spread_of(np.array([math.nan, 1.0]), 1.0).sd)


def test_the_command_prints_one_object_or_tables(capsys: pytest.CaptureFixture[str]):
    app = typer.Typer()
    app.command()(tolerance)
    ran = CliRunner().invoke(app, ["--devices", "3", "--seed", "2", "--only", "force_gain", "--workers", "1", "--json"])
    assert ran.exit_code == 0
    told = json.loads(ran.stdout)
    assert told["devices"] == 3
    assert told["seed"] == 2
    assert [p["name"] for p in told["parameters"]] == ["force_gain"]
    assert told["parameters"][0]["half_width"] == 0.1
    assert told["parameters"][0]["section"] == "4.7.3"
    report = here(3, seed=2, only=["force_gain"])
    assert [f["quantity"] for f in told["felt"]] == [f.quantity for f in report.felt]
    for one in told["felt"]:
        assert {"unit", "nominal", "jnd", "before", "after", "removed_share", "why"} <= set(one)
    _show(report)
    printed = capsys.readouterr().out
    assert "force for 4 N" in printed
    assert "calibration removes" in printed


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"devices": 1}, "devices = 1"),
        ({"devices": 10**7}, "devices"),
        ({"seed": -1}, "seed"),
        ({"spread": 2.1}, "spread"),
        ({"spread": math.nan}, "spread"),
        ({"only": ["colour"]}, "only = 'colour'"),
    ],
)
def test_nonsense_is_refused(arguments: dict, named: str):
    with pytest.raises(InputError, match=named):
        tolerance_study(**{"devices": 2, "executor": OneThenNever(), **arguments})


def test_nonsense_of_bench_and_pool_is_refused():
    with pytest.raises(InputError, match="tau_s"):
        BenchUncertainty(tau_s=-1.0)
    with pytest.raises(InputError, match="force_constant_share"):
        replace(BenchUncertainty(), force_constant_share=0.5)
    with pytest.raises(InputError, match="workers"):
        process_pool(0)


def test_every_parameter_stays_within_its_model_at_the_greatest_spread():
    for name in NAMES:
        for end in (-1.0, 1.0):
            assert device([end * (one == name) for one in NAMES], study.MAX_SPREAD)
    assert published_host().volts_for(10.0) < 1500.0


# The judged size ------------------------------------------------------------------------------------------------------


@pytest.mark.soak
def test_force_of_five_thousand_devices_spreads_as_the_law_written_out():
    n = 5000
    report = tolerance_study(n)
    rng = np.random.default_rng(99)

    def drawn(name: str) -> np.ndarray:
        return NOMINAL[name] + HALF[name] * rng.uniform(-1.0, 1.0, 1_000_000)

    gain, overlap, volts = (drawn(name) / NOMINAL[name] for name in ("force_gain", "overlap_m2", "volts_gain"))
    thickness = drawn("thickness_m") / NOMINAL["thickness_m"]
    threshold_v = drawn("threshold_v")
    for force_n in (1.0, 4.0, 10.0):
        set_v2 = (force_n - 5e-3) / 9.630792e-6 + 172.2985**2
        over_v2 = set_v2 * volts**2 - (threshold_v * thickness) ** 2
        felt_n = 9.630792e-6 * gain * overlap / thickness**2 * over_v2 + 5e-3
        found = row(report, f"force for {force_n:g} N")
        assert found.before.sd == pytest.approx(100.0 * felt_n.std() / force_n, rel=three_sigma(n))
        assert found.after.beyond_jnd < 0.001
    assert row(report, "contact fails").before.n == n

"""The response rig finds how fast a brake grips and lets go, within its stated uncertainty, and names what is wrong."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
import shorter
from brake_truth import Bystander, true_brake, url

from haptics.physics.brake.pull import pull as reference_pull
from haptics.recording import load
from rigs.bench import BenchOptions
from rigs.response import rig as response
from rigs.response.fit import crossing

pytestmark = pytest.mark.slow


# Values that nothing here was tuned with.
ASKED = (
    {},
    {"slack_m": 1.6e-3, "tau_off_s": 0.022, "tau_on_s": 3e-3, "thickness_m": 14e-6},
    {"slack_m": 0.4e-3, "tau_off_s": 0.04, "tau_on_s": 1e-3},
    {"tau_on_s": 5e-3, "tau_off_s": 0.017, "permittivity": 3.0},
)
ACCEL_M_S2 = 0.5
"""Of the simulated stage."""


@pytest.fixture
def few_steps(monkeypatch):
    """Half of them: enough for every fault."""
    shorter.response(monkeypatch.setattr)


def off_by(keys: dict, seed: int) -> dict[str, float]:
    """How many of its standard deviations the rig is off, by quantity."""
    result = response.run(BenchOptions(port=url(keys), seed=seed))
    assert result.sound, (keys, seed, result.faults, result.measured)
    true = true_brake(seed, {**response.SHORT_STRIPS, **keys})
    truth = true.step(response.BEFORE_S, response.HELD_S, response.PULL_M_S, ACCEL_M_S2)
    assert set(truth) == set(result.quantities)
    return {name: (one.value - truth[name]) / one.sd for name, one in result.quantities.items()}


@pytest.mark.parametrize(("keys", "seed"), list(zip(ASKED, range(31, 35), strict=True)))
def test_a_brake_with_other_parameters_is_recovered_within_the_stated_uncertainty(keys, seed):
    # 4 standard deviations: of 16 intervals a right one leaves out one in 1000 runs of this test.
    assert {name: z for name, z in off_by(keys, seed).items() if abs(z) >= 4.0} == {}


@pytest.mark.soak
@pytest.mark.timeout(3000)
def test_95_percent_intervals_cover_the_truth_of_88_to_100_brakes_in_100():
    jobs = [(ASKED[seed % len(ASKED)], 3000 + seed) for seed in range(100)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(off_by, *zip(*jobs, strict=True)))
    covered = {name: sum(abs(one[name]) <= 1.96 for one in found) for name in found[0]}
    assert all(88 <= count <= 100 for count in covered.values()), covered


def test_a_nominal_brake_keeps_the_published_bounds_and_meets_the_reference_model():
    result = response.run(BenchOptions(port="sim://brake?spread=0&volts_gain=1", seed=3))
    found = result.quantities
    assert found["response_s"].value < 0.1  # thesis 4.7.3
    assert found["release_s"].value < 0.1
    assert found["slew_n_s"].value > 200.0
    there = reference_pull("reference", 1500.0)
    # The reference's is the capacity's, at full overlap; here 3 % are gone when volts come, the frame loads at 4.5 N/ms, and
    # force falls while it is held: half a millisecond each way, besides the rig's own uncertainty.
    assert found["response_s"].value == pytest.approx(1e-3 * there.response_ms, abs=4 * found["response_s"].sd + 0.5e-3)
    assert found["release_s"].value == pytest.approx(1e-3 * there.release_ms, abs=4 * found["release_s"].sd + 0.5e-3)


def test_a_level_is_passed_when_an_exact_edge_passes_it():
    rng = np.random.default_rng(8)
    seconds = np.sort(rng.uniform(0.0, 20e-3, 100))
    share = -np.expm1(-seconds / 4e-3) + rng.normal(0.0, 1e-3, 100)
    found = crossing(seconds, share, 0.9)
    true_s = 4e-3 * np.log(10.0)
    assert abs(found.at_s - true_s) < 4 * found.sd_s
    assert found.sd_s < 0.1e-3  # a noise of 1e-3 over a slope of 25 a second is 40 us


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize(
    ("board", "instruments", "what"),
    [
        ("", {"stage": "slip_n=12"}, "clamp_slips"),
        ("", {"stage": "slip_n=20"}, "clamp_slips"),
        ("", {"stage": "stuck=1"}, "stage_still"),
        ("", {"stage": "locked=1"}, "stage_still"),
        ("", {"loadcell": "full_scale_n=5"}, "load_cell_off_scale"),
        ("", {"loadcell": "silent_at_s=8"}, "load_cell_silent"),
        ("", {"loadcell": "flat_at_s=8"}, "load_cell_flat"),
        ("fitted=0", {}, "brake_absent"),
        ("slack_m=0.008", {}, "strips_loose"),
    ],
)
def test_a_fault_at_the_bench_is_named_and_nothing_is_fitted(board, instruments, what):
    ports = {kind: f"sim://{kind}?{keys}" for kind, keys in instruments.items()}
    result = response.run(BenchOptions(port=f"sim://brake?{board}" if board else "sim://brake", seed=4, instruments=ports))
    assert [fault.what for fault in result.faults] == [what]
    assert not result.quantities


def test_a_frame_too_soft_to_show_the_brake_is_out_of_limits():
    result = response.run(BenchOptions(port="sim://brake?load_stiffness_n_m=5000", seed=4))
    assert not result.sound
    assert [one.measurement.name for one in result.measured if not one.within] == ["loading_n_s"]


def test_a_brake_that_is_shorted_is_the_board_s_fault():
    with Bystander() as world:

        def break_it(what: str) -> None:
            if "step 4 of" in what:
                world.device("brake").set_load(0, leak_ohm=1e3)

        result = response.run(BenchOptions(port=world.url, progress=break_it))
    assert {fault.what for fault in result.faults} == {"board"}
    assert not result.quantities


def test_an_interrupted_run_leaves_its_record_and_a_board_that_is_off(tmp_path):
    def interrupt(what: str) -> None:
        if "step 3 of" in what:
            raise KeyboardInterrupt

    with Bystander() as world:
        with pytest.raises(KeyboardInterrupt):
            response.run(BenchOptions(port=world.url, record=tmp_path / "response.h5", progress=interrupt))
        assert (world.device("brake").energised(), world.device("brake").state.name) == ([], "DISARMED")
    kept = load(tmp_path / "response.h5")
    assert (kept.complete, kept.lost_bytes) == (False, 0)
    assert len(kept.stream("loadcell")["force_n"]) > 1000

"""The thermal rig finds what the plant was given, says how sure it is, and names what is wrong at the bench."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
import shorter
from scipy.integrate import solve_ivp

from firmware_models.boards.tactiles_board import TactilesBoard
from firmware_models.line.uart import Line
from firmware_models.options import parse_options, split_url
from firmware_models.protocol_sim import board_options
from haptics.errors import CommandRefused, InputError, LimitError
from haptics.recording import Recording, load
from rigs import thermal
from rigs.bench import Bench, BenchOptions
from rigs.instruments import Thermocouple
from rigs.result import RigResult
from rigs.thermal import rig
from rigs.thermal.fit import PulseRecord, fit_heat

pytestmark = pytest.mark.slow


# Values that nothing here was tuned with.
ASKED = (
    "sim://tactiles",
    "sim://tactiles?tau_s=83&c_k_per_w=91",
    "sim://tactiles?tau_s=140&c_k_per_w=52&resistance_ohm=1.5",
    "sim://tactiles?level=event&c_k_per_w=60",
    "sim://tactiles?level=table&tau_s=70",
)


@pytest.fixture
def half_a_minute_each(monkeypatch):
    """Heating and cooling for half a minute: enough for every fault."""
    shorter.thermal(monkeypatch.setattr, heat_s=30.0, cool_s=30.0)


@pytest.fixture
def a_minute_each(monkeypatch):
    """Heating and cooling for a minute instead of six: a fit with wider intervals, and what shows while it cools."""
    shorter.thermal(monkeypatch.setattr)


def truth(url: str, seed: int, channel: int = 0):
    name, query = split_url(url)
    options = parse_options({"seed": str(seed), **query}, board_options(name))
    return TactilesBoard(options, Line(500_000), 0).plant.thermals[channel]


def pulls(url: str, seed: int) -> dict[str, float]:
    """How many of its standard deviations the rig is off, by parameter."""
    return off_by(thermal.run(BenchOptions(port=url, seed=seed)), url, seed)


def off_by(result: RigResult, url: str, seed: int) -> dict[str, float]:
    """The same of a result."""
    assert result.sound, (url, seed, result.faults, result.measured)
    true = truth(url, seed)
    return {
        name: (result.quantities[name].value - getattr(true, name)) / result.quantities[name].sd
        for name in ("tau_s", "c_k_per_w")
    }


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[RigResult, Recording]:
    """One run of half its length on a board with other parameters, and its recording."""
    path = tmp_path_factory.mktemp("recorded") / "thermal.h5"
    with pytest.MonkeyPatch.context() as patch:
        shorter.thermal(patch.setattr, heat_s=150.0, cool_s=120.0)
        return thermal.run(BenchOptions(port=ASKED[1], seed=12, record=path)), load(path)


def test_tau_and_c_of_a_recorded_run_are_within_the_stated_uncertainty(recorded):
    result, _ = recorded
    # 4 standard deviations: of 8 intervals here and below a right one leaves out one in 2000 runs.
    assert all(abs(pull) < 4.0 for pull in off_by(result, ASKED[1], 12).values())
    assert result.quantities["tau_s"].sd < 0.02 * result.quantities["tau_s"].value  # else the interval means nothing
    assert result.quantities["c_k_per_w"].sd < 0.03 * result.quantities["c_k_per_w"].value


def test_an_actuator_is_heated_and_cooled_as_the_published_one():
    assert (rig.SWITCHES_HZ, rig.HEAT_S, rig.COOL_S) == (2.0, 360.0, 360.0)  # Fig 3.4
    assert rig.PULSE_S == 10e-3


@pytest.mark.usefixtures("a_minute_each")
@pytest.mark.parametrize(("url", "seed"), list(zip(ASKED[2:], range(13, 16), strict=True)))
def test_a_board_with_other_parameters_is_recovered_within_the_stated_uncertainty(url, seed):
    assert all(abs(pull) < 4.0 for pull in pulls(url, seed).values())


@pytest.mark.soak
def test_95_percent_intervals_cover_the_truth_of_88_to_100_boards_in_100():
    jobs = [(ASKED[seed % len(ASKED)], 1000 + seed) for seed in range(100)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(pulls, *zip(*jobs, strict=True)))
    for name in ("tau_s", "c_k_per_w"):
        covered = sum(abs(one[name]) <= 1.96 for one in found)
        assert 88 <= covered <= 100, (name, covered)


def test_the_fit_finds_what_another_integrator_made():
    """Heat and junction by ``solve_ivp``, a coil that draws less as it warms, noise: nothing of the rig's own is in the data."""
    tau_s, c, lag_s, cold_w, per_k = 97.0, 74.0, 1.2, 0.345, 0.0039
    start_s, stop_s = 20.0, 380.0

    def change(t, y):
        power_w = cold_w if start_s <= t < stop_s else 0.0
        return [(c * power_w - y[0]) / tau_s, (y[0] - y[1]) / lag_s]

    seconds = np.arange(0.0, 740.0, 0.1)
    pieces, state = [], [0.0, 0.0]
    for low, high in ((0.0, start_s), (start_s, stop_s), (stop_s, 741.0)):
        solved = solve_ivp(change, (low, high), state, rtol=1e-9, atol=1e-9, dense_output=True, max_step=1.0)
        pieces.append(solved.sol(seconds[(seconds >= low) & (seconds < high)]))
        state = solved.y[:, -1]
    rise_k, junction_k = np.hstack(pieces)
    rng = np.random.default_rng(5)
    celsius = 21.0 + junction_k + rng.normal(0.0, 0.05, len(seconds))
    # Pulses half a spacing later than the steady power, which they stand for; each met once, somewhere.
    starts_s = start_s + 0.25 + 0.5 * np.arange(720) - 0.005
    phases_s = rng.uniform(0.0, 10e-3, 720)
    amps = cold_w / 2 / 10e-3 / 5.0 / (1 + per_k * np.interp(starts_s, seconds, rise_k))
    seen = [(round((t + f) * 1e9), a, 5.0) for t, f, a in zip(starts_s, phases_s, amps, strict=True)]
    record = PulseRecord.of([round(t * 1e9) for t in starts_s], 10e-3, seen).relative_to(0)
    fit = fit_heat(seconds, celsius, record, 0.05)
    assert abs(fit.fit.value("tau_s") - tau_s) < 4 * fit.fit.sd("tau_s")
    assert abs(fit.fit.value("lag_s") - lag_s) < 4 * fit.fit.sd("lag_s") < 0.2 * lag_s
    assert abs(fit.fit.value("c_k_per_w") - c) < fit.c_sd  # its stated parts (gain, power) are not played here
    assert fit.fit.sd("c_k_per_w") < 0.1  # 7000 samples of 0.05 K on 23 K
    assert 0.9 < fit.reduced_chi2 < 1.1  # sd of a reduced chi squared of 7400 points: 0.016


@pytest.mark.usefixtures("half_a_minute_each")
@pytest.mark.parametrize(
    ("board", "thermocouple", "what"),
    [
        ("sim://tactiles?stuck=1", "", "actuator_stuck"),
        ("sim://tactiles?fitted=2", "", "coil"),
        ("sim://tactiles", "loose_at_s=35", "thermocouple_loose"),
        ("sim://tactiles", "loose_at_s=0", "thermocouple_loose"),
        ("sim://tactiles", "open_at_s=35", "thermocouple_open"),
        ("sim://tactiles", "open_at_s=0", "thermocouple_open"),
        ("sim://tactiles", "channel=3", "thermocouple_elsewhere"),
    ],
)
def test_a_fault_at_the_bench_is_named_and_nothing_is_fitted(board, thermocouple, what):
    instruments = {"thermocouple": f"sim://thermocouple?{thermocouple}"} if thermocouple else {}
    result = thermal.run(BenchOptions(port=board, seed=4, instruments=instruments))
    assert [fault.what for fault in result.faults] == [what]
    assert not result.quantities


@pytest.mark.usefixtures("a_minute_each")
@pytest.mark.parametrize("loose_at_s", [110, 137])  # the last 3 s: the scatter alone shows it
def test_a_thermocouple_that_comes_loose_while_it_cools_is_named(loose_at_s):
    instruments = {"thermocouple": f"sim://thermocouple?loose_at_s={loose_at_s}"}
    result = thermal.run(BenchOptions(seed=4, instruments=instruments))
    assert [fault.what for fault in result.faults] == ["thermocouple_loose"]
    assert not result.quantities


def test_a_board_without_its_supply_does_not_arm_and_says_why():
    with pytest.raises(CommandRefused, match="supply"):
        thermal.run(BenchOptions(port="sim://tactiles?supply_v=2"))


def test_a_board_that_gets_too_warm_is_switched_off(tmp_path):
    with pytest.raises(LimitError, match=r"K of rise, above the limit of 50 K"):
        thermal.run(BenchOptions(port="sim://tactiles?c_k_per_w=200", seed=2, record=tmp_path / "hot.h5"))
    kept = load(tmp_path / "hot.h5")
    assert not kept.complete
    last = kept.stream("tactiles_telemetry")[-1]
    assert last["current_ma"] == 0


def test_an_interrupted_run_leaves_its_record_and_a_board_that_is_off(tmp_path):
    def interrupt(what: str) -> None:
        if "60 of" in what:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        thermal.run(BenchOptions(record=tmp_path / "thermal.h5", progress=interrupt))
    kept = load(tmp_path / "thermal.h5")
    assert (kept.complete, kept.lost_bytes) == (False, 0)
    seconds = (kept.stream("thermocouple")["time_ns"] - kept.stream("thermocouple")["time_ns"][0]) / 1e9
    assert 78 < seconds[-1] < 82  # 20 s of rest and 60 s of heating
    assert not (tmp_path / "thermal.journal").exists()


def test_pins_are_back_and_nothing_is_on_however_a_bench_ends():
    for failure in (None, KeyboardInterrupt, LimitError):
        plant = None
        try:
            with Bench("tactiles", [Thermocouple], BenchOptions(), rig="test") as bench:
                plant = bench.glove.plant("tactiles")
                bench.arm()
                bench.pulse([2, 7], bench.now_ns + 50_000_000, 10e-3, toward_skin=True)
                bench.wait(0.2)
                assert [plant.truth()["latched"][k] for k in (2, 7)] == ["on", "on"]
                board = bench.link.port.board
                if failure is not None:
                    raise failure("ends here")
        except (KeyboardInterrupt, LimitError):
            pass
        assert set(board.plant.truth(board.now_ns)["latched"]) == {"off"}
        assert (board.energised(), board.state.name) == ([], "DISARMED")


def test_a_pin_whose_return_was_only_queued_is_withdrawn_too():
    with Bench("tactiles", [Thermocouple], BenchOptions(), rig="test") as bench:
        bench.arm()
        bench.pulse([4], bench.now_ns + 50_000_000, 10e-3, toward_skin=True)
        bench.wait(0.1)
        board = bench.link.port.board
        bench.pulse([4], bench.now_ns + 500_000_000, 10e-3, toward_skin=False)
    assert board.plant.truth(board.now_ns)["latched"][4] == "off"
    assert board.energised() == []


def test_the_recording_holds_what_the_fit_was_made_from(recorded):
    result, kept = recorded
    assert (kept.complete, kept.header["rig"], kept.header["seed"]) == (True, "thermal", 12)
    temperatures = kept.stream("thermocouple")["temperature_c"]
    assert len(temperatures) > 2850  # 290 s at 10 Hz
    assert temperatures.max() - temperatures[:100].mean() == pytest.approx(
        next(one.value for one in result.measured if one.measurement.name == "rise_k"), abs=0.5
    )  # 0.5 K: peak of noise and the room's drift
    assert {"wire", "events", "clock_fits", "tactiles_telemetry"} <= set(kept.streams)


def test_instruments_of_another_kind_or_world_are_refused():
    with pytest.raises(InputError, match="loadcell is not an instrument of this rig"):
        thermal.run(BenchOptions(instruments={"loadcell": "sim://loadcell"}))
    with pytest.raises(InputError, match="is hardware and the board is simulated"):
        thermal.run(BenchOptions(instruments={"thermocouple": "/dev/ttyUSB7"}))
    with pytest.raises(InputError, match=r"is hardware, and no port is given for: thermocouple"):
        thermal.run(BenchOptions(port="/dev/ttyACM7"))

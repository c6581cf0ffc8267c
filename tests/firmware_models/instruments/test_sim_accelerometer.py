"""The simulated accelerometer: lines, counts, and what a landing does to it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import serial

from firmware_models.boards.boot import BOARD_OPTIONS
from firmware_models.plants.tactiles_plant import PLANT_OPTIONS, RECOIL_SPREAD, Actuators
from haptics.errors import InputError
from haptics.physics.latch.pulse import switch
from haptics.physics.latch.recoil import RECOIL, SURFACES, recoil_m_s2
from haptics.units import STANDARD_GRAVITY_M_S2

QUIET = "noise_g=0&swing_g=0&gain=1&offset_g=0&partial=0"
MS = 1_000_000


def options(**given: Any) -> dict[str, Any]:
    return {key: option.default for key, option in {**BOARD_OPTIONS, **PLANT_OPTIONS}.items()} | given


def plant(seed: int = 1, **given: Any) -> Actuators:
    return Actuators(options(**given), np.random.default_rng(seed), 0)


class Bench:
    """A board without host, and an accelerometer on it; the plant is driven by hand."""

    _count = 0

    def __init__(self, board: str = "", accelerometer: str = ""):
        Bench._count += 1
        if "firmware_models" not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append("firmware_models")
        world = f"world=accelerometer-{Bench._count}&clock=virtual"
        join = [
            f"sim://{name}?{world}" + (f"&{more}" if more else "")
            for name, more in (("tactiles", board), ("accelerometer", accelerometer))
        ]
        self.board: Any
        self.port: Any
        self.board, self.port = (serial.serial_for_url(url, baudrate=500_000, timeout=0) for url in join)
        self.plant = self.board.board.plant
        self.plant.feed(True, 0)

    def run(self, to_ms: float, step_ms: float = 1.0) -> None:
        for at_ms in np.arange(self.port.now_ns / MS + step_ms, to_ms + step_ms / 2, step_ms):
            self.port.advance(round(at_ms * MS))

    def cycle(self, at_ms: float) -> int:
        """Out and back by hand, 100 ms apart; returns when the pin came back."""
        for shift_ms, sign in ((0.0, 1), (100.0, -1)):
            self.run(at_ms + shift_ms)
            self.plant.switch({0: sign}, self.port.now_ns)
            self.run(at_ms + shift_ms + 10.0)
            self.plant.switch({0: 0}, self.port.now_ns)
        self.run(at_ms + 200.0)
        return [time_ns for time_ns, _, kind, _ in self.plant.events if kind == "reached_off"][-1]

    def read(self) -> tuple[list[str], np.ndarray, np.ndarray]:
        """Headers, numbers and counts so far."""
        lines = self.port.read(1 << 20).decode().splitlines()
        rows = [line.split() for line in lines if not line.startswith("#")]
        headers = [line for line in lines if line.startswith("#")]
        numbers, counts = np.array([row for row in rows if len(row) == 2], dtype=int).T
        return headers, numbers, counts

    def close(self) -> None:
        self.port.close()
        self.board.close()

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def test_it_says_what_it_is_and_prints_3200_numbered_counts_a_second():
    with Bench() as bench:
        bench.run(2000.0)
        headers, numbers, counts = bench.read()
    assert headers == ["# accelerometer rate_hz=3200.0 range_g=16.0 g_per_count=0.00390625 bandwidth_hz=1600.0"]
    assert list(numbers) == list(range(len(numbers)))
    assert abs(len(numbers) - 6400) < 6400 * 4 * 0.005  # its clock, sd 0.5 %, at 4 sd
    # 12 mg of noise are 3 counts, swing of 20 mg, offset within 4 sd of 50 mg.
    assert np.diff(counts).std() == pytest.approx(np.sqrt(2.0) * 0.012 * 256, rel=0.1)
    assert abs(counts.mean()) < 0.2 * 256


def test_a_landing_rings_under_the_published_envelope_and_reaches_it():
    """Against ``haptics.physics.latch.recoil`` itself; the low-pass is set aside, so that the envelope is the model's."""
    with Bench("surface=bare&spread=0", f"{QUIET}&bandwidth_hz=10000&ring_hz=500") as bench:
        landed_ns = bench.cycle(100.0)
        truth = bench.port.truth()
        _, numbers, counts = bench.read()
    speed = abs([event for event in bench.plant.events if event[2] == "reached_off"][-1][3]) / 0.6634
    since_s = (truth["period_ns"] * (numbers + 1) - landed_ns) / 1e9
    part = (since_s > 0.5e-3) & (since_s < 20e-3)
    envelope_g = np.array([recoil_m_s2(t, "bare", speed, extrapolate=True) / STANDARD_GRAVITY_M_S2 for t in since_s[part]])
    ratio = np.abs(counts[part] / 256) / envelope_g
    # The landing's own strength scatters by 3 %; counts are steps of 4 mg on at least 0.3 g.
    assert 0.88 < ratio.max() < 1.12
    assert ratio.max() > 1.0 - 4 * 0.03 - 0.02
    rms = np.sqrt(np.mean(ratio**2)) * np.sqrt(2.0)
    assert rms == pytest.approx(ratio.max(), rel=0.05)  # 10 rings of one frequency: envelope over root mean square is sqrt(2)
    assert not counts[(since_s < 0.0) & (since_s > -50e-3)].any()


@pytest.mark.parametrize("surface", SURFACES)
def test_the_surface_decides_how_long_it_rings(surface):
    with Bench(f"surface={surface}&spread=0", QUIET) as bench:
        landed_ns = bench.cycle(100.0)
        truth = bench.port.truth()
        _, numbers, counts = bench.read()
    since_s = (truth["period_ns"] * (numbers + 1) - landed_ns) / 1e9
    part = (since_s > 0.0) & (since_s < 60e-3)
    energy = (counts[part] / 256) ** 2
    # Mean time of energy that decays as exp(-2t/tau) is tau/2; a period of sampling and a quarter of a ring either way.
    mean_s = float(np.sum(energy * since_s[part]) / np.sum(energy))
    assert mean_s == pytest.approx(RECOIL.tau_s(surface) / 2.0, abs=0.3e-3)


def test_samples_do_not_depend_on_how_often_somebody_looks():
    seen = []
    for step_ms in (1.0, 0.25):
        with Bench("", "") as bench:
            bench.run(100.0, step_ms)
            bench.plant.switch({0: 1}, bench.port.now_ns)
            bench.run(110.0, step_ms)
            bench.plant.switch({0: 0}, bench.port.now_ns)
            bench.run(200.0, step_ms)
            seen.append(bench.read()[2])
    shorter = min(map(len, seen))
    # Heat is settled at other moments, which changes the current in its last digits and a count here and there by one.
    assert shorter > 600
    assert np.abs(seen[0][:shorter] - seen[1][:shorter]).max() <= 1


def test_a_landing_on_the_skin_side_is_felt_less():
    with Bench("spread=0", QUIET) as bench:
        landed_ns = bench.cycle(100.0)
        period_ns = bench.port.truth()["period_ns"]
        _, numbers, counts = bench.read()
    at_ns = period_ns * (numbers + 1)
    out, back = np.abs(counts[at_ns < landed_ns - 10 * MS]).max(), np.abs(counts[at_ns > landed_ns - 10 * MS]).max()
    assert 0.1 < out / back < 0.8  # 0.3 of the peak, at 0.75 over 0.66 m/s, and where samples met the rings


@pytest.mark.parametrize("range_g", [2, 4, 8, 16])
def test_it_clips_at_the_ends_of_its_range(range_g):
    with Bench("peak_g=200", f"range_g={range_g}") as bench:
        bench.cycle(100.0)
        _, _, counts = bench.read()
    assert (counts.min(), counts.max()) == (-range_g * 256, range_g * 256 - 1)


def test_another_actuators_landing_is_not_felt():
    with Bench("", f"{QUIET}&channel=3") as bench:
        bench.cycle(100.0)
        _, _, counts = bench.read()
    assert not counts.any()


def test_listening_leaves_the_boards_own_events_in_place():
    with Bench() as bench:
        bench.cycle(100.0)
        kinds = [kind for _, _, kind, _ in bench.board.truth()["events"]]
    assert kinds == ["reached_skin", "left_skin", "reached_off"]


def test_a_loose_one_feels_little_and_lost_lines_leave_gaps_in_the_count():
    with Bench("", f"{QUIET}&loose_at_s=0&drop=0.1") as bench:
        bench.cycle(100.0)
        _, numbers, counts = bench.read()
    assert np.abs(counts).max() < 0.1 * 256  # 0.5 % of 10 g
    missing = 1.0 - len(numbers) / (numbers[-1] + 1)
    assert missing == pytest.approx(0.1, abs=4 * np.sqrt(0.1 * 0.9 / 950))


@pytest.mark.parametrize(
    ("query", "words"), [("range_g=3", "allowed: 2, 4, 8, 16"), ("drop=2", "drop"), ("rate_hz=1e5", "rate_hz")]
)
def test_bad_values_are_refused_by_name(query, words):
    with pytest.raises(InputError, match=words):
        Bench("", query)


def test_recoil_is_drawn_within_its_spread_and_leaves_other_draws_alone():
    drawn = [plant(seed) for seed in range(40)]
    peaks = np.array([recoil.peak_g for one in drawn for recoil in one.recoils]) / RECOIL.peak_g
    taus = np.array([recoil.tau_foam_s for one in drawn for recoil in one.recoils]) / RECOIL.tau_foam_s
    for shares in (peaks, taus):
        assert np.abs(shares - 1.0).max() <= RECOIL_SPREAD
        # Uniform: sd is the half-width over sqrt(3); of 600 draws it is known to 2 %.
        assert shares.std() == pytest.approx(RECOIL_SPREAD / np.sqrt(3.0), rel=0.08)
    assert abs(np.corrcoef(peaks, taus)[0, 1]) < 4.0 / np.sqrt(600)
    assert plant(spread=0.0).recoils == [RECOIL] * 15
    given = plant(3, tau_foam_s=2e-3, speed_power=2.0)
    assert {(one.tau_foam_s, one.speed_power) for one in given.recoils} == {(2e-3, 2.0)}
    assert [one.peak_g for one in given.recoils] == [one.peak_g for one in plant(3).recoils]
    # As if there were no recoil: three uniform numbers a channel, and the stream stands behind them.
    rng, alone = np.random.default_rng(7), np.random.default_rng(7)
    first = alone.uniform(-1.0, 1.0, (15, 3))
    Actuators(options(), rng, 0)
    assert rng.random() == alone.random()
    assert [one.resistance_ohm for one in plant(7).latches] == pytest.approx(1.38 + 0.1 * first[:, 0])


def test_the_nominal_speed_is_that_of_a_nominal_switch():
    from firmware_models.instruments.accelerometer import NOMINAL_SPEED_M_S

    speed = switch(10e-3, direction="on-off", level="reference").impact_m_s
    assert speed == pytest.approx(NOMINAL_SPEED_M_S, abs=1e-4)  # as many digits as are written

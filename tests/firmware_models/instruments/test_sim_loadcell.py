"""The simulated load cell reads the tension of its output's hand as raw counts, with faults of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import serial

from haptics.errors import InputError


class Bench:
    """A brake board and a load cell in one world."""

    def __init__(self, keys: str = "", board: str = ""):
        if "firmware_models" not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append("firmware_models")
        self.brake: Any = serial.serial_for_url(f"sim://brake?world=cell&clock=virtual&spread=0{board}", timeout=0)
        self.brake.baudrate = 500_000
        self.cell: Any = serial.serial_for_url(f"sim://loadcell?world=cell&clock=virtual{keys}", baudrate=500_000, timeout=0)

    def counts(self, seconds: float) -> tuple[list[int], list[int]]:
        """Numbers and counts of all samples of the next so many seconds."""
        self.cell.reset_input_buffer()
        came = b""
        for _ in range(round(10 * seconds)):  # a driver's buffer does not hold many seconds
            self.cell.advance(self.cell.now_ns + 100_000_000)
            came += self.cell.read(1 << 16)
        lines = came.decode().split("\n")[:-1]  # the last has not come whole
        pairs = [line.split() for line in lines if line[:1].isdigit() and len(line.split()) == 2]
        return [int(number) for number, _ in pairs], [int(count) for _, count in pairs]

    def hold(self, pull_n: float) -> None:
        """Hand and strips such that the brake's off force is all there is, or a gain in force that makes any tension."""
        plant = self.brake.board.plant
        plant._plant._tension_n[0] = pull_n

    def close(self) -> None:
        self.cell.close()
        self.brake.close()


@pytest.fixture
def bench():
    made: list[Bench] = []

    def make(keys: str = "", board: str = "") -> Bench:
        made.append(Bench(keys, board))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_it_says_what_it_is_and_counts_its_samples(bench):
    one = bench("&rate_hz=80&full_scale_n=98.1")
    one.cell.advance(10_000_000)
    assert one.cell.read(200).decode() == "# loadcell rate_hz=80.0 full_scale_n=98.1 counts_per_n=50968.399592252805 unit=count\n"
    numbers, _ = one.counts(1.0)
    assert numbers[0] == 0
    assert len(numbers) in (79, 80, 81)


def test_counts_are_force_times_its_own_gain_with_its_noise_and_zero(bench):
    one = bench("&noise_n=0.003&zero_n=0.2&gain=1.01&drift_n_min=0")
    _, loose = one.counts(4.0)
    one.hold(7.5)
    _, loaded = one.counts(4.0)
    per_n = one.cell.board.counts_per_n
    assert per_n == 100_000  # 5e6 at 50 N
    # 2000 samples of 3 mN: means good to 0.07 mN, the standard deviation to 1.6 %.
    assert np.mean(loose) / per_n == pytest.approx(0.2, abs=0.3e-3)
    assert (np.mean(loaded) - np.mean(loose)) / per_n == pytest.approx(1.01 * 7.5, abs=0.4e-3)
    assert np.std(loaded) / per_n == pytest.approx(3e-3, rel=0.07)


def test_its_zero_drifts_steadily(bench):
    one = bench("&noise_n=0&zero_n=0&gain=1&drift_n_min=0.06")
    _, counts = one.counts(60.0)
    assert counts[-1] / one.cell.board.counts_per_n == pytest.approx(0.06, abs=2e-5)


def test_it_sits_on_its_stop_at_120_percent_and_clips_at_24_bits(bench):
    one = bench("&noise_n=0&zero_n=0&gain=1&drift_n_min=0&full_scale_n=10")
    one.hold(30.0)
    assert set(one.counts(0.1)[1]) == {round(12.0 * one.cell.board.counts_per_n)}
    one.close()
    other = bench("&noise_n=0&zero_n=0&gain=1&drift_n_min=0&counts_per_n=1e6")
    other.hold(30.0)
    assert set(other.counts(0.1)[1]) == {(1 << 23) - 1}


def test_gain_and_zero_are_drawn_from_the_seed_as_declared(bench):
    from firmware_models.instruments.loadcell import GAIN_SD, ZERO_SD_SHARE
    from rigs.instruments.loadcell import GAIN_SD as STATED_SD

    assert GAIN_SD == STATED_SD
    gains, zeros = [], []
    for seed in range(200):
        one = bench(f"&seed={seed}")
        drawn = one.cell.board.truth()
        gains.append(drawn["gain"])
        zeros.append(drawn["zero_n"])
        one.close()
    # 200 draws: a standard deviation good to 5 %, a mean to 7 % of it.
    assert np.std(gains) == pytest.approx(GAIN_SD, rel=0.2)
    assert np.mean(gains) == pytest.approx(1.0, abs=0.3 * GAIN_SD)
    assert np.std(zeros) == pytest.approx(50.0 * ZERO_SD_SHARE, rel=0.2)


def test_it_falls_silent_or_flat_when_told_to(bench):
    silent = bench("&silent_at_s=1")
    assert len(silent.counts(3.0)[0]) in (499, 500, 501)
    silent.close()
    flat = bench("&flat_at_s=1")
    _, counts = flat.counts(3.0)
    assert len(set(counts[:490])) > 100
    assert len(set(counts[510:])) == 1


def test_looking_at_the_tension_takes_nothing_from_the_board(bench):
    one = bench()
    one.counts(0.5)
    one.brake.set_load(0, hand_m=0.01, hand_m_s=0.0)
    one.counts(0.5)
    truth = one.brake.truth()
    assert truth["tension_n"][0] == pytest.approx(5e-3)  # the off force of the law (thesis 4.9: a few millinewton)
    assert one.brake.board.plant.tension(0, one.brake.now_ns) == truth["tension_n"][0]
    with pytest.raises(InputError, match="channel"):
        one.brake.board.plant.tension(5, one.brake.now_ns)


def test_it_takes_no_load(bench):
    with pytest.raises(InputError, match="does not act on a loadcell"):
        bench().cell.set_load(0, pull_n=1.0)

"""The simulated probe prints what its output and the supply do, and no more than a probe would see."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import serial

from haptics.errors import InputError
from haptics.physics.brake.charging import DRIVE, Charging
from haptics.physics.brake.parameters import BRAKE, capacitance_f

MS = 1_000_000
TOTAL_F = capacitance_f(BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity) + DRIVE.stray_f
QUIET = "noise_v=0&noise_a=0&divider_gain=1&shunt_gain=1"
_worlds = itertools.count()


class ProbeBench:
    """A brake board without spread and a probe in one world; the plant is driven by hand."""

    def __init__(self, probe: str = QUIET, board: str = "spread=0", with_board: bool = True):
        if "firmware_models" not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append("firmware_models")
        world = f"probe-test-{next(_worlds)}"
        self.brake = None
        if with_board:
            self.brake = serial.serial_for_url(
                f"sim://brake?world={world}&clock=virtual&seed=3&{board}", baudrate=500_000, timeout=0
            )
        self.port = serial.serial_for_url(
            f"sim://probe?world={world}&clock=virtual&seed=3&{probe}", baudrate=2_000_000, timeout=0
        )
        self.header: dict[str, float] = {}
        self.rows: list[tuple[int, int, int]] = []
        self._rest = b""

    @property
    def plant(self):
        return self.brake.board.plant

    def drive(self, volts: float, frequency_hz: float, mask: int = 1) -> int:
        now_ns = self.port.now_ns
        self.plant.drive(mask if volts else 0, volts, frequency_hz, now_ns)
        return now_ns

    def run(self, ms: float) -> None:
        self.port.advance(self.port.now_ns + round(ms * MS))
        *lines, self._rest = (self._rest + self.port.read(1 << 16)).split(b"\n")
        for line in lines:
            if line.startswith(b"# probe"):
                self.header = {key: float(value) for key, value in (pair.split("=") for pair in line.decode().split()[2:])}
            else:
                number, volts, amps = (int(word) for word in line.split())
                self.rows.append((number, volts, amps))

    def series(self):
        """Times (s, of the world), volts and amperes, offsets taken off."""
        true = self.port.board.truth()
        number, volts, amps = np.array(self.rows).T
        times_s = (number + 1) * true["period_ns"] * 1e-9
        volts = volts * self.header["volts_per_count"] - true["offset_v"]
        return times_s, volts, amps * self.header["amps_per_count"] - true["offset_a"]

    def close(self) -> None:
        self.port.close()
        if self.brake is not None:
            self.brake.close()


@pytest.fixture
def probe_bench() -> Iterator[Callable[..., ProbeBench]]:
    """Makes benches, and closes their ports."""
    made: list[ProbeBench] = []

    def make(*arguments, **keywords) -> ProbeBench:
        made.append(ProbeBench(*arguments, **keywords))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_volts_follow_the_closed_form_of_a_charge(probe_bench):
    bench = probe_bench()
    bench.run(5)
    began_ns = bench.drive(1500.0, 1.0)
    bench.run(40)
    times_s, volts, _ = bench.series()
    since_s = times_s - began_ns * 1e-9
    charging = Charging(1500.0, TOTAL_F, 1.0 / bench.port.board.truth()["load_ohm"])
    expected = np.array([charging.charge(0.0, max(0.0, one)).u_v for one in since_s])
    # Half a count, of 0.977 V; times are rounded to a nanosecond, 0.2 mV of the ramp.
    assert np.max(np.abs(volts - expected)) < 0.5 * bench.header["volts_per_count"] + 1e-3
    assert volts.max() > 1499.0


def test_the_sum_of_the_current_is_the_charge_that_the_supply_gave(probe_bench):
    bench = probe_bench()
    bench.run(5)
    bench.drive(1500.0, 20.0)
    bench.run(200)
    bench.drive(0.0, 0.0)
    bench.run(5)
    times_s, _, amps = bench.series()
    given_c = bench.plant.supply_charge_c(bench.port.now_ns)
    seen_c = float(np.sum(amps[1:] * np.diff(times_s)))
    # Rounding errors of half a count at most, uniform: 5 sd of their sum.
    sd_c = bench.header["amps_per_count"] / math.sqrt(12.0) * 1e-4 * math.sqrt(len(times_s))
    # In the hold each sample is rounded alike, so that they add up: 3.4 uA lie within half a count of 0.49 uA.
    assert abs(seen_c - given_c) < 5.0 * sd_c + 0.5 * bench.header["amps_per_count"] * times_s[-1]
    # 200 ms at 20 Hz: a first charge and eight reversals of C V each, and the bleeder.
    assert given_c == pytest.approx(9 * TOTAL_F * 1500.0 + 0.2 * 1500.0 / 500e6 + 0.2 * 1500.0 / 1e9, rel=0.02)


def test_a_probe_that_loads_nothing_changes_nothing(probe_bench):
    seen = []
    for with_probe in (True, False):
        bench = probe_bench("load_ohm=1e15" if with_probe else "load_ohm=1e15&rate_hz=1")
        bench.run(2)
        bench.drive(1200.0, 30.0)
        for _ in range(20):
            bench.port.advance(bench.port.now_ns + 7 * MS)
            seen.append(bench.plant.volts(bench.port.now_ns)[0])
    # The same closed forms cut into pieces: rounding only.
    assert np.allclose(seen[:20], seen[20:], rtol=1e-9, atol=1e-6)


def test_the_divider_draws_its_current_from_the_output(probe_bench):
    held_a, loads_ohm = [], []
    for load in ("1e9", "1e15"):
        bench = probe_bench(f"{QUIET}&load_ohm={load}&range_a=20e-6&bits=16", "spread=0")
        bench.drive(1000.0, 1.0)
        bench.run(60)
        held_a.append(float(np.mean(bench.series()[2][-100:])))
        loads_ohm.append(bench.port.board.truth()["load_ohm"])
    # A count of 16 bits over 20 uA is 0.6 nA.
    assert held_a[0] - held_a[1] == pytest.approx(1000.0 / loads_ohm[0], abs=1e-9)
    assert held_a[1] == pytest.approx(1000.0 / DRIVE.bleeder_ohm, abs=1e-9)


def test_noise_gains_and_offsets_are_as_drawn(probe_bench):
    bench = probe_bench("")
    bench.run(300)
    true = bench.port.board.truth()
    _, volts, amps = bench.series()
    count = len(volts)
    # Noise and rounding together; 4 sd of a mean, and of a standard deviation, of that many samples.
    for values, noise, step in ((volts, 1.0, bench.header["volts_per_count"]), (amps, 0.5e-6, bench.header["amps_per_count"])):
        sd = math.hypot(noise, step / math.sqrt(12.0))
        assert abs(float(np.mean(values))) < 4.0 * sd / math.sqrt(count)
        assert float(np.std(values)) == pytest.approx(sd, rel=4.0 / math.sqrt(2.0 * count))
    before = len(bench.rows)
    bench.drive(1500.0, 1.0)
    bench.run(80)
    _, volts, amps = (one[before:] for one in bench.series())
    # 600 samples of a volt; 60 samples of half a microampere on the ramp: 4 sd.
    assert float(np.mean(volts[-600:])) == pytest.approx(1500.0 * true["divider_gain"], abs=4.0 / math.sqrt(600))
    assert float(np.mean(amps[10:70])) == pytest.approx(500e-6 * true["shunt_gain"], abs=4.0 * 0.55e-6 / math.sqrt(60))


def test_ten_thousand_lines_a_second_fit_the_line(probe_bench):
    bench = probe_bench("")
    bench.drive(1500.0, 20.0)
    for _ in range(100):
        bench.run(10)
    assert [row[0] for row in bench.rows] == list(range(len(bench.rows)))
    # A line of 18 bytes takes 90 us; nothing piles up.
    assert len(bench.rows) >= 1.0 / (bench.port.board.truth()["period_ns"] * 1e-9) - 2


def test_more_volts_than_the_range_read_as_its_end(probe_bench):
    bench = probe_bench(f"{QUIET}&range_v=1000&range_a=300e-6")
    bench.drive(1500.0, 20.0)
    bench.run(60)
    counts = np.array(bench.rows)
    full = bench.header["full_scale"]
    assert full == 2047
    assert (counts[:, 1].max(), counts[:, 1].min(), counts[:, 2].max()) == (full, -full, full)


@pytest.mark.parametrize(
    ("fault", "volts_left", "amps_left"),
    [("loose_at_s=0.02", 0.0, 1.0), ("shunt_open_at_s=0.02", 1.0, 0.0), ("shunt_reversed=1", 1.0, -1.0)],
)
def test_a_fault_takes_away_what_it_should(probe_bench, fault, volts_left, amps_left):
    bench = probe_bench(f"{QUIET}&{fault}")
    bench.run(25)
    bench.drive(1500.0, 20.0)
    bench.run(10)
    times_s, volts, amps = bench.series()
    step_v, step_a = bench.header["volts_per_count"], bench.header["amps_per_count"]
    assert volts[-10] == pytest.approx(1500.0 * volts_left, abs=step_v)
    ramp = (times_s > 0.027) & (times_s < 0.032)
    assert amps[ramp] == pytest.approx(500e-6 * amps_left, abs=step_a)


def test_a_silent_probe_prints_no_more_and_the_world_goes_on(probe_bench):
    bench = probe_bench("silent_at_s=0.05")
    bench.run(100)
    assert 498 <= len(bench.rows) <= 501
    assert bench.port.now_ns == 100 * MS


def test_without_a_board_it_reads_zero(probe_bench):
    bench = probe_bench(QUIET, with_board=False)
    bench.run(20)
    _, volts, amps = bench.series()
    assert np.all(np.abs(volts) <= bench.header["volts_per_count"])
    assert np.all(np.abs(amps) <= bench.header["amps_per_count"])


def test_an_output_there_is_none_of_is_refused(probe_bench):
    with pytest.raises(InputError, match=r"channel = 5; allowed 0 to 4"):
        probe_bench("channel=5")


def test_it_measures_the_output_it_is_on(probe_bench):
    bench = probe_bench(f"{QUIET}&channel=2")
    bench.drive(800.0, 1.0, mask=0b00100)
    bench.run(40)
    assert bench.series()[1][-1] == pytest.approx(800.0, abs=1.0)
    bench.drive(0.0, 0.0)
    bench.drive(800.0, 1.0, mask=0b00001)
    bench.run(40)
    assert bench.series()[1][-1] == pytest.approx(0.0, abs=1.0)

"""Guards of the C brake controller: each is tripped by its fault, none by a healthy plant, on a slow CPU too."""

from __future__ import annotations

import ctypes
import math
import random
from collections.abc import Callable, Iterator
from fractions import Fraction

import pytest
from brake_bench import NOMINAL_PF, BrakeBench, SlowBench, benches, build_slow_library, max_dhz, reversals
from brake_circuit import NOMINAL_F, Circuit
from core_bench import MS

from haptics.link.messages import Fault, State


@pytest.fixture(scope="module")
def slow_library(tmp_path_factory) -> ctypes.CDLL:
    return build_slow_library(tmp_path_factory.mktemp("slow"))


@pytest.fixture
def bench(library) -> Iterator[Callable[..., BrakeBench]]:
    yield from benches(library)


@pytest.mark.parametrize(("volts", "dhz"), [(20, 200), (20, 9000), (100, 200), (350, 1400), (1000, 200), (1500, 5), (1500, 400)])
@pytest.mark.parametrize("by", [1.07, 1.3])
def test_too_many_volts(bench, volts, dhz, by) -> None:
    """Tripped once they are 5 % and two volts above."""
    h = bench(Circuit(gain=by)).armed()
    h.hold(80, 1, volts, dhz)
    reached = max(abs(v) for v in h.circuit.volts)
    if volts * by < volts * 1.05 + 2:
        assert h.faults == 0
    else:
        fault, channel, value = h.fault()
        assert (fault, channel) == (Fault.OVER_VOLTAGE, 0)
        assert volts * 1.05 < value <= volts * by + 1
        assert reached < 60


def test_a_supply_that_does_not_follow_a_lowered_setpoint(bench) -> None:
    """The higher one counts until the bridge has turned the load round."""
    h = bench().armed()
    h.hold(200, 1, 1000, 200)
    h.change(min_v=1000)
    lowered = h.now
    h.hold(200, 1, 500, 200)
    fault, _, value = h.fault()
    assert fault == Fault.OVER_VOLTAGE
    assert 525 < value <= 1000
    assert h.edges[-1][0] - lowered < 3 * 25 * MS


@pytest.mark.parametrize("dhz", [20, 200, 600])
def test_too_much_current(bench, dhz) -> None:
    h = bench().armed()
    start = h.now + MS
    h.change(amps=560e-6)
    h.hold(60, 1, 1500, dhz)
    assert h.fault() == (Fault.OVER_CURRENT, 0, 560)
    assert MS <= h.edges[-1][0] - start <= 4 * MS


@pytest.mark.parametrize(("volts", "dhz"), [(24, 50), (24, 9000), (100, 2000), (400, 1230), (1000, 200), (1500, 5), (1500, 640)])
@pytest.mark.parametrize("mask", [1, 31])
def test_a_bridge_that_does_not_turn(bench, volts, dhz, mask) -> None:
    """Latched after one and a half half periods; of those below 1 ms not all are looked at."""
    h = bench().armed()
    dhz = min(dhz, max_dhz(bin(mask).count("1") * 2600, volts))
    half = 10_000_000 / dhz
    h.hold(max(50, 5 * half / MS), mask, volts, dhz)
    assert h.faults == 0
    h.change(stuck=True)
    turned = reversals(h.edges)[-1][0]
    h.hold(5 + 4 * half / MS, mask, volts, dhz)
    fault, channel, value = h.fault()
    assert (fault, channel) == (Fault.BRIDGE_STUCK, 0 if mask == 1 else 255)
    assert value == pytest.approx(volts, rel=0.02, abs=4)
    after = h.edges[-1][0] - turned
    assert 1.5 * half - 2 <= after <= 1.5 * half + MS + (0 if half >= 2 * MS else 2 * MS + 2 * half)


@pytest.mark.parametrize(("volts", "dhz"), [(30, 200), (30, 4000), (100, 200), (400, 200), (1000, 200), (1500, 5), (1500, 640)])
def test_a_brake_that_is_no_longer_there(bench, volts, dhz) -> None:
    h = bench().armed()
    half = 10_000_000 / dhz
    h.hold(100, 1, volts, dhz)
    h.change(farads=[20e-12] + [NOMINAL_F] * 4)
    lost = h.now
    h.hold(5 + 3 * half / MS, 1, volts, dhz)
    fault, channel, _ = h.fault()
    assert (fault, channel) == (Fault.OPEN, 0)
    assert h.edges[-1][0] - lost < half + max(MS, half / 2) + 4 * MS


@pytest.mark.parametrize(("volts", "dhz"), [(20, 200), (20, 9000), (100, 200), (400, 1200), (1000, 200), (1500, 5), (1500, 640)])
@pytest.mark.parametrize("ohm", [1e3, 10e3])
@pytest.mark.parametrize("mask", [1, 7])
def test_an_output_that_breaks_down(bench, volts, dhz, ohm, mask) -> None:
    """It does not rise under full current: short; in the hold phase its volts drop: leak."""
    h = bench().armed()
    dhz = min(dhz, max_dhz(bin(mask).count("1") * 2600, volts))
    h.hold(100, mask, volts, dhz)
    h.change(leak_ohm=[ohm] + [math.inf] * 4)
    broken = h.now
    h.hold(100, mask, volts, dhz)
    fault, channel, _ = h.fault()
    assert fault in (Fault.SHORT, Fault.LEAK)
    assert channel == (0 if mask == 1 else 255)
    assert h.edges[-1][0] - broken < 40 * MS


@pytest.mark.parametrize("volts", [100, 1000, 1500])
def test_an_output_that_never_rises_is_short(bench, volts) -> None:
    h = bench().armed()
    h.change(leak_ohm=[1e3] + [math.inf] * 4)
    begun = h.now + MS
    h.hold(100, 1, volts, 200)
    fault, channel, value = h.fault()
    assert (fault, channel) == (Fault.SHORT, 0)
    assert value <= 4
    assert h.edges[-1][0] - begun <= 6 * MS


@pytest.mark.parametrize("volts", [200, 700, 1500])
@pytest.mark.parametrize(("leak_ua", "trips"), [(20, False), (48, False), (53, True), (150, True)])
def test_a_leak_in_the_hold_phase(bench, volts, leak_ua, trips) -> None:
    h = bench().armed()
    h.ask("identify", seq=0)
    h.change(leak_ohm=[math.inf] * 4 + [volts / leak_ua * 1e6])
    h.hold(150, 16, volts, 100)
    if trips:
        fault, channel, value = h.fault()
        assert (fault, channel) == (Fault.LEAK, 4)
        assert value == pytest.approx(10 * leak_ua, rel=0.02, abs=10)
    else:
        assert h.faults == 0
        assert h.telemetry().leakage == (0, 0, 0, 0, pytest.approx(10 * leak_ua, rel=0.02, abs=10))


@pytest.mark.parametrize("volts", [1500, 500])
def test_a_sudden_drop_in_the_hold_phase(bench, volts) -> None:
    """As when a dielectric breaks down for a moment and heals; above a lowered setpoint no current shows it."""
    h = bench().armed()
    h.hold(290, 1, 1500, 10)
    h.drive(1, 1, volts, 10, 200)
    h.run(4 * MS)
    assert h.faults == 0
    assert abs(h.circuit.volts[0]) > 1490
    h.change(bridge_v=0.85 * h.circuit.bridge_v, volts=[0.85 * v for v in h.circuit.volts])
    h.run(MS)
    fault, channel, _ = h.fault()
    assert (fault, channel) == (Fault.LEAK, 0)


def test_sliding_strips_are_sensed_while_driving(bench) -> None:
    """9 % of the overlap in 10 s, of a brake that is on alone; half a ramp at 4 V a count gives C to half a per cent."""
    h = bench().armed()
    h.ask("identify", seq=0)
    errors = []
    for step in range(10):
        h.change(farads=[NOMINAL_F * (1 - 0.009 * step)] + [NOMINAL_F] * 4)
        h.hold(1000, 1, 1500, 200)
        sensed = h.telemetry().capacitance
        errors.append(sensed[0] / (NOMINAL_PF * (1 - 0.009 * step)) - 1)
    assert max(map(abs, errors)) < 0.006
    assert abs(sum(errors)) / 10 < 0.002  # rounding is as often up as down
    assert h.faults == 0


def play_healthy(h: BrakeBench, rng: random.Random) -> None:
    """A wave on any outputs, of any allowed amplitude and frequency, renewed and changed, on strips that may slide."""
    circuit, farads = h.circuit, list(h.circuit.farads)
    h.armed().ask("identify", seq=0)
    found = h.telemetry().capacitance
    mask = rng.randrange(1, 32)
    volts = rng.choice((20, 1500, round(20 * 75 ** rng.random())))
    most = min(10_000, math.floor(10 * 500e6 / (2 * sum(found[k] for k in range(5) if mask >> k & 1) * volts)))
    dhz = rng.choice((most, most, round(5 * (most / 5) ** rng.random())))
    case = f"{mask:05b} {volts} V {dhz} dHz {circuit}"
    slides, now_v, begun = rng.random() < 0.3, volts, h.now
    end = begun + MS * min(3000.0, max(120.0, 8 * 5000 / dhz))
    while h.now < end:
        if rng.random() < 0.4:
            now_v = rng.choice((volts, rng.randrange(20, volts + 1), rng.randrange(20, volts + 1)))
        h.drive(h.lead_ms * rng.uniform(1, 5), mask, now_v, dhz, 200)
        h.run(rng.randrange(10, 90 * MS))
        if slides:  # 9 % in 10 s
            h.change(farads=[c * (1 - 0.09 * (h.now - begun) / (10_000 * MS)) for c in farads])
        assert h.faults == 0, f"{case}, now {now_v} V: {h.all('fault')}"
    assert h.state in (State.DRIVING, State.ARMED)


def healthy_circuit(rng: random.Random) -> Circuit:
    """Brakes within 5 %, some much smaller or larger, a supply within 1 % of its volts."""
    farads = [NOMINAL_F * rng.uniform(0.95, 1.05) * rng.choice((1, 1, 1, 0.6, 1.35)) for _ in range(5)]
    return Circuit(farads, gain=rng.uniform(0.99, 1.01), amps=rng.choice((500e-6, rng.uniform(450e-6, 540e-6))))


QUICK_OR_LONG = pytest.mark.parametrize("cases", [50, pytest.param(400, marks=pytest.mark.soak)])


@QUICK_OR_LONG
def test_healthy_plants_trip_nothing(library, cases) -> None:
    """Any allowed amplitude and frequency, one to five brakes, all that may vary varying at once."""
    rng = random.Random(2024)
    for _ in range(cases):
        h = BrakeBench(library, healthy_circuit(rng), start=rng.randrange(1 << 40))
        play_healthy(h, rng)
        h.close()


@pytest.mark.parametrize("mask", [1, 31])
def test_lowering_small_amplitudes_at_the_limit_trips_nothing(bench, mask) -> None:
    """There a clamp is too short to empty the outputs: what it leaves has the wrong sign for a while."""
    rng = random.Random(mask)
    for volts in (24, 30, 40, 60, 80, 110):
        h = bench(Circuit(gain=1.01)).armed()
        dhz = max_dhz(bin(mask).count("1") * 2580, volts)
        for _ in range(30):
            h.drive(1, mask, volts, dhz, 200)
            h.run(rng.randrange(10 * MS, 20 * MS))
            h.drive(rng.uniform(0, 3), mask, rng.choice((5, 12, 20)), dhz, 200)
            h.run(rng.randrange(2 * MS, 20 * MS))
            assert h.faults == 0, f"{volts} V {dhz} dHz: {h.all('fault')}"


def test_a_healthy_plant_trips_nothing_from_one_wave_to_another(library) -> None:
    """Other outputs, another frequency, any volts, from rest, while driving and while discharging."""
    rng = random.Random(99)
    for _ in range(25):
        h = BrakeBench(library, Circuit(gain=rng.uniform(0.99, 1.01)), start=rng.randrange(1 << 40)).armed()
        for _ in range(12):
            mask, volts = rng.randrange(1, 32), round(20 * 75 ** rng.random())
            most = max_dhz(bin(mask).count("1") * 2580, volts)
            dhz = rng.choice((most, round(5 * (most / 5) ** rng.random())))
            h.drive(rng.uniform(0, 3), mask, volts, dhz, rng.choice((3, 20, 80, 300)))
            h.run(rng.randrange(10, 90 * MS))
            assert h.faults == 0, f"{mask:05b} {volts} V {dhz} dHz: {h.all('fault')}"
        h.close()


@QUICK_OR_LONG
def test_healthy_plants_trip_nothing_on_a_slow_cpu(slow_library, cases) -> None:
    """Conversions of 26 us, edges in between, a main loop that is late by up to 1.5 ms."""
    rng = random.Random(77)
    for _ in range(cases):
        circuit = healthy_circuit(rng)
        circuit.amps = 500e-6 * rng.uniform(0.98, 1.02)  # it comes too late to measure it now and then
        h = SlowBench(slow_library, circuit, start=rng.randrange(1 << 40))
        play_healthy(h, rng)
        h.close()


def test_a_slow_cpu_keeps_the_wave_and_measures_capacitance(slow_library) -> None:
    """No edge early, and none later than the longest locked section; the self test's pulses wear an edge or two of that."""
    h = SlowBench(slow_library, Circuit([NOMINAL_F * share for share in (0.6, 0.8, 1.0, 1.2, 1.4)])).armed()
    h.ask("identify", seq=0)
    assert h.telemetry().capacitance == pytest.approx([NOMINAL_PF * share for share in (0.6, 0.8, 1.0, 1.2, 1.4)], rel=0.02)
    for dhz in (200, 3333):
        h.edges.clear()
        h.hold(1000, 1, 200, dhz, each_ms=30)
        half = Fraction(10_000_000, dhz)
        turned = reversals(h.edges)
        start = turned[0][0]
        assert len(turned) > 900 * dhz // 5000
        clamp = min(int(half / 10), MS)
        for k, (tick, _) in enumerate(turned[1:]):
            assert -3 <= tick - clamp - (start + (k + Fraction(1, 2)) * half) <= 150
        h.live(200 * MS)
    assert h.faults == 0


@pytest.mark.parametrize(("volts", "dhz"), [(30, 200), (100, 2000), (400, 1200), (1000, 200), (1500, 640)])
@pytest.mark.parametrize(
    ("broken", "faults"),
    [
        ({"gain": 1.2}, {Fault.OVER_VOLTAGE}),
        ({"amps": 570e-6}, {Fault.OVER_CURRENT}),
        ({"stuck": True}, {Fault.BRIDGE_STUCK}),
        ({"farads": [20e-12] + [NOMINAL_F] * 4}, {Fault.OPEN}),
        ({"leak_ohm": [2e3] + [math.inf] * 4}, {Fault.SHORT, Fault.LEAK}),
    ],
)
def test_a_slow_cpu_finds_every_fault_too(slow_library, volts, dhz, broken, faults) -> None:
    h = SlowBench(slow_library).armed()
    h.hold(200, 1, volts, dhz)
    assert h.faults == 0
    h.change(**broken)
    h.hold(400, 1, volts, dhz)
    if broken == {"gain": 1.2} and dhz == 640:
        assert h.faults == 0  # never gets there
    elif "farads" in broken and volts == 30:
        assert h.faults & ~(1 << Fault.OPEN) == 0  # the ramp is over before it looks
    elif broken == {"amps": 570e-6} and volts < 1000:
        assert h.faults & ~(1 << Fault.OVER_CURRENT) == 0  # full current for less than 1 ms at a time
    else:
        assert h.fault()[0] in faults
    h.close()

"""Arming the C brake controller: what keeps it from it, and what its self test finds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest
from brake_bench import NOMINAL_PF, OK, BrakeBench, benches
from brake_circuit import ALL, ENABLED, HIGHEST, NOMINAL_F, Circuit
from core_bench import BOOT_ID, MS, in_ticks

from haptics.link.messages import Fault, State, Status


@pytest.fixture
def bench(library) -> Iterator[Callable[..., BrakeBench]]:
    yield from benches(library)


@pytest.mark.parametrize("share", [0.0, 0.04, 0.095, 0.105, 0.3, 0.49, 0.51, 0.7, 1.0, 1.3, 1.49, 1.51, 2.0, 8.0])
def test_the_self_test_measures_capacitance_and_judges_it(bench, share) -> None:
    """To a count of the sense in 12 V or more, 1/16 V, and a tick in the pulse's 36 or more: 1 %."""
    pf = share * NOMINAL_PF
    h = bench(Circuit([NOMINAL_F, pf * 1e-12] + [NOMINAL_F] * 3))
    h.ask("identify", seq=0)
    h.arm()
    assert h.state == State.SELF_TEST
    for _ in range(200):
        h.run(MS // 4)
        h.send("keepalive", seq=0)
    found = h.telemetry().capacitance
    assert found[0] == pytest.approx(NOMINAL_PF, rel=0.01)
    if share < 0.1:
        assert h.state == State.ARMED
        assert found[1] == 0
        assert h.answer("drive", in_ticks(h.now, 5), 0b10, 100, 200, 100) == (Status.BAD_VALUE, 1)
        assert h.answer("drive", in_ticks(h.now, 5), 0b01, 100, 200, 100) == OK
    elif 0.5 <= share <= 1.5:
        assert h.state == State.ARMED
        assert found[1] == pytest.approx(pf, rel=0.01, abs=2)
        assert found[2:] == pytest.approx([NOMINAL_PF] * 3, rel=0.01)
    else:
        fault, channel, value = h.fault()
        assert (fault, channel) == (Fault.OPEN if share < 0.5 else Fault.SHORT, 1)
        assert value == pytest.approx(pf, rel=0.01, abs=2)


def test_the_self_test_takes_one_output_after_the_other_to_harmless_volts(bench) -> None:
    h = bench()
    h.arm()
    highest = 0.0
    while h.state == State.SELF_TEST:
        h.run(20)
        h.send("keepalive", seq=0)
        h.circuit.advance(h.now)
        highest = max(highest, *map(abs, h.circuit.volts))
        assert sum(abs(v) > 0.5 for v in h.circuit.volts) <= 1
    assert 20 < highest < 40
    assert h.word == 0
    on = [word & ALL for _, word in h.edges if word & ENABLED]
    assert on == [1, 1, 2, 2, 4, 4, 8, 8, 16, 16]
    assert {word >> 16 for _, word in h.edges} == {0, 40}


@pytest.mark.parametrize("amps", [300e-6, 480e-6, 520e-6, 545e-6])
def test_the_self_test_measures_the_supply_too(bench, amps) -> None:
    h = bench(Circuit(amps=amps)).armed()
    h.ask("identify", seq=0)
    assert h.telemetry().capacitance == pytest.approx([NOMINAL_PF] * 5, rel=0.01)


@pytest.mark.parametrize("ohm", [1.0, 1e3, 10e3])
def test_an_output_that_does_not_rise_is_short(bench, ohm) -> None:
    h = bench(Circuit(leak_ohm=[math.inf] * 3 + [ohm, math.inf]))
    h.arm()
    h.run(30 * MS)
    fault, channel, value = h.fault()
    assert (fault, channel) == (Fault.SHORT, 3)
    assert value == 0 or ohm == 10e3  # rises to 5 V, and then no more


def test_no_brake_at_all_fails_the_self_test(bench) -> None:
    h = bench(Circuit([0.0] * 5))
    h.arm()
    h.run(30 * MS)
    assert h.fault() == (Fault.SELF_TEST, 255, 0)
    assert h.answer("arm", BOOT_ID) == (Status.INTERLOCK, 1 << Fault.SELF_TEST)
    assert h.answer("disarm") == OK
    h.change(farads=[NOMINAL_F] + [0.0] * 4)
    h.armed()


def test_an_output_that_keeps_its_volts_fails_the_self_test(bench) -> None:
    h = bench(Circuit(short_ohm=1e9))
    h.circuit.volts[2] = 30.0
    h.arm()
    h.run(30 * MS)
    fault, channel, value = h.fault()
    assert (fault, channel) == (Fault.SELF_TEST, 2)
    assert 25 <= value <= 30


@pytest.mark.parametrize(("volts", "arms"), [(39.9, True), (42.4, False), (43.0, False), (300.0, False)])
def test_a_board_under_voltage_is_not_armed(bench, volts, arms) -> None:
    """The sense may be out by a volt: from 41 V on it errs to the safe side."""
    for where in ("output", "bus"):
        h = bench()
        if where == "output":
            h.circuit.volts[4] = -volts
        else:
            plain = h.senses
            h.senses = lambda sense, plain=plain: round(volts / 2) if sense == HIGHEST else plain(sense)
        assert h.answer("arm", BOOT_ID) == (OK if arms else (Status.INTERLOCK, 0))
        assert h.state == (State.SELF_TEST if arms else State.DISARMED)


def test_an_open_lid_makes_safe_and_keeps_from_arming(bench) -> None:
    h = bench()
    h.lid_closed = False
    assert h.answer("arm", BOOT_ID) == (Status.INTERLOCK, 0)
    h.lid_closed = True
    h.armed()
    h.drive(1, 1, 1000, 200, 1000)
    h.run(30 * MS)
    h.lid_closed = False
    h.run(MS)
    assert h.word == 0
    assert h.state in (State.DISCHARGING, State.DISARMED)
    h.run(5 * MS)
    assert (h.state, h.faults) == (State.DISARMED, 0)
    h.lid_closed = True
    h.run(2000 * MS)
    assert (h.state, h.word) == (State.DISARMED, 0)
    h.armed()
    h.lid_closed = False
    h.run(6 * MS)
    assert h.state == State.DISARMED

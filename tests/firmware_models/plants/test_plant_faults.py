"""Every guard of the protocol's fault table, tripped by a fault of the hardware; and nothing tripped by sound hardware."""

from __future__ import annotations

import numpy as np
import pytest
from cores import CORES

from firmware_models.cores.avr_board import START_TICK
from haptics.link.messages import Fault, State, Status
from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS

MS = 1_000_000
ALL = 0x7FFF
TEN_MS = [200] * 15
WHOLE_BOARD = 255


@pytest.fixture(params=CORES)
def core(request) -> str:
    """The firmware that must notice."""
    return request.param


@pytest.fixture
def host(host):
    """A chip needs a moment to boot, so every board has one."""

    def booted(board: str = "tactiles", **query: object):
        h = host(board, **query)
        h.run(5)
        return h

    return booted


def armed(host, board, **query):
    h = host(board, **query)
    h.seq = 1
    h.arm()
    return h


def live_until_fault(h, max_ms: float) -> float:
    """Milliseconds from now until the board latches something, the dead-man fed; fails if it does not."""
    began_ns = h.now_ns
    while h.now_ns < began_ns + max_ms * MS:
        h.live(0.25)
        if h.port.board.faults:
            assert h.port.truth()["state"] == State.FAULT
            return (h.now_ns - began_ns) / MS
    raise AssertionError(f"no fault within {max_ms} ms")


def reported(h) -> tuple[int, int]:
    """Code and channel of the fault the host hears of."""
    h.run(3)
    return h.last("fault").code, h.last("fault").channel


# Coils.


def test_a_driver_that_sticks_on_an_armed_board_is_found_and_loses_its_feed(host, core) -> None:
    h = armed(host, "tactiles", core=core)
    h.live(50)
    h.port.set_load(3, driver_stuck=1)
    assert h.port.energised() == [3]
    after_ms = live_until_fault(h, 20)
    assert 10.0 < after_ms < 15.0  # longer than the longest pulse, by 2 ms, and a look each ms
    assert reported(h) == (Fault.COIL_ON_TIME, WHOLE_BOARD)
    assert h.last("fault").value == pytest.approx(1000 * NOMINAL_VOLTS / LATCH.resistance_ohm, rel=0.1)
    assert h.port.energised() == []


def test_a_driver_that_is_stuck_from_the_start_is_found_when_it_is_fed(host, core) -> None:
    h = host("tactiles", core=core, driver_stuck=0b1000)
    h.seq = 1
    h.run(100)
    assert h.port.energised() == []
    assert h.port.truth()["energy_j"] == [0.0] * 15
    h.ask("identify")
    assert h.status("arm", h.port.board.boot_id) == Status.OK
    assert live_until_fault(h, 20) < 15.0
    assert reported(h)[0] == Fault.COIL_ON_TIME


def test_a_driver_that_sticks_while_another_coil_is_on_draws_too_much(host, core) -> None:
    h = armed(host, "tactiles", core=core, spread=0)
    assert h.status("pulse", h.tick_in(2), 1, ALL, TEN_MS) == Status.OK
    h.live(2)
    assert h.port.energised() == [0]
    h.port.set_load(3, driver_stuck=1)
    assert live_until_fault(h, 10) < 5  # 2 ms, from a look at most 1 ms later, and the next look
    assert reported(h) == (Fault.COIL_CURRENT, WHOLE_BOARD)
    assert h.port.energised() == []


def test_a_shorted_coil_trips_when_it_is_switched_on(host, core) -> None:
    h = armed(host, "tactiles", core=core, coil_short=0b10, supply_ohm=0.05)
    h.live(100)
    assert h.port.board.faults == 0  # off, it draws nothing
    assert h.status("pulse", h.tick_in(2), 0b10, ALL, TEN_MS) == Status.OK
    h.live(1.5)
    assert live_until_fault(h, 8) < 5.5
    assert reported(h) == (Fault.COIL_CURRENT, WHOLE_BOARD)
    assert h.port.energised() == []
    h.port.set_load(1, coil_short=0)
    assert h.status("disarm") == Status.OK
    h.arm()
    assert h.status("pulse", h.tick_in(2), 0b10, ALL, TEN_MS) == Status.OK
    h.live(30)
    assert h.port.board.faults == 0


def test_a_supply_that_fails_latches_and_a_board_without_supply_does_not_arm(host, core) -> None:
    h = armed(host, "tactiles", core=core)
    h.port.set_load(0, supply_v=2.9)
    assert live_until_fault(h, 5) < 3.0
    assert reported(h) == (Fault.SUPPLY, WHOLE_BOARD)
    assert h.last("fault").value == pytest.approx(2900, abs=5)
    assert h.ask("disarm").detail == 1 << Fault.SUPPLY  # its cause is not gone
    h.port.set_load(0, supply_v=5.0)
    assert h.ask("disarm").detail == 0
    h.port.set_load(0, supply_v=2.9)
    reply = h.ask("arm", h.port.board.boot_id)
    assert (reply.status, reply.detail) == (Status.INTERLOCK, 1 << Fault.SUPPLY)


def test_a_supply_that_sags_under_its_coils_latches(host, core) -> None:
    """Three coils behind 0.5 ohm leave 2.4 V."""
    h = armed(host, "tactiles", core=core, spread=0, supply_ohm=0.5)
    assert h.status("pulse", h.tick_in(2), 0b111, ALL, TEN_MS) == Status.OK
    live_until_fault(h, 10)
    assert reported(h) == (Fault.SUPPLY, WHOLE_BOARD)


@pytest.mark.parametrize("seed", range(3))
def test_sound_coils_trip_nothing(host, core, seed) -> None:
    h = armed(host, "tactiles", core=core, seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(60):
        chosen = sum(1 << int(channel) for channel in rng.choice(15, int(rng.integers(1, 4)), replace=False))
        h.send("pulse", h.tick_in(float(rng.uniform(1, 5))), chosen, int(rng.integers(1 << 15)), [int(rng.integers(1, 201))] * 15)
        h.live(float(rng.uniform(1, 12)))
    assert h.port.board.faults == 0
    assert h.port.truth()["state"] == State.ARMED
    assert sum(h.port.truth()["switches"]) > 20


def test_coils_that_go_off_just_as_the_board_looks_are_no_fault(host, core) -> None:
    """A millisecond apart, as the looks are; one other coil stays on."""
    h = armed(host, "tactiles", core=core, spread=0, ppm=0)
    start = h.tick_in(15)
    assert h.status("pulse", start, 1, ALL, TEN_MS) == Status.OK
    for k in range(9):
        at = (start + 1000 + 2000 * k) % 2**32
        assert h.status("pulse", at, 0b110 << 2 * (k % 2), ALL, [10] * 15) == Status.OK
    h.live(40)
    assert h.last("tactiles_telemetry").played[:5] == (1, 5, 5, 4, 4)
    assert h.port.board.faults == 0


# Both.


@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_a_brown_out_is_a_reboot_that_says_so(host, core, board) -> None:
    first_tick = START_TICK if core == "avr" else 1000  # a chip begins its count itself
    h = armed(host, board, core=core, ppm=0, **({} if core == "avr" else {"tick_offset": first_tick}))
    old = h.ask("identify").boot_id
    if board == "tactiles":
        h.send("pulse", h.tick_in(4), 1, ALL, TEN_MS)
        h.send("pulse", h.tick_in(60), 1, ALL, TEN_MS)
        h.live(6)
    else:
        h.send("drive", h.tick_in(4), 1, 1000, 200, 2000)
        h.live(60)
    assert h.port.energised() == [0]
    h.port.set_load(0, brown_out=1)
    began_ns = h.now_ns
    h.run(6)
    assert h.port.energised() == []
    assert h.port.truth()["state"] == State.FAULT
    h.heard.clear()
    h.run(100)
    assert not h.heard  # it waits to be asked
    identity = h.ask("identify")
    assert identity.boot_id not in (old, 0)
    assert h.ask("sync", 1).received == pytest.approx(first_tick + (h.now_ns - began_ns) / 500, abs=4000)  # an exchange, a boot
    h.run(40)
    assert h.last(f"{board}_telemetry").faults == 1 << Fault.BROWN_OUT
    assert h.last(f"{board}_telemetry").queued == 0
    assert h.status("arm", old) == Status.BAD_VALUE
    assert h.status("arm", identity.boot_id) == Status.INTERLOCK
    assert h.ask("disarm").detail == 0
    h.arm()


@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_an_idle_armed_board_trips_nothing(host, core, board) -> None:
    h = armed(host, board, core=core)
    h.live(1000)
    assert h.port.board.faults == 0
    assert h.port.truth()["state"] == State.ARMED


# Brakes.


def driving(host, core, volts=1000, frequency_dhz=100, mask=1, for_ms=92.0, **query):
    """A board that holds volts in the middle of a half period."""
    h = armed(host, "brake", core=core, spread=0, **query)
    assert h.status("drive", h.tick_in(2), mask, volts, frequency_dhz, 2000) == Status.OK
    h.live(for_ms)
    return h


@pytest.mark.parametrize(
    ("query", "fault"),
    [
        ({"volts_gain": 1.08}, Fault.OVER_VOLTAGE),
        ({"supply_current_a": 700e-6}, Fault.OVER_CURRENT),
        ({"bridge_stuck": 1}, Fault.BRIDGE_STUCK),
        ({"breakdown_v": 600.0}, Fault.SHORT),
    ],
)
def test_bad_hardware_trips_its_guard_when_it_is_driven(host, core, query, fault) -> None:
    h = driving(host, core, mask=0b1, for_ms=0, **query)
    live_until_fault(h, 250)
    assert reported(h)[0] == fault
    assert h.port.energised() == []


@pytest.mark.parametrize(
    ("load", "faults"),
    [
        ({"leak_ohm": 1000 / 70e-6}, {Fault.LEAK}),
        ({"leak_ohm": 10e3}, {Fault.LEAK}),
        ({"breakdown_v": 999.0}, {Fault.LEAK, Fault.SHORT}),
        ({"travel_m": 0.12}, {Fault.OPEN}),
        ({"bridge_stuck": 1}, {Fault.BRIDGE_STUCK}),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_what_breaks_while_driven_is_found(host, core, load, faults) -> None:
    h = driving(host, core)
    assert h.port.truth()["state"] == State.DRIVING
    h.port.set_load(0, **load)
    live_until_fault(h, 130)
    assert reported(h)[0] in faults
    h.run(6)
    assert h.port.energised() == []


@pytest.mark.parametrize(("load", "fault"), [({"travel_m": 0.07}, Fault.OPEN), ({"leak_ohm": 1e3}, Fault.SHORT)])
def test_the_self_test_finds_a_torn_brake_and_a_short(host, core, load, fault) -> None:
    h = host("brake", core=core, spread=0)
    h.seq = 1
    h.port.set_load(3, **load)
    h.send("arm", h.ask("identify").boot_id)
    h.run(40)
    assert h.port.truth()["state"] == State.FAULT
    assert reported(h) == (fault, 3)


def test_no_brake_at_all_fails_the_self_test(host, core) -> None:
    h = host("brake", core=core, fitted=0)
    h.seq = 1
    h.send("arm", h.ask("identify").boot_id)
    h.run(40)
    assert reported(h) == (Fault.SELF_TEST, WHOLE_BOARD)


def test_a_lid_that_opens_makes_safe_without_a_fault_and_keeps_the_board_from_arming(host, core) -> None:
    h = driving(host, core)
    h.port.set_load(0, lid_open=1)
    h.run(8)
    assert h.port.energised() == []
    assert h.port.truth()["state"] == State.DISARMED
    assert h.port.board.faults == 0
    reply = h.ask("arm", h.port.board.boot_id)
    assert (reply.status, reply.detail) == (Status.INTERLOCK, 0)
    h.port.set_load(0, lid_open=0)
    h.run(50)
    assert h.port.truth()["state"] == State.DISARMED  # never by itself
    h.arm()


@pytest.mark.parametrize("when", ["self test", "at rest", "waiting drive"])
def test_a_lid_that_opens_while_nothing_is_driven_disarms_as_well(host, core, when) -> None:
    """What was asked before it opened does not come back when it closes, and neither does the board."""
    h = host("brake", core=core)
    h.seq = 1
    assert h.status("arm", h.ask("identify").boot_id) == Status.OK
    h.live(3 if when == "self test" else 30)
    if when == "waiting drive":
        assert h.status("drive", h.tick_in(40), 1, 800, 100, 1000) == Status.OK
    h.port.set_load(0, lid_open=1)
    h.live(8)
    assert h.port.truth()["state"] == State.DISARMED
    h.port.set_load(0, lid_open=0)
    volts = []
    for _ in range(80):
        h.live(1)
        volts.append(max(map(abs, h.port.truth()["volts"])))
    assert max(volts) < 1.0
    assert (h.port.truth()["state"], h.port.board.faults) == (State.DISARMED, 0)
    assert h.status("drive", h.tick_in(5), 1, 800, 100, 1000) == Status.INTERLOCK
    h.arm()


def test_a_board_whose_lid_is_open_from_the_start_does_not_arm(host, core) -> None:
    h = host("brake", core=core, lid_open=1)
    h.seq = 1
    assert h.status("arm", h.ask("identify").boot_id) == Status.INTERLOCK


@pytest.mark.parametrize("seed", range(3))
def test_sound_brakes_trip_nothing(host, core, seed) -> None:
    h = armed(host, "brake", core=core, seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(25):
        mask, volts = int(rng.integers(1, 32)), int(rng.integers(30, 1501))
        max_dhz = 10 * 500e-6 / (2 * 2.8e-9 * mask.bit_count() * volts)
        frequency_dhz = int(rng.uniform(5, min(max_dhz, 1000)))
        h.send("drive", h.tick_in(3), mask, volts, frequency_dhz, int(rng.integers(20, 400)))
        h.live(float(rng.uniform(10, 150)))
        assert h.port.board.faults == 0, (mask, volts, frequency_dhz)
    assert max(h.port.truth()["amplitude_v"]) >= 0.0
    assert h.last("brake_telemetry").late == 0

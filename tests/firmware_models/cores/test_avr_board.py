"""``core=avr``: the image on the simulated chip in the place of the Python model, with the same hardware and line around it."""

from __future__ import annotations

import io
import json
from typing import Any

import pytest
from avr_bench import needs_avr

from firmware_models.cores.avr_board import START_TICK
from firmware_models.line.uart import Line
from firmware_models.options import parse_options
from firmware_models.protocol_sim import board_options, make_cable
from firmware_models.simulate import Trace
from haptics.errors import InputError
from haptics.link.messages import Fault, State, Status

pytestmark = needs_avr

MS = 1_000_000
ALL = 0x7FFF
TEN_MS = [200] * 15
BOARDS = pytest.mark.parametrize("board", ["tactiles", "brake"])


def open_one(host, board: str = "tactiles", **query: Any):
    h = host(board, core="avr", **query)
    h.seq = 1
    h.run(3)  # it starts in less
    return h


def armed(host, board: str = "tactiles", **query: Any):
    h = open_one(host, board, **query)
    h.arm()
    return h


@BOARDS
def test_it_is_the_same_board_as_the_python_one_but_for_build_and_boot(host, board) -> None:
    py, avr = host(board, seed=3), open_one(host, board, seed=3)
    a, b = py.ask("identify", seq=0)._asdict(), avr.ask("identify", seq=0)._asdict()
    for key in ("build", "boot_id"):
        assert a.pop(key) != b.pop(key)
    assert a == b
    assert set(py.port.truth()) == set(avr.port.truth())
    assert vars(avr.port.board.plant).keys() == vars(py.port.board.plant).keys()
    assert tuple(avr.port.board.limits) == a["limits"]


@BOARDS
def test_the_seed_decides_the_boot_id(host, board) -> None:
    ids = [open_one(host, board, seed=seed).ask("identify").boot_id for seed in (1, 1, 2, 3)]
    assert ids[0] == ids[1]
    assert len(set(ids)) == 3


def test_options_that_the_chip_cannot_honour_are_refused_by_name(host) -> None:
    with pytest.raises(InputError, match="tick_offset = 5 is not possible with core = avr"):
        host("tactiles", core="avr", tick_offset=5)
    with pytest.raises(InputError, match="baud = 115200 is not possible with core = avr"):
        host("tactiles", core="avr", baud=115_200)


def test_a_stricter_current_limit_reaches_the_firmware(host) -> None:
    assert open_one(host, current_limit_a=8).ask("identify").limits[1] == 8000


@pytest.mark.parametrize("ppm", [0, 1000, -1000])
def test_the_crystals_error_is_that_of_the_clock(host, ppm) -> None:
    h = open_one(host, ppm=ppm)
    first, then_ns = h.ask("sync", 1).sent, h.now_ns
    h.run(1000)
    second, now_ns = h.ask("sync", 2).sent, h.now_ns
    ticks = (second - first) % 2**32
    assert ticks == pytest.approx((now_ns - then_ns) / 500 * (1 + ppm * 1e-6), abs=20)  # the stamps are of moments 10 us apart


def test_its_clock_is_known(host) -> None:
    h = armed(host, ppm=37)
    ticks = h.port.board.ticks
    assert ticks.count(0) < START_TICK
    reply_ns = 20_000 * 18
    stamp = h.ask("sync", 1).sent
    assert 0 <= ticks.u32(h.heard[-1].time_ns - reply_ns) - stamp <= 100


def test_a_coil_is_on_from_its_tick_to_that_of_its_end(host) -> None:
    h = armed(host, ppm=-400)
    start = h.tick_in(15)
    assert h.status("pulse", start, 0b10, ALL, [60] * 15) == Status.OK
    ticks = h.port.board.ticks
    full = ticks.count(h.now_ns) + (start - ticks.count(h.now_ns)) % 2**32
    late_ns = 10_000
    for at_ns, on in (
        (ticks.time_ns(full) - 1, []),
        (ticks.time_ns(full) + late_ns, [1]),
        (ticks.time_ns(full + 6000) - 1, [1]),
        (ticks.time_ns(full + 6000) + late_ns, []),
    ):
        h.listen(at_ns)
        assert h.port.energised() == on


def test_the_same_commands_latch_the_same_coils_as_on_the_python_board(host) -> None:
    def play(core: str) -> dict[str, Any]:
        h = host("tactiles", core=core, seed=5, ppm=37, supply_ohm=0.02)
        h.seq = 1
        h.run(3)
        h.arm()
        begin = h.tick_in(40)
        for k in range(6):
            assert h.status("pulse", (begin + k * 25_000) % 2**32, 0b111 << k, 0b0110101 << k, [200 - 7 * k] * 15) == Status.OK
        h.live(300)
        return h.port.truth()

    a, b = play("py"), play("avr")
    assert sum(a["switches"]) > 8
    for key in ("switches", "latched", "coils_on", "state"):
        assert b[key] == a[key], key
    assert b["energy_j"] == pytest.approx(a["energy_j"], rel=2e-3)  # each edge is 2 us of 7 ms late


def test_a_drive_reaches_its_volts_and_ends_with_its_ttl(host) -> None:
    h = armed(host, "brake")
    start = h.tick_in(5)
    assert h.status("drive", start, 0b1, 1000, 200, 200) == Status.OK
    h.live(60)
    assert h.port.truth()["state"] == State.DRIVING
    assert abs(h.port.truth()["volts"][0]) == pytest.approx(1000, rel=0.02)
    h.live(250)
    assert h.port.truth()["state"] == State.ARMED
    assert abs(h.port.truth()["volts"][0]) < 60
    assert h.port.board.faults == 0


def test_the_lid_reaches_the_pin(host) -> None:
    h = armed(host, "brake")
    h.port.set_load(0, lid_open=1)
    h.live(5)
    assert h.port.truth()["state"] == State.DISARMED
    assert h.status("arm", h.port.board.boot_id) == Status.INTERLOCK


@BOARDS
def test_a_brown_out_reboots_it(host, board) -> None:
    h = armed(host, board)
    before = h.ask("identify").boot_id
    h.port.set_load(0, brown_out=1)
    assert h.port.energised() == []
    h.run(3)
    assert (h.port.board.state, h.port.board.faults) == (State.FAULT, 1 << Fault.BROWN_OUT)
    after = h.ask("identify").boot_id
    assert after == h.port.board.boot_id != before
    assert h.status("arm", after) == Status.INTERLOCK
    assert h.status("disarm") == Status.OK
    h.arm()


@BOARDS
def test_a_silent_host_finds_the_board_safe_after_the_dead_mans_time(host, board) -> None:
    h = armed(host, board)
    h.ask("sync", 1)
    fed_ns = h.now_ns
    h.listen(fed_ns + 99 * MS)
    assert h.port.truth()["state"] == State.ARMED
    h.listen(fed_ns + 101 * MS)
    assert h.port.truth()["state"] == State.FAULT


@BOARDS
def test_the_same_seed_gives_the_same_bytes_however_the_world_is_stepped(host, board) -> None:
    def play(step_ms: float) -> tuple[bytes, Any]:
        h = open_one(host, board, seed=5)
        boot_id = h.ask("identify").boot_id
        begin_ns = h.now_ns
        for at_ms, name, values in (
            (2, "arm", (boot_id,)),
            (25, "keepalive", ()),
            (50, "keepalive", ()),
            (60, "pulse", (START_TICK + 180_000, 0b101, 0b001, TEN_MS))
            if board == "tactiles"
            else (60, "drive", (START_TICK + 180_000, 0b1, 1000, 200, 100)),
            (85, "keepalive", ()),
            (110, "keepalive", ()),
        ):
            while h.now_ns < begin_ns + at_ms * MS:
                h.listen(min(h.now_ns + round(step_ms * MS), begin_ns + at_ms * MS))
            h.send(name, *values)
        while h.now_ns < begin_ns + 150 * MS:
            h.listen(min(h.now_ns + round(step_ms * MS), begin_ns + 150 * MS))
        truth = h.port.truth()
        truth.pop("time_ns")
        return bytes(h.raw), truth

    whole, pieces = play(200), play(0.037)
    assert len(whole[0]) > 300
    assert whole[0] == pieces[0]
    assert whole[1] == pieces[1]


def test_bytes_are_handed_over_each_with_the_time_of_its_stop_bit() -> None:
    line = Line(500_000)
    line.send(b"\x01\x02\x00\x03", 1000)
    assert line.take_stamped(1000 + 39_999) == (b"\x01", [21_000])
    assert line.take_stamped(1000 + 80_000) == (b"\x02\x00\x03", [41_000, 61_000, 81_000])
    assert line.take_stamped(10**9) == (b"", [])
    assert line.in_transit(10**9) == 0


def test_a_trace_may_be_kept_of_it(tmp_path) -> None:
    options = parse_options({"core": "avr", "seed": "1"}, board_options("tactiles"))
    cable = make_cable("tactiles", options, 0)
    written = io.StringIO()
    trace = Trace(written)
    cable.advance(5 * MS)
    trace.note(cable)
    assert json.loads(written.getvalue())["state"] == "DISARMED"

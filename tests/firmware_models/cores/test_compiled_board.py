"""``core=c``: the compiled firmware in the place of the Python model, with the same hardware, clock and line around it."""

from __future__ import annotations

import io
import json
import shutil
from typing import Any

import pytest
import serial

from firmware_models.options import parse_options
from firmware_models.protocol_sim import board_options, make_cable
from firmware_models.simulate import Trace
from haptics.errors import InputError
from haptics.link.framing import encode_frame
from haptics.link.messages import BY_NAME, Fault, State, Status

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None or shutil.which("make") is None, reason="no cc or make here: the C core cannot be built"
)

MS = 1_000_000
ALL = 0x7FFF
TEN_MS = [200] * 15
BOARDS = pytest.mark.parametrize("board", ["tactiles", "brake"])


def open_one(host, board: str = "tactiles", core: str = "c", **query: Any):
    h = host(board, core=core, **query)
    h.seq = 1
    return h


def armed(host, board: str = "tactiles", core: str = "c", **query: Any):
    h = open_one(host, board, core, **query)
    h.arm()
    return h


@BOARDS
@pytest.mark.parametrize("seed", [1, 2])
def test_it_is_the_same_board_as_the_python_one_but_for_its_build(host, board, seed) -> None:
    py, c = (open_one(host, board, core, seed=seed) for core in ("py", "c"))
    a, b = py.ask("identify")._asdict(), c.ask("identify")._asdict()
    assert a.pop("build") != b.pop("build")
    assert a == b
    assert set(py.port.truth()) == set(c.port.truth())
    assert vars(c.port.board.plant).keys() == vars(py.port.board.plant).keys()
    assert c.port.board.boot_id == a["boot_id"]
    assert tuple(c.port.board.limits) == a["limits"]


@pytest.mark.parametrize(("ppm", "tick_offset"), [(0, 0), (1000, 12_345), (-1000, 2**32 - 40_000)])
def test_a_coil_is_on_from_the_first_nanosecond_of_its_tick_to_that_of_its_end(host, ppm, tick_offset) -> None:
    h = armed(host, ppm=ppm, tick_offset=tick_offset)
    start = h.tick_in(15)
    assert h.status("pulse", start, 0b10, ALL, [60] * 15) == Status.OK
    ticks = h.port.board.ticks
    count = ticks.count(h.now_ns)
    full = count + (start - count) % 2**32
    for at_ns, on in (
        (ticks.time_ns(full) - 1, []),
        (ticks.time_ns(full), [1]),
        (ticks.time_ns(full + 6000) - 1, [1]),
        (ticks.time_ns(full + 6000), []),
    ):
        h.listen(at_ns)
        assert h.port.energised() == on


def test_the_same_commands_move_the_same_pins_as_on_the_python_board(host) -> None:
    """The edges are on the same nanoseconds, and the plant is the same. (Telemetry looks at it at other moments: rounding.)"""

    def play(core: str) -> dict[str, Any]:
        h = armed(host, core=core, seed=5, ppm=37, tick_offset=2**32 - 100_000, supply_ohm=0.02)
        for k in range(6):
            assert h.status("pulse", (k * 25_000) % 2**32, 0b111 << k, 0b0110101 << k, [200 - 7 * k] * 15) == Status.OK
        h.port.set_load(2, stiffness_n_m=300.0)
        h.live(200)
        h.listen(250 * MS)
        return h.port.truth()

    a, b = play("py"), play("c")
    assert sum(a["switches"]) > 8
    for key in ("switches", "latched", "coils_on", "state"):
        assert b[key] == a[key], key
    assert [event[:3] for event in b["events"]] == [event[:3] for event in a["events"]]
    assert b["energy_j"] == pytest.approx(a["energy_j"], rel=1e-9)
    assert b["rise_k"] == pytest.approx(a["rise_k"], rel=1e-4)


@BOARDS
def test_the_same_seed_gives_the_same_bytes(host, board) -> None:
    def play(seed: int) -> bytes:
        h = armed(host, board, seed=seed)
        if board == "tactiles":
            h.ask("pulse", h.tick_in(3), 0b101, 0b001, TEN_MS)
        else:
            h.ask("drive", h.tick_in(3), 0b01, 1000, 200, 200)
        h.live(200)
        return bytes(h.raw)

    assert play(5) == play(5)
    assert play(5) != play(6)


@BOARDS
def test_sync_stamps_arrival_and_departure_in_the_boards_own_ticks(host, board) -> None:
    h = open_one(host, board, ppm=0, tick_offset=2**32 - 500)
    sent_ns = h.now_ns
    reply = h.ask("sync", 99)
    frame_ns, reply_ns = 20_000 * 10, 20_000 * 18
    assert reply.received == (2**32 - 500 + (sent_ns + frame_ns) // 500) % 2**32
    assert reply.sent == (2**32 - 500 + (h.heard[-1].time_ns - reply_ns) // 500) % 2**32


@BOARDS
def test_a_silent_host_finds_the_board_safe_after_the_dead_mans_time(host, board) -> None:
    h = armed(host, board)
    h.ask("sync", 1)
    fed_ns = h.now_ns
    h.listen(fed_ns + 99 * MS)
    assert h.port.truth()["state"] == State.ARMED
    h.listen(fed_ns + 101 * MS)
    assert h.port.truth()["state"] == State.FAULT
    h.run(2)
    assert h.last("fault").code == Fault.DEAD_MAN


def test_a_board_that_nobody_asked_for_half_an_hour_is_as_it_was(host) -> None:
    """Longer than half of the counter's range, with nothing to do meanwhile."""
    h = open_one(host, ppm=0, tick_offset=5)
    h.run(1_800_000)
    h.arm()
    start = h.tick_in(5)
    assert h.status("pulse", start, 1, ALL, TEN_MS) == Status.OK
    h.live(30)
    assert h.port.truth()["latched"][0] == "on"
    assert h.port.board.faults == 0


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("sim://tactiles?core=c&current_limit_a=60", ["current_limit_a", "60", "core = c", "12"]),
        ("sim://brake?core=c&overlap_m2=0.5", ["overlap_m2", "0.5", "core = c", "65535"]),
        ("sim://brake?core=c&overlap_m2=0", ["overlap_m2", "core = c"]),
        ("sim://thermocouple?core=c", ["core = c", "thermocouple", "leave core out"]),
        ("sim://probe?core=avr", ["core = avr", "probe", "leave core out"]),
    ],
)
def test_what_the_core_cannot_honour_is_refused_by_name(host, url, words) -> None:
    host()  # registers the package
    with pytest.raises(InputError) as caught:
        serial.serial_for_url(url)
    assert all(word in str(caught.value) for word in words)


def test_stricter_limits_are_the_cores_own(host) -> None:
    h = armed(host, current_limit_a=4.0)
    assert h.ask("identify").limits[1] == 4000
    assert h.status("pulse", h.tick_in(3), 0b11, ALL, TEN_MS) == Status.FULL
    assert h.status("pulse", h.tick_in(3), 0b01, ALL, TEN_MS) == Status.OK
    assert open_one(host, "brake", thickness_m=8e-6).ask("identify").limits[0] == 1200


def test_an_accelerometer_in_the_same_world_hears_the_landings(host) -> None:
    h = armed(host, world="heard", spread=0)
    meter: Any = serial.serial_for_url("sim://accelerometer?world=heard&clock=virtual", baudrate=500_000, timeout=0)
    quiet = _counts(h, meter, 20)
    assert h.status("pulse", h.tick_in(3), 0b1, ALL, TEN_MS) == Status.OK
    loud = _counts(h, meter, 40)
    meter.close()
    assert max(map(abs, loud)) > 10 * max(1, *map(abs, quiet))


def _counts(h, meter, ms: float) -> list[int]:
    meter.read(1 << 16)
    h.live(ms)
    return [int(line.split()[1]) for line in meter.read(1 << 16).decode().splitlines()[1:-1] if not line.startswith("#")]


def test_a_stage_and_a_load_cell_in_the_same_world_feel_the_brake(host) -> None:
    h = armed(host, "brake", world="pulled", spread=0)
    assert h.port.board.plant.tension(0, h.now_ns) == 0.0
    h.port.set_load(0, hand_m=0.0, hand_m_s=0.05)
    assert h.status("drive", h.tick_in(3), 1, 1000, 100, 2000) == Status.OK
    cell: Any = serial.serial_for_url("sim://loadcell?world=pulled&clock=virtual", baudrate=500_000, timeout=0)
    h.live(150)
    counts = [int(line.split()[1]) for line in cell.read(1 << 16).decode().splitlines()[1:-1] if not line.startswith("#")]
    newtons = counts[-1] / cell.board.counts_per_n
    cell.close()
    assert newtons == pytest.approx(h.port.board.plant.tension(0, h.now_ns), abs=0.3)
    assert newtons > 2.0


def test_simulate_serves_and_traces_it() -> None:
    options = parse_options({"core": "c", "seed": "4"}, board_options("tactiles"))
    cable = make_cable("tactiles", options, 0)
    cable.attached = True
    text = io.StringIO()
    trace = Trace(text)
    trace.note(cable)
    cable.to_board.send(encode_frame(BY_NAME["arm"].type, 1, cable.board.boot_id.to_bytes(4, "little")), 0)
    for at_ns in range(0, 200 * MS, MS):
        cable.advance(at_ns)
        trace.note(cable)
    states = [json.loads(line)["state"] for line in text.getvalue().splitlines()]
    assert states == ["DISARMED", "ARMED", "FAULT"]  # its dead-man was not fed


@pytest.mark.slow
def test_what_goes_wrong_in_the_plant_comes_out_where_the_board_was_called(host, monkeypatch) -> None:
    h = armed(host)

    def broken(sense: int, time_ns: int) -> int:
        raise InputError("the plant is upset")

    with monkeypatch.context() as patch:
        patch.setattr(h.port.board.pins, "counts", broken)
        with pytest.raises(InputError, match="upset"):
            h.live(5)
    h.live(5)
    assert h.port.board.faults >= 0

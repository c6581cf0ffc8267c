"""The simulated stage speaks the part of GRBL 1.1 that jogs, and moves the hand of its brake."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import serial

from haptics.errors import InputError
from rigs.instruments import Stage

MS = 1_000_000


class Bench:
    """A brake board and a stage in one world."""

    def __init__(self, keys: str = ""):
        if "firmware_models" not in serial.protocol_handler_packages:
            serial.protocol_handler_packages.append("firmware_models")
        self.brake: Any = serial.serial_for_url("sim://brake?world=stage&clock=virtual&spread=0", timeout=0)
        self.stage: Any = serial.serial_for_url(f"sim://stage?world=stage&clock=virtual{keys}", baudrate=115_200, timeout=0)
        self.send(b"", 0.01)

    def send(self, data: bytes, wait_s: float = 0.02) -> list[str]:
        """Lines that come within so long after some bytes."""
        if data:
            self.stage.write(data)
        self.wait(wait_s)
        return [line for line in self.stage.read(4096).decode().split("\r\n") if line]

    def wait(self, seconds: float) -> None:
        self.stage.advance(self.stage.now_ns + round(seconds * 1e9))

    @property
    def hand_m(self) -> float:
        """Where the plant has the hand."""
        position_m, speed_m_s, since_s = self.brake.board.plant._plant._hands[0]
        return position_m + speed_m_s * (self.stage.now_ns / 1e9 - since_s)

    def close(self) -> None:
        self.stage.close()
        self.brake.close()


@pytest.fixture
def bench():
    made: list[Bench] = []

    def make(keys: str = "") -> Bench:
        made.append(Bench(keys))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_it_greets_and_says_how_it_is(bench):
    one = bench()
    one.close()
    made = bench()
    assert made.send(b"?") == ["<Idle|MPos:0.000,0.000,0.000|FS:0,0>"]
    assert made.send(b"\n") == ["ok"]


def test_a_jog_moves_the_hand_at_its_speed_and_ends_where_it_should(bench):
    one = bench("&pitch=1.002&accel_m_s2=0.5")
    assert one.send(b"$J=G91 X10 F60\n") == ["ok"]
    one.wait(1.0)
    begin_m = one.hand_m
    one.wait(5.0)
    assert (one.hand_m - begin_m) / 5.0 == pytest.approx(1.002e-3, rel=1e-9)
    assert one.send(b"?", 0.01)[0].startswith("<Jog|MPos:6.0")
    one.wait(4.5)
    assert one.send(b"?") == ["<Idle|MPos:10.000,0.000,0.000|FS:0,0>"]
    assert one.hand_m == pytest.approx(1.002 * 10e-3, abs=1e-9)


def test_it_speeds_up_and_brakes_as_told(bench):
    """Way and time of a trapezoid: v / a longer than at full speed throughout; both from the equations of motion."""
    one = bench("&pitch=1&accel_m_s2=0.2")
    one.stage.write(b"$J=G91 X20 F1200\n")  # 20 mm/s
    seen = []
    for _ in range(1400):
        one.wait(1e-3)
        seen.append(one.hand_m)
    speed_m_s = np.diff(seen) / 1e-3
    assert speed_m_s.max() == pytest.approx(20e-3, rel=1e-6)
    moving_s = 1e-3 * np.count_nonzero(speed_m_s > 1e-9)
    assert moving_s == pytest.approx(20e-3 / 20e-3 + 20e-3 / 0.2, abs=5e-3)  # steps of 1 ms at either end
    assert np.abs(np.diff(speed_m_s)).max() <= 0.2 * 1e-3 * 2.1  # two steps of the ramp may fall into one look
    assert seen[-1] == pytest.approx(20e-3, abs=1e-9)


@pytest.mark.parametrize("cancel", [b"\x85", b"!"])
def test_jog_cancel_stops_it_at_once_and_forgets_what_waits(bench, cancel):
    one = bench("&accel_m_s2=0.5")
    assert one.send(b"$J=G91 X10 F1200\n$J=G91 X10 F1200\n", 0.2) == ["ok", "ok"]
    one.stage.write(cancel)
    one.wait(0.05)  # 20 mm/s at 0.5 m/s2 takes 40 ms
    stopped_m = one.hand_m
    one.wait(2.0)
    assert one.hand_m == stopped_m
    assert 3e-3 < stopped_m < 6e-3
    assert one.send(b"?")[0].startswith("<Idle|MPos:")
    assert one.send(b"$J=G91 X-1 F600\n", 1.0) == ["ok"]
    assert one.hand_m == pytest.approx(stopped_m - 1e-3 * one.stage.truth()["pitch"], abs=1e-8)


def test_jogs_wait_for_the_one_before(bench):
    one = bench("&pitch=1")
    assert one.send(b"$J=G91 X2 F600\n$J=G91 X-1 F600\n", 0.5) == ["ok", "ok"]
    assert one.hand_m == pytest.approx(1e-3, abs=1e-9)


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        (b"$J=G91 X10\n", "error:22"),
        (b"$J=G91 X10 F0\n", "error:22"),
        (b"$J=G91 X1e9 F60\n", "error:3"),
        (b"$J=G91 X5000 F60\n", "error:2"),
        (b"$J=G91 X1.2.3 F60\n", "error:2"),
        (b"G0 X10\n", "error:3"),
    ],
)
def test_a_line_it_does_not_take_moves_nothing(bench, line, answer):
    one = bench()
    assert one.send(line, 0.5) == [answer]
    assert one.hand_m == 0.0


def test_a_locked_stage_refuses_and_a_stuck_one_does_not_know(bench):
    locked = bench("&locked=1")
    assert locked.send(b"$J=G91 X1 F600\n") == ["error:9"]
    assert locked.send(b"?")[0].startswith("<Alarm|")
    locked.close()
    stuck = bench("&stuck=1")
    assert stuck.send(b"$J=G91 X1 F600\n", 0.5) == ["ok"]
    assert stuck.send(b"?")[0].startswith("<Idle|MPos:1.000")
    assert stuck.hand_m == 0.0


def test_a_clamp_that_slips_lets_the_tension_rise_no_further(bench):
    one = bench("&pitch=1&slip_n=2e-3")
    one.brake.set_load(0, hand_m=0.0)
    one.send(b"$J=G91 X3 F60\n", 3.5)
    # Strips that are off hold 5 mN; the clamp gives way at 2 mN. A step of 1 ms at 1 mm/s against 0.8 N/mm (finger) is 0.8 mN.
    assert 1.9e-3 < one.brake.truth()["tension_n"][0] < 2.9e-3
    assert one.hand_m < 1.1e-3  # the slack of 1 mm and a little
    assert one.send(b"?")[0].startswith("<Idle|MPos:3.000")


def test_it_takes_no_load(bench):
    with pytest.raises(InputError, match="does not act on a stage"):
        bench().stage.set_load(0, pull_n=1.0)


def test_its_driver_moves_stops_and_knows_when_it_stands(bench):
    one = bench("&pitch=1")
    one.stage.close()
    driver = Stage("sim://stage?world=stage&clock=virtual&pitch=1")

    def serve(seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            now_ns = one.brake.now_ns + 10 * MS
            one.brake.advance(now_ns)
            driver.poll(now_ns)

    try:
        serve(0.2)
        assert (driver.state, driver.idle) == ("Idle", True)
        driver.move(5e-3, 10e-3)
        assert not driver.idle
        serve(0.3)
        assert driver.state == "Jog"
        serve(0.5)
        assert (driver.idle, driver.position_m, driver.refusals) == (True, 5e-3, [])
        driver.move(-5e-3, 10e-3)
        serve(0.2)
        driver.stop()
        serve(0.3)
        assert driver.idle
        assert 2e-3 < driver.position_m < 4e-3
        with pytest.raises(InputError, match="speed_m_s"):
            driver.move(1e-3, 1.0)
        with pytest.raises(InputError, match="relative_m"):
            driver.move(1.0, 1e-3)
    finally:
        driver.close()

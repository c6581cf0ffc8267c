"""Whatever a board was doing when it was made safe, a person can arm it again, and only a person."""

from __future__ import annotations

import pytest

import haptics as product
from haptics.errors import LimitError
from haptics.session.configuration import BrakeConfiguration
from haptics.session.devices import Devices

PERIOD_S = 0.050  # of the square wave at 20 Hz


def peak_volts(glove) -> float:
    """The most that the board reports within a period; in the middle of a reversal it is nothing."""
    volts = []
    for _ in range(5):
        glove.advance(PERIOD_S / 5)
        volts.append(glove.state().volts["index"])
    return max(volts)


@pytest.mark.parametrize("phase", range(8))
def test_a_brake_stopped_at_any_phase_of_its_wave_is_armed_and_driven_again(phase):
    with product.open(brake="sim://brake", clock="virtual") as glove:
        glove.arm()
        glove.brake("index", volts=1000.0, ttl_s=0.5)
        assert peak_volts(glove) > 900
        glove.advance((1 + phase / 8) * PERIOD_S)
        glove.off()
        glove.advance(0.5)
        assert glove.state().armed == ()
        assert glove.state().volts["index"] == 0

        glove.arm()
        glove.brake("index", volts=1000.0, ttl_s=0.5)
        assert peak_volts(glove) > 900
        assert glove.state().armed == ("brake",)
        assert glove.state().faults == ()


def test_arming_goes_by_what_the_board_says_now_and_not_by_what_it_said_before():
    glove = Devices(None, BrakeConfiguration(), realtime=False)
    try:
        glove.arm()
        assert glove.links["brake"].armed
        glove.off()
        plant = glove.plant("brake")
        assert plant is not None
        plant.set_load(0, leak_ohm=1.0)  # a scratched film, found by the self test
        with pytest.raises(LimitError, match="fault"):
            glove.arm()
        assert not glove.links["brake"].armed
    finally:
        glove.close()

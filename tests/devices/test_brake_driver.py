"""The brake's driver on a simulated board."""

from __future__ import annotations

import pytest

from haptics.errors import InputError
from haptics.link.messages import State


def _truth(glove):
    return glove._glove.plant("brake").truth()


def _volts(glove, name):
    return glove._glove.brakes.engaged().get(name)


def test_a_brake_asked_for_force_holds_it(glove):
    glove.arm()
    volts = glove.brake("index", force_n=4.0, ttl_s=0.5)
    glove.advance(0.3)
    assert volts == pytest.approx(667, rel=0.02)  # sqrt(4 / 9.63e-6 + 171^2): fitted law
    assert max(_truth(glove)["capacity_n"]) == pytest.approx(4.0, rel=0.15)  # ripple at reversal


def test_volts_fall_by_themselves_after_the_time_to_live(glove):
    glove.arm()
    glove.brake("index", volts=1000, ttl_s=0.1)
    glove.advance(0.09)
    assert abs(_truth(glove)["volts"][0]) > 500
    glove.advance(0.06)
    assert abs(_truth(glove)["volts"][0]) < 60


def test_a_silent_driver_lets_the_volts_fall_within_the_commands_life(glove):
    """The driver stops ticking (its program hangs) while the link still keeps the board alive."""
    glove.arm()
    glove._glove.brakes.engage("index", 1000, glove._glove.now_ns())
    glove.advance(0.1)
    glove._glove.follow(glove._glove.now_ns() + 300_000_000)
    assert abs(_truth(glove)["volts"][0]) < 60


def test_unlike_wishes_share_the_higher_volts(glove):
    glove.arm()
    glove.brake("index", volts=400, ttl_s=0.5)
    glove.brake("thumb", volts=800, ttl_s=0.5)
    glove.advance(0.2)
    amplitude = _truth(glove)["amplitude_v"]
    assert amplitude[0] == pytest.approx(800, rel=0.02)
    assert amplitude[1] == pytest.approx(800, rel=0.02)


def test_force_comes_within_a_tenth_of_a_second_and_goes_within_one(glove):
    """Response < 100 ms (thesis 4.7.3)."""
    glove.arm()
    glove.brake("index", volts=1500, ttl_s=0.3)
    glove.advance(0.1)
    assert _truth(glove)["capacity_n"][0] > 0.9 * 18
    glove.advance(0.3)
    assert _truth(glove)["capacity_n"][0] < 2.0


def test_going_off_shorts_the_bridge(glove):
    glove.arm()
    glove.brake("index", volts=1000, ttl_s=5.0)
    glove.advance(0.1)
    glove.off()
    glove.advance(0.05)
    truth = _truth(glove)
    assert max(abs(v) for v in truth["volts"]) < 60
    assert truth["state"] == State.DISARMED


@pytest.mark.parametrize("volts", [-1, 1501, float("nan")])
def test_volts_outside_the_limits_are_refused_by_name(glove, volts):
    glove.arm()
    with pytest.raises(InputError, match=r"^volts = "):
        glove.brake("index", volts=volts)


def test_neither_force_nor_volts_is_refused(glove):
    with pytest.raises(InputError, match="exactly one"):
        glove.brake("index")

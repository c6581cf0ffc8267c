"""The brake's driver on a simulated board."""

from __future__ import annotations

import pytest

from haptics.errors import ClockUncertain, InputError
from haptics.link.messages import State


def _truth(glove):
    return glove.devices.plant("brake").truth()


def _volts(glove, name):
    return glove.devices.brakes.engaged().get(name)


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
    glove.devices.brakes.engage("index", 1000, glove.devices.now_ns())
    glove.advance(0.1)
    glove.devices.follow(glove.devices.now_ns() + 300_000_000)
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


def _results(asked):
    return [(one.site, one.kind, one.played, one.reason) for one in asked.results() if one.kind in ("brake", "piezo")]


def test_every_brake_that_was_asked_for_gives_one_result(glove):
    glove.arm()
    glove.brake("index", volts=400, ttl_s=0.5)
    glove.brake("thumb", volts=800, ttl_s=0.5)
    glove.advance(0.4)  # many refreshes, which nobody asked for
    assert _results(glove) == [("index", "brake", True, None), ("thumb", "brake", True, None)]
    glove.advance(0.4)
    assert glove.results() == []


def test_a_result_of_a_brake_says_when_it_was_asked_for_and_when_it_begins(glove):
    glove.arm()
    asked_ns = glove.devices.now_ns()
    glove.brake("index", volts=400, ttl_s=0.5)
    glove.advance(0.1)
    rise_ns = min(time_ns for time_ns, _, kind, _ in _truth(glove)["events"] if kind != "shorted" and time_ns > asked_ns)
    (result,) = glove.results()
    assert result.requested_ns == asked_ns
    assert asked_ns < result.start_ns <= rise_ns + 50_000  # the board's clock is known about so well


def test_a_brake_that_no_command_spoke_of_yet_is_superseded(glove, told):
    glove.arm()
    brakes, now_ns = glove.devices.brakes, glove.devices.now_ns()
    for volts in (300, 400):
        brakes.engage("index", volts, now_ns)
    brakes.engage("thumb", 400, now_ns)
    brakes.release("thumb", now_ns)
    glove.advance(0.1)
    assert _results(told) == [
        ("index", "brake", False, "superseded"),
        ("thumb", "brake", False, "superseded"),
        ("index", "brake", True, None),
    ]


def test_a_brake_whose_time_was_over_before_the_next_tick_is_late(glove):
    glove.arm()
    glove.brake("index", volts=300, ttl_s=0.001)
    glove.devices.tick(glove.devices.now_ns() + 5_000_000)
    assert _results(glove) == [("index", "brake", False, "late")]


def test_piezos_give_a_result_each(glove, told):
    glove.arm()
    glove.devices.brakes.piezo(["index", "thumb"], 0.05, glove.devices.now_ns())
    glove.advance(0.1)
    assert _results(told) == [("index", "piezo", True, None), ("thumb", "piezo", True, None)]


def test_a_refused_refresh_is_a_result_of_each_output_that_was_held(glove, monkeypatch):
    glove.arm()
    glove.brake("index", volts=400, ttl_s=5.0)
    glove.advance(0.02)
    assert _results(glove) == [("index", "brake", True, None)]

    def unsure(host_ns):
        raise ClockUncertain("sim://brake", "too coarse")

    monkeypatch.setattr(glove.devices.links["brake"], "to_ticks", unsure)
    glove.advance(0.1)
    assert set(_results(glove)) == {("index", "brake", False, "clock")}


def test_what_was_asked_for_and_not_sent_when_going_off_is_denied(glove, told):
    glove.arm()
    glove.devices.brakes.engage("index", 400, glove.devices.now_ns())
    glove.devices.brakes.set_armed(False)
    assert _results(told) == [("index", "brake", False, "unarmed")]


def test_one_output_is_let_go_of_and_the_other_held_on(glove):
    glove.arm()
    for name in ("index", "thumb"):
        glove.brake(name, volts=800, ttl_s=5.0)
    glove.advance(0.1)
    glove.devices.brakes.release("index", glove.devices.now_ns())
    index, thumb = [], []
    for _ in range(12):
        glove.advance(0.005)
        volts = _truth(glove)["volts"]
        index.append(abs(volts[0]))
        thumb.append(abs(volts[1]))
    assert max(index[2:]) < 60
    assert max(thumb) > 700


def test_all_outputs_are_let_go_of_at_once_and_not_when_their_command_runs_out(glove):
    glove.arm()
    glove.brake("index", volts=800, ttl_s=5.0)
    glove.advance(0.1)
    glove.devices.brakes.release_all(glove.devices.now_ns())
    glove.advance(0.012)  # the command lead, and a discharge
    assert max(map(abs, _truth(glove)["volts"])) < 60
    glove.advance(0.1)
    assert max(map(abs, _truth(glove)["volts"])) < 1


def test_what_the_board_refuses_is_said(glove, told):
    """1500 V at 500 Hz is more than the supply can charge; and a clock that is not known schedules nothing."""
    glove.arm()
    brakes = glove.devices.brakes
    brakes.engage("index", 1500.0, glove.devices.now_ns(), frequency_hz=500.0)
    glove.advance(0.05)
    assert {(refusal.command, refusal.reason) for refusal in told.refusals()} == {("drive", "bad_value")}
    brakes.release_all(glove.devices.now_ns())
    glove.advance(0.05)
    told.refusals()
    brakes.piezo(["index"], 0.1, glove.devices.now_ns(), at_ns=glove.devices.now_ns() + 10_000_000_000)
    assert [refusal.command for refusal in told.refusals()] == ["piezo"]
    assert max(map(abs, _truth(glove)["volts"])) < 1


@pytest.mark.parametrize("volts", [1500.5, -0.1, float("inf")])
def test_the_driver_itself_takes_no_volts_beyond_its_limit(glove, volts):
    """Not only the face of a script: scenes and patterns come in here."""
    glove.arm()
    with pytest.raises(InputError, match="amplitude_v"):
        glove.devices.brakes.engage("index", volts, glove.devices.now_ns())
    assert glove.devices.brakes.engaged() == {}

"""Where the driver believes the pins to be, against where the plant's pins are."""

from __future__ import annotations

import random
from collections import Counter

import pytest

from haptics.devices.pins import Pin
from haptics.errors import LinkError
from haptics.link.commands import Pending
from haptics.link.messages import Status
from haptics.scheduling import latency_bound_s
from haptics.session.glove import open as open_glove
from haptics.time import NS_PER_MS, NS_PER_S

MS = NS_PER_MS


def latched(glove) -> tuple[str, ...]:
    array = glove.devices.tactiles
    pins = glove.devices.plant("tactiles").truth()["latched"]
    return tuple(site for site, state in zip(array.sites, pins, strict=True) if state == "on")


def warm(glove, site: str) -> None:
    """Contacts and releases until heat denies the next contact; the pin is in."""
    while True:
        glove.contact(site)
        glove.advance(0.03)
        if any(result.reason == "heat" for result in glove.results()):
            return
        glove.release(site)
        glove.advance(0.03)


def test_a_contact_denied_while_its_release_waits_strands_no_pin(glove):
    """The touch flickers on a coil near its limit, and the current is taken: the release waits, the next contact is denied."""
    glove.arm()
    warm(glove, "index_tip")
    for _ in range(60):
        glove.advance(0.05)
        glove.contact("index_tip")
        glove.advance(0.03)
        if glove.results()[-1].played:
            break
    assert latched(glove) == ("index_tip",)
    others = ("thumb_tip", "middle_tip", "ring_tip")
    for site in others:
        glove.contact(site)
    glove.advance(0.002)
    glove.release("index_tip")
    glove.advance(0.001)
    glove.contact("index_tip")
    glove.advance(0.1)
    said = [(one.kind, one.reason) for one in glove.results() if one.site == "index_tip"]
    assert said == [("release", None), ("contact", "heat")]
    assert glove.state().pins_out == latched(glove) == others


def refuse(glove, reason: str) -> list[str]:
    """The board refuses the next pulse command for this reason; returns the commands that were refused."""
    link = glove.devices.links["tactiles"]
    send, refused = link.send, []

    def refusing(name, *values, now_ns):
        pending = send(name, *values, now_ns=now_ns) if name != "pulse" or refused else None
        if pending is None:
            pending = Pending(name)
            refused.append(name)
            if reason == "unknown":
                pending.fail(LinkError("here", "no reply"))
            else:
                pending.answer(Status[reason.upper()], 0x7FFF if reason == "hot" else 0, None)  # hot: which coils
        return pending

    link.send = refusing
    return refused


@pytest.mark.parametrize("reason", ["late", "full", "unknown"])
def test_a_release_that_the_board_did_not_carry_out_is_tried_again(glove, reason):
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.1)
    refused = refuse(glove, reason)
    glove.release("index_tip")
    glove.advance(0.1)
    assert refused
    assert [one.reason for one in glove.results() if one.kind == "release"] == [reason, None]
    assert glove.state().pins_out == latched(glove) == ()


@pytest.mark.parametrize("reason", ["late", "bad_value", "unknown"])
def test_a_pin_whose_release_was_refused_is_out_and_what_is_not_wanted_is_not_tried_again(glove, reason):
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.1)
    refuse(glove, reason)
    glove.release("index_tip")
    glove.advance(0.0005)
    glove.devices.tactiles._pins[1].wanted_out = True  # a hand that came back; its contact is denied
    glove.advance(0.1)
    assert glove.state().pins_out == latched(glove) == ("index_tip",)
    glove.release("index_tip")
    glove.advance(0.1)
    assert glove.state().pins_out == latched(glove) == ()


def test_a_pin_whose_contact_was_refused_is_in(glove):
    glove.arm()
    refuse(glove, "bad_value")
    glove.contact("index_tip")
    glove.advance(0.1)
    assert [one.reason for one in glove.results()] == ["bad_value"]
    assert glove.state().pins_out == latched(glove) == ()


def test_a_release_that_would_be_tried_again_is_not_once_the_board_was_off(glove):
    """A hot coil's release is tried again after 250 ms; the next arming, sooner than that, withdraws pins once and for all."""
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.1)
    refused = refuse(glove, "hot")
    glove.release("index_tip")
    array = glove.devices.tactiles
    while not array._again:
        array.tick(glove.devices.now_ns())
        glove.devices.follow(glove.devices.now_ns() + MS)
    assert refused
    for link in glove.devices.links.values():
        link.stop(glove.devices.now_ns())
    glove.devices.follow(glove.devices.now_ns() + 20 * MS)
    assert array.idle
    glove.arm()
    assert latched(glove) == ()
    energy_j = sum(glove.devices.plant("tactiles").truth()["energy_j"])
    glove.advance(0.4)
    assert sum(glove.devices.plant("tactiles").truth()["energy_j"]) == energy_j


def test_a_pin_that_arming_could_not_bring_in_is_brought_in_before_its_next_pulse(glove, told):
    refuse(glove, "bad_value")  # the first stroke of arming
    glove.arm()
    assert glove.state().pins_out == ("thumb_tip", "index_tip", "middle_tip")  # as many as the current allows at once
    assert glove.state().notes == ("tactiles: arming could not withdraw thumb_tip, index_tip, middle_tip yet; they may be out",)
    told.results()
    glove.pulse("index_tip", count=3, rate_hz=20)
    glove.advance(0.3)
    said = [(one.kind, one.played, one.owner) for one in told.results()]
    assert said == [("release", True, ""), *[("pulse", True, "program")] * 3]
    assert glove.state().pins_out == ("thumb_tip", "middle_tip")
    glove.release("thumb_tip")
    glove.release("middle_tip")
    glove.advance(0.1)
    assert glove.state().pins_out == latched(glove) == ()


def test_a_stroke_whose_answer_is_waited_for_no_longer_is_in_doubt(glove):
    """The board disarmed itself before it said what became of the stroke."""
    glove.arm()
    glove.advance(0.1)  # what arming did is sure
    link = glove.devices.links["tactiles"]
    send = link.send
    link.send = lambda name, *values, now_ns: Pending(name) if name == "pulse" else send(name, *values, now_ns=now_ns)
    glove.contact("index_tip")
    glove.advance(0.01)
    assert glove.results() == []
    link.send = send
    glove.devices.plant("tactiles").board._stop(None)
    glove.advance(0.06)
    assert [(one.kind, one.played, one.reason) for one in glove.results()] == [("contact", False, "unknown")]
    assert glove.state().pins_out == ("index_tip",)  # it may be


def test_a_contact_that_waits_is_given_up_with_its_release_and_no_coil_is_heated(glove):
    glove.arm()
    sites = glove.devices.tactiles.sites
    for site in sites:
        glove.contact(site)
    glove.advance(0.004)  # three play
    for site in sites:
        glove.release(site)
    glove.advance(0.2)
    counted = Counter((one.kind, one.reason) for one in glove.results())
    assert counted == {("contact", None): 3, ("contact", "superseded"): 12, ("release", None): 3}
    assert latched(glove) == ()


def test_contacts_and_releases_in_turns_every_5_ms_on_all_channels_play_both(glove, told):
    """100 Hz on fifteen coils, of which three may be on: far more than can play. No release waits longer than its bound."""
    glove.arm()
    asked_ns: dict[str, int] = {}
    worst_ns, played = 0, Counter()
    for turn in range(400):
        now_ns = glove.devices.now_ns()
        for site in glove.devices.tactiles.sites:
            if turn % 2:
                if glove.devices.tactiles.release(site, now_ns):
                    asked_ns[site] = now_ns
            else:
                glove.contact(site)
        glove.advance(0.005)
        for one in told.results():
            played[one.kind] += one.played
            if one.kind == "release":
                assert one.played
                worst_ns = max(worst_ns, one.start_ns - one.requested_ns)
    assert played["contact"] > 100
    assert played["release"] >= played["contact"] - 15
    bound_s = 0.003 + 0.010 + latency_bound_s(3, unit_s=0.0101, blocker_s=0.0101 + 0.003)  # lead, own coil, and the bound
    assert worst_ns <= bound_s * NS_PER_S


@pytest.mark.slow
@pytest.mark.parametrize("line", ["", "&faults=corrupt=0.01,drop=0.003"])
@pytest.mark.parametrize("seed", range(4))
def test_whatever_was_asked_pins_are_believed_where_they_are_and_come_back(seed: int, line: str):
    rng = random.Random(seed)
    with open_glove(tactiles=f"sim://tactiles?spread=0{line}", clock="virtual", seed=seed + 1) as glove:
        glove.arm()
        sites = rng.sample(glove.devices.tactiles.sites, rng.choice([2, 6, 15]))
        for _ in range(250):
            site, ask = rng.choice(sites), rng.random()
            if ask < 0.45:
                glove.contact(site)
            elif ask < 0.9:
                glove.release(site)
            elif ask < 0.95:
                glove.pulse(site, count=3)
            else:
                glove.advance(0.3)
            glove.advance(rng.choice([0.0, 0.001, 0.004, 0.02]))
        glove.advance(0.5)
        if line:
            assert set(latched(glove)) <= set(glove.state().pins_out)  # a pin in doubt counts as out
        else:
            assert glove.state().pins_out == latched(glove)
        for site in sites:
            glove.release(site)
        glove.advance(0.7)
        assert glove.state().pins_out == latched(glove) == ()


def test_a_pin_nobody_knows_of_is_worth_either_stroke():
    pin = Pin()
    pin.ask(0, True)
    assert pin.heading is True
    pin.settle(0, None, 10)
    assert pin.out is None
    assert pin.heading is None
    pin.ask(1, False)
    pin.settle(1, True, 20)
    assert pin.out is False


def test_answers_out_of_order_do_not_turn_time_round():
    pin = Pin()
    pin.ask(0, True)
    pin.ask(1, False)
    pin.settle(1, True, 20)
    pin.settle(0, True, 10)
    assert pin.out is False


def test_strokes_before_a_doubt_stay_sure():
    pin = Pin()
    pin.ask(0, True)
    pin.settle(0, True, 10)
    pin.doubt(10)
    assert pin.out is True
    pin.doubt(9)
    assert pin.out is None

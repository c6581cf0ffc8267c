"""Several owners of one glove: what each wants, for how long, and what the plants do when they disagree."""

from __future__ import annotations

import math

import pytest

from haptics.devices.sharing import LEASE_NS
from haptics.errors import InputError
from haptics.time import NS_PER_S

LEASE_S = LEASE_NS / NS_PER_S


def out(glove) -> tuple[str, ...]:
    """Sites whose pins are out, by the plant."""
    latched = glove.devices.plant("tactiles").truth()["latched"]
    return tuple(site for site, state in zip(glove.devices.tactiles.sites, latched, strict=True) if state == "on")


def amplitude_v(glove, output: int = 0) -> float:
    """Highest volts at an output over more than half a period of its square wave, by the plant."""
    highest_v = 0.0
    for _ in range(15):
        glove.advance(0.001)
        highest_v = max(highest_v, abs(glove.devices.plant("brake").truth()["volts"][output]))
    return highest_v


def renewed(glove, seconds: float, *shares) -> None:
    """Let time pass while the owners of these shares are there."""
    for _ in range(round(seconds / 0.01)):
        for share in shares:
            share.tick(glove.now_ns())
        glove.advance(0.01)


@pytest.fixture
def pins(glove):
    """The array as a scene and as a client have it; armed."""
    glove.arm()
    return glove.devices.share_tactiles("scene"), glove.devices.share_tactiles("client")


@pytest.fixture
def brakes(glove):
    """The brakes as a scene and as the program have them; armed."""
    glove.arm()
    return glove.devices.share_brakes("scene"), glove.devices.share_brakes("program")


def test_the_same_name_gives_the_same_share(glove):
    for share in (glove.devices.share_tactiles, glove.devices.share_brakes):
        assert share("a") is share("a") is not share("b")


# Pins


def test_a_pin_is_out_while_anybody_wants_it_out(glove, pins):
    scene, client = pins
    for share in pins:
        share.contact("index_tip", glove.now_ns())
    renewed(glove, 0.1, *pins)
    assert not scene.release("index_tip", glove.now_ns())
    renewed(glove, 0.1, *pins)
    assert out(glove) == ("index_tip",)
    assert client.release("index_tip", glove.now_ns())
    renewed(glove, 0.1, *pins)
    assert out(glove) == ()


def test_all_that_one_owner_holds_is_let_go_of_and_nothing_else(glove, pins):
    scene, client = pins
    for share, sites in ((scene, ("thumb_tip", "index_tip")), (client, ("index_tip", "ring_tip"))):
        for site in sites:
            share.contact(site, glove.now_ns())
    renewed(glove, 0.1, *pins)
    assert out(glove) == ("thumb_tip", "index_tip", "ring_tip")
    scene.release_all(glove.now_ns())
    renewed(glove, 0.1, *pins)
    assert out(glove) == ("index_tip", "ring_tip")


def test_a_pin_whose_owner_no_longer_renews_goes_back_and_what_others_want_stays(glove, pins):
    scene, client = pins
    scene.contact("thumb_tip", glove.now_ns())
    scene.contact("index_tip", glove.now_ns())
    client.contact("index_tip", glove.now_ns())
    renewed(glove, 0.5, *pins)
    assert out(glove) == ("thumb_tip", "index_tip")
    renewed(glove, LEASE_S - 0.02, client)
    assert out(glove) == ("thumb_tip", "index_tip")
    renewed(glove, 0.06, client)
    assert out(glove) == ("index_tip",)
    glove.advance(LEASE_S + 0.05)
    assert out(glove) == ()


def test_a_pin_asked_for_a_while_goes_back_by_itself_and_later_if_it_is_asked_for_again(glove, pins):
    _, client = pins
    client.contact("index_tip", glove.now_ns(), ttl_s=0.3)
    glove.advance(0.28)
    client.contact("index_tip", glove.now_ns(), ttl_s=0.3)
    glove.advance(0.29)
    assert out(glove) == ("index_tip",)
    glove.advance(0.05)
    assert out(glove) == ()


def test_a_glove_takes_back_what_its_program_asked_for_a_while(glove):
    glove.arm()
    glove.contact("index_tip", ttl_s=0.5)
    glove.contact("thumb_tip")
    glove.advance(0.49)
    assert out(glove) == ("thumb_tip", "index_tip")
    glove.advance(0.05)
    assert out(glove) == ("thumb_tip",)
    glove.advance(59.0)
    assert out(glove) == ("thumb_tip",)
    glove.advance(0.6)
    assert out(glove) == ()


def test_results_name_who_asked(glove, told, pins):
    scene, client = pins
    told.results()
    scene.contact("thumb_tip", glove.now_ns())
    client.pulse("index_tip", glove.now_ns())
    client.burst("ring_tip", 2, glove.now_ns())
    scene.train("middle_tip", 2, 20_000_000, glove.now_ns())
    client.miss("middle_tip", glove.now_ns())
    renewed(glove, 0.1, *pins)
    said = sorted((one.owner, one.site, one.kind, one.played) for one in told.results())
    assert said == [
        ("client", "index_tip", "pulse", True),
        ("client", "middle_tip", "pulse", False),
        ("client", "ring_tip", "burst", True),
        ("scene", "middle_tip", "pulse", True),
        ("scene", "middle_tip", "pulse", True),
        ("scene", "thumb_tip", "contact", True),
    ]


def test_what_was_asked_for_unarmed_is_denied_and_holds_nothing_after_the_next_arming(glove, told):
    client, scene = glove.devices.share_tactiles("client"), glove.devices.share_tactiles("scene")
    client.contact("index_tip", glove.now_ns(), ttl_s=0.1)
    glove.advance(0.2)
    assert [(one.owner, one.kind, one.reason) for one in told.results()] == [("client", "contact", "unarmed")]
    client.contact("index_tip", glove.now_ns(), ttl_s=60.0)
    glove.arm()
    scene.contact("index_tip", glove.now_ns())
    renewed(glove, 0.1, scene)
    assert scene.release("index_tip", glove.now_ns())
    renewed(glove, 0.1, scene)
    assert out(glove) == ()


def stopped(glove) -> None:
    """Both boards are stopped by somebody else."""
    for name in glove.devices.links:
        glove.devices.plant(name).board._stop(None)
    glove.advance(0.6)
    assert glove.state().armed == ()


def test_what_was_wanted_before_a_disarm_holds_nothing_after_the_next_arming(glove, pins):
    scene, client = pins
    client.contact("index_tip", glove.now_ns(), ttl_s=60.0)
    glove.advance(0.1)
    stopped(glove)
    glove.arm()
    assert out(glove) == ()
    scene.contact("index_tip", glove.now_ns())
    renewed(glove, 0.1, scene)
    assert scene.release("index_tip", glove.now_ns())
    renewed(glove, 0.1, scene)
    assert out(glove) == ()


@pytest.mark.parametrize("ttl_s", [0, -1.0, 60.1, math.nan, math.inf, "soon", 10**400])
def test_a_time_that_cannot_be_is_refused_and_asks_for_nothing(glove, pins, brakes, ttl_s):
    with pytest.raises(InputError, match=r"ttl_s = .* 0\.001 to 60 s"):
        pins[0].contact("index_tip", glove.now_ns(), ttl_s=ttl_s)
    with pytest.raises(InputError, match=r"ttl_s = .* 0\.001 to 60 s"):
        brakes[0].engage("index", 500.0, glove.now_ns(), ttl_s=ttl_s)
    glove.advance(0.1)
    assert out(glove) == ()
    assert amplitude_v(glove) < 1.0


def test_what_is_not_there_is_named(glove, pins, brakes):
    for ask in (pins[0].contact, pins[0].release, pins[0].pulse):
        with pytest.raises(InputError, match=r"site = 'elbow' has no tactor; allowed: thumb_tip"):
            ask("elbow", glove.now_ns())
    with pytest.raises(InputError, match=r"'ankle' is unknown"):
        brakes[0].engage("ankle", 100.0, glove.now_ns())
    with pytest.raises(InputError, match=r"'ankle' is unknown; this glove has: index, thumb"):
        brakes[0].release("ankle", glove.now_ns())
    for wrong in ({"amplitude_v": 1501.0}, {"amplitude_v": math.nan}, {"amplitude_v": 100.0, "frequency_hz": 0.0}):
        with pytest.raises(InputError, match=r"amplitude_v|frequency_hz"):
            brakes[0].engage("index", now_ns=glove.now_ns(), **wrong)
    assert brakes[0].engaged() == {}


# Brakes


def test_the_program_goes_before_the_scene_and_the_scene_comes_back_after_it(glove, told, brakes):
    scene, program = brakes
    told.results()
    scene.engage("index", 800.0, glove.now_ns())
    renewed(glove, 0.1, *brakes)
    program.engage("index", 400.0, glove.now_ns())
    renewed(glove, 0.1, *brakes)
    assert amplitude_v(glove) == pytest.approx(400, rel=0.02)
    scene.engage("index", 900.0, glove.now_ns())
    renewed(glove, 0.1, *brakes)
    assert amplitude_v(glove) == pytest.approx(400, rel=0.02)
    assert [(one.owner, one.reason) for one in told.results()] == [("scene", None), ("program", None), ("scene", "outranked")]
    program.release("index", glove.now_ns())
    renewed(glove, 0.1, *brakes)
    assert amplitude_v(glove) == pytest.approx(900, rel=0.02)
    assert [(one.owner, one.played) for one in told.results()] == [("scene", True)]


def test_of_two_of_one_rank_the_stronger_has_the_brake(glove, told):
    glove.arm()
    first, second = glove.devices.share_brakes("a"), glove.devices.share_brakes("b")
    told.results()
    first.engage("index", 500.0, glove.now_ns())
    second.engage("index", 300.0, glove.now_ns())
    renewed(glove, 0.1, first, second)
    assert amplitude_v(glove) == pytest.approx(500, rel=0.02)
    second.engage("index", 700.0, glove.now_ns())
    renewed(glove, 0.1, first, second)
    assert amplitude_v(glove) == pytest.approx(700, rel=0.02)
    second.engage("index", 200.0, glove.now_ns())  # now the other one is the stronger again
    renewed(glove, 0.1, first, second)
    assert amplitude_v(glove) == pytest.approx(500, rel=0.02)
    said = sorted((one.owner, one.reason or "") for one in told.results())
    assert said == [("a", ""), ("a", ""), ("b", ""), ("b", "outranked"), ("b", "outranked")]


def test_one_owners_release_leaves_the_others_brake(glove, brakes):
    scene, program = brakes
    for share in brakes:
        share.engage("index", 600.0, glove.now_ns())
    scene.engage("thumb", 600.0, glove.now_ns())
    renewed(glove, 0.1, *brakes)
    scene.release_all(glove.now_ns())
    renewed(glove, 0.1, *brakes)
    assert amplitude_v(glove, 0) == pytest.approx(600, rel=0.02)
    assert amplitude_v(glove, 1) < 60
    assert (scene.engaged(), program.engaged()) == ({}, {"index": 600.0})


def test_a_brake_whose_owner_no_longer_renews_opens(glove, brakes):
    scene, program = brakes
    scene.engage("index", 600.0, glove.now_ns())
    program.engage("thumb", 600.0, glove.now_ns(), ttl_s=1.0)
    renewed(glove, 0.5, scene)
    assert amplitude_v(glove, 0) == pytest.approx(600, rel=0.02)
    glove.advance(LEASE_S)
    assert amplitude_v(glove, 0) < 60
    assert amplitude_v(glove, 1) == pytest.approx(600, rel=0.02)
    glove.advance(0.3)
    assert amplitude_v(glove, 1) < 60


def test_a_brake_held_before_a_disarm_does_not_come_back_as_somebody_lets_go_after_the_next_arming(glove, brakes):
    scene, program = brakes
    program.engage("index", 800.0, glove.now_ns(), ttl_s=60.0)
    glove.advance(0.1)
    stopped(glove)
    glove.arm()
    assert program.engaged() == {}
    scene.engage("index", 300.0, glove.now_ns())
    renewed(glove, 0.1, scene)
    assert amplitude_v(glove) == pytest.approx(300, rel=0.02)
    scene.release("index", glove.now_ns())
    renewed(glove, 0.1, scene)
    assert amplitude_v(glove) < 60


def test_a_glove_that_goes_off_refuses_what_is_new_and_says_so(glove, told, pins):
    scene, _ = pins
    brake = glove.devices.share_brakes("scene")
    scene.contact("thumb_tip", glove.now_ns())
    brake.engage("index", 600.0, glove.now_ns())
    renewed(glove, 0.1, scene, brake)
    told.results()
    off = glove.devices.begin("off")
    assert not off.done
    scene.contact("index_tip", glove.now_ns())
    scene.pulse("ring_tip", glove.now_ns())
    brake.engage("thumb", 900.0, glove.now_ns())
    brake.piezo(["thumb"], 0.1, glove.now_ns())
    said = {(one.kind, one.site): one.reason for one in told.results() if not one.played}
    assert said == {
        ("contact", "index_tip"): "ended",
        ("pulse", "ring_tip"): "ended",
        ("brake", "thumb"): "ended",
        ("piezo", "thumb"): "ended",
    }
    glove.devices.finish(off)
    glove.advance(0.1)
    assert out(glove) == ()
    assert amplitude_v(glove, 1) < 60

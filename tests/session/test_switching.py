"""Arming, going off and clearing, step by step: what hosts before left behind, what fails, and what goes on meanwhile."""

from __future__ import annotations

import itertools
import threading

import pytest

import haptics
from firmware_models import world as worlds
from haptics.errors import HapticsError
from haptics.link.messages import State
from haptics.session.glove import Glove
from haptics.time import NS_PER_MS

_names = itertools.count()
BOARDS = ("tactiles", "brake")


def host(name: str) -> Glove:
    tactiles, brake = (f"sim://{board}?world={name}&spread=0" for board in BOARDS)
    return haptics.open(tactiles=tactiles, brake=brake, clock="virtual")


def killed(glove: Glove) -> None:
    """As by kill -9: nothing is said, the ports are free."""
    for link in glove.devices.links.values():
        link.close()


@pytest.fixture
def glove():
    with haptics.open(tactiles="sim://tactiles?spread=0", brake="sim://brake?spread=0", clock="virtual") as opened:
        yield opened


def plant(glove: Glove, board: str) -> dict:
    simulated = glove.devices.plant(board)
    assert simulated is not None
    return simulated.truth()


def states(glove: Glove) -> list[int]:
    return [plant(glove, board)["state"] for board in BOARDS]


def highest_v(glove: Glove) -> float:
    return max(map(abs, plant(glove, "brake")["volts"]))


# What hosts before left behind


def test_pins_that_an_earlier_host_left_out_are_withdrawn_by_arming(world):
    name, entered = world
    first = host(name)
    first.arm()
    for site in ("index_tip", "palm_outer"):
        first.contact(site)
    first.advance(0.1)
    killed(first)
    entered.advance(entered.now_ns + 300 * NS_PER_MS)
    with host(name) as second:
        assert plant(second, "tactiles")["latched"].count("on") == 2
        assert second.state().pins_out == haptics.SITES  # nobody knows of any
        second.clear()
        second.arm()
        assert plant(second, "tactiles")["latched"].count("on") == 0
        assert second.state().pins_out == ()
        assert second.results() == []  # nobody asked for it
        second.contact("index_tip")
        second.advance(0.1)
        assert second.state().pins_out == ("index_tip",)


def test_arming_withdraws_no_more_pins_at_once_than_the_supply_feeds_and_again_only_those_in_doubt(glove):
    most = 0
    arming = glove.begin_arming()
    while not arming.done:
        glove.advance(0.001)
        most = max(most, sum(plant(glove, "tactiles")["coils_on"]))
    assert arming.error is None
    assert most == 3  # 12 A over 3.9 A a coil
    assert min(plant(glove, "tactiles")["energy_j"]) > 0.1
    glove.advance(0.1)
    glove.off()
    energy_j = plant(glove, "tactiles")["energy_j"]
    glove.arm()
    assert plant(glove, "tactiles")["energy_j"] == energy_j


def found_holding(phase_ms: int) -> set[str]:
    """What a host says of the brakes of the host before, which was killed at some phase of telemetry while it held one."""
    name = f"held-{next(_names)}"
    entered = worlds.enter(name, "virtual")
    try:
        first = host(name)
        first.arm()
        first.brake("thumb", volts=600.0, ttl_s=5.0)
        first.advance(0.1 + phase_ms / 1000)
        assert max(plant(first, "brake")["amplitude_v"]) > 500
        killed(first)
        with host(name) as second:
            assert highest_v(second) < 60
            second.advance(0.1)
            assert highest_v(second) < 60
            assert second.state().armed == ()
            return {note for note in second.state().notes if note.startswith("brake")}
    finally:
        worlds.leave(name, entered)


def test_brakes_that_an_earlier_host_still_held_are_let_go_of_and_told():
    """Telemetry comes each 20 ms: where it comes before the board is stopped, the volts are told, too."""
    stopped = "brake: it was still armed by an earlier host when this one came; it was stopped"
    held = "brake: found holding 600 V at output 1 for an earlier host"
    told = [found_holding(phase_ms) for phase_ms in range(0, 20, 2)]
    assert all(stopped in notes and notes <= {stopped, held} for notes in told)
    assert any(held in notes for notes in told)


def test_a_fault_that_latched_before_is_told_and_cleared_only_when_asked(world):
    name, entered = world
    first = host(name)
    first.arm()
    killed(first)
    entered.advance(entered.now_ns + 300 * NS_PER_MS)
    with host(name) as second:
        second.advance(0.05)
        for board in BOARDS:
            assert any(note.startswith(f"{board}: found with a latched fault: dead_man") for note in second.state().notes)
        with pytest.raises(HapticsError, match=r"a fault is latched: dead_man; .*clear\(\)"):
            second.arm()
        assert second.clear() == {}
        second.arm()
        assert set(second.state().armed) == set(BOARDS)


# Clearing


def test_what_cannot_be_cleared_is_named_and_clears_once_its_cause_is_gone(glove):
    supply = glove.devices.plant("tactiles")
    glove.arm()
    supply.set_load(0, supply_v=2.5)
    glove.advance(0.1)
    glove.devices.off()
    assert glove.clear() == {"tactiles": ("supply",)}
    with pytest.raises(HapticsError, match="a fault is latched: supply"):
        glove.arm()
    supply.set_load(0, supply_v=5.0)
    assert glove.clear() == {}
    glove.arm()
    assert set(glove.state().armed) == set(BOARDS)


def test_an_armed_glove_is_not_cleared(glove):
    glove.arm()
    with pytest.raises(HapticsError, match=r"tactiles and brake: armed; .*off\(\) first"):
        glove.clear()
    assert set(glove.state().armed) == set(BOARDS)


# Arming that fails, or is ended


def test_an_arming_that_fails_leaves_everything_off(glove):
    glove.devices.plant("brake").set_load(0, lid_open=1)
    glove.advance(0.1)
    arming = glove.begin_arming()
    glove.advance(2.0)
    assert arming.done
    assert "brake" in str(arming.error)
    assert "interlock" in str(arming.error)
    assert states(glove) == [State.DISARMED] * 2
    assert not any(link.armed for link in glove.devices.links.values())
    assert sum(plant(glove, "tactiles")["energy_j"]) == 0.0
    glove.contact("index_tip")
    assert [one.reason for one in glove.results()] == ["unarmed"]


@pytest.mark.parametrize("after_ms", [0, 3, 10, 25, 40, 60])
def test_off_ends_an_arming_that_is_under_way_whatever_it_waits_for(glove, after_ms):
    arming = glove.begin_arming()
    glove.advance(after_ms / 1000)
    assert not arming.done
    assert glove.devices.doing == "arm"
    glove.off()
    assert arming.done
    assert "arm was given up" in str(arming.error)
    energy_j = sum(plant(glove, "tactiles")["energy_j"])
    glove.advance(1.0)
    assert states(glove) == [State.DISARMED] * 2
    assert glove.state().armed == ()
    assert sum(plant(glove, "tactiles")["energy_j"]) == energy_j
    assert highest_v(glove) < 1.0
    glove.arm()
    assert set(glove.state().armed) == set(BOARDS)


@pytest.mark.parametrize("after", [1, 10, 30, 60])
def test_who_interrupts_an_arming_leaves_the_boards_off(glove, monkeypatch, after):
    follow, left = glove.devices.follow, [after]

    def interrupted(to_ns: int) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt
        follow(to_ns)

    monkeypatch.setattr(glove.devices, "follow", interrupted)
    with pytest.raises(KeyboardInterrupt):
        glove.devices.arm()
    glove.advance(0.1)
    assert not any(link.armed for link in glove.devices.links.values())
    assert states(glove) == [State.DISARMED] * 2


def test_who_asks_to_go_off_while_it_does_ends_nothing_but_an_arming_to_come(glove):
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.1)
    begun = [glove.devices.begin(kind) for kind in ("off", "clear", "arm")]
    glove.advance(0.005)
    assert glove.devices.begin("off") is begun[0]
    glove.advance(2.0)
    assert [one.done for one in begun] == [True] * 3
    assert [one.error is None for one in begun] == [True, True, False]
    assert states(glove) == [State.DISARMED] * 2
    assert glove.state().pins_out == ()


def test_faults_are_not_cleared_while_a_glove_arms(glove):
    arming = glove.begin_arming()
    with pytest.raises(HapticsError, match="the glove is arming"):
        glove.clear()
    glove.devices.begin("clear")
    glove.advance(0.2)
    assert arming.done
    assert set(glove.state().armed) == set(BOARDS)
    assert glove.state().faults == ()


def test_who_asks_twice_has_one_arming(glove):
    assert glove.begin_arming() is glove.begin_arming()
    glove.arm()
    assert glove.devices.times_armed == 1


# Meanwhile


def test_while_a_glove_arms_time_and_its_session_go_on(glove):
    session = haptics.Session(haptics.load_scene("desk").placed((0.0, 0.0, 0.0)), glove)
    session.begin()
    ticks: list[int] = []
    tick = session.loop.tick

    def counted(now_ns: int) -> None:
        ticks.append(now_ns)
        tick(now_ns)

    session.loop.tick = counted
    arming, begun_ns = glove.begin_arming(), glove.now_ns()
    while not arming.done:
        glove.advance(0.001)
    lasted_ms = (glove.now_ns() - begun_ns) / NS_PER_MS
    assert lasted_ms > 50  # five rounds of 10 ms for 15 pins of which three move at once
    assert len(ticks) == pytest.approx(lasted_ms, abs=1)


def test_in_real_time_calls_of_other_threads_are_answered_while_a_glove_arms():
    with haptics.open(clock="real") as glove:
        ended = threading.Event()

        def arm() -> None:
            try:
                glove.arm()
            finally:
                ended.set()

        thread = threading.Thread(target=arm)
        seen: list[str | None] = []
        ticked: list[str | None] = []
        tick = glove.devices.tick

        def noted(now_ns: int) -> None:
            ticked.append(glove.devices.doing)
            tick(now_ns)

        glove.devices.tick = noted
        thread.start()
        while not ended.wait(0.001):
            with glove.turn(missed_allowed=True) as devices:
                seen.append(devices.doing)
        thread.join()
        assert "arm" in seen
        assert "arm" in ticked


def test_a_pin_that_somebody_wants_out_while_others_are_withdrawn_is_not_called_stuck(glove):
    arming = glove.begin_arming()
    while not glove.state().armed or not glove.devices.tactiles.armed:
        glove.advance(0.001)
    assert not arming.done
    glove.contact("palm_outer")
    while not arming.done:
        glove.advance(0.001)
    glove.advance(0.05)
    assert glove.state().pins_out == ("palm_outer",)
    assert glove.state().notes == ()


def test_clearing_under_way_goes_on_once_the_glove_went_off_again(glove):
    clearing = glove.devices.begin("clear")
    off = glove.devices.begin("off")
    assert not clearing.done
    glove.devices.finish(off)
    glove.devices.finish(clearing)  # raises what it failed with


def test_off_from_many_threads_at_once_ends_in_each_of_them():
    failed: list[BaseException] = []

    def turn_off(glove: Glove) -> None:
        try:
            for _ in range(10):
                glove.off()
        except HapticsError as error:
            failed.append(error)

    with haptics.open(tactiles="sim://tactiles", brake="sim://brake") as glove:
        threads = [threading.Thread(target=turn_off, args=(glove,)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30.0)
    assert failed == []


@pytest.mark.parametrize(("before", "after"), [(["tactiles"], BOARDS), (BOARDS, ["tactiles"])])
def test_what_is_needed_may_change_while_the_glove_arms(glove, before, after):
    glove.devices.need(before)
    arming = glove.begin_arming()
    glove.advance(0.001)
    assert not arming.done
    glove.devices.need(after)
    glove.advance(1.0)
    assert arming.done
    assert arming.error is None
    assert glove.state().armed == ("tactiles",)  # of those needed now, what the arming had begun with
    assert states(glove)[1] == State.DISARMED

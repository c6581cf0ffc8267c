"""Intent never outlives permission: however a board came to be disarmed, armed again it does nothing that nobody asked for since.

Judged by the plants: no volts, no piezo, no coil energy, no pin that moves.
"""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
from cores import on_every_core

import haptics as product
from haptics.devices.sharing import PROGRAM
from haptics.errors import HapticsError, LinkLost
from haptics.link.framing import encode_frame
from haptics.link.messages import BY_NAME, State
from haptics.session.glove import Glove
from haptics.time import NS_PER_MS

CLEAR_S = 0.6
"""After it a brake is discharged, its clutch of restarts waited for, a board booted."""
WATCHED_S = 1.2
"""Longer than a board accepts a start ahead (1 s)."""


class Truth:
    """What both plants do from now on."""

    def __init__(self, glove: Glove):
        self.glove = glove
        self.boards = {name: glove.devices.plant(name) for name in glove.devices.links}
        self.energy_j, self.latched, self.switches = self._coils()

    def _coils(self) -> tuple[float, list[str], list[int]]:
        truth = self.boards["tactiles"].truth()
        return sum(truth["energy_j"]), list(truth["latched"]), list(truth["switches"])

    def stays_quiet(self, seconds: float = WATCHED_S) -> None:
        for _ in range(round(seconds / 0.02)):
            self.glove.advance(0.02)
            brake = self.boards["brake"].truth()
            assert max(abs(volts) for volts in brake["volts"]) < 1.0
            assert not any(brake["piezo"])
        assert self._coils() == (self.energy_j, self.latched, self.switches)


def wish(glove: Glove) -> None:
    """All that one can ask for: now, for long, and for later."""
    now_ns = glove.devices.now_ns()
    array, brakes = glove.devices.tactiles, glove.devices.brakes
    assert array is not None
    assert brakes is not None
    glove.contact("thumb_tip")
    glove.pulse("palm_index", count=1000, rate_hz=20)
    array.burst("palm_ring", 10, now_ns)
    array.burst("palm_middle", 10, now_ns, at_ns=now_ns + 900 * NS_PER_MS)
    array.contact("ring_tip", now_ns, at_ns=now_ns + 700 * NS_PER_MS)
    glove.brake("index", volts=800, ttl_s=30.0)
    brakes.engage("thumb", 500, now_ns, owner=PROGRAM)
    brakes.piezo(["index"], 0.5, now_ns, at_ns=now_ns + 900 * NS_PER_MS, owner=PROGRAM)


def host_is_away(glove: Glove) -> None:
    clock = glove.devices.clock
    clock.advance_to(clock.now_ns() + 150 * NS_PER_MS)


def another_host(command: str) -> Callable[[Glove], None]:
    def act(glove: Glove) -> None:
        for link in glove.devices.links.values():
            link.port.write(encode_frame(BY_NAME[command].type, 211))

    return act


def load(board: str, **what: float) -> Callable[[Glove], None]:
    return lambda glove: glove.devices.plant(board).set_load(0, **what)


def short_a_coil(glove: Glove) -> None:
    load("tactiles", coil_short=1)(glove)
    glove.release("thumb_tip")  # that coil's next stroke


def lost(board: str) -> Callable[[Glove], None]:
    def act(glove: Glove) -> None:
        link = glove.devices.links[board]
        link.lose(LinkLost(link.name, "pulled"), glove.devices.now_ns())
        glove.advance(0.2)
        link.reopen(link.port, glove.devices.now_ns())

    return act


def disarmed(glove: Glove) -> None:
    for link in glove.devices.links.values():
        link.send("disarm", now_ns=glove.devices.now_ns())


def reboot(board: str) -> Callable[[Glove], None]:
    return lambda glove: glove.devices.plant(board).board.reset()


def failed_arming(glove: Glove) -> None:
    plant = glove.devices.plant("brake")
    assert plant is not None
    glove.devices.off()
    glove.advance(CLEAR_S)
    plant.set_load(0, leak_ohm=1.0)
    with pytest.raises(HapticsError):
        glove.arm()
    wish(glove)
    plant.set_load(0, leak_ohm=float("inf"))


WAYS: dict[str, Callable[[Glove], None]] = {
    "off": lambda glove: glove.off(),
    "disarm": disarmed,
    "stop by another host": another_host("stop"),
    "disarm by another host": another_host("disarm"),
    "dead-man": host_is_away,
    "shorted coil": short_a_coil,
    "supply of the coils": load("tactiles", supply_v=2.5),
    "brown-out of the array": load("tactiles", brown_out=1),
    "lid": load("brake", lid_open=1),
    "leak": load("brake", leak_ohm=1e3),
    "bridge": load("brake", bridge_stuck=1),
    "brown-out of the brake": load("brake", brown_out=1),
    "reboot of the array": reboot("tactiles"),
    "reboot of the brake": reboot("brake"),
    "lost array": lost("tactiles"),
    "lost brake": lost("brake"),
    "failed arming": failed_arming,
}
MENDED = {"tactiles": {"coil_short": 0, "supply_v": 5.0}, "brake": {"lid_open": 0, "leak_ohm": float("inf"), "bridge_stuck": 0}}


def hand_back(glove: Glove) -> None:
    """What a person does who has looked: mend the cause, clear what is latched."""
    glove.advance(0.3)  # a board that rebooted is known by then
    for name, link in glove.devices.links.items():
        glove.devices.plant(name).set_load(0, **MENDED[name])
        link.send("disarm", now_ns=glove.devices.now_ns())
    glove.advance(CLEAR_S)


@pytest.fixture
def glove(core: str):
    with product.open(tactiles=f"sim://tactiles?core={core}", brake=f"sim://brake?core={core}", clock="virtual") as opened:
        opened.advance(0.1)
        yield opened


@on_every_core
@pytest.mark.parametrize("way", WAYS)
def test_armed_again_with_no_call_nothing_is_energised_and_no_pin_moves(glove: Glove, way: str):
    glove.contact("index_tip")  # before the first arming
    glove.arm()
    glove.contact("middle_tip")
    glove.advance(0.05)
    wish(glove)
    glove.advance(0.12)
    WAYS[way](glove)
    glove.advance(CLEAR_S)
    assert len(glove.state().armed) < 2
    hand_back(glove)
    glove.results()
    glove.arm()
    assert set(glove.state().armed) == {"tactiles", "brake"}
    Truth(glove).stays_quiet()
    assert not any(result.played for result in glove.results())


@on_every_core
def test_armed_again_while_armed_every_board_drops_what_it_was_asked_for(glove: Glove):
    glove.arm()
    wish(glove)
    glove.advance(0.12)
    glove.arm()
    Truth(glove).stays_quiet()


@on_every_core
def test_what_is_asked_for_unarmed_is_denied_at_once_and_forgotten(glove: Glove):
    wish(glove)
    denied = glove.results()
    assert {(one.played, one.reason) for one in denied} == {(False, "unarmed")}
    assert sorted(one.kind for one in denied if one.kind in ("brake", "piezo")) == ["brake", "brake", "piezo"]
    glove.arm()
    Truth(glove).stays_quiet()


@pytest.mark.parametrize("core", ["py"])
@pytest.mark.parametrize("way", [way for way in WAYS if way not in ("off", "failed arming", "dead-man")])
def test_a_board_that_is_no_longer_armed_is_asked_for_nothing_more(glove: Glove, way: str):
    glove.arm()
    glove.contact("thumb_tip")
    glove.advance(0.05)
    wish(glove)
    glove.advance(0.1)
    WAYS[way](glove)
    glove.advance(0.06)
    down = {"tactiles", "brake"} - set(glove.state().armed)
    array, brakes = glove.devices.tactiles, glove.devices.brakes
    assert down
    assert array is not None
    assert brakes is not None
    glove.results()
    glove.contact("little_tip")
    brakes.engage("index", 300, glove.devices.now_ns(), owner=PROGRAM)
    denied = {one.kind: one.reason for one in glove.results() if not one.played}
    if "tactiles" in down:
        assert array.idle
        assert denied["contact"] == "unarmed"
    if "brake" in down:
        assert denied["brake"] == "unarmed"
        assert brakes.engaged() == {}
    glove.advance(0.3)
    assert not any(one.kind in ({"tactiles": "contact", "brake": "brake"}[board] for board in down) for one in glove.results())


@pytest.mark.parametrize("core", ["py"])
@pytest.mark.parametrize("way", ["lid", "leak", "brown-out of the brake", "lost brake", "reboot of the brake"])
def test_a_fault_of_the_brake_keeps_no_pin_out_when_going_off(glove: Glove, way: str):
    glove.arm()
    glove.contact("index_tip")
    glove.brake("index", volts=800, ttl_s=30.0)
    glove.advance(0.1)
    WAYS[way](glove)
    glove.advance(0.05)
    assert glove.state().faults
    assert "tactiles" in glove.state().armed
    glove.off()
    array = glove.devices.plant("tactiles").truth()
    assert set(array["latched"]) == {"off"}
    assert array["state"] == State.DISARMED


@pytest.mark.parametrize("core", ["py"])
@pytest.mark.parametrize("way", ["supply of the coils", "brown-out of the array", "lost array"])
def test_a_fault_of_the_array_keeps_no_volts_on_when_going_off(glove: Glove, way: str):
    glove.arm()
    glove.brake("index", volts=800, ttl_s=30.0)
    glove.advance(0.1)
    WAYS[way](glove)
    glove.advance(0.05)
    assert "brake" in glove.state().armed
    glove.off()
    glove.advance(0.1)
    brake = glove.devices.plant("brake").truth()
    assert max(abs(volts) for volts in brake["volts"]) < 60.0
    assert brake["state"] == State.DISARMED


@pytest.mark.parametrize("core", ["py"])
def test_an_old_fault_is_history_and_the_next_off_withdraws_pins(glove: Glove):
    glove.arm()
    load("brake", lid_open=1)(glove)
    glove.advance(0.1)
    glove.off()
    hand_back(glove)
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.1)
    assert glove.state().faults
    glove.off()
    assert set(glove.devices.plant("tactiles").truth()["latched"]) == {"off"}


@pytest.mark.parametrize("core", ["py"])
def test_going_off_withdraws_pins_before_it_drops_volts(glove: Glove):
    glove.arm()
    glove.brake("index", volts=800, ttl_s=30.0)
    for site in ("index_tip", "thumb_tip", "middle_tip", "ring_tip"):
        glove.contact(site)
    glove.advance(0.2)
    for name in ("tactiles", "brake"):
        glove.devices.plant(name).truth()
    glove.off()
    events = {name: glove.devices.plant(name).truth()["events"] for name in ("tactiles", "brake")}
    last_pin_ns = max(event[0] for event in events["tactiles"])
    shorted_ns = min(event[0] for event in events["brake"] if event[2] == "shorted")
    assert last_pin_ns < shorted_ns


@on_every_core
def test_a_missed_dead_man_is_said_at_once_and_energy_is_gone(glove: Glove):
    glove.arm()
    glove.contact("index_tip")
    glove.brake("index", volts=800, ttl_s=30.0)
    glove.advance(0.1)
    clock = glove.devices.clock
    clock.advance_to(clock.now_ns() + 134 * NS_PER_MS)
    glove.advance(0.001)
    said = [fault for fault in glove.state().faults if "host silent for" in fault]
    assert len(said) == 2
    assert all(fault.endswith("ms; board made itself safe; arm again") for fault in said)
    assert glove.state().armed == ()
    glove.contact("thumb_tip")
    assert [result.reason for result in glove.results() if result.site == "thumb_tip"] == ["unarmed"]


@pytest.mark.parametrize("core", ["py"])
def test_a_pin_stays_believed_in_across_a_disarm_and_can_be_released_after(glove: Glove):
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.3)
    another_host("stop")(glove)
    glove.advance(CLEAR_S)
    assert glove.state().pins_out == ("index_tip",)
    glove.arm()
    glove.release("index_tip")
    glove.advance(0.1)
    assert glove.state().pins_out == ()
    assert set(glove.devices.plant("tactiles").truth()["latched"]) == {"off"}


@pytest.mark.parametrize("core", ["py"])
def test_a_stroke_that_a_board_took_and_may_not_have_played_leaves_its_pin_in_doubt(glove: Glove):
    glove.arm()
    glove.advance(0.1)  # what arming did is sure
    array, now_ns = glove.devices.tactiles, glove.devices.now_ns()
    assert array is not None
    array.contact("index_tip", now_ns, at_ns=now_ns + 10 * NS_PER_MS, owner=PROGRAM)
    glove.advance(0.0095)
    assert [result.played for result in glove.results()] == [True]  # acknowledged, not begun
    another_host("stop")(glove)
    glove.advance(CLEAR_S)
    assert set(glove.devices.plant("tactiles").truth()["latched"]) == {"off"}
    assert glove.state().pins_out == ("index_tip",), "it may be out"
    switches = glove.devices.plant("tactiles").truth()["switches"]
    glove.arm()
    assert glove.state().pins_out == ()
    assert glove.devices.plant("tactiles").truth()["switches"] == switches  # it had been in
    glove.contact("index_tip")
    glove.advance(0.1)
    assert glove.devices.plant("tactiles").truth()["latched"][1] == "on"
    glove.release("index_tip")
    glove.advance(0.1)
    assert glove.state().pins_out == ()


@pytest.mark.parametrize("core", ["py"])
def test_whoever_interrupts_going_off_leaves_the_boards_stopped(glove: Glove, monkeypatch: pytest.MonkeyPatch):
    glove.arm()
    glove.contact("index_tip")
    glove.brake("index", volts=800, ttl_s=30.0)
    glove.advance(0.1)

    def interrupted(*_: object) -> bool:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(glove.devices, "_wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            glove.off()
    glove.advance(0.3)
    assert glove.state().armed == ()
    Truth(glove).stays_quiet(0.2)


@pytest.mark.parametrize("core", ["py"])
@pytest.mark.parametrize("seed", range(5))
def test_armed_again_after_any_way_at_any_phase_nothing_is_energised(glove: Glove, seed: int):
    """The moment of the disarm falls anywhere between a wish, its command, the answer, its start and its end."""
    rng = random.Random(seed)
    ways = [way for way in WAYS if not way.startswith("lost")]
    for _ in range(4):
        glove.arm()
        wish(glove)
        glove.advance(rng.choice([0.0, 0.0005, 0.001, 0.002, 0.003, 0.004, rng.uniform(0, 0.03), rng.uniform(0, 0.9)]))
        way = rng.choice(ways)
        WAYS[way](glove)
        glove.advance(rng.choice([0.0, 0.001, 0.02, CLEAR_S]))
        if rng.random() < 0.3:
            wish(glove)
        glove.off()
        hand_back(glove)
        glove.arm()
        Truth(glove).stays_quiet(0.3)
        glove.off()
        glove.advance(CLEAR_S)


@pytest.mark.parametrize("core", ["py"])
@pytest.mark.parametrize("kind", ["pulse", "burst"])
def test_a_pin_that_is_out_because_its_pulse_was_cut_short_is_not_believed_in(glove: Glove, kind: str):
    """The board is made safe at each ms of a pulse; where the stroke back did not play, the next arming makes up for it."""
    array, plant = glove.devices.tactiles, glove.devices.plant("tactiles")
    assert array is not None
    assert plant is not None
    left_out = 0
    for after_ms in range(3, 14):
        glove.arm()
        glove.advance(0.1)  # what arming did is sure
        if kind == "pulse":
            glove.pulse("index_tip")
        else:
            array.burst("index_tip", 10, glove.devices.now_ns())
        glove.advance(after_ms / 1000)
        another_host("stop")(glove)
        glove.advance(CLEAR_S)
        out = plant.truth()["latched"][1] == "on"
        left_out += out
        assert not out or glove.state().pins_out == ("index_tip",)
        glove.arm()
        assert plant.truth()["latched"][1] == "off"
        assert glove.state().pins_out == ()
        glove.off()
    assert left_out


@pytest.mark.parametrize("seed", range(4))
def test_pulses_over_a_bad_line_leave_no_pin_out(seed: int):
    """A stroke out that a board took and a stroke back that came too late: the pin is brought in, and believed where it is."""
    url = f"sim://tactiles?level=event&seed={seed}&faults=drop=0.06,delay=0.04,delay_ms=8"
    rng = random.Random(seed)
    with product.open(tactiles=url, clock="virtual") as opened:
        opened.arm()
        array, plant = opened.devices.tactiles, opened.devices.plant("tactiles")
        assert array is not None
        assert plant is not None
        for _ in range(60):
            for site in rng.sample(array.sites, 2):
                opened.pulse(site)
            array.burst(rng.choice(array.sites), 3, opened.devices.now_ns())
            opened.advance(0.02)
        assert "late" in {result.reason for result in opened.results()}
        opened.advance(1.0)
        assert set(plant.truth()["latched"]) == {"off"}
        assert opened.state().pins_out == ()

"""What a glove does and asks for around arming and going off: on the plants, and on the wires."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import haptics
from haptics.errors import HapticsError, InputError
from haptics.link.framing import Deframer
from haptics.link.messages import BY_TYPE, State
from haptics.session.configuration import BrakeConfiguration, TactilesConfiguration
from haptics.session.devices import Devices
from haptics.session.glove import open as open_glove

MS = 1_000_000
SUPPLY_V = 5.0


class Worn(Devices):
    """A glove in virtual time whose wires are read, too."""

    def __init__(self, tactiles: str = "sim://tactiles?spread=0", brake: str = "sim://brake?spread=0"):
        self.sent: list[str] = []
        self._wires = {"tactiles": Deframer(), "brake": Deframer()}
        parts = TactilesConfiguration(port=tactiles), BrakeConfiguration(port=brake)
        super().__init__(*parts, realtime=False, wire_tap=self._hear)

    def _hear(self, name: str, time_ns: int, to_board: bool, data: bytes) -> None:
        if to_board:
            self.sent += [BY_TYPE[frame.type].name for frame in self._wires[name].feed(data)]

    def run(self, ms: float) -> None:
        self.step_to(self.now_ns() + round(ms * MS))

    def energy_j(self) -> float:
        return sum(self.plant("tactiles").truth()["energy_j"])

    def volts(self) -> float:
        return max(map(abs, self.plant("brake").truth()["volts"]))


@pytest.fixture
def glove() -> Iterator[Worn]:
    worn = Worn()
    yield worn
    worn.close()


def supply_fails(glove: Worn) -> None:
    glove.plant("tactiles").set_load(0, supply_v=0.0)
    glove.run(20)
    glove.plant("tactiles").set_load(0, supply_v=SUPPLY_V)


def reboots(glove: Worn) -> None:
    glove.plant("tactiles").set_load(0, brown_out=1)
    glove.run(600)


def is_told_to_stop(glove: Worn) -> None:
    """By somebody else on the same board."""
    glove.plant("tactiles").board._stop(None)
    glove.run(60)


def goes_off(glove: Worn) -> None:
    glove.off()


WAYS = [supply_fails, reboots, is_told_to_stop, goes_off]


@pytest.mark.parametrize("way", WAYS)
def test_nothing_is_scheduled_or_sent_for_a_board_that_is_off(glove, way):
    glove.arm()
    glove.tactiles.contact("index_tip", glove.now_ns())
    glove.run(50)
    assert glove.energy_j() > 0.1
    way(glove)
    assert glove.plant("tactiles").truth()["state"] in (State.DISARMED, State.FAULT)
    glove.tactiles.take_results()
    glove.sent.clear()
    energy_j = glove.energy_j()
    for ask in (glove.tactiles.contact, glove.tactiles.pulse):
        ask("thumb_tip", glove.now_ns())
        glove.run(20)
    assert {(result.played, result.reason) for result in glove.tactiles.take_results()} == {(False, "unarmed")}
    assert "pulse" not in glove.sent
    assert glove.energy_j() == energy_j


@pytest.mark.parametrize("way", WAYS)
def test_what_was_asked_before_a_board_was_off_does_not_play_once_it_is_armed_again(glove, way):
    glove.arm()
    glove.tactiles.train("palm_index", 50, 20 * MS, glove.now_ns())
    glove.run(100)
    way(glove)
    glove.off()
    for link in glove.links.values():
        link.send("disarm", now_ns=glove.now_ns())  # as a person does who has looked
    glove.run(30)
    glove.tactiles.take_results()
    glove.arm()
    assert {result.kind for result in glove.tactiles.take_results() if result.played} <= {"release"}  # pins that may be out
    energy_j = glove.energy_j()
    glove.run(1200)
    assert glove.energy_j() == energy_j
    assert glove.volts() < 1.0


def test_a_board_that_disarmed_by_itself_is_said_to_have(glove):
    glove.arm()
    is_told_to_stop(glove)
    assert any("disarmed by itself" in fault for fault in glove.faults)


def test_going_off_stops_every_board_and_not_only_waits_for_its_dead_man(glove):
    glove.arm()
    glove.brakes.engage("index", 900.0, glove.now_ns())
    glove.run(100)
    assert glove.volts() > 500
    glove.sent.clear()
    glove.off()
    assert glove.sent.count("stop") == 2
    states = [glove.plant(name).truth()["state"] for name in ("tactiles", "brake")]
    assert states[0] == State.DISARMED
    assert states[1] in (State.DISARMED, State.DISCHARGING)
    glove.follow(glove.now_ns() + 10 * MS)
    assert glove.volts() < 60
    assert [glove.plant(name).board.faults for name in ("tactiles", "brake")] == [0, 0]


def test_going_off_plays_nothing_of_what_was_still_to_come(glove):
    glove.arm()
    glove.tactiles.contact("index_tip", glove.now_ns())
    glove.tactiles.train("palm_index", 60, 20 * MS, glove.now_ns())
    glove.run(105)
    glove.tactiles.take_results()
    began_ns = glove.now_ns()
    glove.off()
    assert glove.now_ns() - began_ns < 60 * MS
    rest = [result for result in glove.tactiles.take_results() if result.kind == "pulse"]
    assert len(rest) > 50
    assert {result.reason for result in rest if not result.played} == {"ended"}
    assert sum(result.played for result in rest) <= 1  # what was on its way to the board


def test_who_is_interrupted_while_going_off_has_stopped_every_board(glove, monkeypatch):
    glove.arm()
    glove.tactiles.contact("index_tip", glove.now_ns())
    glove.brakes.engage("index", 900.0, glove.now_ns())
    glove.run(100)

    def interrupted(*_: object) -> bool:
        raise KeyboardInterrupt

    glove.sent.clear()
    with monkeypatch.context() as patch:
        patch.setattr(glove, "_wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            glove.off()
    glove.follow(glove.now_ns() + 20 * MS)
    assert glove.sent.count("stop") == 2
    assert glove.volts() < 60
    assert [glove.plant(name).truth()["state"] for name in ("tactiles", "brake")] == [State.DISARMED] * 2


def test_a_glove_of_which_one_board_would_not_arm_is_not_armed_at_all():
    glove = Worn(brake="sim://brake?lid_open=1")
    try:
        with pytest.raises(HapticsError):
            glove.arm()
        assert [glove.plant(name).truth()["state"] for name in ("tactiles", "brake")] == [State.DISARMED] * 2
        assert not any(link.armed for link in glove.links.values())
    finally:
        glove.close()


def test_a_board_that_fails_while_the_other_still_arms_makes_the_arming_fail():
    """At any phase of telemetry: arming either fails, or every board is armed when it is over."""
    failed = 0
    for after_ms in range(0, 20, 2):
        glove = Worn()

        def fails(name: str, event: object, glove: Worn = glove) -> None:
            if name == "tactiles" and getattr(getattr(event, "message", None), "state", None) == State.ARMED:
                glove.plant("tactiles").set_load(0, supply_v=0.0)

        try:
            glove.run(after_ms)
            glove.on_event(fails)
            glove.arm()
            assert all(link.armed for link in glove.links.values())
        except HapticsError:
            failed += 1
            assert not any(link.armed for link in glove.links.values())
        finally:
            glove.close()
    assert failed > 0


def test_arming_waits_until_the_brakes_have_been_tested():
    """Telemetry comes each 20 ms and a test takes eight, so that some of these first hear of a board that tests itself."""
    for after_ms in range(0, 20, 2):
        glove = Worn()
        try:
            glove.arm()
            glove.run(100)
            glove.off()  # every pin is known to be in: none has to be withdrawn meanwhile
            glove.run(40 + after_ms)
            glove.arm()
            assert glove.plant("brake").truth()["state"] == State.ARMED
        finally:
            glove.close()


def test_a_lost_link_forbids_and_says_so():
    glove = Worn(tactiles="sim://tactiles?spread=0&faults=unplug_s=0.8")
    try:
        glove.arm()
        assert glove.now_ns() < 700 * MS
        glove.run(900)
        assert any(fault.startswith("tactiles") for fault in glove.faults)
        glove.tactiles.take_results()
        glove.tactiles.pulse("thumb_tip", glove.now_ns())
        glove.run(10)
        assert [result.reason for result in glove.tactiles.take_results()] == ["unarmed"]
    finally:
        glove.close()


@pytest.mark.parametrize("error", [None, InputError("a script's own mistake"), KeyboardInterrupt()])
def test_a_script_ends_in_off_whatever_ended_it(error, monkeypatch):
    seen = []
    close = Devices.close
    monkeypatch.setattr(Devices, "close", lambda self: (seen.append(self.plant("brake").truth()), close(self)))

    def script() -> None:
        with open_glove(tactiles="sim://tactiles", brake="sim://brake?spread=0", clock="virtual") as glove:
            glove.arm()
            glove.brake("index", volts=900.0, ttl_s=5.0)
            glove.advance(0.1)
            if error is not None:
                raise error

    if error is None:
        script()
    else:
        with pytest.raises(type(error)):
            script()
    assert [truth["state"] for truth in seen] in ([State.DISARMED], [State.DISCHARGING])


def test_pins_are_withdrawn_before_an_arming_that_fails_for_the_other_board():
    """No board is armed after it, so that nothing could withdraw them then, off neither."""
    brake = "sim://brake?spread=0&faults=unplug_s=0.3"
    with haptics.open(tactiles="sim://tactiles?spread=0", brake=brake, clock="virtual") as glove:
        glove.arm()
        glove.contact("index_tip")
        glove.advance(0.5)
        assert glove.state().pins_out == ("index_tip",)
        with pytest.raises(HapticsError, match="the port went away"):
            glove.arm()
        assert glove.state().pins_out == ()
        assert glove.devices.plant("tactiles").truth()["latched"].count("on") == 0

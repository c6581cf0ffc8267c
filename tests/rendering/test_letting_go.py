"""A hand that is gone, a wearer's limits, clutches: what the loop lets go of, and how far it goes, on the plants."""

from __future__ import annotations

from test_loop import Stage

from haptics.session.configuration import BrakeConfiguration, Configuration


def max_v(stage: Stage) -> float:
    return max(map(abs, stage.glove.plant("brake").truth()["volts"]))


def ended(stage: Stage) -> None:
    stage.glove.off()
    stage.glove.close()


def test_a_touch_that_was_decided_for_a_hand_does_not_come_once_it_is_gone():
    """It is decided ahead: gone a millisecond before, the hand is touched by nothing any more."""
    first = Stage("playground")
    first.run(1500)
    touched_ns = next(event.time_ns for event in first.session.events if event.kind == "touch")
    ended(first)
    again = Stage("playground")
    again.run((touched_ns - first.start_ns) / 1e6 - 1)
    assert not any(again.glove.tactiles.pins_out())
    again.session.hand_gone(again.glove.now_ns())
    energy_j = sum(again.glove.plant("tactiles").truth()["energy_j"])
    again.run((touched_ns - first.start_ns) / 1e6 + 60, poses=False)
    assert "touch" not in again.kinds()
    assert sum(again.glove.plant("tactiles").truth()["energy_j"]) == energy_j
    ended(again)


def test_a_hand_that_goes_is_let_go_of_by_the_plants():
    stage = Stage("playground")
    stage.run(1500)
    assert max_v(stage) > 100
    assert "on" in stage.glove.plant("tactiles").truth()["latched"]
    stage.session.hand_gone(stage.glove.now_ns())
    stage.run(1600, poses=False)
    assert max_v(stage) < 60
    assert set(stage.glove.plant("tactiles").truth()["latched"]) == {"off"}
    ended(stage)


def test_no_grasp_closes_with_more_volts_than_the_wearer_allows():
    stage = Stage("playground", Configuration(brake=BrakeConfiguration(amplitude_v=300.0)))
    highest_v = 0.0
    for ms in range(1300, 1600, 5):
        stage.run(ms)
        highest_v = max(highest_v, max_v(stage))
    assert 250 < highest_v < 1.05 * 300
    ended(stage)


def test_no_clutch_closes_with_more_volts_than_the_wearer_allows_and_all_open_when_the_hand_is_lost():
    stage = Stage("posture", Configuration(brake=BrakeConfiguration(clutch_amplitude_v=200.0)))
    seen_v = []
    for ms in range(1500, 3000, 10):
        stage.run(ms)
        seen_v.append(max_v(stage))
        if seen_v[-1] > 150 and ms > 2000:  # the back is held
            break
    assert 150 < max(seen_v) < 1.05 * 200
    for after_ms in range(150, 500, 10):
        stage.run(ms + after_ms, poses=False)
        assert max_v(stage) < 60
    ended(stage)


def test_pins_that_a_disarm_left_out_are_withdrawn_by_the_next_arming_and_stay_in():
    """A board that stops leaves its pins where they are; the hand has opened when it is armed again."""
    stage = Stage("playground")
    stage.run(1500)
    assert "on" in stage.glove.plant("tactiles").truth()["latched"]
    stage.glove.plant("tactiles").board._stop(None)
    stage.run(2590, poses=False)
    assert "on" in stage.glove.plant("tactiles").truth()["latched"]
    stage.glove.arm()
    assert set(stage.glove.plant("tactiles").truth()["latched"]) == {"off"}
    now_ms = (stage.glove.now_ns() - stage.start_ns) / 1e6
    energy_j = sum(stage.glove.plant("tactiles").truth()["energy_j"])
    stage.run(now_ms + 20, poses=False)
    assert sum(stage.glove.plant("tactiles").truth()["energy_j"]) == energy_j  # nothing moves before there is a hand
    stage.fed = next(i for i, frame in enumerate(stage.frames) if frame.time_ns > stage.glove.now_ns())
    stage.run(now_ms + 120)
    assert set(stage.glove.plant("tactiles").truth()["latched"]) == {"off"}
    ended(stage)

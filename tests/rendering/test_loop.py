"""The loop on an open simulated glove: what poses become, and what bad or missing ones do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.fidelity import plan_scene
from haptics.recording import finalise, load
from haptics.scene import load_scene
from haptics.scene.hand_files.load import load_hand
from haptics.session.composition import open_planned
from haptics.session.configuration import Configuration
from haptics.session.recorder import Recorder
from haptics.session.session import Session
from haptics.time import NS_PER_MS

LATENCY_NS = 10 * NS_PER_MS


class Stage:
    """A session in virtual time, fed by hand."""

    def __init__(self, name: str, configuration: Configuration | None = None, record: Path | None = None):
        configuration = configuration or Configuration()
        self.recording = load_hand("synthetic")
        scene = load_scene(name).placed_for(self.recording)
        self.glove = open_planned(scene, plan_scene(scene), configuration)
        recorder = None if record is None else Recorder(record, {}, force=False)
        self.session = Session(scene, self.glove, configuration, recorder)
        self.glove.arm()
        self.start_ns = (self.glove.now_ns() // NS_PER_MS + 2) * NS_PER_MS
        self.session.begin(self.start_ns)
        self.frames = [replace(f, time_ns=f.time_ns + self.start_ns) for f in self.recording.frames("right")]
        self.fed = 0

    def run(self, to_ms: float, poses: bool = True, every_ms: int = 1) -> None:
        """Tick to ``to_ms`` after the start; with ``poses``, those whose latency has passed arrive."""
        end_ns = self.start_ns + round(to_ms * NS_PER_MS)
        while self.glove.now_ns() < end_ns:
            now_ns = max(self.start_ns, self.glove.now_ns() // NS_PER_MS * NS_PER_MS + every_ms * NS_PER_MS)
            while poses and self.fed < len(self.frames) and self.frames[self.fed].time_ns + LATENCY_NS <= now_ns:
                self.session.submit(self.frames[self.fed], now_ns)
                self.fed += 1
            self.session.tick(now_ns)

    def kinds(self) -> list[str]:
        return [event.kind for event in self.session.events]


@pytest.fixture
def playground():
    stage = Stage("playground")
    yield stage
    stage.glove.off()
    stage.glove.close()


def test_brakes_close_ahead_of_the_grasp_and_open_after_it(playground):
    playground.run(2400)
    kinds = playground.kinds()
    assert kinds.index("grasp_ahead") < kinds.index("grasp_begin") < kinds.index("grasp_end")
    assert playground.glove.brakes is not None
    assert playground.glove.brakes.engaged() == {}


def test_without_poses_everything_goes_off_after_a_tenth_of_a_second(playground):
    playground.run(1500)
    assert playground.glove.brakes.engaged()
    assert any(playground.glove.tactiles.pins_out())
    last_pose_ms = (playground.frames[playground.fed - 1].time_ns - playground.start_ns) / NS_PER_MS
    playground.run(last_pose_ms + 99, poses=False)
    assert playground.glove.brakes.engaged()
    playground.run(last_pose_ms + 112, poses=False)
    assert playground.glove.brakes.engaged() == {}
    playground.run(last_pose_ms + 300, poses=False)
    assert not any(playground.glove.tactiles.pins_out())
    truth = playground.glove.plant("brake").truth()
    assert max(abs(v) for v in truth["volts"]) < 60
    assert set(playground.glove.plant("tactiles").truth()["latched"]) == {"off"}


@pytest.mark.parametrize("ahead_ms", [-100, 0, 49])
def test_the_watchdog_goes_by_arrival_whatever_time_poses_claim_to_be_of(playground, ahead_ms):
    """Poses with the clock of a peer that is off; the last one arrives at 1.5 s."""
    playground.frames = [replace(f, time_ns=f.time_ns + ahead_ms * NS_PER_MS) for f in playground.frames]
    arrived_ms = 0.0
    for number, frame in enumerate(playground.frames[:165]):
        arrived_ms = 10 + 9.09 * number
        playground.run(arrived_ms, poses=False)
        playground.session.submit(frame, playground.glove.now_ns())
    playground.run(arrived_ms + 99, poses=False)
    assert "watchdog" not in playground.kinds()
    playground.run(arrived_ms + 103, poses=False)
    assert "watchdog" in playground.kinds()
    assert playground.glove.brakes.engaged() == {}


def test_after_the_watchdog_nothing_comes_back_while_the_hand_still_touches(playground):
    playground.run(1500)
    playground.run(1700, poses=False)
    assert "watchdog" in playground.kinds()
    playground.fed = next(i for i, f in enumerate(playground.frames) if f.time_ns > playground.start_ns + 1690 * NS_PER_MS)
    playground.run(1900)  # the hand still holds the ball
    assert not any(playground.glove.tactiles.pins_out())
    assert playground.glove.brakes.engaged() == {}
    assert "resumed" not in playground.kinds()
    playground.run(2600)  # it has opened since
    assert "resumed" in playground.kinds()


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda f: replace(f, position_m=np.full((26, 3), np.nan)), "finite"),
        (lambda f: replace(f, position_m=f.position_m + 0.5), "m/s"),
        (lambda f: replace(f, time_ns=f.time_ns - 10**9), "time"),
        (lambda f: replace(f, position_m=f.position_m * 1e300), "finite|lies at"),
        (lambda f: replace(f, valid=False), "marks the pose as not valid"),
    ],
)
def test_a_pose_that_cannot_be_is_refused_and_moves_nothing(playground, spoil, word):
    playground.run(600)
    before = playground.glove.tactiles.pins_out()
    reason = playground.session.submit(spoil(playground.frames[playground.fed]), playground.glove.now_ns())
    assert reason is not None
    assert any(part in reason for part in word.split("|"))
    playground.run(605, poses=False)
    assert playground.glove.tactiles.pins_out() == before


def test_a_pose_from_the_future_moves_nothing_and_shuts_out_none_after_it(playground):
    playground.run(600)
    frame = playground.frames[playground.fed]
    reason = playground.session.submit(replace(frame, time_ns=frame.time_ns + 3600 * 10**9), playground.glove.now_ns())
    assert "ahead of its arrival" in str(reason)
    playground.run(2400)
    assert playground.kinds().count("pose_refused") == 1
    assert "grasp_begin" in playground.kinds()
    assert "watchdog" not in playground.kinds()


def test_a_first_pose_in_the_wrong_place_costs_one_pose_more_and_is_let_go(playground):
    first, then = playground.frames[0], playground.frames[1]
    touching = then.position_m - then.position_m[10] + playground.session.loop.body("book").pose.position_m
    session, now_ns = playground.session, playground.glove.now_ns
    assert session.submit(replace(first, position_m=touching), now_ns() + 10 * NS_PER_MS) is None
    playground.fed = 1
    playground.run(2400)
    assert playground.kinds().count("pose_refused") == 1
    assert "grasp_begin" in playground.kinds()
    assert "watchdog" not in playground.kinds()


@pytest.mark.parametrize("frame", [None, {"wrist": [0, 0, 0]}, "pose"])
def test_what_is_no_frame_at_all_is_an_error_and_changes_nothing(playground, frame):
    playground.run(600)
    with pytest.raises(InputError, match="expected a HandFrame"):
        playground.session.submit(frame, playground.glove.now_ns())
    playground.run(1500)
    assert "pose_refused" not in playground.kinds()


def test_a_session_on_a_left_glove_follows_no_right_hand():
    stage = Stage("playground", Configuration(side="left"))
    try:
        energy_j = sum(stage.glove.plant("tactiles").truth()["energy_j"])
        stage.run(1500)
        assert "grasp_begin" in stage.kinds()
        assert {(event.kind, event.subject) for event in stage.session.events} == {("grasp_begin", "right")}  # seen, not felt
        assert not stage.session.results
        assert not stage.session.brake_results
        assert sum(stage.glove.plant("tactiles").truth()["energy_j"]) == energy_j
        assert max(map(abs, stage.glove.plant("brake").truth()["volts"])) < 1.0
    finally:
        stage.glove.off()
        stage.glove.close()


def test_a_hand_that_contradicts_its_label_is_an_event_once(playground):
    playground.frames = [replace(frame, side="left") for frame in playground.frames]
    playground.run(600)
    (event,) = [event for event in playground.session.events if event.kind == "handedness"]
    assert "the hand labelled left looks like a right one" in event.detail


def test_poses_of_no_form_are_recorded_as_events_and_leave_the_recording_whole(tmp_path):
    stage = Stage("playground", record=tmp_path / "run.journal")
    try:
        stage.run(300)
        good = stage.fed
        wrong = ({"position_m": None}, {"position_m": np.zeros((25, 3))}, {"side": 3}, {"time_ns": "now"}, {"track_id": 2**40})
        for fields in wrong:
            assert stage.session.submit(replace(stage.frames[good], **fields), stage.glove.now_ns()) is not None
        lost = replace(stage.frames[good], position_m=np.full((26, 3), np.nan))
        assert stage.session.submit(lost, stage.glove.now_ns()) is not None
        stage.run(400)
    finally:
        stage.glove.off()
        stage.glove.close()
    stage.session.recorder.journal.close({})
    finalise(tmp_path / "run.journal", tmp_path / "run.h5")
    recording = load(tmp_path / "run.h5")
    assert recording.stream("poses")["accepted"].tolist() == [1] * good + [0] + [1] * (stage.fed - good)
    assert int((recording.stream("events")["kind"] == b"pose_refused").sum()) == len(wrong) + 1


def test_a_hand_that_is_gone_lets_go_of_everything_quietly(playground):
    playground.run(1500)
    playground.session.hand_gone(playground.glove.now_ns())
    playground.run(1700, poses=False)
    assert not any(playground.glove.tactiles.pins_out())
    assert playground.glove.brakes.engaged() == {}
    assert "watchdog" not in playground.kinds()


def test_a_pin_that_the_board_refused_as_late_is_asked_for_again(playground):
    """A host that stalls past the command lead: the command comes late, the touch must not be lost for it."""
    array, link = playground.glove.share_tactiles("scene"), playground.glove.links["tactiles"]
    to_ticks, calls = link.to_ticks, []

    def late_once(host_ns: int) -> int:
        calls.append(host_ns)
        return to_ticks(host_ns - (50 * NS_PER_MS if len(calls) == 1 else 0))

    link.to_ticks = late_once
    array.contact("index_tip", playground.glove.now_ns())
    playground.run(100)
    assert [(r.played, r.reason) for r in playground.session.results] == [(False, "late"), (True, None)]
    assert playground.glove.plant("tactiles").truth()["latched"][1] == "on"


def test_armed_again_the_loop_starts_from_nothing_and_what_is_still_held_is_not_felt_by_itself(playground):
    playground.run(1500)
    glove = playground.glove
    assert glove.brakes.engaged()
    assert any(glove.tactiles.pins_out())
    for link in glove.links.values():
        link.send("disarm", now_ns=glove.now_ns())  # by whomever
    playground.run(1520, poses=False)
    assert glove.brakes.engaged() == {}
    glove.arm()
    assert not any(glove.tactiles.pins_out())
    energy_j = sum(glove.plant("tactiles").truth()["energy_j"])
    again_ms = (glove.now_ns() - playground.start_ns) / NS_PER_MS
    playground.run(again_ms + 300, poses=False)
    assert glove.brakes.engaged() == {}
    assert sum(glove.plant("tactiles").truth()["energy_j"]) == energy_j
    assert not any(glove.tactiles.pins_out())
    playground.fed = next(i for i, f in enumerate(playground.frames) if f.time_ns > glove.now_ns() - LATENCY_NS)
    playground.run(again_ms + 500)
    assert "grasp_end" in playground.kinds()  # the grasp of before is over; a new one begins with a new closing
    assert glove.brakes.engaged() == {}


@pytest.fixture
def desk():
    stage = Stage("desk")
    yield stage
    stage.glove.off()
    stage.glove.close()


@pytest.mark.parametrize("every_ms", [4, 11, 33])
def test_ticked_too_seldom_the_loop_still_plays_in_time_and_says_overrun_once(desk, every_ms):
    desk.run(1200, every_ms=every_ms)
    said = [event for event in desk.session.events if event.kind == "overrun"]
    assert len(said) == 1
    assert said[0].time_ns - desk.start_ns <= 4 * every_ms * NS_PER_MS
    assert f"ticked every {every_ms} ms" in said[0].detail
    assert "tick every 1 ms" in said[0].detail
    results = desk.session.results
    assert sum(result.played for result in results) > 50
    failed = [result for result in results if result.reason in {"late", "unknown", "clock"}]
    assert all(result.requested_ns <= said[0].time_ns for result in failed)  # the loop's pace takes three ticks to know


def test_ticked_often_enough_or_held_up_for_once_it_says_nothing(desk):
    desk.run(300)
    desk.run(301, every_ms=30)
    desk.run(600)
    desk.run(601, every_ms=30)
    desk.run(900)
    assert "overrun" not in desk.kinds()


def test_each_stretch_of_slow_ticks_is_said(desk):
    for stretch in range(1, 4):
        desk.run(stretch * 200 - 100)
        desk.run(stretch * 200, every_ms=10)
    assert desk.kinds().count("overrun") == 3


def test_pulses_that_were_due_before_the_tick_are_counted(playground):
    playground.run(20)
    playground.glove.share_tactiles("scene").train("palm_index", 30, 10 * NS_PER_MS, playground.glove.now_ns())
    playground.run(400, every_ms=25)
    (said,) = [event.detail for event in playground.session.events if event.kind == "overrun"]
    assert "pulses came late" in said
    results = playground.session.results
    assert sum(result.played for result in results) >= 20
    assert not {result.reason for result in results} & {"late", "unknown"}


def test_a_loop_that_is_ticked_far_too_seldom_says_which_pulses_nobody_felt(desk):
    desk.run(2500, every_ms=70)
    late = [result for result in desk.session.results if result.reason == "late"]
    assert len(late) > 20
    assert {result.kind for result in late} == {"pulse"}
    assert desk.glove.tactiles.overdue >= len(late)


def test_armed_again_no_clutch_engages_until_a_pose_says_where_the_hand_is():
    """Rules that go by the body alone, too: what was asked for before a disarm does not outlive it."""
    stage = Stage("posture")
    try:
        plant = stage.glove.plant("brake")
        assert plant is not None
        stage.run(400)
        assert max(plant.truth()["amplitude_v"]) > 300.0
        stage.glove.off()
        stage.glove.arm()
        now_ms = (stage.glove.now_ns() - stage.start_ns) / NS_PER_MS
        for step in range(1, 20):
            stage.run(now_ms + 20 * step, poses=False)
            assert max(abs(volts) for volts in plant.truth()["volts"]) < 1.0
        assert max(plant.truth()["amplitude_v"]) < 1.0
        stage.run(now_ms + 600)
        assert max(plant.truth()["amplitude_v"]) > 300.0
    finally:
        stage.glove.off()
        stage.glove.close()

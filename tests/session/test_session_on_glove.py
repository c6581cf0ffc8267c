"""The glove that ``haptics.open`` gives is the one that a session plays on: ticked with it, recorded with it, with units."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from told import Told

import haptics
from haptics.recording.condition import condition_of

TACTILES, BRAKE = "sim://tactiles?spread=0", "sim://brake?spread=0"


def poses(first: int = 0, last: int = 400):
    """Hand tracking's own words: ns, and joints by WebXR's or OpenXR's names."""
    for frame in itertools.islice(haptics.load_hand("synthetic").frames("right"), first, last):
        yield frame.time_ns, dict(zip(haptics.JOINTS, zip(frame.position_m, frame.orientation_xyzw, strict=True), strict=True))


def play(glove: haptics.Glove, session: haptics.Session, last: int = 400) -> None:
    start_ns = glove.now_ns()
    for time_ns, joints in poses(0, last):
        glove.advance(max(0.0, (time_ns - (glove.now_ns() - start_ns)) / 1e9))
        assert session.submit(haptics.HandFrame.from_joints(glove.now_ns(), "right", joints)) is None


def placed(name: str = "playground") -> haptics.Scene:
    return haptics.load_scene(name).placed_for(haptics.load_hand("synthetic"))


def test_a_grasp_is_felt_with_the_glove_that_open_gives(tmp_path):
    out = tmp_path / "felt.h5"
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual", record=out) as glove:
        told = Told(glove.devices)
        session = haptics.Session(placed(), glove)
        glove.arm()
        session.begin()
        play(glove, session, 150)
        state, truth = glove.state(), glove.truth()
        assert truth is not None
        for name in ("index", "thumb"):
            force_n, sd_n = state.force_n[name], state.force_sd_n[name]
            assert force_n is not None
            assert force_n > 4.0
            assert sd_n is not None
            assert 0.0 < sd_n < 0.2 * force_n
        assert {"thumb_tip", "index_tip"} <= set(truth.pins_out)
        told_v, true_v = [], []
        for _ in range(6):  # some of which fall into reversals of the square wave
            glove.advance(0.01)
            told_v.append(glove.state().volts)
            true_v.append(glove.truth().volts)
        for name in ("index", "thumb"):
            assert max(volts[name] for volts in told_v) == pytest.approx(max(abs(volts[name]) for volts in true_v), rel=0.05)
        assert glove.results() == []  # they are the session's
        session.end()
        glove.advance(0.3)
        assert glove.truth().pins_out == ()
        assert max(map(abs, glove.truth().volts.values())) < 60.0
        glove.pulse("index_tip")
        glove.advance(0.1)
        assert [(one.kind, one.played) for one in glove.results()] == [("pulse", True)]
    kinds = [event.kind for event in session.events]
    assert "grasp_begin" in kinds
    assert {one.kind for one in session.brake_results if one.played} == {"brake", "piezo"}
    assert len(session.truth.pins) > 4
    assert condition_of(out).complete
    recording = haptics.load_recording(out)
    assert recording.counts["poses"] == 150
    asked = Counter((one.owner, one.kind in ("brake", "piezo")) for one in told.results())
    assert asked["scene", True] == len(session.brake_results)
    assert asked["scene", False] > len(session.results)  # and what it let go of at its end
    assert asked["", False] == 15  # withdrawn by arming
    assert recording.counts["requests"] == asked["scene", False] + asked["program", False] + asked["", False]
    assert recording.counts["brake_requests"] == asked["scene", True]
    assert recording.stream("ticks")["force_n"].max() > 4.0
    assert b"grasp_begin" in set(recording.stream("events")["kind"])


def test_in_real_time_the_gloves_thread_ticks_the_session():
    with haptics.open(tactiles=TACTILES, clock="real") as glove:
        session = haptics.Session(placed("desk"), glove)
        glove.arm()
        session.begin()
        _, joints = next(poses())
        end_s = time.monotonic() + 60.0
        while not any(event.kind == "watchdog" for event in session.events):  # poses stop, and nobody but the thread ticks
            assert time.monotonic() < end_s
            try:
                session.submit(haptics.HandFrame.from_joints(glove.now_ns(), "right", joints))
            except haptics.DeadManMissed:  # a machine that is too busy
                glove.off()
                glove.arm()
            time.sleep(0.3)


def test_a_glove_driven_by_hand_is_recorded_whole(tmp_path):
    out = tmp_path / "hand.h5"
    with pytest.raises(RuntimeError), haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual", record=out) as glove:  # noqa: PT012
        glove.arm()
        glove.contact("index_tip")
        glove.burst("thumb_tip", 3)
        glove.piezo("index", 0.05)
        assert glove.brake("thumb", volts=400.0, ttl_s=5.0, frequency_hz=40.0) == 400.0
        glove.advance(0.2)
        assert glove.truth().force_n["thumb"] > 0.5
        assert glove.state().force_n["thumb"] == pytest.approx(glove.truth().force_n["thumb"], rel=0.3)
        glove.release_brake("thumb")
        glove.advance(0.1)
        assert glove.telemetry().brake.output_v[1] < 60.0
        results = {one.kind: one.played for one in glove.results()}
        assert results == dict.fromkeys(("contact", "burst", "piezo", "brake"), True)
        raise RuntimeError("the program breaks; the glove goes off in good order")
    condition = condition_of(out)
    assert condition.complete
    assert not condition.damaged
    recording = haptics.load_recording(out)
    assert {row["kind"] for row in recording.stream("requests")} >= {b"contact", b"burst", b"release"} - {b"release"}
    assert [(row["brake"], row["kind"], row["played"]) for row in recording.stream("brake_requests")] == [
        (b"index", b"piezo", 1),
        (b"thumb", b"brake", 1),
    ]
    assert recording.stream("ticks")["volts"].max() > 350.0
    assert recording.stream("ticks")["pin_out"][-1].sum() == 0  # withdrawn, and seen to be
    assert recording.counts["wire"] > 100
    assert not list(tmp_path.glob("*.journal"))


def test_a_recording_is_not_overwritten_unasked(tmp_path):
    out = tmp_path / "hand.h5"
    haptics.open(tactiles=TACTILES, clock="virtual", record=out).close()
    with pytest.raises(haptics.InputError, match="exists"):
        haptics.open(tactiles=TACTILES, clock="virtual", record=out)
    haptics.open(tactiles=TACTILES, clock="virtual", record=out, force=True).close()
    with pytest.raises(haptics.InputError, match=r"record = .*expected .* HDF5"):
        haptics.open(clock="virtual", record=tmp_path / "hand.csv")


def test_limits_have_names_and_units():
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as glove:
        who = glove.identity()
        assert who.tactiles is not None
        assert who.tactiles.limits.max_pulse_s == pytest.approx(0.010)
        assert who.tactiles.limits.min_supply_v == pytest.approx(3.0)
        assert who.brake is not None
        assert who.brake.limits.max_amplitude_v == 1500.0
        assert who.brake.limits.max_charge_c == pytest.approx(45e-6)
        assert who.brake.dead_man_s == pytest.approx(0.1)
        glove.arm()
        glove.advance(0.05)
        told = glove.telemetry()
        assert told.tactiles is not None
        assert told.tactiles.state == "armed"
        assert told.tactiles.supply_v == pytest.approx(5.0, abs=0.1)
        assert told.tactiles.faults == ()
        assert glove.truth().rise_k.keys() == set(haptics.SITES)


def test_messages_name_what_was_typed():
    with haptics.open(brake=BRAKE, clock="virtual") as glove:
        glove.arm()
        with pytest.raises(haptics.InputError, match=r"^volts = 1501 V; allowed 0 to 1500 V$"):
            glove.brake("index", volts=1501)
        with pytest.raises(haptics.InputError, match=r"^volts = 1500.0001 V; allowed 0 to 1500 V$"):
            glove.brake("index", volts=1500.0001)
        with pytest.raises(
            haptics.InputError, match=r"^force_n = 30 N needs 17\d\d V; the index brake holds at most 2\d\.\d N at 1500 V$"
        ):
            glove.brake("index", force_n=30)
        with pytest.raises(
            haptics.InputError, match=r"name = 'indx' is not a brake of this glove; expected index or thumb; did you mean index"
        ):
            glove.brake("indx", volts=100)
        with pytest.raises(haptics.InputError, match="without a tactor array"):
            glove.burst("index_tip")
        with pytest.raises(haptics.InputError, match=r"frequency_hz = 2000 Hz; allowed 0\.1 to 1000 Hz"):
            glove.brake("index", volts=100, frequency_hz=2000)


def test_a_session_takes_a_scene_whose_places_wait_for_a_hand_and_whose_brakes_are_there():
    with haptics.open(tactiles=TACTILES, brake=BRAKE, clock="virtual") as glove:
        session = haptics.Session(haptics.load_scene("playground"), glove)
        assert "ball" not in session.scene.names
        assert "still" in session.waits_for
        narrow = haptics.Configuration.model_validate({"brake": {"channels": ["index"]}})
    with (
        haptics.open(narrow, clock="virtual") as glove,
        pytest.raises(haptics.InputError, match="drives thumb, but the glove's outputs are index"),
    ):
        haptics.Session(placed(), glove)


@pytest.mark.parametrize("name", haptics.BASES)
def test_joints_in_an_engines_own_basis_are_the_same_frame(name):
    time_ns, joints = next(poses(40))
    basis = haptics.BASES[name]
    theirs = {joint: basis.from_openxr(*pose) for joint, pose in joints.items() if joint != "palm" or name != "webxr"}
    frame = haptics.HandFrame.from_joints(time_ns, "right", theirs, basis=name)
    own = haptics.HandFrame.from_joints(time_ns, "right", joints)
    np.testing.assert_allclose(frame.position_m[1:], own.position_m[1:], atol=1e-12)
    np.testing.assert_allclose(frame.orientation_xyzw[1:], own.orientation_xyzw[1:], atol=1e-12)
    np.testing.assert_allclose(frame.position_m[0], own.position_m[0], atol=0.01)
    with pytest.raises(haptics.InputError, match=r"basis = 'unty' .*did you mean unity"):
        haptics.HandFrame.from_joints(time_ns, "right", joints, basis="unty")


@pytest.mark.parametrize("true", haptics.BASES)
@pytest.mark.parametrize("stated", haptics.BASES)
def test_a_wrong_basis_is_refused_with_one_that_fits(true, stated):
    time_ns, joints = next(poses(40))
    theirs = {joint: haptics.BASES[true].from_openxr(*pose) for joint, pose in joints.items()}
    if haptics.BASES[true].axes == haptics.BASES[stated].axes:
        haptics.HandFrame.from_joints(time_ns, "right", theirs, basis=stated)
        return
    with pytest.raises(haptics.InputError, match=rf"basis = '{stated}' does not fit the joints: .*basis='\w+' fits") as caught:
        haptics.HandFrame.from_joints(time_ns, "right", theirs, basis=stated)
    named = str(caught.value).split("basis='")[1].split("'")[0]
    assert haptics.BASES[named].axes == haptics.BASES[true].axes
    assert not haptics.HandFrame.from_joints(time_ns, "right", theirs, valid=False, basis=stated).valid


def test_joints_with_axes_of_their_own_are_refused_with_what_to_do():
    time_ns, joints = next(poses(40))
    quarter = Rotation.from_euler("y", 90.0, degrees=True)
    sideways = haptics.Basis("mine", ((0, 1, 0), (0, 0, 1), (1, 0, 0)))
    with pytest.raises(haptics.InputError, match=r"basis = 'mine' does not fit"):
        haptics.HandFrame.from_joints(time_ns, "right", joints, basis=sideways)
    x_along = {joint: (place, (Rotation.from_quat(turn) * quarter).as_quat()) for joint, (place, turn) in joints.items()}
    with pytest.raises(haptics.InputError, match=r"no basis of haptics\.BASES fits: turn each joint"):
        haptics.HandFrame.from_joints(time_ns, "right", x_along)


def test_a_session_ends_and_truth_is_there_though_the_boards_missed_their_host(monkeypatch):
    from haptics.session import service as service_module

    glove = haptics.open(tactiles=TACTILES)
    try:
        session = haptics.Session(placed("desk"), glove)
        glove.arm()
        session.begin()
        with glove.turn():  # the thread waits while time goes on, as in a process that was stopped
            late_ns = service_module.awake_ns() + 1_500_000_000
            monkeypatch.setattr(service_module, "awake_ns", lambda: late_ns)
            glove._service.serve()
            with pytest.raises(haptics.DeadManMissed):
                session.hand_gone()
            assert glove.truth() is not None
            session.end()
            assert glove.state().armed == ()
    finally:
        glove.close()


def test_a_session_remembers_the_last_of_what_happened_and_hands_on_all_of_it():
    recording = haptics.load_hand("synthetic")
    heard = []
    with haptics.open(clock="virtual") as glove:
        glove.arm()
        session = haptics.Session(haptics.load_scene("playground").placed_for(recording), glove, kept=3)
        session.subscribe(heard.append)
        session.begin()
        start_ns = glove.now_ns()
        for frame in list(recording.frames("right"))[:250]:
            while glove.now_ns() < start_ns + frame.time_ns + 10_000_000:
                session.tick(glove.now_ns() + 1_000_000)
            session.submit(replace(frame, time_ns=start_ns + frame.time_ns))
        session.end()
    events = [one for one in heard if isinstance(one, haptics.LoopEvent)]
    results = [one for one in heard if isinstance(one, haptics.Result)]
    assert "grasp_begin" in [event.kind for event in events[:-3]]
    assert list(session.events) == events[-3:]
    assert list(session.results) == [one for one in results if one.kind not in ("brake", "piezo")][-3:]
    assert list(session.brake_results) == [one for one in results if one.kind in ("brake", "piezo")][-3:]
    assert len(session.truth.forces_n) == 3
    assert session.truth.peak_force_n.max() > 5


@pytest.mark.parametrize("kept", [0, -1, 1.5, True, "all"])
def test_how_much_a_session_remembers_is_checked(kept):
    with haptics.open(clock="virtual") as glove, pytest.raises(haptics.InputError, match="kept"):
        haptics.Session(haptics.load_scene("desk").placed((0.0, 0.0, 0.0)), glove, kept=kept)


def test_a_sink_that_cannot_be_called_is_refused():
    with haptics.open(clock="virtual") as glove:
        session = haptics.Session(haptics.load_scene("desk").placed((0.0, 0.0, 0.0)), glove)
        with pytest.raises(haptics.InputError, match="sink = 3 cannot be called"):
            session.subscribe(3)


def test_without_a_name_every_brake_is_let_go_of():
    with haptics.open(brake=BRAKE, clock="virtual") as glove:
        glove.arm()
        for name in ("index", "thumb"):
            glove.brake(name, volts=800.0, ttl_s=10.0)
        glove.advance(0.2)
        assert min(glove.truth().force_n.values()) > 1.0
        glove.release_brake()
        glove.advance(0.2)
        assert max(abs(volts) for volts in glove.truth().volts.values()) < 60.0


def test_a_scene_that_drives_brakes_is_told_of_a_glove_without_them():
    recording = haptics.load_hand("synthetic")
    scene = haptics.load_scene("playground").placed_for(recording)
    with haptics.open(tactiles=TACTILES, clock="virtual") as glove:
        haptics.Session(scene, glove)
        haptics.Session(scene, glove)
        (note,) = [note for note in glove.state().notes if note.startswith("brake: ")]
        assert "drives index, thumb, which this glove has not; open it with brake=" in note

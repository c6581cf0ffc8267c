"""A calibrated hand touches where its own fingertips are: in the session, in what judges it, in the report and in the replay."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import pytest

import haptics
from haptics.errors import InputError
from haptics.judging.felt import track_truths
from haptics.judging.onset import touches_on
from haptics.recording.seal import seal
from haptics.scene.calibration.store import calibrations_folder, remove_calibration, save_calibration
from haptics.scene.hands.frame import HandFrame, mirrored
from haptics.scene.hands.joints import FINGERS
from haptics.scene.sites import SITE, nominal_sites
from haptics.session.configuration import Configuration, check_configuration
from haptics.session.replay import replay_recording
from haptics.session.run import RunOptions, run_scene
from haptics.time import NS_PER_MS

BALL = """
summary = "a ball"
[[objects]]
name = "ball"
placement = "world"
position_m = [0.0, 0.0, -0.4]
shape = { kind = "sphere", radius_m = 0.03 }
effects = [{ kind = "contact", sites = ["index_tip"] }]
"""
SPEED_M_S = 0.1
LARGER = haptics.HandCalibration(name="anna", side="right", tip_radius_m={"index": 0.010})  # nominal: 7 mm
EARLIER_NS = 30 * NS_PER_MS
"""3 mm at 0.1 m/s."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HAPTICS_CONFIG_FOLDER", str(tmp_path / "configuration"))
    return calibrations_folder()


@pytest.fixture
def ball(tmp_path: Path) -> haptics.Scene:
    (tmp_path / "ball.toml").write_text(BALL)
    return haptics.load_scene(tmp_path / "ball.toml")


def flight() -> list[HandFrame]:
    """A rigid hand whose index fingertip flies along -z, straight at the ball."""
    first = next(haptics.load_hand("synthetic").frames("right"))
    tip_m = first.position_m[haptics.JOINTS.index("index_tip")]
    times_ns = range(0, 1000 * NS_PER_MS, 10 * NS_PER_MS)
    places_m = [(0.0, 0.0, -0.3 - SPEED_M_S * time_ns / 1e9) for time_ns in times_ns]
    return [
        replace(first, time_ns=t, position_m=first.position_m - tip_m + place)
        for t, place in zip(times_ns, places_m, strict=True)
    ]


def touches_ns(scene: haptics.Scene, configuration: Configuration | None = None, other: bool = False, **how) -> list[int | None]:
    """When a session aims at for each touch, ns from the start of the flight; of the other hand, if asked for."""
    with haptics.open(configuration, clock="virtual") as glove:
        session = haptics.Session(scene, glove, **how)
        glove.arm()
        session.begin()
        start_ns = glove.now_ns()
        for frame in [mirrored(frame) for frame in flight()] if other else flight():
            glove.advance(max(0.0, (frame.time_ns - (glove.now_ns() - start_ns)) / 1e9))
            assert session.submit(replace(frame, time_ns=start_ns + frame.time_ns)) is None
        return [event.aimed_ns and event.aimed_ns - start_ns for event in session.events if event.kind == "touch"]


def touched_ns(*what, **how) -> int:
    """When it aims at for the first touch."""
    first_ns = touches_ns(*what, **how)[0]
    assert first_ns is not None
    return first_ns


def test_a_fingertip_3_mm_larger_touches_as_much_earlier_as_it_takes_to_fly_3_mm(ball):
    nominal_ns = touched_ns(ball)
    assert nominal_ns / 1e9 == pytest.approx((0.1 - 0.03 - 0.007) / SPEED_M_S, abs=2e-3)
    assert nominal_ns - touched_ns(ball, calibration=LARGER) == pytest.approx(EARLIER_NS, abs=2 * NS_PER_MS)
    save_calibration(LARGER)
    named = check_configuration({"hand_calibration": "anna"}, "glove.toml")
    assert nominal_ns - touched_ns(ball, named) == pytest.approx(EARLIER_NS, abs=2 * NS_PER_MS)


def test_what_judges_a_touch_knows_the_same_fingertip(ball):
    truths = [track_truths(ball, sites, flight(), ("ball",))[0] for sites in (nominal_sites(), LARGER.sites())]
    nominal, own = (touches_on(t.time_ns, t.distance_m["ball"], (SITE["index_tip"],), "ball")[0].time_ns for t in truths)
    assert nominal - own == pytest.approx(EARLIER_NS, abs=NS_PER_MS / 100)


def test_a_report_judges_by_the_fingertips_that_the_session_had():
    """Tips of 12 mm: held against nominal ones, four of five touches would come 17 to 64 ms too early."""
    large = replace(LARGER, tip_radius_m=dict.fromkeys(FINGERS, 0.012))
    onset = run_scene("playground", "synthetic", Configuration(), RunOptions(record=False, calibration=large))["onset_error_ms"]
    assert (onset["n"], onset["in_window"], onset["missed"], onset["false"]) == (5, 1.0, 0, 0)


def test_a_calibrated_session_follows_only_that_hand(ball):
    assert touches_ns(ball, other=True)
    assert touches_ns(ball, other=True, calibration=LARGER) == []


def test_a_calibration_that_does_not_fit_is_refused(ball):
    left = check_configuration({"side": "left"}, "glove.toml")
    with haptics.open(left, clock="virtual") as glove:
        with pytest.raises(InputError, match="calibration 'anna' is of the right hand, and the left one wears the glove"):
            haptics.Session(ball, glove, calibration=LARGER)
        with pytest.raises(InputError, match="calibration = 'anna' is of type str; expected a HandCalibration"):
            haptics.Session(ball, glove, calibration="anna")
    missing = check_configuration({"hand_calibration": "bertha"}, "glove.toml")
    with haptics.open(missing, clock="virtual") as glove, pytest.raises(InputError, match="calibration 'bertha' is not in"):
        haptics.Session(ball, glove)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("../anna", "wears the glove: 1 to 64 letters, digits, - and _"),
        ("", "expected"),
        (3, "expected text in quotes"),
        ([], "text"),
    ],
)
def test_a_configured_name_is_checked(name, said):
    with pytest.raises(InputError, match="hand_calibration") as refused:
        check_configuration({"hand_calibration": name}, "glove.toml")
    assert said in str(refused.value)


def test_without_a_calibration_a_configuration_is_written_as_ever():
    assert list(Configuration().model_dump(mode="json")) == ["side", "tracker_latency_s", "tick_hz", "tactiles", "brake"]
    named = check_configuration({"hand_calibration": "anna"}, "glove.toml")
    assert check_configuration(named.model_dump(mode="json"), "a header") == named


def test_a_run_tells_records_and_replays_its_calibration(tmp_path):
    save_calibration(LARGER)
    named = check_configuration({"hand_calibration": "anna"}, "glove.toml")
    out, plain = tmp_path / "own.h5", tmp_path / "plain.h5"
    report = run_scene("playground", "synthetic", named, RunOptions(out=out))
    nominal = run_scene("playground", "synthetic", Configuration(), RunOptions(out=plain))
    assert report["hand"]["calibration"] == "anna"
    assert "calibration" not in nominal["hand"]
    assert (report["onset_error_ms"]["missed"], report["onset_error_ms"]["false"]) == (0, 0)
    header = haptics.load_recording(out).header
    assert header["hand_calibration"] == {"name": "anna", "side": "right", "tip_radius_m": {"index": 0.01}}
    assert "hand_calibration" not in haptics.load_recording(plain).header
    remove_calibration("anna")  # the recording knows all of it
    assert replay_recording(out).identical
    assert replay_recording(plain).identical

    with h5py.File(out, "r+") as file:  # the same poses without it are another run
        provenance = file["entry/provenance"]
        kept = {key: value for key, value in header.items() if key != "hand_calibration"}
        kept["configuration"] = {key: value for key, value in kept["configuration"].items() if key != "hand_calibration"}
        del provenance["header"]
        provenance["header"] = json.dumps(kept)
    seal(out)
    assert not replay_recording(out).identical


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("anna", "hand_calibration = 'anna' in its header is no calibration; expected a table"),
        ({"name": "anna"}, "side is missing"),
        ({"name": "../anna", "side": "right"}, "name = '../anna'"),
        ({"side": "right"}, "name = ''"),
        ({"name": "anna", "side": "left"}, "is of the left hand, and the right one wears the glove"),
        ({"name": "anna", "side": "right", "tip_radius_m": {"index": 7}}, "tip_radius_m.index = 7 m"),
    ],
)
def test_a_header_that_no_run_writes_is_refused(recorded, tmp_path, entry, said):
    path = Path(shutil.copy(recorded, tmp_path / "copy.h5"))
    with h5py.File(path, "r+") as file:
        header = {**json.loads(file["entry/provenance/header"][()]), "hand_calibration": entry}
        del file["entry/provenance/header"]
        file["entry/provenance/header"] = json.dumps(header)
    seal(path)
    with pytest.raises(InputError) as refused:
        replay_recording(path)
    assert said in str(refused.value)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recorded") / "run.h5"
    run_scene("tennis", "synthetic", Configuration(), RunOptions(out=out))
    return out


def test_a_run_with_a_hand_that_is_not_that_persons_says_so():
    other = replace(LARGER, bone_m={"index_proximal": 0.05, "middle_proximal": 0.056}, notes=("made in a hurry",))
    options = RunOptions(record=False, calibration=other)
    notes = run_scene("tennis", "synthetic", Configuration(), options)["notes"]
    assert "calibration 'anna': made in a hurry" in notes
    assert any(note.startswith("the hand's bones are 20% shorter than those of the calibration 'anna'") for note in notes)
    with pytest.raises(InputError, match="calibration 'anna' is of the left hand, and the right one wears the glove"):
        run_scene("tennis", "synthetic", Configuration(), replace(options, calibration=replace(other, side="left")))


def test_a_recorded_glove_keeps_the_calibration_that_its_configuration_names(tmp_path):
    save_calibration(LARGER)
    named = check_configuration({"hand_calibration": "anna"}, "glove.toml")
    with haptics.open(named, clock="virtual", record=tmp_path / "hand.h5") as glove:
        glove.advance(0.02)
    assert haptics.load_recording(tmp_path / "hand.h5").header["hand_calibration"]["tip_radius_m"] == {"index": 0.01}

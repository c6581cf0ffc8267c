"""``haptics hand``: what a file holds, and plain files that give it back."""

from __future__ import annotations

import json

import numpy as np
import pytest
from engine_hands import UNITY, WEBXR, json_lines, poses_of, shipped
from leap_hands import a_tap

import haptics

TRACK = shipped()


@pytest.fixture
def unity(tmp_path):
    path = tmp_path / "unity.jsonl"
    path.write_text(json_lines({"basis": "unity", "unit": "m", "time": "s"}, poses_of(TRACK, "unity", names=UNITY)))
    return path


def test_info_tells_what_a_file_holds(answer, unity):
    told = answer("hand", "info", unity)
    assert (told["source"], told["format"], told["basis"]) == ("unity.jsonl", "joints as JSON", "unity")
    assert (told["unit"], told["time"], told["frames"]) == ("m", "s", 40)
    assert told["duration_s"] == pytest.approx(TRACK.time_ns[-1] / 1e9, abs=1e-9)
    (hand,) = told["hands"]
    apart_ms = np.diff(TRACK.time_ns) / 1e6
    assert hand["rate_hz"] == pytest.approx(1e3 / np.median(apart_ms), rel=1e-6)
    assert hand["jitter_ms"] == pytest.approx(np.median(abs(apart_ms - np.median(apart_ms))), rel=1e-4)
    assert (hand["side"], hand["poses"], hand["tracks"], hand["refused"], hand["playable"]) == ("right", 40, 1, 0, True)
    assert (len(told["joints_read"]), told["joints_made"], told["orientations"]) == (26, [], "read")
    assert told["refused"] == told["notes"] == []
    (loss,) = told["losses"]
    assert loss.startswith("joints that were read are within ")


def test_info_names_what_was_made_inferred_refused_and_lost(answer, tmp_path):
    poses = poses_of(TRACK, "webxr", unit_m=0.01, names=WEBXR)
    poses[3]["joints"]["thumb-tip"] = None
    poses[20]["joints"]["wrist"]["position"][1] += 20.0
    path = tmp_path / "webxr.json"
    path.write_text(json_lines({"basis": "webxr", "time": "s"}, poses))
    told = answer("hand", "info", path)
    assert told["joints_made"] == ["palm"]
    assert told["notes"][0].startswith("unit: cm was inferred")
    assert told["losses"][0] == "1 of 26 joints was made rather than read: palm"
    lost, jumped = (pose["reason"] for pose in told["refused"])
    assert lost == "objects[4]: no position of thumb_tip; missing, called otherwise, or lost"
    assert jumped.startswith("wrist jumped at ")
    assert told["hands"][0]["refused"] == 2


@pytest.mark.parametrize("content", ["unity", "leap", "synthetic"])
def test_a_person_is_told_the_same(command, unity, tmp_path, content):
    (tmp_path / "tap.json").write_text(json.dumps(a_tap()))
    file = {"unity": unity, "leap": tmp_path / "tap.json", "synthetic": "synthetic"}[content]
    code, out, err = command("hand", "info", file)
    assert (code, err) == (0, "")
    for word in ("joints made", "rate", "jitter", "plays"):
        assert word in out
    assert ("loss: 5 of 26 joints were made" in out) == (content == "leap")
    assert command("hand", "convert", file, tmp_path / "told.csv")[0] == 0


def test_a_hand_that_would_not_be_played_is_told_so(answer, tmp_path):
    path = tmp_path / "fast.jsonl"
    path.write_text(json_lines({"basis": "openxr", "unit": "m", "time": "us"}, poses_of(TRACK, "openxr")))
    told = answer("hand", "info", path)
    assert told["hands"][0]["playable"] is False
    assert any("too fast for a tracker; are the times in s?" in note for note in told["notes"])
    assert any(note.startswith("`haptics run` does not play the right hand: ") for note in told["notes"])
    assert len(told["refused"]) == 10


@pytest.mark.parametrize("ending", ["csv", "jsonl"])
def test_a_converted_file_gives_back_what_was_read_to_the_last_digit(answer, unity, tmp_path, ending):
    out = tmp_path / f"plain.{ending}"
    told = answer("hand", "convert", unity, out)
    assert (told["path"], told["poses"], told["off_mm"]) == (str(out), 40, 0.0)
    before, after = haptics.load_hand(unity), haptics.load_hand(out)
    for field in ("time_ns", "position_m", "orientation_xyzw"):
        np.testing.assert_array_equal(getattr(after.tracks[0], field), getattr(before.tracks[0], field))
    assert after.notes == ()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_a_converted_file_has_the_documented_columns(answer, tmp_path):
    answer("hand", "convert", "synthetic", tmp_path / "plain.csv")
    said, head, first, *_ = (tmp_path / "plain.csv").read_text().splitlines()
    assert said == "# basis=openxr unit=m time=ns"
    assert head.startswith("time_ns,side,track,palm_x,palm_y,palm_z,palm_qx,palm_qy,palm_qz,palm_qw,wrist_x,")
    assert head.endswith(",little_tip_qx,little_tip_qy,little_tip_qz,little_tip_qw")
    assert first.startswith("0,right,0,")
    answer("hand", "convert", "synthetic", tmp_path / "plain.jsonl")
    said, first, *_ = (tmp_path / "plain.jsonl").read_text().splitlines()
    assert json.loads(said) == {"basis": "openxr", "unit": "m", "time": "ns"}
    pose = json.loads(first)
    assert (pose["time"], pose["side"], pose["track"], list(pose["joints"])) == (0, "right", 0, list(haptics.JOINTS))


def test_options_say_what_a_file_does_not(answer, refused, tmp_path):
    poses = poses_of(TRACK, "unreal", unit_m=0.01)
    for index, pose in enumerate(poses):
        del pose["side"]
        pose["time"] = index * 700.0  # no tracker's pace in any unit
        pose["joints"] = {name: value["position"] for name, value in pose["joints"].items()}
    path, out = tmp_path / "bare.jsonl", tmp_path / "out.csv"
    path.write_text(json_lines(None, poses))
    options = ["--side", "right", "--time", "us", "--basis", "unreal"]
    for count, asked in ((0, "--side`"), (2, "--time`"), (4, "--basis`")):
        assert asked in refused("hand", "convert", path, out, *options[:count])
    assert answer("hand", "convert", path, out, *options, "--unit", "cm")["poses"] == 40
    assert "unit = 'cm'" not in refused("hand", "convert", path, tmp_path / "other.csv", *options, "--unit", "feet")


def test_refusals_of_convert(command, refused, unity, tmp_path):
    assert "neither .csv nor .jsonl" in refused("hand", "convert", unity, tmp_path / "out.txt")
    assert "is the file read as the hand" in refused("hand", "convert", unity, unity, "--force")
    out = tmp_path / "out.csv"
    out.write_text("mine")
    assert "exists and is not overwritten" in refused("hand", "convert", unity, out)
    assert out.read_text() == "mine"
    assert command("hand", "convert", unity, out, "--force")[0] == 0
    assert out.read_text() != "mine"
    assert "there is no folder" in refused("hand", "convert", unity, tmp_path / "no" / "out.csv")
    assert "does not exist" in refused("hand", "info", tmp_path / "none.csv")
    assert "synthetic has no pose of the left hand" in refused(
        "hand", "convert", "synthetic", tmp_path / "l.csv", "--side", "left"
    )
    assert "--unit = 'm': what synthetic is settles" in refused("hand", "convert", "synthetic", tmp_path / "l.csv", "--unit", "m")


def test_what_convert_cannot_keep_is_told(answer, tmp_path):
    (tmp_path / "tap.json").write_text(json.dumps(a_tap()))
    losses = answer("hand", "convert", tmp_path / "tap.json", tmp_path / "tap.csv")["losses"]
    assert [loss.partition(" were ")[0] for loss in losses] == [
        "5 of 26 joints",
        "orientations",
        "how thick the fingers are is not written",
    ]

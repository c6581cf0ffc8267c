"""Hands of engines and trackers play like the motion that they were made from; the plain files of ``convert`` do so exactly."""

from __future__ import annotations

import pytest
from engine_hands import UNITY, as_engine, json_lines, poses_of
from pages import CHECKOUT, commands

from haptics.scene.hands.joints import JOINTS
from haptics.scene.hands.synthetic import synthetic_hand

TRACK = synthetic_hand().tracks[0]
FELT = ("contacts", "grasps", "pulses", "onset_error_ms", "brakes")


def landmarks() -> str:
    """The motion before a camera that moves with the hand."""
    order = [at for at, name in enumerate(JOINTS) if at and (name.startswith("thumb") or not name.endswith("metacarpal"))]
    local = TRACK.position_m[:, order] - TRACK.position_m[:, order].mean(axis=1, keepdims=True)
    lines = [{"mirrored": False}]
    for time_ns, points in zip(TRACK.time_ns.tolist(), (local * [1.0, -1.0, -1.0]).tolist(), strict=True):
        hand = [dict(zip("xyz", point, strict=True)) for point in points]
        lines.append({"timestamp_ms": time_ns / 1e6, "handedness": [[{"categoryName": "Right"}]], "worldLandmarks": [hand]})
    return json_lines(None, lines)


def rows_of_joints() -> str:
    position, turn = as_engine(TRACK, "unreal")
    lines = ["# basis=unreal unit=cm", "time_ns,side,joint,x,y,z,qx,qy,qz,qw"]
    for time_ns, places, turns in zip(TRACK.time_ns.tolist(), position.tolist(), turn.tolist(), strict=True):
        lines += [
            ",".join([str(time_ns), "right", name, *map(repr, (*place, *spin))])
            for name, place, spin in zip(JOINTS, places, turns, strict=True)
        ]
    return "\n".join(lines)


def unity_lines() -> str:
    return json_lines({"basis": "unity", "unit": "m", "time": "s"}, poses_of(TRACK, "unity", names=UNITY))


@pytest.fixture
def play(haptics, tmp_path):
    def command(hand):
        done = haptics("run", "tennis", "--hand", hand, "--out", tmp_path / "out.h5", "--force", "--json")
        assert done.code == 0, done.err
        return done.json

    return command


@pytest.mark.parametrize("ending", ["csv", pytest.param("jsonl", marks=pytest.mark.slow)])
def test_a_converted_hand_is_felt_like_the_one_that_it_was_made_from(play, haptics, tmp_path, ending):
    plain = tmp_path / f"plain.{ending}"
    assert haptics("hand", "convert", "synthetic", plain).code == 0
    found, wanted = play(plain), play("synthetic")
    assert {part: found[part] for part in FELT} == {part: wanted[part] for part in FELT}
    assert found["notes"] == wanted["notes"]


@pytest.mark.slow
@pytest.mark.parametrize("content", [unity_lines, rows_of_joints])
def test_a_hand_of_an_engine_is_felt_like_the_one_that_it_was_made_from(play, tmp_path, content):
    (tmp_path / "engine").write_text(content())
    found, wanted = play(tmp_path / "engine"), play("synthetic")
    assert (found["contacts"], found["grasps"]) == (wanted["contacts"], wanted["grasps"])
    assert found["hand"]["refused"] == 0
    assert found["notes"] == wanted["notes"]


@pytest.mark.slow
def test_landmarks_play_and_the_report_says_what_they_lack(play, tmp_path):
    (tmp_path / "landmarks").write_text(landmarks())
    found = play(tmp_path / "landmarks")
    assert found["hand"]["refused"] == 0
    assert any("does not travel" in note for note in found["notes"])
    assert any(note.startswith("5 of 26 joints were made") for note in found["notes"])


@pytest.mark.slow
def test_the_recording_of_a_run_with_such_a_hand_is_replayed_to_the_byte(play, haptics, tmp_path):
    (tmp_path / "engine").write_text(unity_lines())
    play(tmp_path / "engine")
    assert haptics("replay", tmp_path / "out.h5", "--json").json["identical"] is True
    assert haptics("hand", "info", tmp_path / "out.h5", "--json").json["format"] == "a recording of `haptics run`"


def test_the_commands_on_the_page_of_hand_files_run(haptics, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = commands(CHECKOUT / "docs" / "reference" / "hands.md")
    assert [words[:3] for words in lines] == [["haptics", "hand", "info"], ["haptics", "hand", "convert"]]
    for words in lines:
        done = haptics(*words[1:])
        assert done.code == 0, done.err
        assert done.out.strip()

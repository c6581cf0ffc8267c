"""Hands as they are: which one is played, what is refused of it, and what a person is told."""

from __future__ import annotations

import gzip
import json

import h5py
import pytest
from test_bad_input import _hand_frame, _leap


def frames(count: int = 40, bad: int | None = None) -> list[dict]:
    """A right hand that stands still but for its index fingertip, which is once 60 mm off."""
    found = [_hand_frame(10_000 * index) for index in range(count)]
    if bad is not None:
        found[bad]["pointables"][1]["tipPosition"][1] += 60.0
    return found


def left(frame: dict, apart: bool = True) -> dict:
    """The frame's hand mirrored, as a left one; with ``apart`` it is another hand."""
    hand, fingers = frame["hands"][0], frame["pointables"]
    hand = {**hand, "id": 2 if apart else 1, "type": "left", "palmPosition": mirrored(hand["palmPosition"])}
    points = [
        {k: mirrored(v) if k.endswith("Position") else v for k, v in {**finger, "handId": hand["id"]}.items()}
        for finger in fingers
    ]
    return {**frame, "hands": [hand], "pointables": points}


def mirrored(point: list[float]) -> list[float]:
    return [-point[0], *point[1:]]


@pytest.fixture
def play(haptics, tmp_path):
    def command(content, *more, scene="desk"):
        path = tmp_path / "hand.json"
        path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
        return haptics("run", scene, "--hand", path, "--out", tmp_path / "out.h5", "--force", "--json", *more)

    return command


@pytest.fixture
def nothing_left(tmp_path):
    yield
    assert [path.name for path in tmp_path.iterdir() if path.suffix in (".h5", ".journal")] == []


@pytest.mark.slow
def test_one_bad_pose_is_refused_and_counted_and_the_rest_is_played(play, tmp_path):
    done = play(_leap(frames(bad=15)))
    assert done.code == 0, done.err
    hand = done.json["hand"]
    assert (hand["poses"], hand["refused"]) == (40, 1)
    (note,) = done.json["notes"]
    assert note.startswith("1 pose of the right hand was refused at 0.150 s: index_tip jumped at 6 m/s")
    with h5py.File(tmp_path / "out.h5") as file:
        assert len(file["entry/poses/time_ns"]) == 39


@pytest.mark.slow
def test_what_a_bad_pose_did_not_move_is_as_without_it(play):
    whole = _leap(frames())
    spoilt = _leap(frames(bad=15))
    gone = _leap([frame for index, frame in enumerate(frames()) if index != 15])
    reports = [play(content).json for content in (spoilt, gone)]
    for report in reports:
        for part in ("hand", "notes", "recording"):
            del report[part]
    assert reports[0] == reports[1]
    assert play(whole).json["contacts"] == reports[0]["contacts"]


@pytest.mark.slow
def test_a_pose_that_cannot_be_read_is_counted_with_them(play):
    content = frames(bad=15)
    content[20]["pointables"][2]["dipPosition"] = None
    hand = play(_leap(content)).json["hand"]
    assert (hand["poses"], hand["refused"]) == (40, 2)


@pytest.mark.slow
def test_a_stamp_from_the_future_costs_its_own_pose_only(play):
    content = frames()
    content[10]["timestamp"] += 500_000_000
    done = play(_leap(content))
    assert done.json["hand"]["refused"] == 1
    assert done.json["hand"]["duration_s"] == pytest.approx(0.39)
    assert "frames[10].timestamp = 500100000 us lies ahead of the next frame's 110000 us" in done.json["notes"][0]


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize("how", ["option", "configuration"])
def test_a_hand_that_is_not_there_ends_the_run_before_it_begins(play, tmp_path, how):
    (tmp_path / "left.toml").write_text('side = "left"\n')
    done = play(_leap(frames(6)), *(("--side", "left") if how == "option" else ("--config", tmp_path / "left.toml")))
    assert done.code == 2
    assert "no pose of the left hand; the recording has right: 6 poses" in done.err


@pytest.mark.usefixtures("nothing_left")
def test_no_whole_hand_at_all_says_what_was_left_out(play):
    content = frames(6)
    for frame in content:
        frame["pointables"].pop()
    done = play(_leap(content))
    assert done.code == 2
    assert "no pose of either hand" in done.err
    assert "6 hands without all five fingers" in done.err


@pytest.mark.usefixtures("nothing_left")
def test_another_side_is_refused_by_name(play):
    done = play(_leap(frames(6)), "--side", "both")
    assert done.code == 2
    assert "side = 'both' is not allowed; allowed: auto, left, right" in done.err


@pytest.mark.slow
def test_of_two_hands_either_can_be_chosen(play, tmp_path):
    both = [{**a, "hands": a["hands"] + b["hands"], "pointables": a["pointables"] + b["pointables"]}
            for a, b in zip(frames(30), map(left, frames(30)), strict=True)]  # fmt: skip
    right = play(_leap(both)).json
    assert right["hand"]["side"] == "right"
    assert right["notes"][0].startswith("the left hand (30 poses) was left out")
    assert "--side left" in right["notes"][0]
    (tmp_path / "glove.toml").write_text('side = "right"\n')
    chosen = play(_leap(both), "--config", tmp_path / "glove.toml", "--side", "left").json
    assert chosen["hand"]["side"] == "left"
    alone = play(_leap([left(frame, apart=False) for frame in frames(30)])).json
    for report in (chosen, alone):
        for part in ("notes", "hand", "recording"):
            del report[part]
    assert chosen == alone


@pytest.mark.slow
def test_a_wrong_label_is_noted_and_played(play):
    content = frames(30)
    for frame in content:
        frame["hands"][0]["type"] = "left"
    done = play(_leap(content))
    assert done.code == 0, done.err
    assert any("the hand labelled left looks like a right one" in note for note in done.json["notes"])


@pytest.mark.slow
@pytest.mark.parametrize("command", ["prove", "onset"])
def test_every_command_that_takes_a_hand_takes_its_side(haptics, tmp_path, command):
    path = tmp_path / "hand.jsonl"
    path.write_bytes(gzip.compress(b"\n".join(json.dumps(frame).encode() for frame in frames(40))))
    scene = ("resistance",) if command == "prove" else ()
    more = ("--objects", 3, "--latency-ms", 0) if command == "onset" else ()
    found = haptics("fidelity", command, *scene, "--hand", path, "--side", "right", *more, "--json")
    assert found.code in (0, 1), found.err
    assert found.err == ""
    missed = haptics("fidelity", command, *scene, "--hand", path, "--side", "left", *more, "--json")
    assert missed.code == 2
    assert "left hand" in missed.err


def test_a_folder_of_hands_in_several_wrappers(haptics, tmp_path):
    lines = b"\n".join(json.dumps(frame).encode() for frame in frames(40))
    for name in ("a.json", "b.jsonl", "c.ldj", "d.json.gz"):
        (tmp_path / name).write_bytes(gzip.compress(lines) if name.endswith("gz") else lines)
    (tmp_path / "notes.txt").write_text("not a hand")
    done = haptics("fidelity", "onset", "--folder", tmp_path, "--objects", 3, "--latency-ms", 0, "--json")
    assert done.code == 0, done.err


@pytest.mark.slow
def test_a_run_with_a_refused_pose_is_replayed_to_the_byte(play, haptics, tmp_path):
    assert play(_leap(frames(bad=15))).code == 0
    assert haptics("replay", tmp_path / "out.h5", "--json").json["identical"] is True

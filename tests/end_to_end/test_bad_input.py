"""Bad input of any kind: one clear line, exit code 2, nothing left that looks whole."""

from __future__ import annotations

import gzip
import json

import pytest


def _refused(done, *words):
    assert done.code == 2, (done.code, done.err)
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err, done.err


@pytest.fixture
def run(haptics, tmp_path):
    def command(scene="playground", hand="synthetic", *more):
        done = haptics("run", scene, "--hand", hand, "--out", tmp_path / "out.h5", *more)
        assert not (tmp_path / "out.h5").exists()
        assert not list(tmp_path.glob("*.journal"))
        return done

    return command


def _leap(frames):
    return {"metadata": {"protocolVersion": 6}, "frames": frames}


def _hand_frame(time_us, x=0.0):
    fingers = []
    for finger in range(5):
        base = [x + 20.0 * finger, 150.0, 0.0]
        joint = [[base[0], 150.0, -30.0 * i] for i in range(4)]
        fingers.append(
            {"handId": 1, "id": 10 + finger, "type": finger, "mcpPosition": joint[0], "pipPosition": joint[1],
             "dipPosition": joint[2], "tipPosition": joint[3], "width": 18.0, "tool": False}
        )  # fmt: skip
    hand = {"id": 1, "type": "right", "palmPosition": [x + 40.0, 150.0, 30.0], "palmNormal": [0.0, -1.0, 0.0],
            "direction": [0.0, 0.0, -1.0], "grabStrength": 0.0, "pinchStrength": 0.0, "confidence": 1.0}  # fmt: skip
    return {"timestamp": time_us, "hands": [hand], "pointables": fingers}


def _write(path, data):
    path.write_text(json.dumps(data))
    return path


def test_unknown_scene_names_those_that_exist(run):
    _refused(run("nowhere"), "nowhere", "playground", "desk")


def test_missing_hand_file(run):
    _refused(run(hand="no/such/file.json"), "no/such/file.json")


def test_broken_gzip(run, tmp_path):
    path = tmp_path / "broken.json.gz"
    path.write_bytes(gzip.compress(b'{"metadata": {}, "frames": []}')[:-6])
    _refused(run(hand=path), "broken.json.gz")


def test_truncated_json(run, tmp_path):
    path = tmp_path / "cut.json"
    path.write_text(json.dumps(_leap([_hand_frame(0), _hand_frame(9000)]))[:-40])
    _refused(run(hand=path), "cut.json")


@pytest.mark.parametrize("value", [float("nan"), 1e300, "x", None])
def test_hostile_numbers(run, tmp_path, value):
    frames = [_hand_frame(9000 * i) for i in range(5)]
    frames[3]["pointables"][1]["tipPosition"][0] = value
    _refused(run(hand=_write(tmp_path / "hostile.json", _leap(frames))), "hostile.json", "tipPosition")


def test_missing_keys(run, tmp_path):
    frames = [_hand_frame(9000 * i) for i in range(5)]
    del frames[2]["timestamp"]
    _refused(run(hand=_write(tmp_path / "keys.json", _leap(frames))), "timestamp")


def test_nesting(run, tmp_path):
    path = tmp_path / "deep.json"
    path.write_text("[" * 5_000_000)
    _refused(run(hand=path), "deep.json")


def test_a_hand_that_teleports(run, tmp_path):
    frames = [_hand_frame(9000 * i, x=0.0 if i < 20 else 500.0) for i in range(40)]
    _refused(run(hand=_write(tmp_path / "jump.json", _leap(frames))), "jump.json", "m/s")


def test_time_stamps_that_go_back_more_often_than_not(run, tmp_path):
    frames = [_hand_frame(200_000 + 9000 * i) for i in range(20)]
    for frame in frames[10:]:
        frame["timestamp"] -= 180_000
    _refused(run(hand=_write(tmp_path / "back.json", _leap(frames))), "back.json", "goes back")


def test_a_port_that_is_missing(run):
    _refused(run("playground", "synthetic", "--port-tactiles", "/dev/ttyNOSUCH7", "--realtime"), "/dev/ttyNOSUCH7")


@pytest.mark.slow
def test_a_port_that_is_no_board(run):
    _refused(run("playground", "synthetic", "--port-tactiles", "loop://", "--realtime"), "loop://")


def test_the_wrong_board(run):
    _refused(run("playground", "synthetic", "--port-tactiles", "sim://brake"), "brake")


def test_an_unknown_simulated_key(run):
    _refused(run("playground", "synthetic", "--port-tactiles", "sim://tactiles?colour=blue"), "colour")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[tactiles]\ncurrent_limit_a = 1000.0\n", ("current_limit_a", "1000")),
        ("[brake]\namplitude_v = 1e9\n", ("amplitude_v",)),
        ("[brake]\namplitude_v = nan\n", ("amplitude_v",)),
        ("colour = 'blue'\n", ("colour",)),
        ("[tactiles\n", ("TOML",)),
    ],
)
def test_an_impossible_configuration(run, haptics, tmp_path, text, words):
    path = tmp_path / "glove.toml"
    path.write_text(text)
    _refused(run("playground", "synthetic", "--config", path), "glove.toml", *words)
    _refused(haptics("config", "check", path), "glove.toml", *words)


@pytest.mark.parametrize("value", [-1, 1e9, "nan"])
def test_an_impossible_latency(run, value):
    _refused(run("playground", "synthetic", "--latency-ms", value), "latency")


def test_a_journal_without_a_name(haptics):
    _refused(haptics("recording", "recover", "/"), "expected a file name")


@pytest.mark.slow
def test_names_that_are_no_text_and_names_with_signs_of_formulas_are_names(haptics, tmp_path):
    hand = tmp_path / "a$b_{c$\udcff.json"
    hand.write_text(json.dumps(_leap([_hand_frame(10_000 * index) for index in range(5)])))
    out, picture = tmp_path / "out.h5", tmp_path / "out.png"
    done = haptics("run", "desk", "--hand", hand, "--out", out, "--picture", picture, "--json")
    assert done.code == 0, done.err
    assert picture.stat().st_size
    assert haptics("recording", "info", out, "--json").json["header"]["hand"] == str(hand)

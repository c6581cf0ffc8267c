"""Every command: strict JSON where it reports, exit 2 and a reason where it cannot, exit 1 where something failed."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from haptics.errors import InputError, LimitError

REPORTING = {
    ("scenes",): "scenes",
    ("ports",): "ports",
    ("fidelity", "plan", "playground"): "rows",
    ("fidelity", "onset", "--hand", "synthetic", "--objects", "2", "--latency-ms", "10"): "rows",
    ("config", "schema"): "properties",
    ("off", "--port", "sim://brake"): "ports",
    ("predict", "latch"): "switched",
    ("predict", "thermal", "--rate-per-min", "60"): "mean_rise_k",
    ("predict", "brake", "--volts", "500"): "force_n",
}


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "key"), REPORTING.items(), ids=[" ".join(words[:2]) for words in REPORTING])
def test_a_command_that_reports_answers_one_strict_json_object(answer, arguments, key):
    assert key in answer(*arguments)


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [words for words in REPORTING if words[0] != "off"], ids=lambda words: " ".join(words[:2]))
def test_a_person_gets_words_and_the_same_exit_code(command, arguments):
    code, out, err = command(*arguments)
    assert (code, err) == (0, "")
    assert out.strip()


def test_the_shipped_scenes_are_listed_with_what_they_are(answer):
    scenes = {scene["name"]: scene["summary"] for scene in answer("scenes")["scenes"]}
    assert {"desk", "playground", "workplace", "posture", "resistance", "tennis"} == set(scenes)
    assert all(scenes.values())


def test_the_simulated_boards_are_always_there(answer):
    ports = {port["url"]: port for port in answer("ports")["ports"]}
    assert ports["sim://tactiles"]["simulated"]
    assert ports["sim://brake"]["simulated"]


def test_the_plan_leaves_out_what_a_scene_does_not_use_and_says_why(answer):
    desk = answer("fidelity", "plan", "desk")
    built = {row["device"] for row in desk["rows"]}
    assert "tactiles" in built
    assert "brake" not in built
    assert {row["device"] for row in desk["absent"]} >= {"brake"}
    assert all(row["why"] for row in [*desk["rows"], *desk["absent"]])


def test_a_configuration_is_checked_and_its_defaults_filled_in(answer, tmp_path):
    path = tmp_path / "glove.toml"
    path.write_text('side = "left"\n[tactiles]\nrise_limit_k = 15.0\n')
    told = answer("config", "check", path)
    assert told["valid"] is True
    assert told["configuration"]["side"] == "left"
    assert told["configuration"]["tactiles"]["rise_limit_k"] == 15.0
    assert told["configuration"]["brake"]["amplitude_v"] == 1000.0


def test_every_key_a_configuration_may_have_is_in_the_schema(answer, tmp_path):
    path = tmp_path / "glove.toml"
    path.write_text("")
    configuration = answer("config", "check", path)["configuration"]
    schema = answer("config", "schema")
    assert set(schema["properties"]) == set(configuration)
    assert set(schema["$defs"]["BrakeConfiguration"]["properties"]) == set(configuration["brake"])
    assert schema["additionalProperties"] is False


def test_off_on_a_port_that_is_not_there_says_so_and_exits_2(command, strict_json):
    code, out, _ = command("off", "--port", "/dev/ttyNOSUCH7", "--json")
    (port,) = strict_json(out)["ports"]
    assert code == 2
    assert port["safe"] is False
    assert "/dev/ttyNOSUCH7" in port["result"]
    code, out, _ = command("off", "--port", "/dev/ttyNOSUCH7")
    assert code == 2
    assert "no such port" in " ".join(out.split())


@pytest.mark.parametrize(
    ("port", "word"), [("", "port"), ("sim://glove", "glove"), ("ftp://host", "ftp"), ("sim://brake?colour=red", "red")]
)
def test_off_names_what_is_no_port_and_still_makes_the_others_safe(command, strict_json, port, word):
    code, out, _ = command("off", "--port", port, "--port", "sim://tactiles", "--json")
    unknown, tactiles = strict_json(out)["ports"]
    assert (code, unknown["safe"], tactiles["safe"]) == (2, False, True)
    assert word in unknown["result"]


def test_off_of_a_simulated_board_is_safe(answer):
    (port,) = answer("off", "--port", "sim://tactiles")["ports"]
    assert port == {"port": "sim://tactiles", "board": "tactiles", "safe": True, "result": "off"}


GROUPS = ("predict", "link", "config", "recording", "fidelity")
COMMANDS = (
    ("run", "desk"),
    ("scenes",),
    ("replay", "x.h5"),
    ("ports",),
    ("off",),
    ("predict", "thermal"),
    ("predict", "latch"),
    ("predict", "brake"),
    ("predict", "recoil"),
    ("predict", "laws"),
    ("fidelity", "measure"),
    ("fidelity", "plan", "desk"),
    ("fidelity", "prove", "desk"),
    ("fidelity", "stress"),
    ("fidelity", "onset"),
    ("config", "check", "x.toml"),
    ("config", "schema"),
    ("recording", "info", "x.h5"),
    ("recording", "recover", "x.journal"),
    ("recording", "view", "x.h5"),
    ("link", "simulate", "brake"),
)


@pytest.mark.slow
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_an_unknown_option_is_refused_by_every_command(refused, words):
    assert "--colour" in refused(*words, "--colour", "blue")


@pytest.mark.slow
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_says_what_it_does(command, words):
    code, out, _ = command(*words, "--help")
    assert code == 0
    assert "Usage" in out


@pytest.mark.parametrize("words", [("nonsense",), ("run",), *((group, "nonsense") for group in GROUPS)], ids=" ".join)
def test_an_unknown_command_or_a_missing_argument_is_refused(refused, words):
    refused(*words)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("fidelity", "plan", "nowhere"), "nowhere"),
        (("config", "check", "missing.toml"), "missing.toml"),
        (("recording", "info", "missing.h5"), "missing.h5"),
        (("recording", "recover", "missing.journal"), "missing.journal"),
        (("replay", "missing.h5"), "missing.h5"),
        (("link", "simulate", "glove"), "glove"),
        (("fidelity", "onset", "--objects", "-1"), "objects"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else value,
)
def test_what_is_not_there_is_named(refused, words, named):
    assert named in refused(*words)


@pytest.mark.parametrize("content", [b"", b"mine, not yours\n", b"\x89HDF\r\n\x1a\n cut"])
def test_a_file_of_another_kind_is_named_and_left_alone(refused, tmp_path, content):
    path = tmp_path / "other.h5"
    path.write_bytes(content)
    for words in (("recording", "info"), ("recording", "recover"), ("replay",)):
        if words == ("recording", "recover"):
            assert "other.h5" in refused(*words, path, "--out", tmp_path / "out.h5")
        else:
            assert "other.h5" in refused(*words, path)
    assert path.read_bytes() == content
    assert not (tmp_path / "out.h5").exists()


def test_a_recording_cut_short_is_damaged_and_no_recording_is_no_such_file(command, refused, strict_json, tmp_path):
    from haptics.recording import Journal, finalise

    with Journal.create(tmp_path / "a.journal", {"seed": 1}) as journal:
        journal.blob("glove.toml", bytes(2000))
        journal.close({})
    finalise(tmp_path / "a.journal", tmp_path / "a.h5")
    whole = (tmp_path / "a.h5").read_bytes()
    for kept, place in ((len(whole) // 2, "cut short"), (len(whole) - 10, "the seal at its end is missing")):
        (tmp_path / "cut.h5").write_bytes(whole[:kept])
        code, out, _ = command("recording", "info", tmp_path / "cut.h5", "--json")
        found = strict_json(out)
        (damaged,) = found["damaged"]
        assert (code, found["lost_bytes"]) == (1, None)
        assert re.search(r"lost\W+unknown", command("recording", "info", tmp_path / "cut.h5")[1])
        assert place in damaged
        assert place in refused("replay", tmp_path / "cut.h5")
    (tmp_path / "text.h5").write_text("side = 'right'\n")
    assert "is not an HDF5 file: it does not begin as one does" in refused("recording", "info", tmp_path / "text.h5")


def test_what_was_recovered_is_said_in_words(command, tmp_path):
    from haptics.recording import Journal

    with Journal.create(tmp_path / "a.journal", {"seed": 1}) as journal:
        journal.blob("glove.toml", b"x")
        journal.commit()
    code, out, _ = command("recording", "recover", tmp_path / "a.journal")
    assert code == 0
    assert "removed: all of it is in the recording" in out
    assert "complete" in out
    assert "{" not in out
    assert "False" not in out


def test_a_port_without_a_board_is_not_called_safe(command, monkeypatch):
    from haptics.session import off as off_module

    found = [off_module.Off("/dev/ttyS0", None, True, "no identity"), off_module.Off("/dev/ttyACM0", "brake", True, "off")]
    monkeypatch.setattr(off_module, "make_safe", lambda port: found)
    code, out, _ = command("off")
    silent, board = (next(line for line in out.splitlines() if name in line) for name in ("ttyS0", "ttyACM0"))
    assert code == 0
    assert "no board" in silent
    assert "yes" not in silent
    assert "yes" in board


def test_a_limit_exits_with_1_and_a_mistake_with_2(capsys):
    from haptics.cli.program import ended_by

    assert (ended_by(LimitError("too hot")), ended_by(InputError("no such thing")), ended_by(KeyboardInterrupt())) == (1, 2, 130)
    assert "too hot" in capsys.readouterr().err


def test_a_view_does_not_take_the_place_of_its_recording(tmp_path, refused):
    mine = tmp_path / "mine.h5"
    mine.write_bytes(b"precious")
    assert "is the file read as the recording" in refused("recording", "view", mine, "--rrd", mine, "--force")
    assert "nothing to write; give --picture" in refused("recording", "view", mine)
    assert mine.read_bytes() == b"precious"


def test_a_session_of_ones_own_is_pictured_like_a_run(command, refused, strict_json, tmp_path):
    import haptics

    out, picture = tmp_path / "own.h5", tmp_path / "own.png"
    hand = haptics.load_hand("synthetic")
    with haptics.open(tactiles="sim://tactiles", brake="sim://brake", clock="virtual", record=out) as glove:
        session = haptics.Session(haptics.load_scene("playground").placed_for(hand), glove)
        glove.arm()
        session.begin()
        for frame in list(hand.frames("right"))[:20]:
            glove.advance(0.01)
            session.submit(replace(frame, time_ns=glove.now_ns()))
    code, said, _ = command("recording", "view", out, "--picture", picture, "--json")
    assert code == 0
    assert strict_json(said) == {"files": [str(picture)]}
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "exists and is not overwritten" in refused("recording", "view", out, "--picture", picture)
    code, said, _ = command("replay", out, "--json")
    assert (code, strict_json(said)["identical"], strict_json(said)["first_difference"]) == (0, True, None)
    assert "nothing to write; give --picture FILE.png, --rrd FILE.rrd or both" in refused("recording", "view", out)
    assert f"--picture = {out} is the file read as the recording" in refused("recording", "view", out, "--picture", out)
    with haptics.open(tactiles="sim://tactiles", clock="virtual", record=tmp_path / "bare.h5") as glove:
        glove.advance(0.01)
    assert "it holds 0 sessions" in refused("replay", tmp_path / "bare.h5")
    assert command("recording", "view", tmp_path / "bare.h5", "--picture", tmp_path / "bare.png")[0] == 0

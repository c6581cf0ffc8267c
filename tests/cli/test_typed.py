"""Errors name what was typed: every option that is a number, in its own unit, with its own value, found by looking at the app."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from haptics.cli.commands import add_installed_commands, app
from haptics.cli.typed import as_typed
from haptics.errors import NotOneOf, OutOfRange

NEEDED = {
    "run": ("desk",),
    "predict thermal": ("--rate-per-min", "60"),
    "predict brake": ("--volts", "100"),
    "fidelity plan": ("desk",),
    "fidelity prove": ("desk",),
    "link stress": ("--port", "sim://tactiles"),
    "link monitor": ("--port", "sim://tactiles", "--for-s", "0.1"),
    "link identify": ("--port", "sim://tactiles"),
    "link conformance": ("--port", "sim://tactiles"),
    "link simulate": ("tactiles", "--for-s", "0"),
    "garment design": ("--garment", "sleeve", "--motion", "elbow_flexion", "--coverage", "0.9", "--level", "coarse"),
    "garment patch": ("--design", "strip"),
    "garment report": ("--out", "page.html"),
    "characterize": ("thermal",),
}
"""What a command must be given besides."""
TOGETHER = {
    "predict thermal --burst-ms": ("--every-s", "1"),
    "predict thermal --burst-hz": ("--burst-ms", "100", "--every-s", "1"),
    "predict thermal --every-s": ("--burst-ms", "100"),
    "predict brake --force-n": (),
    "garment bodies --angle-deg": ("--export", "body.obj", "--motion", "elbow_flexion"),
}
"""What an option is only looked at with."""
IN_PLACE_OF = {"predict brake --force-n": "--volts", "predict thermal --burst-ms": "--rate-per-min"}
IN_PLACE_OF |= dict.fromkeys(("predict thermal --burst-hz", "predict thermal --every-s"), "--rate-per-min")
ON_A_DESIGN = ("garment evaluate", "garment export")
"""Commands that need a design first: ``tests/cli/test_garment_command.py``."""
NUMBERS = (int, float, list[int], list[float])


def numbers() -> Iterator[tuple[str, str]]:
    """Every option that takes a number: command, option."""
    add_installed_commands()

    def walk(command: Any, name: str) -> Iterator[tuple[str, str]]:
        for word, one in getattr(command, "commands", {}).items():
            yield from walk(one, f"{name} {word}".strip())
        for option in command.params:
            if option.param_type_name == "option" and option.type_descriptor.annotation in NUMBERS:
                yield name, option.opts[0]

    return walk(typer.main.get_command(app), "")


CASES = [(name, option) for name, option in numbers() if name not in ON_A_DESIGN]


def without(words: tuple[str, ...], option: str | None) -> list[str]:
    found = list(words)
    if option in found:
        del found[found.index(option) : found.index(option) + 2]
    return found


def test_the_app_has_many_options_that_are_numbers():
    assert len(CASES) > 50


@pytest.mark.parametrize(("name", "option"), CASES, ids=[" ".join(case) for case in CASES])
def test_a_number_out_of_range_is_named_as_it_was_typed(name, option, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = f"{name} {option}"
    given = [*without(without(NEEDED.get(name, ()), option), IN_PLACE_OF.get(case)), *TOGETHER.get(case, ())]
    code, _, err = command(*name.split(), *given, option, "-77777")
    words = " ".join(err.replace("│", " ").split())
    assert code == 2, words
    assert option in words
    assert "77777" in words


@pytest.mark.parametrize(
    ("argument", "value", "high", "unit", "option", "typed", "said"),
    [
        ("pulse_s", 20.0, 0.1, "s", "--pulse-ms", 20000.0, "--pulse-ms = 20000 ms; allowed 0 to 100 ms"),
        ("thickness_m", 0.02, 0.01, "m", "--thickness-um", 20000.0, "--thickness-um = 20000 µm; allowed 0 to 10000 µm"),
        ("latency", 300.0, 100.0, "ms", "--latency-ms", 300.0, "--latency-ms = 300 ms; allowed 0 to 100 ms"),
        ("volts", 1501.0, 1500.0, "V", "--volts", 1501.0, "--volts = 1501 V; allowed 0 to 1500 V"),
        (
            "rate_per_min",
            1e9,
            math.inf,
            "1/min",
            "--rate-per-min",
            1e9,
            "--rate-per-min = 1000000000 1/min; allowed at least 0 1/min",
        ),
        ("other_s", 1.0, 0.1, "s", "--pulse-ms", 20.0, "other_s = 1 s; allowed 0 to 0.1 s"),
    ],
)
def test_units_are_those_of_the_option(argument, value, high, unit, option, typed, said):
    context = type("Context", (), {})()
    name = option.strip("-").replace("-", "_")
    parameter = type("Parameter", (), {"name": name, "opts": [option], "param_type_name": "option"})()
    context.command, context.params = type("Command", (), {"params": [parameter]})(), {name: typed}
    context.get_parameter_source = lambda _name: type("Source", (), {"name": "COMMANDLINE"})
    assert as_typed(OutOfRange(argument, value, 0.0, high, unit), context) == said


def test_a_word_that_is_nearly_right_gets_the_right_one(refused):
    assert "--direction = 'offon' is not allowed; allowed: off-on, on-off; did you mean off-on?" in refused(
        "predict", "latch", "--direction", "offon"
    )
    assert "did you mean" not in str(NotOneOf("finger", "toe", "'toe'", ("index", "thumb")))


def test_a_message_in_words_speaks_of_options_too(refused):
    said = refused("predict", "thermal", "--burst-ms", 50)
    assert "either --rate-per-min, or --burst-ms together with --every-s" in said


def test_errors_come_home_from_other_processes():
    for error in (OutOfRange("pulse_s", 20.0, 0.0, 0.1, "s"), NotOneOf("finger", "toe", "'toe'", ("index", "thumb"))):
        assert str(pickle.loads(pickle.dumps(error))) == str(error)
        assert vars(pickle.loads(pickle.dumps(error))) == vars(error)


def test_a_command_that_is_nearly_right_gets_the_right_one(refused):
    assert "Did you mean 'scenes'?" in refused("scene")


@pytest.mark.parametrize(
    ("level", "said"),
    [
        ("coil=dynamic", "--level = 'coil=dynamic': there is no model 'coil' with levels; expected latch, brake"),
        (
            "latch=dynamc",
            "--level = 'latch=dynamc': latch has no level 'dynamc'; expected event, table, dynamic, reference; did you",
        ),
        ("latch", "--level = 'latch'; expected MODEL=LEVEL, once for each model, such as latch=dynamic"),
    ],
)
def test_a_level_is_named_as_it_was_typed(level, said, refused):
    assert said in refused("run", "desk", "--level", level)


def test_a_port_is_named_by_its_option(refused):
    said = refused("run", "desk", "--port-tactiles", "sim://thermocouple")
    assert "--port-tactiles = 'sim://thermocouple' is no simulated tactor array; expected sim://tactiles, or a real port" in said
    said = refused("run", "desk", "--port-brake", "sim://tactiles")
    assert "--port-brake = 'sim://tactiles' is no simulated brake controller; expected sim://brake, or a real port" in said
    said = refused("link", "identify", "--port", "sim://tactile")
    assert "--port = sim://tactile: there is no such simulated board; there are sim://tactiles, sim://brake, " in said
    assert "did you mean tactiles?" in said
    said = refused("characterize", "thermal", "--port", "sim://tactile")
    assert "--port = 'sim://tactile' is no simulated tactor array; expected sim://tactiles, or a real port" in said


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (("run", "desk", "--out"), "--out"),
        (("run", "desk", "--picture"), "--picture"),
        (("characterize", "thermal", "--out"), "--out"),
        (("validate", "--out"), "--out"),
        (("fidelity", "measure", "--quick", "--out"), "--out"),
        (("garment", "bodies", "--export"), "--export"),
        (("link", "simulate", "tactiles", "--trace"), "--trace"),
        (("link", "simulate", "tactiles", "--link"), "--link"),
    ],
)
def test_a_folder_that_is_not_there_is_not_made(words, option, refused, tmp_path):
    missing = tmp_path / "nowhere" / ("x.obj" if option == "--export" else "x.h5")
    said = refused(*words, missing)
    assert f"{option} = {missing}: there is no folder {missing.parent}; make it, or choose another place" in said
    assert not missing.parent.exists()


def test_a_number_and_a_file_are_named_by_their_option(refused, tmp_path):
    assert "Invalid value for '--budget': 'abc'; expected a number" in refused("run", "desk", "--budget", "abc")
    nowhere = tmp_path / "nowhere"
    assert f"--folder = {nowhere}: there is no such folder" in refused("fidelity", "onset", "--folder", nowhere)
    missing = tmp_path / "none.toml"
    assert f"--config = '{missing}' cannot be read: No such file" in refused("run", "desk", "--config", missing)


def test_what_a_file_holds_is_not_taken_for_an_option(tmp_path, refused):
    (tmp_path / "g.toml").write_text('side = "up"\n')
    assert "--side" not in refused("run", "tennis", "--config", tmp_path / "g.toml")
    ball = 'summary = "x"\n[[objects]]\nname = "b"\nplacement = "palm"\nshape = { kind = "sphere", radius_m = 0.03 }\n'
    (tmp_path / "s.toml").write_text(ball + 'effects = [{ kind = "contact", force_n = 1 }]\n')
    said = refused("run", tmp_path / "s.toml", "--out", tmp_path / "o.h5", "--force")
    assert "unknown key 'force_n'" in said


def test_of_an_option_that_is_given_twice_the_number_at_fault_is_named():
    from haptics.cli.typed import _typed

    assert _typed([5.0, 20000.0], 20000.000001) == 20000.0
    assert _typed(None, 3.0) == 3.0


@pytest.mark.parametrize(("value", "expected"), [("abc", "a number"), ("", "a number")])
def test_what_is_no_number_is_shown_as_it_was_typed(value, expected, command):
    code, _, err = command("run", "playground", "--budget", value)
    assert code == 2
    assert f"'--budget': {value!r}; expected {expected}" in err

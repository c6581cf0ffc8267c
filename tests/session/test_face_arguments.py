"""Whatever is handed to the package's face, what cannot be used gives one ``InputError`` that names the argument."""

from __future__ import annotations

import inspect
import math
import pickle

import numpy as np
import pytest

import haptics
from haptics.errors import InputError
from haptics.session.devices import Devices
from haptics.session.glove import open as open_glove

JUNK = [None, True, -1, 2.5, 10**400, math.nan, math.inf, "4", "", "no such", b"x", [1], {"a": 1}, np.zeros(3), object(), 1j]


@pytest.fixture(scope="module")
def glove():
    with open_glove(tactiles="sim://tactiles?spread=0", brake="sim://brake?spread=0", clock="virtual") as opened:
        opened.arm()
        yield opened


def refused(call, *args, **kwargs) -> str:
    with pytest.raises(InputError) as caught:
        call(*args, **kwargs)
    words = (
        "allowed",
        "must be",
        "expected",
        "at most",
        "No such file",
        "no such file",
        "directory",
        "does not exist",
        "known keys",
        "given twice",
    )
    assert any(word in str(caught.value) for word in words)
    return str(caught.value)


@pytest.mark.parametrize(
    ("method", "arguments", "argument", "fine"),
    [
        ("contact", {}, "site", ()),
        ("release", {}, "site", ()),
        ("pulse", {}, "site", ()),
        ("pulse", {"site": "index_tip"}, "count", ()),
        ("pulse", {"site": "index_tip"}, "rate_hz", (2.5,)),
        ("brake", {"volts": 100.0}, "name", ()),
        ("brake", {"name": "index"}, "volts", (2.5,)),
        ("brake", {"name": "index"}, "force_n", (2.5,)),
        ("brake", {"name": "index", "volts": 100.0}, "ttl_s", (2.5,)),
        ("brake", {"name": "index", "volts": 100.0}, "frequency_hz", (None, 2.5)),
        ("burst", {}, "site", ()),
        ("burst", {"site": "index_tip"}, "cycles", ()),
        ("piezo", {}, "name", ()),
        ("piezo", {"name": "index"}, "duration_s", ()),
        ("release_brake", {}, "name", (None,)),
        ("advance", {}, "seconds", (2.5,)),
    ],
)
def test_every_argument_of_a_glove_is_checked_and_named(glove, method, arguments, argument, fine):
    glove.results()
    for value in JUNK:
        if any(value is one or (isinstance(value, float) and value == one) for one in fine):
            continue
        said = refused(getattr(glove, method), **arguments, **{argument: value})
        assert argument in said, said
    assert glove.results() == []  # nothing was asked for


@pytest.mark.parametrize("count", [0, 1001, 2.0, np.float64(3.0), np.bool_(True), "3"])
def test_a_count_is_a_whole_number(glove, count):
    assert refused(glove.pulse, "index_tip", count).startswith("count = ")


def test_numbers_of_numpy_are_numbers(glove):
    glove.pulse("index_tip", np.int32(2), np.float32(50.0))
    assert glove.brake("index", volts=np.int64(100), ttl_s=np.float64(0.1)) == 100.0


def test_more_force_than_a_brake_has_is_refused_in_newtons(glove):
    said = refused(glove.brake, "index", force_n=30)
    assert said.startswith("force_n = 30 N needs 17")
    assert "at 1500 V" in said
    held_n = float(said.split("holds at most ")[1].split()[0])
    assert glove.brake("index", force_n=0.99 * held_n) <= 1500.0


CALLS = [
    (haptics.open, {}, "config", [None]),
    (haptics.open, {"clock": "virtual"}, "tactiles", [None]),
    (haptics.open, {"clock": "virtual"}, "brake", [None]),
    (haptics.open, {}, "clock", []),
    (haptics.open, {"clock": "virtual"}, "seed", []),
    (haptics.open, {"tactiles": "sim://tactiles", "clock": "virtual"}, "record", [None]),
    (haptics.open, {"record": "r.h5", "clock": "virtual"}, "force", [True, False]),
    (haptics.load_configuration, {}, "path", [None]),
    (haptics.load_scene, {}, "source", []),
    (haptics.load_hand, {}, "source", []),
    (haptics.load_recording, {}, "path", []),
    (Devices, {"brake": None, "realtime": False}, "tactiles", [None]),
    (Devices, {"tactiles": None, "realtime": False}, "brake", [None]),
]


@pytest.mark.parametrize(("call", "arguments", "argument", "fine"), CALLS, ids=lambda one: getattr(one, "__name__", None))
def test_every_argument_of_the_packages_face_is_checked(call, arguments, argument, fine, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert argument in inspect.signature(call).parameters
    for value in JUNK:
        if not any(value is one for one in fine):
            refused(call, **arguments, **{argument: value})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("url", ["spy:///dev/ttyACM0", "alt://x", "cp2110://1", "SPY://x?file=y"])
def test_no_port_is_opened_where_one_of_them_is_not_allowed(url, monkeypatch):
    monkeypatch.setattr("haptics.session.opening.open_port", lambda *_: pytest.fail("a port was opened"))
    assert refused(haptics.open, tactiles="sim://tactiles", brake=url).startswith("brake = ")
    parts = haptics.load_configuration(None)
    swapped = parts.brake.model_copy(update={"port": url})
    assert "brake port" in refused(Devices, parts.tactiles, swapped, realtime=True)


def test_a_session_takes_what_it_is_made_of_and_no_other():
    configuration = haptics.load_configuration(None)
    scene = haptics.load_scene("desk")
    glove = Devices(configuration.tactiles, None, realtime=False)
    try:
        for junk in ("desk", None, 5):
            assert refused(haptics.Session, junk, glove, configuration).startswith("scene = ")
            assert refused(haptics.Session, scene, junk, configuration).startswith("glove = ")
            assert refused(haptics.Session, scene, glove, junk).startswith("configuration = ")
            if junk is not None:
                assert refused(haptics.Session, scene, glove, configuration, junk).startswith("recorder = ")
        session = haptics.Session(scene.placed(None, None, "right"), glove, configuration)
        session.begin(0)
        for junk in (None, "pose", {"joints": []}, 5):
            assert refused(session.submit, junk, 0).startswith("frame = ")
    finally:
        glove.close()


def test_what_a_glove_is_given_besides_its_parts_is_checked():
    part = haptics.load_configuration(None).tactiles
    for junk in (None, "false", 0, 1.0, [], math.nan):
        assert refused(Devices, part, None, realtime=junk).startswith("realtime = ")
        assert refused(Devices, part, None, realtime=False, limit_pulses=junk).startswith("limit_pulses = ")
    for junk in ("level=event", 3, [("tactiles", {})], {"array": {}}, {"tactiles": "level=event"}):
        assert refused(Devices, part, None, realtime=False, simulate=junk).startswith("simulate")
    assert refused(Devices, part, None, realtime=False, wire_tap="tap").startswith("wire_tap = ")


def test_every_argument_of_a_glove_in_parts_is_checked():
    glove = Devices(haptics.load_configuration(None).tactiles, None, realtime=np.bool_(False))
    try:
        for method, argument in (
            ("follow", "to_ns"),
            ("tick", "now_ns"),
            ("step_to", "to_ns"),
            ("on_event", "sink"),
            ("plant", "name"),
        ):
            for junk in (None, math.nan, "4", [1], 10**400, np.zeros(3)):
                assert refused(getattr(glove, method), junk).startswith(f"{argument} = ")
        glove.step_to(np.int64(glove.now_ns() + 1000))
    finally:
        glove.close()


def test_one_port_is_not_two_boards():
    both = {"tactiles": "socket://host:1", "brake": "socket://host:1"}
    assert "port for each board" in refused(haptics.open, **both)


@pytest.mark.parametrize("url", ["sim://brake", "sim://thermocouple", "sim://tactile", "sim://"])
def test_another_simulated_board_is_no_array(url):
    assert refused(haptics.open, tactiles=url, clock="virtual") == (
        f"tactiles = '{url}' is no simulated tactor array; expected sim://tactiles, or a real port"
    )


@pytest.mark.parametrize("url", ["sim://tactiles#x", "sim://tactiles/x", "sim://tactiles?seed=1&seed=2", "sim://tactiles?foo=1"])
def test_a_simulated_board_is_opened_by_what_its_url_says_or_not_at_all(url):
    refused(haptics.open, tactiles=url, clock="virtual")


@pytest.mark.parametrize(
    ("call", "wrong", "said"),
    [
        (
            haptics.open,
            {"tactile": "sim://tactiles"},
            "open() has no argument 'tactile'; known arguments: config, tactiles, brake, ",
        ),
        (haptics.Session, {"scen": None}, "Session() has no argument 'scen'; known arguments: scene, glove, "),
        (haptics.HandFrame.from_joints, {"bases": "unity"}, "HandFrame.from_joints() has no argument 'bases'; known arguments: "),
    ],
)
def test_an_argument_that_there_is_not_is_answered_with_those_there_are(call, wrong, said):
    with pytest.raises(InputError) as caught:
        call(**wrong)
    assert isinstance(caught.value, TypeError)
    assert str(caught.value).startswith(said)
    assert "; did you mean " in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_a_glove_knows_the_arguments_of_its_calls(glove):
    for method, wrong, meant in (
        ("brake", "volt", "volts"),
        ("pulse", "rate", "rate_hz"),
        ("contact", "sit", "site"),
        ("release", "sit", "site"),
        ("burst", "cycle", "cycles"),
        ("piezo", "duration", "duration_s"),
        ("release_brake", "nam", "name"),
        ("advance", "second", "seconds"),
    ):
        with pytest.raises(InputError, match=rf"Glove\.{method}\(\) has no argument '{wrong}'; .*did you mean {meant}\?"):
            getattr(glove, method)(**{wrong: 1})


def test_a_brake_is_called_a_brake(glove):
    said = refused(glove.brake, "indx", volts=100.0)
    assert said == "name = 'indx' is not a brake of this glove; expected index or thumb; did you mean index?"


def test_a_port_is_no_configuration():
    assert refused(haptics.open, "sim://tactiles") == (
        "config = 'sim://tactiles' is a port; expected a file name; ports have options of their own"
    )


class Unshowable:
    def __repr__(self):
        raise RuntimeError("no")


LONG = {
    "digits": 10**5000,
    "fewer digits": -(10**400),
    "text": "x" * 5000,
    "bytes": b"x" * 5000,
    "list": list(range(5000)),
    "unshowable": Unshowable(),
    "array": np.zeros((40, 40)),
}


@pytest.mark.parametrize("which", LONG)
def test_whatever_is_refused_is_named_in_one_short_line(glove, which):
    for method, arguments, argument in (
        ("contact", {}, "site"),
        ("pulse", {"site": "index_tip"}, "count"),
        ("brake", {"name": "index"}, "volts"),
        ("advance", {}, "seconds"),
    ):
        said = refused(getattr(glove, method), **arguments, **{argument: LONG[which]})
        assert said.startswith(f"{argument} = ")
        assert len(said) < 400
        assert "\n" not in said


@pytest.mark.parametrize(
    ("axes", "unit_m", "word"),
    [
        (5, 1.0, "axes"),
        (((1, 0, 0), (0, 1, 0), (0, 0, 0)), 1.0, "axes"),
        (((1, 0, 0), (1, 0, 0), (0, 0, 1)), 1.0, "axes"),
        (((0.5, 0, 0), (0, 1, 0), (0, 0, 1)), 1.0, "axes"),
        (((1, 0, 0), (0, 1, 0)), 1.0, "axes"),
        (((1, 0, 0), (0, 1, 0), (0, 0, 1)), 0.0, "unit_m = 0 m"),
        (((1, 0, 0), (0, 1, 0), (0, 0, 1)), "m", "unit_m"),
    ],
)
def test_a_basis_that_turns_no_axes_into_axes_is_refused(axes, unit_m, word):
    assert word in refused(haptics.Basis, "mine", axes, unit_m)


def test_a_scene_is_placed_for_a_recording_and_nothing_else():
    assert "recording = 'synthetic'" in refused(haptics.load_scene("desk").placed_for, "synthetic")

"""Leap Motion recordings, whole and hostile."""

from __future__ import annotations

import contextlib
import copy
import gzip
import json
import tracemalloc

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from leap_hands import a_hand, a_recording
from scipy.spatial.transform import Rotation

from haptics.errors import InputError
from haptics.scene.hand_files import json_stream, text_source
from haptics.scene.hand_files.leap import load_leap
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.check import check_frame
from haptics.scene.hands.joints import JOINT


@pytest.fixture
def load(tmp_path):
    def from_content(content):
        path = tmp_path / "some.leap.json"
        path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
        return load_leap(path)

    return from_content


def test_lengths_times_and_joints_are_converted(load):
    recording = load(a_recording([5_000_000, 5_009_000, 5_018_500]))
    (track,) = recording.tracks
    assert (track.side, recording.frame_count, recording.duration_s) == ("right", 3, 0.0185)
    assert track.time_ns.tolist() == [0, 9_000_000, 18_500_000]
    np.testing.assert_allclose(track.joint_m("palm")[0], [0.0, 0.2, 0.0], atol=1e-15)
    np.testing.assert_allclose(track.joint_m("index_proximal")[0], [-0.02, 0.2, -0.02], atol=1e-15)
    np.testing.assert_allclose(track.joint_m("index_tip")[0], [-0.02, 0.2, -0.105], atol=1e-15)
    np.testing.assert_allclose(track.joint_m("thumb_metacarpal")[0], [-0.04, 0.2, 0.05], atol=1e-15)
    np.testing.assert_allclose(track.joint_m("thumb_tip")[0], [-0.04, 0.2, -0.035], atol=1e-15)
    assert track.radius_m[JOINT["ring_tip"]] == pytest.approx(0.009)


def test_the_wrist_is_behind_the_palm_and_metacarpals_run_from_it(load):
    track = load(a_recording([0])).tracks[0]
    np.testing.assert_allclose(track.joint_m("wrist")[0], [0.0, 0.2, 0.06], atol=1e-15)  # 1.5 times the bone of 40 mm
    z = [track.joint_m(name)[0, 2] for name in ("wrist", "ring_metacarpal", "palm", "ring_proximal", "ring_tip")]
    assert z == sorted(z, reverse=True)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_flat_hand_has_level_joints(load, side):
    track = load(a_recording([0], lambda _: [a_hand(side=side)])).tracks[0]
    assert track.side == side
    for name in ("palm", "wrist", "index_proximal", "middle_distal", "little_tip"):
        np.testing.assert_allclose(track.orientation_xyzw[0, JOINT[name]], [0, 0, 0, 1], atol=1e-12)
    nail = Rotation.from_quat(track.orientation_xyzw[0, JOINT["thumb_tip"]]).apply([0, 1, 0])
    assert nail[0] * (1 if side == "left" else -1) > 0.5  # the thumb's back faces away from the fingers
    assert nail[1] > 0.3


def test_gzip_is_told_by_content_and_json_in_chunks_is_the_same(tmp_path, monkeypatch):
    content = json.dumps({"build": 1234567, **a_recording(range(0, 90_000, 9_000))}).encode()
    (tmp_path / "plain.json").write_bytes(b"\xef\xbb\xbf" + content)  # with the mark some editors put in front
    (tmp_path / "misnamed.json").write_bytes(gzip.compress(content, mtime=0))
    plain, packed = load_hand(tmp_path / "plain.json"), load_hand(tmp_path / "misnamed.json")
    for chunk in (1, 7, 1000):
        monkeypatch.setattr(json_stream, "MIN_PIECE_CHARS", chunk)
        small = load_leap(tmp_path / "misnamed.json")
        for other in (packed, small):
            np.testing.assert_array_equal(other.tracks[0].position_m, plain.tracks[0].position_m)
    assert plain.source == "plain.json"


def test_repeated_time_stamps_are_dropped_and_counted(load):
    recording = load(a_recording([0, 9000, 9000, 9000, 18_000]))
    assert recording.tracks[0].time_ns.tolist() == [0, 9_000_000, 18_000_000]
    assert recording.dropped == {"frames that repeat a time stamp": 2}
    assert recording.frame_count == 3


def test_a_half_microsecond_interval_is_kept(load):
    assert load(a_recording([0, 510, 510.5])).tracks[0].time_ns.tolist() == [0, 510_000, 510_500]


def test_hands_come_and_go(load):
    def hands(index):
        return {0: [], 1: [a_hand(7)], 2: [a_hand(7), a_hand(8, "left", 300)], 3: [a_hand(8, "left", 300)], 4: [a_hand(9)]}[index]

    recording = load(a_recording([0, 9000, 18_000, 27_000, 36_000], hands))
    assert [(track.side, track.track_id, track.time_ns.tolist()) for track in recording.tracks] == [
        ("right", 0, [9_000_000, 18_000_000]),
        ("left", 1, [18_000_000, 27_000_000]),
        ("right", 2, [36_000_000]),
    ]
    assert recording.frame_count == 5
    assert recording.side_with_most_frames == "right"


def test_a_gap_beyond_100_ms_ends_a_track_and_a_shorter_one_does_not(load):
    recording = load(a_recording([0, 9_000, 109_000, 209_001]))
    assert [len(track) for track in recording.tracks] == [3, 1]
    assert [track.track_id for track in recording.tracks] == [0, 1]


def test_an_id_that_changes_hands_is_another_track(load):
    recording = load(a_recording([0, 9000], lambda index: [a_hand(7, ("left", "right")[index])]))
    assert [track.side for track in recording.tracks] == ["left", "right"]


def test_no_hands_at_all_is_a_recording_without_tracks(load):
    recording = load(a_recording([0, 9000], lambda _: []))
    assert recording.tracks == ()
    assert recording.frame_count == 2


def test_incomplete_hands_stray_pointables_and_tools_are_left_out_and_counted(load):
    content = a_recording([0, 9000, 18_000])
    del content["frames"][1]["pointables"][2]
    content["frames"][2]["pointables"].append({**content["frames"][2]["pointables"][0], "handId": 99})
    content["frames"][2]["pointables"].append({"tool": True})
    recording = load(content)
    assert recording.tracks[0].time_ns.tolist() == [0, 18_000_000]
    assert recording.dropped == {"hands without all five fingers": 1, "pointables without their hand": 1, "tools": 1}


def test_a_hand_that_jumps_is_loaded_as_recorded_for_the_loop_to_refuse(load):
    recording = load(a_recording([0, 9000, 18_000], lambda index: [a_hand(shift_mm=(0, 3000, 3000)[index])]))
    first, jumped, _ = recording.frames("right")
    assert check_frame(first, None) is None
    assert "jumped" in str(check_frame(jumped, first))


def test_a_width_is_welcome_but_not_required(load):
    content = a_recording([0])
    for pointable in content["frames"][0]["pointables"]:
        del pointable["width"]
    assert load(content).tracks[0].radius_m[JOINT["index_tip"]] == 0.008


# -- hostile -------------------------------------------------------------------------------------------------------------------


def changed(path: list, value) -> dict:
    """A recording of three frames with one member replaced, or removed where ``value`` is ``KeyError``."""
    content = a_recording([0, 9000, 18_000])
    owner = content
    for key in path[:-1]:
        owner = owner[key]
    if value is KeyError:
        del owner[path[-1]]
    else:
        owner[path[-1]] = value
    return content


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["metadata"], [6], "metadata is a list of 1; expected an object"),
        (["frames"], KeyError, "frames is missing or empty"),
        (["frames"], [], "frames is missing or empty"),
        (["frames"], {}, r"frames: '\{' seen; expected '\['"),
        (["frames", 1], ["id", "timestamp"], r"frames\[1\] is a list of 2; expected an object"),
        (["frames", 1], None, r"frames\[1\] is null"),
        (["frames", 1, "timestamp"], KeyError, r"frames\[1\]\.timestamp is missing; required in every frame"),
        (["frames", 1, "timestamp"], "9000", r"frames\[1\]\.timestamp = '9000'"),
        (["frames", 1, "timestamp"], True, r"frames\[1\]\.timestamp = True"),
        (["frames", 0, "timestamp"], -1, r"frames\[0\]\.timestamp = -1; must be 0 to "),
        (["frames", 2, "timestamp"], 8999, r"frames\[2\]\.timestamp = 8999 us goes back; the frame before has 9000 us"),
        (["frames", 2, "timestamp"], 10**12, r"timestamp = 1000000000000 us is 1e\+06 s after the first; must be at most 3600"),
        (["frames", 2, "timestamp"], 10**400, r"frames\[2\]\.timestamp = an integer of 1329 bits"),
        (["frames", 1, "hands"], KeyError, r"frames\[1\]\.hands is missing"),
        (["frames", 1, "hands"], 3, r"frames\[1\]\.hands is 3; expected a list"),
        (["frames", 1, "hands", 0], 3, r"frames\[1\]\.hands\[0\] is 3; expected an object"),
        (["frames", 1, "hands", 0, "id"], 7.5, r"hands\[0\]\.id = 7\.5"),
        (["frames", 1, "hands", 0, "id"], False, r"hands\[0\]\.id = False"),
        (["frames", 1, "hands", 0, "type"], "both", r"hands\[0\]\.type = 'both' is not allowed; allowed: left, right"),
        (["frames", 1, "hands", 0, "type"], ["left"], r"hands\[0\]\.type = a list of 1"),
        (["frames", 1, "hands", 0, "palmPosition"], [0, 0], r"palmPosition is a list of 2; expected three numbers"),
        (["frames", 1, "hands", 0, "palmPosition"], [0, 1e300, 0], r"tion\[1\] = 1e\+300; must be .* 10000 mm"),
        (["frames", 1, "hands", 0, "palmNormal"], [0, 0, 0], r"palmNormal = \[0, 0, 0\] has length 0"),
        (["frames", 1, "hands", 0, "palmNormal"], [0, 0, -1], r"palmNormal = \[0, 0, -1\] lies along the direction"),
        (["frames", 1, "hands", 0, "direction"], KeyError, r"direction is missing; required in every hand"),
        (["frames", 1, "pointables"], {}, r"frames\[1\]\.pointables is an object of 0; expected a list"),
        (["frames", 1, "pointables", 3], "x", r"pointables\[3\] is 'x'"),
        (["frames", 1, "pointables", 3, "handId"], None, r"pointables\[3\]\.handId = null"),
        (["frames", 1, "pointables", 3, "type"], 5, r"pointables\[3\]\.type = 5; must be 0 \(thumb\) to 4"),
        (["frames", 1, "pointables", 3, "type"], 2, r"pointables\[3\]\.type = 2 is given twice for hand 7"),
        (["frames", 1, "pointables", 3, "width"], -1, r"pointables\[3\]\.width = -1"),
        (["frames", 1, "pointables", 3, "tipPosition"], KeyError, r"\[3\]\.tipPosition is missing; required in every pointable"),
        (["frames", 1, "pointables", 3, "tipPosition"], [0, 0, None], r"tipPosition\[2\] = null"),
        (["frames", 1, "pointables", 3, "tipPosition"], [0, 0, 10_001], r"tipPosition\[2\] = 10001; must be"),
        (["frames", 1, "pointables", 3, "tipPosition"], "a" * 500, r"tipPosition is 'a{39}\.\.\.; expected"),
    ],
)  # fmt: skip
def test_a_wrong_member_is_refused_with_its_place(load, path, value, message):
    with pytest.raises(InputError, match=message) as refused:
        load(changed(path, value))
    place = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path[:2]).lstrip(".")
    assert f"some.leap.json: {place}" in str(refused.value)


def test_one_hand_twice_in_a_frame_is_refused(load):
    with pytest.raises(InputError, match=r"frames\[0\]\.hands\[1\]\.id = 7 is given twice"):
        load(a_recording([0], lambda _: [a_hand(), a_hand()]))


GOOD = json.dumps(a_recording(range(0, 900_000, 9_000))).encode()
PACKED = gzip.compress(GOOD, mtime=0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it is empty"),
        (b" \n" * 9, "it is empty, or blank"),
        (b"\0" * 100, "it begins with .*; hands are read from"),
        (b"null", "it begins with 'n', so it is not JSON"),
        (b"[1, 2]", r"frames\[0\] is 1; expected an object"),
        (b"{}", "frames is missing or empty"),
        (b"{1: 2}", "a member's name"),
        (b'{"a" 1}', "a: '1' seen; expected ':'"),
        (b'{"a": 1 "b": 2}', "a: '\"' after it; expected ',' or '}'"),
        (b'{"a": 1, "a": 2}', "given twice"),
        (b'{"a": tru}', "a: not JSON"),
        (GOOD[:-1], "the file ends"),
        (GOOD[: len(GOOD) // 2], r"frames\[\d+\]: not JSON, or cut short: .* at character \d+"),
        (GOOD + b"{}", "follows the object; expected the end"),
        (
            GOOD.replace(b'"timestamp": ', b'"timestamp": NaN, "was": '),
            r"frames\[0\]\.timestamp: NaN is not allowed; expected finite",
        ),
        (GOOD.replace(b'"timestamp": ', b'"timestamp": -Infinity, "was": '), r"frames\[0\]\.timestamp: -Infinity is not allowed"),
        (GOOD.replace(b'"timestamp": ', b'"timestamp": 1e999, "was": '), r"frames\[0\]\.timestamp = inf"),
        (GOOD.replace(b"18000", b"9" * 5000), r"frames\[2\]: a number cannot be read"),
        (GOOD[:3000] + b"\xff" + GOOD[3000:], "byte 0xff is not UTF-8"),
        (PACKED[:-5], "gzip data is broken"),
        (PACKED[:100], "gzip data is broken"),
        (PACKED[:300] + b"\0" * 40 + PACKED[340:], "gzip data is broken"),
        (b"\x1f\x8bno such thing", "gzip data is broken|cannot be read"),
        (b"\x89HDF\r\n\x1a\n", "it is an HDF5 file"),
        (b'"frames"' + b"\xc3", "one text in quotes|not UTF-8"),
    ],
)
def test_a_broken_file_is_refused_with_its_place(load, content, message):
    with pytest.raises(InputError, match=message):
        load(content)


@pytest.mark.slow
@pytest.mark.parametrize(
    "content",
    [
        b"[" * 100_000_000,
        b'{"metadata": ' + b"[" * 100_000_000,
        gzip.compress(b'{"frames": [' + b'{"a":' * 20_000_000, 1, mtime=0),
        gzip.compress(b'{"metadata": "' + b"a" * 100_000_000, 1, mtime=0),
        b'{"frames": [' + b"[],[],[]," * 1_000_000,
        b'{"metadata": [' + b"[]," * 1_000_000,
        b"{" + b",".join(b'"k%d": 1' % number for number in range(100_000)) + b"}",
    ],
    ids=["lists", "lists in a member", "objects in a frame", "a long string", "many lists", "a long list", "many members"],
)
def test_a_hundred_megabytes_of_nonsense_are_refused_in_little_memory(tmp_path, content):
    path = tmp_path / "nonsense"
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            load_leap(path)
        # The longest value allowed is 1 MiB of text and is read in doubling steps; as empty lists it takes some 25 times that.
        assert tracemalloc.get_traced_memory()[1] < 64 << 20
    finally:
        tracemalloc.stop()


def test_text_beyond_the_limit_is_refused(load, monkeypatch):
    monkeypatch.setattr(text_source, "LARGEST_FILE_BYTES", 1 << 20)
    with pytest.raises(InputError, match="longer than the allowed 1 MiB"):
        load(gzip.compress(b"{" + b" " * (4 << 20)))


def test_a_constant_that_is_no_json_is_found_wherever_it_stands(load):
    content = a_recording([0, 9000])
    content["frames"][1]["pointables"][3]["tipPosition"][2] = float("nan")
    with pytest.raises(InputError, match=r"frames\[1\]\.pointables\[3\]\.tipPosition\[2\]: NaN is not allowed"):
        load(content)
    content["frames"][1]["pointables"][3]["tipPosition"][2] = 0.0
    content["frames"][1]["hands"][0]["confidence"] = float("inf")  # not a member anyone reads, but no JSON either
    with pytest.raises(InputError, match=r"frames\[1\]\.hands\[0\]\.confidence: Infinity is not allowed"):
        load(content)


def test_what_is_no_file_is_refused(tmp_path):
    for source in (tmp_path, tmp_path / "missing.json", "/dev/zero", "no\0name", "n" * 5000, "unheard_of"):
        with pytest.raises(InputError, match=r"expected a file|zero byte|cannot be read"):
            load_hand(source)
        with pytest.raises(InputError, match=r"expected a file|zero byte|cannot be read"):
            load_leap(source)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


def places(value, path=()):
    """Every place in nested lists and objects."""
    yield path
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from places(inner, (*path, key))


BASE = a_recording([0, 9000])
PLACES = [place for place in places(BASE) if place]


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(PLACES), JSON, st.booleans())
def test_anything_anywhere_loads_or_is_refused(load, place, value, remove):
    content = copy.deepcopy(BASE)
    owner = content
    for key in place[:-1]:
        owner = owner[key]
    if remove:
        del owner[place[-1]]
    else:
        owner[place[-1]] = value
    with contextlib.suppress(InputError):
        recording = load(content)
        for track in recording.tracks:
            assert np.isfinite(track.position_m).all()
            assert np.isfinite(track.orientation_xyzw).all()
            assert (np.diff(track.time_ns) > 0).all()


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, len(PACKED) - 1), st.binary(min_size=1, max_size=8), st.booleans())
def test_flipped_bytes_load_or_are_refused(load, at, noise, packed):
    content = PACKED if packed else GOOD
    at = at if packed else at * len(GOOD) // len(PACKED)
    with contextlib.suppress(InputError):
        load(content[:at] + noise + content[at + len(noise) :])


# -- the recordings ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "frames", "seconds", "sides"),
    [  # the recordings' own description
        ("grab", 374, 3.3, ["right"]),
        ("wave", 111, 0.95, ["right"]),
        ("waiting", 326, 3.0, ["right"]),
        ("flapping", 328, 3.1, ["right", "left"]),
    ],
)
def test_recorded_hands_are_whole_and_every_pose_is_accepted(recordings, name, frames, seconds, sides):
    recording = load_hand(recordings / f"{name}.leap.json.gz")
    assert recording.frame_count == frames
    assert recording.duration_s == pytest.approx(seconds, abs=0.05)
    assert [track.side for track in recording.tracks] == sides
    assert recording.dropped == {}
    for track in recording.tracks:
        assert len(track) == frames
        poses = list(track.frames())
        assert not any(check_frame(pose, before) for pose, before in zip(poses, [None, *poses], strict=False))


def test_recorded_bones_and_wrists_are_a_persons(recordings):
    for name in ("grab", "wave", "waiting", "flapping"):
        for track in load_hand(recordings / f"{name}.leap.json.gz").tracks:
            to_wrist = np.linalg.norm(track.joint_m("wrist") - track.joint_m("middle_proximal"), axis=1)
            assert (to_wrist > 0.075).all()
            assert (to_wrist < 0.105).all()
            thumb_to_wrist = np.linalg.norm(track.joint_m("wrist") - track.joint_m("thumb_metacarpal"), axis=1)
            assert (thumb_to_wrist < 0.04).all()


def test_recorded_joints_point_along_their_bones(recordings):
    for track in load_hand(recordings / "flapping.leap.json.gz").tracks:
        for near, far in (("index_proximal", "index_intermediate"), ("thumb_proximal", "thumb_distal")):
            bone = track.joint_m(far) - track.joint_m(near)
            turn = Rotation.from_quat(track.orientation_xyzw[:, JOINT[near]])
            ahead = turn.apply([0.0, 0.0, -1.0])
            np.testing.assert_allclose(ahead, bone / np.linalg.norm(bone, axis=1, keepdims=True), atol=1e-12)

"""Hands in every wrapper: each readable way to write the same frames gives the same poses, and what is not is named."""

from __future__ import annotations

import base64
import gzip
import io
import json
import re
import tracemalloc
import zipfile

import h5py
import numpy as np
import pytest
from hostile_hands import damaged, loads_or_refuses
from hypothesis import HealthCheck, given, settings, strategies as st
from leap_hands import a_hand, a_recording, a_tap
from test_lz_string import ORIGINAL

from haptics.errors import InputError
from haptics.scene.hand_files import lz_string
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.motion import judge_motion
from haptics.scene.hands.recording import LARGE_SHARE

TAP = a_tap()
FRAMES = TAP["frames"]


def text(value: object) -> bytes:
    return json.dumps(value).encode()


def lines(values: list) -> bytes:
    return b"".join(text(value) + b"\n" for value in values)


def packed(finger_types: bool = True, extra: bool = False) -> list:
    """As LeapJS Playback 0.2 packs them: a schema, then rows."""
    hand_keys = ["id", "type", "direction", "palmNormal", "palmPosition"]
    points = ["mcpPosition", "pipPosition", "dipPosition", "tipPosition"]
    finger_keys = ["handId", "id", "tool", *points, "width", *(["type"] if finger_types else [])]
    box = [{"interactionBox": ["center", "size"]}] if extra else []
    rows: list = [["id", "timestamp", {"hands": [hand_keys]}, {"pointables": [finger_keys]}, *box]]
    for number, frame in enumerate(FRAMES):
        hands = [[hand[key] for key in hand_keys] for hand in frame["hands"]]
        fingers = [[{**f, "id": 10 * f["handId"] + f["type"]}[key] for key in finger_keys] for f in frame["pointables"]]
        rows.append([number, frame["timestamp"], hands, fingers, *([[[0, 200, 0], [1, 1, 1]]] if extra else [])])
    return rows


def without_types() -> dict:
    """Frames whose fingers are known by their ids only."""
    content = a_tap()
    for frame in content["frames"]:
        for pointable in frame["pointables"]:
            pointable["id"] = 10 * pointable["handId"] + pointable.pop("type")
    return content


def in_lz_string(content: bytes) -> bytes:
    """The same text as 8-bit literals and nothing else: valid lz-string, though its writer would do better."""
    bits, width, room = "", 2, 1
    for index, byte in enumerate(content):
        bits += "0" * width + f"{byte:08b}"[::-1]
        for _ in range(1 if index == 0 else 2):
            room -= 1
            if room == 0:
                room, width = 1 << width, width + 1
    bits += f"{2:0{width}b}"[::-1]
    bits += "0" * (-len(bits) % 24)
    return base64.b64encode(int(bits, 2).to_bytes(len(bits) // 8, "big"))


EVENTS = [{"state": "connected"}, *({"state": "frame", "frame": frame} for frame in FRAMES), {"event": {"type": "deviceEvent"}}]
READABLE = {
    "no metadata": text({"frames": FRAMES}),
    "metadata of null": text({"metadata": None, "frames": FRAMES}),
    "no version": text({"frames": FRAMES, "metadata": {"generatedBy": "LeapJS Playback 0.1-pre"}}),
    "version as text": text({"frames": FRAMES, "metadata": {"protocolVersion": "6"}}),
    "another version": text({"frames": FRAMES, "metadata": {"protocolVersion": 5}}),
    "version of another kind": text({"frames": FRAMES, "metadata": {"protocolVersion": [True]}}),
    "a list": text(FRAMES),
    "by line": lines([{"version": 6}, *FRAMES]),
    "by line with blanks": b"\n" + lines(FRAMES).replace(b"\n", b"\r\n\r\n"),
    "by line without a break at the end": lines(FRAMES)[:-1],
    "events by line": lines(EVENTS),
    "a list of events' frames": text([event["frame"] for event in EVENTS if "frame" in event]),
    "packed": text({"metadata": {"formatVersion": 2, "protocolVersion": 6}, "frames": packed()}),
    "packed, no types": text({"frames": packed(finger_types=False)}),
    "packed with more": text({"frames": packed(extra=True)}),
    "packed in a list": text(packed()),
    "no types": text(without_types()),
    "UTF-8 with its mark": b"\xef\xbb\xbf" + text(TAP),
    "UTF-16 with its mark": text(TAP).decode().encode("utf-16"),
    "UTF-16 of the other order": b"\xfe\xff" + text(TAP).decode().encode("utf-16-be"),
    "UTF-16 without a mark": text(TAP).decode().encode("utf-16-le"),
    "lz-string": in_lz_string(text(TAP)),
    "lz-string by line": in_lz_string(lines(FRAMES)),
    "lz-string, packed": in_lz_string(text({"frames": packed()})),
}  # fmt: skip


@pytest.fixture
def write(tmp_path):
    def to_file(content: bytes, name: str = "hand"):
        path = tmp_path / name
        path.write_bytes(content)
        return path

    return to_file


@pytest.mark.parametrize("zipped", [False, True], ids=["plain", "gzip"])
@pytest.mark.parametrize("name", READABLE)
def test_the_same_frames_in_any_wrapper_are_the_same_poses(write, name, zipped):
    reference = load_hand(write(text(TAP), "reference"))
    content = gzip.compress(READABLE[name], mtime=0) if zipped else READABLE[name]
    found = load_hand(write(content, "misnamed.csv"))
    (track,), (wanted,) = found.tracks, reference.tracks
    assert track.side == wanted.side
    for field in ("time_ns", "position_m", "orientation_xyzw", "radius_m"):
        np.testing.assert_array_equal(getattr(track, field), getattr(wanted, field))
    assert (found.frame_count, found.duration_s, found.dropped, found.refused) == (12, 0.11, {}, ())


@pytest.mark.parametrize(
    ("name", "note"),
    [
        ("no metadata", "does not state its protocol version; its frames are read as 6"),
        ("a list", "does not state its"),
        ("events by line", "does not state its"),
        ("another version", "states protocol version '5'"),
        ("version of another kind", "states protocol version '[True]'"),
        ("version as text", None),
        ("by line", None),
    ],
)
def test_the_version_is_a_hint_and_a_note_says_what_was_made_of_it(write, name, note):
    found = load_hand(write(READABLE[name])).notes
    assert [note in one for one in found] == [True] if note else found == ()


def test_the_genuine_file_of_a_browsers_recorder(recordings):
    found = load_hand(recordings / "finger-tap-54fps.json.lz")
    (track,) = found.tracks
    assert (track.side, len(track), found.frame_count) == ("right", 89, 89)
    assert found.duration_s == pytest.approx(1.636, abs=1e-3)
    np.testing.assert_allclose(track.joint_m("palm")[0], [0.0277403, 0.150743, 0.0455955], atol=1e-12)
    np.testing.assert_allclose(track.joint_m("thumb_tip")[0], [-0.0536964, 0.144391, 0.0249789], atol=1e-12)
    assert found.notes == found.refused == ()


def made(kind: str) -> bytes:
    """The beginning of files of other kinds."""
    if kind == "zip":
        with zipfile.ZipFile(buffer := io.BytesIO(), "w") as archive:
            archive.writestr("hand.json", text(TAP))
        return buffer.getvalue()
    if kind == "npz":
        np.savez(buffer := io.BytesIO(), a=np.zeros(3))
        return buffer.getvalue()
    if kind == "npy":
        np.save(buffer := io.BytesIO(), np.zeros(3))
        return buffer.getvalue()
    with h5py.File(buffer := io.BytesIO(), "w") as file:
        file["a"] = [1.0]
    return buffer.getvalue()


WEBXR = {"inputSources": [{"hand": {"wrist": {"position": [0, 0, 0]}, "thumb-tip": {"position": [0, 0, 0]}}}]}
LANDMARK = [{"x": 0.5, "y": 0.5, "z": 0.0}] * 21


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "it is empty"),
        (b" \n\t ", "it is empty, or blank"),
        (gzip.compress(b""), "it is empty"),
        (b"time,x,y,z\n0,1,2,3\n", "looks like CSV, a table of separated values"),
        (b"time;x;y;z\n0;1,5;2;3\n", "looks like CSV, a table of separated values"),
        (b"t,x\n0,1\n", "looks like CSV, a table of separated values, with the columns 't, x', none of them of a joint"),
        (b"time 0 0 0", "it begins with 't', so it is not JSON of frames; hands are read from: "),
        (b"HIERARCHY\nROOT Hips\n{\n", "a BVH motion"),
        (b"Kaydara FBX Binary  \x00\x1a\x00", "an FBX file"),
        (b"; FBX 7.7.0 project file\n", "an FBX file"),
        (b"glTF\x02\0\0\0", "a binary glTF model"),
        (text({"asset": {"version": "2.0"}, "scenes": []}), "a glTF model"),
        (text(WEBXR), "objects[0] has no time; expected a member `time`"),
        (lines([{"time": 1, "joints": {}}] * 5), "objects[0] has no joints; expected them by name"),
        (text({"frames": [WEBXR["inputSources"][0]] * 5}), "frames[0] has no time"),
        (text({"multiHandLandmarks": [LANDMARK]}), "MediaPipe"),
        (text([{"handedness": "Left", "landmarks": LANDMARK}] * 9), "MediaPipe"),
        (text({"frames": [{"hand_landmarks": LANDMARK}] * 9}), "MediaPipe"),
        (text([{"keypoints3D": LANDMARK}] * 9), "keypoints of a picture, which have no scale"),
        (text([LANDMARK]), "lists of points"),
        (text({"metadata": {"protocolVersion": 4}, "frames": [{**FRAMES[0], "hands": [{}]}]}), "joints of fingers came with 6"),
        (b"<!DOCTYPE html>\n<html><body>404", "a web page"),
        (b"<?xml version='1.0'?><COLLADA/>", "XML"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "a Git LFS pointer"),
        (made("zip"), "a zip archive"),
        (made("npz"), "a zip archive"),
        (made("npy"), "a NumPy array"),
        (gzip.compress(gzip.compress(text(TAP))), "gzip twice"),
        (gzip.compress(made("hdf5")), "an HDF5 file"),
        (made("hdf5"), "HDF5"),
        (b"haptics journal 1\n....", "`haptics recording recover`"),
        (b"\x89PNG\r\n\x1a\n", "a picture"),
        (b"\0\0\0\x20ftypisom", "a video"),
        (text(ORIGINAL[0][1]), "one text in quotes"),
        (base64.b64encode(text(TAP)), "JSON in plain base64"),
        (base64.b64encode(gzip.compress(text(TAP), mtime=0)), "gzip in plain base64"),
        (gzip.compress(text(TAP))[:-20], "gzip data is broken"),
        (in_lz_string(text(TAP))[:-40], "lz-string data is cut short"),
        (text(TAP)[:-40], "cut short"),
        (lines(FRAMES)[:-40], "objects[11]"),
        (text({"metadata": {"protocolVersion": 6}}), "frames is missing or empty"),
        (lines([{"version": 6}, {"state": "connected"}]), "frames is missing or empty"),
        (text(packed()[:1]), "frames is missing or empty"),
        (text({"frames": [["id", 3]]}), "schema is not a name"),
        (text({"frames": [["id", "id"]]}), "names 'id' twice"),
        (text({"frames": [packed()[0], *([1, 2] for _ in range(9))]}), "frames[1] is a row of 2; expected a list of 4"),
        (text({"frames": [packed()[0], *([1, 2, 3, []] for _ in range(9))]}), "frames[1].hands is not a list"),
        (text(TAP) + text(TAP), "follows the object; expected the end"),
        (text(FRAMES) + b"[]", "follows the list; expected the end"),
        (lines(FRAMES) + b"[]", "objects[12]: '[' seen; expected '{'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "file",  # the same in each worker: archives carry the time
)  # fmt: skip
def test_what_cannot_be_read_is_called_by_its_name(write, content, words):
    path = write(content, "it.json")
    with pytest.raises(InputError) as refused:
        load_hand(path)
    assert any(word in str(refused.value) for word in words.split("|")), refused.value
    assert "it.json" in str(refused.value)


# -- one bad pose ----------------------------------------------------------------------------------------------------------------


def spoilt(place: list, value: object, index: int = 5, count: int = 12) -> dict:
    """A recording with one member of one frame replaced, or removed where ``value`` is ``KeyError``."""
    content = a_tap(count)
    owner = content["frames"][index]
    for key in place[:-1]:
        owner = owner[key]
    if value is KeyError:
        del owner[place[-1]]
    else:
        owner[place[-1]] = value
    return content


BAD = [
    (["timestamp"], KeyError, r"frames\[5\]\.timestamp is missing"),
    (["timestamp"], None, r"frames\[5\]\.timestamp = null"),
    (["timestamp"], float("nan"), r"frames\[5\]\.timestamp: NaN is not allowed"),
    (["timestamp"], 10**400, r"frames\[5\]\.timestamp = an integer of 1329 bits"),
    (["timestamp"], 900_000_000, r"frames\[5\]\.timestamp = 900000000 us lies ahead of the next frame's 5060000 us"),
    (["timestamp"], 5_000_001, r"frames\[5\]\.timestamp = 5000001 us goes back"),
    (["hands"], None, r"frames\[5\]\.hands is null"),
    (["hands", 0], None, r"frames\[5\]\.hands\[0\] is null"),
    (["hands", 0, "type"], "both", r"hands\[0\]\.type = 'both' is not allowed"),
    (["hands", 0, "palmNormal"], [0, 0, 0], r"palmNormal = \[0, 0, 0\] has length 0"),
    (["hands", 0, "palmPosition"], "here", r"palmPosition is 'here'; expected three numbers"),
    (["pointables"], 3, r"frames\[5\]\.pointables is 3"),
    (["pointables", 2], None, r"pointables\[2\] is null"),
    (["pointables", 2, "type"], 9, r"pointables\[2\]\.type = 9"),
    (["pointables", 2, "tipPosition"], KeyError, r"pointables\[2\]\.tipPosition is missing"),
    (["pointables", 2, "tipPosition"], None, r"pointables\[2\]\.tipPosition is null"),
    (["pointables", 2, "tipPosition"], [0, None, 0], r"pointables\[2\]\.tipPosition\[1\] = null"),
    (["pointables", 2, "tipPosition"], [0, float("nan"), 0], r"pointables\[2\]\.tipPosition\[1\]: NaN is not allowed"),
    (["pointables", 2, "tipPosition"], [0, 1e300, 0], r"tipPosition\[1\] = 1e\+300; must be"),
    (["pointables", 2, "tipPosition"], [0, 0], r"tipPosition is a list of 2; expected three numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("place", "value", "reason"), BAD)
def test_one_bad_pose_is_left_out_with_its_reason_and_the_rest_is_as_before(write, place, value, reason):
    found, whole = load_hand(write(text(spoilt(place, value)))), load_hand(write(text(a_tap()), "whole"))
    (refused,) = found.refused
    assert re.search(reason, refused.reason), refused.reason
    rest = np.arange(12) != 5
    np.testing.assert_array_equal(found.tracks[0].time_ns, whole.tracks[0].time_ns[rest])
    np.testing.assert_array_equal(found.tracks[0].position_m, whole.tracks[0].position_m[rest])


def test_a_bad_hand_leaves_the_other_one_in_its_frame(write):
    content = a_tap(hands=lambda _: [a_hand(7), a_hand(8, "left", 300.0)])
    content["frames"][3]["pointables"][7]["dipPosition"] = None  # the left middle finger
    found = load_hand(write(text(content)))
    assert [(track.side, len(track)) for track in found.tracks] == [("right", 12), ("left", 11)]
    assert [(pose.side, pose.time_ns) for pose in found.refused] == [("left", 30_000_000)]


@pytest.mark.parametrize(("bad", "loads"), [(19, True), (20, False)])
def test_a_large_share_of_bad_poses_spoils_the_recording(write, bad, loads):
    assert LARGE_SHARE == 0.2
    content = a_tap(100)
    for frame in content["frames"][:bad]:
        frame["pointables"][0]["tipPosition"][1] = None
    if loads:
        assert len(load_hand(write(text(content))).refused) == bad
    else:
        with pytest.raises(InputError, match=r"frames\[0\]\.pointables\[0\]\.tipPosition\[1\] = null.*\(20 of 100 poses"):
            load_hand(write(text(content)))


def test_a_file_of_nothing_but_bad_frames_is_not_read_to_its_end(write):
    path = write(b'{"frames": [' + b"null," * 3_000_000 + b"null]}")
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"frames\[0\] is null; expected an object \(1001 of 1001"):
            load_hand(path)
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


def test_repeated_and_stray_are_still_counted_and_not_refused(write):
    content = a_recording([0, 9000, 9000, 18_000])
    del content["frames"][3]["pointables"][4]
    found = load_hand(write(text(content)))
    assert found.dropped == {"frames that repeat a time stamp": 1, "hands without all five fingers": 1}
    assert found.refused == ()


def test_bombs_in_lz_string_are_refused_in_bounded_memory(write, monkeypatch):
    monkeypatch.setattr(lz_string, "LARGEST_TEXT_CHARS", 16 << 10)
    path = write(in_lz_string(b'{"frames": [' + b" " * (3 << 13)))
    for content in (path, write(gzip.compress(path.read_bytes()), "zipped")):
        tracemalloc.start()
        try:
            with pytest.raises(InputError, match="longer than the allowed 16 Ki characters"):
                load_hand(content)
            # Two bytes a character, two entries of eight a literal, and a piece of the file as bits.
            assert tracemalloc.get_traced_memory()[1] < 6 << 20
        finally:
            tracemalloc.stop()


# -- anything at all -----------------------------------------------------------------------------------------------------------

SEEDS = {
    "packed": text({"frames": packed()}),
    "events": lines(EVENTS),
    "lines": lines(FRAMES),
    "lz-string": in_lz_string(text(TAP)),
    "UTF-16": text(TAP).decode().encode("utf-16"),
    "gzip": gzip.compress(lines(FRAMES), mtime=0),
}
HOSTILE = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@HOSTILE
@given(st.sampled_from(list(SEEDS)), st.integers(0, 10**6), st.binary(min_size=1, max_size=6), st.booleans())
def test_flipped_cut_or_doubled_bytes_load_or_are_refused(write, seed, at, noise, cut):
    loads_or_refuses(write(damaged(SEEDS[seed], at, noise, cut)))


@HOSTILE
@given(
    st.binary(max_size=40),
    st.sampled_from([b"", b"{", b"[", b"[[", b"N4", b"\x37\x82", b"\xff\xfe", b"\x1f\x8b", b'{"frames":[']),
)
def test_any_bytes_load_or_are_refused(write, content, start):
    loads_or_refuses(write(start + content))


VALUE = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=2),
    max_leaves=6,
)


@HOSTILE
@given(st.integers(0, 12), st.lists(st.integers(0, 4), min_size=1, max_size=4), VALUE)
def test_any_value_in_packed_rows_loads_or_is_refused(write, row, way, value):
    rows = packed()
    owner = rows[row % len(rows)]
    for key in way[:-1]:
        inner = owner[key % len(owner)] if isinstance(owner, list) and owner else None
        if not isinstance(inner, list):
            break
        owner = inner
    if owner:
        owner[way[-1] % len(owner)] = value
    loads_or_refuses(write(text({"frames": rows})))


@HOSTILE
@given(st.lists(VALUE, max_size=5), st.booleans())
def test_any_values_by_line_or_in_a_list_load_or_are_refused(write, values, by_line):
    loads_or_refuses(write(lines(values) if by_line else text(values)))


PLACES = (["timestamp"], ["hands"], ["hands", 0], ["hands", 0, "palmPosition"], ["pointables"], ["pointables", 2, "tipPosition"])


@HOSTILE
@given(st.dictionaries(st.integers(0, 11), st.tuples(st.sampled_from(PLACES), VALUE), max_size=4))
def test_several_bad_members_load_or_are_refused(write, spoils):
    content = a_tap()
    for index, (place, value) in spoils.items():
        owner = content["frames"][index]
        for key in place[:-1]:
            owner = owner[key]
        owner[place[-1]] = value
    loads_or_refuses(write(text(content)))


def test_a_clock_that_stands_still_is_no_recording(tmp_path):
    path = tmp_path / "seconds.json"
    path.write_bytes(text(a_recording([5] * 9 + [6] * 3)))
    with pytest.raises(InputError, match=r"10 of 12 frames repeat a timestamp; each needs its own, .* microseconds"):
        load_hand(path)


@pytest.mark.parametrize(("unit", "how"), [(1e3, "slow"), (1e-3, "fast")])
def test_time_stamps_in_another_unit_are_noticed(tmp_path, unit, how):
    path = tmp_path / "other.json"
    content = a_tap()
    for frame in content["frames"]:
        frame["timestamp"] *= unit
    path.write_bytes(text(content))
    note = f"too {how} for a tracker; are the time stamps in microseconds?"
    if how == "slow":
        assert note in judge_motion(load_hand(path)).notes[-1]
        return
    with pytest.raises(InputError, match="of the right hand cannot be used") as refused:
        judge_motion(load_hand(path))
    assert note in str(refused.value)


def test_lengths_in_metres_are_named(tmp_path):
    path = tmp_path / "metres.json"
    content = a_tap()
    for frame in content["frames"]:
        for owner in (*frame["hands"], *frame["pointables"]):
            owner.update({key: [part / 1e3 for part in value] for key, value in owner.items() if key.endswith("Position")})
    path.write_bytes(text(content))
    with pytest.raises(InputError, match=r"are its lengths in the right unit \(.* a Leap recording millimetres\)\?"):
        judge_motion(load_hand(path))

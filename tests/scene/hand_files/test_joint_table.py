"""Joints as CSV: a row a pose and a row a joint, in the columns, separators and bases that programs write."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from engine_hands import ENGINES, UNITY, as_engine, assert_same, shipped

from haptics.errors import InputError
from haptics.scene.hand_files import joint_table
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.joints import JOINTS

TRACK = shipped()
PARTS = ("x", "y", "z", "qx", "qy", "qz", "qw")
SAID = "# basis=openxr unit=m\n"


@pytest.fixture
def load(tmp_path):
    def from_text(text, **told):
        path = tmp_path / "hand.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_hand(path, **told)

    return from_text


def numbers(engine="openxr", unit_m=None):
    """Rows of 182 numbers."""
    return np.concatenate(as_engine(TRACK, engine, unit_m), axis=-1).reshape(len(TRACK), -1).tolist()


def wide(rows=None, names=None, mark=",", time="time_ns", per_ns=1):
    """A row a pose, in the plain form or with other names and marks."""
    columns = names or [f"{joint}_{part}" for joint in JOINTS for part in PARTS]
    lines = [mark.join([time, "side", *columns])]
    for time_ns, row in zip(TRACK.time_ns.tolist(), rows or numbers(), strict=True):
        lines.append(mark.join([repr(time_ns / per_ns if per_ns > 1 else time_ns), "right", *map(repr, row)]))
    return "\n".join(lines) + "\n"


def tall(rows=None):
    """A row a joint."""
    lines = ["time_ns,side,joint,x,y,z,qx,qy,qz,qw"]
    for time_ns, row in zip(TRACK.time_ns.tolist(), rows or numbers(), strict=True):
        for at, joint in enumerate(JOINTS):
            lines.append(",".join([str(time_ns), "right", joint, *map(repr, row[7 * at : 7 * at + 7])]))
    return "\n".join(lines) + "\n"


def test_a_row_of_a_pose_written_by_hand(load):
    places = {"wrist": (0, 0, 9), "middle_proximal": (0, 0, 0), "middle_tip": (0, 0, -9)}
    columns, row = [], []
    for joint in JOINTS:
        x, y, z = places.get(joint, (0, 0, -1))
        columns += [f"{joint}_{part}" for part in PARTS]
        row += [x, y, z, 0, 0, 0, 1]
    lines = [f"{time},left,{','.join(map(str, row))}" for time in (5, 15)]
    (track,) = load("# basis=godot, unit=cm, time=ms\ntime,side," + ",".join(columns) + "\n" + "\n".join(lines)).tracks
    assert (track.side, track.time_ns.tolist()) == ("left", [0, 10_000_000])
    np.testing.assert_allclose(track.joint_m("wrist"), [[0.0, 0.0, 0.09]] * 2, atol=1e-15)
    np.testing.assert_allclose(track.joint_m("middle_tip"), [[0.0, 0.0, -0.09]] * 2, atol=1e-15)


@pytest.mark.parametrize("form", [wide, tall])
@pytest.mark.parametrize("engine", ENGINES)
def test_every_basis_gives_the_poses_back(load, form, engine):
    unit = "cm" if engine == "unreal" else "m"
    found = load(f"# basis={engine} unit={unit}\n" + form(numbers(engine)))
    assert_same(found.tracks[0], TRACK)
    assert found.notes == found.refused == ()


SPELT = {
    "Unity": [f"{UNITY[joint]}{part}" for joint in JOINTS for part in ("PosX", "PosY", "PosZ", "RotX", "RotY", "RotZ", "RotW")],
    "dots": [f"{UNITY[joint]}.{part}" for joint in JOINTS for part in ("position.x", "position.y", "position.z", "rotation.x",
                                                                       "rotation.y", "rotation.z", "rotation.w")],
    "OpenXR": [f"XR_HAND_JOINT_{joint.upper()}_EXT {part}" for joint in JOINTS for part in ("px", "py", "pz", *PARTS[3:])],
    "blanks": [f"{joint.replace('_', ' ')} {part}" for joint in JOINTS for part in PARTS],
    "the side before": [f"right_{joint}_{part}" for joint in JOINTS for part in PARTS],
}  # fmt: skip


@pytest.mark.parametrize("names", SPELT)
def test_columns_by_other_names(load, names):
    assert_same(load(SAID + wide(names=SPELT[names])).tracks[0], TRACK)


@pytest.mark.parametrize("mark", [";", "\t"])
def test_other_separators_and_the_comma_of_decimals(load, mark):
    text = wide(mark=mark)
    assert_same(load(SAID + text).tracks[0], TRACK)
    assert_same(load(SAID + text.replace(".", ",")).tracks[0], TRACK)


def test_quotes_breaks_blank_lines_comments_and_other_columns(load):
    head, *rows = wide().splitlines()
    text = "\r\n".join([f'"{head}"'.replace(",", '","') + ",fps", "", "# a remark", *(f"{row},60" for row in rows)])
    for content in (SAID + text, text, "\ufeff" + SAID + text, (SAID + text).encode("utf-16")):
        assert_same(load(content).tracks[0], TRACK)


def test_seconds_by_name(load):
    assert_same(load(SAID + wide(time="Timestamp (s)", per_ns=10**9)).tracks[0], TRACK)


def test_both_hands_in_one_row_and_one_of_them_not_tracked(load):
    head = [f"{side}_{joint}_{part}" for side in ("left", "right") for joint in JOINTS for part in PARTS]
    lines = [",".join(["time_ns", *head])]
    for time_ns, row in zip(TRACK.time_ns.tolist(), numbers(), strict=True):
        left = map(repr, row) if time_ns == 0 else [""] * len(row)
        lines.append(",".join([str(time_ns), *left, *map(repr, row)]))
    found = load(SAID + "\n".join(lines))
    assert [(track.side, len(track)) for track in found.tracks] == [("left", 1), ("right", 40)]
    assert found.dropped == {"poses without a hand: no joint has a place of its own": 39}
    assert found.refused == ()


def test_rows_of_joints_of_two_hands_may_alternate(load):
    head, *rows = tall().splitlines()
    both = [line for row in rows for line in (row, row.replace("right", "left"))]
    found = load(SAID + "\n".join([head, *both]))
    assert [(track.side, len(track)) for track in found.tracks] == [("right", 40), ("left", 40)]


def spoilt(text, line, column, value):
    rows = [row.split(",") for row in text.splitlines()]
    rows[line][column] = value
    return "\n".join(map(",".join, rows))


@pytest.mark.parametrize(
    ("text", "line", "column", "value", "reason"),
    [
        (wide(), 6, 9, "", r"line 8: no position of wrist; missing, called otherwise, or lost"),
        (wide(), 6, 9, "nan", "line 8: no position of wrist"),
        (wide(), 6, 9, "inf", "line 8: no position of wrist"),
        (wide(), 6, 9, "lost", "line 8: no position of wrist"),
        (wide(), 6, 9, "1e7", "line 8: no position of wrist"),
        (wide(), 6, 12, "-", "line 8: no orientation of wrist"),
        (wide(), 6, 1, "both", "line 8: side = 'both' is not allowed"),
        (wide(), 6, 0, "soon", "line 8: time = 'soon'; expected a number"),
        (wide(), 6, 0, "9" * 400, "line 8: time = '9"),
        (wide(), 6, 0, "5,5", "line 8 has 185 cells; expected 184"),
        (wide(), 6, 1, 'a"b"', "line 8"),
        (tall(), 6 * 26, 3, "", "no position of little_tip"),
        (tall(), 6 * 26, 2, "elbow", "no position of little_tip"),
        (tall(), 6 * 26, 2, "palm", "no position of palm, little_tip"),
    ],
)
def test_one_bad_row_costs_its_own_pose_only(load, text, line, column, value, reason):
    found = load(SAID + spoilt(text, line, column, value))
    (refused,) = found.refused
    assert reason in refused.reason
    rest = np.arange(40) != 5
    np.testing.assert_allclose(found.tracks[0].position_m, TRACK.position_m[rest], atol=1e-12)


def test_a_row_of_a_joint_that_has_no_time_costs_its_own_pose_only(load):
    found = load(SAID + spoilt(tall(), 6 * 26, 0, "soon"))
    assert len(found.refused) == 2  # the row, and the pose that lacks its joint
    assert len(found.tracks[0]) == 39


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b,c,d\n1,2,3,4\n", r"looks like CSV, .* with the columns 'a, b, c, d', none of them a time; expected time_ns, side"),
        ("time,x,y,z\n0,1,2,3\n", r"looks like CSV, .* 'time, x, y, z', none of them of a joint; expected such as index_tip_x"),
        ("time;joint;angle\n0;wrist;3\n", r"'time, joint, angle'; a row a joint has x, y, z, qx, qy, qz, qw as well"),
        ("time,side,wrist_x,wrist_x\n0,left,0,0\n", r"column 'wrist_x' is given twice"),
        ("time,side,wrist_x,Wrist.posX\n0,left,0,0\n", r"column 'Wrist\.posX' is the x of wrist, which another column is, too"),
        ("time,side,wrist_x,wrist_y,wrist_z\n0,left,0,0,0\n", r"line 2: no position of thumb_metacarpal, .*little_tip; missing"),
        ("time,side,wrist_x,wrist_y\n", r"there is no pose in it"),
        ("time,side,track,wrist_x\n0,left,-1,0\n", r"track = '-1'; expected a whole number of 0 or more"),
        ("# basis=maya\n" + wide(), r"line 1: basis = 'maya' is not allowed"),
        ("# unit=m\n# unit=cm\n" + wide(), r"unit = 'cm', but before it was 'm'"),
        ("# basis=unity\n" + wide(), r"basis = 'unity' does not fit the joints: .* openxr fits"),
        ("#\n", r"none of them a time"),
    ],
)
def test_a_table_that_cannot_be_used_says_why(load, text, message):
    with pytest.raises(InputError, match=message):
        load(text)


@pytest.mark.parametrize("form", [wide, tall])
def test_what_no_comment_declares_is_inferred_and_said(load, form):
    found = load(form(numbers("unity", 0.001)))
    assert_same(found.tracks[0], TRACK)
    assert [note.split(" was inferred")[0] for note in found.notes] == ["unit: mm", "basis: unity"]


def test_a_line_without_end_is_refused_in_little_memory(load, monkeypatch):
    monkeypatch.setattr(joint_table, "_PIECE_CHARS", 4 << 10)
    text = wide().encode() + b'"' + b"1," * (4 << 20)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"line 42 is longer than the allowed 65536 characters"):
            load(text)
        assert tracemalloc.get_traced_memory()[1] < 32 << 20  # the text that this test itself wrote takes 8
    finally:
        tracemalloc.stop()


def test_countless_hands_at_one_time_are_refused_in_little_memory(load):
    rows = "\n".join(f"0,left,{track},wrist,0,0,0" for track in range(20_000))
    with pytest.raises(InputError, match=r"no position of thumb_metacarpal.*\(20000 of 20000 poses cannot be used\)"):
        load("time,side,track,joint,x,y,z\n" + rows)

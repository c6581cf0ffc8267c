"""Joints and landmarks with anything at all in them load or are refused, and what loads and is judged good can be played."""

from __future__ import annotations

import json
import tracemalloc

import pytest
from engine_hands import json_lines, poses_of, shipped
from hostile_hands import damaged, loads_or_refuses
from hypothesis import HealthCheck, given, settings, strategies as st
from test_joint_table import tall, wide
from test_mediapipe import python_task

from haptics.errors import InputError
from haptics.scene.hand_files import pose_rows, text_source
from haptics.scene.hand_files.load import load_hand

HEADER = {"basis": "openxr", "unit": "m", "time": "s"}
LINES = json_lines(HEADER, poses_of(shipped(6), "openxr"))
RESULTS = [{"timestamp_ms": 33 * index, **python_task()} for index in range(6)]
SEEDS = {
    "lines": LINES.encode(),
    "wide": b"# basis=openxr unit=m\n" + wide().encode(),
    "tall": b"# basis=openxr unit=m\n" + tall().encode()[:30_000],
    "landmarks": json_lines({"mirrored": False}, RESULTS).encode(),
}
HOSTILE = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture
def write(tmp_path):
    def to_file(content: bytes):
        path = tmp_path / "hand"
        path.write_bytes(content)
        return path

    return to_file


@HOSTILE
@given(st.sampled_from(list(SEEDS)), st.integers(0, 10**6), st.binary(min_size=1, max_size=6), st.booleans())
def test_flipped_or_cut_bytes(write, seed, at, noise, cut):
    loads_or_refuses(write(damaged(SEEDS[seed], at, noise, cut)))


VALUE = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.sampled_from(["left", "wrist", "openxr"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=4) | st.sampled_from(["x", "position", "wrist", "joints", "left"]), inner, max_size=2)
    ),
    max_leaves=6,
)
WAYS = st.lists(st.integers(0, 30), min_size=1, max_size=5)


def replaced(value, way, by):
    """``value`` with the part at the end of a way through it replaced."""
    if not way or not isinstance(value, (dict, list)) or not value:
        return by
    keys = list(value) if isinstance(value, dict) else range(len(value))
    key = keys[way[0] % len(keys)]
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[key] = replaced(value[key], way[1:], by)
    return copy


@HOSTILE
@given(st.sampled_from(["lines", "landmarks"]), st.integers(0, 6), WAYS, VALUE)
def test_any_value_anywhere(write, seed, line, way, value):
    values = [json.loads(one) for one in SEEDS[seed].splitlines()]
    values[line] = replaced(values[line], way, value)
    loads_or_refuses(write("\n".join(json.dumps(one) for one in values).encode()))


CELL = st.sampled_from(["", "nan", "-inf", "1e999", "9" * 30, "left", "wrist", '"', '""', ",", "#", "\t", "0", "-1", "\0", "é"])


@HOSTILE
@given(st.sampled_from(["wide", "tall"]), st.dictionaries(st.tuples(st.integers(0, 40), st.integers(0, 190)), CELL, max_size=4))
def test_any_cell_anywhere(write, seed, cells):
    rows = [line.split(",") for line in SEEDS[seed].decode().splitlines()]
    for (row, column), cell in cells.items():
        rows[row % len(rows)][column % len(rows[row % len(rows)])] = cell
    loads_or_refuses(write("\n".join(map(",".join, rows)).encode()))


@HOSTILE
@given(
    st.binary(max_size=40),
    st.sampled_from(
        [b"# ", b"time,side,wrist_x,", b"time;joint;x;y;z\n", b'{"basis":', b'{"joints":[', b'{"worldLandmarks":[[', b"#basis="]
    ),
)
def test_any_beginning(write, content, start):
    loads_or_refuses(write(start + content))


ENDLESS = [b'{"time":1,"side":"left","joints":{"wrist":[0,0,0]}}\n', b'{"worldLandmarks":[]}\n', b"1,left,0,0,0\n"]


@pytest.mark.parametrize("most", ["text", "poses"])
@pytest.mark.parametrize("piece", ENDLESS, ids=["lines", "landmarks", "table"])
def test_a_file_without_end_is_refused_in_bounded_memory(write, monkeypatch, piece, most):
    if most == "text":
        monkeypatch.setattr(text_source, "LARGEST_FILE_BYTES", 300 << 10)
    else:
        monkeypatch.setattr(pose_rows, "MOST_POSES", 1000)
    head = b"time_ms,side,wrist_x,wrist_y,wrist_z\n" if piece.startswith(b"1") else b""
    path = write(head + piece * ((400 << 10) // len(piece)))
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"text is longer than the allowed|goes on beyond the allowed 1000"):
            load_hand(path)
        assert tracemalloc.get_traced_memory()[1] < 64 << 20
    finally:
        tracemalloc.stop()

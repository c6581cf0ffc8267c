"""A recording is played again to the byte, is found out if a byte or a pose was changed, and is a hand like any other."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import pytest

from haptics.errors import InputError
from haptics.recording.seal import seal
from haptics.session.configuration import Configuration
from haptics.session.replay import replay_recording
from haptics.session.run import RunOptions, run_scene

SCENE = "tennis"  # drives both boards


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recorded") / "run.h5"
    run_scene(SCENE, "synthetic", Configuration(), RunOptions(out=out, seed=5, latency_s=0.012))
    return out


@pytest.fixture
def copy(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(recorded, tmp_path / "copy.h5"))


@contextmanager
def changed(path: Path) -> Iterator[h5py.File]:
    """Change a recording, and seal it again: what was made so, not what was damaged."""
    with h5py.File(path, "r+") as file:
        yield file
    seal(path)


@pytest.mark.slow
def test_a_replay_sends_and_receives_the_same_bytes_at_the_same_times(haptics, recorded):
    before = recorded.read_bytes()
    done = haptics("replay", recorded, "--json")
    assert done.code == 0, done.err
    with h5py.File(recorded) as file:
        rows = len(file["entry/wire/time_ns"])
    told = done.json
    assert told["identical"] is True
    assert told["wire_rows"] == told["replayed_rows"] == rows > 0
    assert told["first_difference_ns"] is None
    assert recorded.read_bytes() == before


@pytest.mark.slow
def test_one_flipped_bit_on_the_wire_is_found_and_placed(haptics, copy):
    with changed(copy) as file:
        wire = file["entry/wire"]
        row = len(wire["time_ns"]) // 2
        data = wire["data"][row].tobytes()
        wire["data"][row] = np.void(bytes([data[0] ^ 1]) + data[1:])
        time_ns = int(wire["time_ns"][row])
    done = haptics("replay", copy, "--json")
    assert done.code == 1
    assert done.json["identical"] is False
    assert done.json["first_difference_ns"] == time_ns


@pytest.mark.slow
def test_a_bit_that_flips_by_itself_is_damage_and_is_not_replayed(haptics, copy):
    with h5py.File(copy) as file:
        place = file["entry/wire/data"].id.get_chunk_info(0).byte_offset
    data = bytearray(copy.read_bytes())
    data[place] ^= 4
    copy.write_bytes(data)
    for command in (("replay", copy), ("run", "desk", "--hand", copy, "--out", copy.with_name("out.h5"))):
        done = haptics(*command)
        assert done.code == 2
        assert "copy.h5 is damaged, or was changed since it was written: entry/wire/data" in done.err
    done = haptics("recording", "info", copy, "--json")
    assert (done.code, done.json["damaged"]) == (1, ["entry/wire/data"])


@pytest.mark.slow
def test_one_moved_pose_is_found_from_when_it_mattered(haptics, copy):
    with changed(copy) as file:
        events, poses = file["entry/events"], file["entry/poses"]
        touch_ns = events["time_ns"][()][events["kind"][()] == b"touch"][0]
        row = int(np.searchsorted(poses["time_ns"][()], touch_ns)) - 1  # the last pose before the first touch
        moved = poses["position_m"][row]
        moved[:, 1] += 0.02  # 20 mm in 9 ms is a speed that a hand may have
        poses["position_m"][row] = moved
        arrived_ns = int(poses["time_ns"][row])
    done = haptics("replay", copy, "--json")
    assert done.code == 1, done.err
    assert done.json["identical"] is False
    assert done.json["first_difference_ns"] >= arrived_ns


@pytest.mark.parametrize(
    ("place", "value", "word"),
    [
        ("poses/position_m", np.nan, "finite"),
        ("poses/position_m", 5.0, "5 m"),
        ("poses/sampled_ns", 0, "does not follow"),
    ],
)
def test_a_pose_that_no_hand_can_make_is_refused_by_its_number(haptics, copy, place, value, word):
    with changed(copy) as file:
        file["entry"][place][100] = value
    done = haptics("replay", copy)
    assert done.code == 2
    assert "copy.h5: pose 100" in done.err
    assert word in done.err


def test_a_run_in_real_time_cannot_be_had_again_and_says_so(haptics, copy):
    with changed(copy) as file:
        provenance = file["entry/provenance"]
        header = json.loads(provenance["header"][()])
        del provenance["header"]
        provenance["header"] = json.dumps({**header, "realtime": True})
    done = haptics("replay", copy)
    assert done.code == 2
    assert "real time" in done.err


def test_what_a_recording_holds_is_told(haptics, recorded):
    told = haptics("recording", "info", recorded, "--json").json
    assert told["header"]["scene"] == SCENE
    assert told["header"]["seed"] == 5
    with h5py.File(recorded) as file:
        assert told["rows"] == {name: len(file["entry"][name]["time_ns"]) for name in told["rows"]}
    assert min(told["rows"][name] for name in ("poses", "ticks", "events", "wire", "requests")) > 0


def test_what_is_no_recording_of_a_run_is_refused(haptics, copy):
    with changed(copy) as file:
        del file["entry/wire"]
    done = haptics("replay", copy)
    assert done.code == 2
    assert "cannot be replayed" in done.err


@pytest.mark.slow
def test_a_recording_is_a_hand(haptics, recorded, tmp_path):
    poses = {}
    for name, hand in (("first", "synthetic"), ("second", recorded)):
        out = tmp_path / f"{name}.h5"
        done = haptics("run", "resistance", "--hand", hand, "--latency-ms", 12, "--out", out, "--json")
        assert done.code == 0, done.err
        with h5py.File(out) as file:
            poses[name] = [file["entry/poses"][field][()] for field in ("position_m", "orientation_xyzw", "accepted")]
            wire = file["entry/wire/data"][()].tobytes()
        poses[name].append(wire)
    for first, second in zip(*poses.values(), strict=True):
        assert np.array_equal(first, second)


@pytest.mark.parametrize(
    "change",
    [
        {"ports": None},
        {"ports": {"tactiles": 5, "brake": None}},
        {"ports": {"tactiles": None}},
        {"realtime": "no"},
        {"latency_s": "0.01"},
        {"seed": None},
        {"side": 3},
        {"configuration": None},
        {"levels": 7},
        {"levels": {"latch": 1}},
        {"tolerance_jnd": "x"},
    ],
)
def test_a_header_that_no_run_writes_is_refused(copy, change):
    with changed(copy) as file:
        header = json.loads(file["entry/provenance/header"][()])
        del file["entry/provenance/header"]
        file["entry/provenance/header"] = json.dumps({**header, **change})
    with pytest.raises(InputError, match=rf"copy.h5 cannot be replayed: {next(iter(change))} = .* is not what a run writes"):
        replay_recording(copy)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("poses/side", 1.5),
        ("poses/side", b"x"),
        ("poses/sampled_ns", 0.5),
        ("poses/track", b"x"),
        ("events/kind", 3),
        ("wire/data", 3),
    ],
)
def test_a_column_of_another_type_is_refused(copy, column, value):
    with changed(copy) as file:
        rows = len(file[f"entry/{column}"])
        del file[f"entry/{column}"]
        file[f"entry/{column}"] = np.full(rows, value)
    with pytest.raises(InputError, match=r"copy.h5"):
        replay_recording(copy)


def test_a_pose_beyond_any_recording_is_refused(copy):
    with changed(copy) as file:
        file["entry/poses/sampled_ns"][5] = -(2**63)
    with pytest.raises(InputError, match=r"pose 5 is .* s from the start of the motion"):
        replay_recording(copy)

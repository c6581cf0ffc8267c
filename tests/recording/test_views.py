"""The views show what the recording holds, and name what they lack when they cannot."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import numpy as np
import pytest
from recorded_session import START_NS, STEPS, record_session

from haptics.errors import InputError
from haptics.recording import Journal, Recording, finalise, load, write_picture, write_rrd
from haptics.recording.views import view_data


def bare_recording(folder: Path, header: dict | None = None) -> Recording:
    """A recording without one stream that the views know."""
    journal = Journal.create(folder / "j", header or {})
    journal.stream("trials", np.dtype([("time_ns", "<i8"), ("answer", "u1")])).append((1, 2))
    journal.close()
    finalise(folder / "j", folder / "bare.h5")
    return load(folder / "bare.h5")


def rrd_columns(path: Path, entity: str) -> dict[str, list]:
    """All non-static columns of an entity in a rerun file, by name."""
    from rerun.chunk import RrdReader

    columns: dict[str, list] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                columns.setdefault(name, []).extend(batch.column(name).to_pylist())
    return columns


@pytest.fixture(scope="module")
def rrd(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("rerun", reason="extra `view`")
    return write_rrd(recording, tmp_path_factory.mktemp("rrd") / "session.rrd")


def test_rerun_reads_back_every_entity_and_the_layout(rrd: Path):
    from rerun.chunk import RrdReader

    reader = RrdReader(rrd)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    paths = {chunk.entity_path for chunk in reader.stream().to_chunks()}
    assert {"/hand/right/joints", "/hand/right/bones", "/hand/right/actuators", "/events"} <= paths
    assert {"/actuators/rise_k", "/brake/volts", "/brake/force_n", "/pins/index_tip", "/piezo/index"} <= paths
    assert not any(path.startswith("/hand/left") for path in paths)


def test_rerun_reads_back_the_values(rrd: Path, recording: Recording):
    ticks, poses = recording.stream("ticks"), recording.stream("poses")
    rises = rrd_columns(rrd, "/actuators/rise_k")
    assert np.array_equal(rises["Scalars:scalars"], ticks["rise_k"])
    since_ns = [time.value if hasattr(time, "value") else round(time.total_seconds() * 1e9) for time in rises["session"]]
    assert since_ns == (ticks["time_ns"] - START_NS).tolist()
    joints = rrd_columns(rrd, "/hand/right/joints")["Points3D:positions"]
    assert np.array_equal(joints, poses["position_m"])
    bones = np.array(rrd_columns(rrd, "/hand/right/bones")["LineStrips3D:strips"])
    assert np.array_equal(bones[7], poses["position_m"][7][view_data.CHAINS])


def test_pins_and_trouble_are_in_the_file(rrd: Path):
    assert rrd_columns(rrd, "/pins/index_tip")["StateChange:state"] == [["off"], ["out"], ["off"]]
    events = rrd_columns(rrd, "/events")
    lines = [text for (text,) in events["TextLog:text"]]
    assert "touch thumb_tip ball" in lines
    assert dict(zip(lines, events["TextLog:level"], strict=True))["index_tip: pulse denied: heat"] == ["WARN"]
    assert dict(zip(lines, events["TextLog:level"], strict=True))["fault brake over current"] == ["WARN"]


def test_rerun_writes_no_more_than_the_file(recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("rerun", reason="extra `view`")

    def refused(*_args, **_kwargs):
        raise AssertionError("a view must not open a socket")

    monkeypatch.setattr(socket.socket, "connect", refused)
    monkeypatch.setattr(socket.socket, "bind", refused)
    write_rrd(recording, tmp_path / "one.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["one.rrd"]
    with pytest.raises(InputError, match="--force"):
        write_rrd(recording, tmp_path / "one.rrd")
    write_rrd(recording, tmp_path / "one.rrd", force=True)


@pytest.mark.slow
def test_a_picture_is_a_png_of_the_whole_session(recording: Recording, tmp_path: Path):
    pytest.importorskip("matplotlib", reason="extra `report`")
    from matplotlib.image import imread

    pixels = imread(write_picture(recording, tmp_path / "one.png"))
    assert pixels.shape[:2] == (1375, 1210)
    assert pixels[..., 0].std() > 0.05  # not a blank page
    with pytest.raises(InputError, match="--force"):
        write_picture(recording, tmp_path / "one.png")
    assert (tmp_path / "one.png").read_bytes() == write_picture(recording, tmp_path / "two.png").read_bytes()


def test_views_of_a_recording_without_their_streams_are_empty_not_wrong(tmp_path: Path):
    recording = bare_recording(tmp_path)
    pytest.importorskip("rerun", reason="extra `view`")
    pytest.importorskip("matplotlib", reason="extra `report`")
    assert rrd_columns(write_rrd(recording, tmp_path / "bare.rrd"), "/actuators/rise_k") == {}
    assert write_picture(recording, tmp_path / "bare.png").stat().st_size > 0


@pytest.mark.parametrize(("module", "write", "extra"), [("rerun", write_rrd, "view"), ("matplotlib", write_picture, "report")])
def test_a_missing_extra_is_named(recording: Recording, tmp_path: Path, monkeypatch, module: str, write, extra: str):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=rf"pip install '\.\[{extra}\]'"):
        write(recording, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_importing_the_package_imports_no_heavy_extra():
    import subprocess

    code = "import sys, haptics.recording; print([m for m in ('h5py', 'rerun', 'matplotlib', 'scipy') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_the_colour_scale_runs_from_blue_to_red_and_holds_its_ends():
    colours = view_data.rise_colours(np.array([-5.0, 0.0, 12.5, 25.0, 90.0, np.nan]))
    assert colours.tolist() == [[69, 117, 180], [69, 117, 180], [254, 224, 144], [215, 48, 39], [215, 48, 39], [128] * 3]


def test_sites_follow_the_header_turned_with_their_joint(tmp_path: Path):
    # a quarter turn about z takes an offset along x to y
    weights = np.zeros((1, 26))
    weights[0, 10] = 1.0
    sites = {"names": ["nail"], "weights": weights.tolist(), "offset_joint": [10], "offset_m": [[0.01, 0.0, 0.0]]}
    recording = bare_recording(tmp_path, {"sites": sites})
    pose = np.zeros(1, [("position_m", "<f4", (26, 3)), ("orientation_xyzw", "<f4", (26, 4))])
    pose["position_m"][0, 10] = (1.0, 2.0, 3.0)
    pose["orientation_xyzw"][0, 10] = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    # single precision of metres
    assert view_data.sites_of(recording).positions(pose)[0, 0] == pytest.approx((1.0, 2.01, 3.0), abs=1e-6)


def test_nominal_sites_are_fifteen_blends_of_joints(tmp_path: Path):
    sites = view_data.sites_of(bare_recording(tmp_path))
    assert len(sites.names) == 15
    assert np.array_equal(sites.weights.sum(axis=1), np.ones(15))


def test_the_palm_view_keeps_the_thumb_on_the_side_where_one_sees_it():
    from recorded_session import hand

    from haptics.recording.views.hand_picture import palm_view

    right = hand(0.0)
    left = right * np.array([-1.0, 1.0, 1.0])
    assert palm_view(right, "right")(right)[5, 0] > palm_view(right, "right")(right)[25, 0]
    assert palm_view(left, "left")(left)[5, 0] < palm_view(left, "left")(left)[25, 0]


def test_the_hand_with_more_poses_wears_the_glove(tmp_path: Path):
    finalise(record_session(tmp_path / "j", {"side": None}), tmp_path / "r.h5")
    recording = load(tmp_path / "r.h5")
    assert view_data.glove_side(recording) == "right"
    assert len(view_data.poses_of(recording, "left")) == 0
    assert len(view_data.poses_of(recording, "right")) == STEPS


def test_refused_poses_are_not_drawn_and_the_glove_s_hand_is_the_one_of_the_header_or_the_one_seen_more(tmp_path):
    from haptics.recording.views.view_data import glove_side, poses_of
    from haptics.session.recorder import RUN_STREAMS

    spec = next(one for one in RUN_STREAMS if one.name == "poses")

    def recorded(name: str, header: dict, sides: list[int], accepted: list[int]) -> Recording:
        journal = Journal.create(tmp_path / f"{name}.journal", header)
        rows = journal.declare(spec)
        for number, (side, good) in enumerate(zip(sides, accepted, strict=True)):
            rows.append((number, number, side, 0, good, np.full((26, 3), number), np.tile((0, 0, 0, 1), (26, 1))))
        journal.close()
        finalise(journal.path, tmp_path / f"{name}.h5")
        return load(tmp_path / f"{name}.h5")

    some = recorded("some", {}, [1, 1, 1, 0], [1, 0, 1, 1])
    assert poses_of(some, "right")["sampled_ns"].tolist() == [0, 2]
    assert glove_side(some) == "right"
    assert glove_side(recorded("left", {"side": "left"}, [1, 1, 1, 0], [1] * 4)) == "left"
    assert glove_side(recorded("more", {}, [0, 0, 1], [1] * 3)) == "left"

"""The main job: a hand through a scene, down to volts, and back as a report."""

from __future__ import annotations

import h5py
import pytest

RECORDED = ("grab", "wave", "waiting", "flapping")


def _run(haptics, tmp_path, scene, hand, *more):
    out = tmp_path / "run.h5"
    done = haptics("run", scene, "--hand", hand, "--out", out, "--force", "--json", *more)
    assert done.code == 0, done.err
    return done.json, out


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["desk", "playground"])
@pytest.mark.parametrize("name", RECORDED)
def test_every_recorded_hand_runs_in_every_hand_scene(haptics, tmp_path, recordings, scene, name):
    report, out = _run(haptics, tmp_path, scene, recordings / f"{name}.leap.json.gz")
    pulses = report["pulses"]
    assert pulses["requested"] == pulses["played"] + sum(pulses["denied"].values())
    assert report["faults"] == []
    assert report["ticks"]["missed"] is None
    assert report["recording"] == str(out)


@pytest.mark.slow
def test_grab_in_the_playground_is_two_grasps_and_both_brakes_act_in_each(haptics, tmp_path, recordings):
    report, out = _run(haptics, tmp_path, "playground", recordings / "grab.leap.json.gz")
    assert report["grasps"] == 2
    assert {b["name"] for b in report["brakes"] if b["peak_force_n"] > 1} == {"index", "thumb"}
    with h5py.File(out) as file:
        events, ticks = file["entry/events"], file["entry/ticks"]
        kinds = [k.decode() for k in events["kind"][()]]
        times = events["time_ns"][()]
        begins = [t for t, k in zip(times, kinds, strict=True) if k == "grasp_begin"]
        ends = [t for t, k in zip(times, kinds, strict=True) if k == "grasp_end"] + [ticks["time_ns"][-1]]
        assert len(begins) == 2
        for begin, end in zip(begins, ends, strict=False):
            during = (ticks["time_ns"][()] >= begin) & (ticks["time_ns"][()] <= end)
            assert (ticks["force_n"][()][during][:, :2].max(axis=0) > 1).all()


@pytest.mark.slow
def test_a_hand_that_never_closes_gets_no_grasp_and_the_report_says_why(haptics, tmp_path, recordings):
    report, _ = _run(haptics, tmp_path, "playground", recordings / "wave.leap.json.gz")
    assert report["grasps"] == 0
    assert any("closing stroke" in note for note in report["notes"])


@pytest.mark.slow
def test_same_seed_gives_the_same_report_and_the_same_bytes(haptics, tmp_path):
    first, out = _run(haptics, tmp_path, "playground", "synthetic", "--seed", 7)
    with h5py.File(out) as file:
        wire = file["entry/wire/data"][()].tobytes()
    second, out = _run(haptics, tmp_path, "playground", "synthetic", "--seed", 7)
    with h5py.File(out) as file:
        assert file["entry/wire/data"][()].tobytes() == wire
    assert first == second


@pytest.mark.slow
def test_another_seed_gives_another_board(haptics, tmp_path):
    first, _ = _run(haptics, tmp_path, "playground", "synthetic", "--seed", 7)
    other, _ = _run(haptics, tmp_path, "playground", "synthetic", "--seed", 8)
    assert first["actuators"] != other["actuators"]


@pytest.mark.slow
def test_the_synthetic_hand_touches_and_grasps(haptics, tmp_path):
    report, _ = _run(haptics, tmp_path, "playground", "synthetic")
    assert report["contacts"] > 0
    assert report["grasps"] >= 1
    assert report["pulses"]["played"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["workplace", "posture", "resistance", "tennis"])
def test_garment_scenes_engage_clutches_and_build_no_tactors_they_do_not_use(haptics, tmp_path, scene):
    report, _ = _run(haptics, tmp_path, scene, "synthetic")
    assert max(b["peak_volts"] for b in report["brakes"]) > 300
    planned = {row["device"] for row in report["plan"]}
    assert "tactiles" in planned or not report["actuators"]


@pytest.mark.slow
def test_latency_is_a_setting_and_costs_closeness(haptics, tmp_path, recordings):
    near, _ = _run(haptics, tmp_path, "playground", recordings / "grab.leap.json.gz", "--latency-ms", 0)
    far, _ = _run(haptics, tmp_path, "playground", recordings / "grab.leap.json.gz", "--latency-ms", 40)
    assert near["onset_error_ms"]["hold"]["signed_median"] < far["onset_error_ms"]["hold"]["signed_median"]


def test_an_existing_recording_is_not_overwritten(haptics, tmp_path):
    out = tmp_path / "kept.h5"
    out.write_bytes(b"mine")
    done = haptics("run", "playground", "--hand", "synthetic", "--out", out)
    assert done.code == 2
    assert "kept.h5" in done.err
    assert out.read_bytes() == b"mine"


@pytest.mark.slow
def test_the_recording_opens_on_its_default_plot(haptics, tmp_path):
    _, out = _run(haptics, tmp_path, "playground", "synthetic")
    with h5py.File(out) as file:
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        signal = data[data.attrs["signal"]]
        axis = data[data.attrs["axes"][0] if not isinstance(data.attrs["axes"], str) else data.attrs["axes"]]
        assert len(axis) == len(signal)
        assert signal.attrs["units"]

"""A scene with a drawn mesh, by the command: what was mended and what will be slow reaches the user and the recording."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

SCENE = """summary = "one mesh"
[[objects]]
name = "thing"
placement = "palm"
position_m = [0.0, 0.0, -0.05]
effects = [{ kind = "contact" }]
"""


def write_ball(path, rings=10, radius=0.04):
    """A ball of latitude rings, with a vertex that belongs to nothing."""
    polar = np.pi * np.arange(1, rings) / rings
    turn = np.pi * np.arange(2 * rings) / rings
    p, t = np.meshgrid(polar, turn, indexing="ij")
    body = np.stack([np.sin(p) * np.cos(t), np.cos(p), np.sin(p) * np.sin(t)], axis=-1).reshape(-1, 3)
    vertices = radius * np.vstack([[0, 1, 0], [0, -1, 0], body, [9, 9, 9]])
    at = lambda ring, step: 3 + ring * 2 * rings + step % (2 * rings)  # noqa: E731
    faces = [f"f 1 {at(0, s + 1)} {at(0, s)}\nf 2 {at(rings - 2, s)} {at(rings - 2, s + 1)}" for s in range(2 * rings)]
    faces += [
        f"f {at(r, s)} {at(r, s + 1)} {at(r + 1, s + 1)} {at(r + 1, s)}" for r in range(rings - 2) for s in range(2 * rings)
    ]
    path.write_text("\n".join(["v {} {} {}".format(*v) for v in vertices] + faces) + "\n")


@pytest.fixture
def hand(tmp_path):
    """Three poses of an open right hand, 10 ms apart."""
    frames = []
    for k in range(3):
        fingers = [
            {"handId": 1, "id": 10 + f, "type": f, "width": 18.0, "tool": False, "mcpPosition": [20.0 * f, 150.0, 0.0],
             "pipPosition": [20.0 * f, 150.0, -30.0], "dipPosition": [20.0 * f, 150.0, -60.0],
             "tipPosition": [20.0 * f, 150.0, -90.0]} for f in range(5)
        ]  # fmt: skip
        palm = {"id": 1, "type": "right", "palmPosition": [40.0, 150.0, 30.0], "palmNormal": [0.0, -1.0, 0.0],
                "direction": [0.0, 0.0, -1.0], "grabStrength": 0.0, "pinchStrength": 0.0, "confidence": 1.0}  # fmt: skip
        frames.append({"timestamp": 10_000 * k, "hands": [palm], "pointables": fingers})
    (tmp_path / "hand.json").write_text(json.dumps({"metadata": {"protocolVersion": 6}, "frames": frames}))
    return tmp_path / "hand.json"


@pytest.mark.slow
def test_notes_reach_the_report_the_recording_and_slowness_is_said_before(haptics, tmp_path, hand):
    write_ball(tmp_path / "ball.obj")
    (tmp_path / "mine.toml").write_text(SCENE + 'shape = { kind = "mesh", file = "ball.obj", units = "m" }\n')
    done = haptics("run", tmp_path / "mine.toml", "--hand", hand, "--out", tmp_path / "out.h5", "--json")
    assert done.code == 0, done.err
    report = json.loads(done.out)
    assert report["notes"] == [
        "thing: ball.obj: taken to be y up, as its shape does not specify: 0.08 m wide, 0.08 high, 0.08 deep",
        "thing: ball.obj: 1 vertex of no triangle left out",
    ]
    with h5py.File(tmp_path / "out.h5") as file:
        kept = json.loads(file["entry/attachments/report.json"].asstr()[()])
    assert kept["notes"] == report["notes"]
    assert done.err == ""

    write_ball(tmp_path / "ball.obj", rings=14)
    done = haptics("run", tmp_path / "mine.toml", "--hand", hand, "--out", tmp_path / "two.h5")
    assert done.code == 0
    assert done.err.startswith("note: 728 triangles of meshes: about 1.46 ms a tick while the hand is near them")
    assert "note: thing: ball.obj: 1 vertex of no triangle left out" in done.out
    assert "note: 728 triangles of meshes" in done.out


@pytest.mark.slow
def test_eighty_metres_are_asked_about_and_leave_nothing_behind(haptics, tmp_path, hand):
    write_ball(tmp_path / "ball.obj", radius=40)
    (tmp_path / "mine.toml").write_text(SCENE + 'shape = { kind = "mesh", file = "ball.obj" }\n')
    done = haptics("run", tmp_path / "mine.toml", "--hand", hand, "--out", tmp_path / "out.h5")
    assert done.code == 2
    assert "it is 80 m across" in done.err
    assert "is it in millimetres? Then it is 0.08 m across" in done.err
    assert "scale = 0.001" in done.err
    assert not (tmp_path / "out.h5").exists()
    (tmp_path / "mine.toml").write_text(SCENE + 'shape = { kind = "mesh", file = "ball.obj", units = "m" }\n')
    done = haptics("run", tmp_path / "mine.toml", "--hand", hand, "--out", tmp_path / "out.h5", "--json")
    assert json.loads(done.out)["notes"][0].endswith("kept as given")

"""The motion that ships as engines and trackers would have it, by formulas of the tests' own, and how files spell it."""

from __future__ import annotations

import json

import numpy as np
from scipy.spatial.transform import Rotation

from haptics.scene.hands.joints import JOINTS
from haptics.scene.hands.recording import HandTrack
from haptics.scene.hands.synthetic import synthetic_hand

# Right, up and forward of each engine in its own coordinates, and its unit in metres, as docs/reference/joints.md has them.
ENGINES = {
    "openxr": ((1, 0, 0), (0, 1, 0), (0, 0, -1), 1.0),
    "webxr": ((1, 0, 0), (0, 1, 0), (0, 0, -1), 1.0),
    "godot": ((1, 0, 0), (0, 1, 0), (0, 0, -1), 1.0),
    "unity": ((1, 0, 0), (0, 1, 0), (0, 0, 1), 1.0),
    "unreal": ((0, 1, 0), (0, 0, 1), (1, 0, 0), 0.01),
}


def _in_webxr(name: str) -> str:
    finger, _, part = name.replace("little", "pinky").partition("_")
    words = [finger, *(["finger"] if finger not in ("thumb", "wrist") else [])]
    words += ["phalanx"] if part in ("proximal", "intermediate", "distal") else []
    return "-".join([*words, part]).rstrip("-")


WEBXR = {name: _in_webxr(name) for name in JOINTS[1:]}
UNITY = {name: "".join(word.capitalize() for word in name.split("_")) for name in JOINTS}


def shipped(count: int = 40) -> HandTrack:
    """The first frames of the motion that ships."""
    track = synthetic_hand().tracks[0]
    return HandTrack("right", 0, track.time_ns[:count], track.position_m[:count], track.orientation_xyzw[:count])


def as_engine(track: HandTrack, engine: str, unit_m: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 26, 3) and quaternions (n, 26, 4) as an engine has them; a left-handed one turns rotations, too."""
    right, up, forward, own_m = ENGINES[engine]
    to_engine = np.array([right, up, [-one for one in forward]], float).T  # columns: where OpenXR's x, y, z go
    turn = Rotation.from_quat(track.orientation_xyzw.reshape(-1, 4)).as_matrix()
    turned = Rotation.from_matrix(to_engine @ turn @ to_engine.T).as_quat()
    position = track.position_m @ to_engine.T / (own_m if unit_m is None else unit_m)
    return position, turned.reshape(-1, 26, 4)


def json_lines(header: dict | None, poses: list[dict]) -> str:
    """A header, if any, and a line for each pose."""
    return "".join(json.dumps(line) + "\n" for line in ([] if header is None else [header]) + poses)


def poses_of(
    track: HandTrack, engine: str, unit_m: float | None = None, names: dict | None = None, side: str = "right"
) -> list[dict]:
    """Poses of the plain form, times in seconds."""
    names = dict(zip(JOINTS, JOINTS, strict=True)) if names is None else names
    position, turn = as_engine(track, engine, unit_m)
    return [
        {
            "time": time_ns / 1e9,
            "side": side,
            "joints": {
                names[name]: {"position": place.tolist(), "orientation": spin.tolist()}
                for name, place, spin in zip(JOINTS, places, turns, strict=True)
                if name in names
            },
        }
        for time_ns, places, turns in zip(track.time_ns.tolist(), position, turn, strict=True)
    ]


def assert_same(found: HandTrack, wanted: HandTrack, joints: list[str] | None = None) -> None:
    """The same poses to 1e-9 m and the same rotations; ``joints``: only these are compared."""
    at = [JOINTS.index(name) for name in (joints or JOINTS)]
    np.testing.assert_allclose(found.time_ns, wanted.time_ns, atol=1, rtol=0)
    np.testing.assert_allclose(found.position_m[:, at], wanted.position_m[:, at], atol=1e-9, rtol=0)
    cosine = np.abs(np.sum(found.orientation_xyzw[:, at] * wanted.orientation_xyzw[:, at], axis=-1))
    np.testing.assert_allclose(cosine, 1.0, atol=1e-9)

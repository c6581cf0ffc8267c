"""A small session to record: a hand closes on a ball, pins come out one by one, brakes hold, coils warm."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from haptics.recording import Journal

POSES = np.dtype(
    [
        ("time_ns", "<i8"),
        ("sampled_ns", "<i8"),
        ("side", "i1"),
        ("track", "<i4"),
        ("accepted", "u1"),
        ("position_m", "<f4", (26, 3)),
        ("orientation_xyzw", "<f4", (26, 4)),
    ]
)
TICKS = np.dtype(
    [
        ("time_ns", "<i8"),
        ("rise_k", "<f4", (15,)),
        ("pin_out", "u1", (15,)),
        ("volts", "<f4", (5,)),
        ("force_n", "<f4", (5,)),
        ("piezo", "u1", (5,)),
    ]
)
REQUESTS = np.dtype(
    [("time_ns", "<i8"), ("site", "S16"), ("kind", "S10"), ("played", "u1"), ("reason", "S16"), ("start_ns", "<i8")]
)
EVENTS = np.dtype([("time_ns", "<i8"), ("kind", "S20"), ("subject", "S32"), ("object", "S32"), ("detail", "S96")])
START_NS = 5_000_000_000
STEPS = 300
TOUCH_STEPS = {"thumb_tip": 100, "index_tip": 110, "middle_tip": 115, "ring_tip": 125, "little_tip": 140, "index_phalanx": 150}
TOUCH_CHANNEL = {"thumb_tip": 0, "index_tip": 1, "middle_tip": 2, "ring_tip": 3, "little_tip": 4, "index_phalanx": 6}


def hand(bend_rad: float) -> np.ndarray:
    """A right hand, palm down, fingers along -z, each joint bent by ``bend_rad``: (26, 3) in metres."""
    joints = np.zeros((26, 3))
    joints[0] = (0.0, 0.0, -0.04)
    bases = {6: -0.02, 11: -0.003, 16: 0.012, 21: 0.026}
    lengths = {
        6: (0.062, 0.04, 0.025, 0.02),
        11: (0.062, 0.044, 0.028, 0.02),
        16: (0.056, 0.04, 0.026, 0.02),
        21: (0.05, 0.03, 0.02, 0.018),
    }
    for first, x in bases.items():
        joints[first] = (0.6 * x, 0.0, -0.025)
        place, angle = joints[first].copy(), 0.0
        for step, length in enumerate(lengths[first]):
            angle += bend_rad if step else 0.0
            side = x / 0.062 * 0.3
            place = place + length * np.array([side, -np.sin(angle), -np.cos(angle)]) / np.hypot(side, 1.0)
            joints[first + 1 + step] = place
    place, turn = np.array([-0.02, -0.01, -0.02]), 0.0
    joints[2] = place
    for step, length in enumerate((0.045, 0.034, 0.026)):
        turn = 0.4 * bend_rad * (step + 1)
        place = place + length * np.array([-np.cos(0.8 + turn), -0.4 * np.sin(turn), -np.sin(0.8 + turn)])
        joints[3 + step] = place
    return joints


def record_session(path: Path, header: dict | None = None) -> Path:
    """Write the session's journal to ``path`` and close it."""
    rng = np.random.default_rng(7)
    journal = Journal.create(path, {"title": "hand on a ball", "side": "right", "seed": 7, **(header or {})})
    poses = journal.stream("poses", POSES, {"position_m": "m"}, "poses as they arrived")
    ticks = journal.stream("ticks", TICKS, {"rise_k": "K", "volts": "V", "force_n": "N"}, "devices every 10 ms")
    requests = journal.stream("requests", REQUESTS, {"start_ns": "ns"})
    events = journal.stream("events", EVENTS)
    journal.blob("glove.toml", b'side = "right"\n')
    rise_k, pins = np.zeros(15), np.zeros(15, np.uint8)
    shift_m = np.array([0.1, 1.0, -0.3])
    orientation = np.tile([0.0, 0.0, 0.0, 1.0], (26, 1))
    for step in range(STEPS):
        now_ns = START_NS + step * 10_000_000
        closing = np.clip((step - 60) / 100, 0.0, 1.0) - np.clip((step - 220) / 60, 0.0, 1.0)
        poses.append((now_ns, now_ns - 5_000_000, 1, 0, 1, hand(0.1 + 0.75 * closing) + shift_m, orientation))
        for site, touched in TOUCH_STEPS.items():
            if step in (touched, 240):
                pins[TOUCH_CHANNEL[site]] = step == touched
                rise_k[TOUCH_CHANNEL[site]] += 1.5
                events.append((now_ns, "touch" if step == touched else "release", site, "ball", ""))
                requests.append((now_ns, site, "contact", 1, "", now_ns + 1_000_000))
        if step > 150:
            rise_k[[1, 2]] += 0.1 * rng.random(2)
        rise_k *= np.exp(-0.01 / 102.0)
        on = 150 <= step < 230
        force_n = 4.0 * on * np.array([0.6, 1.0, 0.8, 0.0, 0.0])
        ticks.append((now_ns, rise_k, pins, 900.0 * (force_n > 0), force_n, pins[:5] * (step % 20 < 5)))
    requests.append((START_NS + 2_000_000_000, "index_tip", "pulse", 0, "heat", 0))
    events.append((START_NS + 2_500_000_000, "fault", "brake", "", "over current"))
    journal.close({"contacts": len(TOUCH_STEPS)})
    return path

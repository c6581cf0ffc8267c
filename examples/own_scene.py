"""A scene of one's own, fed by an engine's poses: a fingertip taps on a drum, whose skin answers with a pattern of pins.

An engine calls ``submit`` whenever it has a pose, on whatever clock the glove runs; here that is virtual time, and the engine is
a sine.
"""

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import haptics

SCENE = """
summary = "a drum under the fingertips"

[[objects]]
name = "drum"
shape = { kind = "cylinder", radius_m = 0.15, height_m = 0.1 }
position_m = [0.0, 0.0, -0.1]
effects = [
    { kind = "contact", sites = ["index_tip", "middle_tip"] },
    { kind = "pattern", pattern = "radial", lasts = "stimulus", duration_s = 0.25 },
]
"""
POSE_S = 0.011  # a tracker at about 90 Hz


def poses():
    """What an engine would send: an open right hand that sinks onto the drum and rises again, twice a second."""
    hand = next(haptics.load_hand("synthetic").frames("right"))
    lowest_m = hand.position_m[:, 1].min()
    for number in range(90):
        height_m = 0.08 + 0.04 * math.cos(4.0 * math.pi * number * POSE_S)
        yield replace(hand, position_m=hand.position_m + np.array([0.0, height_m - lowest_m, 0.0]))


with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "drum.toml"
    path.write_text(SCENE)
    scene = haptics.load_scene(path)

with haptics.open(tactiles="sim://tactiles", clock="virtual") as glove:  # this scene needs no brake
    session = haptics.Session(scene, glove)
    glove.arm()
    session.begin()
    start_ns = glove.now_ns()
    for pose in poses():
        session.submit(replace(pose, time_ns=glove.now_ns()))
        glove.advance(POSE_S)
    session.end()

for event in session.events:
    print(f"{(event.time_ns - start_ns) / 1e9:6.3f} s  {event.kind:8} {event.subject} {event.object}")
played = sum(result.played for result in session.results)
print(f"{played} of {len(session.results)} pulses played")
print(f"warmest actuator: {session.truth.peak_rise_k.max():.2f} K above the room")

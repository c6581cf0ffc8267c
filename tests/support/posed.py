"""A loop fed with a hand, without devices: on the compiled path from pose to decision, or on the plain one."""

from __future__ import annotations

import time

import numpy as np
import pytest

from haptics.rendering import grasp_ahead, touch_ahead
from haptics.rendering.events import LoopEvent
from haptics.rendering.loop import Leads, RenderLoop
from haptics.scene.hands.recording import HandRecording
from haptics.scene.scene import Scene
from haptics.scene.sites import nominal_sites
from haptics.time import NS_PER_MS

LATE_NS = 7 * NS_PER_MS


class _Brake:
    """Takes whatever is asked of it."""

    max_frequency_hz = 100.0

    def __getattr__(self, _: str):
        return lambda *_, **__: None


def loop_of(scene: Scene, plain: bool) -> RenderLoop:
    """A loop over a placed scene; ``plain``: no shape is taken for one that compiled code knows."""
    with pytest.MonkeyPatch.context() as patch:
        if plain:
            for module in (touch_ahead, grasp_ahead):
                patch.setattr(module, "packable", lambda _: False)
        return RenderLoop(scene, nominal_sites(), None, _Brake(), Leads(0.009, 0.011, 0.02))


def play(loop: RenderLoop, hand: HandRecording) -> tuple[list[LoopEvent], np.ndarray]:
    """What the loop reports of poses that come 7 ms late, and the CPU time of each, s."""
    frames = list(hand.frames(hand.side_with_most_frames))
    loop.begin(frames[0].time_ns)
    now_ns, events, costs_s = frames[0].time_ns, [], []
    for frame in frames:
        while now_ns < frame.time_ns + LATE_NS:
            loop.tick(now_ns)
            now_ns += NS_PER_MS
        began_ns = time.process_time_ns()
        loop.submit(frame, now_ns)
        costs_s.append((time.process_time_ns() - began_ns) * 1e-9)
        events += loop.take_events()
    return events, np.array(costs_s)

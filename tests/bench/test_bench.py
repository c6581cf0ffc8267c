"""Speeds that matter to a user, with the bounds they are held to; ratios are measured side by side in one run.

Run by ``make bench`` only: no ordinary test depends on how fast a machine is.
"""

from __future__ import annotations

import gc
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from haptics.fidelity import plan_scene
from haptics.scene import load_scene
from haptics.scene.hand import HandRecording
from haptics.scene.leap import load_leap
from haptics.scene.recordings import load_hand
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, arrivals_of, open_glove
from haptics.session.session import Session
from haptics.time import NS_PER_MS, NS_PER_S

pytestmark = pytest.mark.bench

LATENCY_NS = 10 * NS_PER_MS
TEN_OBJECTS = "".join(
    f"""
[[objects]]
name = "ball{i}"
placement = "palm"
position_m = [{0.06 * (i % 5) - 0.12:.3f}, {-0.03 - 0.03 * (i // 5):.3f}, {-0.05 - 0.02 * (i % 3):.3f}]
shape = {{ kind = "sphere", radius_m = 0.02 }}
effects = [{{ kind = "contact" }}{', { kind = "grasp" }' if i < 2 else ""}]
"""
    for i in range(10)
)


def _hand(recordings: Path) -> HandRecording:
    return load_leap(recordings / "grab.leap.json.gz")


def _ticks(scene_source: str | Path, hand: HandRecording) -> tuple[list[float], list[bool]]:
    """CPU seconds of every tick of the loop, simulated boards and links included, and whether a pose arrived at it."""
    scene = load_scene(scene_source).placed_for(hand)
    configuration = Configuration()
    glove = open_glove(scene, plan_scene(scene), configuration, RunOptions())
    try:
        session = Session(scene, glove, configuration)
        glove.arm()
        start_ns = (glove.now_ns() // NS_PER_MS + 2) * NS_PER_MS
        session.begin(start_ns)
        arrivals = list(arrivals_of(tuple(hand.frames(hand.side_with_most_frames)), hand, start_ns, LATENCY_NS))
        gc.collect()
        gc.freeze()
        costs, posed, index = [], [], 0
        for now_ns in range(start_ns, arrivals[-1][0] + NS_PER_MS, NS_PER_MS):
            began = time.process_time()
            before = index
            while index < len(arrivals) and arrivals[index][0] <= now_ns:
                frame = arrivals[index][1]
                session.submit(frame, now_ns) if frame is not None else session.hand_gone(now_ns)
                index += 1
            session.tick(now_ns)
            costs.append(time.process_time() - began)
            posed.append(index > before)
        return costs, posed
    finally:
        gc.unfreeze()
        glove.off()
        glove.close()


def _report(what: str, figure: str) -> None:
    print(f"\n{what:<66} {figure}")


def test_import_is_quick():
    code = "import time; t = time.perf_counter(); import haptics; print(time.perf_counter() - t)"
    times = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout) for _ in range(7)
    ]
    _report("import haptics, median of 7 fresh interpreters", f"{statistics.median(times) * 1e3:.0f} ms (bound 500)")
    assert statistics.median(times) < 0.5


def test_the_loop_of_grab_through_the_playground_is_five_times_faster_than_real_time(recordings):
    hand = _hand(recordings)
    _ticks("playground", hand)  # compiled and cached once
    runs = [sum(_ticks("playground", hand)[0]) for _ in range(3)]
    ratio = hand.duration_s / statistics.median(runs)
    _report("grab through playground, real time over CPU time of the loop", f"{ratio:.1f} (bound 5)")
    assert ratio >= 5


def test_a_tick_with_fifteen_actuators_two_brakes_and_ten_objects(recordings, tmp_path):
    (tmp_path / "ten.toml").write_text('summary = "ten balls about the hand"\n' + TEN_OBJECTS)
    costs, posed = _ticks(tmp_path / "ten.toml", _hand(recordings))
    every, with_pose = np.array(costs) * 1e3, np.array(costs)[np.array(posed)] * 1e3
    _report("tick with ten objects, median of all", f"{np.median(every):.3f} ms (bound 0.3)")
    _report("  of those at which a pose arrives, median", f"{np.median(with_pose):.3f} ms")
    _report("  99 % of all", f"{np.quantile(every, 0.99):.3f} ms")
    assert np.median(every) < 0.3


def test_the_compiled_latch_against_a_general_solver():
    """One 10 ms switch at the dynamic level, and the same equation of motion handed to scipy as a user would."""
    from scipy.integrate import solve_ivp

    from haptics.physics.latch import switch, travel_s

    switch(0.010)
    began = time.process_time()
    for i in range(50):
        switch(0.010, 5.0 - 1e-3 * i)
    ours_s = (time.process_time() - began) / 50
    assert 0.003 < travel_s("off-on") < 0.008

    def free_flight(_: float, y: np.ndarray) -> np.ndarray:  # cheaper than the whole model: a lower bound on what a solver costs
        return np.array([y[1], (0.075 * y[2] - 0.46 * y[1]) / 0.35e-3, (5.0 - 1.38 * y[2] - 0.075 * y[1]) / 20e-6])

    began = time.process_time()
    for _ in range(5):
        solve_ivp(free_flight, (0.0, 0.010), [0.0, 0.0, 0.0], method="Radau", rtol=1e-6, atol=1e-9)
    scipy_s = (time.process_time() - began) / 5
    _report("one switch, dynamic level (with its search for the least pulse)", f"{ours_s * 1e3:.2f} ms")
    _report("solve_ivp, Radau, a simpler latch", f"{scipy_s * 1e3:.2f} ms")


def test_a_real_second_of_an_idle_glove():
    """What a loop costs while nothing happens, from the shipped hand's still beginning."""
    hand = load_hand("synthetic")
    costs, _ = _ticks("playground", hand)
    first = costs[: NS_PER_S // NS_PER_MS // 2]
    _report("first half second of the shipped hand, CPU share", f"{100 * sum(first) / 0.5:.1f} %")

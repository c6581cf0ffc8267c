"""Speeds that matter to a user, with the bounds they are held to; what can be compared is measured side by side in one run.

Run by ``make bench`` only: no ordinary test depends on how fast a machine is. CPU time throughout, so that what else the machine
does counts little; it still slows caches and shared cores, so a bound on a whole run is held against the best of several.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from haptics.scene.hands.frame import HandFrame
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene
from haptics.session.session import Session
from haptics.time import NS_PER_S

pytestmark = pytest.mark.bench

Row = Callable[[str, str, str], None]
SHAPES = (
    'kind = "sphere", radius_m = 0.02',
    'kind = "box", size_m = [0.03, 0.03, 0.03]',
    'kind = "capsule", radius_m = 0.012, length_m = 0.03',
    'kind = "cylinder", radius_m = 0.015, height_m = 0.03',
)
TEN_OBJECTS = 'summary = "ten things within reach of the fingers, two of them to grasp"\n' + "".join(
    f"""
[[objects]]
name = "thing{i}"
placement = "{"in_hand" if i == 0 else "palm"}"
position_m = [{0.06 * (i % 5) - 0.12:.3f}, {-0.03 - 0.03 * (i // 5):.3f}, {-0.05 - 0.02 * (i % 3):.3f}]
shape = {{ {SHAPES[i % 4]} }}
effects = [{{ kind = "contact" }}{', { kind = "grasp" }' if i < 2 else ""}]
"""
    for i in range(10)
)


@pytest.fixture
def hand(request: pytest.FixtureRequest) -> str:
    """The recorded grab, or the motion that ships where there is none."""
    try:
        return str(request.getfixturevalue("recordings") / "grab.leap.json.gz")
    except pytest.skip.Exception:
        return "synthetic"


def tick_costs(scene: str | Path, hand: str, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """CPU seconds of every tick of ``haptics run``, and whether a pose arrived at it.

    A tick is all that is done in a millisecond: poses, boards, links, drivers, recording. Start-up and going off are left out.
    """
    marks_ns: list[int] = []
    posed_at: list[int] = []
    tick, submit = Session.tick, Session.submit

    def timed_tick(session: Session, now_ns: int) -> None:
        if not marks_ns:
            marks_ns.append(time.process_time_ns())
        tick(session, now_ns)
        marks_ns.append(time.process_time_ns())

    def noted_submit(session: Session, frame: HandFrame, now_ns: int) -> str | None:
        posed_at.append(len(marks_ns) - 1)
        return submit(session, frame, now_ns)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "tick", timed_tick)
        patch.setattr(Session, "submit", noted_submit)
        run_scene(str(scene), hand, Configuration(), RunOptions(out=folder / "run.h5", force=True))
    costs_s = np.diff(marks_ns) / NS_PER_S
    posed = np.zeros(len(costs_s), dtype=bool)
    posed[posed_at] = True
    return costs_s, posed


def test_import_is_quick(row: Row) -> None:
    code = "import time; t = time.perf_counter(); import haptics; print(time.perf_counter() - t)"
    times_s = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout) for _ in range(7)
    ]
    row("import haptics, median of 7 fresh interpreters", f"{statistics.median(times_s) * 1e3:.0f} ms", "500 ms")
    assert statistics.median(times_s) < 0.5


def test_the_loop_of_grab_through_the_playground_is_five_times_faster_than_real_time(row: Row, hand: str, tmp_path: Path) -> None:
    costs_s = [tick_costs("playground", hand, tmp_path)[0] for _ in range(6)][1:]  # the first one fills caches
    speeds = [len(costs) * 1e-3 / costs.sum() for costs in costs_s]
    name = Path(hand).name.split(".")[0]
    row(f"{name} through playground, real time over CPU time of the loop, best of 5", f"{max(speeds):.1f}", "5")
    row("  median of 5", f"{statistics.median(speeds):.1f}", "")
    assert max(speeds) >= 5


def test_a_tick_with_fifteen_actuators_two_brakes_and_ten_objects(row: Row, hand: str, tmp_path: Path) -> None:
    scene = tmp_path / "ten.toml"
    scene.write_text(TEN_OBJECTS)
    tick_costs(scene, hand, tmp_path)
    costs_s, posed = tick_costs(scene, hand, tmp_path)
    every_ms, with_pose_ms = costs_s * 1e3, costs_s[posed] * 1e3
    row("tick with 15 actuators, 2 brakes, 10 objects, median of all", f"{np.median(every_ms):.3f} ms", "0.3 ms")
    row(f"  of the {100 * posed.mean():.0f} % at which a pose arrives, median", f"{np.median(with_pose_ms):.3f} ms", "")
    row("  mean of all", f"{every_ms.mean():.3f} ms", "")
    row("  99 % of all", f"{np.quantile(every_ms, 0.99):.3f} ms", "")
    assert np.median(every_ms) < 0.3


def test_what_an_idle_glove_costs(row: Row, tmp_path: Path) -> None:
    """The shipped hand's still beginning: poses come, nothing is touched."""
    costs_s, _ = tick_costs("playground", "synthetic", tmp_path)
    row("first half second of the shipped hand, share of one core", f"{100 * costs_s[:500].sum() / 0.5:.0f} %", "")

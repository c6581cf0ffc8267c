"""What the loop costs: against plain Python measured beside it, since that is what it is made of."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from ledger import Ledger, cpu_s, interpreted
from posed import loop_of, play

from haptics.scene import load_scene
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.frame import HandFrame
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene
from haptics.session.session import Session
from haptics.time import NS_PER_S

pytestmark = pytest.mark.bench
CALLS = 200_000
"""Of plain Python beside each run."""

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
{f"position_m = [{0.06 * (i % 5) - 0.12:.3f}, {-0.03 - 0.03 * (i // 5):.3f}, {-0.05 - 0.02 * (i % 3):.3f}]" if i else ""}
shape = {{ {SHAPES[i % 4] if i else 'kind = "sphere"'} }}
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


def process_s(code: str) -> float:
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True)
    return time.perf_counter() - began


def test_import_is_quick(bench: Ledger) -> None:
    pairs = [(process_s("import haptics"), process_s("pass")) for _ in range(9)]
    bench.note("a fresh interpreter that imports haptics", f"{min(a for a, _ in pairs) * 1e3:.0f} ms")
    ratio = float(np.median([a / b for a, b in pairs]))
    bench.ratio("import", "a fresh interpreter that imports haptics, over one that does nothing", ratio, at_most=3)


def beside_plain_python(scene: str | Path, hand: str, folder: Path, times: int = 5) -> tuple[np.ndarray, np.ndarray, float]:
    """Cost of every tick of the quickest of several runs, where poses arrived, and calls of plain Python that a tick is worth.

    The last is the median of as many ratios, each of a run and of plain Python right after it.
    """
    tick_costs(scene, hand, folder)  # fills caches
    runs, ratios = [], []
    for _ in range(times):
        costs_s, posed = tick_costs(scene, hand, folder)
        a_call_s = cpu_s(lambda: interpreted(CALLS)) / CALLS
        runs.append((costs_s, posed))
        ratios.append(float(costs_s.mean() / a_call_s))
    costs_s, posed = min(runs, key=lambda run: run[0].sum())
    return costs_s, posed, float(np.median(ratios))


def test_the_loop_of_a_grab_through_the_playground(bench: Ledger, hand: str, tmp_path: Path) -> None:
    costs_s, _, calls = beside_plain_python("playground", hand, tmp_path)
    name = Path(hand).name.split(".")[0]
    bench.note(f"{name} through playground, real time over CPU time of the loop", f"{len(costs_s) * 1e-3 / costs_s.sum():.1f}")
    bench.ratio("loop.playground", f"{name} through playground: a tick, in calls of plain Python", calls, at_most=2000)


def test_a_pose_on_the_desk_beside_the_plain_path(bench: Ledger, hand: str) -> None:
    """Median and 99 % of CPU time from a pose to its decisions, each the median ratio of several pairs of runs."""
    recording = load_hand(hand)
    scene = load_scene("desk").placed_for(recording)
    play(loop_of(scene, plain=False), recording)  # compiles
    pairs = [[play(loop_of(scene, plain), recording)[1] for plain in (True, False)] for _ in range(9)]
    for key, what, share, at_least in (("median", "median", 0.5, 5), ("p99", "99 %", 0.99, 4)):
        plain_s, ours_s = np.array([[np.quantile(costs_s, share) for costs_s in pair] for pair in pairs]).T
        bench.note(f"a pose on desk: {what}", f"{np.median(ours_s) * 1e3:.3f} ms")
        ratio = float(np.median(plain_s / ours_s))
        bench.ratio(f"loop.pose.{key}", f"a pose on desk, plain path over compiled: {what}", ratio, at_least=at_least)


def test_a_tick_with_fifteen_actuators_two_brakes_and_ten_objects(bench: Ledger, hand: str, tmp_path: Path) -> None:
    scene = tmp_path / "ten.toml"
    scene.write_text(TEN_OBJECTS)
    costs_s, posed, calls = beside_plain_python(scene, hand, tmp_path, 3)
    every_ms, with_pose_ms = costs_s * 1e3, costs_s[posed] * 1e3
    bench.note("tick with 15 actuators, 2 brakes, 10 objects: median of all", f"{np.median(every_ms):.3f} ms")
    bench.note(f"of the {100 * posed.mean():.0f} % at which a pose arrives: median", f"{np.median(with_pose_ms):.3f} ms")
    bench.note("99 % of all", f"{np.quantile(every_ms, 0.99):.3f} ms")
    bench.ratio(
        "loop.ten_objects", "a tick with 15 actuators, 2 brakes, 10 objects, in calls of plain Python", calls, at_most=2000
    )


def test_what_an_idle_glove_costs(bench: Ledger, tmp_path: Path) -> None:
    """The shipped hand's still beginning: poses come, nothing is touched."""
    costs_s, _ = tick_costs("playground", "synthetic", tmp_path)
    bench.note("first half second of the shipped hand, share of one core", f"{100 * costs_s[:500].sum() / 0.5:.0f} %")
    bench.ratio(
        "loop.idle", "a tick with nothing touched, over the mean tick", costs_s[:500].mean() / costs_s.mean(), at_most=1.2
    )

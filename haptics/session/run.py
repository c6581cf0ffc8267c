"""The main job: play a hand's motion through a scene, render it on the devices, record everything, report what was felt."""

from __future__ import annotations

import gc
import hashlib
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from haptics.ends import orderly, unbroken
from haptics.errors import InputError
from haptics.fidelity import DEFAULT_BUDGET, DEFAULT_TOLERANCE_JND, Plan, plan_scene
from haptics.recording import load, write_picture, write_rrd
from haptics.recording.ending import finish, keep
from haptics.recording.leftovers import journal_of, refuse_leftover
from haptics.recording.output import check_outputs
from haptics.scene import load_scene
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.motion import judge_motion
from haptics.scene.hands.recording import HandRecording
from haptics.scene.scene import Scene
from haptics.scene.sites import SITES, nominal_sites
from haptics.session.configuration import BrakeConfiguration, Configuration, TactilesConfiguration
from haptics.session.glove import Glove
from haptics.session.recorder import Recorder, provenance
from haptics.session.report import build_report
from haptics.session.session import Session
from haptics.time import NS_PER_MS, NS_PER_S, seconds_to_ns
from haptics.units import in_range

GONE_NS = 15 * NS_PER_MS
"""A tracker that loses a hand says so with its next frame, about this much later."""
TAIL_NS = 40 * NS_PER_MS
"""The run goes on this long after the last pose arrived, so that what it caused is seen; less than the pose watchdog."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What a run may be told besides scene, hand and configuration. Paths that are None are not written, but ``out`` is named.

    ``side``: ``left``, ``right`` or ``auto``, instead of the configuration's.
    ``levels``, ``tolerance_jnd``, ``budget_s_per_s``: see ``fidelity.plan_scene``. ``watch`` is shown the ended session.
    """

    port_tactiles: str | None = None
    port_brake: str | None = None
    side: str | None = None
    realtime: bool = False
    latency_s: float | None = None
    seed: int = 1
    out: Path | None = None
    rrd: Path | None = None
    picture: Path | None = None
    force: bool = False
    progress: bool = False
    record: bool = True
    levels: dict[str, str] = field(default_factory=dict)
    tolerance_jnd: float = DEFAULT_TOLERANCE_JND
    budget_s_per_s: float = DEFAULT_BUDGET
    watch: Callable[[Session], None] | None = None


def run_scene(scene_name: str, hand_source: str, configuration: Configuration, options: RunOptions) -> dict[str, Any]:
    """Run, and return the report (the JSON object of ``haptics run --json``).

    :raises InputError: scene, hand, option or file that cannot be used; nothing is left behind.
    :raises LinkError: a port or board that cannot be used.
    """
    latency_s = configuration.tracker_latency_s if options.latency_s is None else options.latency_s
    in_range("latency", latency_s * 1e3, 0.0, 100.0, "ms")
    in_range("seed", options.seed, 0, 2**31 - 1)
    scene = load_scene(scene_name)
    motion = judge_motion(load_hand(hand_source), configuration.side if options.side is None else options.side, str(hand_source))
    if options.side is not None:
        configuration = configuration.model_copy(update={"side": options.side})
    recording, side, frames = motion.recording, motion.side, motion.frames
    placed = scene.placed_for(recording, side)
    if placed.slow_notice is not None:
        print(f"note: {placed.slow_notice}", file=sys.stderr, flush=True)
    plan = plan_of(placed, configuration, options)
    out = options.out or Path(f"{scene.name}-{time.strftime('%Y%m%d-%H%M%S')}.h5")
    _check_outputs(out, hand_source, scene_name, options)
    glove_brakes = _with_outputs(configuration.brake, placed).channels if plan.builds("brake") or plan.builds("piezo") else ()
    header = {
        **provenance(),
        "scene": scene.name,
        "scene_source": scene_name,
        "hand": str(hand_source),
        "side": side,
        "latency_s": latency_s,
        "seed": options.seed,
        "realtime": options.realtime,
        "configuration": configuration.model_dump(mode="json"),
        "configuration_sha256": hashlib.sha256(configuration.model_dump_json().encode()).hexdigest(),
        "levels": options.levels,
        "tolerance_jnd": options.tolerance_jnd,
        "budget_s_per_s": options.budget_s_per_s,
        "ports": {"tactiles": options.port_tactiles, "brake": options.port_brake},
        "plan": asdict(plan),
        "title": f"{scene.name} with {recording.source}",
        "sites": _sites(),
        "brakes": list(glove_brakes),
        "motion": {"source": recording.source, "frame_count": recording.frame_count, "duration_s": recording.duration_s},
        "default_plot": {"stream": "ticks", "signal": "force_n" if plan.builds("brake") else "rise_k"},
    }
    recorder: Recorder | None = None
    tap = _Tap()
    with orderly():
        glove = open_glove(placed, plan, configuration, options, tap)
        try:
            try:
                if options.record:
                    recorder = Recorder(journal_of(out), header, options.force)
                    tap.attach(recorder)
                played = _play(glove, placed, configuration, recorder, frames, recording, latency_s, options)
            except BaseException:
                _make_safe(glove, recorder)
                raise
            glove.close()
            session, start_ns, ticks, missed = played
            if options.watch is not None:
                options.watch(session)
            report = build_report(
                session=session,
                plan=plan,
                motion=motion,
                latency_ns=seconds_to_ns(latency_s),
                start_ns=start_ns,
                ticks=ticks,
                ticks_missed=missed,
                tick_ns=NS_PER_S // configuration.tick_hz,
                out=out if options.record else None,
            )
            if recorder is not None:
                recorder.journal.blob("report.json", _json_bytes(report))
                finish(recorder.journal, out, options.force, {"ended": "off"})
        except BaseException as error:
            if recorder is not None:
                keep(recorder.journal, out, options.force, error)
            raise
        if recorder is not None:
            _derive(out, options)
    return report


def _make_safe(glove: Glove, recorder: Recorder | None) -> None:
    """Off and closed, whatever else is asked for or goes wrong meanwhile."""
    with unbroken:
        if recorder is not None:
            recorder.journal.raises = False
        try:
            glove.off()
        finally:
            glove.close()


def plan_of(scene: Scene, configuration: Configuration, options: RunOptions) -> Plan:
    """The plan of a run.

    :raises InputError: see ``plan_scene``.
    """
    return plan_scene(
        scene,
        options.tolerance_jnd,
        options.budget_s_per_s,
        options.levels,
        configuration.brake.amplitude_v if scene.needs.brakes else None,
    )


def open_glove(scene: Scene, plan: Plan, configuration: Configuration, options: RunOptions, tap: Any = None) -> Glove:
    """The devices that the plan builds, and no others.

    :raises InputError: more outputs asked for than a board has.
    :raises LinkError: a port or board that cannot be used.
    """
    tactiles, brake = configuration.tactiles, configuration.brake
    if options.port_tactiles is not None:
        tactiles = tactiles.model_copy(update={"port": options.port_tactiles})
    if options.port_brake is not None:
        brake = brake.model_copy(update={"port": options.port_brake})
    outputs = _with_outputs(brake, scene) if plan.builds("brake") or plan.builds("piezo") else None
    return Glove(
        tactiles if plan.builds("tactiles") else None,
        outputs,
        realtime=options.realtime,
        seed=options.seed,
        simulate=_simulated(plan, tactiles, outputs),
        wire_tap=tap,
    )


def _simulated(plan: Plan, tactiles: TactilesConfiguration, brake: BrakeConfiguration | None) -> dict[str, dict[str, object]]:
    """What simulated boards are told of the plan: the level, and which channels there are."""
    told: dict[str, dict[str, object]] = {name: {"level": level} for name, level in plan.levels.items()}
    if "tactiles" in told:
        told["tactiles"]["fitted"] = sum(1 << channel for channel, site in enumerate(tactiles.sites) if site in plan.sites)
    if brake is not None:
        told.setdefault("brake", {})["fitted"] = len(brake.channels)
    return told


def _with_outputs(brake: BrakeConfiguration, scene: Scene) -> BrakeConfiguration:
    """The brake's outputs, named as the scene names what it drives unless the configuration covers all of them."""
    needed = tuple(dict.fromkeys((*scene.needs.brakes, *scene.needs.piezos, *scene.needs.clutches)))
    if set(needed) <= set(brake.channels):
        return brake
    try:
        return BrakeConfiguration.model_validate({**brake.model_dump(), "channels": needed})
    except ValueError as error:
        raise InputError(f"scene {scene.name!r} drives {', '.join(needed)}, more than one board's outputs: {error}") from error


class _Tap:
    """Wire bytes to the recorder once there is one; those of the handshake are kept until then."""

    def __init__(self) -> None:
        self._early: list[tuple[int, str, bool, bytes]] = []
        self._recorder: Recorder | None = None

    def __call__(self, name: str, time_ns: int, to_board: bool, data: bytes) -> None:
        if self._recorder is None:
            self._early.append((time_ns, name, to_board, data))
        else:
            self._recorder.wire(time_ns, name, to_board, data)

    def attach(self, recorder: Recorder) -> None:
        self._recorder = recorder
        for time_ns, name, to_board, data in self._early:
            recorder.wire(time_ns, name, to_board, data)
        self._early.clear()


def _play(
    glove: Glove,
    scene: Scene,
    configuration: Configuration,
    recorder: Recorder | None,
    frames: tuple[HandFrame, ...],
    recording: HandRecording,
    latency_s: float,
    options: RunOptions,
) -> tuple[Session, int, int, int | None]:
    tick_ns = NS_PER_S // configuration.tick_hz
    session = Session(scene, glove, configuration, recorder)
    gc.collect()
    gc.freeze()
    glove.arm()
    start_ns = (glove.now_ns() // tick_ns + 2) * tick_ns
    session.begin(start_ns)
    arrivals = list(arrivals_of(frames, recording, start_ns, seconds_to_ns(latency_s)))
    end_ns = (arrivals[-1][0] if arrivals else start_ns + seconds_to_ns(recording.duration_s)) + TAIL_NS
    ticks = -(-(end_ns - start_ns) // tick_ns)
    pace = _Pace(options.realtime, tick_ns)
    show = _Progress(options.progress, ticks)
    try:
        index = 0
        for tick in range(ticks + 1):
            planned_ns = start_ns + tick * tick_ns
            now_ns = pace.wait_for(planned_ns)
            while index < len(arrivals) and arrivals[index][0] <= now_ns:
                frame = arrivals[index][1]
                session.submit(frame, now_ns) if frame is not None else session.hand_gone(now_ns)
                index += 1
            session.tick(now_ns)
            show.at(tick)
    finally:
        gc.unfreeze()
        show.done()
    glove.off()
    session.settle()
    return session, start_ns, ticks + 1, pace.missed


def arrivals_of(
    frames: tuple[HandFrame, ...], recording: HandRecording, start_ns: int, latency_ns: int
) -> Iterator[tuple[int, HandFrame | None]]:
    """When each pose reaches the loop, on the glove's clock; None where the tracker says that the hand is gone."""
    for frame, following in zip(frames, (*frames[1:], None), strict=True):
        sampled_ns = start_ns + frame.time_ns
        yield sampled_ns + latency_ns, replace(frame, time_ns=sampled_ns)
        ends_ns = seconds_to_ns(recording.duration_s) if following is None else following.time_ns
        changes = following is None or following.track_id != frame.track_id
        if changes and ends_ns - frame.time_ns > 2 * GONE_NS:
            yield sampled_ns + latency_ns + GONE_NS, None


class _Pace:
    """Absolute deadlines: waits for them in real time and counts those missed by over a period; virtual time is on time."""

    def __init__(self, realtime: bool, tick_ns: int):
        self._realtime, self._tick_ns = realtime, tick_ns
        self.missed: int | None = 0 if realtime else None

    def wait_for(self, planned_ns: int) -> int:
        if self.missed is None:
            return planned_ns
        ahead_ns = planned_ns - time.monotonic_ns()
        if ahead_ns > 0:
            time.sleep(ahead_ns / NS_PER_S)
        now_ns = time.monotonic_ns()
        self.missed += now_ns - planned_ns > self._tick_ns
        return now_ns


class _Progress:
    """A line on standard error, where a person looks at it."""

    def __init__(self, wanted: bool, ticks: int):
        self._ticks = ticks
        self._on = wanted and sys.stderr.isatty()

    def at(self, tick: int) -> None:
        if self._on and tick % 250 == 0:
            print(f"\r{100 * tick // max(1, self._ticks):3d} %", end="", file=sys.stderr, flush=True)

    def done(self) -> None:
        if self._on:
            print("\r     \r", end="", file=sys.stderr, flush=True)


def _check_outputs(out: Path, hand: str, scene: str, options: RunOptions) -> None:
    """All that can be known of the outputs before a board is opened.

    :raises InputError: see ``check_outputs``; a journal of an earlier run is in the way.
    """
    outputs = {"out": out if options.record else None, "rrd": options.rrd, "picture": options.picture}
    if options.record:
        refuse_leftover(journal_of(out), options.force)
        outputs["the journal of out"] = journal_of(out)
    check_outputs(outputs, options.force, {"hand": Path(hand), "scene": Path(scene)})


def _sites() -> dict[str, Any]:
    """Where the actuators sit on the joints, so that a recording can be drawn without this program."""
    sites = nominal_sites()
    parts = (sites.weights, sites.offset_joint, sites.offset_m)
    return {"names": list(SITES), **{k: v.tolist() for k, v in zip(("weights", "offset_joint", "offset_m"), parts, strict=True)}}


def _json_bytes(report: dict[str, Any]) -> bytes:
    import json

    return json.dumps(report, indent=1).encode()


def _derive(out: Path, options: RunOptions) -> None:
    """The views asked for, from the finished recording."""
    if options.rrd is None and options.picture is None:
        return
    try:
        recording = load(out)
        if options.rrd is not None:
            write_rrd(recording, options.rrd, force=options.force)
        if options.picture is not None:
            write_picture(recording, options.picture, force=options.force)
    except BaseException as error:
        error.add_note(f"the recording {out} is complete")
        raise

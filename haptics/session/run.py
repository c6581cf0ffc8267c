"""The main job: play a hand's motion through a scene, render it on the devices, record everything, report what was felt."""

from __future__ import annotations

import gc
import hashlib
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from haptics.ends import orderly, unbroken
from haptics.fidelity import DEFAULT_BUDGET, DEFAULT_TOLERANCE_JND
from haptics.judging.truth import Truth
from haptics.recording import load, write_picture, write_rrd
from haptics.recording.ending import finish, keep
from haptics.recording.leftovers import journal_of, refuse_leftover
from haptics.recording.output import check_folder, check_outputs
from haptics.scene import load_scene
from haptics.scene.calibration.hand_calibration import HandCalibration
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.motion import judge_motion
from haptics.scene.hands.recording import HandRecording
from haptics.scene.scene import Scene
from haptics.session.arrivals import arrivals_of
from haptics.session.composition import EarlyWire, open_planned, plan_for, with_outputs, with_ports
from haptics.session.configuration import Configuration
from haptics.session.devices import Devices
from haptics.session.heard import Heard
from haptics.session.pace import Pace
from haptics.session.recorder import Recorder, provenance, sites_of_joints
from haptics.session.report import build_report
from haptics.session.session import Session
from haptics.session.whose_hand import calibration_header, calibration_of, sites_of
from haptics.time import NS_PER_MS, NS_PER_S, seconds_to_ns
from haptics.units import in_range

TAIL_NS = 40 * NS_PER_MS
"""The run goes on this long after the last pose arrived, so that what it caused is seen; less than the pose watchdog."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What a run takes besides scene, hand and configuration.

    :param port_tactiles: URL of the array's port, instead of the configuration's.
    :param port_brake: URL of the brake controller's port, likewise.
    :param side: ``left``, ``right`` or ``auto``, instead of the configuration's.
    :param realtime: on the machine's clock, as hardware needs, rather than in virtual time.
    :param latency_s: from sampling a pose to its arrival, 0 to 0.1 s, instead of the configuration's.
    :param seed: of simulated boards, 0 to 2**31 - 1.
    :param out: recording to write; named after scene and time if None.
    :param rrd: file for rerun to write, or None.
    :param picture: picture to write, or None.
    :param force: overwrite files that exist.
    :param progress: on standard error, where that is a terminal.
    :param record: write a recording at all.
    :param levels: of the models, by name, where not the plan's own choice (``fidelity.plan_scene``).
    :param tolerance_jnd: error that the plan may make, in just noticeable differences.
    :param budget_s_per_s: computing time that the plan may take, s per second of the run.
    :param calibration: of the hand, instead of the one that the configuration names; a nominal hand if neither does.
    :param watch: called with the session when it has ended.
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
    calibration: HandCalibration | None = None
    watch: Callable[[Session], None] | None = None


def run_scene(scene_name: str, hand_source: str, configuration: Configuration, options: RunOptions) -> dict[str, Any]:
    """Play a hand's motion through a scene on a glove.

    :param scene_name: a shipped scene's name, or a file.
    :param hand_source: a shipped motion's name, or a file.
    :param configuration: of the glove.
    :param options: see there.
    :return: the report: the JSON object of ``haptics run --json``.
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
    calibration = calibration_of(configuration, options.calibration, side)
    options = replace(options, calibration=calibration)
    placed = scene.placed_for(recording, side)
    if placed.slow_notice is not None:
        print(f"note: {placed.slow_notice}", file=sys.stderr, flush=True)
    plan = plan_for(placed, configuration, options.tolerance_jnd, options.budget_s_per_s, options.levels)
    out = options.out or Path(f"{scene.name}-{time.strftime('%Y%m%d-%H%M%S')}.h5")
    _check_outputs(out, hand_source, scene_name, options)
    glove_brakes = with_outputs(configuration.brake, placed).channels if plan.builds("brake") or plan.builds("piezo") else ()
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
        "sites": sites_of_joints(sites_of(calibration)),
        **calibration_header(calibration),
        "brakes": list(glove_brakes),
        "motion": {"source": recording.source, "frame_count": recording.frame_count, "duration_s": recording.duration_s},
        "default_plot": {"stream": "ticks", "signal": "force_n" if plan.builds("brake") else "rise_k"},
    }
    recorder: Recorder | None = None
    tap = EarlyWire()
    with orderly():
        wired = with_ports(configuration, options.port_tactiles, options.port_brake)
        glove = open_planned(placed, plan, wired, realtime=options.realtime, seed=options.seed, wire_tap=tap)
        try:
            try:
                if options.record:
                    recorder = Recorder(journal_of(out), header, options.force, live=options.realtime)
                    tap.attach(recorder)
                played = _play(glove, placed, configuration, recorder, frames, recording, latency_s, options)
            except BaseException:
                _make_safe(glove, recorder)
                raise
            glove.close()
            session, heard, start_ns, ticks, missed = played
            if options.watch is not None:
                options.watch(session)
            report = build_report(
                session=session,
                heard=heard,
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


def _make_safe(glove: Devices, recorder: Recorder | None) -> None:
    """Off and closed, whatever else is asked for or goes wrong meanwhile."""
    with unbroken:
        if recorder is not None:
            recorder.journal.raises = False
        try:
            glove.off()
        finally:
            glove.close()


def _play(
    glove: Devices,
    scene: Scene,
    configuration: Configuration,
    recorder: Recorder | None,
    frames: tuple[HandFrame, ...],
    recording: HandRecording,
    latency_s: float,
    options: RunOptions,
) -> tuple[Session, Heard, int, int, int | None]:
    tick_ns = NS_PER_S // configuration.tick_hz
    session = Session(scene, glove, configuration, recorder, calibration=options.calibration, gathered=Truth.keeping(None))
    heard = Heard(session)
    gc.collect()
    gc.freeze()
    glove.arm()
    start_ns = (glove.now_ns() // tick_ns + 2) * tick_ns
    session.begin(start_ns)
    arrivals = list(arrivals_of(frames, recording, start_ns, seconds_to_ns(latency_s)))
    end_ns = (arrivals[-1][0] if arrivals else start_ns + seconds_to_ns(recording.duration_s)) + TAIL_NS
    ticks = -(-(end_ns - start_ns) // tick_ns)
    pace = Pace(options.realtime, tick_ns)
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
    return session, heard, start_ns, ticks + 1, pace.missed


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
        check_folder("out", out)
        refuse_leftover(journal_of(out), options.force)
        outputs["the journal of out"] = journal_of(out)
    check_outputs(outputs, options.force, {"hand": Path(hand), "scene": Path(scene)})


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

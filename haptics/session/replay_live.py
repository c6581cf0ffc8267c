"""Play a session recorded in real time again, in virtual time: the same poses at the same moments give the same decisions.

A loop decides by what comes in and when: poses, calls, and the moments of its ticks. All of that is recorded, so that a session
that ran on the machine's clock can be had again on simulated boards. What boards answered, and when, cannot.
"""

from __future__ import annotations

import heapq
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.recording.recording import Recording
from haptics.rendering.events import LoopEvent
from haptics.scene.hands.frame import HandFrame
from haptics.scene.library import load_scene
from haptics.scene.placed_table import placed_again
from haptics.scene.scene import Scene
from haptics.session.composition import with_outputs
from haptics.session.configuration import check_configuration
from haptics.session.devices import Devices
from haptics.session.recorder import SESSION_BLOB
from haptics.session.session import Session
from haptics.session.whose_hand import recorded_calibration
from haptics.time import NS_PER_MS, NS_PER_S

DECISIONS = (
    *("touch", "release", "grasp_begin", "grasp_end", "grasp_ahead", "grasp_withdrawn", "clutch_on", "clutch_off"),
    *("watchdog", "waiting", "resumed", "placed", "scene", "clock_jump"),
)
"""Kinds of events that follow from what comes in alone."""
LONGEST_NS = 24 * 3600 * NS_PER_S
"""Of a session that is replayed."""
SETTLING_NS = 100 * NS_PER_MS
"""A replay begins this long after its boards were armed."""
_Input = tuple[int, int, Callable[[Session, int], Any]]


@dataclass(frozen=True, slots=True)
class LiveReplay:
    """How the replay of a session compares.

    :param recording: the file that was replayed.
    :param scene: its name.
    :param identical: every decision came again, at the same moment.
    :param decisions: in the recording.
    :param replayed_decisions: in the replay.
    :param first_difference: the first decision that differs, in words; None if none does.
    """

    recording: str
    scene: str
    identical: bool
    decisions: int
    replayed_decisions: int
    first_difference: str | None


def replay_live(path: Path, recording: Recording) -> LiveReplay:
    """Replay a session.

    :param path: of the recording.
    :param recording: loaded from there, with streams ``poses``, ``loop`` and ``events``.
    :return: how the two compare.
    :raises InputError: no session was recorded, or more than one; its scene was made by a program or has gone.
    """
    begun = _begun(path, recording)
    _check_ticks(path, recording)
    configuration = check_configuration(recording.header["configuration"], f"configuration in {path}")
    scene = _scene(path, begun)
    calibration = recorded_calibration(path, begun)
    outputs = with_outputs(configuration.brake, scene).model_copy(update={"port": "sim://brake"})
    tactiles = configuration.tactiles.model_copy(update={"port": "sim://tactiles"})
    devices = Devices(tactiles, outputs, realtime=False)
    try:
        devices.arm()
        start_ns = devices.now_ns() + SETTLING_NS
        shift_ns = start_ns - int(begun["start_ns"])
        session = Session(scene, devices, configuration, kept=None, resume=begun["resume"], calibration=calibration)
        session.begin(start_ns)
        for time_ns, _, act in heapq.merge(*_inputs(recording, shift_ns), key=lambda one: one[:2]):
            if time_ns >= start_ns:
                act(session, time_ns)
        again = [_shown(event, start_ns) for event in session.events if event.kind in DECISIONS]
    finally:
        devices.off()
        devices.close()
    then = _recorded(recording, int(begun["start_ns"]))
    first = next((i for i, (a, b) in enumerate(zip(then, again, strict=False)) if a != b), min(len(then), len(again)))
    identical = then == again
    difference = None
    if not identical:
        was, now = (one[first] if first < len(one) else "nothing" for one in (then, again))
        difference = f"recorded {was}; replayed {now}"
    return LiveReplay(str(path), scene.name, identical, len(then), len(again), difference)


def _check_ticks(path: Path, recording: Recording) -> None:
    ticks = recording.stream("loop")["time_ns"]
    if len(ticks) and (int(ticks.min()) < 0 or int(ticks.max()) - int(ticks.min()) > LONGEST_NS or (np.diff(ticks) < 0).any()):
        raise InputError(f"{path} cannot be replayed: its stream loop holds no moments of ticks in order, within a day")


def _begun(path: Path, recording: Recording) -> dict[str, Any]:
    blobs = [name for name in recording.blobs if name.startswith(SESSION_BLOB)]
    if len(blobs) != 1:
        raise InputError(f"{path} cannot be replayed: it holds {len(blobs)} sessions; expected a recording of one session")
    try:
        begun = json.loads(recording.blob(blobs[0]))
    except ValueError as error:
        raise InputError(f"{path} cannot be replayed: its {blobs[0]} is not JSON: {error}") from error
    if not isinstance(begun, dict) or not {"start_ns", "resume", "scene_source", "objects"} <= set(begun):
        raise InputError(f"{path} cannot be replayed: its {blobs[0]} is not what a session writes")
    return begun


def _scene(path: Path, begun: dict[str, Any]) -> Scene:
    if not begun["scene_source"]:
        raise InputError(f"{path} cannot be replayed: its scene was made by a program; only one from a file can be had again")
    return placed_again(load_scene(begun["scene_source"]), begun["objects"])


def _inputs(recording: Recording, shift_ns: int) -> Iterator[Iterator[_Input]]:
    """What came in, in order of time; at one moment poses before calls before the tick."""
    yield _poses(recording, shift_ns)
    yield _calls(recording, shift_ns)
    ticks = recording.stream("loop")["time_ns"].tolist()
    yield ((time_ns + shift_ns, 2, lambda session, now_ns: session.tick(now_ns)) for time_ns in ticks)


def _poses(recording: Recording, shift_ns: int) -> Iterator[_Input]:
    for row in recording.stream("poses"):
        frame = HandFrame(
            time_ns=int(row["sampled_ns"]) + shift_ns,
            side="right" if row["side"] else "left",
            track_id=int(row["track"]),
            position_m=row["position_m"].astype(float),
            orientation_xyzw=row["orientation_xyzw"].astype(float),
        )
        yield int(row["time_ns"]) + shift_ns, 0, lambda session, now_ns, frame=frame: session.submit(frame, now_ns)


def _calls(recording: Recording, shift_ns: int) -> Iterator[_Input]:
    for row in recording.stream("calls"):
        call, name = _text(row["call"]), _text(row["name"])
        pose = row["position_m"].tolist(), row["orientation_xyzw"].tolist()
        yield int(row["time_ns"]) + shift_ns, 1, lambda session, now_ns, c=call, n=name, p=pose: _call(session, now_ns, c, n, p)


def _text(data: bytes) -> str:
    return data.decode("utf-8", "backslashreplace")


def _call(session: Session, now_ns: int, call: str, name: str, pose: tuple[list[float], list[float]]) -> None:
    if call == "move_object":
        session.move_object(name, *pose, now_ns=now_ns)
    elif call == "place":
        session.place(now_ns)
    elif call == "hand_gone":
        session.hand_gone(now_ns, name or None)
    elif call == "armed":
        session.start_over(now_ns)
    elif call == "remove_object":
        session.remove_object(name, now_ns)
    elif call == "change_scene":
        session.change_scene(load_scene(name), now_ns)
    else:
        raise InputError(f"a call {call!r} was recorded, which cannot be made again")


def _recorded(recording: Recording, start_ns: int) -> list[str]:
    rows = recording.stream("events")
    kinds = {kind.encode() for kind in DECISIONS}
    return [
        _words(int(row["time_ns"]) - start_ns, *(_text(row[name]) for name in ("kind", "subject", "object")))
        for row in rows
        if row["kind"] in kinds and int(row["time_ns"]) >= start_ns
    ]


def _shown(event: LoopEvent, start_ns: int) -> str:
    return _words(event.time_ns - start_ns, event.kind, event.subject, event.object)


def _words(since_ns: int, kind: str, subject: str, name: str) -> str:
    return f"{kind} {subject} {name} at {since_ns / NS_PER_S:.9f} s".replace("  ", " ")

"""Play a recording's poses through its scene again, and hold what goes over the wire, or what is decided, against what was."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.recording import load
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.motion import refusals
from haptics.scene.hands.shown import shown
from haptics.session.configuration import check_configuration
from haptics.session.recorder import LINK_STREAMS
from haptics.session.replay_live import LiveReplay, replay_live
from haptics.session.run import RunOptions, run_scene
from haptics.session.whose_hand import recorded_calibration
from haptics.time import NS_PER_S

_WIRE = next(spec for spec in LINK_STREAMS if spec.name == "wire")
_NUMBER = (int, float)
_HEADER: dict[str, Any] = {
    "scene": str,
    "scene_source": str,
    "side": str,
    "realtime": bool,
    "latency_s": _NUMBER,
    "seed": int,
    "configuration": dict,
    "ports": dict,
    "levels": dict,
    "tolerance_jnd": _NUMBER,
    "budget_s_per_s": _NUMBER,
}
_MISSING: dict[str, Any] = {"levels": {}, "tolerance_jnd": 0.0, "budget_s_per_s": 0.0}
"""Entries that older recordings lack; the run's own defaults serve."""


@dataclass(frozen=True, slots=True)
class Replay:
    """How a replay compares.

    :param recording: the file that was replayed.
    :param scene: its name.
    :param identical: every byte to and from the boards went over the wire at the same time.
    :param wire_rows: rows of wire bytes in the recording.
    :param replayed_rows: the same in the replay.
    :param first_difference_ns: run time of the first row of wire bytes that differs, or None.
    """

    recording: str
    scene: str
    identical: bool
    wire_rows: int
    replayed_rows: int
    first_difference_ns: int | None


def replay_recording(path: str | Path) -> Replay | LiveReplay:
    """Replay in virtual time: a run with its scene, configuration, seed and latency; a session with all that came in.

    :param path: of a recording of a run, or of a session on a glove.
    :return: how the two compare: by bytes where the first was in virtual time, too, else by decisions.
    :raises InputError: not a recording of a run or a session, or its scene cannot be had again.
    """
    path = Path(path)
    recording = load(path)
    header = recording.header
    if "loop" in recording:
        return replay_live(path, recording)
    if "scene_source" not in header or "wire" not in recording:
        raise InputError(f"{path} cannot be replayed: it is no recording of `haptics run`; haptics recording view shows it")
    if recording.streams["wire"].dtype != _WIRE.dtype:
        raise InputError(f"{path} cannot be replayed: its stream wire has other fields than `haptics run` records")
    _check_header(path, header)
    if header["realtime"]:
        raise InputError(
            f"{path} cannot be replayed: it was made in real time, and without the moments of the loop's ticks, which recordings "
            "hold since this version"
        )
    options = RunOptions(
        port_tactiles=header["ports"]["tactiles"],
        port_brake=header["ports"]["brake"],
        latency_s=header["latency_s"],
        seed=header["seed"],
        calibration=recorded_calibration(path, header),
        **{name: header[name] for name in ("levels", "tolerance_jnd", "budget_s_per_s") if name in header},
    )
    configuration = check_configuration(header["configuration"], f"configuration in {path}")
    configuration = configuration.model_copy(update={"side": header["side"]})
    _check_poses(path, header["side"])
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder) / "replay.h5"
        try:
            run_scene(header["scene_source"], str(path), configuration, replace(options, out=again))
        except BaseException as error:
            vars(error).pop("__notes__", None)  # of a recording that goes with its folder
            raise
        wire, replayed = recording.stream("wire"), load(again).stream("wire")
    shared = min(len(wire), len(replayed))
    same = wire[:shared] == replayed[:shared]
    identical = len(wire) == len(replayed) and bool(np.all(same))
    first = None if identical else int(wire["time_ns"][np.argmin(same)] if not np.all(same) else wire["time_ns"][-1])
    return Replay(str(path), header["scene"], identical, len(wire), len(replayed), first)


def _check_header(path: Path, header: dict[str, Any]) -> None:
    """What a run writes into its header; whether the values may be used, the run itself asks."""
    for name, kinds in _HEADER.items():
        value = header.get(name, _MISSING.get(name))
        if not isinstance(value, kinds) or (kinds is not bool and isinstance(value, bool)):
            raise InputError(f"{path} cannot be replayed: {name} = {shown(value)} in its header is not what a run writes")
    for part, inner in (("ports", {"tactiles", "brake"}), ("levels", set())):
        texts = header.get(part, {})
        if not inner <= set(texts) or not all(isinstance(text, str) or (text is None and inner) for text in texts.values()):
            raise InputError(f"{path} cannot be replayed: {part} = {shown(texts)} in its header is not what a run writes")


def _check_poses(path: Path, side: str) -> None:
    """A run plays only poses that a hand can have, so a recording of one with another has been changed or damaged."""
    frames = tuple(load_hand(path).frames(side))
    for index, reason in refusals(frames).items():
        raise InputError(f"{path}: pose {index} at {frames[index].time_ns / NS_PER_S:.3f} s is refused: {reason}")

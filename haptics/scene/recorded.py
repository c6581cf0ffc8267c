"""The hand of one of the project's own recordings (HDF5, stream ``poses``), to be played again."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from haptics.errors import InputError
from haptics.recording import Recording, load
from haptics.scene.hand import SIDES, HandRecording, HandTrack

SIGNATURE = b"\x89HDF"


def load_recorded(path: Path) -> HandRecording:
    """The poses that a run received, exactly, with time zero at the start of its motion.

    :raises InputError: not a recording, or one without poses.
    """
    recording = load(path)
    if "poses" not in recording:
        raise InputError(f"hand {path}: the recording has no stream `poses`; allowed: one that `haptics run` made")
    poses, start_ns = recording.stream("poses"), motion_start_ns(recording)
    motion = recording.header.get("motion", {})
    tracks = []
    for side, track in dict.fromkeys(zip(poses["side"].tolist(), poses["track"].tolist(), strict=True)):
        rows = poses[(poses["side"] == side) & (poses["track"] == track)]
        tracks.append(
            HandTrack(
                SIDES[side],
                track,
                rows["sampled_ns"] - start_ns,
                np.ascontiguousarray(rows["position_m"], dtype=float),
                np.ascontiguousarray(rows["orientation_xyzw"], dtype=float),
            )
        )
    duration_s = motion.get("duration_s", float(poses["sampled_ns"].max() - start_ns) / 1e9 if len(poses) else 0.0)
    return HandRecording(str(motion.get("source", path.name)), tuple(tracks), motion.get("frame_count", len(poses)), duration_s)


def motion_start_ns(recording: Recording) -> int:
    """When the hand's motion began on the run's clock.

    :raises InputError: the recording does not say.
    """
    events = recording.stream("events")
    started = events["time_ns"][events["kind"] == b"start"]
    if not len(started):
        raise InputError(f"{recording.path}: no event `start`; the run ended before its motion began")
    return int(started[0])

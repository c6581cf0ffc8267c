"""The hand of one of the project's own recordings (HDF5, stream ``poses``), to be played again."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from haptics.errors import InputError
from haptics.recording import Recording, load
from haptics.recording.streams import check_fields
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.recording import HandRecording, HandTrack
from haptics.scene.hands.time_order import LONGEST_S
from haptics.time import NS_PER_S

SIGNATURE = b"\x89HDF"
_FIELDS: dict[str, tuple[str, tuple[int, ...] | None]] = {
    "side": ("iu", ()),
    "track": ("iu", ()),
    "sampled_ns": ("i", ()),
    "position_m": ("f", (26, 3)),
    "orientation_xyzw": ("f", (26, 4)),
}


def load_recorded(path: Path) -> HandRecording:
    """The poses that a run received, exactly, with time zero at the start of its motion.

    :param path: a recording made by ``haptics run``.
    :return: the hand, ready to be played again.
    :raises InputError: not a recording, or one without poses.
    """
    recording = load(path)
    if "poses" not in recording:
        raise InputError(f"hand {path}: the recording has no stream `poses`; expected one that `haptics run` made")
    check_fields(f"hand {path}", recording.streams["poses"], _FIELDS)
    poses, start_ns = recording.stream("poses"), motion_start_ns(recording)
    for index, sampled_ns in enumerate(poses["sampled_ns"].tolist()):
        if abs(sampled_ns - start_ns) > LONGEST_S * NS_PER_S:
            raise InputError(
                f"hand {path}: pose {index} is {(sampled_ns - start_ns) / NS_PER_S:.6g} s from the start of the motion; "
                f"must be at most {LONGEST_S:g} s"
            )
    tracks = []
    for side, track in dict.fromkeys(zip(poses["side"].tolist(), poses["track"].tolist(), strict=True)):
        if not 0 <= side < len(SIDES):
            raise InputError(f"hand {path}: a pose has side {side}; allowed: 0 (left) or 1 (right)")
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
    motion = recording.header.get("motion")
    motion = motion if isinstance(motion, dict) else {}
    duration_s = motion.get("duration_s")
    if not isinstance(duration_s, (int, float)) or not 0.0 <= duration_s <= LONGEST_S:
        duration_s = float(poses["sampled_ns"].max() - start_ns) / NS_PER_S if len(poses) else 0.0
    count = motion.get("frame_count")
    frame_count = count if isinstance(count, int) else len(poses)
    return HandRecording(str(motion.get("source", path.name)), tuple(tracks), frame_count, duration_s)


def motion_start_ns(recording: Recording) -> int:
    """When the hand's motion began.

    :param recording: of a run.
    :return: on the run's clock.
    :raises InputError: the recording has no event ``start``.
    """
    events = recording.stream("events")
    check_fields(str(recording.path), recording.streams["events"], {"kind": ("S", ())})
    started = events["time_ns"][events["kind"] == b"start"]
    if not len(started):
        raise InputError(f"{recording.path}: no event `start`; the run ended before its motion began")
    return int(started[0])

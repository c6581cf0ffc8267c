"""The hand of one of the project's own recordings (HDF5, stream ``poses``), to be played again.

A run begins with its motion, at an event ``start``, and all of its poses are given. A session on a glove (``haptics.open`` with
``record``) has been given poses as an engine had them: its motion begins with the first one, and of a hand of which it took some,
those that it refused are left out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.recording import Recording, load
from haptics.recording.streams import check_fields
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.origin import Origin
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
_ACCEPTED: dict[str, tuple[str, tuple[int, ...] | None]] = {"accepted": ("biu", ())}


def load_recorded(path: Path) -> HandRecording:
    """The poses that a run or a session received, exactly, with time zero at the start of the motion.

    :param path: a recording made by ``haptics run``, or of a glove with a session on it.
    :return: the hand, ready to be played again.
    :raises InputError: not a recording, or one without poses.
    """
    recording = load(path)
    if "poses" not in recording:
        raise InputError(f"hand {path}: the recording has no stream `poses`; expected one of `haptics run` or a session")
    check_fields(f"hand {path}", recording.streams["poses"], _FIELDS)
    poses, dropped = recording.stream("poses"), {}
    if "scene_source" in recording.header:
        kind, start_ns = "a recording of `haptics run`", motion_start_ns(recording)
    else:
        check_fields(f"hand {path}", recording.streams["poses"], _ACCEPTED)
        kind, (poses, dropped) = "a recording of a session", _taken(poses)
        start_ns = int(poses["sampled_ns"].min()) if len(poses) else 0
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
    origin = Origin(kind, "openxr", "m", "ns", off_m=0.0)
    return HandRecording(str(motion.get("source", path.name)), tuple(tracks), frame_count, duration_s, dropped, origin=origin)


def _taken(poses: NDArray[np.void]) -> tuple[NDArray[np.void], dict[str, int]]:
    """Of each hand of which the session took poses, those; of the other hand, which drives nothing, all."""
    taken = poses["accepted"] != 0
    keep = taken | ~np.isin(poses["side"], poses["side"][taken])
    refused = int((~keep).sum())
    return poses[keep], {"poses that the session refused": refused} if refused else {}


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

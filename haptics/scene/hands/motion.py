"""The motion of one hand of a recording: the poses to play, and what was refused and why.

One bad pose is refused and not the recording; where a large share is bad (``LARGE_SHARE``), the recording is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from haptics.errors import InputError
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.handedness import apparent_side, contradiction
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.pose_gate import PoseGate
from haptics.scene.hands.recording import HandRecording, HandTrack, RefusedPose, too_many_refused
from haptics.scene.hands.time_order import in_order, why_not
from haptics.time import NS_PER_S
from haptics.units import one_of


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The part of a recording that is played.

    :param recording: without the poses that are refused.
    :param side: the hand that is followed.
    :param frames: its poses, each as a hand can have it after the one before.
    :param refused: the others of that hand, by time where it is known.
    :param notes: what a person should know of the choice, in sentences.
    """

    recording: HandRecording
    side: str
    frames: tuple[HandFrame, ...]
    refused: tuple[RefusedPose, ...]
    notes: tuple[str, ...]


def judge_motion(recording: HandRecording, side: str = "auto", source: str | None = None) -> Motion:
    """The motion of one hand, without the poses that must not move anything.

    :param recording: of one or both hands.
    :param side: ``left``, ``right``, or ``auto``: the one with most poses.
    :param source: how messages call the recording; None: by its own name.
    :return: what is played, and what was refused and why.
    :raises InputError: no pose of that hand (the message lists those there are), or a large share of them refused.
    """
    one_of("side", side, ("auto", *SIDES))
    source = recording.source if source is None else source
    chosen = recording.side_with_most_frames if side == "auto" else side
    frames = tuple(recording.frames(chosen))
    found = {index: _refusal(frames[index], reason) for index, reason in refusals(frames).items()}
    unread = tuple(pose for pose in recording.refused if pose.side in (chosen, None))
    total = len(frames) + len(unread)
    if not frames:
        raise InputError(f"hand {source}: {_none_of(recording, chosen, side != 'auto')}")
    if (found or unread) and too_many_refused(len(found) + len(unread), total):
        first = unread[0].reason if unread else ""
        if found:
            index = min(found)
            first = f"pose {index} at {frames[index].time_ns / NS_PER_S:.3f} s is refused: {found[index].reason}"
        share = f"{len(found) + len(unread)} of {total} poses of the {chosen} hand cannot be used"
        raise InputError("; ".join((f"hand {source}: {first} ({share})", *recording.notes)))
    kept = tuple(frame for index, frame in enumerate(frames) if index not in found)
    refused = tuple(sorted((*unread, *found.values()), key=lambda pose: (pose.time_ns is None, pose.time_ns or 0)))
    left = _without(recording, chosen, kept) if found else recording
    notes = (
        *recording.notes,
        *_of_refused(refused, chosen),
        *_of_other_hand(recording, chosen, side == "auto"),
        *_of_handedness(left, chosen),
    )
    return Motion(left, chosen, kept, refused, notes)


def refusals(frames: tuple[HandFrame, ...]) -> dict[int, str]:
    """Find the poses of one hand that must not move anything.

    :param frames: in the order of the recording.
    :return: the reason of each, by its index in ``frames``.
    """
    time_ns = np.array([frame.time_ns for frame in frames], np.int64)
    keep = in_order(time_ns)
    gate = PoseGate()
    found: dict[int, str] = {}
    last, last_ns, doubted = -1, -1, -1
    for index, frame in enumerate(frames):
        if not keep[index]:
            late = last >= 0 and frame.time_ns <= last_ns
            why = f"does not follow {last_ns} ns" if late else why_not(time_ns, keep, index)
            found[index] = f"its time {frame.time_ns} ns {why}"
            continue
        reason = gate.judge(frame)
        if reason is not None:
            found[index], doubted = reason, index
            continue
        if gate.overturned is not None:  # the pose in doubt was right, and the one that it was held against wrong
            found[last] = found.pop(doubted)
        last, last_ns = index, frame.time_ns
    return dict(sorted(found.items()))


def accepted(track: HandTrack) -> HandTrack | None:
    """A track without the poses that must not move anything.

    :param track: as recorded.
    :return: the track itself where none is refused; None if none is left.
    """
    bad = refusals(tuple(track.frames()))
    keep = np.array([index not in bad for index in range(len(track))], bool)
    return track if not bad else _thinned(track, keep)


def _refusal(frame: HandFrame, reason: str) -> RefusedPose:
    return RefusedPose(frame.time_ns, frame.side, reason)


def _thinned(track: HandTrack, keep: np.ndarray) -> HandTrack | None:
    if not keep.any():
        return None
    return replace(
        track,
        time_ns=track.time_ns[keep],
        position_m=track.position_m[keep],
        orientation_xyzw=track.orientation_xyzw[keep],
    )


def _without(recording: HandRecording, side: str, kept: tuple[HandFrame, ...]) -> HandRecording:
    at = {(frame.track_id, frame.time_ns) for frame in kept}
    tracks = []
    for track in recording.tracks:
        if track.side == side:
            track = _thinned(track, np.array([(track.track_id, time_ns) in at for time_ns in track.time_ns.tolist()], bool))
        if track is not None:
            tracks.append(track)
    return replace(recording, tracks=tuple(tracks))


def _none_of(recording: HandRecording, side: str, by_name: bool) -> str:
    count = {other: sum(map(len, recording.of_side(other))) for other in SIDES if recording.of_side(other)}
    there = ", ".join(f"{other}: {poses} poses" for other, poses in count.items())
    what = f"the recording has {there}" if there else f"the recording has no whole hand in its {recording.frame_count} frames"
    dropped = "".join(f"; left out while reading: {number} {name}" for name, number in recording.dropped.items())
    unread = [pose.reason for pose in recording.refused]
    refused = f"; {len(unread)} poses could not be read, the first: {unread[0]}" if unread else ""
    choose = f"; --side {next(iter(count))} plays that hand" if count else ""
    of_whom = f"of the {side} hand" if count or by_name else "of either hand"
    return f"no pose {of_whom}; {what}{dropped}{refused}{choose}"


def _of_refused(refused: tuple[RefusedPose, ...], side: str) -> list[str]:
    for first in refused[:1]:
        at = "" if first.time_ns is None else f" at {first.time_ns / NS_PER_S:.3f} s"
        if len(refused) == 1:
            return [f"1 pose of the {side} hand was refused{at}: {first.reason}"]
        return [f"{len(refused)} poses of the {side} hand were refused, the first{at}: {first.reason}"]
    return []


def _of_other_hand(recording: HandRecording, side: str, chosen_here: bool) -> list[str]:
    other = SIDES[1 - SIDES.index(side)]
    poses = sum(map(len, recording.of_side(other)))
    if not poses:
        return []
    how = f"; `--side {other}`, or `side` in the configuration, chooses it" if chosen_here else ""
    return [f"the {other} hand ({poses} poses) was left out, the {side} one was played{how}"]


def _of_handedness(recording: HandRecording, side: str) -> list[str]:
    tracks = recording.of_side(side)
    position_m = np.concatenate([track.position_m for track in tracks])
    turn = np.concatenate([track.orientation_xyzw for track in tracks])
    wrong = contradiction(side, apparent_side(position_m, turn))
    return [] if wrong is None else [wrong]

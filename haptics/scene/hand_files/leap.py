"""Recordings of a Leap Motion controller, as LeapJS and programs around it write them; recognised by content, not by name.

Frames may be the list ``frames`` of an object, a list alone, or follow each other line by line, bare or as events with a
``frame`` in them; as objects or as packed rows; plain, gzip or lz-string (``docs/reference/hands.md``).

The device's basis is OpenXR's (right-handed, +Y up, +Z toward the user) in millimetres and microseconds. It reports four
points a finger and the palm. What OpenXR has beyond them is estimated:

- the thumb's ``mcpPosition`` is the base of its metacarpal, a finger's is its knuckle (``*_proximal``);
- the wrist lies ``WRIST_BEHIND_PALM`` lengths of the middle finger's proximal bone behind the palm. Leap's palm is about
  20 mm behind the middle knuckle, and a wrist 90 mm, twice that bone (assumed, from bone lengths of adults);
- the other metacarpals begin where ``completion.put_in_metacarpals`` puts them (assumed, likewise);
- orientations come from the bones' directions and the palm's normal (``haptics.scene.hands.bones``).

A pose that cannot be read, and a frame out of order in time, are left out and kept in ``refused``; where they are a large share
the file is refused. Whether a pose is one that a hand can have is not judged here but by ``haptics.scene.hands.motion``.
"""

from __future__ import annotations

from array import array
from collections import Counter
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from haptics.errors import InputError
from haptics.scene.hand_files.foreign import foreign_members
from haptics.scene.hand_files.json_stream import Item, Member, read_items
from haptics.scene.hand_files.leap_frame import Seen, of_type, read_frame
from haptics.scene.hand_files.packed_rows import check_schema, unpacked
from haptics.scene.hands.bones import orientations
from haptics.scene.hands.completion import METACARPALS, put_in_metacarpals
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import FINGERS, JOINT, NOMINAL_RADIUS_M, Side
from haptics.scene.hands.origin import Origin
from haptics.scene.hands.recording import HandRecording, HandTrack, RefusedPose, too_many_refused
from haptics.scene.hands.time_order import in_order, why_not
from haptics.time import NS_PER_MS, NS_PER_S, NS_PER_US

PROTOCOL_VERSION = 6
"""The version whose frames have all that is needed; what a file states is a hint and no more."""
TRACK_GAP_NS = 100 * NS_PER_MS
"""A hand unseen for longer than this comes back as a new track."""
WRIST_BEHIND_PALM = 1.5
HOPELESS = 1000
"""So many refused poses, a large share so far, and no more of the file is read."""

FASTEST_S, SLOWEST_S = 1e-3, 0.5
"""A tracker's frames are no nearer and no farther apart, in the median (assumed; those in use give some 10 to 300 a second)."""
ORIGIN = Origin("Leap Motion, as LeapJS writes it", "openxr", "mm", "us", ("wrist", *METACARPALS), turned=True)
_REPEATED = "frames that repeat a time stamp"
_HEADERS = frozenset({"version", "serviceVersion", "state", "event"})


@dataclass
class _OpenTrack:
    """What has been read of a hand so far: times, and rows as in ``leap_frame.Seen``."""

    side: Side
    time_ns: list[int] = field(default_factory=list)
    rows: list[Floats] = field(default_factory=list)


def load_leap(path: str | PathLike[str]) -> HandRecording:
    """Read a recording of a Leap Motion controller.

    Left out, and counted in ``dropped``: frames that repeat a time stamp, hands without all five fingers, pointables whose
    hand is not in the frame, and tools. Left out, and listed in ``refused``: poses with a value that is missing, of the wrong
    type or out of range, and frames out of order in time.

    :param path: the file; its name does not matter.
    :return: in metres; time zero is the first frame.
    :raises InputError: the file cannot be read, is not a recording of hands, or a large share of it is refused; the message names
        the place, the value and what is expected, or what the file is instead.
    """
    path = Path(path)
    try:
        return _Reading(path).recording()
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


class _Reading:
    """A file while it is read."""

    def __init__(self, path: Path):
        self._source = path.name
        self._version: object = None
        self._schema: list | None = None
        self._frame_ns, self._places = array("q"), array("q")
        self._place = "frames[{}]"
        self._seen: list[tuple[int, Seen]] = []
        self._dropped: Counter[str] = Counter()
        self._refused: list[tuple[int | None, str | None, str]] = []  # device's time where it is known, side, reason
        self._foreign: str | None = None
        for number, item in enumerate(read_items(path, "frames")):
            if isinstance(item, Item):
                self._take(item)
            else:
                self._take_member(item)
            if number % HOPELESS == 0 and len(self._refused) >= HOPELESS:
                self._check_share()

    def _take_member(self, member: Member) -> None:
        if member.name == "metadata" and member.value is not None:
            self._version = of_type(member.value, "metadata", dict, "an object").get("protocolVersion")

    def _take(self, item: Item) -> None:
        place, value = item.place, item.value
        if isinstance(value, dict) and place.startswith("objects"):
            self._place = "objects[{}]"
            if "hands" not in value and isinstance(value.get("frame"), dict):
                place, value = f"{place}.frame", value["frame"]
            elif "hands" not in value and value.keys() & _HEADERS:
                self._version = value.get("version", self._version)
                return
            elif not value.keys() & {"hands", "timestamp"}:
                self._foreign = self._foreign or foreign_members(value)
                which = "" if place == "objects[0]" else f"{place} is not a frame, and "
                self._refused.append((None, None, f"{which}frames is missing or empty; expected at least one frame"))
                return
        if isinstance(value, list) and place == "frames[0]":
            self._schema = self._checked_schema(value, place)
            return
        try:
            if item.broken:
                raise InputError(item.broken)
            frame = read_frame(value if self._schema is None else unpacked(self._schema, value, place), place, self._dropped)
        except InputError as error:
            self._foreign = self._foreign or foreign_members(value)
            self._refused.append((None, None, str(error)))
            return
        self._seen += [(len(self._frame_ns), hand) for hand in frame.hands]
        self._refused += [(frame.time_ns, side, reason) for side, reason in frame.refused]
        self._frame_ns.append(frame.time_ns)
        self._places.append(int(item.place[item.place.index("[") + 1 : -1]))

    def _checked_schema(self, value: list, place: str) -> list:
        try:
            return check_schema(value, place)
        except InputError as error:
            what = foreign_members(value)
            raise InputError(f"{what}; seen: {error}") if what else error from None

    def recording(self) -> HandRecording:
        time_ns = np.array(self._frame_ns, np.int64)
        keep = in_order(time_ns)
        self._leave_out(time_ns, keep)
        self._check_share()
        if not keep.any():
            raise InputError("frames is missing or empty; expected at least one frame")
        repeated = self._dropped[_REPEATED]
        if 2 * repeated > len(time_ns):
            raise InputError(f"{repeated} of {len(time_ns)} frames repeat a timestamp; each needs its own, in whole microseconds")
        kept_ns = time_ns[keep]
        first_ns, last_ns = int(kept_ns[0]), int(kept_ns[-1])
        return HandRecording(
            source=self._source,
            tracks=self._tracks((time_ns - first_ns).tolist()),
            frame_count=len(kept_ns),
            duration_s=(last_ns - first_ns) / NS_PER_S,
            dropped=dict(self._dropped),
            refused=tuple(RefusedPose(None if at is None else at - first_ns, side, reason) for at, side, reason in self._refused),
            notes=(*self._notes(), *_of_rate(kept_ns)),
            origin=ORIGIN,
        )

    def _leave_out(self, time_ns: np.ndarray, keep: np.ndarray) -> None:
        if keep.all():
            return
        kept = set(time_ns[keep].tolist())
        sides: dict[int, list[str]] = {}
        for index, hand in self._seen:
            if not keep[index]:
                sides.setdefault(index, []).append(hand.side)
        self._seen = [(index, hand) for index, hand in self._seen if keep[index]]
        for index in np.flatnonzero(~keep).tolist():
            at_ns = int(time_ns[index])
            if at_ns in kept:
                self._dropped[_REPEATED] += 1
                continue
            place = self._place.format(self._places[index])
            reason = f"{place}.timestamp = {at_ns / NS_PER_US:.16g} us {why_not(time_ns, keep, index)}"
            self._refused += [(None, side, reason) for side in sides.get(index, [])]
            if index not in sides:
                self._dropped["frames without a hand, out of order in time"] += 1

    def _check_share(self) -> None:
        if self._refused and too_many_refused(len(self._refused), len(self._refused) + len(self._seen)):
            first = self._refused[0][2]
            if self._foreign:
                raise InputError(f"{self._foreign}; seen: {first}")
            many = f" ({len(self._refused)} of {len(self._refused) + len(self._seen)} poses cannot be used)"
            version = self._version
            old = isinstance(version, int) and version < PROTOCOL_VERSION
            hint = f"; its protocol version is {version}, and the joints of fingers came with {PROTOCOL_VERSION}" if old else ""
            raise InputError(f"{first}{many if len(self._refused) > 1 else ''}{hint}")

    def _tracks(self, frame_ns: list[int]) -> tuple[HandTrack, ...]:
        latest: dict[tuple[int, str], _OpenTrack] = {}
        tracks: list[_OpenTrack] = []
        for index, hand in self._seen:
            key = hand.device_id, hand.side
            track = latest.get(key)
            if track is None or frame_ns[index] - track.time_ns[-1] > TRACK_GAP_NS:
                track = latest[key] = _OpenTrack(hand.side)
                tracks.append(track)
            track.time_ns.append(frame_ns[index])
            track.rows.append(hand.row)
        return tuple(_track(number, track) for number, track in enumerate(tracks))

    def _notes(self) -> tuple[str, ...]:
        version = self._version
        if version is None:
            return (f"{self._source} does not state its protocol version; its frames are read as {PROTOCOL_VERSION}",)
        if isinstance(version, bool) or str(version) != str(PROTOCOL_VERSION):
            return (f"{self._source} states protocol version {str(version)[:20]!r}; its frames are read as {PROTOCOL_VERSION}",)
        return ()


def _of_rate(time_ns: np.ndarray) -> list[str]:
    apart_s = float(np.median(np.diff(time_ns))) / NS_PER_S if len(time_ns) > 2 else SLOWEST_S
    if FASTEST_S <= apart_s <= SLOWEST_S:
        return []
    how = "fast" if apart_s < FASTEST_S else "slow"
    return [f"the frames are {apart_s:.3g} s apart, too {how} for a tracker; are the time stamps in microseconds?"]


def _track(number: int, track: _OpenTrack) -> HandTrack:
    rows = np.array(track.rows)
    palm_m, normal, direction = rows[:, :3] * 1e-3, rows[:, 3:6], rows[:, 6:9]
    finger_m = rows[:, 9:69].reshape(-1, 5, 4, 3) * 1e-3
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)

    bone_m = float(np.median(np.linalg.norm(finger_m[:, 2, 1] - finger_m[:, 2, 0], axis=1)))
    wrist_m = palm_m - WRIST_BEHIND_PALM * bone_m * direction
    position_m = np.empty((len(rows), 26, 3))
    position_m[:, JOINT["palm"]], position_m[:, JOINT["wrist"]] = palm_m, wrist_m
    radius_m = NOMINAL_RADIUS_M.copy()
    for finger, name in enumerate(FINGERS):
        tip = JOINT[f"{name}_tip"]
        position_m[:, tip - 3 : tip + 1] = finger_m[:, finger]
        width_m = rows[:, 69 + finger] * 1e-3
        if np.isfinite(width_m).any():
            radius_m[tip - 2 : tip + 1] = 0.5 * np.nanmedian(width_m)
    put_in_metacarpals(position_m, METACARPALS)
    return HandTrack(
        side=track.side,
        track_id=number,
        time_ns=np.array(track.time_ns, np.int64),
        position_m=position_m,
        orientation_xyzw=orientations(position_m, direction, -normal, track.side),
        radius_m=radius_m,
    )

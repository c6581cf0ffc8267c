"""Recordings of a Leap Motion controller, as LeapJS writes them (protocol version 6), ``.json`` or ``.json.gz``.

The device's basis is OpenXR's (right-handed, +Y up, +Z toward the user) in millimetres and microseconds. It reports four
points a finger and the palm. What OpenXR has beyond them is estimated:

- the thumb's ``mcpPosition`` is the base of its metacarpal, a finger's is its knuckle (``*_proximal``);
- the wrist lies ``WRIST_BEHIND_PALM`` lengths of the middle finger's proximal bone behind the palm. Leap's palm is about
  20 mm behind the middle knuckle, and a wrist 90 mm, twice that bone (assumed, from bone lengths of adults);
- the other metacarpals begin ``METACARPAL_SHARE`` of the way from the knuckle to the wrist (assumed, likewise);
- orientations come from the bones' directions and the palm's normal (``haptics.scene.bones``).

Poses are not judged here: a hand that jumps is loaded as recorded, and ``check_frame`` refuses it where it would move things.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TypeVar

import numpy as np

from haptics.errors import InputError
from haptics.scene.bones import orientations
from haptics.scene.hand import FARTHEST_M, FINGERS, JOINT, NOMINAL_RADIUS_M, SIDES, Floats, HandRecording, HandTrack
from haptics.scene.json_stream import read_members
from haptics.time import NS_PER_MS, NS_PER_S, NS_PER_US

Kind = TypeVar("Kind")

PROTOCOL_VERSION = 6
TRACK_GAP_NS = 100 * NS_PER_MS
"""A hand unseen for longer than this comes back as a new track."""
LONGEST_S = 3600.0
"""A recording is at most this long; a later time stamp is a broken one."""
WRIST_BEHIND_PALM = 1.5
METACARPAL_SHARE = 0.72
FARTHEST_MM = FARTHEST_M * 1e3
WIDEST_FINGER_MM = 100.0
_LATEST_US = 2**53  # beyond it a JSON reader that uses doubles cannot tell microseconds apart

_POINTS = ("mcpPosition", "pipPosition", "dipPosition", "tipPosition")


@dataclass
class _OpenTrack:
    """What has been read of a hand so far: times, and rows of palm, normal, direction, 20 finger points, 5 widths."""

    side: str
    time_ns: list[int] = field(default_factory=list)
    rows: list[Floats] = field(default_factory=list)


def load_leap(path: str | PathLike[str]) -> HandRecording:
    """The recording in ``path``. Its time zero is the first frame.

    Left out, and counted in ``dropped``: frames that repeat a time stamp, hands without all five fingers, pointables whose
    hand is not in the frame, and tools.

    :raises InputError: the file cannot be read, is not version 6, or a value in it is missing, of the wrong type or out of
        range, or time goes back; the message names the frame, the key, the value and what is allowed.
    """
    path = Path(path)
    try:
        return _read(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _read(path: Path) -> HandRecording:
    latest: dict[tuple[int, str], _OpenTrack] = {}
    tracks: list[_OpenTrack] = []
    dropped: Counter[str] = Counter()
    version: int | None = None
    first_ns = last_ns = -1
    frame_count = 0
    for name, index, value in read_members(path, "frames"):
        if name == "metadata":
            version = _version(value)
        if name != "frames":
            continue
        place = f"frames[{index}]"
        frame = _of_type(value, place, dict, "an object")
        device_ns = _time_ns(frame, place, first_ns, last_ns)
        if device_ns == last_ns:
            dropped["frames that repeat a time stamp"] += 1
            continue
        first_ns, last_ns = device_ns if first_ns < 0 else first_ns, device_ns
        frame_count += 1
        for device_id, side, row in _hands(frame, place, dropped):
            track = latest.get((device_id, side))
            if track is None or device_ns - first_ns - track.time_ns[-1] > TRACK_GAP_NS:
                track = latest[device_id, side] = _OpenTrack(side)
                tracks.append(track)
            track.time_ns.append(device_ns - first_ns)
            track.rows.append(row)
    if version is None:
        raise InputError(f"metadata.protocolVersion is missing; allowed: {PROTOCOL_VERSION}")
    if frame_count == 0:
        raise InputError("frames is missing or empty; allowed: at least one frame")
    return HandRecording(
        source=path.name,
        tracks=tuple(_track(number, track) for number, track in enumerate(tracks)),
        frame_count=frame_count,
        duration_s=(last_ns - first_ns) / NS_PER_S,
        dropped=dict(dropped),
    )


def _version(metadata: object) -> int:
    version = _of_type(metadata, "metadata", dict, "an object").get("protocolVersion")
    if isinstance(version, bool) or version != PROTOCOL_VERSION:
        raise InputError(f"metadata.protocolVersion = {_short(version)} is not allowed; allowed: {PROTOCOL_VERSION}")
    return PROTOCOL_VERSION


def _time_ns(frame: dict, place: str, first_ns: int, last_ns: int) -> int:
    time_us = _number(_member(frame, "timestamp", place), f"{place}.timestamp", 0, _LATEST_US, "us")
    time_ns = round(time_us * NS_PER_US)
    if time_ns < last_ns:
        raise InputError(
            f"{place}.timestamp = {time_us} us goes back; "
            f"allowed: {last_ns / NS_PER_US:.16g} us, that of the frame before, or later"
        )
    if first_ns >= 0 and time_ns - first_ns > LONGEST_S * NS_PER_S:
        raise InputError(
            f"{place}.timestamp = {time_us} us is {(time_ns - first_ns) / NS_PER_S:.6g} s after the first; "
            f"allowed: up to {LONGEST_S:g} s"
        )
    return time_ns


def _hands(frame: dict, place: str, dropped: Counter[str]) -> list[tuple[int, str, Floats]]:
    """The frame's whole hands: the device's id, the side, and a row of 74 numbers in millimetres."""
    hands: dict[int, tuple[str, list[float]]] = {}
    for index, hand in enumerate(_of_type(_member(frame, "hands", place), f"{place}.hands", list, "a list")):
        at = f"{place}.hands[{index}]"
        _of_type(hand, at, dict, "an object")
        device_id = _whole(_member(hand, "id", at), f"{at}.id")
        if device_id in hands:
            raise InputError(f"{at}.id = {device_id} is given twice in one frame; allowed: each hand once")
        side = _member(hand, "type", at)
        if side not in SIDES:
            raise InputError(f"{at}.type = {_short(side)} is not allowed; allowed: {', '.join(SIDES)}")
        normal, direction = (_unit(hand, key, at) for key in ("palmNormal", "direction"))
        if abs(float(np.dot(normal, direction))) > 0.9 * math.hypot(*normal) * math.hypot(*direction):
            raise InputError(f"{at}.palmNormal = {normal} lies along the direction; allowed: across it")
        hands[device_id] = side, [*_point(hand, "palmPosition", at), *normal, *direction]

    fingers: dict[tuple[int, int], tuple[list[float], float]] = {}
    for index, pointable in enumerate(_of_type(_member(frame, "pointables", place), f"{place}.pointables", list, "a list")):
        at = f"{place}.pointables[{index}]"
        _of_type(pointable, at, dict, "an object")
        if pointable.get("tool") is True:
            dropped["tools"] += 1
            continue
        device_id = _whole(_member(pointable, "handId", at), f"{at}.handId")
        if device_id not in hands:
            dropped["pointables without their hand"] += 1
            continue
        finger = _whole(_member(pointable, "type", at), f"{at}.type")
        if not 0 <= finger <= 4:
            raise InputError(f"{at}.type = {finger} is not allowed; allowed: 0 (thumb) to 4 (little finger)")
        if (device_id, finger) in fingers:
            raise InputError(f"{at}.type = {finger} is given twice for hand {device_id}; allowed: each finger once")
        points = [number for key in _POINTS for number in _point(pointable, key, at)]
        width_mm = math.nan  # not every writer gives one
        if "width" in pointable:
            width_mm = _number(pointable["width"], f"{at}.width", 0.0, WIDEST_FINGER_MM, "mm")
        fingers[device_id, finger] = points, width_mm

    whole = []
    for device_id, (side, palm) in hands.items():
        own = [fingers.get((device_id, finger)) for finger in range(5)]
        found = [finger for finger in own if finger is not None]
        if len(found) < 5:
            dropped["hands without all five fingers"] += 1
            continue
        row = [*palm, *(number for points, _ in found for number in points), *(width for _, width in found)]
        whole.append((device_id, side, np.array(row, float)))
    return whole


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
        if name != "thumb":
            knuckle_m = finger_m[:, finger, 0]
            position_m[:, JOINT[f"{name}_metacarpal"]] = knuckle_m + METACARPAL_SHARE * (wrist_m - knuckle_m)
        width_m = rows[:, 69 + finger] * 1e-3
        if np.isfinite(width_m).any():
            radius_m[tip - 2 : tip + 1] = 0.5 * np.nanmedian(width_m)
    return HandTrack(
        side=track.side,
        track_id=number,
        time_ns=np.array(track.time_ns, np.int64),
        position_m=position_m,
        orientation_xyzw=orientations(position_m, direction, -normal, track.side),
        radius_m=radius_m,
    )


def _member(owner: dict, key: str, place: str) -> object:
    if key not in owner:
        raise InputError(f"{place}.{key} is missing; allowed: present in each")
    return owner[key]


def _of_type(value: object, place: str, kind: type[Kind], allowed: str) -> Kind:
    if not isinstance(value, kind):
        raise InputError(f"{place} is {_short(value)}; allowed: {allowed}")
    return value


def _number(value: object, place: str, low: float, high: float, unit: str) -> float:
    # Comparing before converting keeps integers of any length, and NaN, out.
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise InputError(f"{place} = {_short(value)} is not allowed; allowed: a number from {low:.16g} to {high:.16g} {unit}")
    return value


def _whole(value: object, place: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**63:
        raise InputError(f"{place} = {_short(value)} is not allowed; allowed: a whole number of 64 bits")
    return value


def _point(owner: dict, key: str, place: str) -> list[float]:
    value = _member(owner, key, place)
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{place}.{key} is {_short(value)}; allowed: three numbers")
    return [_number(part, f"{place}.{key}[{axis}]", -FARTHEST_MM, FARTHEST_MM, "mm") for axis, part in enumerate(value)]


def _unit(owner: dict, key: str, place: str) -> list[float]:
    vector = _point(owner, key, place)
    if not 0.5 <= math.hypot(*vector) <= 2.0:
        raise InputError(f"{place}.{key} = {vector} has length {math.hypot(*vector):.6g}; allowed: 1, a direction")
    return vector


def _short(value: object) -> str:
    """What was seen, in a few characters, whatever it is."""
    if isinstance(value, (list, dict)):
        return f"{'a list' if isinstance(value, list) else 'an object'} of {len(value)}"
    if isinstance(value, int) and abs(value) >= 10**20:
        return f"an integer of {value.bit_length()} bits"
    text = "null" if value is None else repr(value)
    return text if len(text) <= 40 else f"{text[:40]}..."

"""World landmarks of MediaPipe's hands, as its tasks for Python and the web and its older solutions give them, in JSON.

A result a line, with a time beside it, in a list, or in ``frames`` of an object::

    {"timestamp_ms": 33, "handedness": [[{"category_name": "Right"}]],
     "hand_world_landmarks": [[{"x": 0.01, "y": -0.02, "z": 0.0}, ...]]}

- *Axes.* Landmarks have +X to the right of the picture, +Y down, +Z away from the camera; OpenXR's, for someone who looks as the
  camera does, are half a turn about X from them.
- *Place.* Metres, from the middle of the hand: the hand turns and bends, but does not travel.
- *Mirrored pictures.* Where the picture was mirrored first (a selfie), so are the points, which are mirrored back, and the tasks
  name the other hand. The older solutions name the hand as of a mirrored picture, mirrored or not, so they need to be told.
- *Joints.* 21: the palm, the metacarpals of the fingers and all orientations are made (``haptics.scene.hands.completion``).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from haptics.errors import InputError
from haptics.scene.hand_files.clock_member import Clock
from haptics.scene.hand_files.declared import Declared, declared_in
from haptics.scene.hand_files.joint_pose import joint_numbers
from haptics.scene.hand_files.json_stream import Item, Member, read_items
from haptics.scene.hand_files.pose_rows import LOST, PoseRows
from haptics.scene.hand_files.spelling import PARTS, plain, side_of
from haptics.scene.hands.basis import Basis
from haptics.scene.hands.completion import REQUIRED
from haptics.scene.hands.joints import JOINT, JOINTS, SIDES
from haptics.scene.hands.shown import shown

WORLD = ("hand_world_landmarks", "world_landmarks")
OLD_WORLD = "multi_hand_world_landmarks"
PICTURE = ("hand_landmarks", "landmarks", "multi_hand_landmarks")
_HANDEDNESS = ("handedness", "handednesses", "multi_handedness", "side")
_LABELS = ("category_name", "label", "display_name")
_WITHIN = ("landmark", "landmarks", "classification", "categories")
LANDMARKS = REQUIRED
"""The joint of each landmark: both go from the wrist out, thumb first."""
_AXES = {
    False: Basis("mediapipe", ((1, 0, 0), (0, -1, 0), (0, 0, -1))),
    True: Basis("mediapipe, mirrored", ((-1, 0, 0), (0, -1, 0), (0, 0, -1))),
}
TRAVEL = "world landmarks have their origin in the hand, so the hand turns and bends but does not travel"


def read_landmarks(path: Path, told: Declared) -> tuple[PoseRows, Basis, list[str]]:
    """Collect the poses of a file.

    :param path: JSON of landmarks.
    :param told: what whoever reads it says of its numbers.
    :return: poses in the landmarks' own axes, those axes, and notes.
    :raises InputError: not JSON of that form, nearly all of it cannot be used, or it is not known whether it was mirrored.
    """
    reading = _Reading(told)
    for item in read_items(path, "frames"):
        reading.take(item)
    return reading.rows, _AXES[bool(reading.mirrored)], [TRAVEL, *reading.notes()]


class _Reading:
    """A file while it is read."""

    def __init__(self, told: Declared):
        self.rows = PoseRows()
        self._told, self._clock = told, Clock(self.rows)

    @property
    def mirrored(self) -> bool | None:
        return self._told.over(self.rows.declared).mirrored

    def notes(self) -> list[str]:
        if self.mirrored is None:
            return ["the picture was taken for one that was not mirrored; the file does not say"]
        return ["the picture was mirrored, so points and sides were mirrored back"] if self.mirrored else []

    def take(self, item: Item | Member) -> None:
        """A result, a header, or another member of the object that has the results."""
        if isinstance(item, Member):
            self._hear(declared_in({item.name: item.value}, item.name, whole=True))
            return
        frame, place, rows = item.value, item.place, self.rows
        if not isinstance(frame, dict):
            rows.refuse(None, None, f"{place} is {shown(frame)}; expected an object with world landmarks")
            return
        members = {plain(name): value for name, value in frame.items()}
        self._hear(declared_in(frame, place))
        key = next((name for name in (*WORLD, OLD_WORLD) if name in members), None)
        if key is None:
            if any(members.get(name) for name in PICTURE):
                rows.refuse(None, None, f"{place}: {NO_SCALE}")
            return
        try:
            hands = _hands(members[key], f"{place}.{key}")
            labels = _labels(next((members[name] for name in _HANDEDNESS if name in members), None))
            time = self._clock.read(frame, place) if hands else 0.0
        except InputError as error:
            rows.refuse(None, None, str(error))
            return
        if not hands:
            rows.leave_out("frames without a hand")
        for index, hand in enumerate(hands):
            side = None
            try:
                side = self._side(labels[index] if index < len(labels) else None, key == OLD_WORLD, f"{place}.handedness")
                at = f"{place}.{key}[{index}]"
                rows.add(at, time, side, 0, _numbers(hand, at))
            except InputError as error:
                rows.refuse(time, side, str(error))

    def _hear(self, said: Declared) -> None:
        if said.mirrored is not None and self.rows.declared.mirrored is None and self.rows.time and self._told.mirrored is None:
            raise InputError("mirrored is said after the first pose; say it before")
        self.rows.declared = self.rows.declared.agreed(said)

    def _side(self, label: object, old: bool, place: str) -> str | None:
        """The hand that a label means; None where there is no label."""
        if old and self.mirrored is None:
            raise InputError(
                f"{place}: the older solutions name the hand as of a mirrored picture; begin the file with "
                '{"mirrored": true} or {"mirrored": false}, or convert it with --mirrored or --not-mirrored'
            )
        if label is None:
            return None
        side = side_of(label, place)
        other = SIDES[1 - SIDES.index(side)]
        return other if bool(self.mirrored) != old else side


NO_SCALE = (
    "landmarks of MediaPipe in parts of a picture (0 to 1), which have no scale; expected its world landmarks, in metres: "
    "hand_world_landmarks (Python) or worldLandmarks (web)"
)


def _hands(value: object, place: str) -> list[Sequence[object]]:
    """The landmarks of each hand; of one alone, too."""
    if value is None:
        return []
    if isinstance(value, list) and value and _is_point(value[0]):
        value = [value]
    if not isinstance(value, list):
        raise InputError(f"{place} is {shown(value)}; expected a list of hands, {len(LANDMARKS)} landmarks each")
    hands = []
    for index, hand in enumerate(value):
        hand = _inner(hand)
        if not isinstance(hand, list) or len(hand) != len(LANDMARKS):
            raise InputError(f"{place}[{index}] is {shown(hand)}; expected {len(LANDMARKS)} landmarks")
        hands.append(hand)
    return hands


def _is_point(value: object) -> bool:
    if isinstance(value, list):
        return bool(value) and not isinstance(value[0], (list, dict))
    return isinstance(value, dict) and any(plain(name) == "x" for name in value)


def _labels(value: object) -> list[object]:
    """What each hand is called; the first of several is the likeliest."""
    if not isinstance(value, list):
        return [_label(value)]
    return [_label(one) for one in value]


def _label(value: object) -> object:
    value = _inner(value)
    while isinstance(value, list):
        value = value[0] if value else None
    if isinstance(value, dict):
        members = {plain(name): part for name, part in value.items()}
        return next((members[name] for name in _LABELS if members.get(name)), None)
    return value


def _inner(value: object) -> object:
    if isinstance(value, dict):
        return next((part for name, part in value.items() if plain(name) in _WITHIN and isinstance(part, list)), value)
    return value


def _numbers(hand: Sequence[object], place: str) -> list[float]:
    numbers = list(LOST) * len(JOINTS)
    points = [joint_numbers(point, f"{place}[{index}]")[:3] for index, point in enumerate(hand)]
    if all(point[0] >= 0.0 and point[1] >= 0.0 for point in points):
        raise InputError(
            f"{place} has no x or y below 0, as world landmarks have, whose origin is in the hand; it seems to be {NO_SCALE}"
        )
    for name, point in zip(LANDMARKS, points, strict=True):
        at = len(PARTS) * JOINT[name]
        numbers[at : at + 3] = point
    return numbers

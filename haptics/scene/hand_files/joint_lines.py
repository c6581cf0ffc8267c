"""Hands as JSON, joint by joint, as WebXR, OpenXR and Unity XR Hands have them; a line each, a list, or ``frames`` of an object.

The plain form is a header and a line for each pose (``docs/reference/hands.md``)::

    {"basis": "unity", "unit": "m", "time": "ms"}
    {"time": 12.5, "side": "right", "joints": {"wrist": {"position": [0, 1, 0], "orientation": [0, 0, 0, 1]}, ...}}

Read are also both hands in one line: a list ``hands``, objects ``left`` and ``right``, or WebXR's ``inputSources``; joints in a
list with a name each, 25 without names in WebXR's order, and joints that are members of the hand itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from haptics.errors import InputError
from haptics.scene.hand_files.clock_member import Clock
from haptics.scene.hand_files.declared import NOTHING, declared_in
from haptics.scene.hand_files.joint_pose import is_marked_lost, joint_numbers
from haptics.scene.hand_files.json_stream import Item, Member, read_items
from haptics.scene.hand_files.pose_rows import LOST, PoseRows
from haptics.scene.hand_files.spelling import is_side, is_time, joint_called, plain, side_of
from haptics.scene.hands.joints import JOINTS, SIDES
from haptics.scene.hands.shown import shown

Members = dict[str, object]

_HANDS = ("hands", "input_sources")
_JOINTS = ("joints", "hand", "joint_poses", "bones")
_NAMES = ("name", "joint", "joint_name", "id", "joint_id")
_TRACKS = ("track", "track_id")
_WEBXR_COUNT = len(JOINTS) - 1


def read_joint_lines(path: Path) -> PoseRows:
    """Collect the poses of a file.

    :param path: JSON of joints.
    :return: in the file's own numbers.
    :raises InputError: not JSON of that form, or nearly all of it cannot be used.
    """
    rows = PoseRows()
    clock = Clock(rows)
    for item in read_items(path, "frames"):
        if isinstance(item, Member):
            rows.declared = rows.declared.agreed(declared_in({item.name: item.value}, item.name, whole=True))
        else:
            _take(item, rows, clock)
    return rows


def _take(item: Item, rows: PoseRows, clock: Clock) -> None:
    frame, place = item.value, item.place
    if not isinstance(frame, dict):
        rows.refuse(None, None, f"{place} is {shown(frame)}; expected an object with a time, a side and joints")
        return
    members = {plain(name): value for name, value in frame.items()}
    hands = list(_hands(members, place))
    timed = any(is_time(name) and not isinstance(value, str) for name, value in frame.items())
    said = declared_in(frame, place, whole=not timed)
    rows.declared = rows.declared.agreed(said)
    if not hands:
        if any(name in members for name in (*_HANDS, *SIDES)):
            rows.leave_out("frames without a hand")
        elif timed or said == NOTHING:
            rows.refuse(None, None, f"{place} has no joints; expected them by name, each with a position and an orientation")
        return
    try:
        time = clock.read(frame, place)
    except InputError as error:
        for _ in hands:
            rows.refuse(None, None, str(error))
        return
    for at, side, hand in hands:
        known = None
        try:
            known = None if side is None else side_of(side, f"{at}.side")
            _add(rows, at, time, known, hand)
        except InputError as error:
            rows.refuse(time, known, str(error))


def _hands(members: Members, place: str) -> Iterator[tuple[str, object, Members]]:
    """Place, side and members of each hand of a frame."""
    found = False
    for name in _HANDS:
        hands = members.get(name)
        if isinstance(hands, dict):
            members = members | {plain(side): hand for side, hand in hands.items()}
        elif isinstance(hands, list):
            for index, hand in enumerate(hands):
                if isinstance(hand, dict):
                    found = True
                    inner = {plain(key): value for key, value in hand.items()}
                    yield f"{place}.{name}[{index}]", _side(inner), inner
    for side in SIDES:
        hand = members.get(side)
        if isinstance(hand, (dict, list)):
            found = True
            inner: Members = {"joints": hand}
            if isinstance(hand, dict):
                inner = {plain(key): value for key, value in hand.items()}
            yield f"{place}.{side}", side, inner
    if not found and _joints(members):
        yield place, _side(members), members


def _side(members: Members) -> object:
    return next((value for name, value in members.items() if is_side(name) and not isinstance(value, (dict, list))), None)


def _joints(members: Members) -> object:
    """What holds the joints: an object or a list; empty if nothing does."""
    for name in _JOINTS:
        held = members.get(name)
        if isinstance(held, (dict, list)):
            return held
    return {name: value for name, value in members.items() if joint_called(name) is not None}


def _add(rows: PoseRows, place: str, time: float, side: str | None, hand: Members) -> None:
    if is_marked_lost(hand):
        rows.leave_out("poses that their tracker marks as not valid")
        return
    numbers = list(LOST) * len(JOINTS)
    seen = set[int]()
    for name, joint, value in _named(_joints(hand), f"{place}.joints"):
        if joint in seen:
            raise InputError(f"{name} is given twice; expected each joint once")
        seen.add(joint)
        numbers[len(LOST) * joint : len(LOST) * (joint + 1)] = joint_numbers(value, name)
    rows.add(place, time, side, _track(hand, place), numbers)


def _named(joints: object, place: str) -> Iterator[tuple[str, int, object]]:
    """Place, number and pose of each joint; what is no joint of a hand is passed over, as engines have more."""
    if isinstance(joints, dict):
        for name, value in joints.items():
            joint = joint_called(name)
            if joint is not None:
                yield f"{place}.{JOINTS[joint]}", joint, value
        return
    assert isinstance(joints, list)
    names = [_name(value) for value in joints]
    if joints and all(name is None for name in names):
        if len(joints) != _WEBXR_COUNT:
            raise InputError(
                f"{place} is a list of {len(joints)} without names; expected a name with each, or {_WEBXR_COUNT} in WebXR's "
                "order (of 26, OpenXR has the palm first and Unity the wrist)"
            )
        yield from ((f"{place}[{index}]", index + 1, value) for index, value in enumerate(joints))
        return
    for index, (name, value) in enumerate(zip(names, joints, strict=True)):
        joint = None if name is None else joint_called(name)
        if joint is not None:
            yield f"{place}[{index}]", joint, value


def _name(value: object) -> str | None:
    if not isinstance(value, dict):
        return None
    members = {plain(name): part for name, part in value.items()}
    return next((part for part in map(members.get, _NAMES) if isinstance(part, str)), None)


def _track(hand: Members, place: str) -> int:
    track = next((hand[name] for name in _TRACKS if name in hand), 0)
    if isinstance(track, bool) or not isinstance(track, int) or not 0 <= track < 1 << 31:
        raise InputError(f"{place}.track = {shown(track)}; must be a whole number of 0 or more")
    return track

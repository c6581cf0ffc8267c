"""The pose of one joint in JSON, in the forms that programs write.

Position and orientation by name, as lists or as objects of ``x``, ``y``, ``z`` (``w``); side by side in a list; within a ``pose``
or a ``transform``; or all seven numbers in one list or object.
"""

from __future__ import annotations

from collections.abc import Sequence

from haptics.errors import InputError
from haptics.scene.hand_files.pose_rows import LARGEST, LOST
from haptics.scene.hand_files.spelling import PARTS, part_called, plain
from haptics.scene.hands.shown import shown

_POSITION = ("position", "pos", "p", "translation", "location")
_TURN = ("orientation", "rotation", "rot", "quaternion", "quat", "q")
_WITHIN = ("pose", "transform")
_VALID = ("valid", "is_valid", "tracked", "is_tracked", "active", "is_active")
_EXPECTED = "expected a position (x, y, z) and an orientation, a quaternion (x, y, z, w)"


def joint_numbers(value: object, place: str, depth: int = 0) -> Sequence[float]:
    """The numbers of one joint.

    :param value: as parsed from JSON; null for a joint that the tracker has lost.
    :param place: where it is in the file, for messages.
    :param depth: how deep it is nested, 0 or 1.
    :return: seven, as ``PARTS``; NaN where the tracker gives none.
    :raises InputError: it has no such form, or a part is no number.
    """
    if isinstance(value, list):
        return _of_list(value, place)
    if value is None:
        return LOST
    if not isinstance(value, dict):
        raise InputError(f"{place} is {shown(value)}; {_EXPECTED}")
    members = {plain(name): part for name, part in value.items()}
    if is_marked_lost(members):
        return LOST
    for name in _WITHIN:
        if name in members and depth == 0:
            return joint_numbers(members[name], f"{place}.{name}", 1)
    position, turn = (next((members[name] for name in names if name in members), None) for names in (_POSITION, _TURN))
    if position is None and turn is None:
        return _of_parts(members, place)
    return (*_vector(position, "xyz", f"{place}.position"), *_vector(turn, "xyzw", f"{place}.orientation"))


def is_marked_lost(members: dict[str, object]) -> bool:
    """Whether a tracker does not vouch for a joint or a pose.

    :param members: by their plain names.
    :return: whether one of them says so.
    """
    return any(members.get(name) is False for name in _VALID)


def _of_list(value: list[object], place: str) -> Sequence[float]:
    if len(value) == 2:
        return (*_vector(value[0], "xyz", f"{place}[0]"), *_vector(value[1], "xyzw", f"{place}[1]"))
    if len(value) in (3, 7):
        return (*(_number(part, f"{place}[{index}]") for index, part in enumerate(value)), *LOST[len(value) :])
    raise InputError(f"{place} is {shown(value)}; {_EXPECTED}")


def _of_parts(members: dict[str, object], place: str) -> Sequence[float]:
    parts = {part_called(name): value for name, value in members.items()}
    if not {"x", "y", "z"} <= parts.keys():
        raise InputError(f"{place} has {', '.join(members)[:60] or 'nothing in it'}; {_EXPECTED}")
    return [_number(parts.get(part), f"{place}.{part}") for part in PARTS]


def _vector(value: object, axes: str, place: str) -> Sequence[float]:
    if value is None:
        return LOST[: len(axes)]
    if isinstance(value, dict):
        members = {plain(name): part for name, part in value.items()}
        value = [members[axis] for axis in axes if axis in members]
    if not isinstance(value, list) or len(value) != len(axes):
        raise InputError(f"{place} is {shown(value)}; expected {len(axes)} numbers ({', '.join(axes)})")
    return [_number(part, f"{place}.{axis}") for axis, part in zip(axes, value, strict=True)]


def _number(value: object, place: str) -> float:
    if value is None:
        return LOST[0]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > LARGEST:
        raise InputError(f"{place} = {shown(value)}; expected a number within {LARGEST:.0f}")
    return float(value)

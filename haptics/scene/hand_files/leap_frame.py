"""One frame of a Leap Motion controller: its whole hands as rows of numbers, and what is wrong with the others.

Judged by its members, whatever version of the protocol the file names: those of version 6 have all that is needed.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from haptics.errors import InputError
from haptics.scene.hands.check import FARTHEST_M
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import SIDES, Side
from haptics.scene.hands.shown import shown
from haptics.time import NS_PER_US

Kind = TypeVar("Kind")

FARTHEST_MM = FARTHEST_M * 1e3
WIDEST_FINGER_MM = 100.0
_LATEST_US = 2**53  # beyond it a JSON reader that uses doubles cannot distinguish microseconds

_OWNERS = {"hands": "hand", "pointables": "pointable"}
_POINTS = ("mcpPosition", "pipPosition", "dipPosition", "tipPosition")


@dataclass(frozen=True, slots=True)
class Seen:
    """A whole hand in a frame.

    :param device_id: the device's number of the hand.
    :param side: ``left`` or ``right``.
    :param row: (74,): palm, normal, direction, 20 finger points (mm) and 5 finger widths (mm; NaN where the writer gives none).
    """

    device_id: int
    side: Side
    row: Floats


@dataclass(slots=True)
class Frame:
    """What a frame holds.

    :param time_ns: its stamp on the device's clock.
    :param hands: those that can be used.
    :param refused: side and reason of those that cannot; the side is None where it is not known.
    """

    time_ns: int
    hands: list[Seen] = field(default_factory=list)
    refused: list[tuple[str | None, str]] = field(default_factory=list)


@dataclass(slots=True)
class _Hand:
    side: Side
    palm: list[float]
    fingers: dict[int, tuple[list[float], float]] = field(default_factory=dict)
    refused: str = ""


def read_frame(value: object, place: str, dropped: Counter[str]) -> Frame:
    """The hands of a frame. Hands without all five fingers, pointables without their hand and tools are counted in ``dropped``.

    :param value: the frame as parsed from JSON.
    :param place: where it is in the file, for messages.
    :param dropped: counts by name; added to.
    :return: the hands that can be used, and those that cannot with the reason.
    :raises InputError: not a frame: its stamp or one of its lists is missing or of the wrong type; the message names the place
        and the value.
    """
    frame = of_type(value, place, dict, "an object")
    found = Frame(_time_ns(frame, place))
    hands: dict[int, _Hand] = {}
    for index, hand in enumerate(of_type(_member(frame, "hands", place), f"{place}.hands", list, "a list")):
        at = f"{place}.hands[{index}]"
        side = hand.get("type") if isinstance(hand, dict) else None
        try:
            _add_hand(hand, at, hands)
        except InputError as error:
            found.refused.append((side if side in SIDES else None, str(error)))
    for index, pointable in enumerate(of_type(_member(frame, "pointables", place), f"{place}.pointables", list, "a list")):
        _add_pointable(pointable, f"{place}.pointables[{index}]", hands, dropped)
    for device_id, hand in hands.items():
        own = [hand.fingers[finger] for finger in range(5) if finger in hand.fingers]
        if hand.refused:
            found.refused.append((hand.side, hand.refused))
        elif len(own) < 5:
            dropped["hands without all five fingers"] += 1
        else:
            row = [*hand.palm, *(number for points, _ in own for number in points), *(width for _, width in own)]
            found.hands.append(Seen(device_id, hand.side, np.array(row, float)))
    return found


def _time_ns(frame: dict, place: str) -> int:
    return round(_number(_member(frame, "timestamp", place), f"{place}.timestamp", 0, _LATEST_US, "us") * NS_PER_US)


def _add_hand(hand: object, at: str, hands: dict[int, _Hand]) -> None:
    hand = of_type(hand, at, dict, "an object")
    device_id = _whole(_member(hand, "id", at), f"{at}.id")
    if device_id in hands:
        hands[device_id].refused = f"{at}.id = {device_id} is given twice in one frame"
        return
    side = _member(hand, "type", at)
    if not isinstance(side, str) or side not in SIDES:
        raise InputError(f"{at}.type = {shown(side)} is not allowed; allowed: {', '.join(SIDES)}")
    normal, direction = (_unit(hand, key, at) for key in ("palmNormal", "direction"))
    if abs(float(np.dot(normal, direction))) > 0.9 * math.hypot(*normal) * math.hypot(*direction):
        raise InputError(f"{at}.palmNormal = {normal} lies along the direction; expected a vector across it")
    hands[device_id] = _Hand(side, [*_point(hand, "palmPosition", at), *normal, *direction])


def _add_pointable(pointable: object, at: str, hands: dict[int, _Hand], dropped: Counter[str]) -> None:
    """A finger to its hand; one that cannot be used spoils the pose of its hand, or of all hands where that is not known."""
    spoils: list[_Hand] = list(hands.values())
    try:
        pointable = of_type(pointable, at, dict, "an object")
        if pointable.get("tool") is True:
            dropped["tools"] += 1
            return
        device_id = _whole(_member(pointable, "handId", at), f"{at}.handId")
        if device_id not in hands:
            dropped["pointables without their hand"] += 1
            return
        hand = hands[device_id]
        spoils = [hand]
        finger = _finger(pointable, at)
        if finger in hand.fingers:
            raise InputError(f"{at}.type = {finger} is given twice for hand {device_id}")
        points = [number for key in _POINTS for number in _point(pointable, key, at)]
        width_mm = math.nan  # not every writer gives one
        if "width" in pointable:
            width_mm = _number(pointable["width"], f"{at}.width", 0.0, WIDEST_FINGER_MM, "mm")
        hand.fingers[finger] = points, width_mm
    except InputError as error:
        for hand in spoils:
            hand.refused = hand.refused or str(error)


def _finger(pointable: dict, at: str) -> int:
    """0, the thumb, to 4. Older writers give no type, and count the fingers in the last digit of their id."""
    if "type" not in pointable and "id" in pointable:
        key, finger = "id modulo 10", _whole(pointable["id"], f"{at}.id") % 10
    else:
        key, finger = "type", _whole(_member(pointable, "type", at), f"{at}.type")
    if not 0 <= finger <= 4:
        raise InputError(f"{at}.{key} = {finger}; must be 0 (thumb) to 4 (little finger)")
    return finger


def _member(owner: dict, key: str, place: str) -> object:
    if key not in owner:
        name = place.rpartition(".")[2].partition("[")[0]
        raise InputError(f"{place}.{key} is missing; required in every {_OWNERS.get(name, 'frame')}")
    return owner[key]


def of_type(value: object, place: str, kind: type[Kind], expected: str) -> Kind:
    """Check the type of a value.

    :param value: as parsed from JSON.
    :param place: where it is in the file, for messages.
    :param kind: the type that it must have.
    :param expected: the type in words.
    :return: the value.
    :raises InputError: it is of another type.
    """
    if not isinstance(value, kind):
        raise InputError(f"{place} is {shown(value)}; expected {expected}")
    return value


def _number(value: object, place: str, low: float, high: float, unit: str) -> float:
    # Comparing before converting keeps integers of any length, and NaN, out.
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise InputError(f"{place} = {shown(value)}; must be {low:.16g} to {high:.16g} {unit}")
    return value


def _whole(value: object, place: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) >= 2**63:
        raise InputError(f"{place} = {shown(value)} is not a whole number of 64 bits")
    return value


def _point(owner: dict, key: str, place: str) -> list[float]:
    value = _member(owner, key, place)
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{place}.{key} is {shown(value)}; expected three numbers")
    return [_number(part, f"{place}.{key}[{axis}]", -FARTHEST_MM, FARTHEST_MM, "mm") for axis, part in enumerate(value)]


def _unit(owner: dict, key: str, place: str) -> list[float]:
    vector = _point(owner, key, place)
    if not 0.5 <= math.hypot(*vector) <= 2.0:
        raise InputError(f"{place}.{key} = {vector} has length {math.hypot(*vector):.6g}; expected a direction of length 1")
    return vector

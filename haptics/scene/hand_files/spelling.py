"""How programs call the members and columns of a hand's pose: its time, its side, its joints, and the parts of a joint."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

from haptics.errors import InputError
from haptics.scene.hands.joints import SIDES, Side, joint_index
from haptics.scene.hands.shown import shown
from haptics.time import NS_PER_MS, NS_PER_S, NS_PER_US

UNITS_M: Mapping[str, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""Units of length, in metres."""
TIMES_NS: Mapping[str, int] = {"ns": 1, "us": NS_PER_US, "ms": NS_PER_MS, "s": NS_PER_S}
"""Units of time, in nanoseconds."""
LONGEST_NAME = 80
"""No name that is known is longer, so that what is remembered of names stays small."""
PARTS = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""Of a joint's pose, in the order of a row."""

_HUMPS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_BREAKS = re.compile(r"[^a-z0-9]+")
_TIME = re.compile(
    r"(?:time|timestamp|time_stamp|sample_time|elapsed|elapsed_time|t)(?:_?(ns|us|ms|s|nsec|usec|msec|sec|seconds))?"
)
_TIME_WORDS = {"nsec": "ns", "usec": "us", "msec": "ms", "sec": "s", "seconds": "s"}
_SIDE_NAMES = {"side", "hand", "handedness", "hand_side", "chirality"}
_SIDE_WORDS: dict[str, Side] = {"left": "left", "right": "right", "l": "left", "r": "right"}
_SIDE_WORDS |= {"left_hand": "left", "right_hand": "right", "hand_left": "left", "hand_right": "right"}
_POSITION = {"position", "pos", "p", "translation", "location", "loc"}
_TURN = {"orientation", "orient", "rotation", "rot", "quaternion", "quat", "q", "r"}
_OF_WORD = {
    **{f"{word}{between}{axis}": axis for word in _POSITION for axis in "xyz" for between in ("", "_")},
    **{f"{word}{between}{axis}": f"q{axis}" for word in _TURN for axis in "xyzw" for between in ("", "_")},
    **{axis: axis for axis in "xyz"},
    "w": "qw",
}


def plain(name: str) -> str:
    """A name in small letters with ``_`` between its words.

    :param name: such as ``worldLandmarks``, ``Pos X`` or ``time-ns``.
    :return: such as ``world_landmarks``, ``pos_x``, ``time_ns``; of a long name, its beginning.
    """
    return _plain(name[:LONGEST_NAME])


@lru_cache(4096)
def _plain(name: str) -> str:
    return _BREAKS.sub("_", _HUMPS.sub("_", name).lower()).strip("_")


def is_time(name: str) -> bool:
    """Whether a member or column is a pose's time.

    :param name: as it is spelt.
    :return: whether it is.
    """
    return _TIME.fullmatch(plain(name)) is not None


def unit_of_time(name: str) -> str | None:
    """The unit in the name of a time.

    :param name: such as ``timestampMs``.
    :return: one of ``TIMES_NS``, or None where it has none.
    """
    found = _TIME.fullmatch(plain(name))
    unit = found[1] if found else None
    return _TIME_WORDS.get(unit, unit) if unit else None


def is_side(name: str) -> bool:
    """Whether a member or column is a hand's side.

    :param name: as it is spelt.
    :return: whether it is.
    """
    return plain(name) in _SIDE_NAMES


def side_of(value: object, place: str) -> Side:
    """The side that a word stands for.

    :param value: as read.
    :param place: where it is in the file, for messages.
    :return: ``left`` or ``right``.
    :raises InputError: it stands for none.
    """
    side = _SIDE_WORDS.get(plain(value)) if isinstance(value, str) else None
    if side is None:
        raise InputError(f"{place} = {shown(value)} is not allowed; allowed: {', '.join(SIDES)}")
    return side


def joint_called(name: str) -> int | None:
    """The joint that a name stands for.

    :param name: as engines spell it; words may be apart by blanks.
    :return: 0 to 25, or None where it is no joint's name.
    """
    return _joint_called(name) if len(name) <= LONGEST_NAME else None


@lru_cache(4096)
def _joint_called(name: str) -> int | None:
    try:
        return joint_index(name.rpartition(".")[2].strip().replace(" ", "_"))
    except InputError:
        return None


def part_called(name: str) -> str | None:
    """The part of a joint's pose that a name stands for.

    :param name: such as ``x``, ``posX``, ``rotation_w``.
    :return: one of ``PARTS``, or None.
    """
    return _OF_WORD.get(plain(name))


def column_called(name: str) -> tuple[Side | None, int, str] | None:
    """What a column of a table with a row a pose holds.

    :param name: such as ``index_tip_x``, ``IndexTip.rot.w`` or ``left_wrist_posY``.
    :return: the side where it names one, the joint, and the part; None where it is no joint's.
    """
    words = plain(name).split("_")
    side = _SIDE_WORDS.get(words[0]) if len(words) > 2 else None
    words = words[1:] if side is not None else words
    for count in (2, 1):  # `pos_x` before `x`
        part = part_called("_".join(words[-count:]))
        joint = joint_called("_".join(words[:-count])) if len(words) > count else None
        if part is not None and joint is not None:
            return side, joint, part
    return None

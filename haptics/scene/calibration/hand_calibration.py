"""One person's hand as it differs from the nominal one: fingertips' sizes, and where the tactors sit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import date
from typing import Any

import numpy as np

from haptics.errors import InputError, nearest
from haptics.scene.calibration.measures import BONES, SHORTEST_BONE_M, bone_lengths
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import FINGERS, SIDES, Side
from haptics.scene.sites import LARGEST_OFFSET_M, SITE, SITES, SiteMap, nominal_sites
from haptics.units import brief, number, one_of

SMALLEST_TIP_M, LARGEST_TIP_M = 0.003, 0.015
"""Radii of fingertips, of children and of gloved adults (assumed)."""
LONGEST_BONE_M = 0.15
NARROWEST_M, WIDEST_M = 0.03, 0.12
"""Knuckles of index and little finger apart (assumed)."""
LARGEST_SD_M = 0.05
LONGEST_NAME = 64
LONGEST_TEXT = 500
OTHER_HAND = 0.10
"""A hand whose bones differ by a larger share in the median is another person's, or seen by another tracker (assumed)."""

_OF_SITES = ("site", SITES)
_OF_FINGERS = ("finger", FINGERS)
_OF_BONES = ("bone", BONES)


@dataclass(frozen=True, slots=True, kw_only=True)
class HandCalibration:
    """How one person's hand differs from the nominal one. ``CalibrationRoutine`` makes one; what is left out is nominal.

    :param name: whose it is, and what its file is called: 1 to 64 letters a to z, digits, ``-`` and ``_``.
    :param side: ``left`` or ``right``.
    :param tip_radius_m: by finger, the sphere about the tip's joint, 0.003 to 0.015 m; nominal: 0.007 m.
    :param tip_radius_sd_m: by finger, standard deviations of these, 0 to 0.05 m.
    :param offset_m: by site, three numbers, -0.05 to 0.05 m each: how far its tactor is from where a nominal glove has it, in the
        axes of its joint; -y is toward the palmar side.
    :param bone_m: by the joint that a bone begins at, its length, 0 to 0.15 m; to see later whether it is the same hand.
    :param bone_sd_m: likewise, how far a single frame is off, as a standard deviation, 0 to 0.05 m.
    :param breadth_m: how far the knuckles of index and little finger are apart, 0.03 to 0.12 m, or None.
    :param made_on: the day, or None.
    :param made_from: what hand it was made from, for people; at most 500 characters.
    :param notes: what else a person should know of it, likewise.
    :raises InputError: what cannot be, with its value and what is allowed.
    """

    name: str
    side: Side
    tip_radius_m: Mapping[str, float] = field(default_factory=dict)
    tip_radius_sd_m: Mapping[str, float] = field(default_factory=dict)
    offset_m: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    bone_m: Mapping[str, float] = field(default_factory=dict)
    bone_sd_m: Mapping[str, float] = field(default_factory=dict)
    breadth_m: float | None = None
    made_on: date | None = None
    made_from: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_name(self.name)
        one_of("side", self.side, SIDES)
        checked: dict[str, Any] = {
            "tip_radius_m": self._lengths("tip_radius_m", _OF_FINGERS, SMALLEST_TIP_M, LARGEST_TIP_M),
            "tip_radius_sd_m": self._lengths("tip_radius_sd_m", _OF_FINGERS, 0.0, LARGEST_SD_M),
            "offset_m": {site: _offset(site, given) for site, given in self._known("offset_m", _OF_SITES).items()},
            "bone_m": self._lengths("bone_m", _OF_BONES, 0.0, LONGEST_BONE_M),
            "bone_sd_m": self._lengths("bone_sd_m", _OF_BONES, 0.0, LARGEST_SD_M),
            "notes": tuple(_text("notes", note) for note in _items("notes", self.notes)),
        }
        if self.breadth_m is not None:
            checked["breadth_m"] = number("breadth_m", self.breadth_m, NARROWEST_M, WIDEST_M, "m")
        if self.made_on is not None and type(self.made_on) is not date:  # a moment is a date to Python
            raise InputError(f"made_on = {brief(self.made_on)} is no day; expected a date such as 2026-03-31, or None")
        _text("made_from", self.made_from)
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def _known(self, name: str, of: tuple[str, Sequence[str]]) -> dict[str, Any]:
        """A table by the names of fingers, sites or bones, copied."""
        given, (what, known) = getattr(self, name), of
        if not isinstance(given, Mapping):
            raise InputError(f"{name} = {brief(given)} is no table; expected values by the {what}'s name")
        for key in given:
            if key not in known:
                raise InputError(f"{name} has no {what} {brief(key)}; known {what}s: {', '.join(known)}{nearest(key, known)}")
        return dict(given)

    def _lengths(self, name: str, of: tuple[str, Sequence[str]], low_m: float, high_m: float) -> dict[str, float]:
        return {key: number(f"{name}.{key}", value, low_m, high_m, "m") for key, value in self._known(name, of).items()}

    def sites(self) -> SiteMap:
        """Where the tactors are on this hand.

        :return: the nominal map, moved by the offsets, with this person's fingertips.
        """
        sites = nominal_sites().moved(self.offset_m)
        radius_m = sites.radius_m.copy()
        for finger, tip_m in self.tip_radius_m.items():
            radius_m[SITE[f"{finger}_tip"]] = tip_m
        return replace(sites, radius_m=radius_m)

    def other_hand(self, position_m: Floats) -> str | None:
        """Whether poses look like another hand's than this one's.

        :param position_m: joints, (n, 26, 3), metres.
        :return: a sentence on how far the bones differ, where they do by more than ``OTHER_HAND`` in the median; else None.
        """
        known = [(BONES.index(name), length_m) for name, length_m in self.bone_m.items() if length_m > SHORTEST_BONE_M]
        if not known or not len(position_m):
            return None
        seen_m = np.median(bone_lengths(position_m), axis=0)
        share = float(np.median([seen_m[place] / length_m for place, length_m in known])) - 1.0
        if abs(share) <= OTHER_HAND:
            return None
        return (
            f"the hand's bones are {abs(share):.0%} {'longer' if share > 0 else 'shorter'} than those of the calibration "
            f"{self.name!r}: is it that person's hand, seen by the same tracker?"
        )

    def table(self) -> dict[str, Any]:
        """It as plain data, such as a file or a recording's header holds; what is left out is left out there too.

        :return: all but the name.
        """
        plain = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "name"}
        plain["made_on"] = None if self.made_on is None else self.made_on.isoformat()
        plain["notes"] = list(self.notes)
        plain["offset_m"] = {site: list(offset) for site, offset in self.offset_m.items()}
        return {key: value for key, value in plain.items() if value not in (None, "", {}, [])}

    @classmethod
    def of_table(cls, name: str, table: Mapping[str, Any]) -> HandCalibration:
        """One from plain data.

        :param name: whose it is.
        :param table: as :meth:`table` gives it; lists and tables of any origin.
        :return: checked.
        :raises InputError: a key that is not known or a value that is not allowed, ``side`` missing.
        """
        known = tuple(one.name for one in fields(cls) if one.name != "name")
        for key in table:
            if key not in known:
                raise InputError(
                    f"{key} = {brief(table[key])}: there is no such key; known keys: {', '.join(known)}{nearest(key, known)}"
                )
        if "side" not in table:
            raise InputError(f"side is missing; expected one of {', '.join(SIDES)}")
        made_on = table.get("made_on")
        if isinstance(made_on, str):
            try:
                made_on = date.fromisoformat(made_on)
            except ValueError as error:
                raise InputError(f"made_on = {brief(made_on)} is no day; expected one such as 2026-03-31") from error
        return cls(**{**table, "name": name, "made_on": made_on})


def check_name(name: object) -> str:
    """A calibration's name, which is a file's name too.

    :param name: what was handed in.
    :return: the same.
    :raises InputError: no text of 1 to 64 letters a to z, digits, ``-`` and ``_``.
    """
    if not isinstance(name, str) or not re.fullmatch(rf"[A-Za-z0-9_-]{{1,{LONGEST_NAME}}}", name):
        raise InputError(f"name = {brief(name)}; expected 1 to {LONGEST_NAME} letters a to z or A to Z, digits, - and _")
    return name


def _items(name: str, given: object) -> Sequence[Any]:
    if not isinstance(given, (list, tuple)):
        raise InputError(f"{name} = {brief(given)} is no list; expected a list")
    return given


def _offset(site: str, given: object) -> tuple[float, ...]:
    parts = _items(f"offset_m.{site}", given.tolist() if isinstance(given, np.ndarray) else given)
    if len(parts) != 3:
        raise InputError(f"offset_m.{site} = {brief(given)} has {len(parts)} numbers; expected 3, metres")
    return tuple(
        number(f"offset_m.{site} along {axis}", part, -LARGEST_OFFSET_M, LARGEST_OFFSET_M, "m")
        for axis, part in zip("xyz", parts, strict=True)
    )


def _text(name: str, given: object) -> str:
    if not isinstance(given, str) or len(given) > LONGEST_TEXT or not given.isprintable():
        raise InputError(f"{name} = {brief(given)}; expected one line of text, at most {LONGEST_TEXT} characters")
    return given

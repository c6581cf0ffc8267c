"""What a file of hands says of its numbers, or whoever reads it does: basis, unit, unit of time, side, mirrored or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

from haptics.errors import InputError
from haptics.scene.hand_files.spelling import TIMES_NS, UNITS_M, plain
from haptics.scene.hands.basis import BASES
from haptics.scene.hands.joints import SIDES
from haptics.units import brief, one_of, truth

_ALLOWED = {"basis": tuple(BASES), "unit": tuple(UNITS_M), "time": tuple(TIMES_NS), "side": SIDES}
_ALSO = {"units": "unit", "time_unit": "time", "time_units": "time", "selfie": "mirrored", "selfie_mode": "mirrored"}
_WORDS = {
    **{f"{size}{met}{many}": unit for size, unit in (("", "m"), ("centi", "cm"), ("milli", "mm")) for met in ("metre", "meter")
       for many in ("", "s")},
    **{f"{size}seconds": unit for size, unit in (("nano", "ns"), ("micro", "us"), ("milli", "ms"), ("", "s"))},
}  # fmt: skip
_NEEDED = {"basis", "unit", "time", "mirrored"}  # a side stands in every pose, too


@dataclass(frozen=True, slots=True)
class Declared:
    """What is said of a file's numbers; None is what is not said.

    :param basis: whose axes: a name of ``haptics.BASES``.
    :param unit: of lengths: ``m``, ``cm`` or ``mm``.
    :param time: unit of times: ``ns``, ``us``, ``ms`` or ``s``.
    :param side: whose hand it is where a pose does not say.
    :param mirrored: whether the picture was mirrored before landmarks were found in it.
    :raises InputError: another word.
    """

    basis: str | None = None
    unit: str | None = None
    time: str | None = None
    side: str | None = None
    mirrored: bool | None = None

    def __post_init__(self) -> None:
        for name, allowed in _ALLOWED.items():
            if getattr(self, name) is not None:
                one_of(name, getattr(self, name), allowed)
        if self.mirrored is not None:
            truth("mirrored", self.mirrored)

    def over(self, other: Declared) -> Declared:
        """This, and what only the other says.

        :param other: what serves where this says nothing.
        :return: both.
        """
        said = {one.name: getattr(self, one.name) for one in fields(self) if getattr(self, one.name) is not None}
        return replace(other, **said)

    def agreed(self, other: Declared) -> Declared:
        """This and what another place of the same file says.

        :param other: from there.
        :return: both.
        :raises InputError: they contradict each other.
        """
        for one in fields(self):
            mine, others = getattr(self, one.name), getattr(other, one.name)
            if mine is not None and others is not None and mine != others:
                raise InputError(f"{one.name} = {brief(others)}, but before it was {brief(mine)}; a file has one")
        return self.over(other)


NOTHING = Declared()
"""Nothing is said."""


def declared_in(members: Mapping[str, object], place: str, whole: bool = False) -> Declared:
    """What members of an object, or words of a comment, declare; others are passed over.

    :param members: values by their names.
    :param place: where they are in the file, for messages.
    :param whole: whether this is a header and no pose, so that ``side`` is of all poses.
    :return: what they say.
    :raises InputError: a word that is not allowed; the message names the place.
    """
    said: dict[str, object] = {}
    for name, value in members.items():
        name = _ALSO.get(plain(name), plain(name))
        number = name == "time" and not isinstance(value, str)  # a pose's own time
        if value is not None and not number and (name in _NEEDED or (whole and name == "side")):
            said[name] = _WORDS.get(value.strip().lower(), value.strip().lower()) if isinstance(value, str) else value
    try:
        return Declared(**said) if said else NOTHING  # type: ignore[arg-type]
    except InputError as error:
        raise InputError(f"{place}: {error}") from error

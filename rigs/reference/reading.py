"""Reference files checked as they are read: TOML with the tables ``published``, ``curve`` and ``contradiction``.

Nothing is taken on trust: unknown or missing keys, sections that the thesis does not have, ids given twice, numbers that are
none and choices outside their closed sets are refused with file and id. The meaning of the keys is in ``published``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from haptics.errors import InputError
from haptics.table_faults import read_toml
from haptics.units import one_of
from rigs.reference.published import RELATIONS, ROLES, SURE, TOLERANCE_KINDS, Contradiction, Curve, CurvePoint, Passage, Published
from rigs.reference.sections import SECTIONS

UNITS = (
    *("1", "%", "m", "m2", "m3", "kg", "s", "Hz", "1/min", "m/s", "g", "N", "N/s", "N/kg", "Pa"),
    *("V", "V/m", "A", "W", "J", "F", "ohm", "K", "K/W"),
)
"""Units of the files: SI, and %, 1/min, K/W and g (standard gravity)."""

_ABOUT = ("tolerance_reason", "sample_size", "place", "used_by", "note")
_PUBLISHED_NEEDS = ("id", "quantity", "value", "unit", "tolerance_kind", "section", "sure", "role")
_PUBLISHED_MAY = ("relation", "tolerance", "written", *_ABOUT)
_CURVE_NEEDS = ("id", "quantity", "unit", "x_quantity", "tolerance_kind", "section", "sure", "written", "role", "points")
_CURVE_MAY = ("x_unit", *_ABOUT)
_CONTRADICTION_NEEDS = ("id", "written", "follows", "used_here", "concerns")
_TABLES = ("published", "curve", "contradiction")


@dataclass(frozen=True)
class Reference:
    """All that was read, by id.

    :param published: numbers by id.
    :param curves: by id.
    :param contradictions: by id.
    """

    published: Mapping[str, Published]
    curves: Mapping[str, Curve]
    contradictions: Mapping[str, Contradiction]


def read_reference(texts: Mapping[str, str]) -> Reference:
    """Files as one body of reference data.

    :param texts: the text of each file, by its name.
    :return: all rows by id, in the order of the files.
    :raises InputError: anything a file should not hold; the message names file, id, the value and what is allowed.
    """
    found: dict[str, Published | Curve | Contradiction] = {}
    for file, text in texts.items():
        for row in _rows(file, text):
            if row.id in found:
                raise InputError(f"{file}: id {row.id!r} is given twice, first in {found[row.id].file}")
            found[row.id] = row
    for row in found.values():
        for concerned in row.concerns if isinstance(row, Contradiction) else ():
            if not isinstance(found.get(concerned), Published | Curve):
                raise InputError(f"{row.file}: {row.id!r} concerns {concerned!r}, which is no id of a number or curve")
    return Reference(
        MappingProxyType({key: row for key, row in found.items() if isinstance(row, Published)}),
        MappingProxyType({key: row for key, row in found.items() if isinstance(row, Curve)}),
        MappingProxyType({key: row for key, row in found.items() if isinstance(row, Contradiction)}),
    )


def _rows(file: str, text: str) -> Iterable[Published | Curve | Contradiction]:
    tables = read_toml(text, file)
    makers = {"published": _published, "curve": _curve, "contradiction": _contradiction}
    for table, rows in tables.items():
        one_of(f"{file}: table", table, _TABLES)
        for row in _list(f"{file}: {table}", rows):
            if not isinstance(row, dict):
                raise InputError(f"{file}: {table} holds {row!r}; expected [[{table}]] tables")
            yield makers[table](_where(file, row), row, file)


def _published(where: str, row: dict[str, Any], file: str) -> Published:
    _keys(where, row, _PUBLISHED_NEEDS, _PUBLISHED_MAY)
    relation = one_of(f"{where} relation", row.get("relation", "="), RELATIONS)
    about = _about(where, row)
    bound = relation not in ("=", "about")
    if bound != (about["tolerance_kind"] == "bound"):
        raise InputError(
            f"{where}: relation {relation!r} with tolerance_kind {about['tolerance_kind']!r}; only bounds have 'bound'"
        )
    if not bound and "tolerance" not in row:
        raise InputError(f"{where}: no tolerance; expected a number >= 0, assumed with its reason if none is stated")
    if ("written" in row) == (about["sure"] == "derived"):
        raise InputError(f"{where}: sure = {about['sure']!r}; what the source states needs written, what is derived has none")
    return Published(
        relation=relation,
        value=_number(f"{where} value", row["value"]),
        tolerance=_tolerance(where, row.get("tolerance", 0.0)),
        written=_text(f"{where} written", row["written"]) if "written" in row else "",
        file=file,
        **about,
    )


def _curve(where: str, row: dict[str, Any], file: str) -> Curve:
    _keys(where, row, _CURVE_NEEDS, _CURVE_MAY)
    about = _about(where, row)
    one_of(f"{where} tolerance_kind", about["tolerance_kind"], ("stated", "assumed"))
    points = tuple(_point(f"{where} points", point, "x_unit" in row) for point in _list(f"{where} points", row["points"]))
    if len({(point.x, point.label) for point in points}) != len(points) or not points:
        raise InputError(f"{where}: {len(points)} points; expected one or more, no two at the same place")
    return Curve(
        x_quantity=_text(f"{where} x_quantity", row["x_quantity"]),
        x_unit=one_of(f"{where} x_unit", row["x_unit"], UNITS) if "x_unit" in row else "",
        written=tuple(_text(f"{where} written", one) for one in _list(f"{where} written", row["written"])),
        points=points,
        file=file,
        **about,
    )


def _point(where: str, point: Any, numbered: bool) -> CurvePoint:
    if not isinstance(point, dict):
        raise InputError(f"{where}: {point!r} is not a table; expected x or label, y, tolerance")
    _keys(where, point, ("x" if numbered else "label", "y", "tolerance"), ())
    return CurvePoint(
        x=_number(f"{where} x", point["x"]) if numbered else None,
        label="" if numbered else _text(f"{where} label", point["label"]),
        y=_number(f"{where} y", point["y"]),
        tolerance=_tolerance(where, point["tolerance"]),
    )


def _contradiction(where: str, row: dict[str, Any], file: str) -> Contradiction:
    _keys(where, row, _CONTRADICTION_NEEDS, ("computed",))
    passages: list[Passage] = []
    for passage in _list(f"{where} written", row["written"]):
        if not isinstance(passage, dict):
            raise InputError(f"{where} written: {passage!r} is not a table; expected section and says")
        _keys(f"{where} written", passage, ("section", "says"), ())
        passages.append(Passage(_section(where, passage["section"]), _text(f"{where} says", passage["says"])))
    if len(passages) < 2:
        raise InputError(f"{where}: {len(passages)} passages; expected two or more")
    computed = row.get("computed", {})
    if not isinstance(computed, dict):
        raise InputError(f"{where} computed = {computed!r}; expected a table of numbers")
    return Contradiction(
        id=row["id"],
        written=tuple(passages),
        follows=_text(f"{where} follows", row["follows"]),
        computed=MappingProxyType({name: _number(f"{where} {name}", number) for name, number in computed.items()}),
        used_here=_text(f"{where} used_here", row["used_here"]),
        concerns=tuple(_text(f"{where} concerns", one) for one in _list(f"{where} concerns", row["concerns"])),
        file=file,
    )


def _about(where: str, row: dict[str, Any]) -> dict[str, Any]:
    """What numbers and curves have in common."""
    kind = one_of(f"{where} tolerance_kind", row["tolerance_kind"], TOLERANCE_KINDS)
    if ("tolerance_reason" in row) != (kind == "assumed"):
        raise InputError(f"{where}: tolerance_kind {kind!r}; an assumed one needs a tolerance_reason, others have none")
    size = row.get("sample_size", 1)
    if isinstance(size, bool) or not isinstance(size, int) or size < 1 or ("sample_size" in row and kind != "stated"):
        raise InputError(f"{where}: sample_size = {size!r}; expected a whole number >= 1, with a stated tolerance only")
    used_by = tuple(_text(f"{where} used_by", one) for one in _list(f"{where} used_by", row.get("used_by", [])))
    role = one_of(f"{where} role", row["role"], ROLES)
    if role == "calibration" and not used_by:
        raise InputError(f"{where}: no used_by; a calibration names what in the project was set by it")
    return {
        "id": row["id"],
        "quantity": _text(f"{where} quantity", row["quantity"]),
        "unit": one_of(f"{where} unit", row["unit"], UNITS),
        "tolerance_kind": kind,
        "tolerance_reason": _text(f"{where} tolerance_reason", row["tolerance_reason"]) if kind == "assumed" else "",
        "sample_size": size,
        "section": _section(where, row["section"]),
        "place": _text(f"{where} place", row["place"]) if "place" in row else "",
        "sure": one_of(f"{where} sure", row["sure"], SURE),
        "role": role,
        "used_by": used_by,
        "note": _text(f"{where} note", row["note"]) if "note" in row else "",
    }


def _where(file: str, row: dict[str, Any]) -> str:
    key = row.get("id")
    if not isinstance(key, str) or not key.isidentifier():
        raise InputError(f"{file}: id = {key!r}; expected letters, digits and underscores")
    return f"{file}: {key!r}"


def _keys(where: str, row: dict[str, Any], needs: tuple[str, ...], may: tuple[str, ...]) -> None:
    for key in row:
        one_of(f"{where} key", key, (*needs, *may))
    missing = [key for key in needs if key not in row]
    if missing:
        raise InputError(f"{where}: {', '.join(missing)} missing; required: {', '.join(needs)}")


def _section(where: str, section: Any) -> str:
    if section not in SECTIONS:
        raise InputError(f"{where}: section = {section!r}; expected a section of chapters 3 to 6, or 7.1, as a string")
    return section


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{name} = {value!r} is not a number; expected a finite number")
    return float(value)


def _tolerance(where: str, value: Any) -> float:
    tolerance = _number(f"{where} tolerance", value)
    if tolerance < 0.0:
        raise InputError(f"{where} tolerance = {tolerance:g} is not allowed; expected >= 0")
    return tolerance


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{name} = {value!r}; expected text")
    return value


def _list(name: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"{name} = {value!r}; expected a list")
    return value

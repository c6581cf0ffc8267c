"""Packed frames, as LeapJS Playback writes them since 0.2: names once, then a row of values for each frame.

The first row is the schema. An item of it is a member's name, or an object with one member: its name, and what it holds. That is
a list of names for an object (``{"interactionBox": ["center", "size"]}``), or a list of one such list for a list of objects
(``{"hands": [["id", "type"]]}``).
"""

from __future__ import annotations

from typing import Any

from haptics.errors import InputError

DEEPEST = 8


def check_schema(schema: object, place: str, depth: int = 0) -> list[Any]:
    """Check the schema of packed rows.

    :param schema: the first row, as parsed from JSON.
    :param place: where it is in the file, for messages.
    :param depth: how deep it is nested in another; 0 to 7.
    :return: the schema.
    :raises InputError: an item that is neither a name nor an object with one member, a name that comes twice, or too deep.
    """
    if not isinstance(schema, list) or not schema:
        raise InputError(f"{place} is not a schema of packed rows; expected a list of names, or frames that are objects")
    if depth == DEEPEST:
        raise InputError(f"{place} is nested too deeply; at most {DEEPEST} levels are read")
    names: set[str] = set()
    for index, part in enumerate(schema):
        if isinstance(part, dict) and len(part) == 1:
            ((name, inner),) = part.items()
            rows = isinstance(inner, list) and len(inner) == 1 and isinstance(inner[0], list)
            check_schema(inner[0] if rows else inner, f"{place}[{index}].{name}", depth + 1)
        elif isinstance(part, str):
            name = part
        else:
            raise InputError(
                f"{place}[{index}] of the packed rows' schema is not a name; expected a name, or an object of one member"
            )
        if name in names:
            raise InputError(f"{place} names {name!r} twice")
        names.add(name)
    return schema


def unpacked(schema: list[Any], row: object, place: str) -> dict[str, Any]:
    """The object that a row stands for.

    :param schema: as checked.
    :param row: as parsed from JSON.
    :param place: where it is in the file, for messages.
    :return: the row's values by their names.
    :raises InputError: a row that is not a list of as many values as the schema has, or a list in it likewise.
    """
    if not isinstance(row, list) or len(row) != len(schema):
        seen = f"a row of {len(row)}" if isinstance(row, list) else "not a row"
        raise InputError(f"{place} is {seen}; expected a list of {len(schema)}, as in the schema of the first row")
    found: dict[str, Any] = {}
    for part, value in zip(schema, row, strict=True):
        if isinstance(part, str):
            found[part] = value
            continue
        ((name, inner),) = part.items()
        if value is None:
            found[name] = None
        elif isinstance(inner[0], list):
            if not isinstance(value, list):
                raise InputError(f"{place}.{name} is not a list; expected a list of rows")
            found[name] = [unpacked(inner[0], each, f"{place}.{name}[{index}]") for index, each in enumerate(value)]
        else:
            found[name] = unpacked(inner, value, f"{place}.{name}")
    return found

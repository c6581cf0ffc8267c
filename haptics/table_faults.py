"""What is wrong with a table of a TOML file, in words.

Tables are checked by pydantic, whose messages speak of inputs and arguments. Here each becomes one line that names the key, its
value and the table as the file writes them, with the keys or values that there are.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from haptics.errors import InputError
from haptics.toml_lines import lines_of
from haptics.units import brief, nearest

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")
_EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "text in quotes",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dataclass_type": "a table",
}
_UNITS = {
    "s": "s",
    "m": "m",
    "m2": "m²",
    "hz": "Hz",
    "v": "V",
    "a": "A",
    "c": "C",
    "w": "W",
    "k": "K",
    "k_per_w": "K/W",
    "n_v2": "N/V²",
    "n": "N",
    "deg": "deg",
}
"""By the ending of a key."""
_BOUNDS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")


def read_toml(text: str, place: str) -> dict[str, Any]:
    """The tables of a TOML file.

    :param text: the file's.
    :param place: what to call the file in messages.
    :return: plain data.
    :raises InputError: not TOML; with the line, what stands there and how it would be right.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.match(r"(.*) \(at line (\d+), column (\d+)\)", str(error))
        lines = text.splitlines()
        message, line, column = found.groups() if found else (str(error), str(len(lines)), "the end")
        at = int(line) - 1
        seen = brief(lines[at].strip()) if 0 <= at < len(lines) else "the end of the file"
        raise InputError(
            f"{place}:{line}: {seen} is not TOML (column {column}: {message[:1].lower()}{message[1:]}); "
            'expected key = value, with text in "quotes", or a [table]'
        ) from error


def faults_in_words(error: ValidationError, schema: Mapping[str, Any], data: object, place: str, text: str | None = None) -> str:
    """Every fault of a file, each on a line of its own: file, line, and what is wrong.

    :param error: of pydantic.
    :param schema: JSON schema of the whole file.
    :param data: the file's content as plain data.
    :param place: what to call the file.
    :param text: of the file; None where the data is no file's: no lines then.
    :return: the lines.
    """
    lines: list[tuple[int, str]] = []
    for fault in error.errors(include_url=False):
        line = 0 if text is None else line_of(text, (*fault["loc"], *_named_in(fault)))
        where = place if text is None else f"{place}:{line}"
        lines.append((line, f"{where}: {fault_in_words(fault, schema, data)}"))
    return "\n".join(said for _, said in sorted(lines, key=lambda one: one[0]))


def _named_in(fault: ErrorDetails) -> tuple[str, ...]:
    """The keys that a table's own check names at the begin of its message, such as ``calibration.index: ...``."""
    found = (
        re.match(r"Value error, ([a-z_]\w*(?:\.\w+)*)(?: = |: | is )", fault["msg"]) if fault["type"] == "value_error" else None
    )
    keys = () if found is None else tuple(found[1].split("."))
    return keys[1:] if fault["loc"] and keys[:1] == fault["loc"][-1:] else keys


def line_of(text: str, keys: tuple[int | str, ...]) -> int:
    """The line of a place such as ``("objects", 2, "shape")``, or of the innermost part of it that the file has.

    :param text: of the file, which is TOML.
    :param keys: names of tables and keys, and numbers of items, from the outside in; what the file has not, such as a kind that
        pydantic puts between, is passed by.
    :return: counted from 1.
    """
    lines, path, line = lines_of(text), (), 1
    for step in keys:
        if (*path, step) in lines:
            path = (*path, step)
            line = lines[path]
    return line


def fault_in_words(fault: ErrorDetails, schema: Mapping[str, Any], data: object) -> str:
    """One fault of a file, without the file's name.

    :param fault: an item of ``ValidationError.errors()``.
    :param schema: JSON schema of the whole file, with the keys and ranges that there are.
    :param data: the file's content as plain data.
    :return: such as ``unknown key 'colour' in [[objects]] 'ball'; known keys: name, shape``.
    """
    place = _place_of(fault, schema, data)
    kind, key, table = fault["type"], place.key, place.table
    inside = f" in {table}" if table else ""
    if kind in _UNKNOWN_KEY:
        return f"unknown key {key!r}{inside}; {_known('known keys', key, place.keys)}"
    if kind == "missing" and place.in_list:
        return f"{key} = {brief(fault['input'])}{inside} has {len(fault['input'])} values; expected {place.schema['minItems']}"
    if kind == "missing":
        return f"key {key!r} is missing{inside}; it is required"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        where, by, kinds = place.name_of_itself, *_kinds(place.schema)
        if kind == "union_tag_not_found":
            return f"key {by!r} is missing in {where}; known kinds: {', '.join(kinds)}"
        tag = str(fault.get("ctx", {}).get("tag", ""))
        return f"{by} = {tag!r} in {where} is not known; {_known('known kinds', tag, kinds)}"
    if kind == "value_error":
        said = fault["msg"].removeprefix("Value error, ")
        if said.startswith((f"{key} = ", f"{key}.")):
            return f"{table}: {said}" if table else said
        where = place.name_of_itself if isinstance(fault["input"], dict) else f"{key}{inside}"
        return f"{where}: {said}"
    unit = unit_of(key)
    seen = f"{key or 'the file'} = {brief(fault['input'])}{unit if kind in _BOUNDS else ''}{inside}"
    if kind == "literal_error":
        return f"{seen}; {_known('allowed', fault['input'], place.schema.get('enum', ()))}"
    if kind in _BOUNDS:
        return f"{seen}; {_range(place.schema)}{unit}"
    if kind in ("too_long", "too_short") and "minItems" in place.schema:
        return f"{seen} has {len(fault['input'])} values; expected {place.schema['minItems']}"
    if kind == "string_pattern_mismatch":
        return f"{seen}; expected {place.schema.get('description') or 'text of the form ' + place.schema['pattern']}"
    if kind == "string_too_short":
        return f"{seen}; expected some text"
    expected = _EXPECTED.get(kind)
    return f"{seen}; expected {expected}" if expected else f"{seen}: {fault['msg']}"


@dataclass
class _Place:
    """Where a fault is: the steps that led there, and the schema of what is there."""

    root: Mapping[str, Any]
    data: object
    schema: Mapping[str, Any]
    steps: list[str | int] = field(default_factory=list)
    keys: tuple[str, ...] = ()
    """Keys of the table that the last step is in."""
    in_list: bool = False
    """Whether the last step is an item that is missing from a list."""

    @property
    def key(self) -> str:
        """The last key, with the numbers of items after it."""
        at = len(self.steps) - next((n for n, step in enumerate(reversed(self.steps)) if isinstance(step, str)), 0) - 1
        return _joined(self.steps[max(at, 0) :])

    @property
    def table(self) -> str:
        """What the last key is in, as the file writes it; empty for the file itself."""
        last = max((n for n, step in enumerate(self.steps) if isinstance(step, str)), default=0)
        return self._named(self.steps[:last])

    @property
    def name_of_itself(self) -> str:
        """The whole place, as the file writes it."""
        return self._named(self.steps) or "the file"

    def _named(self, steps: list[str | int]) -> str:
        """``[tactiles.calibration]``, ``[[objects]] 'ball'`` or ``effects[0] of [[objects]] 'ball'``."""
        if len(steps) < 2 or not isinstance(steps[1], int):
            return f"[{_joined(steps)}]" if steps else ""
        item = self.data[steps[0]][steps[1]]  # type: ignore[index]  # the steps lead through the data
        name = item.get("name") if isinstance(item, dict) else None
        header = f"[[{steps[0]}]] {name!r}" if isinstance(name, str) else f"[[{steps[0]}]] number {steps[1] + 1}"
        inner = _joined(steps[2:])
        return f"{inner} of {header}" if inner else header


def _place_of(fault: ErrorDetails, schema: Mapping[str, Any], data: object) -> _Place:
    """Follow a fault's location through schema and data; pydantic puts the kind of a table between its steps."""
    place, value = _Place(schema, data, schema), data
    for step in fault["loc"]:
        here = _resolved(place.root, place.schema, value)
        if "discriminator" in here:
            place.schema = {"$ref": here["discriminator"]["mapping"].get(step, "")}
            continue
        place.keys = tuple(here.get("properties", ()))
        if isinstance(step, int) and isinstance(value, list) and step >= len(value):
            place.schema, place.in_list = here, True
            return place
        place.steps.append(step)
        if isinstance(step, int):
            prefix = here.get("prefixItems", ())
            place.schema = prefix[step] if step < len(prefix) else here.get("items", {})
            value = value[step] if isinstance(value, list) else None
        else:
            place.schema = here.get("properties", {}).get(step, here.get("additionalProperties") or {})
            value = value.get(step) if isinstance(value, dict) else None
    place.schema = _resolved(place.root, place.schema, value)
    return place


def _resolved(root: Mapping[str, Any], schema: Mapping[str, Any], value: object) -> Mapping[str, Any]:
    """A schema without references and without the choice of nothing at all."""
    while True:
        if "$ref" in schema:
            schema = {**root.get("$defs", {}).get(schema["$ref"].rpartition("/")[2], {}), **_beside(schema, "$ref")}
        elif "anyOf" in schema:
            chosen = next(one for one in schema["anyOf"] if value is None or one.get("type") != "null")
            schema = {**chosen, **_beside(schema, "anyOf")}
        else:
            return schema


def _beside(schema: Mapping[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in schema.items() if key not in (name, "title")}


def _kinds(schema: Mapping[str, Any]) -> tuple[str, list[str]]:
    """The key that decides which of several tables this is, and its values."""
    chooser = schema.get("discriminator", {})
    return chooser.get("propertyName", "kind"), list(chooser.get("mapping", ()))


def _known(what: str, given: object, names: Iterable[str]) -> str:
    names = [str(name) for name in names]
    return f"{what}: {', '.join(names)}{nearest(given, names)}"


def unit_of(key: str) -> str:
    """A key's unit, by its ending.

    :param key: as the file has it.
    :return: such as `` V``, with a space before it; nothing for a pure number.
    """
    stem = key.partition("[")[0]
    endings = [ending for ending in _UNITS if stem.endswith(f"_{ending}")]
    return f" {_UNITS[max(endings, key=len)]}" if endings else ""


def _range(schema: Mapping[str, Any]) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    if low is not None and high is not None:
        return f"allowed {low:g} to {high:g}"
    for key, words in (
        ("minimum", "at least"),
        ("maximum", "at most"),
        ("exclusiveMinimum", "above"),
        ("exclusiveMaximum", "below"),
    ):
        if key in schema:
            return f"allowed {words} {schema[key]:g}"
    return "it is out of range"


def _joined(steps: Iterable[str | int]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).lstrip(".")

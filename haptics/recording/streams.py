"""What a stream of rows is: a name, the fields of a row, their units.

A row type is a packed little-endian numpy structure whose first field is ``time_ns`` (int64, the host's clock). Other
fields are numbers, fixed-length byte strings (``S``) or opaque bytes (``V``), single or as fixed-shape arrays, so that
every row has the same length and a journal segment is the rows' own bytes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from haptics.errors import InputError

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_KINDS = "biufSV"
_MAX_AXES = 16
_WORDS = {"b": "boolean", "i": "integer", "u": "unsigned integer", "f": "float", "S": "text", "V": "bytes"}
BLOB_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,254}")
"""What an attachment may be called."""
RESERVED = ("provenance", "attachments", "title")
"""Names that a recording's own groups use."""


@dataclass(frozen=True)
class StreamSpec:
    """One stream.

    :param name: lower-case letters, digits and ``_``, beginning with a letter; none of ``RESERVED``.
    :param dtype: type of a row, its first field ``time_ns`` (int64, ns); made packed and little-endian.
    :param units: by field; fields without a unit left out. ``time_ns`` is added.
    :param description: a sentence on what it holds, under 1000 characters.
    :raises InputError: a name, field, unit or description that cannot be recorded.
    """

    name: str
    dtype: np.dtype[np.void]
    units: Mapping[str, str] = field(default_factory=dict)
    description: str = ""

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name) or self.name in RESERVED:
            raise InputError(
                f"stream name = {self.name!r}; expected lower-case letters, digits and _, but not {', '.join(RESERVED)}"
            )
        object.__setattr__(self, "dtype", _packed(self.name, np.dtype(self.dtype)))
        unknown = sorted(set(self.units) - set(self.fields))
        if unknown:
            raise InputError(f"stream {self.name}: units for {', '.join(unknown)}; its fields are {', '.join(self.fields)}")
        object.__setattr__(self, "units", {"time_ns": "ns", **self.units})
        for what, text in (("description", self.description), *((f"unit of {name}", unit) for name, unit in self.units.items())):
            if not fits_attribute(text):
                raise InputError(f"stream {self.name}: {what} = {repr(text)[:60]}; expected text of fewer than 1000 characters")

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields, in the row's order."""
        return self.dtype.names or ()

    def as_json(self) -> dict[str, Any]:
        """The stream as plain data; :meth:`from_json` is its inverse.

        :return: ``name``, ``fields`` (name, numpy type, shape), ``units``, ``description``.
        """
        fields = []
        for name in self.fields:
            base, shape = field_type(self.dtype, name)
            fields.append([name, base.str, list(shape)])
        return {"name": self.name, "fields": fields, "units": dict(self.units), "description": self.description}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> StreamSpec:
        """The stream that :meth:`as_json` described.

        :param data: what it returned; keys that it does not have are ignored.
        :return: the stream.
        :raises InputError: a name, field, unit or description that cannot be recorded.
        :raises KeyError: a part is missing.
        :raises TypeError: a field is not a name, a type that numpy knows, and a shape.
        :raises ValueError: a field is given twice, or is none of these three.
        """
        row = np.dtype([(name, code, tuple(shape)) for name, code, shape in data["fields"]])
        return cls(data["name"], row, data["units"], data["description"])


def check_fields(where: str, spec: StreamSpec, wanted: Mapping[str, tuple[str, tuple[int, ...] | None]]) -> None:
    """Hold a stream that was read against what its reader counts on.

    :param where: the recording, for messages.
    :param spec: the stream as it was read.
    :param wanted: for each field the kinds of its element (numpy's letters) and its shape, or None for a number or a row of
        numbers.
    :raises InputError: a field is missing, or is another.
    """
    for name, (kinds, shape) in wanted.items():
        if name not in spec.fields:
            raise InputError(f"{where}: stream {spec.name} has no field {name}; it has {', '.join(spec.fields)}")
        base, found = field_type(spec.dtype, name)
        if base.kind not in kinds or (len(found) > 1 if shape is None else found != shape):
            want = f"{' or '.join(_WORDS[kind] for kind in kinds)}{'' if shape is None else list(shape)}"
            raise InputError(f"{where}: field {name} of stream {spec.name} has type {base}{list(found)}; expected {want}")


def fits_attribute(text: object) -> bool:
    """Whether HDF5 keeps this as the text of an attribute; all attributes of a part share 64 KiB.

    :param text: anything; only text fits.
    :return: whether it does.
    """
    return isinstance(text, str) and len(text) < 1000 and "\0" not in text and is_unicode(text)


def is_unicode(text: str) -> bool:
    """Whether text can be written as UTF-8; a path whose bytes are not UTF-8 cannot, as Python hands it over.

    :param text: any text.
    :return: whether it can.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def field_type(dtype: np.dtype[Any], name: str) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Element type and shape of a row's field.

    :param dtype: type of a row.
    :param name: of the field.
    :return: the type, and ``()`` or ``(n, ...)``.
    """
    fields: Any = dtype.fields
    whole = fields[name][0]
    return whole.base, whole.shape


def _packed(stream: str, dtype: np.dtype[Any]) -> np.dtype[np.void]:
    names = dtype.names or ()
    if not names or names[0] != "time_ns" or field_type(dtype, "time_ns") != (np.dtype(np.int64), ()):
        raise InputError(f"stream {stream}: fields = {names or dtype}; the first has to be time_ns of type int64")
    columns = []
    for name in names:
        base, shape = field_type(dtype, name)
        if not _NAME.fullmatch(name):
            raise InputError(f"stream {stream}: field = {name!r}; expected lower-case letters, digits and _")
        if base.kind not in _KINDS or base.names or not base.itemsize or 0 in shape or len(shape) > _MAX_AXES:
            raise InputError(
                f"stream {stream}: field {name} has type {base}{list(shape)}; expected integers, floats, booleans, "
                f"fixed-length bytes (S16, V64), and fixed arrays of these, of up to {_MAX_AXES} axes"
            )
        columns.append((name, base.newbyteorder("<"), shape))
    return np.dtype(columns)

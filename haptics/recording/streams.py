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
RESERVED = ("provenance", "attachments", "title")
"""Names that a recording's own groups use."""


@dataclass(frozen=True)
class StreamSpec:
    """One stream: ``name``, row type, ``units`` by field (fields without a unit left out), a sentence on what it holds.

    :raises InputError: a name, field or unit that cannot be recorded.
    """

    name: str
    dtype: np.dtype[np.void]
    units: Mapping[str, str] = field(default_factory=dict)
    description: str = ""

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name) or self.name in RESERVED:
            raise InputError(
                f"stream name = {self.name!r} is not allowed; allowed: lower-case letters, digits and _, "
                f"but not {', '.join(RESERVED)}"
            )
        object.__setattr__(self, "dtype", _packed(self.name, np.dtype(self.dtype)))
        unknown = sorted(set(self.units) - set(self.fields))
        if unknown:
            raise InputError(f"stream {self.name}: units for {', '.join(unknown)}; its fields are {', '.join(self.fields)}")
        object.__setattr__(self, "units", {"time_ns": "ns", **self.units})

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields, in the row's order."""
        return self.dtype.names or ()

    def as_json(self) -> dict[str, Any]:
        """The stream as plain data; :meth:`from_json` is its inverse."""
        fields = []
        for name in self.fields:
            base, shape = field_type(self.dtype, name)
            fields.append([name, base.str, list(shape)])
        return {"name": self.name, "fields": fields, "units": dict(self.units), "description": self.description}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> StreamSpec:
        """The stream that :meth:`as_json` described."""
        row = np.dtype([(name, code, tuple(shape)) for name, code, shape in data["fields"]])
        return cls(data["name"], row, data["units"], data["description"])


def field_type(dtype: np.dtype[Any], name: str) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Element type and shape ``()`` or ``(n, ...)`` of a row's field."""
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
            raise InputError(f"stream {stream}: field = {name!r}; allowed: lower-case letters, digits and _")
        if base.kind not in _KINDS or base.names or not base.itemsize or 0 in shape:
            raise InputError(
                f"stream {stream}: field {name} has type {base}{list(shape)}; allowed: integers, floats, booleans, "
                "fixed-length bytes (S16, V64), and fixed arrays of these"
            )
        columns.append((name, base.newbyteorder("<"), shape))
    return np.dtype(columns)

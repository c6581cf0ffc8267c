"""Parameters that know their unit, where they come from, and what values make sense.

A parameter set is a frozen dataclass derived from ``Parameters`` whose fields are made by ``parameter``:

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Spring(Parameters):
...     stiffness_n_m: float = parameter(400.0, "N/m", "assumed", "a soft spring", low=0.0)
>>> Spring().stiffness_n_m
400.0
>>> [row.name for row in provenance(Spring())]
['stiffness_n_m']
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, Self

from haptics.errors import InputError
from haptics.units import in_range

Provenance = Literal["stated", "derived", "identified", "assumed"]
"""stated: a source gives it. derived: arithmetic from stated numbers. identified: fitted or solved for by a model.
assumed: nobody measured it."""


@dataclass(frozen=True)
class ParameterRow:
    """One parameter of a set: its value now, and what is known of it.

    :param name: field of the set.
    :param value: in ``unit``.
    :param unit: SI symbol; "1" for a pure number.
    :param provenance: how it is known, see ``Provenance``.
    :param source: thesis section, or what was assumed.
    :param low: minimum value allowed.
    :param high: maximum value allowed.
    """

    name: str
    value: float
    unit: str
    provenance: Provenance
    source: str
    low: float
    high: float


def parameter(
    default: float,
    unit: str,
    provenance: Provenance,
    source: str,
    low: float = -math.inf,
    high: float = math.inf,
) -> Any:
    """A dataclass field that carries unit, provenance, source and allowed range (both ends included).

    :param default: value in ``unit``.
    :param unit: SI symbol; "1" for a pure number.
    :param provenance: stated, derived, identified or assumed.
    :param source: thesis section, or what was assumed.
    :param low: minimum value allowed; none by default.
    :param high: maximum value allowed; none by default.
    :return: a ``dataclasses.field``, typed as anything so that it stands for a float.
    """
    return field(default=default, metadata={"parameter": (unit, provenance, source, low, high)})


@dataclass(frozen=True)
class Parameters:
    """Base of every parameter set: checks each field's range when made.

    :raises InputError: a value outside its field's range.
    """

    def __post_init__(self) -> None:
        for row in provenance(self):
            in_range(row.name, row.value, row.low, row.high, row.unit)

    def with_values(self, **values: float) -> Self:
        """A copy with some values changed.

        :param values: new values by field name, in the field's unit.
        :return: a new set of the same class.
        :raises InputError: an unknown name, or a value outside its range.
        """
        known = {f.name for f in fields(self)}
        for name in values:
            if name not in known:
                raise InputError(f"parameter {name!r} is unknown to {type(self).__name__}; known: {', '.join(sorted(known))}")
        return replace(self, **values)


def provenance(parameters: Parameters) -> list[ParameterRow]:
    """One row for each field of ``parameters`` that was declared by ``parameter``, in order.

    :param parameters: any parameter set.
    :return: rows in the order of the fields; fields made otherwise are left out.
    """
    rows: list[ParameterRow] = []
    for f in fields(parameters):
        if "parameter" in f.metadata:
            unit, kind, source, low, high = f.metadata["parameter"]
            rows.append(ParameterRow(f.name, getattr(parameters, f.name), unit, kind, source, low, high))
    return rows

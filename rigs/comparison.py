"""Published beside measured: one row for each number, with a verdict and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from rigs.reference import Published, contradictions_of, published
from rigs.result import Quantity

Verdict = Literal["agrees", "differs", "not identifiable", "contradiction in the source"]


@dataclass(frozen=True)
class Row:
    """One published number against ours. ``ours`` None: nothing here measures it. ``tolerance`` None: none was stated or assumed.

    ``role`` calibration: the shipped plants were set by this number, so that agreeing proves nothing but that they were.
    """

    name: str
    quantity: str
    section: str
    published: float | None
    relation: str
    tolerance: float | None
    ours: float | None
    uncertainty: float | None
    unit: str
    role: str
    verdict: Verdict
    why: str

    @property
    def fails(self) -> bool:
        """A validation row that differs, and no contradiction in the source explains it."""
        return self.role == "validation" and self.verdict == "differs"

    def cells(self) -> tuple[Any, ...]:
        """As shown in a table."""
        relation = "" if self.relation == "=" else f"{self.relation} "
        tolerance = f" ± {self.tolerance:.3g}" if self.tolerance else ""
        said = "–" if self.published is None else f"{relation}{self.published:.4g}{tolerance}"
        ours = "–" if self.ours is None else f"{self.ours:.4g} ± {self.uncertainty or 0.0:.2g}"
        return self.quantity, self.section, said, ours, self.unit, self.role, self.verdict, self.why

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "name": self.name,
            "quantity": self.quantity,
            "section": self.section,
            "published": self.published,
            "relation": self.relation,
            "tolerance": self.tolerance,
            "ours": self.ours,
            "uncertainty": self.uncertainty,
            "unit": self.unit,
            "role": self.role,
            "verdict": self.verdict,
            "why": self.why,
        }


def compare(wanted: Mapping[str, str], quantities: Mapping[str, Quantity]) -> Iterator[Row]:
    """A row for each pair of a quantity's name and the number of the reference that it answers."""
    for name, number in wanted.items():
        if name in quantities:
            yield compared(name, published(number), quantities[name])


def compared(name: str, source: Published, ours: Quantity, why: str = "") -> Row:
    """Ours against one published number."""
    row = replace(not_met(name, source, why), ours=ours.value, uncertainty=ours.sd, unit=ours.unit)
    if source.compare(ours.value, ours.sd) == "agrees":
        return replace(row, verdict="agrees")
    found = contradictions_of(source.id)
    if found:
        return replace(row, verdict="contradiction in the source", why=why or "; ".join(one.follows for one in found))
    return replace(row, verdict="differs", why=why or f"off by {ours.value - source.value:+.3g} {ours.unit}")


def not_met(name: str, source: Published, why: str) -> Row:
    """A published number that nothing here answers, and why."""
    return Row(
        name=name,
        quantity=source.quantity,
        section=source.section,
        published=source.value,
        relation=source.relation,
        tolerance=source.tolerance,
        ours=None,
        uncertainty=None,
        unit=source.unit,
        role=source.role,
        verdict="not identifiable",
        why=why,
    )

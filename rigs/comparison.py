"""Published beside measured: one row for each number, with a verdict and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from haptics.units import one_of
from rigs.reference import contradictions_of, curve, published
from rigs.result import Answer, Quantity

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


def compare(wanted: Mapping[str, Answer], quantities: Mapping[str, Quantity]) -> Iterator[Row]:
    """A row for each quantity that answers a published number.

    :raises InputError: an id that the reference does not have.
    """
    for name, answer in wanted.items():
        if name in quantities:
            yield compared(name, answer, quantities[name])


def compared(name: str, answer: Answer, ours: Quantity, why: str = "") -> Row:
    """Ours against one published number; ``why`` says where ours comes from.

    :raises InputError: an id or a point that the reference does not have, or a contradiction that is not about it.
    """
    row = replace(not_met(name, answer, why), ours=ours.value, uncertainty=ours.sd, unit=ours.unit)
    if answer.at is None:
        verdict = published(answer.published).compare(ours.value, ours.sd)
    else:
        verdict = curve(answer.published).compare(answer.at, ours.value, ours.sd)
    if verdict == "agrees":
        return replace(row, verdict="agrees")
    if answer.contradiction is not None:
        about = {one.id: one for one in contradictions_of(answer.published)}
        one_of("contradiction", answer.contradiction, tuple(about))
        return replace(row, verdict="contradiction in the source", why=about[answer.contradiction].follows)
    off = ours.value - (row.published or 0.0)
    return replace(row, verdict="differs", why=why or f"off by {off:+.3g} {ours.unit}")


def not_met(name: str, answer: Answer, why: str) -> Row:
    """A published number that nothing here answers, and why.

    :raises InputError: an id or a point that the reference does not have.
    """
    if answer.at is None:
        source = published(answer.published)
        quantity, value, tolerance, relation = source.quantity, source.value, source.tolerance, source.relation
    else:
        source = curve(answer.published)
        point = source.at(answer.at)
        quantity, value, tolerance, relation = (
            f"{source.quantity} at {answer.at:g} {source.x_unit}",
            point.y,
            point.tolerance,
            "=",
        )
    return Row(
        name=name,
        quantity=quantity,
        section=source.section,
        published=value,
        relation=relation,
        tolerance=tolerance,
        ours=None,
        uncertainty=None,
        unit=source.unit,
        role=source.role,
        verdict="not identifiable",
        why=why,
    )

"""Published beside measured: one row for each number, with a verdict and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from haptics.units import one_of
from rigs.reference import contradictions_of, curve, published
from rigs.result import Answer, Quantity, readable

Verdict = Literal["agrees", "differs", "not identifiable", "contradiction in the source"]


@dataclass(frozen=True)
class Row:
    """One published number beside ours.

    :param name: of the quantity here.
    :param quantity: what it is, as the reference words it.
    :param section: of the thesis.
    :param published: value, in ``unit``.
    :param relation: ``=``, ``about``, ``<``, ``<=``, ``>`` or ``>=``.
    :param tolerance: of the published value, in ``unit``; None where none was stated or assumed.
    :param ours: measured or computed value, in ``unit``; None where nothing here measures it.
    :param uncertainty: its standard deviation, in ``unit``; None with ``ours``.
    :param unit: SI, or as printed.
    :param role: ``validation``, or ``calibration`` where the shipped plants were set by this number, so that agreement proves
        nothing.
    :param verdict: of the comparison.
    :param why: reason for the verdict, or where ours comes from; may be empty where it agrees.
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
        """As shown in a table.

        :return: quantity, section, published, ours, role, verdict, why.
        """
        relation = "" if self.relation == "=" else f"{self.relation} "
        tolerance = f" ± {readable(self.tolerance, self.unit, 3)}" if self.tolerance else ""
        published = "–" if self.published is None else f"{relation}{readable(self.published, self.unit)}{tolerance}"
        uncertainty = f" ± {readable(self.uncertainty, self.unit, 2)}" if self.uncertainty else ""
        ours = f"{readable(self.ours, self.unit)}{uncertainty}"
        return self.quantity, self.section, published, ours, self.role, self.verdict, self.why

    def to_json(self) -> dict[str, Any]:
        """Plain data.

        :return: every field by name; null for None.
        """
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

    :param wanted: which published number each quantity answers, by the quantity's name.
    :param quantities: measured ones, by name.
    :return: rows in the order of ``wanted``; quantities that were not measured are left out.
    :raises InputError: an id that the reference does not have.
    """
    for name, answer in wanted.items():
        if name in quantities:
            yield compared(name, answer, quantities[name])


def compared(name: str, answer: Answer, ours: Quantity, why: str = "") -> Row:
    """Ours against one published number; ``why`` states where ours comes from.

    :param name: of the quantity.
    :param answer: the published number it answers.
    :param ours: value, standard deviation and unit.
    :param why: where ours comes from.
    :return: the row, with its verdict.
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

    :param name: of the quantity.
    :param answer: the published number.
    :param why: reason that nothing answers it.
    :return: the row, ``ours`` None and verdict ``not identifiable``.
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

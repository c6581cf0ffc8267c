"""A published number, a published curve, a place where the source contradicts itself; and when a result agrees with one.

The rule, for a result ``r`` of standard deviation ``sd`` against a published value ``p``:

- *stated* tolerance ``t`` (the source's ± or SD): agrees if ``|r - p| <= 2 sqrt(t^2/n + sd^2)``. The source never states what
  its ± is; it is read as one standard deviation (assumed). ``n`` is ``sample_size``, the persons or pieces whose scatter ``t``
  is, where ``p`` is their mean; 1 where ``t`` is of the value itself.
- *assumed* tolerance ``t`` (half of the last digit printed, a setting): a half-width, agrees if
  ``|r - p| <= sqrt(t^2 + (2 sd)^2)``.
- *bound*: agrees unless ``r`` lies beyond it by more than ``sqrt(t^2 + (2 sd)^2)``, ``t`` being the rounding of the printed
  bound.

Two standard deviations let 5 % of true results differ, so among forty comparisons two are to be expected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from haptics.errors import InputError
from haptics.units import in_range

Verdict = Literal["agrees", "differs"]
RELATIONS = ("=", "about", "<", "<=", ">", ">=")
"""How the source states a value. ``about`` is compared as ``=`` within its tolerance."""
TOLERANCE_KINDS = ("stated", "assumed", "bound")
SURE = ("stated", "table", "caption", "derived")
"""How sure a value is: in the text, in a table, in the caption of a figure, or arithmetic from stated values."""
ROLES = ("calibration", "validation")
"""``calibration``: the shipped plants hold this number or were fitted or solved from it, so agreeing with it proves nothing."""


def half_width(tolerance: float, tolerance_kind: str, sd: float = 0.0, sample_size: int = 1) -> float:
    """How far a result may lie from a published value, or beyond a bound, and still agree. See the module for the rule.

    :param tolerance: of the published value, >= 0, in its unit.
    :param tolerance_kind: one of ``TOLERANCE_KINDS``.
    :param sd: standard deviation of the result, >= 0, in the value's unit.
    :param sample_size: persons or pieces behind a mean, >= 1.
    :return: maximum difference that agrees, in the value's unit.
    :raises InputError: ``sd`` negative or not finite.
    """
    in_range("sd", sd, 0.0, math.inf)
    own = 2.0 * tolerance / math.sqrt(sample_size) if tolerance_kind == "stated" else tolerance
    return math.hypot(own, 2.0 * sd)


@dataclass(frozen=True, slots=True)
class Published:
    """One published number.

    :param id: such as ``thermal_tau``.
    :param quantity: what it is, in words.
    :param value: in ``unit``.
    :param unit: SI, or as printed where it is %, 1/min, K/W or g (standard gravity, never gram).
    :param relation: how the source states the value, one of ``RELATIONS``.
    :param tolerance: in ``unit``; 0 for a bound without one.
    :param tolerance_kind: one of ``TOLERANCE_KINDS``.
    :param tolerance_reason: where an assumed tolerance comes from; empty otherwise.
    :param sample_size: persons or pieces behind a mean, else 1.
    :param section: of the thesis.
    :param place: table or figure; empty for running text.
    :param sure: one of ``SURE``.
    :param written: words and number of the source; empty for a derived value.
    :param role: one of ``ROLES``.
    :param used_by: what in the project holds the number or was found from it, as ``module:NAME.attribute``.
    :param note: for readers; may be empty.
    :param file: that holds it.
    """

    id: str
    quantity: str
    value: float
    unit: str
    relation: str
    tolerance: float
    tolerance_kind: str
    tolerance_reason: str
    sample_size: int
    section: str
    place: str
    sure: str
    written: str
    role: str
    used_by: tuple[str, ...]
    note: str
    file: str

    def allowed(self, sd: float = 0.0) -> float:
        """How far a result of standard deviation ``sd`` may lie off, or beyond the bound (``unit``).

        :param sd: standard deviation of the result, >= 0, in ``unit``.
        :return: maximum difference that agrees, in ``unit``.
        :raises InputError: ``sd`` negative or not finite.
        """
        return half_width(self.tolerance, self.tolerance_kind, sd, self.sample_size)

    def compare(self, ours: float, sd: float = 0.0) -> Verdict:
        """Whether our result agrees with the published one, by the rule of this module.

        :param ours: in ``unit``.
        :param sd: its standard deviation, >= 0.
        :return: ``agrees`` or ``differs``.
        :raises InputError: a number that is not finite, or a negative ``sd``.
        """
        off = in_range("ours", ours, -math.inf, math.inf, self.unit) - self.value
        allowed = self.allowed(sd)
        if self.relation in ("=", "about"):
            return "agrees" if abs(off) <= allowed else "differs"
        beyond = off if self.relation.startswith("<") else -off
        if self.relation.endswith("=") or allowed > 0.0:
            return "agrees" if beyond <= allowed else "differs"
        return "agrees" if beyond < 0.0 else "differs"


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """One point of a curve.

    :param x: abscissa, in the curve's ``x_unit``; None for a curve over categories.
    :param label: category; empty for a numbered point.
    :param y: value, in the curve's ``unit``.
    :param tolerance: of ``y``, >= 0.
    """

    x: float | None
    label: str
    y: float
    tolerance: float


@dataclass(frozen=True, slots=True)
class Curve:
    """Published points of one quantity over another.

    :param id: such as ``force_index``.
    :param quantity: what it is, in words.
    :param unit: of the points' ``y``, as in ``Published``.
    :param x_quantity: what it is plotted over.
    :param x_unit: of the points' ``x``; empty for categories.
    :param tolerance_kind: ``stated`` or ``assumed``.
    :param tolerance_reason: where an assumed tolerance comes from; empty otherwise.
    :param sample_size: persons or pieces behind each mean, else 1.
    :param section: of the thesis.
    :param place: table or figure; empty for running text.
    :param sure: one of ``SURE``.
    :param written: words and numbers of the source.
    :param role: one of ``ROLES``.
    :param used_by: what in the project holds the curve, as ``module:NAME.attribute``.
    :param note: for readers; may be empty.
    :param points: in the source's order, at least one.
    :param file: that holds it.
    """

    id: str
    quantity: str
    unit: str
    x_quantity: str
    x_unit: str
    tolerance_kind: str
    tolerance_reason: str
    sample_size: int
    section: str
    place: str
    sure: str
    written: tuple[str, ...]
    role: str
    used_by: tuple[str, ...]
    note: str
    points: tuple[CurvePoint, ...]
    file: str

    def at(self, key: float | str) -> CurvePoint:
        """The point at an ``x``, or of a label.

        :param key: ``x`` of a numbered point, label of a category.
        :return: the point.
        :raises InputError: there is none; nothing is read in between.
        """
        for point in self.points:
            if key == (point.label if point.x is None else point.x):
                return point
        allowed = ", ".join(point.label if point.x is None else f"{point.x:g}" for point in self.points)
        raise InputError(f"curve {self.id!r} has no point at {key!r}; allowed: {allowed}")

    def compare(self, key: float | str, ours: float, sd: float = 0.0) -> Verdict:
        """Whether our result at a point agrees with the published one, by the rule of this module.

        :param key: ``x`` of a numbered point, label of a category.
        :param ours: in ``unit``.
        :param sd: its standard deviation, >= 0.
        :return: ``agrees`` or ``differs``.
        :raises InputError: an unknown point, a number that is not finite, or a negative ``sd``.
        """
        point = self.at(key)
        off = in_range("ours", ours, -math.inf, math.inf, self.unit) - point.y
        return "agrees" if abs(off) <= half_width(point.tolerance, self.tolerance_kind, sd, self.sample_size) else "differs"


@dataclass(frozen=True, slots=True)
class Passage:
    """What the source states in one place, in this project's words.

    :param section: of the thesis.
    :param says: the statement.
    """

    section: str
    says: str


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Where the source disagrees with itself.

    :param id: such as ``time_to_charge``.
    :param written: the two or more passages.
    :param follows: the arithmetic, in words.
    :param computed: its results by name, recomputed by a test.
    :param used_here: what the project takes.
    :param concerns: ids of the numbers and curves concerned.
    :param file: that holds it.
    """

    id: str
    written: tuple[Passage, ...]
    follows: str
    computed: Mapping[str, float]
    used_here: str
    concerns: tuple[str, ...]
    file: str

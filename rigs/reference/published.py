"""A published number, a published curve, a place where the source contradicts itself; and when a result agrees with one.

The rule, for a result ``r`` of standard deviation ``sd`` against a published value ``p``:

- *stated* tolerance ``t`` (the source's ± or SD): agrees if ``|r - p| <= 2 sqrt(t^2/n + sd^2)``. The source never says what
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
"""How the source puts a value. ``about`` is compared as ``=``: the tolerance says how near."""
TOLERANCE_KINDS = ("stated", "assumed", "bound")
SURE = ("stated", "table", "caption", "derived")
"""How sure a value is: in the text, in a table, in the caption of a figure, or arithmetic from stated values."""
ROLES = ("calibration", "validation")
"""``calibration``: the shipped plants hold this number or were fitted or solved from it, so agreeing with it proves nothing."""


def half_width(tolerance: float, tolerance_kind: str, sd: float = 0.0, sample_size: int = 1) -> float:
    """How far a result may lie from a published value, or beyond a bound, and still agree. See the module for the rule.

    :param sd: standard deviation of the result, >= 0, in the value's unit.
    :raises InputError: ``sd`` negative or not finite.
    """
    in_range("sd", sd, 0.0, math.inf)
    own = 2.0 * tolerance / math.sqrt(sample_size) if tolerance_kind == "stated" else tolerance
    return math.hypot(own, 2.0 * sd)


@dataclass(frozen=True, slots=True)
class Published:
    """One published number.

    ``value`` in ``unit``: SI, or as printed where the unit is %, 1/min, K/W or g (standard gravity, never gram). ``tolerance`` is
    0 for a bound without one. ``written``: the words and number of the source, empty for a derived value. ``place``: the table
    or figure. ``used_by``: what in the project holds the number or was found from it, as ``module:NAME.attribute``.
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

        :raises InputError: ``sd`` negative or not finite.
        """
        return half_width(self.tolerance, self.tolerance_kind, sd, self.sample_size)

    def compare(self, ours: float, sd: float = 0.0) -> Verdict:
        """Whether our result agrees with the published one, by the rule of this module.

        :param ours: in ``unit``. :param sd: its standard deviation, >= 0.
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
    """One point: at ``x``, or for a curve over categories ``label`` (and ``x`` None); ``y`` with its tolerance."""

    x: float | None
    label: str
    y: float
    tolerance: float


@dataclass(frozen=True, slots=True)
class Curve:
    """Published points of one quantity over another. ``x_unit`` is empty for categories; the rest as in ``Published``."""

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

        :raises InputError: there is none; nothing is read in between.
        """
        for point in self.points:
            if key == (point.label if point.x is None else point.x):
                return point
        allowed = ", ".join(point.label if point.x is None else f"{point.x:g}" for point in self.points)
        raise InputError(f"curve {self.id!r} has no point at {key!r}; allowed: {allowed}")

    def compare(self, key: float | str, ours: float, sd: float = 0.0) -> Verdict:
        """Whether our result at a point agrees with the published one, by the rule of this module.

        :raises InputError: no such point, a number that is not finite, or a negative ``sd``.
        """
        point = self.at(key)
        off = in_range("ours", ours, -math.inf, math.inf, self.unit) - point.y
        return "agrees" if abs(off) <= half_width(point.tolerance, self.tolerance_kind, sd, self.sample_size) else "differs"


@dataclass(frozen=True, slots=True)
class Passage:
    """What the source says, in our words, and in which section."""

    section: str
    says: str


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Where the source disagrees with itself.

    ``written``: the two or more passages. ``follows``: the arithmetic in words, ``computed`` its results, recomputed by a test.
    ``used_here``: what the project takes. ``concerns``: ids of the numbers and curves concerned.
    """

    id: str
    written: tuple[Passage, ...]
    follows: str
    computed: Mapping[str, float]
    used_here: str
    concerns: tuple[str, ...]
    file: str

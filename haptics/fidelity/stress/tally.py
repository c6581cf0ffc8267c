"""One extreme of one level: what was asked, what came of it, and the row it makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from haptics.errors import InputError


@dataclass(frozen=True, slots=True)
class StressRow:
    """One extreme of one level.

    :param model: latch, thermal or brake.
    :param level: of the model.
    :param extreme: what was tried, in words.
    :param tried: questions asked.
    :param refused: what the level would not answer, or reported that it does not answer for.
    :param worst: largest error.
    :param unit: of ``worst`` and ``bound``.
    :param bound: that errors must keep within.
    :param holds: whether they did, and nothing was answered that must be refused.
    :param limit: where the level ceases to be valid, in words; what broke comes first.
    """

    model: str
    level: str
    extreme: str
    tried: int
    refused: int
    worst: float
    unit: str
    bound: float
    holds: bool
    limit: str


@dataclass
class Tally:
    """Gathers the answers to one extreme.

    :param model: latch, thermal or brake.
    :param level: of the model.
    :param extreme: what is tried, in words.
    :param unit: of the errors.
    :param bound: that errors must keep within.
    :param limit: where the level ceases to be valid.
    :param tried: questions so far.
    :param refused: refusals so far.
    :param worst: largest error so far.
    :param broken: what went wrong so far, in words.
    """

    model: str
    level: str
    extreme: str
    unit: str
    bound: float
    limit: str = ""
    tried: int = 0
    refused: int = 0
    worst: float = 0.0
    broken: list[str] = field(default_factory=list)

    def ask(self, question: Callable[[], float | None], must_refuse: bool = False) -> None:
        """Count one question.

        :param question: gives its error; None or ``InputError`` for a refusal.
        :param must_refuse: True: any answer is wrong.
        """
        self.tried += 1
        try:
            error = question()
        except InputError:
            error = None
        if error is None:
            self.refused += 1
        elif must_refuse:
            self.broken.append("answered what it must refuse")
        elif not error <= self.bound:  # also NaN
            self.broken.append(f"off by {error:g} {self.unit}")
            self.worst = error
        else:
            self.worst = max(self.worst, error)

    def row(self) -> StressRow:
        """The result; what broke comes first in ``limit``.

        :return: the row of this extreme.
        """
        limit = "; ".join([*dict.fromkeys(self.broken), *([self.limit] if self.limit else [])])
        holds = not self.broken and self.tried > 0
        return StressRow(
            self.model, self.level, self.extreme, self.tried, self.refused, self.worst, self.unit, self.bound, holds, limit
        )  # fmt: skip

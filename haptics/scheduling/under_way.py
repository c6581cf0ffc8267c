"""A request that has no outcome yet: when it may start, how much of it has played, and how it ends."""

from __future__ import annotations

from haptics.scheduling.requests import Outcome, Request, Stroke
from haptics.time import seconds_to_ns

FOREVER_NS = 1 << 62
"""Later than anything that happens."""


class UnderWay:
    """A request that waits for its first unit, or a burst between two cycles.

    ``due_ns``: when its next unit may start. ``order``: smaller goes first. ``cycles``: units played. ``begun_ns``: when the
    first one started, None before. ``held_by``: what it last waited for.

    :param request: what was asked for.
    :param now_ns: when it was submitted (ns).
    :param serial: counts submissions; decides between equals.
    """

    __slots__ = ("begun_ns", "cycles", "due_ns", "held_by", "latest_ns", "lengths_ns", "order", "request", "units")

    def __init__(self, request: Request, now_ns: int, serial: int):
        self.request = request
        self.units: tuple[tuple[Stroke, ...], ...] = request.units
        self.lengths_ns = [sum(seconds_to_ns(stroke.duration_s) for stroke in unit) for unit in self.units]
        self.due_ns = max(request.start_ns, now_ns)
        self.latest_ns = FOREVER_NS if request.latest_ns is None else request.latest_ns
        self.order: tuple[int, ...] = (int(request.priority), 1, self.due_ns, serial)
        self.cycles = 0
        self.begun_ns: int | None = None
        self.held_by: str | None = None

    def played(self) -> Outcome:
        """It has played whole.

        :return: its outcome.
        """
        return Outcome(self.request, True, None, self.begun_ns, self.cycles, self.held_by)

    def cut(self, held_by: str) -> Outcome:
        """A burst ends after the cycles that have played.

        :param held_by: what ended it.
        :return: its outcome.
        """
        return Outcome(self.request, True, "cut", self.begun_ns, self.cycles, held_by)

    def denied(self, reason: str, held_by: str | None = None) -> Outcome:
        """Nothing of it plays.

        :param reason: why; see ``Outcome.reason``.
        :param held_by: what it last waited for, if anything.
        :return: its outcome.
        """
        return Outcome(self.request, False, reason, None, 0, held_by)
